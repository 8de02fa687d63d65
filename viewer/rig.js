// A body's bones as numbers: from a pose to the matrices that move its skin. No DOM, no three.js.

import { inverse, product } from "./client/core/skins.js";

const UPRIGHT = new Float32Array([0, 0, 0, 1]);

/**
 * The joints that a stream rotates, and their ancestors, as `Rig` takes them. Every other joint moves with one of them, as a finger
 * does with the hand: `carriers` has the index of that one for each joint of the body, and `settled` the matrix that takes the
 * joint's skin from the bind pose to rest beside its carrier; null if it is the carrier itself.
 */
export function posedJoints(joints, boneNames) {
  const kept = new Set();
  joints.forEach(({ name }, joint) => {
    if (!boneNames.includes(name)) return;
    for (let above = joint; above >= 0 && !kept.has(above); above = joints[above].parent) kept.add(above);
  });
  const carriers = [];
  const posed = [];
  joints.forEach((joint, k) => {
    carriers.push(kept.has(k) ? posed.length : carriers[joint.parent]);
    if (kept.has(k)) posed.push({ ...joint, parent: joint.parent < 0 ? -1 : carriers[joint.parent] });
  });
  const rest = new Float32Array(16 * joints.length), carried = new Float32Array(16 * posed.length);
  const upright = Float32Array.from([0, 0, 0, ...boneNames.flatMap(() => [0, 0, 0, 1])]);
  new Rig(joints, boneNames).matrices(upright, rest);
  new Rig(posed, boneNames).matrices(upright, carried);
  const of = (matrices, k) => matrices.subarray(16 * k, 16 * k + 16);
  const settled = carriers.map((carrier, k) => (kept.has(k) ? null : product(inverse(of(carried, carrier)), of(rest, k))));
  return { posed, carriers, settled };
}

/** Puts skin { position, normal, skinIndex, skinWeight } to rest, as `posedJoints` describes, and binds it to the carriers. */
export function settle({ position, normal, skinIndex, skinWeight }, { carriers, settled }) {
  for (let vertex = 0; vertex < position.length / 3; vertex += 1) {
    const own = [0, 1, 2, 3].map((k) => 4 * vertex + k);
    if (own.some((k) => skinWeight[k] && settled[skinIndex[k]])) {
      for (const [values, moved] of [[position, 1], [normal, 0]]) {
        const [x, y, z] = values.subarray(3 * vertex, 3 * vertex + 3);
        for (let axis = 0; axis < 3; axis += 1) {
          values[3 * vertex + axis] = own.reduce((sum, k) => {
            const m = settled[skinIndex[k]];
            const to = m ? m[axis] * x + m[4 + axis] * y + m[8 + axis] * z + moved * m[12 + axis] : [x, y, z][axis];
            return sum + skinWeight[k] * to;
          }, 0);
        }
      }
    }
    for (const k of own) skinIndex[k] = carriers[skinIndex[k]];
  }
}

/** The joints of one body. */
export class Rig {
  /**
   * `joints`: { name, parent (index, -1 for the root), offset [x, y, z] to the parent at rest, inverse (inverse bind matrix, 16
   * numbers by columns) }, parents before children. `boneNames`: the bones of a frame's rotations, in order. Throws if the body lacks
   * one of them.
   */
  constructor(joints, boneNames) {
    const index = new Map(joints.map(({ name }, joint) => [name, joint]));
    const missing = boneNames.filter((name) => !index.has(name));
    if (missing.length) throw new Error(`the body has no bone ${missing.join(", ")}`);
    this.index = index;
    this.count = joints.length;
    this.parents = Int16Array.from(joints, ({ parent }) => parent);
    this.offsets = Float32Array.from(joints.flatMap(({ offset }) => offset));
    this.inverses = Float32Array.from(joints.flatMap(({ inverse }) => [...inverse]));
    this.source = new Int16Array(this.count).fill(-1); // index of a frame's rotation; -1: at rest
    boneNames.forEach((name, bone) => {
      this.source[index.get(name)] = bone;
    });
    this.turns = new Float32Array(4 * this.count); // in the world, x, y, z, w
    this.places = new Float32Array(3 * this.count);
  }

