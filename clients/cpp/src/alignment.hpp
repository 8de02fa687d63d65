// The orientation of a character in its own axes.
#pragma once

#include "wayfarer/bone_map.hpp"

namespace wayfarer {

struct LegBones {
  int hip, knee, ankle, toe;
};
inline constexpr LegBones LEGS[2]{
    {bone_number("left_hip"), bone_number("left_knee"), bone_number("left_ankle"), bone_number("left_foot")},
    {bone_number("right_hip"), bone_number("right_knee"), bone_number("right_ankle"), bone_number("right_foot")}};

/// The rotation from the character's axes to the basis, derived from its legs.
Quat alignment(const BoneMap& map, const Basis& basis);

}  // namespace wayfarer
