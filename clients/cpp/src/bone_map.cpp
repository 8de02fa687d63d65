#include "wayfarer/bone_map.hpp"

#include <algorithm>
#include <set>
#include <sstream>
#include <stdexcept>

#include "bone_names.hpp"
#include "bone_search.hpp"

namespace wayfarer {
namespace {

using namespace bone_search;

constexpr int REQUIRED[]{PELVIS,         SIDES[0].hip,  SIDES[0].knee, SIDES[0].ankle,
                         SIDES[1].hip,   SIDES[1].knee, SIDES[1].ankle};
constexpr int TRUNK[]{PELVIS, SPINE[0], SPINE[1], SPINE[2], NECK, HEAD};
constexpr int BRANCHING[]{SIDES[0].hip, SIDES[1].hip, SIDES[0].collar, SIDES[1].collar, SIDES[0].shoulder,
                          SIDES[1].shoulder};  // they may hang from any bone of the trunk: they move with that bone
constexpr double UNEVEN = 1.01;   // greatest ratio between the scales of a node's axes
constexpr double BACKWARD = 0.2;  // cosine of the angle up to which toes may point backwards
constexpr double HEELS = 0.3;     // greatest height of an ankle over its leg's lowest node, by the thigh's height
constexpr const char* HINDLEGS =
    "legs as animals' hind legs, whose heels are off the ground, are not found by their shape. Say which bones these "
    "are, by a correction";

std::string name_of(int b) { return std::string(BONES[at(b)]); }
std::string quoted(const Rig& rig, int node) { return '"' + rig.node(node).name + '"'; }

std::string lacking(const Nodes& nodes) {
  std::string names;
  for (const int b : REQUIRED)
    if (nodes[at(b)] < 0) names += (names.empty() ? "" : ", ") + name_of(b);
  return names;
}

template <class Words>
std::string listed(const char* role, const Words& names) {
  std::string found = std::string(role) + ": ";
  for (const auto name : names) found += (name == names.front() ? "" : ", ") + std::string(name);
  return found;
}

/// Known names of missing bones.
std::string known_names(const Nodes& nodes) {
  std::string found;
  const auto add = [&](bool lacks, const std::string& row) {
    if (lacks) found += (found.empty() ? "" : "; ") + row;
  };
  const auto either = [&](int left, int right) { return nodes[at(left)] < 0 || nodes[at(right)] < 0; };
  add(nodes[at(PELVIS)] < 0, listed("pelvis", words::role_pelvis));
  add(either(SIDES[0].hip, SIDES[1].hip), listed("hip", words::role_hip));
  add(either(SIDES[0].knee, SIDES[1].knee), listed("knee", words::role_knee));
  add(either(SIDES[0].ankle, SIDES[1].ankle), listed("ankle", words::role_ankle));
  return found;
}

/// Whether a bone is above another on the way to the pelvis.
bool leads_to(int upper, int b) {
  while ((b = PARENTS[at(b)]) >= 0)
    if (b == upper) return true;
  return false;
}

/// The bone that this one wrongly hangs from or shares a node with; -1: none.
int misplaced(const Rig& rig, const Nodes& nodes, int b) {
  const int node = nodes[at(b)];
  for (int other = 0; other < BONE_COUNT; ++other)
    if (other != b && nodes[at(other)] == node) return other;
  int above = -1;
  for (const int k : rig.ancestors(node)) {
    const auto found = std::find(nodes.begin(), nodes.end(), k);
    if (found == nodes.end()) continue;
    above = static_cast<int>(found - nodes.begin());
    break;
  }
  if (above < 0 || leads_to(above, b)) return -1;
  const bool branches = contains(BRANCHING, b) || contains(TRUNK, b);
  return branches && contains(TRUNK, above) && !leads_to(b, above) ? -1 : above;
}

/// The bones without optional ones whose place is impossible.
Nodes kept(const Rig& rig, Nodes nodes) {
  for (int b = 0; b < BONE_COUNT; ++b)
    if (nodes[at(b)] >= 0 && !contains(REQUIRED, b) && misplaced(rig, nodes, b) >= 0) nodes[at(b)] = -1;
  return nodes;
}

void check(const Rig& rig, const Nodes& nodes) {
  if (const std::string names = lacking(nodes); !names.empty())
    throw std::invalid_argument("no node was found for " + names +
                                ", neither by names nor by shape: say which they are, by a correction. Known names, with "
                                "sides as in LeftFoot, foot_l, foot.L: " + known_names(nodes));
  std::set<int> line;
  for (int b = 0; b < BONE_COUNT; ++b) {
    if (nodes[at(b)] < 0) continue;
    for (const int k : rig.ancestors(nodes[at(b)])) line.insert(k);
    const int other = misplaced(rig, nodes, b);
    if (other < 0) continue;
    const bool twin = nodes[at(other)] == nodes[at(b)];
    throw std::invalid_argument(name_of(b) + ": " + quoted(rig, nodes[at(b)]) +
                                (twin ? " is " + name_of(other) + ", too" : " hangs from " + name_of(other)));
  }
  for (const int k : line) {
    const Vec3& scale = rig.node(k).scale;
    const double most = std::max({scale.x, scale.y, scale.z}), least = std::min({scale.x, scale.y, scale.z});
    if (most > 0 && most <= UNEVEN * least) continue;
    std::ostringstream sizes;
    sizes << scale.x << ", " << scale.y << ", " << scale.z;
    throw std::invalid_argument(quoted(rig, k) + " is scaled by " + sizes.str() +
                                ": bones below it would be sheared or mirrored as they turn. Apply its scale to the model, "
                                "and export it again");
  }
}

/// Throws for animals, and for sides that contradict each other.
void check_biped(const Rig& rig, const Nodes& nodes, const Basis& basis) {
  const Line hips{nodes[at(SIDES[0].hip)], nodes[at(SIDES[1].hip)]};
  if (const Line others = Shape(rig, basis).other_legs(nodes[at(PELVIS)], hips); !others.empty())
    throw std::invalid_argument("it has four legs (" + quoted(rig, hips[0]) + ", " + quoted(rig, hips[1]) + ", " +
                                quoted(rig, others[0]) + ", " + quoted(rig, others[1]) +
                                "): only what walks on two can be animated");
  if (const int node = contradicted(rig, nodes); node >= 0)
    throw std::invalid_argument(quoted(rig, node) +
                                " is on the other side than its name tells, by where the feet point: " + HINDLEGS);
  Vec3 up, toes;
  for (const Side& side : SIDES) {
    const Vec3& ankle = rig.place(nodes[at(side.ankle)]);
    up = up + rig.place(nodes[at(side.hip)]) - ankle;
    if (nodes[at(side.foot)] >= 0) toes = toes + rig.place(nodes[at(side.foot)]) - ankle;
  }
  for (const Side& side : SIDES) {
    const int ankle = nodes[at(side.ankle)];
    double low = dot(rig.place(ankle), up);
    for (const int k : subtree(rig, ankle)) low = std::min(low, dot(rig.place(k), up));
    if (dot(rig.place(ankle), up) - low > HEELS * (dot(rig.place(nodes[at(side.hip)]), up) - low))
      throw std::invalid_argument(quoted(rig, ankle) + " is high above the ground for an ankle: " + HINDLEGS);
  }
  const Vec3 forward = basis.handed * cross(rig.place(hips[0]) - rig.place(hips[1]), up);
  if (dot(toes, forward) < -BACKWARD * length(toes) * length(forward))
    throw std::invalid_argument("its toes point backwards: left and right are exchanged, or these are no feet (" +
                                quoted(rig, hips[0]) + " counts as left)");
}

}  // namespace

BoneMap::BoneMap(Rig rig, const Nodes& nodes, std::string found_by)
    : rig_(std::move(rig)), nodes_(nodes), found_by_(std::move(found_by)) {
  const int count = static_cast<int>(rig_.nodes().size());
  for (const int k : nodes_)
    if (k >= count) throw std::invalid_argument("the rig has no node " + std::to_string(k));
  check(rig_, nodes_);
}

std::vector<std::string> BoneMap::missing() const {
  std::vector<std::string> names;
  for (int b = 0; b < BONE_COUNT; ++b)
    if (nodes_[at(b)] < 0) names.push_back(name_of(b));
  return names;
}

std::vector<std::pair<std::string, std::string>> BoneMap::table() const {
  std::vector<std::pair<std::string, std::string>> rows;
  for (int b = 0; b < BONE_COUNT; ++b)
    if (nodes_[at(b)] >= 0) rows.emplace_back(name_of(b), rig_.node(nodes_[at(b)]).name);
  return rows;
}

namespace {

Nodes changed(const Rig& rig, Nodes nodes, const BoneMap::Changes& changes) {
  for (const auto& [bone_name, node_name] : changes) {
    const int b = bone(bone_name);
    if (b < 0) {
      std::string names;
      for (const auto name : BONES) names += (names.empty() ? "" : ", ") + std::string(name);
      throw std::invalid_argument("\"" + bone_name + "\" is no bone; bones are " + names);
    }
    nodes[at(b)] = -1;
    if (!node_name) continue;
    const auto& all = rig.nodes();
    const auto found = std::find_if(
        all.begin(), all.end(), [&name = *node_name](const Node& node) { return node.name == name; });
    if (found == all.end()) throw std::invalid_argument(bone_name + ": the rig has no node \"" + *node_name + "\"");
    nodes[at(b)] = static_cast<int>(found - all.begin());
  }
  return nodes;
}

/// The bones found, enough or not, and how they were found.
std::pair<Nodes, std::string> find(const Rig& rig, const std::map<std::string, int>& humanoid, const Basis& basis) {
  if (!humanoid.empty()) return {by_vrm(humanoid), "vrm"};
  const Nodes named = by_names(rig);
  if (lacking(named).empty()) return {named, "names"};
  const Nodes shaped = Shape(rig, basis).nodes();
  if (lacking(shaped).empty()) return {shaped, "shape"};
  return {named, "names"};
}

}  // namespace

BoneMap BoneMap::corrected(const Changes& changes) const { return {rig_, changed(rig_, nodes_, changes), "user"}; }

BoneMap map_bones(const Rig& rig, const std::map<std::string, int>& humanoid, const Basis& basis,
                  const BoneMap::Changes& correct) {
  const auto [nodes, found_by] = find(rig, humanoid, basis);
  if (!correct.empty()) return {rig, changed(rig, nodes, correct), "user"};
  BoneMap map{rig, kept(rig, nodes), found_by};
  check_biped(rig, map.nodes(), basis);
  return map;
}

}  // namespace wayfarer