  /** Writes the matrices of a frame (hips x, y, z, then x, y, z, w per bone) into `out`, 16 numbers per joint. */
  matrices(frame, out, at = 0) {
    for (let joint = 0; joint < this.count; joint += 1) {
      this.#place(joint, frame);
      this.#matrix(joint, out, at + 16 * joint);
    }
  }

  /** Where a joint is in the last frame, or null if there is none of this name. */
  placeOf(name) {
    const joint = this.index.get(name);
    return joint === undefined ? null : this.places.subarray(3 * joint, 3 * joint + 3);
  }

  #place(joint, frame) {
    const { turns, places, offsets } = this;
    const parent = this.parents[joint];
    const source = this.source[joint];
    if (parent < 0) {
      for (let axis = 0; axis < 3; axis += 1) places[3 * joint + axis] = frame[axis];
    } else {
      rotate(turns, 4 * parent, offsets, 3 * joint, places, 3 * joint);
      for (let axis = 0; axis < 3; axis += 1) places[3 * joint + axis] += places[3 * parent + axis];
    }
    if (source < 0) copy(parent < 0 ? UPRIGHT : turns, Math.max(0, 4 * parent), turns, 4 * joint);
    else if (parent < 0) copy(frame, 3 + 4 * source, turns, 4 * joint);
    else multiply(turns, 4 * parent, frame, 3 + 4 * source, turns, 4 * joint);
  }

  /** out = [turn | place] · inverse bind. */
  #matrix(joint, out, at) {
    const { turns, places, inverses } = this;
    const x = turns[4 * joint], y = turns[4 * joint + 1], z = turns[4 * joint + 2], w = turns[4 * joint + 3];
    const xx = 1 - 2 * (y * y + z * z), yx = 2 * (x * y + w * z), zx = 2 * (x * z - w * y);
    const xy = 2 * (x * y - w * z), yy = 1 - 2 * (x * x + z * z), zy = 2 * (y * z + w * x);
    const xz = 2 * (x * z + w * y), yz = 2 * (y * z - w * x), zz = 1 - 2 * (x * x + y * y);
    for (let column = 0; column < 16; column += 4) {
      const from = 16 * joint + column, to = at + column;
      const a = inverses[from], b = inverses[from + 1], c = inverses[from + 2];
      out[to] = xx * a + xy * b + xz * c;
      out[to + 1] = yx * a + yy * b + yz * c;
      out[to + 2] = zx * a + zy * b + zz * c;
    }
    for (let axis = 0; axis < 3; axis += 1) out[at + 12 + axis] += places[3 * joint + axis];
    out[at + 15] = 1;
  }
}

function copy(p, i, out, k) {
  for (let n = 0; n < 4; n += 1) out[k + n] = p[i + n];
}

function rotate(q, i, v, j, out, k) {
  const x = q[i], y = q[i + 1], z = q[i + 2], w = q[i + 3];
  const a = v[j], b = v[j + 1], c = v[j + 2];
  const tx = 2 * (y * c - z * b), ty = 2 * (z * a - x * c), tz = 2 * (x * b - y * a);
  out[k] = a + w * tx + y * tz - z * ty;
  out[k + 1] = b + w * ty + z * tx - x * tz;
  out[k + 2] = c + w * tz + x * ty - y * tx;
}

function multiply(p, i, q, j, out, k) {
  const ax = p[i], ay = p[i + 1], az = p[i + 2], aw = p[i + 3];
  const bx = q[j], by = q[j + 1], bz = q[j + 2], bw = q[j + 3];
  out[k] = aw * bx + ax * bw + ay * bz - az * by;
  out[k + 1] = aw * by - ax * bz + ay * bw + az * bx;
  out[k + 2] = aw * bz + ax * by - ay * bx + az * bw;
  out[k + 3] = aw * bw - ax * bx - ay * by - az * bz;
}
