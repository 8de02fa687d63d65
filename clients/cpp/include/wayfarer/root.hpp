// A smooth root for capsules, cameras and root motion: clients/README.md, "Smooth root".
#pragma once

#include <limits>

#include "wayfarer/bases.hpp"

namespace wayfarer {

/// Ground point and heading of an agent, from its sampled poses. Allocates nothing.
class SmoothRoot {
 public:
  explicit SmoothRoot(const Basis& basis, double metres_per_unit = 1)
      : basis_(basis), jump_(2 / metres_per_unit) {}

  /// At `time`: hips' place and rotation of a frame (its first seven numbers), height of the ground there.
  void update(double time, const float* frame, double ground);
  /// Point on the ground.
  const Vec3& point() const { return point_; }
  /// Radians, continuous beyond π. NaN before the first update.
  double heading() const { return heading_.value; }

 private:
  struct Follower {
    double value = std::numeric_limits<double>::quiet_NaN(), rate = 0;
    void follow(double target, double step, double jump);
  };

  Basis basis_;
  double jump_;
  double last_ = std::numeric_limits<double>::quiet_NaN();
  Follower left_, forward_, up_, heading_;
  Vec3 point_{};
};

}  // namespace wayfarer
