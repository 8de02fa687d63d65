#include <cctype>

#include "bone_names.hpp"
#include "bone_search.hpp"

namespace wayfarer::bone_search {

Line path(const Rig& rig, int top, int bottom) {
  Line line{bottom};
  while (line.back() != top) line.push_back(rig.node(line.back()).parent);
  std::reverse(line.begin(), line.end());
  return line;
}

Line subtree(const Rig& rig, int node) {
  Line found{node};
  for (std::size_t k = 0; k < found.size(); ++k) {
    const auto& children = rig.children(found[k]);
    found.insert(found.end(), children.begin(), children.end());
  }
  return found;
}

Line joints(const Rig& rig, const Line& line, double least) {
  Line found;
  for (const int k : line)
    if (found.empty() || length(rig.place(k) - rig.place(found.back())) >= least) found.push_back(k);
  return found;
}

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

namespace {

/// Side ("left", "right", "") and the rest of a name; both empty for helpers.
struct Named {
  std::string_view side;
  std::string rest;
};

bool is_upper(char c) { return c >= 'A' && c <= 'Z'; }
bool is_lower(char c) { return c >= 'a' && c <= 'z'; }

bool is_ascii(char c) { return static_cast<unsigned char>(c) < 128; }

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
    if (is_ascii(c) && !is_upper(c) && !is_lower(c)) {
      end();
      continue;
    }
    const char before = k ? last[k - 1] : '\0', next = k + 1 < last.size() ? last[k + 1] : '\0';
    if (!token.empty() && is_ascii(before) != is_ascii(c)) end();
    if (is_upper(c) && (is_lower(before) || (is_upper(before) && is_lower(next)))) end();
    token += static_cast<char>(is_upper(c) ? c - 'A' + 'a' : c);
  }
  end();
  return tokens;
}

/// Removes the side at the start of a token, where words begin with it in scripts without spaces.
template <class Marks>
bool take_side(std::string& token, const Marks& marks) {
  for (const auto mark : marks) {
    const bool begins = !is_ascii(mark.front()) && token.compare(0, mark.size(), mark) == 0;
    if (token != mark && !begins) continue;
    token.erase(0, mark.size());
    return true;
  }
  return false;
}

