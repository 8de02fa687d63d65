// A character's skeleton at rest, as its file has it.
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "wayfarer/quaternions.hpp"

namespace wayfarer {

inline constexpr int BONE_COUNT = 22;
/// The bones of a stream's profile `body`, in order.
inline constexpr std::array<std::string_view, BONE_COUNT> BONES{
    "pelvis",        "left_hip",       "right_hip",  "spine1",      "left_knee",   "right_knee",
    "spine2",        "left_ankle",     "right_ankle", "spine3",     "left_foot",   "right_foot",
    "neck",          "left_collar",    "right_collar", "head",      "left_shoulder", "right_shoulder",
    "left_elbow",    "right_elbow",    "left_wrist", "right_wrist"};
/// Parent of each bone; -1: none.
inline constexpr std::array<int, BONE_COUNT> PARENTS{-1, 0, 0, 0,  1,  2,  3,  4,  5,  6,  7,
                                                     8,  9, 9, 9, 12, 13, 14, 16, 17, 18, 19};

/// Number of a bone; -1 for an unknown name.
constexpr int bone_number(std::string_view name) {
  for (int b = 0; b < BONE_COUNT; ++b)
    if (BONES[static_cast<std::size_t>(b)] == name) return b;
  return -1;
}

/// A node of the file: its rest transform relative to its parent. `parent` is the parent's number, -1: none.
struct Node {
  std::string name;
  int parent = -1;
  Vec3 position{};
  Quat rotation{};
  Vec3 scale{1, 1, 1};
};

/// Nodes, parents before children, and where they are at rest in the character's own space.
class Rig {
 public:
  /// Throws std::invalid_argument when a parent stands behind its child.
  explicit Rig(std::vector<Node> nodes);

  const std::vector<Node>& nodes() const { return nodes_; }
  const Node& node(int k) const { return nodes_[static_cast<std::size_t>(k)]; }
  const std::vector<int>& children(int k) const { return children_[static_cast<std::size_t>(k)]; }
  /// Places and rotations in the character's space.
  const Vec3& place(int k) const { return places_[static_cast<std::size_t>(k)]; }
  const Quat& rotation(int k) const { return rotations_[static_cast<std::size_t>(k)]; }
  /// Product of scales from the top; right if each is equal along all axes.
  const Vec3& scale(int k) const { return scales_[static_cast<std::size_t>(k)]; }
  /// Ancestors of a node, from its parent to the top.
  std::vector<int> ancestors(int k) const;

 private:
  std::vector<Node> nodes_;
  std::vector<Vec3> places_, scales_;
  std::vector<Quat> rotations_;
  std::vector<std::vector<int>> children_;
};

}  // namespace wayfarer
