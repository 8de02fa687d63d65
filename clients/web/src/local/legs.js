// Legs of a body: the properties of its shape, the places of joints and soles in posed frames, and two-bone inverse
// kinematics. It mirrors the server's world/output/legs.py and twobone.py, for one person. Left comes before right.

import { multiply, relative, rotate } from "../core/quaternions.js";
import { bounded } from "./steering.js";

const TURN = 88;
export const FRAMES = 8, SOLES = 4;
const HIPS = [1, 2], KNEES = [4, 5], ANKLES = [7, 8], BALLS = [10, 11];
const FREE = 0.5;
const STRETCH = 0.999, FOLD = 0.3, TINY = 1e-9, SOFT = Math.PI / 45;

/**
 * Both legs in the T-pose: each joint relative to the one above it, [2, 3]; sole markers relative to ankle and ball,
 * times their share, [2, 4, 3]. `standing`: height of the hips.
 * @typedef {object} Legs
 * @property {Float64Array} hip @property {Float64Array} knee @property {Float64Array} ankle @property {Float64Array} ball
 * @property {Float64Array} soleOfAnkle @property {Float64Array} soleOfBall @property {Float64Array} ballShare
 * @property {number[]} length @property {number} standing
 */

/** @param {{ bones: Float64Array, soleOfAnkle: Float64Array, soleOfBall: Float64Array, ballShare: Float64Array }} shape @returns {Legs} */
export function measureLegs({ bones, soleOfAnkle, soleOfBall, ballShare }) {
  const pick = (/** @type {number[]} */ pair) =>
    Float64Array.from(pair.flatMap((bone) => [...bones.subarray(3 * bone, 3 * bone + 3)]));
  const [hip, knee, ankle, ball] = [HIPS, KNEES, ANKLES, BALLS].map(pick);
  const lengthOf = (/** @type {Float64Array} */ v, /** @type {number} */ i) => Math.hypot(v[i], v[i + 1], v[i + 2]);
  const down = (hip[2] + hip[5] + knee[2] + knee[5] + ankle[2] + ankle[5]) / 2;
  return {
    hip, knee, ankle, ball, soleOfAnkle, soleOfBall, ballShare,
    length: [0, 3].map((i) => lengthOf(knee, i) + lengthOf(ankle, i)),
    standing: -down - (soleOfAnkle[2] + soleOfAnkle[3 * SOLES + 2]) / 2,
  };
}

/** Posed legs of frames: rotations in the world, places off the root [frame, side, 3], soles in the world [frame, side, 4, 3]. */
export class LegPose {
  /** @param {Legs} legs @param {ArrayLike<number>} translation @param {Float64Array} rotations @param {number} [frames] */
  constructor(legs, translation, rotations, frames = FRAMES) {
    const values = (/** @type {number} */ each) => new Float64Array(each * frames);
    this.rootTurn = values(4);
    this.hipTurn = values(8);
    this.kneeTurn = values(8);
    this.ankleTurn = values(8);
    this.hip = values(6);
    this.knee = values(6);
    this.ankle = values(6);
    this.soles = values(6 * SOLES);
    this.facing = values(2);
    this.sunk = values(1); // metres by which the hips are lowered, once known
    const point = new Float64Array(3), turn = new Float64Array(4);
    for (let t = 0; t < frames; t += 1) {
      const at = TURN * t;
      this.rootTurn.set(rotations.subarray(at, at + 4), 4 * t);
      this.#face(t);
      for (let side = 0; side < 2; side += 1) {
        const k = 2 * t + side;
        rotate(this.rootTurn, 4 * t, legs.hip, 3 * side, this.hip, 3 * k);
        multiply(this.rootTurn, 4 * t, rotations, at + 4 * HIPS[side], this.hipTurn, 4 * k);
        rotate(this.hipTurn, 4 * k, legs.knee, 3 * side, point, 0);
        add(this.hip, 3 * k, point, this.knee, 3 * k);
        multiply(this.hipTurn, 4 * k, rotations, at + 4 * KNEES[side], this.kneeTurn, 4 * k);
        rotate(this.kneeTurn, 4 * k, legs.ankle, 3 * side, point, 0);
        add(this.knee, 3 * k, point, this.ankle, 3 * k);
        multiply(this.kneeTurn, 4 * k, rotations, at + 4 * ANKLES[side], this.ankleTurn, 4 * k);
        multiply(this.ankleTurn, 4 * k, rotations, at + 4 * BALLS[side], turn, 0);
        this.#soles(legs, translation, t, side, turn);
      }
    }
  }

  /** @param {number} t */
  #face(t) {
    const [x, y, z, w] = this.rootTurn.subarray(4 * t, 4 * t + 4);
    const a = -2 * (x * y + z * w), b = 1 - 2 * (y * y + z * z), length = Math.max(Math.hypot(a, b), 1e-9);
    this.facing[2 * t] = a / length;
    this.facing[2 * t + 1] = b / length;
  }

  /** @param {Legs} legs @param {ArrayLike<number>} translation @param {number} t @param {number} side @param {Float64Array} ballTurn */
  #soles(legs, translation, t, side, ballTurn) {
    const k = 2 * t + side, ball = new Float64Array(3), own = new Float64Array(3), toe = new Float64Array(3);
    rotate(this.ankleTurn, 4 * k, legs.ball, 3 * side, ball, 0);
    for (let p = 0; p < SOLES; p += 1) {
      const from = SOLES * side + p, to = 3 * (SOLES * k + p);
      rotate(this.ankleTurn, 4 * k, legs.soleOfAnkle, 3 * from, own, 0);
      rotate(ballTurn, 0, legs.soleOfBall, 3 * from, toe, 0);
      for (let n = 0; n < 3; n += 1) {
        const ankle = translation[3 * t + n] + this.ankle[3 * k + n];
        this.soles[to + n] = ankle + legs.ballShare[from] * ball[n] + own[n] + toe[n];
      }
    }
  }
}

