// The bases a session may choose (docs/wire-format.md), as its clients need them.

/**
 * Unit vectors of a body at heading 0; `handed` is 1 when the axes are right-handed, -1 when left-handed.
 * @typedef {{ left: Float64Array, up: Float64Array, forward: Float64Array, handed: number }} Basis
 */

/** @param {string} left @param {string} up @param {string} forward @returns {Basis} */
function basis(left, up, forward) {
  const [l, u, f] = [left, up, forward].map((axis) => (
    Float64Array.from(["x", "y", "z"], (name) => (axis[1] === name ? Number(`${axis[0]}1`) : 0))
  ));
  return Object.freeze({ left: l, up: u, forward: f, handed: dot(cross(l, u), f) });
}

/** By name, as in the API. */
export const BASES = Object.freeze({
  gltf: basis("+x", "+y", "+z"),
  unity: basis("-x", "+y", "+z"),
  unreal: basis("-y", "+z", "+x"),
  unreal_mannequin: basis("+x", "+z", "+y"),
  blender: basis("+x", "+z", "-y"),
  ros: basis("+y", "+z", "+x"),
});

/** @param {Float64Array} a @param {Float64Array} b */
export function dot(a, b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/** @param {Float64Array} a @param {Float64Array} b */
export function cross(a, b) {
  return Float64Array.of(a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]);
}

const FOUND = new Float64Array(1);

/**
 * The angle about `up` by which a rotation (x, y, z, w at `at`) turns `forward`, radians.
 * @param {Basis} basis @param {ArrayLike<number>} q @param {number} [at]
 */
export function headingOf(basis, q, at = 0) {
  putHeading(basis, q, at, FOUND, 0);
  return FOUND[0];
}

/**
 * out = the heading, as above.
 * @param {Basis} basis @param {ArrayLike<number>} q @param {number} at @param {Float64Array} out @param {number} k
 */
export function putHeading({ up, forward }, q, at, out, k) {
  const x = q[at], y = q[at + 1], z = q[at + 2], w = q[at + 3];
  const a = forward[0], b = forward[1], c = forward[2];
  const tx = 2 * (y * c - z * b), ty = 2 * (z * a - x * c), tz = 2 * (x * b - y * a);
  const vx = a + w * tx + y * tz - z * ty, vy = b + w * ty + z * tx - x * tz, vz = c + w * tz + x * ty - y * tx;
  // cross(up, forward), the same algebra in every basis
  const sx = up[1] * c - up[2] * b, sy = up[2] * a - up[0] * c, sz = up[0] * b - up[1] * a;
  out[k] = Math.atan2(vx * sx + vy * sy + vz * sz, vx * a + vy * b + vz * c);
}
