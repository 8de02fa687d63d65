// How trunk, head and arms are held in what is shown, each person in an own way. The server's world/output/posture.py,
// for one person.

import { multiply } from "../core/quaternions.js";
import { habitNumbers } from "./random.js";
import { bounded } from "./steering.js";

const DEGREE = Math.PI / 180, TURN = 88;
const UPRIGHT = [-1.5, 1.5], LEVEL = [-13, -3], ASIDE = [-1, 10], ELBOWS = [0, 22], TURNED = [-3, 16]; // degrees
const FOLLOW = 1 / (0.4 * 40); // share by which the remembered lean and pitch follow in a frame
const TRUNK_SHARE = 0.85, TRUNK_MOST = 5 * DEGREE, HEAD_SHARE = 0.6, HEAD_MOST = 15 * DEGREE;
const CALMING = 1 / (1.2 * 40), LEAVING = 1 / (0.6 * 40), HANGING = -4 * DEGREE, HANGING_MOST = 45 * DEGREE;
const HANGING_ASIDE = 3 * DEGREE, RELAXED = [0, -4 * DEGREE, 6 * DEGREE], PALM = [-2, -14, -7].map((n) => n * DEGREE);
const SWING = [0.5, 1.8], SWING_MOST = 20 * DEGREE, UNEVEN = 5 * DEGREE, HANDS = [20, 14];
const TRUNK = [0, 3, 6, 9], SPINE = 3, NECK = 12, HEAD = 15;
const SHOULDERS = [16, 17], ELBOW_JOINTS = [18, 19], WRISTS = [20, 21];
const SIDES = [-1, 1];

/** @param {bigint} seed */
export function habitsOf(seed) {
  const [swing, aside, elbows, turned, about, bent, lean, level, ...uneven] = habitNumbers(seed, 12);
  const between = (/** @type {number[]} */ [low, high], /** @type {number} */ share) => low + (high - low) * share;
  const more = uneven.map((n) => (2 * n - 1) * UNEVEN);
  return {
    swing: between(SWING, swing),
    aside: [0, 1].map((k) => between(ASIDE, aside) * DEGREE + more[k] / 2),
    elbows: [0, 1].map((k) => Math.max(between(ELBOWS, elbows) * DEGREE + more[2 + k], 0)),
    turned: between(TURNED, turned) * DEGREE,
    hands: [about, bent].map((n, k) => between([-HANDS[k], HANDS[k]], n) * DEGREE),
    lean: between(UPRIGHT, lean) * DEGREE,
    level: between(LEVEL, level) * DEGREE,
  };
}

const chest = new Float64Array(4), turn = new Float64Array(4);

/** Radians that chest and head look up in the frame at `at`. @param {Float64Array} rotations @param {number} at */
export function looks(rotations, at = 0) {
  chest.set(rotations.subarray(at, at + 4));
  for (const joint of TRUNK.slice(1)) multiply(chest, 0, rotations, at + 4 * joint, chest, 0);
  const lean = pitch(chest);
  multiply(chest, 0, rotations, at + 4 * NECK, chest, 0);
  multiply(chest, 0, rotations, at + 4 * HEAD, chest, 0);
  return { lean, pitch: pitch(chest) };
}

/**
 * How far somebody is at rest in each frame of a chunk, eased, and at its end; `before` that at its start.
 * @param {number} before @param {boolean} rests @param {number} frames
 */
export function calmed(before, rests, frames) {
  let share = before;
  const shares = Float64Array.from({ length: frames }, () => {
    share = bounded(share + (rests ? CALMING : -LEAVING), 0, 1);
    return share * share * (3 - 2 * share);
  });
  return { shares, share };
}

/**
 * Hold the frames of a chunk so, in place. `before`: how chest and head have looked for the last steps; so does the
 * result. `rest`: how far the person is at rest in each frame.
 * @param {ReturnType<typeof looks>} before @param {Float64Array} rotations @param {ReturnType<typeof habitsOf>} own
 * @param {Float64Array} rest
 */
