// Feet that stand stay where they are: the drift of a body that stands is taken off every step. The server's
// world/stepping/planting.py and strides.py, for one person. World: metres, Z up.

import { multiply } from "../core/quaternions.js";
import { STANDING, STEP_SECONDS, STOPPING, STRAFING, bounded, facingOf } from "./steering.js";

const FRAMES = 8, SEED = 2, TURN = 88; // numbers of a frame's rotations
const MAX_SHIFT = 0.03, MAX_TURN = (2 * Math.PI) / 180; // of a step
const AWRY = (1.5 * Math.PI) / 180, BACK = [0.4, (1.5 * Math.PI) / 180]; // off the heading of who stands
const MAX_STRIDE = 0.06, MAX_TWIST = (6 * Math.PI) / 180; // of a foot of its own
const STRIDE = 0.05;
const WIDTH = [0.14, 0.26];
const LEG_HEIGHT = 0.8;
/** Share of a correction in each new frame. */
export const EASE = Array.from({ length: FRAMES }, (_, t) => 0.5 - 0.5 * Math.cos((Math.PI * (t + 1)) / FRAMES));

/** @typedef {import("./steering.js").Gait} Gait */
/** @typedef {[number, number]} Point */
/**
 * The two frames that a step starts from.
 * @typedef {object} Seed
 * @property {Float32Array} markers @property {Float32Array} translation @property {Float32Array} rotations
 */
/**
 * New frames, and the markers that the next step starts from.
 * @typedef {object} Step
 * @property {Float64Array} translation @property {Float64Array} rotations @property {Float32Array} markers
 * @property {Uint8Array} contacts left and right of each frame
 */
/** A motion in the plane: about `centre` by `turn`, then by `shift`. @typedef {{ centre: Point, turn: number, shift: Point }} Planar */

/**
 * The step with the drift of planted feet taken off, where the next one starts, and the gait that remembers the
 * feet. `soles`: numbers of the sole markers, 4 of each foot; `facing` of the seed.
 * @param {number[][]} soles @param {Gait} gait @param {Seed} seed @param {Point} facing @param {Step} step @param {Point} carried
 * @returns {{ gait: Gait, step: Step, seed: Seed }}
 */
export function plant(soles, gait, seed, facing, step, carried) {
  const onTheSpot = gait.mode === STANDING || gait.mode === STRAFING;
  const stands = (onTheSpot || (gait.mode === STOPPING && gait.planted)) && step.contacts.every(Boolean);
  if (!stands) return { gait: { ...gait, planted: false, carried: [0, 0] }, step, seed: endOf(step) };
  const before = feet(seed.markers, seed.markers.length / SEED, soles);
  const places = gait.planted ? gait.soles : closed(before, facing);
  const way = wayOf(gait.carried, carried);
  const moved = Float64Array.from(places, (value, k) => value + way[2 * (FRAMES - 1) + (k % 2)]);
  const back = gait.mode === STANDING ? backTo(facingOf(step.rotations, TURN * (FRAMES - 1)), gait.stopFacing) : 0;
  return { gait: { ...gait, planted: true, carried, soles: moved }, ...corrected(step, soles, places, moved, way, back) };
}

/** Radians by which a step turns who faces elsewhere back to his heading. @param {Point} facing @param {Point} asked */
function backTo(facing, asked) {
  const off = Math.atan2(facing[0] * asked[1] - facing[1] * asked[0], facing[0] * asked[0] + facing[1] * asked[1]);
  return bounded(BACK[0] * (off - bounded(off, -AWRY, AWRY)), -BACK[1], BACK[1]);
}

/** Where the next step starts. @param {Step} step @returns {Seed} */
function endOf(step) {
  return {
    markers: step.markers,
    translation: Float32Array.from(step.translation.subarray(-3 * SEED)),
    rotations: Float32Array.from(step.rotations.subarray(-TURN * SEED)),
  };
}

/** Places x, y of sole markers, left foot first. @param {Float32Array} markers @param {number} at @param {number[][]} soles */
function feet(markers, at, soles) {
  return Float64Array.from(soles.flat().flatMap((m) => [markers[at + 3 * m], markers[at + 3 * m + 1]]));
}

