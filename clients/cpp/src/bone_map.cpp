#include "wayfarer/bone_map.hpp"

#include <algorithm>
#include <cctype>
#include <stdexcept>

#include "bone_names.hpp"

namespace wayfarer {
namespace {

using Nodes = BoneMap::Nodes;
using Line = std::vector<int>;

constexpr int bone(std::string_view name) { return bone_number(name); }
struct Side {
  std::string_view name;
  int hip, knee, ankle, foot, collar, shoulder, elbow, wrist;
};
constexpr Side SIDES[2]{{"left", bone("left_hip"), bone("left_knee"), bone("left_ankle"), bone("left_foot"),
                         bone("left_collar"), bone("left_shoulder"), bone("left_elbow"), bone("left_wrist")},
                        {"right", bone("right_hip"), bone("right_knee"), bone("right_ankle"), bone("right_foot"),
                         bone("right_collar"), bone("right_shoulder"), bone("right_elbow"), bone("right_wrist")}};
constexpr int PELVIS = bone("pelvis"), NECK = bone("neck"), HEAD = bone("head");
constexpr int SPINE[3]{bone("spine1"), bone("spine2"), bone("spine3")};
constexpr int REQUIRED[]{PELVIS,         SIDES[0].hip,  SIDES[0].knee, SIDES[0].ankle,
                         SIDES[1].hip,   SIDES[1].knee, SIDES[1].ankle};

std::size_t at(int k) { return static_cast<std::size_t>(k); }
std::string name_of(int b) { return std::string(BONES[at(b)]); }

template <class List, class Value>
bool contains(const List& list, const Value& value) {
  return std::find(std::begin(list), std::end(list), value) != std::end(list);
}

Nodes none() {
  Nodes nodes;
  nodes.fill(-1);
  return nodes;
}

std::string lacking(const Nodes& nodes) {
  std::string names;
  for (const int b : REQUIRED)
    if (nodes[at(b)] < 0) names += (names.empty() ? "" : ", ") + name_of(b);
  return names;
}

void check(const Rig& rig, const Nodes& nodes) {
  if (const std::string names = lacking(nodes); !names.empty())
    throw std::invalid_argument("neither names nor shape of this rig tell its " + names +
                                ": say which nodes these are, by a correction");
  const auto hangs = [&](int lower, int upper) {
    if (contains(rig.ancestors(nodes[at(lower)]), nodes[at(upper)])) return;
    throw std::invalid_argument(name_of(lower) + ": \"" + rig.node(nodes[at(lower)]).name +
                                "\" does not hang from the " + name_of(upper));
  };
  for (const Side& side : SIDES) {
    hangs(side.hip, PELVIS);
    hangs(side.knee, side.hip);
    hangs(side.ankle, side.knee);
  }
  for (int b = 0; b < BONE_COUNT; ++b) {
    if (nodes[at(b)] < 0) continue;
    int above = -1;
    for (const int k : rig.ancestors(nodes[at(b)])) {
      const auto found = std::find(nodes.begin(), nodes.end(), k);
      if (found == nodes.end()) continue;
      above = static_cast<int>(found - nodes.begin());
      break;
    }
    if (b == PELVIS ? above < 0 : above >= 0 && above < b) continue;
    throw std::invalid_argument(name_of(b) + ": \"" + rig.node(nodes[at(b)]).name + "\" hangs from " +
                                (above < 0 ? "no bone" : name_of(above)));
  }
}

/// Nodes between pelvis and neck → spine bones: the last, from which arms hang, is spine3.
void spread_spine(const Line& chain, Nodes& nodes) {
  const std::size_t count = chain.size();
  if (count == 1) nodes[at(SPINE[2])] = chain[0];
  else if (count == 2) nodes[at(SPINE[0])] = chain[0], nodes[at(SPINE[2])] = chain[1];
  else if (count > 2)
    for (std::size_t k = 0; k < 3; ++k) nodes[at(SPINE[k])] = chain[(k * (count - 1) + 1) / 2];
}

Nodes by_vrm(const std::map<std::string, int>& humanoid) {
  Nodes nodes = none();
  const auto find = [&](std::string_view name) {
    const auto found = humanoid.find(std::string(name));
    return found == humanoid.end() ? -1 : found->second;
  };
  for (const auto& [bone_name, name] : words::vrm) nodes[at(bone(bone_name))] = find(name);
  Line chain;
  for (const auto name : words::vrm_spine)
    if (find(name) >= 0) chain.push_back(find(name));
  spread_spine(chain, nodes);
  return nodes;
}

/// Side ("left", "right", "") and the rest of a name; helpers give nothing.
struct Named {
  std::string_view side;
  std::string rest;
};

bool is_upper(char c) { return c >= 'A' && c <= 'Z'; }
bool is_lower(char c) { return c >= 'a' && c <= 'z'; }

std::vector<std::string> tokens_of(const std::string& name) {
  const std::string last = name.substr(name.find_last_of(":|") + 1);
  std::vector<std::string> tokens;
  std::string token;
  const auto end = [&] {
    if (!token.empty()) tokens.push_back(token);
    token.clear();
  };
  for (std::size_t k = 0; k < last.size(); ++k) {
    const char c = last[k];
    if (!is_upper(c) && !is_lower(c)) {
      end();
      continue;
    }
    const char before = k ? last[k - 1] : '\0', next = k + 1 < last.size() ? last[k + 1] : '\0';
    if (is_upper(c) && (is_lower(before) || (is_upper(before) && is_lower(next)))) end();
    token += static_cast<char>(is_upper(c) ? c - 'A' + 'a' : c);
  }
  end();
  return tokens;
}

Named words_of(const std::string& name) {
  Named named;
  for (const std::string& token : tokens_of(name)) {
    if (contains(words::helpers, token)) return {};
    if (contains(words::left, token)) named.side = "left";
    else if (contains(words::right, token)) named.side = "right";
    else if (!contains(words::noise, token)) named.rest += token;
  }
  return named;
}

Line path(const Rig& rig, int top, int bottom) {
  Line line{bottom};
  while (line.back() != top) line.push_back(rig.node(line.back()).parent);
  std::reverse(line.begin(), line.end());
  return line;
}

/// Of a path, those at least so far from the one before: the later of two at one place.
Line joints(const Rig& rig, const Line& line, double least) {
  Line found;
  for (const int k : line)
    if (found.empty() || length(rig.place(k) - rig.place(found.back())) >= least) found.push_back(k);
  return found;
}

class ByNames {
 public:
  explicit ByNames(const Rig& rig) : rig_(rig) {
    for (int k = 0; k < static_cast<int>(rig.nodes().size()); ++k) {
      named_.push_back(words_of(rig.node(k).name));
      above_.push_back(rig.ancestors(k));
    }
  }