export function hold(before, rotations, own, rest) {
  let { lean, pitch } = before;
  for (let at = 0; at < rotations.length; at += TURN) {
    const now = looks(rotations, at);
    lean += FOLLOW * (now.lean - lean);
    pitch += FOLLOW * (now.pitch - pitch);
    const back = bounded(TRUNK_SHARE * (-lean - own.lean), 0, TRUNK_MOST);
    const up = bounded(HEAD_SHARE * (own.level - pitch - back), -HEAD_MOST, HEAD_MOST);
    for (const [joint, angle] of [[SPINE, back], [NECK, up / 2], [HEAD, up / 2]]) {
      turn.set([Math.sin(angle / 2), 0, 0, Math.cos(angle / 2)]);
      multiply(turn, 0, rotations, at + 4 * joint, rotations, at + 4 * joint);
    }
    for (let side = 0; side < 2; side += 1) arm(rotations, at, side, own, HANGING - (lean + back), rest[at / TURN]);
  }
  return { lean, pitch };
}

/**
 * @param {Float64Array} rotations @param {number} at @param {number} side @param {ReturnType<typeof habitsOf>} own
 * @param {number} vertical where an arm at rest points @param {number} rest
 */
function arm(rotations, at, side, own, vertical, rest) {
  const sign = SIDES[side], shoulder = at + 4 * SHOULDERS[side];
  const [x, y, z, w] = rotations.subarray(shoulder, shoulder + 4);
  const ahead = sign * 2 * (x * y + w * z), down = -sign * 2 * (x * z - w * y);
  const hangs = bounded(2 * down - 0.4, 0, 1);
  const off = vertical - Math.atan2(ahead, Math.max(down, 0.2));
  const swings = bounded((1 - own.swing) * off, -SWING_MOST, SWING_MOST);
  const more = (swings + rest * (bounded(off, -HANGING_MOST, HANGING_MOST) - swings)) * hangs;
  const aside = (own.aside[side] + HANGING_ASIDE * rest) * hangs;
  before(rotations, shoulder, 0.5 * more, -0.5 * sign * aside, -0.5 * sign * own.turned * hangs);
  const elbow = at + 4 * ELBOW_JOINTS[side], wrist = at + 4 * WRISTS[side];
  relax(rotations, elbow, RELAXED, sign, rest);
  before(rotations, elbow, 0, 0, 0.5 * sign * own.elbows[side]);
  relax(rotations, wrist, PALM, sign, rest);
  before(rotations, wrist, 0.5 * own.hands[0], 0.5 * sign * own.hands[1], 0);
}

/** Bring the rotation at i so far to one by small angles, mirrored on the left side; not of unit length. @param {Float64Array} q @param {number} i @param {number[]} angles @param {number} sign @param {number} rest */
function relax(q, i, [x, y, z], sign, rest) {
  const near = q[i + 3] < 0 ? -1 : 1, length = Math.hypot(0.5 * x, 0.5 * y, 0.5 * z, 1);
  turn.set([0.5 * x, 0.5 * sign * y, 0.5 * sign * z, 1]);
  for (let n = 0; n < 4; n += 1) q[i + n] += rest * ((near * turn[n]) / length - q[i + n]);
}

/** Turn the rotation at i from the left by (x, y, z, 1), and make it a unit one. @param {Float64Array} q @param {number} i @param {number} x @param {number} y @param {number} z */
function before(q, i, x, y, z) {
  turn.set([x, y, z, 1]);
  multiply(turn, 0, q, i, q, i);
  const length = Math.max(Math.hypot(q[i], q[i + 1], q[i + 2], q[i + 3]), 1e-12);
  for (let n = 0; n < 4; n += 1) q[i + n] /= length;
}

/** Radians that what points ahead looks up. @param {Float64Array} q */
const pitch = (q) => Math.asin(bounded(2 * (q[1] * q[2] + q[0] * q[3]), -1, 1));
