// Shared by the searches for bones by names and by shape.
#pragma once

#include <algorithm>
#include <string_view>
#include <vector>

#include "wayfarer/bone_map.hpp"

namespace wayfarer::bone_search {

using Nodes = BoneMap::Nodes;
using Line = std::vector<int>;

constexpr int bone(std::string_view name) { return bone_number(name); }
struct Side {
  std::string_view name;
  int hip, knee, ankle, foot, collar, shoulder, elbow, wrist;
};
inline constexpr Side SIDES[2]{
    {"left", bone("left_hip"), bone("left_knee"), bone("left_ankle"), bone("left_foot"), bone("left_collar"),
     bone("left_shoulder"), bone("left_elbow"), bone("left_wrist")},
    {"right", bone("right_hip"), bone("right_knee"), bone("right_ankle"), bone("right_foot"), bone("right_collar"),
     bone("right_shoulder"), bone("right_elbow"), bone("right_wrist")}};
inline constexpr int PELVIS = bone("pelvis"), NECK = bone("neck"), HEAD = bone("head");
inline constexpr int SPINE[3]{bone("spine1"), bone("spine2"), bone("spine3")};

inline std::size_t at(int k) { return static_cast<std::size_t>(k); }

template <class List, class Value>
bool contains(const List& list, const Value& value) {
  return std::find(std::begin(list), std::end(list), value) != std::end(list);
}

inline Nodes none() {
  Nodes nodes;
  nodes.fill(-1);
  return nodes;
}

/// The nodes from a node down to a descendant.
Line path(const Rig& rig, int top, int bottom);
/// A node and all below it, level by level.
Line subtree(const Rig& rig, int node);
/// The nodes of a path, without those nearer than `least` to the one kept before.
Line joints(const Rig& rig, const Line& line, double least);
/// Nodes between pelvis and neck → spine bones: the last, from which arms hang, is spine3.
void spread_spine(const Line& chain, Nodes& nodes);

Nodes by_vrm(const std::map<std::string, int>& humanoid);
/// The bones that names reveal, enough for a humanoid or not.
Nodes by_names(const Rig& rig);
/// A node of a limb whose name gives the other side than its bone; -1: none, or most agree with the side found.
int contradicted(const Rig& rig, const Nodes& nodes);

/// Branches of a rig that reach the ground, and the bones that follow from them.
class Shape {
 public:
  Shape(const Rig& rig, const Basis& basis);
  /// The bones that the shape reveals, enough for a humanoid or not.
  Nodes nodes() const;
  /// A pair of legs of the same body that hangs far from these two thighs; empty: none does.
  Line other_legs(int pelvis, const Line& hips) const;

 private:
  struct Pair {  // a node, and the joints of two branches of at least three that reach the ground apart
    int above;
    Line chains[2];
  };
  int lowest(int node) const;
  Vec3 toes(const Line& chain) const;
  void upper(const Line& spine, const Vec3& left, Nodes& nodes) const;
  void arm_of(const Side& side, const Line& line, Nodes& nodes) const;

  const Rig& rig_;
  const Basis& basis_;
  std::vector<double> height_;
  std::vector<Line> below_;
  std::vector<Pair> pairs_;
  double tall_ = 0;
};

}  // namespace wayfarer::bone_search
