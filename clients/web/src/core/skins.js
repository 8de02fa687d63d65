// Rest is the bind pose of the skin, whatever frame of an animation the nodes stand in.

import { between } from "./quaternions.js";

const POSED = 0.01; // of the skeleton's size, and of an axis: a joint this far off another one is not in the bind pose

/**
 * A skin of a character: the numbers of its joints among the nodes, the inverse bind matrix of each (16 numbers, by
 * columns), and other spaces than those of the joints' ancestors in which it may have been bound, such as its meshes'.
 * @typedef {{ joints: number[], inverses: ArrayLike<number>[], spaces: ArrayLike<number>[] }} Skin
 * @typedef {import("./rig.js").Node} Node
 */

/**
 * The nodes in the bind pose of the skins; the same list if they stand in it.
 * @param {Node[]} nodes parents first @param {Skin[]} skins @returns {Node[]}
 */
export function boundNodes(nodes, skins) {
  const world = worldsOf(nodes);
  /** @type {Map<number, Float64Array>} */
  const wanted = new Map();
  for (const skin of [...skins].sort((a, b) => b.joints.length - a.joints.length)) {
    for (const [joint, matrix] of boundJoints(nodes, world, skin)) if (!wanted.has(joint)) wanted.set(joint, matrix);
  }
  if (!wanted.size) return nodes;
  /** @type {Float64Array[]} */
  const found = [];
  return nodes.map((node, k) => {
    const above = node.parent < 0 ? identity() : found[node.parent];
    const own = wanted.get(k);
    found[k] = own ?? product(above, localOf(node));
    return own ? { ...node, ...parts(product(inverse(above), own)) } : node;
  });
}

/**
 * Joints → their world matrices in the bind pose; none if they stand in it.
 * @param {Node[]} nodes @param {Float64Array[]} world @param {Skin} skin @returns {[number, Float64Array][]}
 */
function boundJoints(nodes, world, { joints, inverses, spaces }) {
  if (joints.length < 2 || joints.some((joint) => joint < 0)) return [];
  const bound = inverses.map(inverse);
  if (bound.some((matrix) => matrix.some(Number.isNaN))) return [];
  const shown = joints.map((joint) => world[joint]);
  const back = inverse(product(shown[0], inverses[0]));
  const since = shown.map((matrix, k) => product(back, product(matrix, product(inverses[k], bound[k]))));
  const extent = [12, 13, 14].map((n) => Math.max(...bound.map((m) => m[n])) - Math.min(...bound.map((m) => m[n])));
  const most = POSED * Math.max(...extent);
  if (since.every((matrix, k) => alike(matrix, bound[k], most))) return [];
  const depth = (/** @type {number} */ k) => ancestors(nodes, k).length;
  const top = joints.reduce((least, k) => (depth(k) < depth(least) ? k : least));
  const tried = [identity(), ...spaces.map((space) => Float64Array.from(space)), ...ancestors(nodes, top).map((k) => world[k])];
  const off = (/** @type {Float64Array} */ space) => median(bound.map((matrix, k) => apart(product(space, matrix), shown[k])));
  const space = tried.reduce((best, one) => (off(one) < off(best) ? one : best));
  return joints.map((joint, k) => [joint, product(space, bound[k])]);
}

/** @param {Float64Array} a @param {Float64Array} b @param {number} most */
function alike(a, b, most) {
  if ([12, 13, 14].some((n) => Math.abs(a[n] - b[n]) > most)) return false;
  const [p, q] = [axes(a), axes(b)];
  return p.every((value, n) => Math.abs(value - q[n]) <= POSED);
}

/** Difference between two matrices, in angle and size. @param {Float64Array} a @param {Float64Array} b */
function apart(a, b) {
  const [p, q] = [axes(a), axes(b)];
  const trace = p.reduce((sum, value, n) => sum + value * q[n], 0);
  const sizes = [a, b].map((m) => Math.cbrt(Math.abs(determinant(m))));
  return Math.acos(Math.min(1, Math.max(-1, (trace - 1) / 2))) + 10 * Math.abs(Math.log(sizes[0] / sizes[1]));
}

