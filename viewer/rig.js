// A body's bones as numbers: from a pose to the matrices that move its skin. No DOM, no three.js.

import { inverse, product } from "./client/core/skins.js";

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
    let moves = false;
    for (let k = 4 * vertex; k < 4 * vertex + 4; k += 1) moves ||= skinWeight[k] !== 0 && settled[skinIndex[k]] !== null;
    if (moves) {
      blend(position, vertex, 1, settled, skinIndex, skinWeight);
      blend(normal, vertex, 0, settled, skinIndex, skinWeight);
    }
    for (let k = 4 * vertex; k < 4 * vertex + 4; k += 1) skinIndex[k] = carriers[skinIndex[k]];
  }
}

/** Moves a vertex's value x, y, z by the matrices of its joints (null: it stays), each by its weight. `moved`: 1 for a place. */
function blend(values, vertex, moved, matrices, skinIndex, skinWeight) {
  const x = values[3 * vertex], y = values[3 * vertex + 1], z = values[3 * vertex + 2];
  let a = 0, b = 0, c = 0;
  for (let k = 4 * vertex; k < 4 * vertex + 4; k += 1) {
    const weight = skinWeight[k], m = matrices[skinIndex[k]];
    a += weight * (m ? m[0] * x + m[4] * y + m[8] * z + moved * m[12] : x);
    b += weight * (m ? m[1] * x + m[5] * y + m[9] * z + moved * m[13] : y);
    c += weight * (m ? m[2] * x + m[6] * y + m[10] * z + moved * m[14] : z);
  }
  values[3 * vertex] = a;
  values[3 * vertex + 1] = b;
  values[3 * vertex + 2] = c;
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
  matrices(frame, out, at = 0) { // it runs for each joint of each person in each picture: one loop takes half the time of many functions
    const { turns, places, offsets, inverses, parents, source, count } = this;
    for (let joint = 0; joint < count; joint += 1) {
      const parent = parents[joint], bone = source[joint], t = 4 * joint, p = 3 * joint;
      let x = 0, y = 0, z = 0, w = 1; // its turn in the world
      let px = frame[0], py = frame[1], pz = frame[2]; // and its place
      if (bone >= 0) {
        const from = 3 + 4 * bone;
        x = frame[from];
        y = frame[from + 1];
        z = frame[from + 2];
        w = frame[from + 3];
      }
      if (parent >= 0) {
        const ax = turns[4 * parent], ay = turns[4 * parent + 1], az = turns[4 * parent + 2], aw = turns[4 * parent + 3];
        const a = offsets[p], b = offsets[p + 1], c = offsets[p + 2];
        const tx = 2 * (ay * c - az * b), ty = 2 * (az * a - ax * c), tz = 2 * (ax * b - ay * a);
        px = places[3 * parent] + a + aw * tx + ay * tz - az * ty;
        py = places[3 * parent + 1] + b + aw * ty + az * tx - ax * tz;
        pz = places[3 * parent + 2] + c + aw * tz + ax * ty - ay * tx;
        const bx = x, by = y, bz = z, bw = w;
        x = aw * bx + ax * bw + ay * bz - az * by;
        y = aw * by - ax * bz + ay * bw + az * bx;
        z = aw * bz + ax * by - ay * bx + az * bw;
        w = aw * bw - ax * bx - ay * by - az * bz;
      }
      turns[t] = x;
      turns[t + 1] = y;
      turns[t + 2] = z;
      turns[t + 3] = w;
      places[p] = px;
      places[p + 1] = py;
      places[p + 2] = pz;
      // out = [turn | place] · inverse bind
      const xx = 1 - 2 * (y * y + z * z), yx = 2 * (x * y + w * z), zx = 2 * (x * z - w * y);
      const xy = 2 * (x * y - w * z), yy = 1 - 2 * (x * x + z * z), zy = 2 * (y * z + w * x);
      const xz = 2 * (x * z + w * y), yz = 2 * (y * z - w * x), zz = 1 - 2 * (x * x + y * y);
      const to = at + 16 * joint;
      for (let column = 0; column < 16; column += 4) {
        const from = 16 * joint + column;
        const a = inverses[from], b = inverses[from + 1], c = inverses[from + 2];
        out[to + column] = xx * a + xy * b + xz * c;
        out[to + column + 1] = yx * a + yy * b + yz * c;
        out[to + column + 2] = zx * a + zy * b + zz * c;
      }
      out[to + 12] += px;
      out[to + 13] += py;
      out[to + 14] += pz;
      out[to + 15] = 1;
    }
  }

  /** Where a joint is in the last frame, or null if there is none of this name. */
  placeOf(name) {
    const joint = this.index.get(name);
    return joint === undefined ? null : this.places.subarray(3 * joint, 3 * joint + 3);
  }
}
