// A step that no body could take is repaired before it is shown, or continued from. The server's
// world/stepping/guards.py, for one person. Rare; without a repair nothing changes.

import { multiply, relative } from "../core/quaternions.js";
import { LegPose, SOLES } from "./legs.js";

const FRAMES = 8, SEED = 2, TURN = 88, JOINTS = 22;
const DEGREE = Math.PI / 180;
const KNEES = [4, 5], ANKLES = [7, 8], SPINE = [3, 6, 9], ARMS = [16, 17, 18, 19, 20, 21];
const KNEE = [-5 * DEGREE, 150 * DEGREE];
const SIDEWAYS = Math.sin(15 * DEGREE) ** 2; // of half the angle that a knee is turned by beside its bend, squared
const ANKLE = 35 * DEGREE; // half the angle that an ankle is turned by at most
const ARM_MOST = 60 * DEGREE; // that a joint of an arm turns by while a body gets up
const FELL = Math.cos(32 * DEGREE);
const FOLDED = 0.76;
// degrees per frame by which the turning of a joint may change from frame to frame, in the order of BONES
const JERK = [Infinity, 5, 5, 5, 7, 7, 5, 25, 25, 5, 40, 40, 12, 7, 7, 15, 8, 8, 15, 15, 25, 25];
const LIMITS = JERK.map((degrees) => ((degrees * DEGREE) / 2) ** 2);

const WHIP = 0.06; // metres per frame² by which the way of a foot may change
const LEGS = [[1, 4, 7], [2, 5, 8]], REACHES = [0.9, 0.5, 0.14]; // joints, and metres to the foot's middle
const EVEN = whittaker(2);

/** @typedef {import("./planting.js").Seed} Seed */

/**
 * Rotations of a step without impossible knees and jerks: the same array when there are none.
 * @param {Seed} seed @param {Float64Array} translation @param {Float64Array} rotations @param {import("./legs.js").Legs} legs
 */
export function smoothed(seed, translation, rotations, legs) {
  return unwhipped(seed, translation, unjerked(seed, rotations, legs), legs);
}

/** Without impossible knees and turns. @param {Seed} seed @param {Float64Array} rotations @param {import("./legs.js").Legs} legs */
function unjerked(seed, rotations, legs) {
  let result = turnable(bendable(rotations, legs));
  const path = new Float64Array((SEED + FRAMES) * 4);
  for (let joint = 1; joint < JOINTS; joint += 1) {
    for (let t = 0; t < SEED; t += 1) copyTurn(seed.rotations, TURN * t + 4 * joint, path, 4 * t);
    for (let t = 0; t < FRAMES; t += 1) copyTurn(result, TURN * t + 4 * joint, path, 4 * (SEED + t));
    if (!(worstJerk(path) > LIMITS[joint])) continue;
    alike(path);
    const jerk = worstJerk(path);
    if (!(jerk > LIMITS[joint])) continue;
    const smooth = smoothest(path);
    if (worstJerk(smooth) >= jerk) continue; // where a joint came fast and ends near by
    if (result === rotations) result = rotations.slice();
    for (let t = 0; t < FRAMES; t += 1) copyTurn(smooth, 4 * (SEED + t), result, TURN * t + 4 * joint);
  }
  return result;
}

/**
 * With the turns of a leg smoothed whose foot jumps.
 * @param {Seed} seed @param {Float64Array} translation @param {Float64Array} rotations @param {import("./legs.js").Legs} legs
 */
function unwhipped(seed, translation, rotations, legs) {
  const path = new Float64Array((SEED + FRAMES) * 4);
  const take = (/** @type {number} */ joint) => {
    for (let t = 0; t < SEED; t += 1) copyTurn(seed.rotations, TURN * t + 4 * joint, path, 4 * t);
    for (let t = 0; t < FRAMES; t += 1) copyTurn(rotations, TURN * t + 4 * joint, path, 4 * (SEED + t));
  };
  const far = LEGS.map((joints) => joints.reduce((sum, joint, k) => {
    take(joint);
    return sum + REACHES[k] * 2 * Math.sqrt(worstJerk(path));
  }, 0));
  if (!far.some((metres) => metres > WHIP)) return rotations; // nearly always: nobody need be posed
  const joined = (/** @type {ArrayLike<number>} */ a, /** @type {ArrayLike<number>} */ b) => Float64Array.of(...Array.from(a), ...Array.from(b));
  const pose = new LegPose(legs, joined(seed.translation, translation), joined(seed.rotations, rotations), SEED + FRAMES);
  let result = rotations;
  LEGS.forEach((joints, side) => {
    if (!(jump(pose, side) > WHIP)) return;
    if (result === rotations) result = rotations.slice();
    for (const joint of joints) {
      take(joint);
      alike(path);
      const even = evened(path);
      for (let t = 0; t < FRAMES; t += 1) copyTurn(even, 4 * t, result, TURN * t + 4 * joint);
    }
  });
  return result;
}

/** Metres per frame² by which the way of a foot's middle changes at most. @param {LegPose} pose @param {number} side */
function jump(pose, side) {
  const middle = (/** @type {number} */ t, /** @type {number} */ axis) => {
    let sum = 0;
    for (let p = 0; p < SOLES; p += 1) sum += pose.soles[3 * (SOLES * (2 * t + side) + p) + axis];
    return sum / SOLES;
  };
  let most = 0;
  for (let t = 2; t < SEED + FRAMES; t += 1) {
    const [x, y, z] = [0, 1, 2].map((axis) => middle(t, axis) - 2 * middle(t - 1, axis) + middle(t - 2, axis));
    most = Math.max(most, Math.hypot(x, y, z));
  }
  return most;
}

