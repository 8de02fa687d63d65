// Feet that stand stay where they are: the drift of a body that stands is taken off every step; and the way of the
// hips of people with shorter steps. The server's world/stepping/planting.py and strides.py, for one person.
#pragma once

#include "steering.hpp"

namespace wayfarer::local {

using SoleMarkers = std::array<int, 2 * SOLES>;  // numbers of the sole markers, left foot first

/// A step that has been corrected, and where the next one starts.
struct Planted {
  Gait gait;
  Step step;
  Seed seed;
};

/// The step with the drift of planted feet taken off, and the gait that remembers the feet. `facing`: of the seed.
Planted plant(const SoleMarkers& soles, Gait gait, const Seed& seed, Point facing, const Step& step, Point carried);

/// Shorten the way of the hips, in place: by shares `before` at the start of the step and `after` at its end.
void shorten(double before, double after, Point start, Planted& planted);

/// Places of the soles in the frame of markers that begins at `from`.
SolePlaces sole_places(const Markers& markers, std::size_t from, const SoleMarkers& soles);

}  // namespace wayfarer::local
