// Written by `python -m tests.golden` from the Python client's bone_names.json.
#pragma once

#include <array>
#include <string_view>
#include <utility>

namespace wayfarer::words {
using namespace std::string_view_literals;

inline constexpr std::array role_hip{
    "upleg"sv, "upperleg"sv, "legupper"sv, "thigh"sv, "femur"sv, "hip"sv};
inline constexpr std::array role_knee{
    "lowerleg"sv, "lowleg"sv, "leglower"sv, "calf"sv, "shin"sv, "knee"sv, "leg"sv};
inline constexpr std::array role_ankle{
    "ankle"sv, "foot"sv};
inline constexpr std::array role_foot{
    "toebase"sv, "toe"sv, "toes"sv, "ball"sv, "foot"sv};
inline constexpr std::array role_shoulder{
    "upperarm"sv, "uparm"sv, "armupper"sv, "arm"sv, "humerus"sv, "shldr"sv, "shoulder"sv};
inline constexpr std::array role_collar{
    "clavicle"sv, "collar"sv, "collarbone"sv, "scapula"sv, "shoulder"sv};
inline constexpr std::array role_elbow{
    "lowerarm"sv, "forearm"sv, "lowarm"sv, "armlower"sv, "elbow"sv};
inline constexpr std::array role_wrist{
    "hand"sv, "wrist"sv};
inline constexpr std::array role_pelvis{
    "hips"sv, "pelvis"sv, "hip"sv};
inline constexpr std::array role_neck{
    "neck"sv, "necklower"sv};
inline constexpr std::array role_head{
    "head"sv};
inline constexpr std::array left{
    "left"sv, "l"sv, "lf"sv, "lft"sv};
inline constexpr std::array right{
    "right"sv, "r"sv, "rt"sv, "rgt"sv};
inline constexpr std::array noise{
    "mixamorig"sv, "bip"sv, "cc"sv, "base"sv, "def"sv, "j"sv, "c"sv, "b"sv, "jnt"sv, "joint"sv, "bone"sv, "bn"sv, "armature"sv, "character"sv, "valvebiped"sv, "rig"sv};
inline constexpr std::array helpers{
    "twist"sv, "roll"sv, "ik"sv, "fk"sv, "pole"sv, "target"sv, "end"sv, "nub"sv, "tip"sv, "ctrl"sv, "control"sv, "helper"sv, "socket"sv, "effector"sv, "share"sv, "adj"sv, "mch"sv, "org"sv, "weapon"sv, "hair"sv, "skirt"sv, "breast"sv, "eye"sv, "eyelid"sv, "jaw"sv, "tongue"sv, "teeth"sv, "thumb"sv, "index"sv, "middle"sv, "ring"sv, "pinky"sv, "little"sv, "finger"sv, "metacarpal"sv, "heel"sv};
inline constexpr std::array vrm_spine{
    "spine"sv, "chest"sv, "upperChest"sv};
inline constexpr std::array vrm{
    std::pair{"pelvis"sv, "hips"sv}, std::pair{"neck"sv, "neck"sv}, std::pair{"head"sv, "head"sv}, std::pair{"left_hip"sv, "leftUpperLeg"sv}, std::pair{"left_knee"sv, "leftLowerLeg"sv}, std::pair{"left_ankle"sv, "leftFoot"sv}, std::pair{"left_foot"sv, "leftToes"sv}, std::pair{"right_hip"sv, "rightUpperLeg"sv}, std::pair{"right_knee"sv, "rightLowerLeg"sv}, std::pair{"right_ankle"sv, "rightFoot"sv}, std::pair{"right_foot"sv, "rightToes"sv}, std::pair{"left_collar"sv, "leftShoulder"sv}, std::pair{"left_shoulder"sv, "leftUpperArm"sv}, std::pair{"left_elbow"sv, "leftLowerArm"sv}, std::pair{"left_wrist"sv, "leftHand"sv}, std::pair{"right_collar"sv, "rightShoulder"sv}, std::pair{"right_shoulder"sv, "rightUpperArm"sv}, std::pair{"right_elbow"sv, "rightLowerArm"sv}, std::pair{"right_wrist"sv, "rightHand"sv}};

}  // namespace wayfarer::words