/** New turns of a path with smaller second differences and the same end. @param {Float64Array} path */
function evened(path) {
  const out = new Float64Array(4 * FRAMES);
  for (let t = 0; t < FRAMES; t += 1) {
    const turn = [0, 1, 2, 3].map((n) => EVEN[t].reduce((sum, share, k) => sum + share * path[4 * k + n], 0));
    const length = Math.hypot(...turn);
    out.set(turn.map((n) => n / length), 4 * t);
  }
  return out;
}

/** New frames from all of a path: least squares of changes and, times a weight, second differences. @param {number} weight */
function whittaker(weight) {
  const total = SEED + FRAMES, unknown = FRAMES - 1;
  const system = Array.from({ length: total }, (_, i) => Array.from({ length: total }, (__, k) => Number(i === k)));
  for (let t = 0; t + 2 < total; t += 1) {
    const bend = [1, -2, 1];
    for (let i = 0; i < 3; i += 1) for (let k = 0; k < 3; k += 1) system[t + i][t + k] += weight * bend[i] * bend[k];
  }
  const rows = Array.from({ length: unknown }, (_, i) => {
    const row = system[SEED + i];
    const known = row.map((value, k) => (k < SEED || k === total - 1 ? -value : 0));
    known[SEED + i] += 1;
    return [...row.slice(SEED, SEED + unknown), ...known];
  });
  for (let i = 0; i < unknown; i += 1) { // positive definite: no pivoting
    rows[i] = rows[i].map((value) => value / rows[i][i]);
    for (let k = 0; k < unknown; k += 1) {
      if (k !== i) rows[k] = rows[k].map((value, n) => value - rows[k][i] * rows[i][n]);
    }
  }
  return [...rows.map((row) => row.slice(unknown)), Array.from({ length: total }, (_, k) => Number(k === total - 1))];
}

/** @param {ArrayLike<number>} from @param {number} i @param {Float64Array} to @param {number} k */
function copyTurn(from, i, to, k) {
  for (let n = 0; n < 4; n += 1) to[k + n] = from[i + n];
}

/** Largest squared second difference of a path of turns. @param {Float64Array} path */
function worstJerk(path) {
  let worst = 0;
  for (let t = 2; t < path.length / 4; t += 1) {
    let sum = 0;
    for (let n = 0; n < 4; n += 1) sum += (path[4 * t + n] - 2 * path[4 * t - 4 + n] + path[4 * t - 8 + n]) ** 2;
    worst = Math.max(worst, sum);
  }
  return worst;
}

/** Choose signs so that turns are near to each other: both of a quaternion mean the same turn. @param {Float64Array} path */
function alike(path) {
  for (let at = 4; at < path.length; at += 4) {
    let dot = 0;
    for (let n = 0; n < 4; n += 1) dot += path[at + n] * path[at - 4 + n];
    if (dot < 0) for (let n = 0; n < 4; n += 1) path[at + n] *= -1;
  }
}

/** The path with its new frames on the cubic that begins and ends as fast as it does. @param {Float64Array} path */
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

/** The rotation about a vector by as many radians as it is long. @param {number[]} vector @param {Float64Array} out */
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

/** The same with knees bent as knees bend. @param {Float64Array} rotations @param {import("./legs.js").Legs} legs */
function bendable(rotations, legs) {
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

/** The same with ankles turned as far as ankles turn. @param {Float64Array} rotations */
function turnable(rotations) {
  let result = rotations;
  for (let t = 0; t < FRAMES; t += 1) {
    for (const joint of ANKLES) {
      const at = TURN * t + 4 * joint, scalar = rotations[at + 3];
      if (Math.abs(scalar) >= Math.cos(ANKLE)) continue;
      if (result === rotations) result = rotations.slice();
      const share = ((scalar < 0 ? -1 : 1) * Math.sin(ANKLE)) / Math.sqrt(Math.max(1 - scalar ** 2, 1e-12));
      for (let n = 0; n < 3; n += 1) result[at + n] = rotations[at + n] * share;
      result[at + 3] = Math.cos(ANKLE);
    }
  }
  return result;
}

/** Radians that a knee is bent from straight. @param {Float64Array} q @param {number} i @param {Float64Array} rest @param {number} j */
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

/** Whether frames cannot be shown: not finite, or far off where they start. @param {number[]} start @param {Float64Array} translation @param {ArrayLike<number>[]} all */
export function broken(start, translation, all) {
  for (const values of all) for (let k = 0; k < values.length; k += 1) if (!Number.isFinite(values[k])) return true;
  for (let t = 0; t < FRAMES; t += 1) {
    const [x, y, z] = [0, 1, 2].map((k) => translation[3 * t + k] - start[k]);
    if (Math.hypot(x, y, z) > 3) return true;
  }
  return false;
}

/**
 * Frames from the end of a seed to a stand. Arms that have far to go get there with the next step: the stand is changed
 * to show them where they have come to. @param {Seed} seed @param {Seed} stand
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