/** @param {Float64Array} a @param {number} i @param {Float64Array} b @param {Float64Array} out @param {number} k */
function add(a, i, b, out, k) {
  for (let n = 0; n < 3; n += 1) out[k + n] = a[i + n] + b[n];
}

/**
 * Puts each ankle `shifts` [frame, side, 3] off. Writes hips, knees and ankles of `rotations`.
 * @param {LegPose} pose @param {Float64Array} shifts @param {Float64Array} rotations
 */
export function moveAnkles(pose, shifts, rotations) {
  for (let t = 0; t < FRAMES; t += 1) {
    for (let side = 0; side < 2; side += 1) moveAnkle(pose, t, side, shifts.subarray(3 * (2 * t + side)), rotations);
  }
}

const one = () => new Float64Array(4);
const [across, ankleTo, target, bend, swing, hipTurn, kneeTurn] = Array.from({ length: 7 }, one);
const [thigh, shin, hinge, bentShin] = Array.from({ length: 4 }, () => new Float64Array(3));

/** @param {LegPose} pose @param {number} t @param {number} side @param {ArrayLike<number>} shift @param {Float64Array} rotations */
function moveAnkle(pose, t, side, shift, rotations) {
  const k = 2 * t + side, i = 3 * k;
  let before = 0, wanted = 0;
  for (let n = 0; n < 3; n += 1) {
    thigh[n] = pose.knee[i + n] - pose.hip[i + n];
    shin[n] = pose.ankle[i + n] - pose.knee[i + n];
    target[n] = pose.ankle[i + n] + shift[n] - pose.hip[i + n];
    before += (pose.ankle[i + n] - pose.hip[i + n]) ** 2;
    wanted += target[n] ** 2;
  }
  // a shin turned by an angle about the hinge has thigh · shin = along + most · cos(angle + bend)
  rotate(pose.hipTurn, 4 * k, LEFT, 0, hinge, 0);
  cross(thigh, shin, across, 1);
  const along = dot(thigh, hinge) * dot(shin, hinge), level = dot(thigh, shin) - along, upright = dot(across, hinge);
  const most = Math.max(Math.hypot(level, upright), TINY), fixed = dot(thigh, thigh) + dot(shin, shin) + 2 * along;
  const full = Math.sqrt(Math.max(fixed + 2 * most, TINY));
  const after = reach(Math.sqrt(before), Math.sqrt(wanted), full);
  let bent = Math.acos(bounded((after * after - fixed) / (2 * most), -1, 1));
  bent += Math.max(2 * SOFT - bent, 0) ** 2 / (4 * SOFT);
  const half = 0.5 * (bent - Math.atan2(upright, level)), sine = Math.sin(half);
  bend.set([hinge[0] * sine, hinge[1] * sine, hinge[2] * sine, Math.cos(half)]);

  // the shortest arc from the bent leg to its target
  rotate(bend, 0, shin, 0, bentShin, 0);
  for (let n = 0; n < 3; n += 1) ankleTo[n] = thigh[n] + bentShin[n];
  cross(ankleTo, target, swing, 1);
  swing[3] = dot(ankleTo, target) + Math.hypot(ankleTo[0], ankleTo[1], ankleTo[2]) * Math.hypot(target[0], target[1], target[2]) + TINY;
  unit(swing);
  multiply(swing, 0, pose.hipTurn, 4 * k, hipTurn, 0);
  multiply(bend, 0, pose.kneeTurn, 4 * k, kneeTurn, 0);
  multiply(swing, 0, kneeTurn, 0, kneeTurn, 0);
  const at = TURN * t;
  relative(pose.rootTurn, 4 * t, hipTurn, 0, rotations, at + 4 * HIPS[side]);
  relative(hipTurn, 0, kneeTurn, 0, rotations, at + 4 * KNEES[side]);
  relative(kneeTurn, 0, pose.ankleTurn, 4 * k, rotations, at + 4 * ANKLES[side]);
}

const LEFT = Float64Array.of(-1, 0, 0);

/** Distance from hip to ankle that a leg reaches for a `wanted` one. @param {number} before @param {number} wanted @param {number} leg */
function reach(before, wanted, leg) {
  const way = STRETCH * leg - before, more = wanted - before;
  const near = Math.max(FREE * way, 1e-6), rest = Math.max((1 - FREE) * way, 1e-6);
  const eased = Math.min(more, near) + rest * (1 - Math.exp(-Math.max(more - near, 0) / rest));
  return Math.max(before + eased, Math.min(before, FOLD * leg));
}

/** @param {Float64Array} a @param {Float64Array} b */
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

/** @param {Float64Array} a @param {Float64Array} b @param {Float64Array} out @param {number} scale */
function cross(a, b, out, scale) {
  const x = a[1] * b[2] - a[2] * b[1], y = a[2] * b[0] - a[0] * b[2], z = a[0] * b[1] - a[1] * b[0];
  out[0] = x * scale;
  out[1] = y * scale;
  out[2] = z * scale;
}

/** @param {Float64Array} q */
function unit(q) {
  const length = Math.max(Math.hypot(q[0], q[1], q[2], q[3]), 1e-12);
  for (let n = 0; n < 4; n += 1) q[n] /= length;
}
