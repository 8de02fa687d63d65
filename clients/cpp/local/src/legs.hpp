// Legs of a body: the properties of its shape, the places of joints and soles in a posed frame, and two-bone inverse
// kinematics. It mirrors the server's world/output/legs.py and twobone.py, for one person. Left comes before right.
#pragma once

#include "geometry.hpp"

namespace wayfarer::local {

template <class T>
using Feet = std::array<T, 2>;
using Soles = std::array<Vec3, SOLES>;

/// Both legs in the T-pose: each joint relative to the one above it, and sole markers relative to ankle and ball, times
/// their share. `standing`: height of the hips.
struct Legs {
  Feet<Vec3> hip, knee, ankle, ball;
  Feet<Soles> sole_of_ankle, sole_of_ball;
  Feet<std::array<double, SOLES>> ball_share{};
  Feet<double> length{};
  double standing = 0;

  /// Fills `length` and `standing` from the rest.
  void measure();
};

/// Legs in a frame: turns in the world, joints seen from the root, soles in the world.
struct LegPose {
  Quat root;
  Feet<Quat> hip_turn, knee_turn, ankle_turn;
  Feet<Vec3> hip, knee, ankle;
  Feet<Soles> soles;
  Point facing;

  LegPose() = default;
  LegPose(const Legs& legs, const Vec3& hips, const Turns& turns);
};

/// Put each ankle `shifts` off. Writes hips, knees and ankles.
void move_ankles(const LegPose& pose, const Feet<Vec3>& shifts, Turns& turns);

double lowest(const Soles& soles);

}  // namespace wayfarer::local
