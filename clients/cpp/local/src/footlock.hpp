// Feet that bear weight stay where they are, and the next step starts from there. The server's
// world/output/footlock.py, for one person: what its rules are for is told there.
#pragma once

#include <string>

#include "guards.hpp"

namespace wayfarer::local {

/// How far a marker goes along with a leg: of the ways that its knee and ankle are moved.
struct LegShare {
  double knee = 0, ankle = 0;
};

/// Of each marker, for the left leg and the right one.
std::vector<Feet<LegShare>> leg_shares(const std::vector<std::string>& markers);

/// Lock the feet in a step that goes on from `seed`.
void lock_feet(const Legs& legs, const std::vector<Feet<LegShare>>& shares, const Seed& seed, Step& step);

}  // namespace wayfarer::local
