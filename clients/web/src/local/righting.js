// Straightens up leaning bodies, which nothing else does. It mirrors the server's world/stepping/righting.py, for one
// person. World: metres, Z up.

import { multiply, rotate, rotateBack } from "../core/quaternions.js";
import { STOPPING, STRAFING, WALKING } from "./steering.js";

const FRAMES = 8, SEED = 2, TURN = 88;
const DEGREE = Math.PI / 180;
const MOST = 14 * DEGREE, MOST_ON_THE_SPOT = 9 * DEGREE; // lean of the spine that is allowed
const SHARE = 0.35, TURN_MOST = 5 * DEGREE; // of the lean beyond it, removed in a step
/** Share of the turn in each new frame. */
const EASE = Array.from({ length: FRAMES }, (_, t) => 0.5 - 0.5 * Math.cos((Math.PI * (t + 1)) / FRAMES));
const PIVOT = 0.21; // metres above the hips joint about which the spine bends as a whole
const SPINE = [3, 6, 9];
const BELOW = ["FWT", "BWT", "HIP", "THI", "KNE", "KNI", "SHN", "CLF", "ANK", "HEE", "TOE", "MT1", "MT5"];
/** @type {Record<string, number>} */
const PARTLY = { LNWST: 0.5, RNWST: 0.5, T10: 1 };

/** Multiples of the spine's turn that markers follow; each of its joints turns by half. @param {string[]} names */
export function sharesOf(names) {
  return names.map((name) => (BELOW.includes(name.slice(1)) || name.includes("SOLE") ? 0 : PARTLY[name] ?? 1.5));
}

/**
 * Takes a part of the lean off the step by its end, if the body leans too far; otherwise returns the same step. `mode` is
 * that of the step, `shares` are those of its markers.
 * @param {number} mode @param {import("./person.js").Step} step @param {number[]} shares
 * @returns {import("./person.js").Step}
 */
export function righted(mode, step, shares) {
  const last = TURN * (FRAMES - 1), turn = step.rotations.slice(last, last + 4);
  let a = 0, b = 0, up = 0;
  for (const joint of SPINE) {
    multiply(turn, 0, step.rotations, last + 4 * joint, turn, 0);
    const [x, y, z, w] = turn;
    a += (2 * (x * z + w * y)) / 3;
    b += (2 * (y * z - w * x)) / 3;
    up += (1 - 2 * (x * x + y * y)) / 3;
  }
  const aside = Math.hypot(a, b), lean = Math.atan2(aside, up);
  const excess = lean - (mode === WALKING || mode === STOPPING || mode === STRAFING ? MOST : MOST_ON_THE_SPOT);
  if (!(excess > 0)) return step;
  const back = Math.min(SHARE * excess, TURN_MOST);
  const axis = Float64Array.of(b / Math.max(aside, 1e-6), -a / Math.max(aside, 1e-6), 0);
  const rotations = step.rotations.slice(), markers = step.markers.slice();
  for (let t = 0; t < FRAMES; t += 1) bendBack(step.rotations, rotations, TURN * t, axis, (back * EASE[t]) / 2);
  for (let s = 0; s < SEED; s += 1) swing(step, markers, s, axis, back, shares);
  return { ...step, rotations, markers };
}

/**
 * The spine of a frame, turned about an axis of the world by `half` in each of its joints.
 * @param {Float64Array} from @param {Float64Array} to @param {number} at @param {Float64Array} axis @param {number} half
 */
function bendBack(from, to, at, axis, half) {
  const above = from.slice(at, at + 4), about = new Float64Array(3), turn = new Float64Array(4);
  for (const joint of SPINE) {
    rotateBack(above, 0, axis, 0, about, 0);
    const sine = Math.sin(half / 2);
    turn.set([sine * about[0], sine * about[1], sine * about[2], Math.cos(half / 2)]);
    multiply(turn, 0, from, at + 4 * joint, to, at + 4 * joint);
    multiply(above, 0, from, at + 4 * joint, above, 0);
  }
}

/**
 * The markers of a seed frame; those above the hips are turned by their share of `back` at that time.
 * @param {import("./person.js").Step} step @param {Float32Array} markers @param {number} s @param {Float64Array} axis
 * @param {number} back @param {number[]} shares
 */
function swing(step, markers, s, axis, back, shares) {
  const frame = FRAMES - SEED + s, above = new Float64Array(3);
  rotate(step.rotations, TURN * frame, Float64Array.of(0, 0, PIVOT), 0, above, 0);
  const pivot = Array.from(above, (value, k) => step.translation[3 * frame + k] + value);
  const [ax, ay] = axis;
  shares.forEach((share, marker) => {
    if (!share) return;
    const at = 3 * (shares.length * s + marker), angle = back * EASE[frame] * share;
    const sine = Math.sin(angle), cosine = Math.cos(angle);
    const [x, y, z] = pivot.map((value, k) => markers[at + k] - value);
    const along = (1 - cosine) * (ax * x + ay * y);
    markers[at] = pivot[0] + cosine * x + sine * ay * z + along * ax;
    markers[at + 1] = pivot[1] + cosine * y - sine * ax * z + along * ay;
    markers[at + 2] = pivot[2] + cosine * z + sine * (ax * y - ay * x);
  });
}
