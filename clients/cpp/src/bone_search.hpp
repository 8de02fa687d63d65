// What the searches for bones share: by names, by shape.
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

/// From a node down to one below it.
Line path(const Rig& rig, int top, int bottom);
/// A node and all below it, level by level.
Line subtree(const Rig& rig, int node);
/// Of a path, those at least so far from the one before: the later of two at one place.
Line joints(const Rig& rig, const Line& line, double least);
/// Nodes between pelvis and neck → spine bones: the last, from which arms hang, is spine3.
void spread_spine(const Line& chain, Nodes& nodes);

Nodes by_vrm(const std::map<std::string, int>& humanoid);
/// What the names tell, enough for a humanoid or not.
Nodes by_names(const Rig& rig);
/// A node of a limb whose name tells the other side than its bone; -1: none does, or most tell the side that was found.
int contradicted(const Rig& rig, const Nodes& nodes);

/// Branches of a rig that reach the ground, and what follows from them.
class Shape {
 public:
  Shape(const Rig& rig, const Basis& basis);
  /// What the shape tells, enough for a humanoid or not.
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