  Nodes nodes() {
    for (const Side& side : SIDES) {
      find(side.hip, words::role_hip, side.name);
      find(side.knee, words::role_knee, side.name, nodes_[at(side.hip)]);
      find(side.ankle, words::role_ankle, side.name, nodes_[at(side.knee)]);
      find(side.foot, words::role_foot, side.name, nodes_[at(side.ankle)]);
      find(side.shoulder, words::role_shoulder, side.name);
      find(side.elbow, words::role_elbow, side.name, nodes_[at(side.shoulder)]);
      find(side.wrist, words::role_wrist, side.name, nodes_[at(side.elbow)]);
      find(side.collar, words::role_collar, side.name);
    }
    find(PELVIS, words::role_pelvis, "");
    const int left = nodes_[at(SIDES[0].hip)], right = nodes_[at(SIDES[1].hip)];
    if (left >= 0 && right >= 0) {
      const Line shared = common(left, right);
      if (!shared.empty() && !contains(shared, nodes_[PELVIS])) nodes_[PELVIS] = shared.front();
    }
    find(NECK, words::role_neck, "");
    find(HEAD, words::role_head, "", nodes_[NECK]);
    const int top = nodes_[NECK] >= 0 ? nodes_[NECK] : nodes_[HEAD];
    if (nodes_[PELVIS] >= 0) {
      if (top >= 0) spread_spine(line(nodes_[PELVIS], top), nodes_);
      else trunk();
    }
    return nodes_;
  }

 private:
  template <class Words>
  void find(int b, const Words& role, std::string_view side, int inside = -1) {
    for (const auto word : role) {
      int best = -1;
      for (int k = 0; k < static_cast<int>(named_.size()); ++k) {
        if (named_[at(k)].rest != word || named_[at(k)].side != side || contains(nodes_, k)) continue;
        if (inside >= 0 && !contains(above_[at(k)], inside)) continue;
        if (best < 0 || above_[at(k)].size() < above_[at(best)].size()) best = k;
      }
      nodes_[at(b)] = best;
      if (best >= 0) return;
    }
  }

