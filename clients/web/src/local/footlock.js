// Keeps feet that bear weight in place, in the frames shown. It mirrors the server's world/output/footlock.py, which
// explains the rules, for one person. World: metres, Z up, 40 frames per second.

import { FRAMES, LegPose, SOLES, moveAnkles } from "./legs.js";
import { bounded } from "./steering.js";

const FPS = 40;
const TOUCH_HEIGHT = 0.03, TOUCH_SPEED = 0.4, LIFT_HEIGHT = 0.05, LIFT_SPEED = 0.7, TOLD_HEIGHT = 0.02;
const RISE = 1 / 3;
const SLIPPING = [0.25, LIFT_SPEED], LEASH = [0.09, 0.14];
const FADE = 1 / (0.15 * FPS);
const SETTLE = 0.25, DROP = 0.02, SOFTNESS = 0.001;

/** @param {number} value @param {number[]} ends */
function smooth(value, [low, high]) {
  const t = bounded((value - low) / (high - low), 0, 1);
  return t * t * (3 - 2 * t);
}

/** State of the lock for two feet. */
class LockState {
  soles = new Float64Array(6 * SOLES); // where the model put them in the last frame [side, 4, 3]
  contact = [false, false];
  hold = [0, 0];
  shift = [[0, 0, 0], [0, 0, 0]];
}

/** Locks the feet of one person, chunk after chunk. */
export class FootLock {
  /** @type {LockState | null} */
  #state = null;

  /** @param {import("./legs.js").Legs} legs */
  constructor(legs) {
    this.legs = legs;
  }

  /** Forget the past: the next chunk starts in another pose. */
  restart() {
    this.#state = null;
  }

  /** @param {Float64Array} translation @param {Float64Array} rotations */
  #begin(translation, rotations) {
    const state = new LockState(), pose = new LegPose(this.legs, translation, rotations, 1);
    state.soles.set(pose.soles.subarray(0, 6 * SOLES));
    for (let side = 0; side < 2; side += 1) {
      state.contact[side] = lowest(pose.soles, SOLES * side) < TOUCH_HEIGHT;
      state.hold[side] = Number(state.contact[side]);
    }
    return state;
  }

  /**
   * Clean a chunk in place. Returns contacts, left and right of each frame.
   * @param {Float64Array} translation @param {Float64Array} rotations
   */
  clean(translation, rotations) {
    const state = (this.#state ??= this.#begin(translation, rotations));
    const pose = new LegPose(this.legs, translation, rotations);
    const contacts = new Uint8Array(2 * FRAMES), shifts = new Float64Array(6 * FRAMES);
    for (let k = 0; k < 2 * FRAMES; k += 1) {
      const side = k % 2, [x, y, height] = slide(pose, k, state.soles), speed = FPS * Math.hypot(x, y);
      const touches = state.contact[side] ? height < LIFT_HEIGHT && speed < LIFT_SPEED : height < TOUCH_HEIGHT && speed < TOUCH_SPEED;
      state.contact[side] = touches;
      const hold = (state.hold[side] = bounded(state.hold[side] + (touches ? RISE : -RISE), 0, 1));
      const before = state.shift[side];
      const grip = hold * (1 - smooth(speed, SLIPPING)) * (1 - smooth(Math.hypot(before[0], before[1]), LEASH));
      const stays = 1 - (1 - grip) * FADE, settling = -height * (1 - smooth(height, [0, DROP]));
      const shift = [stays * before[0] - grip * x, stays * before[1] - grip * y, before[2] + SETTLE * (hold * settling - before[2])];
      state.shift[side] = shift;
      shifts.set(shift, 3 * k);
      contacts[k] = Number(touches && grip >= 0.5 && height + shift[2] <= TOLD_HEIGHT);
    }
    state.soles.set(pose.soles.subarray(-6 * SOLES));
    moveAnkles(pose, shifts, rotations);
    return contacts;
  }
}

/** @param {Float64Array} soles @param {number} at */
function lowest(soles, at) {
  let least = Infinity;
  for (let p = 0; p < SOLES; p += 1) least = Math.min(least, soles[3 * (at + p) + 2]);
  return least;
}

/**
 * Movement [x, y] of foot `k`'s bearing point since the last frame, and its height.
 * @param {LegPose} pose @param {number} k @param {Float64Array} before
 */
function slide(pose, k, before) {
  const now = 3 * SOLES * k, [old, from] = k < 2 ? [before, now] : [pose.soles, now - 6 * SOLES];
  const height = lowest(pose.soles, SOLES * k);
  let x = 0, y = 0, loads = 0;
  for (let p = 0; p < 3 * SOLES; p += 3) {
    const load = Math.exp((height - pose.soles[now + p + 2]) / SOFTNESS);
    loads += load;
    x += load * (pose.soles[now + p] - old[from + p]);
    y += load * (pose.soles[now + p + 1] - old[from + p + 1]);
  }
  return [x / loads, y / loads, height];
}
