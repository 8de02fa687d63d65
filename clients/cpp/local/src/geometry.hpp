// Points of the floor, and what frames are made of. World: metres, Z up, heading 0 faces +Y.
#pragma once

#include <array>
#include <vector>

#include "wayfarer/quaternions.hpp"

namespace wayfarer::local {

constexpr int FRAMES = 8, SEED = 2, JOINTS = 22, SOLES = 4, FPS = 40;  // SOLES: markers of a foot
constexpr double STEP_SECONDS = double(FRAMES) / FPS;
constexpr double PI = 3.14159265358979323846, DEGREE = PI / 180;
constexpr std::size_t KNEES[] = {4, 5}, SPINE[] = {3, 6, 9};  // numbers of joints

struct Point {
  double x = 0, y = 0;
};
inline Point operator+(Point a, Point b) { return {a.x + b.x, a.y + b.y}; }
inline Point operator-(Point a, Point b) { return {a.x - b.x, a.y - b.y}; }
inline Point operator*(double share, Point p) { return {share * p.x, share * p.y}; }
inline double dot(Point a, Point b) { return a.x * b.x + a.y * b.y; }
inline double cross(Point a, Point b) { return a.x * b.y - a.y * b.x; }
inline double length(Point p) { return std::hypot(p.x, p.y); }
inline Point unit(Point p) { return (1 / std::max(length(p), 1e-6)) * p; }
/// Radians from one unit vector to another, counterclockwise.
inline double turn_to(Point a, Point b) { return std::atan2(cross(a, b), dot(a, b)); }
inline Point turned(Point p, double angle) {
  return {std::cos(angle) * p.x - std::sin(angle) * p.y, std::sin(angle) * p.x + std::cos(angle) * p.y};
}
inline Point floor_of(const Vec3& v) { return {v.x, v.y}; }

inline double bounded(double value, double low, double high) { return std::min(std::max(value, low), high); }
inline double smooth(double value, double low, double high) {
  const double t = bounded((value - low) / (high - low), 0, 1);
  return t * t * (3 - 2 * t);
}

inline Quat operator+(const Quat& a, const Quat& b) { return {a.x + b.x, a.y + b.y, a.z + b.z, a.w + b.w}; }
inline Quat operator-(const Quat& a, const Quat& b) { return {a.x - b.x, a.y - b.y, a.z - b.z, a.w - b.w}; }
inline Quat operator*(double share, const Quat& q) { return {share * q.x, share * q.y, share * q.z, share * q.w}; }
inline double dot(const Quat& a, const Quat& b) { return a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w; }
inline Quat unit(const Quat& q) { return (1 / std::max(length(q), 1e-12)) * q; }
inline Quat about_x(double angle) { return {std::sin(angle / 2), 0, 0, std::cos(angle / 2)}; }
inline Quat about_z(double angle) { return {0, 0, std::sin(angle / 2), std::cos(angle / 2)}; }
/// What hips that are turned so face, on the floor.
inline Point facing_of(const Quat& q) {
  const Point ahead{-2 * (q.x * q.y + q.z * q.w), 1 - 2 * (q.y * q.y + q.z * q.z)};
  return (1 / std::max(length(ahead), 1e-9)) * ahead;
}

/// As the model and the server have it: float32.
inline double rounded(double value) { return static_cast<float>(value); }
inline Vec3 rounded(const Vec3& v) { return {rounded(v.x), rounded(v.y), rounded(v.z)}; }
inline Quat rounded(const Quat& q) { return {rounded(q.x), rounded(q.y), rounded(q.z), rounded(q.w)}; }

using Turns = std::array<Quat, JOINTS>;  // of a frame: hips in the world, others relative to their parents
using Markers = std::vector<Vec3>;       // of the seed's frames, one after another

/// New frames, and the markers that the next step starts from.
struct Step {
  std::array<Vec3, FRAMES> hips;
  std::array<Turns, FRAMES> turns;
  Markers markers;
  std::array<std::array<bool, 2>, FRAMES> contacts;  // left, right
};

/// The two frames that a step starts from.
struct Seed {
  std::array<Vec3, SEED> hips;
  std::array<Turns, SEED> turns;
  Markers markers;
};

}  // namespace wayfarer::local
