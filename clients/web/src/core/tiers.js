// Frames of each tier of a stream, as poses with the bones of the first: clients/README.md, "Far people".

import { BASES } from "./bases.js";
import { CYCLE, STAND, SWING } from "./gait_table.js";
import { ENCODING, unpackPoses } from "./poses.js";

/** @typedef {import("./messages.js").Header} Header */

const BONES = 22, POSES = 16, MAX_BONES = 1024;
const TURN = Math.PI / 32768;

/** Unpacks the frames of one stream. Allocates nothing once the longest chunk has come. */
export class TierUnpacker {
  #stand = Float64Array.from(STAND);
  #cycle = Float64Array.from(CYCLE);
  #scratch = new Float32Array(0);

  /** Throws when a header cannot be read. @param {Header} header */
  constructor(header) {
    const basis = BASES[/** @type {keyof typeof BASES} */ (header.basis)] ?? BASES.gltf;
    this.up = basis.up;
    this.bones = Int32Array.from(header.bones);
    /** Numbers per frame. */
    this.width = 3 + 4 * header.bones.length;
    if (header.tiers.some(({ bones }) => bones.length > MAX_BONES)) throw new Error("a tier has too many bones");
    this.tiers = header.tiers.map(({ encoding, bones, sentFps }) => ({
      encoding, sentFps, count: bones.length,
      isWhole: bones.length === header.bones.length && bones.every((bone, k) => bone === header.bones[k]),
      slots: Int32Array.from(header.bones, (bone) => bones.indexOf(bone)), // of each bone, in a frame of the tier
    }));
    for (const table of [this.#stand, this.#cycle]) {
      for (let k = 0; k < table.length; k += 4) {
        const [x, y, z] = table.subarray(k, k + 3);
        for (let axis = 0; axis < 3; axis += 1) {
          table[k + axis] = basis.handed * (x * basis.left[axis] + y * basis.up[axis] + z * basis.forward[axis]);
        }
      }
    }
  }

  /**
   * Reads `count` frames of a tier that begin at byte `start` into `out`.
   * @param {DataView} view @param {number} start @param {number} count @param {number} number @param {Float32Array} out
   */
  unpack(view, start, count, number, out) {
    const tier = this.tiers[number];
    if (tier.encoding === ENCODING.ROOT) {
      for (let frame = 0; frame < count; frame += 1) this.#root(view, start + 16 * frame, out, this.width * frame);
    } else if (tier.isWhole) {
      unpackPoses(view, start, count, tier.encoding, tier.count, out);
    } else {
      const width = 3 + 4 * tier.count, { bones } = this;
      if (this.#scratch.length < count * width) this.#scratch = new Float32Array(count * width);
      const scratch = this.#scratch;
      unpackPoses(view, start, count, tier.encoding, tier.count, scratch);
      for (let frame = 0; frame < count; frame += 1) {
        const from = width * frame, to = this.width * frame;
        for (let k = 0; k < 3; k += 1) out[to + k] = scratch[from + k];
        for (let k = 0; k < bones.length; k += 1) {
          const slot = tier.slots[k], at = to + 3 + 4 * k;
          if (slot < 0) this.#standing(bones[k], out, at);
          else for (let n = 0; n < 4; n += 1) out[at + n] = scratch[from + 3 + 4 * slot + n];
        }
      }
    }
  }

  /** @param {number} bone @param {Float32Array} out @param {number} at */
  #standing(bone, out, at) {
    for (let n = 0; n < 4; n += 1) out[at + n] = bone < BONES ? this.#stand[4 * bone + n] : n === 3 ? 1 : 0;
  }

  /** @param {DataView} view @param {number} from @param {Float32Array} out @param {number} to */
  #root(view, from, out, to) {
    for (let k = 0; k < 3; k += 1) out[to + k] = view.getFloat32(from + 4 * k, true);
    const half = view.getInt16(from + 12, true) * TURN / 2;
    const phase = view.getUint8(from + 14) / 256 * POSES;
    const share = Math.min(1, view.getUint8(from + 15) / 128 / SWING);
    const pose = Math.floor(phase), cycle = this.#cycle, { bones, up } = this;
    for (let k = 0; k < bones.length; k += 1) {
      const bone = bones[k], at = to + 3 + 4 * k;
      this.#standing(bone, out, at);
      if (bone >= BONES) continue;
      const a = 4 * (BONES * pose + bone), b = 4 * (BONES * ((pose + 1) % POSES) + bone);
      mix(cycle, a, cycle, b, phase - pose, MIXED);
      mix(this.#stand, 4 * bone, MIXED, 0, share, MIXED);
      if (bone === 0) turn(up, half, MIXED);
      for (let n = 0; n < 4; n += 1) out[at + n] = MIXED[n];
    }
  }
}

const MIXED = new Float64Array(4);

/**
 * out = the interpolation of two rotations, linearly along the shorter arc, normalised.
 * @param {Float64Array} p @param {number} i @param {Float64Array} q @param {number} j @param {number} share @param {Float64Array} out
 */
function mix(p, i, q, j, share, out) {
  const cosine = p[i] * q[j] + p[i + 1] * q[j + 1] + p[i + 2] * q[j + 2] + p[i + 3] * q[j + 3];
  const from = 1 - share, to = cosine < 0 ? -share : share;
  const x = from * p[i] + to * q[j], y = from * p[i + 1] + to * q[j + 1];
  const z = from * p[i + 2] + to * q[j + 2], w = from * p[i + 3] + to * q[j + 3];
  const length = Math.sqrt(x * x + y * y + z * z + w * w);
  out[0] = x / length;
  out[1] = y / length;
  out[2] = z / length;
  out[3] = w / length;
}

/** Turns q about `up` in the world. @param {Float64Array} up @param {number} half @param {Float64Array} q */
function turn(up, half, q) {
  const sine = Math.sin(half), aw = Math.cos(half);
  const ax = sine * up[0], ay = sine * up[1], az = sine * up[2];
  const bx = q[0], by = q[1], bz = q[2], bw = q[3];
  q[0] = aw * bx + ax * bw + ay * bz - az * by;
  q[1] = aw * by - ax * bz + ay * bw + az * bx;
  q[2] = aw * bz + ax * by - ay * bx + az * bw;
  q[3] = aw * bw - ax * bx - ay * by - az * bz;
}
