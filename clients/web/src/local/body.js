// Bodies of an export (wayfarer.json, body_<gender>.bin): start poses, bones and soles of any shape. World: metres,
// Z up, heading 0 faces +Y.

import { multiply } from "../core/quaternions.js";
import { legShares } from "./footlock.js";
import { measureLegs } from "./legs.js";
import { sharesOf } from "./righting.js";

const JOINTS = 22, SEED = 2;

/** A body of one gender. */
export class LocalBody {
  /** @type {Map<string, Float32Array>} */
  #parts = new Map();

  /** @param {any} about wayfarer.json @param {string} gender @param {ArrayBuffer} bytes */
  constructor(about, gender, bytes) {
    const layout = about.bodies[gender];
    if (!layout) throw new Error(`wayfarer.json: there is no body "${gender}"; ${Object.keys(about.bodies).join(", ")}`);
    for (const { name, offset, bytes: size } of layout.parts) {
      if (offset + size > bytes.byteLength) throw new Error(`${layout.file}: is cut short`);
      this.#parts.set(name, new Float32Array(bytes.slice(offset, offset + size)));
    }
    /** Numbers of the sole markers, four of each foot, left first. @type {number[][]} */
    this.soles = about.sole_markers;
    this.markers = about.markers.length;
    /** Share of the spine's bend that each marker follows. */
    this.shares = sharesOf(about.markers);
    /** Shares of each leg's movements that each marker follows. */
    this.legShares = legShares(about.markers);
    this.poses = this.#part("start_rotations").length / (4 * JOINTS);
  }

  /** Offsets of the bones from their parents in the T-pose, and legs. @param {ArrayLike<number>} betas */
  shape(betas) {
    const bones = this.#shaped("bones", betas);
    const legs = measureLegs({
      bones,
      soleOfAnkle: this.#shaped("sole_of_ankle", betas),
      soleOfBall: this.#shaped("sole_of_ball", betas),
      ballShare: Float64Array.from(this.#part("ball_share")),
    });
    return { bones, legs };
  }

  /**
   * The seed of a person standing in a start pose, soles on the floor, hips over x, y.
   * @param {number} pose @param {ArrayLike<number>} betas @param {number} x @param {number} y @param {number} heading
   * @returns {import("./person.js").Seed}
   */
  stand(pose, betas, x, y, heading) {
    const size = 3 * this.markers, markers = new Float64Array(size);
    const mean = this.#part("start_markers"), dirs = this.#part("start_markers_dirs");
    const cos = Math.cos(heading), sin = Math.sin(heading);
    for (let k = 0; k < size; k += 1) markers[k] = linear(mean, dirs, size * pose + k, betas);
    let lowest = Infinity;
    for (const marker of this.soles.flat()) lowest = Math.min(lowest, markers[3 * marker + 2]);
    for (let k = 0; k < size; k += 3) {
      const [a, b] = [markers[k], markers[k + 1]];
      markers[k] = x + cos * a - sin * b;
      markers[k + 1] = y + sin * a + cos * b;
      markers[k + 2] -= lowest;
    }
    const turns = Float64Array.from(this.#part("start_rotations").subarray(4 * JOINTS * pose, 4 * JOINTS * (pose + 1)));
    multiply(Float64Array.of(0, 0, Math.sin(heading / 2), Math.cos(heading / 2)), 0, turns, 0, turns, 0);
    const twice = (/** @type {ArrayLike<number>} */ frame) => Float32Array.from({ length: SEED * frame.length }, (_, k) => frame[k % frame.length]);
    return { markers: twice(markers), translation: twice([x, y, -lowest]), rotations: twice(turns) };
  }

  /** @param {string} name @param {ArrayLike<number>} betas */
  #shaped(name, betas) {
    const mean = this.#part(name), dirs = this.#part(`${name}_dirs`);
    return Float64Array.from(mean, (_, k) => linear(mean, dirs, k, betas));
  }

  /** @param {string} name */
  #part(name) {
    const part = this.#parts.get(name);
    if (!part) throw new Error(`wayfarer.json: the bodies have no ${name}`);
    return part;
  }
}

/** @param {Float32Array} mean @param {Float32Array} dirs @param {number} k @param {ArrayLike<number>} betas */
function linear(mean, dirs, k, betas) {
  let value = mean[k];
  for (let b = 0; b < betas.length; b += 1) value += dirs[betas.length * k + b] * betas[b];
  return value;
}