Named words_of(const std::string& name) {
  Named named;
  const std::vector<std::string> tokens = tokens_of(name);
  for (const std::string& token : tokens)
    if (contains(words::helpers, token)) return {};
  for (std::string token : tokens) {
    if (take_side(token, words::left)) named.side = "left";
    if (take_side(token, words::right)) named.side = "right";
    if (!contains(words::noise, token)) named.rest += token;
  }
  return named;
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
      find(side.foot, words::role_foot, side.name, nodes_[at(side.ankle)], true);
      find(side.shoulder, words::role_shoulder, side.name);
      find(side.elbow, words::role_elbow, side.name, nodes_[at(side.shoulder)]);
      find(side.wrist, words::role_wrist, side.name, nodes_[at(side.elbow)]);
      find(side.collar, words::role_collar, side.name);
    }
    find(NECK, words::role_neck, "");
    find(HEAD, words::role_head, "", nodes_[at(NECK)]);
    find(PELVIS, words::role_pelvis, "");
    find_pelvis();
    find_spine();
    return nodes_;
  }

 private:
  /// The uppermost node with the first of the role's words that any node has. Nodes below `inside` come first.
  /// Otherwise it may be anywhere: feet of IK rigs hang from the root. A word of two roles, such as `foot`, is not
  /// looked for there again.
  template <class Words>
  void find(int b, const Words& role, std::string_view side, int inside = -1, bool shares_foot = false) {
    for (const int within : inside < 0 ? Line{-1} : Line{inside, -1})
      for (const auto word : role) {
        if (within < 0 && inside >= 0 && shares_foot && word == "foot") continue;
        int best = -1;
        for (int k = 0; k < static_cast<int>(named_.size()); ++k) {
          if (named_[at(k)].rest != word || named_[at(k)].side != side || contains(nodes_, k)) continue;
          if (within >= 0 && !contains(above_[at(k)], within)) continue;
          if (best < 0 || above_[at(k)].size() < above_[at(best)].size()) best = k;
        }
        nodes_[at(b)] = best;
        if (best >= 0) return;
      }
  }

  /// The nodes at the end of the trunk: the neck, or the head, or both arms.
  Line top() const {
    for (const int b : {NECK, HEAD})
      if (nodes_[at(b)] >= 0) return {nodes_[at(b)]};
    Line arms;
    for (const Side& side : SIDES) {
      const int collar = nodes_[at(side.collar)], arm = collar >= 0 ? collar : nodes_[at(side.shoulder)];
      if (arm < 0) return {};
      arms.push_back(arm);
    }
    return arms;
  }

  Line thighs() const {
    Line found;
    for (const Side& side : SIDES)
      if (nodes_[at(side.hip)] >= 0) found.push_back(nodes_[at(side.hip)]);
    return found;
  }

  /// Moves the pelvis to the lowest node that carries both legs and the trunk.
  void find_pelvis() {
    const Line legs = thighs();
    if (legs.size() < 2) return;
    Line all = legs;
    for (const int node : top()) all.push_back(node);
    for (const Line& carried : {all, legs}) {
      const Line common = shared(carried);
      if (contains(common, nodes_[at(PELVIS)])) return;
      if (common.empty()) continue;
      nodes_[at(PELVIS)] = common.front();
      return;
    }
  }

  /// The common ancestors of these nodes, from below.
  Line shared(const Line& nodes) const {
    Line found;
    for (const int k : above_[at(nodes[0])])
      if (std::all_of(nodes.begin(), nodes.end(), [&](int n) { return contains(above_[at(n)], k); })) found.push_back(k);
    return found;
  }

  /// The trunk's bones, from which no thigh hangs. Where rigs only number them, with neck and head, as Rigify does,
  /// where arms branch off tells them apart.
  void find_spine() {
    const Line ends = top();
    if (ends.empty() || nodes_[at(PELVIS)] < 0) return;
    if (ends.size() == 1) return spread_spine(trunk(ends[0]), nodes_);
    const Line common = shared(ends);
    if (common.empty() || !contains(above_[at(common.front())], nodes_[at(PELVIS)])) return;
    const int chest = common.front();
    Line chain;
    for (int node = chest;;) {
      Line onward;
      for (const int k : rig_.children(node))
        if (!named_[at(k)].rest.empty() && named_[at(k)].side.empty()) onward.push_back(k);
      if (onward.size() != 1) break;
      chain.push_back(node = onward.front());
    }
    Line spine = trunk(chest);
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
    if (rest.size() > 1) nodes_[at(NECK)] = rest.front();
    if (!rest.empty()) nodes_[at(HEAD)] = rest.back();
  }

  /// Named nodes below this one, from the lowest, except ancestors of thighs.
  Line trunk(int top_node) const {
    const Line legs = thighs();
    Line found;
    for (const int k : above_[at(top_node)]) {
      if (std::any_of(legs.begin(), legs.end(), [&](int leg) { return contains(above_[at(leg)], k); })) break;
      if (!named_[at(k)].rest.empty() && named_[at(k)].side.empty()) found.push_back(k);
    }
    std::reverse(found.begin(), found.end());
    return found;
  }

  const Rig& rig_;
  std::vector<Named> named_;
  std::vector<Line> above_;
  Nodes nodes_ = none();
};

}  // namespace

Nodes by_names(const Rig& rig) { return ByNames(rig).nodes(); }

int contradicted(const Rig& rig, const Nodes& nodes) {
  int against = -1, told = 0;
  for (int b = 0; b < BONE_COUNT; ++b) {
    if (nodes[at(b)] < 0) continue;
    const std::string_view bone_name = BONES[at(b)], side = bone_name.substr(0, bone_name.find('_'));
    const std::string_view has = words_of(rig.node(nodes[at(b)]).name).side;
    if ((side != "left" && side != "right") || has.empty()) continue;
    told += has == side ? 1 : -1;
    if (has != side && against < 0) against = nodes[at(b)];
  }
  return told < 0 ? against : -1;
}

}  // namespace wayfarer::bone_search
