// Feet that bear weight stay where they are, and the next step starts from there. The server's
// world/output/footlock.py, which explains the rules, for one person.
#pragma once

#include <string>

#include "guards.hpp"

namespace wayfarer::local {

/// How far a marker goes along with a leg: of the ways that its knee and ankle are moved.
struct LegShare {
  double knee = 0, ankle = 0;
};

/// Shares of each marker in the left and the right leg.
std::vector<Feet<LegShare>> leg_shares(const std::vector<std::string>& markers);

/// Lock the feet in a step that starts from `seed`.
void lock_feet(const Legs& legs, const std::vector<Feet<LegShare>>& shares, const Seed& seed, Step& step);

}  // namespace wayfarer::local
