// Maps nodes of a rig to bones: by VRM's table, otherwise by names, otherwise by shape. clients/README.md, "Bones of a
// character".
#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "wayfarer/bases.hpp"
#include "wayfarer/rig.hpp"

namespace wayfarer {

/// A rig's nodes by canonical bone, and how they were found.
class BoneMap {
 public:
  using Changes = std::map<std::string, std::optional<std::string>>;  // bone → name of its node; nullopt: none
  using Nodes = std::array<int, BONE_COUNT>;  // by bone; -1: the rig lacks it

  /// Throws std::invalid_argument when these nodes are not the bones of a humanoid.
  BoneMap(Rig rig, const Nodes& nodes, std::string found_by);

  const Rig& rig() const { return rig_; }
  const Nodes& nodes() const { return nodes_; }
  /// "vrm", "names", "shape"; "user" after a correction.
  const std::string& found_by() const { return found_by_; }
  /// Bones that the rig lacks; their children take over their rotations.
  std::vector<std::string> missing() const;
  /// Canonical name, name of the node: to show it, or keep it.
  std::vector<std::pair<std::string, std::string>> table() const;
  /// The map with other nodes for some bones (by node name), or without them (nullopt). Throws std::invalid_argument.
  BoneMap corrected(const Changes& changes) const;

 private:
  Rig rig_;
  Nodes nodes_;
  std::string found_by_;
};

/// The map of a rig. `humanoid`: VRM's names → nodes. `basis`: gives the up of the rig's space. `correct`: as for
/// BoneMap::corrected; it also serves rigs that would be refused without it. Throws std::invalid_argument that names
/// missing hips or legs.
BoneMap map_bones(const Rig& rig, const std::map<std::string, int>& humanoid = {}, const Basis& basis = bases::gltf,
                  const BoneMap::Changes& correct = {});

}  // namespace wayfarer
