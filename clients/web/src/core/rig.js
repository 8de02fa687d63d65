// A character's skeleton at rest, as its file has it.

import { multiply, rotate } from "./quaternions.js";

/** The 22 bones of a stream's profile `body`, in order. */
export const BONES = Object.freeze([
  "pelvis", "left_hip", "right_hip", "spine1", "left_knee", "right_knee", "spine2", "left_ankle", "right_ankle",
  "spine3", "left_foot", "right_foot", "neck", "left_collar", "right_collar", "head", "left_shoulder",
  "right_shoulder", "left_elbow", "right_elbow", "left_wrist", "right_wrist",
]);
/** Parent of each bone; -1: none. */
export const PARENTS = Object.freeze([-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19]);

/**
 * A node of the file: its rest transform relative to its parent. `parent` is the parent's number, -1: none.
 * @typedef {object} Node
 * @property {string} name
 * @property {number} parent
 * @property {ArrayLike<number>} [position]
 * @property {ArrayLike<number>} [rotation] x, y, z, w
 * @property {ArrayLike<number>} [scale]
 */

/** Nodes, parents before children, and where they are at rest in the character's own space. */
export class Rig {
  /** @param {Node[]} nodes */
  constructor(nodes) {
    this.nodes = nodes;
    this.rotations = new Float64Array(4 * nodes.length);
    this.places = new Float64Array(3 * nodes.length);
    /** Products of scales from the top; right if each is equal along all axes. */
    this.scales = new Float64Array(3 * nodes.length);
    /** @type {number[][]} */
    this.children = nodes.map(() => []);
    nodes.forEach((node, k) => this.#place(node, k));
  }

  /** @param {Node} node @param {number} k */
  #place({ name, parent, position = [0, 0, 0], rotation = [0, 0, 0, 1], scale = [1, 1, 1] }, k) {
    if (!(parent >= -1 && parent < k)) throw new Error(`node ${k} (${name}): its parent must stand before it`);
    const length = Math.hypot(rotation[0], rotation[1], rotation[2], rotation[3]);
    const own = Float64Array.from([0, 1, 2, 3], (n) => rotation[n] / length);
    const { rotations, places, scales } = this;
    if (parent < 0) {
      rotations.set(own, 4 * k);
      places.set([position[0], position[1], position[2]], 3 * k);
      scales.set([scale[0], scale[1], scale[2]], 3 * k);
      return;
    }
    this.children[parent].push(k);
    multiply(rotations, 4 * parent, own, 0, rotations, 4 * k);
    const offset = Float64Array.from([0, 1, 2], (n) => scales[3 * parent + n] * position[n]);
    rotate(rotations, 4 * parent, offset, 0, places, 3 * k);
    for (let n = 0; n < 3; n += 1) {
      places[3 * k + n] += places[3 * parent + n];
      scales[3 * k + n] = scales[3 * parent + n] * scale[n];
    }
  }

  /** Place of a node. @param {number} node */
  place(node) {
    return this.places.slice(3 * node, 3 * node + 3);
  }

  /** Rotation of a node in the character's space; the identity for -1. @param {number} node */
  rotation(node) {
    return node < 0 ? Float64Array.of(0, 0, 0, 1) : this.rotations.slice(4 * node, 4 * node + 4);
  }

  /** Ancestors of a node, from its parent to the top. @param {number} node @returns {number[]} */
  ancestors(node) {
    const found = [];
    for (let k = this.nodes[node].parent; k >= 0; k = this.nodes[k].parent) found.push(k);
    return found;
  }
}
