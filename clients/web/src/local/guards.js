// Repairs a step that no body could take before it is shown or continued from. It mirrors the server's
// world/stepping/guards.py, for one person. Repairs are rare; other steps do not change.

import { multiply, relative } from "../core/quaternions.js";

const FRAMES = 8, SEED = 2, TURN = 88, JOINTS = 22;
const DEGREE = Math.PI / 180;
const KNEES = [4, 5], SPINE = [3, 6, 9], ARMS = [16, 17, 18, 19, 20, 21];
const KNEE = [-5 * DEGREE, 150 * DEGREE];
const SIDEWAYS = Math.sin(15 * DEGREE) ** 2; // squared sine of half the angle by which a knee is turned sideways
const ARM_MOST = 60 * DEGREE; // by which a joint of an arm turns while a body gets up
const FELL = Math.cos(32 * DEGREE);
const FOLDED = 0.76;
/** @typedef {import("./person.js").Seed} Seed */

/** @param {ArrayLike<number>} from @param {number} i @param {Float64Array} to @param {number} k */
function copyTurn(from, i, to, k) {
  for (let n = 0; n < 4; n += 1) to[k + n] = from[i + n];
}

/** The path with its new frames on a cubic with the same speeds at both ends. @param {Float64Array} path */
function smoothest(path) {
  const last = path.length - 4, turn = new Float64Array(4), out = path.slice();
  const between = (/** @type {number} */ i, /** @type {number} */ j) => {
    relative(path, i, path, j, turn, 0);
    return vectorOf(turn);
  };
  const whole = between(4, last);
  const fast = (Math.max(Math.hypot(...whole), 1e-6) * 3) / FRAMES;
  const [into, leaving] = [between(0, 4), between(last - 4, last)].map((v) => {
    const share = Math.min(1, fast / Math.max(Math.hypot(...v), 1e-9));
    return v.map((n) => n * share);
  });
  for (let k = 1; k <= FRAMES; k += 1) {
    const t = k / FRAMES;
    const way = whole.map((w, n) => w * (3 * t ** 2 - 2 * t ** 3) + FRAMES * into[n] * (t - 2 * t ** 2 + t ** 3)
      + FRAMES * leaving[n] * (t ** 3 - t ** 2));
    turnOf(way, turn);
    multiply(path, 4, turn, 0, out, 4 * (k + 1));
  }
  return out;
}

/** The rotation about a vector by its length in radians. @param {number[]} vector @param {Float64Array} out */
function turnOf(vector, out) {
  const angle = Math.max(Math.hypot(...vector), 1e-12), sine = Math.sin(angle / 2) / angle;
  out.set([vector[0] * sine, vector[1] * sine, vector[2] * sine, Math.cos(angle / 2)]);
}

/** Axis times angle, the shorter way round. @param {Float64Array} q */
function vectorOf(q) {
  const sign = q[3] < 0 ? -1 : 1, v = [sign * q[0], sign * q[1], sign * q[2]];
  const sine = Math.hypot(...v);
  const share = (2 * Math.atan2(sine, sign * q[3])) / Math.max(sine, 1e-12);
  return v.map((n) => n * share);
}

/**
 * Rotations of a step with knees that bend as knees can; the same array if they already do.
 * @param {Float64Array} rotations @param {import("./legs.js").Legs} legs
 */
export function bendable(rotations, legs) {
  let result = rotations;
  const knee = new Float64Array(4);
  for (let t = 0; t < FRAMES; t += 1) {
    for (let side = 0; side < 2; side += 1) {
      const at = TURN * t + 4 * KNEES[side];
      copyTurn(rotations, at, knee, 0);
      const beside = knee[1] ** 2 + knee[2] ** 2, twisted = beside > SIDEWAYS;
      if (twisted) {
        const less = Math.sqrt(SIDEWAYS / Math.max(beside, 1e-12));
        const more = Math.sqrt((1 - less * less * beside) / Math.max(1 - beside, 1e-6));
        knee.set([more * knee[0], less * knee[1], less * knee[2], more * knee[3]]);
      }
      const bend = flexion(knee, 0, legs.ankle, 3 * side);
      const excess = bend - Math.min(Math.max(bend, KNEE[0]), KNEE[1]);
      if (!twisted && excess === 0) continue;
      if (result === rotations) result = rotations.slice();
      if (excess !== 0) multiply(Float64Array.of(Math.sin(excess / 2), 0, 0, Math.cos(excess / 2)), 0, knee, 0, knee, 0);
      copyTurn(knee, 0, result, at);
    }
  }
  return result;
}