/** Way of each frame of a body whose velocity changes evenly. @param {Point} before @param {Point} after */
function wayOf(before, after) {
  const way = new Float64Array(2 * FRAMES);
  for (let t = 0; t < FRAMES; t += 1) {
    const share = (t + 1) / FRAMES;
    for (let k = 0; k < 2; k += 1) {
      way[2 * t + k] = STEP_SECONDS * share * (before[k] + (share / 2) * (after[k] - before[k]));
    }
  }
  return way;
}

/** Places for soles found: feet together, a foot that is left behind comes up. @param {Float64Array} soles @param {Point} facing */
function closed(soles, facing) {
  const [left, right] = [0, 1].map((foot) => mean(soles.subarray(8 * foot, 8 * foot + 8)));
  const aside = [facing[1], -facing[0]];
  const between = [right[0] - left[0], right[1] - left[1]];
  const ahead = between[0] * facing[0] + between[1] * facing[1];
  const apart = between[0] * aside[0] + between[1] * aside[1];
  const close = Math.abs(ahead) > STRIDE ? Math.abs(ahead) : 0;
  const wide = bounded(apart, WIDTH[0], WIDTH[1]) - apart;
  return Float64Array.from(soles, (value, k) => {
    const isLeft = k < 8, axis = k % 2;
    const forward = close * Number(isLeft ? ahead > 0 : ahead < 0);
    return value + forward * facing[axis] + ((isLeft ? -wide : wide) / 2) * aside[axis];
  });
}

/** @param {Step} step @param {number[][]} soles @param {Float64Array} places @param {Float64Array} moved @param {Float64Array} way @param {number} back */
function corrected(step, soles, places, moved, way, back) {
  const count = step.markers.length / SEED;
  const both = nearest(feet(step.markers, count, soles), places, MAX_SHIFT, MAX_TURN);
  both.turn += back;
  const translation = step.translation.slice(), rotations = step.rotations.slice();
  const next = endOf(step), markers = step.markers.slice();
  const end = [way[2 * (FRAMES - 1)], way[2 * (FRAMES - 1) + 1]];
  for (let t = 0; t < FRAMES; t += 1) {
    const [x, y] = shifted(both, step.translation[3 * t], step.translation[3 * t + 1], EASE[t]);
    translation[3 * t] = x + way[2 * t];
    translation[3 * t + 1] = y + way[2 * t + 1];
    yaw(rotations, TURN * t, EASE[t] * both.turn);
  }
  for (let s = 0; s < SEED; s += 1) {
    const t = FRAMES - SEED + s;
    const [x, y] = shifted(both, step.translation[3 * t], step.translation[3 * t + 1], 1);
    next.translation[3 * s] = x + end[0];
    next.translation[3 * s + 1] = y + end[1];
    const turned = step.rotations.slice(TURN * t, TURN * t + 4);
    yaw(turned, 0, both.turn);
    next.rotations.set(turned, TURN * s);
  }
  for (let m = 0; m < markers.length; m += 3) {
    const [x, y] = shifted(both, markers[m], markers[m + 1], 1);
    markers[m] = x + end[0];
    markers[m + 1] = y + end[1];
  }
  next.markers = bent(markers, soles, moved);
  return { step: { ...step, translation, rotations, markers }, seed: next };
}

/** Turn the rotation at i about the vertical. @param {Float64Array} q @param {number} i @param {number} angle */
function yaw(q, i, angle) {
  multiply(Float64Array.of(0, 0, Math.sin(angle / 2), Math.cos(angle / 2)), 0, q, i, q, i);
}

