// A step that no body could take is repaired before it is shown, or continued from. The server's
// world/stepping/guards.py, for one person. Rare; without a repair nothing changes.
#pragma once

#include "legs.hpp"

namespace wayfarer::local {

using FrameHips = std::array<Vec3, FRAMES>;
using FrameTurns = std::array<Turns, FRAMES>;

/// Bend the knees of a step as knees bend.
void make_bendable(FrameTurns& turns, const Legs& legs);

/// Whether a body leans or squats at the end of its step.
bool fallen(const FrameHips& hips, const FrameTurns& turns, const Legs& legs);

/// Whether frames cannot be shown: not finite, or far off where they start.
bool broken(const Vec3& start, const Step& step);

/// Frames from the end of a seed to a stand. Arms that have far to go get there with the next step: the stand is
/// changed to show them where they have come to.
void get_up(const Seed& seed, Seed& stand, FrameHips& hips, FrameTurns& turns);

}  // namespace wayfarer::local
