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

/// How far somebody is at rest in each frame, eased. `share`: that at the start, and then at the end.
std::array<double, FRAMES> calmed(double& share, bool rests);

/// Hold frames so, in place. `before`: how chest and head have looked for the last steps; so does the result. `rest`:
/// how far the person is at rest in each frame.
Looks hold(Looks before, std::array<Turns, FRAMES>& turns, const Habits& own, const std::array<double, FRAMES>& rest);

}  // namespace wayfarer::local
