#include "bone_search.hpp"

namespace wayfarer::bone_search {
namespace {

constexpr double LOW = 0.1;      // of the rig's height: a branch that ends below this reaches the ground
constexpr double APART = 0.05;   // of that height: least distance between the ends of two legs
constexpr double TOES = 0.02;    // of that height: least distance of toes before the ankle
constexpr double FAR_OFF = 0.25; // of that height: least distance between two pairs of legs

}  // namespace

Shape::Shape(const Rig& rig, const Basis& basis) : rig_(rig), basis_(basis) {
  const int count = static_cast<int>(rig.nodes().size());
  for (int k = 0; k < count; ++k) {
    height_.push_back(dot(rig.place(k), basis.up));
    below_.push_back(subtree(rig, k));
  }
  if (count == 0) return;
  const auto [low, high] = std::minmax_element(height_.begin(), height_.end());
  tall_ = *high - *low;
  for (int k = 0; k < count && tall_ > 0; ++k) {
    Line feet;
    std::vector<Line> chains;
    for (const int child : rig.children(k)) {
      if (height_[at(lowest(child))] >= *low + LOW * tall_) continue;
      feet.push_back(child);
      chains.push_back(joints(rig, path(rig, child, lowest(child)), 0.03 * tall_));
    }
    for (std::size_t n = 0; n < feet.size(); ++n)
      for (std::size_t m = n + 1; m < feet.size(); ++m) {
        const double gap = length(basis.level(rig.place(lowest(feet[n])) - rig.place(lowest(feet[m]))));
        if (std::min(chains[n].size(), chains[m].size()) >= 3 && gap > APART * tall_)
          pairs_.push_back({k, {chains[n], chains[m]}});
      }
  }
}

int Shape::lowest(int node) const {
  const Line& inside = below_[at(node)];
  return *std::min_element(inside.begin(), inside.end(),
                           [&](int a, int b) { return height_[at(a)] < height_[at(b)]; });
}

/// Where the toes of a leg point, level.
Vec3 Shape::toes(const Line& chain) const {
  return basis_.level(rig_.place(chain[std::min<std::size_t>(3, chain.size() - 1)]) - rig_.place(chain[2]));
}

Line Shape::other_legs(int pelvis, const Line& hips) const {
  Line line = rig_.ancestors(pelvis), own = hips;
  line.insert(line.end(), below_[at(pelvis)].begin(), below_[at(pelvis)].end());
  for (const int hip : hips)
    for (const int k : rig_.ancestors(hip)) own.push_back(k);
  for (const auto& [above, chains] : pairs_) {
    const int a = chains[0].front(), b = chains[1].front();
    if (!contains(line, above) || contains(own, a) || contains(own, b)) continue;
    const Vec3 away = 0.5 * (rig_.place(a) + rig_.place(b) - rig_.place(hips[0]) - rig_.place(hips[1]));
    if (length(basis_.level(away)) > FAR_OFF * tall_) return {a, b};
  }
  return {};
}

Nodes Shape::nodes() const {
  Nodes nodes = none();
  const auto walks = [&](const Pair& pair) {
    return std::min(length(toes(pair.chains[0])), length(toes(pair.chains[1]))) >= TOES * tall_;
  };
  // nodes come parents first: the deepest. Without toes nothing tells front from back, or a leg from a skirt
  const auto found = std::find_if(pairs_.rbegin(), pairs_.rend(), walks);
  if (found == pairs_.rend()) return nodes;
  Line chains[2]{found->chains[0], found->chains[1]};
  const Vec3 forward = toes(chains[0]) + toes(chains[1]);
  if (length(forward) < 0.01 * tall_) return nodes;
  Vec3 left = basis_.handed * cross(basis_.up, forward);
  left = 1 / length(left) * left;
  const Vec3 across = rig_.place(chains[0].front()) - rig_.place(chains[1].front());
  if (dot(basis_.level(across), left) < 0) std::swap(chains[0], chains[1]);
  nodes[at(PELVIS)] = found->above;
  for (std::size_t s = 0; s < 2; ++s) {
    const int bones[4]{SIDES[s].hip, SIDES[s].knee, SIDES[s].ankle, SIDES[s].foot};
    for (std::size_t k = 0; k < std::min<std::size_t>(4, chains[s].size()); ++k) nodes[at(bones[k])] = chains[s][k];
  }
  const Line& inside = below_[at(found->above)];
  const int top = *std::max_element(inside.begin(), inside.end(),
                                    [&](int a, int b) { return height_[at(a)] < height_[at(b)]; });
  Line spine = path(rig_, found->above, top);
  spine.erase(spine.begin());
  upper(spine, left, nodes);
  return nodes;
}

/// Arms, and the spine as far as them; neck and head above.
void Shape::upper(const Line& spine, const Vec3& left, Nodes& nodes) const {
  const auto side = [&](int node) { return dot(rig_.place(node), left); };
  for (std::size_t k = 0; k < spine.size(); ++k) {
    const int chest = spine[k];
    int arm[2]{-1, -1}, reach[2]{};
    for (const int child : rig_.children(chest)) {
      if (contains(spine, child)) continue;
      const Line& inside = below_[at(child)];
      const int far = *std::max_element(inside.begin(), inside.end(), [&](int a, int b) {
        return std::abs(side(a)) < std::abs(side(b));
      });
      const double out = side(far) - side(chest);
      const std::size_t s = out > 0 ? 0 : 1;
      if (std::abs(out) > 0.15 * tall_ && arm[s] < 0) arm[s] = child, reach[s] = far;
    }
    if (arm[0] < 0 || arm[1] < 0) continue;
    spread_spine(Line(spine.begin(), spine.begin() + static_cast<std::ptrdiff_t>(k) + 1), nodes);
    for (std::size_t s = 0; s < 2; ++s) arm_of(SIDES[s], path(rig_, arm[s], reach[s]), nodes);
    const Line rest =
        joints(rig_, Line(spine.begin() + static_cast<std::ptrdiff_t>(k) + 1, spine.end()), 0.01 * tall_);
    if (rest.size() > 1) nodes[NECK] = rest[0], nodes[HEAD] = rest[1];
    else if (rest.size() == 1) nodes[HEAD] = rest[0];
    return;
  }
  if (!spine.empty()) spread_spine({spine.front()}, nodes);
}

void Shape::arm_of(const Side& side, const Line& line, Nodes& nodes) const {
  Line chain;
  for (const int node : joints(rig_, line, 0.02 * tall_)) {
    chain.push_back(node);
    if (rig_.children(node).size() >= 3) break;  // the hand: fingers begin
  }
  const int bones[4]{side.collar, side.shoulder, side.elbow, side.wrist};
  const std::size_t first = chain.size() >= 4 ? 0 : 1, skipped = chain.size() >= 4 ? chain.size() - 4 : 0;
  for (std::size_t k = first; k < 4 && k - first + skipped < chain.size(); ++k)
    nodes[at(bones[k])] = chain[k - first + skipped];
}

}  // namespace wayfarer::bone_search
