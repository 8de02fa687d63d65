// Soles of a character, from its mesh at rest: clients/README.md, "Retargeting", 5.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "wayfarer/bone_map.hpp"

namespace wayfarer {

/// Points of a mesh that may touch the ground, in the basis, at rest.
struct Soles {
  struct Foot {
    std::vector<Vec3> fixed;  // moved by the ankle, from its joint
    std::vector<Vec3> toes;   // moved by the toes, from their joint
  };
  double floor = 0;  // height of the lowest
  std::array<Foot, 2> feet;
};

/// The soles of a character. `places` are its mesh's vertices at rest, in its own space; `nodes` are the nodes of the
/// rig that move each most. nullopt: a foot has no vertices, or they end above its ankle.
std::optional<Soles> measure_soles(const BoneMap& map, const std::vector<Vec3>& places, const std::vector<int>& nodes,
                                   const Basis& basis = bases::gltf);

}  // namespace wayfarer
