#include "wayfarer/soles.hpp"

#include <cmath>
#include <limits>

#include "alignment.hpp"

namespace wayfarer {
namespace {

constexpr double STEEP[]{45, 75};  // outermost points are looked for in these directions: degrees off straight down
constexpr int ROUND = 8;           // number of directions around the vertical, for each

/// Directions down, and obliquely down all around.
std::vector<Vec3> sole_directions(const Basis& basis) {
  const double pi = 3.141592653589793;
  std::vector<Vec3> found{-basis.up};
  for (const double degrees : STEEP)
    for (int k = 0; k < ROUND; ++k) {
      const double steep = degrees * pi / 180, angle = 2 * pi * k / ROUND;
      const Vec3 beside = std::cos(angle) * basis.forward + std::sin(angle) * basis.left;
      found.push_back(std::sin(steep) * beside - std::cos(steep) * basis.up);
    }
  return found;
}

}  // namespace

std::optional<Soles> measure_soles(const BoneMap& map, const std::vector<Vec3>& places, const std::vector<int>& nodes,
                                   const Basis& basis) {
  const Rig& rig = map.rig();
  const Quat turn = alignment(map, basis);
  std::vector<int> owner(rig.nodes().size(), -1);
  for (int k = 0; k < static_cast<int>(owner.size()); ++k) {
    const int parent = rig.node(k).parent;
    if (parent >= 0) owner[static_cast<std::size_t>(k)] = owner[static_cast<std::size_t>(parent)];
    for (int b = 0; b < BONE_COUNT; ++b)
      if (map.nodes()[static_cast<std::size_t>(b)] == k) owner[static_cast<std::size_t>(k)] = b;
  }
  const std::vector<Vec3> directions = sole_directions(basis);
  const auto place_of = [&](int bone) { return rotate(turn, rig.place(map.nodes()[static_cast<std::size_t>(bone)])); };
  Soles soles;
  soles.floor = std::numeric_limits<double>::infinity();
  for (std::size_t leg = 0; leg < 2; ++leg) {
    Soles::Foot& foot = soles.feet[leg];
    for (const int bone : {LEGS[leg].ankle, LEGS[leg].toe}) {
      if (map.nodes()[static_cast<std::size_t>(bone)] < 0) continue;
      const Vec3 joint = place_of(bone);
      std::vector<double> best(directions.size(), -std::numeric_limits<double>::infinity());
      std::vector<std::size_t> outermost(directions.size(), places.size());
      for (std::size_t k = 0; k < places.size() && k < nodes.size(); ++k) {
        if (nodes[k] < 0 || static_cast<std::size_t>(nodes[k]) >= owner.size()) continue;
        if (owner[static_cast<std::size_t>(nodes[k])] != bone) continue;
        const Vec3 place = rotate(turn, places[k]);
        soles.floor = std::min(soles.floor, dot(place, basis.up));
        for (std::size_t d = 0; d < directions.size(); ++d)
          if (const double far_off = dot(place, directions[d]); far_off > best[d]) best[d] = far_off, outermost[d] = k;
      }
      auto& points = bone == LEGS[leg].ankle ? foot.fixed : foot.toes;
      for (std::size_t d = 0; d < directions.size(); ++d) {
        bool known = outermost[d] == places.size();
        for (std::size_t e = 0; e < d; ++e) known = known || outermost[e] == outermost[d];
        if (!known) points.push_back(rotate(turn, places[outermost[d]]) - joint);
      }
    }
    if ((foot.fixed.empty() && foot.toes.empty()) || soles.floor >= dot(place_of(LEGS[leg].ankle), basis.up)) return {};
  }
  return soles;
}

}  // namespace wayfarer