/** Bend of a knee from straight, radians. @param {Float64Array} q @param {number} i @param {Float64Array} rest @param {number} j */
function flexion(q, i, rest, j) {
  const x = q[i], y = q[i + 1], z = q[i + 2], w = q[i + 3];
  const a = rest[j], b = rest[j + 1], c = rest[j + 2];
  const ahead = 2 * (x * y + w * z) * a + (1 - 2 * (x * x + z * z)) * b + 2 * (y * z - w * x) * c;
  const up = 2 * (x * z - w * y) * a + 2 * (y * z + w * x) * b + (1 - 2 * (x * x + y * y)) * c;
  const bend = Math.atan2(-ahead, -up) - Math.atan2(-b, -c) + Math.PI / 2;
  const whole = 2 * Math.PI;
  return (((bend % whole) + whole) % whole) - Math.PI / 2;
}

/** Whether a body leans or squats at the end of its step. @param {Float64Array} translation @param {Float64Array} rotations @param {import("./legs.js").Legs} legs */
export function fallen(translation, rotations, legs) {
  const last = TURN * (FRAMES - 1), turn = rotations.slice(last, last + 4);
  let upright = 0;
  for (const joint of SPINE) {
    multiply(turn, 0, rotations, last + 4 * joint, turn, 0);
    upright += (1 - 2 * (turn[0] ** 2 + turn[1] ** 2)) / 3;
  }
  return upright < FELL || translation[3 * FRAMES - 1] < FOLDED * legs.standing;
}

/** Whether frames cannot be shown: not finite, or far from their start. @param {number[]} start @param {Float64Array} translation @param {ArrayLike<number>[]} all */
export function broken(start, translation, all) {
  for (const values of all) for (let k = 0; k < values.length; k += 1) if (!Number.isFinite(values[k])) return true;
  for (let t = 0; t < FRAMES; t += 1) {
    const [x, y, z] = [0, 1, 2].map((k) => translation[3 * t + k] - start[k]);
    if (Math.hypot(x, y, z) > 3) return true;
  }
  return false;
}

/**
 * Frames from the end of a seed to a stand. Arms with far to go arrive in the next step; the stand is changed to show
 * how far they have come. @param {Seed} seed @param {Seed} stand
 */
export function gotUp(seed, stand) {
  const translation = new Float64Array(3 * FRAMES), rotations = new Float64Array(TURN * FRAMES);
  for (let f = 0; f < FRAMES; f += 1) {
    const t = (f + 1) / FRAMES;
    for (let k = 0; k < 3; k += 1) {
      const start = seed.translation[3 + k], speed = start - seed.translation[k];
      translation[3 * f + k] = start + (3 * t ** 2 - 2 * t ** 3) * (stand.translation[3 + k] - start)
        + FRAMES * (t - 2 * t ** 2 + t ** 3) * speed;
    }
  }
  const path = new Float64Array((SEED + FRAMES) * 4), end = new Float64Array(4), last = new Float64Array(4);
  for (let joint = 0; joint < JOINTS; joint += 1) {
    const at = 4 * joint;
    for (let t = 0; t < SEED; t += 1) copyTurn(seed.rotations, TURN * t + at, path, 4 * t);
    copyTurn(stand.rotations, TURN + at, end, 0);
    copyTurn(seed.rotations, TURN + at, last, 0);
    relative(last, 0, end, 0, end, 0);
    let way = vectorOf(end);
    if (ARMS.includes(joint)) way = way.map((n) => n * Math.min(1, ARM_MOST / Math.max(Math.hypot(...way), 1e-9)));
    turnOf(way, end);
    multiply(last, 0, end, 0, end, 0);
    for (let t = 0; t < FRAMES; t += 1) copyTurn(end, 0, path, 4 * (SEED + t));
    const smooth = smoothest(path);
    for (let t = 0; t < FRAMES; t += 1) copyTurn(smooth, 4 * (SEED + t), rotations, TURN * t + at);
    if (!ARMS.includes(joint)) continue;
    for (let t = 0; t < SEED; t += 1) stand.rotations.set(rotations.subarray(TURN * (FRAMES - 1) + at, TURN * (FRAMES - 1) + at + 4), TURN * t + at);
  }
  return { translation, rotations };
}
