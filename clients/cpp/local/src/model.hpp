// An export (wayfarer.json, body_<gender>.bin): the graph's inputs, start poses, bones and soles of any shape.
#pragma once

#include "footlock.hpp"
#include "righting.hpp"

namespace wayfarer::local {

using Betas = std::array<double, 10>;
using SoleMarkers = std::array<int, 2 * SOLES>;  // numbers of the sole markers, left foot first

/// A body of one gender.
class Body {
 public:
  explicit Body(std::map<std::string, std::vector<float>> parts) : parts_(std::move(parts)) {}

  std::size_t poses() const { return part("start_rotations").size() / (4 * JOINTS); }
  /// Offsets of the bones from their parents in the T-pose; of the hips, over the floor.
  std::array<Vec3, JOINTS> bones(const Betas& betas) const;
  Legs legs(const Betas& betas) const;
  /// The seed of a person who stands in a start pose, soles on the floor, hips over `place`.
  Seed stand(std::size_t pose, const Betas& betas, const SoleMarkers& soles, Point place, double heading) const;

 private:
  std::map<std::string, std::vector<float>> parts_;

  const std::vector<float>& part(const std::string& name) const;
  std::vector<Vec3> shaped(const std::string& name, const Betas& betas, std::size_t from, std::size_t count) const;
  std::vector<Vec3> shaped(const std::string& name, const Betas& betas) const;
};

/// The graph's inputs for a mode.
struct ModeInputs {
  std::vector<float> term_weights;
  float policy = 0, temperature = 0, own = 0;  // own: share of the noise that is a person's own
};

}  // namespace wayfarer::local

namespace wayfarer {

struct LocalModel::Parts {
  std::vector<std::string> inputs, outputs;
  std::vector<std::vector<std::int64_t>> shapes;  // of the inputs; 0: people
  std::array<local::ModeInputs, 5> modes;
  std::map<std::string, double> steering;
  std::map<std::string, local::Body> bodies;
  local::SoleMarkers soles;
  std::vector<double> shares;  // of the markers when the spine turns, see righting.hpp
  std::vector<local::Feet<local::LegShare>> leg_shares;  // and when legs are moved, see footlock.hpp
  std::vector<std::size_t> mirrored_markers, mirrored_joints;
};

}  // namespace wayfarer