/** Markers with each leg bent so that its sole ends at its place. @param {Float32Array} markers @param {number[][]} soles @param {Float64Array} places */
function bent(markers, soles, places) {
  const found = feet(markers, markers.length / SEED, soles);
  const own = [0, 1].map((foot) => {
    const part = /** @type {const} */ ([8 * foot, 8 * foot + 8]);
    return nearest(found.subarray(...part), places.subarray(...part), MAX_STRIDE, MAX_TWIST);
  });
  const result = markers.slice();
  for (let m = 0; m < markers.length; m += 3) {
    const x = markers[m], y = markers[m + 1];
    const left = toSole(x, y, found, 0), right = toSole(x, y, found, 8);
    const toRight = bounded((2 * left) / Math.max(left + right, 1e-6) - 0.5, 0, 1);
    const low = bounded(1 - markers[m + 2] / LEG_HEIGHT, 0, 1);
    const a = shifted(own[0], x, y, low * (1 - toRight)), b = shifted(own[1], x, y, low * toRight);
    result[m] = a[0] + b[0] - x;
    result[m + 1] = a[1] + b[1] - y;
  }
  return result;
}

/** Metres to a sole: its line from heel to toe. @param {number} x @param {number} y @param {Float64Array} soles @param {number} at */
function toSole(x, y, soles, at) {
  const heelX = soles[at], heelY = soles[at + 1], dx = soles[at + 6] - heelX, dy = soles[at + 7] - heelY;
  const along = bounded(((x - heelX) * dx + (y - heelY) * dy) / Math.max(dx * dx + dy * dy, 1e-6), 0, 1);
  return Math.hypot(x - heelX - along * dx, y - heelY - along * dy);
}

/** The motion that brings points nearest to where they are wanted, within bounds. @param {Float64Array} found @param {Float64Array} wanted @param {number} most @param {number} mostTurn @returns {Planar} */
function nearest(found, wanted, most, mostTurn) {
  const centre = mean(found), goal = mean(wanted);
  let crossed = 0, dotted = 0;
  for (let k = 0; k < found.length; k += 2) {
    const ax = found[k] - centre[0], ay = found[k + 1] - centre[1];
    const bx = wanted[k] - goal[0], by = wanted[k + 1] - goal[1];
    crossed += ax * by - ay * bx;
    dotted += ax * bx + ay * by;
  }
  const shift = [goal[0] - centre[0], goal[1] - centre[1]];
  const share = Math.min(1, most / Math.max(Math.hypot(shift[0], shift[1]), 1e-9));
  const turn = bounded(Math.atan2(crossed, dotted), -mostTurn, mostTurn);
  return { centre, turn, shift: [share * shift[0], share * shift[1]] };
}

/** A point moved by a share of a motion. @param {Planar} motion @param {number} px @param {number} py @param {number} share */
function shifted({ centre, turn, shift }, px, py, share) {
  const x = px - centre[0], y = py - centre[1], cos = Math.cos(share * turn), sin = Math.sin(share * turn);
  return [cos * x - sin * y + centre[0] + share * shift[0], sin * x + cos * y + centre[1] + share * shift[1]];
}

/** @param {Float64Array} points @returns {Point} */
function mean(points) {
  let x = 0, y = 0;
  for (let k = 0; k < points.length; k += 2) {
    x += points[k];
    y += points[k + 1];
  }
  return [(2 * x) / points.length, (2 * y) / points.length];
}

/**
 * The step, and where the next one starts, with the way of the hips shortened: by shares `before` at its start and
 * `after` at its end. @param {number} before @param {number} after @param {Point} start @param {Step} step @param {Seed} seed
 */
export function shorten(before, after, start, step, seed) {
  if (!before && !after) return { step, seed };
  const translation = step.translation.slice(), off = [0, 0], last = [...start];
  for (let t = 0; t < FRAMES; t += 1) {
    const share = before + ((t + 1) / FRAMES) * (after - before);
    for (let k = 0; k < 2; k += 1) {
      const place = step.translation[3 * t + k];
      off[k] -= share * (place - last[k]);
      last[k] = place;
      translation[3 * t + k] = place + off[k];
    }
  }
  const moved = { ...seed, markers: seed.markers.slice(), translation: seed.translation.slice() };
  for (const places of [moved.markers, moved.translation]) {
    for (let k = 0; k < places.length; k += 3) {
      places[k] += off[0];
      places[k + 1] += off[1];
    }
  }
  return { step: { ...step, translation }, seed: moved };
}
