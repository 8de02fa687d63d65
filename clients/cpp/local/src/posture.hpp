// How trunk, head and arms are held in what is shown, each person in an own way. The server's world/output/posture.py,
// for one person.
#pragma once

#include <cstdint>

#include "geometry.hpp"

namespace wayfarer::local {

/// Angles in radians; `swing`: how far arms swing, times the model's.
struct Habits {
  double swing, aside[2], elbows[2], turned, hands[2], lean, level;
};
Habits habits_of(std::uint64_t seed);

/// Radians that chest and head look up.
struct Looks {
  double lean, pitch;
};
Looks looks(const Turns& turns);

/// Hold frames so, in place. `before`: how chest and head have looked for the last steps; so does the result.
Looks hold(Looks before, std::array<Turns, FRAMES>& turns, const Habits& own);

}  // namespace wayfarer::local
