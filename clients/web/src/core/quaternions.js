// Rotations as unit quaternions x, y, z, w in flat arrays: (array, index of x). Left-handed bases have the same
// algebra. `out` may be one of the inputs. Only Float64Array is taken: with arrays of several kinds these functions
// would be many times slower, and allocate.

/**
 * out = the rotation q, then p.
 * @param {Float64Array} p @param {number} i @param {Float64Array} q @param {number} j @param {Float64Array} out @param {number} k
 */
export function multiply(p, i, q, j, out, k) {
  const ax = p[i], ay = p[i + 1], az = p[i + 2], aw = p[i + 3];
  const bx = q[j], by = q[j + 1], bz = q[j + 2], bw = q[j + 3];
  out[k] = aw * bx + ax * bw + ay * bz - az * by;
  out[k + 1] = aw * by - ax * bz + ay * bw + az * bx;
  out[k + 2] = aw * bz + ax * by - ay * bx + az * bw;
  out[k + 3] = aw * bw - ax * bx - ay * by - az * bz;
}

/**
 * out = the inverse of p, after q: what q is relative to p.
 * @param {Float64Array} p @param {number} i @param {Float64Array} q @param {number} j @param {Float64Array} out @param {number} k
 */
export function relative(p, i, q, j, out, k) {
  const ax = -p[i], ay = -p[i + 1], az = -p[i + 2], aw = p[i + 3];
  const bx = q[j], by = q[j + 1], bz = q[j + 2], bw = q[j + 3];
  out[k] = aw * bx + ax * bw + ay * bz - az * by;
  out[k + 1] = aw * by - ax * bz + ay * bw + az * bx;
  out[k + 2] = aw * bz + ax * by - ay * bx + az * bw;
  out[k + 3] = aw * bw - ax * bx - ay * by - az * bz;
}

/**
 * out = the vector v, turned by q.
 * @param {Float64Array} q @param {number} i @param {Float64Array} v @param {number} j @param {Float64Array} out @param {number} k
 */
export function rotate(q, i, v, j, out, k) {
  const x = q[i], y = q[i + 1], z = q[i + 2], w = q[i + 3];
  const a = v[j], b = v[j + 1], c = v[j + 2];
  const tx = 2 * (y * c - z * b), ty = 2 * (z * a - x * c), tz = 2 * (x * b - y * a);
  out[k] = a + w * tx + y * tz - z * ty;
  out[k + 1] = b + w * ty + z * tx - x * tz;
  out[k + 2] = c + w * tz + x * ty - y * tx;
}

/**
 * out = the vector v, turned back by q.
 * @param {Float64Array} q @param {number} i @param {Float64Array} v @param {number} j @param {Float64Array} out @param {number} k
 */
export function rotateBack(q, i, v, j, out, k) {
  const x = -q[i], y = -q[i + 1], z = -q[i + 2], w = q[i + 3];
  const a = v[j], b = v[j + 1], c = v[j + 2];
  const tx = 2 * (y * c - z * b), ty = 2 * (z * a - x * c), tz = 2 * (x * b - y * a);
  out[k] = a + w * tx + y * tz - z * ty;
  out[k + 1] = b + w * ty + z * tx - x * tz;
  out[k + 2] = c + w * tz + x * ty - y * tx;
}

/**
 * out = the least rotation that turns the direction of a into that of b.
 * @param {Float64Array} a @param {number} i @param {Float64Array} b @param {number} j @param {Float64Array} out @param {number} k
 */
export function arc(a, i, b, j, out, k) {
  const n = Math.sqrt((a[i] * a[i] + a[i + 1] * a[i + 1] + a[i + 2] * a[i + 2])
    * (b[j] * b[j] + b[j + 1] * b[j + 1] + b[j + 2] * b[j + 2]));
  const w = 1 + (a[i] * b[j] + a[i + 1] * b[j + 1] + a[i + 2] * b[j + 2]) / n;
  let x, y, z;
  if (w < 1e-9) { // opposite: about any axis across
    const ax = Math.abs(a[i]), ay = Math.abs(a[i + 1]), az = Math.abs(a[i + 2]);
    if (ax <= ay && ax <= az) x = 0, y = a[i + 2], z = -a[i + 1];
    else if (ay <= az) x = -a[i + 2], y = 0, z = a[i];
    else x = a[i + 1], y = -a[i], z = 0;
    const length = Math.sqrt(x * x + y * y + z * z);
    out[k] = x / length, out[k + 1] = y / length, out[k + 2] = z / length, out[k + 3] = 0;
    return;
  }
  x = (a[i + 1] * b[j + 2] - a[i + 2] * b[j + 1]) / n;
  y = (a[i + 2] * b[j] - a[i] * b[j + 2]) / n;
  z = (a[i] * b[j + 1] - a[i + 1] * b[j]) / n;
  const length = Math.sqrt(x * x + y * y + z * z + w * w);
  out[k] = x / length, out[k + 1] = y / length, out[k + 2] = z / length, out[k + 3] = w / length;
}

/**
 * The rotation that turns the axes `from` into the axes `to`, each three unit vectors of one handedness.
 * @param {ArrayLike<number>[]} from @param {ArrayLike<number>[]} to @returns {Float64Array} x, y, z, w
 */
export function between(from, to) {
  // matrix m[row][column] = sum over axes of to · fromᵀ, then Shepperd's method
  const m = [0, 1, 2].map((r) => [0, 1, 2].map((c) => from.reduce((sum, axis, n) => sum + to[n][r] * axis[c], 0)));
  const choices = [m[0][0], m[1][1], m[2][2], m[0][0] + m[1][1] + m[2][2]];
  const k = choices.indexOf(Math.max(...choices));
  const q = [0, 0, 0, 0];
  if (k === 3) {
    q[0] = m[2][1] - m[1][2], q[1] = m[0][2] - m[2][0], q[2] = m[1][0] - m[0][1], q[3] = 1 + choices[3];
  } else {
    const i = k, j = (k + 1) % 3, n = (k + 2) % 3;
    q[i] = 1 + m[i][i] - m[j][j] - m[n][n];
    q[j] = m[j][i] + m[i][j];
    q[n] = m[n][i] + m[i][n];
    q[3] = m[n][j] - m[j][n];
  }
  const length = Math.hypot(...q);
  return Float64Array.from(q, (value) => value / length);
}
