// Vectors and unit quaternions x, y, z, w. The same algebra holds in left-handed bases.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace wayfarer {

struct Vec3 {
  double x = 0, y = 0, z = 0;
};

struct Quat {
  double x = 0, y = 0, z = 0, w = 1;
};

inline Vec3 operator+(const Vec3& a, const Vec3& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec3 operator-(const Vec3& a, const Vec3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec3 operator-(const Vec3& v) { return {-v.x, -v.y, -v.z}; }
inline Vec3 operator*(double share, const Vec3& v) { return {share * v.x, share * v.y, share * v.z}; }
inline double dot(const Vec3& a, const Vec3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline double length(const Vec3& v) { return std::sqrt(dot(v, v)); }

inline Vec3 cross(const Vec3& a, const Vec3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

/// The part of `v` across the unit vector `axis`.
inline Vec3 without(const Vec3& v, const Vec3& axis) { return v - dot(v, axis) * axis; }

inline double length(const Quat& q) {
  return std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
}

inline Quat normalized(const Quat& q) {
  const double size = length(q);
  return {q.x / size, q.y / size, q.z / size, q.w / size};
}

/// The rotation `q`, then `p`.
inline Quat multiply(const Quat& p, const Quat& q) {
  return {p.w * q.x + p.x * q.w + p.y * q.z - p.z * q.y,
          p.w * q.y - p.x * q.z + p.y * q.w + p.z * q.x,
          p.w * q.z + p.x * q.y - p.y * q.x + p.z * q.w,
          p.w * q.w - p.x * q.x - p.y * q.y - p.z * q.z};
}

inline Quat inverse(const Quat& q) { return {-q.x, -q.y, -q.z, q.w}; }

/// `v` turned by `q`.
inline Vec3 rotate(const Quat& q, const Vec3& v) {
  const Vec3 axis{q.x, q.y, q.z};
  const Vec3 t = 2 * cross(axis, v);
  return v + q.w * t + cross(axis, t);
}

/// The least rotation that turns the direction of `a` into that of `b`.
inline Quat arc(const Vec3& a, const Vec3& b) {
  const double size = length(a) * length(b);
  const double w = 1 + dot(a, b) / size;
  if (w < 1e-9) {  // opposite: about any axis across
    const double x = std::abs(a.x), y = std::abs(a.y), z = std::abs(a.z);
    const Vec3 least = x <= y && x <= z ? Vec3{1, 0, 0} : y <= z ? Vec3{0, 1, 0} : Vec3{0, 0, 1};
    const Vec3 axis = cross(a, least);
    return normalized({axis.x, axis.y, axis.z, 0});
  }
  const Vec3 axis = (1 / size) * cross(a, b);
  return normalized({axis.x, axis.y, axis.z, w});
}

/// The rotation that turns the axes `from` into the axes `to`, each three unit vectors of one handedness.
inline Quat between(const Vec3 (&from)[3], const Vec3 (&to)[3]) {
  double m[3][3] = {};  // sum over axes of to · fromᵀ, then Shepperd's method
  for (int n = 0; n < 3; ++n) {
    const double row[3] = {to[n].x, to[n].y, to[n].z};
    const double column[3] = {from[n].x, from[n].y, from[n].z};
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) m[r][c] += row[r] * column[c];
  }
  const double choices[4] = {m[0][0], m[1][1], m[2][2], m[0][0] + m[1][1] + m[2][2]};
  const auto k = std::max_element(choices, choices + 4) - choices;
  double q[4];
  if (k == 3) {
    q[0] = m[2][1] - m[1][2], q[1] = m[0][2] - m[2][0], q[2] = m[1][0] - m[0][1];
    q[3] = 1 + choices[3];
  } else {
    const auto i = k, j = (k + 1) % 3, n = (k + 2) % 3;
    q[i] = 1 + m[i][i] - m[j][j] - m[n][n];
    q[j] = m[j][i] + m[i][j];
    q[n] = m[n][i] + m[i][n];
    q[3] = m[n][j] - m[j][n];
  }
  return normalized({q[0], q[1], q[2], q[3]});
}

}  // namespace wayfarer
