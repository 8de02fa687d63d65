// What the mesh of a character at rest tells of its soles: clients/README.md, "Retargeting", 5.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "wayfarer/bone_map.hpp"

namespace wayfarer {

/// Points of a mesh that may touch the ground, in the basis, at rest.
struct Soles {
  struct Foot {
    std::vector<Vec3> fixed;  // from the ankle's joint: what the ankle moves
    std::vector<Vec3> toes;   // from the toes' joint: what the toes move
  };
  double floor = 0;  // height of the lowest
  std::array<Foot, 2> feet;
};

/// The soles of a character whose mesh has vertices at `places`, in its own space at rest, each of which the node `nodes`
/// of the rig moves most. Nothing where a foot has no vertices, or they end above its ankle.
std::optional<Soles> measure_soles(const BoneMap& map, const std::vector<Vec3>& places, const std::vector<int>& nodes,
                                   const Basis& basis = bases::gltf);

}  // namespace wayfarer
