// Leaning bodies straighten up: nothing else takes a lean off. The server's world/stepping/righting.py, for one person.
#pragma once

#include <string>

#include "steering.hpp"

namespace wayfarer::local {

/// Multiples of the spine's turn that markers go along with: each of its joints turns by half.
std::vector<double> shares_of(const std::vector<std::string>& markers);

/// Take a part of the lean off, by the end of the step, if the body leans too far; `mode` is that of the step.
void right(Mode mode, const std::vector<double>& shares, Step& step);

}  // namespace wayfarer::local