  Line common(int a, int b) const {
    Line shared;
    for (const int k : above_[at(a)])
      if (contains(above_[at(b)], k)) shared.push_back(k);
    return shared;
  }

  /// Nodes between two, from low to high, without helpers; none when not on one line.
  Line line(int low, int high) const {
    Line found;
    if (!contains(above_[at(high)], low)) return found;
    for (const int k : path(rig_, low, high))
      if (k != low && k != high && !named_[at(k)].rest.empty()) found.push_back(k);
    return found;
  }

  /// Spine, neck and head of a rig that only numbers them, as Rigify: by where arms branch off.
  void trunk() {
    int arms[2];
    for (std::size_t s = 0; s < 2; ++s) {
      const int collar = nodes_[at(SIDES[s].collar)];
      arms[s] = collar >= 0 ? collar : nodes_[at(SIDES[s].shoulder)];
      if (arms[s] < 0) return;
    }
    const Line shared = common(arms[0], arms[1]);
    if (shared.empty() || !contains(above_[at(shared.front())], nodes_[PELVIS])) return;
    const int chest = shared.front();
    Line chain;
    for (int node = chest;;) {
      Line onward;
      for (const int k : rig_.children(node))
        if (!named_[at(k)].rest.empty() && named_[at(k)].side.empty()) onward.push_back(k);
      if (onward.size() != 1) break;
      chain.push_back(node = onward.front());
    }
    Line spine = line(nodes_[PELVIS], chest);
    spine.push_back(chest);
    spread_spine(spine, nodes_);
    Vec3 low = rig_.place(0), high = low;
    for (int k = 0; k < static_cast<int>(named_.size()); ++k) {
      const Vec3& p = rig_.place(k);
      low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
      high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
    }
    const Vec3 extent = high - low;
    const Line rest = joints(rig_, chain, 0.01 * std::max({extent.x, extent.y, extent.z}));
    if (rest.size() > 1) nodes_[NECK] = rest.front();
    if (!rest.empty()) nodes_[HEAD] = rest.back();
  }

  const Rig& rig_;
  std::vector<Named> named_;
  std::vector<Line> above_;
  Nodes nodes_ = none();
};

/// Legs end lowest, the spine goes up between them, arms branch to both sides of it.
class ByShape {
 public:
  ByShape(const Rig& rig, const Basis& basis) : rig_(rig), basis_(basis) {}

  Nodes nodes() {
    const int count = static_cast<int>(rig_.nodes().size());
    for (int k = 0; k < count; ++k) {
      height_.push_back(dot(rig_.place(k), basis_.up));
      below_.push_back(subtree(k));
    }
    if (count == 0) return none();
    const auto [low, high] = std::minmax_element(height_.begin(), height_.end());
    floor_ = *low;
    tall_ = *high - *low;
    Line chains[2];
    if (!(tall_ > 0) || !legs(chains)) return none();
    for (std::size_t s = 0; s < 2; ++s) {
      const int bones[4]{SIDES[s].hip, SIDES[s].knee, SIDES[s].ankle, SIDES[s].foot};
      for (std::size_t k = 0; k < std::min<std::size_t>(4, chains[s].size()); ++k)
        nodes_[at(bones[k])] = chains[s][k];
    }
    const Line& inside = below_[at(nodes_[PELVIS])];
    const int top = *std::max_element(inside.begin(), inside.end(),
                                      [&](int a, int b) { return height_[at(a)] < height_[at(b)]; });
    Line spine = path(rig_, nodes_[PELVIS], top);
    spine.erase(spine.begin());
    upper(spine);
    return nodes_;
  }

 private:
  Line subtree(int node) const {
    Line found{node};
    for (std::size_t k = 0; k < found.size(); ++k) {
      const auto& children = rig_.children(found[k]);
      found.insert(found.end(), children.begin(), children.end());
    }
    return found;
  }

  int lowest(int node) const {
    const Line& inside = below_[at(node)];
    return *std::min_element(inside.begin(), inside.end(),
                             [&](int a, int b) { return height_[at(a)] < height_[at(b)]; });
  }