/** Numbers of a node's ancestors, to the top. @param {Node[]} nodes @param {number} node */
function ancestors(nodes, node) {
  const found = [];
  for (let k = nodes[node].parent; k >= 0; k = nodes[k].parent) found.push(k);
  return found;
}

/** @param {number[]} values */
function median(values) {
  return [...values].sort((a, b) => a - b)[values.length >> 1];
}

/** World matrices of nodes, parents first. @param {Node[]} nodes */
function worldsOf(nodes) {
  /** @type {Float64Array[]} */
  const found = [];
  for (const node of nodes) found.push(node.parent < 0 ? localOf(node) : product(found[node.parent], localOf(node)));
  return found;
}

/** @param {Node} node */
function localOf({ position = [0, 0, 0], rotation = [0, 0, 0, 1], scale = [1, 1, 1] }) {
  const length = Math.hypot(rotation[0], rotation[1], rotation[2], rotation[3]);
  const [x, y, z, w] = [0, 1, 2, 3].map((n) => rotation[n] / length);
  const [a, b, c] = [scale[0], scale[1], scale[2]];
  return Float64Array.of(
    a * (1 - 2 * (y * y + z * z)), 2 * a * (x * y + w * z), 2 * a * (x * z - w * y), 0,
    2 * b * (x * y - w * z), b * (1 - 2 * (x * x + z * z)), 2 * b * (y * z + w * x), 0,
    2 * c * (x * z + w * y), 2 * c * (y * z - w * x), c * (1 - 2 * (x * x + y * y)), 0,
    position[0], position[1], position[2], 1,
  );
}

/** @param {Float64Array} m @returns {{ position: number[], rotation: Float64Array, scale: number[] }} */
function parts(m) {
  const scale = [0, 4, 8].map((at) => Math.hypot(m[at], m[at + 1], m[at + 2]));
  const own = axes(m);
  const rows = [0, 3, 6].map((at) => own.slice(at, at + 3));
  const straight = [0, 1, 2].map((n) => Float64Array.of(+(n === 0), +(n === 1), +(n === 2)));
  return { position: [m[12], m[13], m[14]], rotation: between(straight, rows), scale };
}

/** The three axes, of unit length, one after the other. @param {Float64Array} m */
function axes(m) {
  return Float64Array.from([0, 4, 8].flatMap((at) => {
    const length = Math.hypot(m[at], m[at + 1], m[at + 2]);
    return [m[at] / length, m[at + 1] / length, m[at + 2] / length];
  }));
}

function identity() {
  return Float64Array.of(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1);
}

/** @param {ArrayLike<number>} a @param {ArrayLike<number>} b */
export function product(a, b) {
  const out = new Float64Array(16);
  for (let column = 0; column < 16; column += 4) {
    for (let row = 0; row < 4; row += 1) {
      for (let n = 0; n < 4; n += 1) out[column + row] += a[4 * n + row] * b[column + n];
    }
  }
  return out;
}

/** @param {ArrayLike<number>} m */
function determinant(m) {
  return m[0] * (m[5] * m[10] - m[6] * m[9]) - m[4] * (m[1] * m[10] - m[2] * m[9]) + m[8] * (m[1] * m[6] - m[2] * m[5]);
}

/** The inverse of a matrix whose last row is 0 0 0 1; NaN if there is none. @param {ArrayLike<number>} m */
export function inverse(m) {
  const size = determinant(m);
  const d = Math.abs(size) < 1e-12 ? NaN : 1 / size;
  const out = Float64Array.of(
    d * (m[5] * m[10] - m[6] * m[9]), d * (m[2] * m[9] - m[1] * m[10]), d * (m[1] * m[6] - m[2] * m[5]), 0,
    d * (m[6] * m[8] - m[4] * m[10]), d * (m[0] * m[10] - m[2] * m[8]), d * (m[2] * m[4] - m[0] * m[6]), 0,
    d * (m[4] * m[9] - m[5] * m[8]), d * (m[1] * m[8] - m[0] * m[9]), d * (m[0] * m[5] - m[1] * m[4]), 0,
    0, 0, 0, 1,
  );
  for (let n = 0; n < 3; n += 1) out[12 + n] = -(out[n] * m[12] + out[4 + n] * m[13] + out[8 + n] * m[14]);
  return out;
}
