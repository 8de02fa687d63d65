// A smooth root for capsules, cameras and root motion: clients/README.md, "Smooth root".

import { putHeading } from "./bases.js";

const SMOOTHING = 0.3; // seconds: time constant of the critically damped filter
const STEP = 5; // index in the targets: seconds since the last update
const JUMP = 2; // metres, or seconds between samples, beyond which it begins again at that place

/** Ground point and heading of an agent, from its sampled poses. Allocates nothing. */
export class SmoothRoot {
  #values = new Float64Array(8).fill(NaN); // left, forward, up, heading; their rates
  #targets = new Float64Array(6); // left, forward, up, heading; STEP
  #last = new Float64Array(1).fill(NaN);

  /** @param {import("./bases.js").Basis} basis @param {number} [metresPerUnit] */
  constructor(basis, metresPerUnit = 1) {
    this.basis = basis;
    this.jump = JUMP / metresPerUnit;
    /** Point on the ground. */
    this.point = new Float64Array(3);
  }

  /** Radians, continuous beyond π. NaN before the first update. */
  get heading() {
    return this.#values[3];
  }

  /**
   * At `time`: hips' place and rotation of a frame (its first seven numbers), height of the ground there.
   * @param {number} time @param {ArrayLike<number>} frame @param {number} ground
   */
  update(time, frame, ground) {
    const last = this.#last[0];
    this.#last[0] = time;
    this.#targets[STEP] = last === last ? Math.max(0, time - last) : 0;
    this.#targets[2] = ground;
    this.#update(frame);
  }

  /** @param {ArrayLike<number>} frame */
  #update(frame) {
    const { left, up, forward } = this.basis;
    const values = this.#values, targets = this.#targets;
    targets[0] = frame[0] * left[0] + frame[1] * left[1] + frame[2] * left[2];
    targets[1] = frame[0] * forward[0] + frame[1] * forward[1] + frame[2] * forward[2];
    putHeading(this.basis, frame, 3, targets, 3);
    if (values[3] === values[3]) targets[3] += 2 * Math.PI * Math.round((values[3] - targets[3]) / (2 * Math.PI));
    for (let k = 0; k < 4; k += 1) this.#follow(k);
    for (let k = 0; k < 3; k += 1) this.point[k] = values[0] * left[k] + values[1] * forward[k] + values[2] * up[k];
  }

  /** @param {number} k */
  #follow(k) {
    const values = this.#values;
    const target = this.#targets[k], step = this.#targets[STEP];
    const jumped = k < 3 && Math.abs(target - values[k]) > this.jump;
    if (values[k] !== values[k] || step > JUMP || jumped) {
      values[k] = target;
      values[k + 4] = 0;
    } else if (step > 0) {
      const theta = Math.exp(-step / SMOOTHING);
      const ahead = values[k] + values[k + 4] * step;
      const off = target - ahead;
      values[k] = ahead + (1 - theta * theta) * off;
      values[k + 4] += ((1 - theta) ** 2 / step) * off;
    }
  }
}