  /// The pelvis, and both legs from hip to toes, left first; false when there are none.
  bool legs(Line (&chains)[2]) {
    int a = -1, b = -1;
    for (int k = 0; k < static_cast<int>(below_.size()); ++k) {  // parents come first: the deepest stays
      Line feet;
      for (const int child : rig_.children(k))
        if (height_[at(lowest(child))] < floor_ + 0.1 * tall_) feet.push_back(child);
      for (std::size_t n = 0; n < feet.size(); ++n)
        for (std::size_t m = n + 1; m < feet.size(); ++m) {
          const Vec3 gap = rig_.place(lowest(feet[n])) - rig_.place(lowest(feet[m]));
          if (length(basis_.level(gap)) > 0.05 * tall_) nodes_[PELVIS] = k, a = feet[n], b = feet[m];
        }
    }
    if (a < 0) return false;
    chains[0] = joints(rig_, path(rig_, a, lowest(a)), 0.03 * tall_);
    chains[1] = joints(rig_, path(rig_, b, lowest(b)), 0.03 * tall_);
    Vec3 toes;
    for (const Line& chain : chains) {
      if (chain.size() < 3) return false;
      toes = toes + rig_.place(chain[std::min<std::size_t>(3, chain.size() - 1)]) - rig_.place(chain[2]);
    }
    const Vec3 forward = basis_.level(toes);
    if (length(forward) < 0.01 * tall_) return false;  // no toes: nothing tells front from back
    left_ = basis_.handed * cross(basis_.up, forward);
    left_ = 1 / length(left_) * left_;
    if (dot(basis_.level(rig_.place(a) - rig_.place(b)), left_) < 0) std::swap(chains[0], chains[1]);
    return true;
  }

  double side(int node) const { return dot(rig_.place(node), left_); }

  /// Arms, and the spine as far as them; neck and head above.
  void upper(const Line& spine) {
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
      spread_spine(Line(spine.begin(), spine.begin() + static_cast<std::ptrdiff_t>(k) + 1), nodes_);
      for (std::size_t s = 0; s < 2; ++s) arm_of(SIDES[s], path(rig_, arm[s], reach[s]));
      const Line rest =
          joints(rig_, Line(spine.begin() + static_cast<std::ptrdiff_t>(k) + 1, spine.end()), 0.01 * tall_);
      if (rest.size() > 1) nodes_[NECK] = rest[0], nodes_[HEAD] = rest[1];
      else if (rest.size() == 1) nodes_[HEAD] = rest[0];
      return;
    }
    if (!spine.empty()) spread_spine({spine.front()}, nodes_);
  }

  void arm_of(const Side& side, const Line& line) {
    Line chain;
    for (const int node : joints(rig_, line, 0.02 * tall_)) {
      chain.push_back(node);
      if (rig_.children(node).size() >= 3) break;  // the hand: fingers begin
    }
    const int bones[4]{side.collar, side.shoulder, side.elbow, side.wrist};
    const std::size_t first = chain.size() >= 4 ? 0 : 1, skipped = chain.size() >= 4 ? chain.size() - 4 : 0;
    for (std::size_t k = first; k < 4 && k - first + skipped < chain.size(); ++k)
      nodes_[at(bones[k])] = chain[k - first + skipped];
  }

  const Rig& rig_;
  const Basis& basis_;
  std::vector<double> height_;
  std::vector<Line> below_;
  double floor_ = 0, tall_ = 0;
  Vec3 left_;
  Nodes nodes_ = none();
};

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

/// What is found, enough or not, and how.
std::pair<Nodes, std::string> find(const Rig& rig, const std::map<std::string, int>& humanoid, const Basis& basis) {
  if (!humanoid.empty()) return {by_vrm(humanoid), "vrm"};
  const Nodes named = ByNames(rig).nodes();
  if (lacking(named).empty()) return {named, "names"};
  const Nodes shaped = ByShape(rig, basis).nodes();
  if (lacking(shaped).empty()) return {shaped, "shape"};
  return {named, "names"};
}

}  // namespace

BoneMap BoneMap::corrected(const Changes& changes) const { return {rig_, changed(rig_, nodes_, changes), "user"}; }

BoneMap map_bones(const Rig& rig, const std::map<std::string, int>& humanoid, const Basis& basis,
                  const BoneMap::Changes& correct) {
  const auto [nodes, found_by] = find(rig, humanoid, basis);
  if (correct.empty()) return {rig, nodes, found_by};
  return {rig, changed(rig, nodes, correct), "user"};
}

}  // namespace wayfarer
