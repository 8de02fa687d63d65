// Written by `python -m tests.golden` from the Python client's bone_names.json.
#pragma once

#include <array>
#include <string_view>
#include <utility>

namespace wayfarer::words {
using namespace std::string_view_literals;

inline constexpr std::array role_hip{
    "upleg"sv, "upperleg"sv, "legupper"sv, "thigh"sv, "femur"sv, "hip"sv, "upperthigh"sv, "足d"sv, "大腿"sv, "太もも"sv, "足"sv, "脚"sv, "leg"sv};
inline constexpr std::array role_knee{
    "lowerleg"sv, "lowleg"sv, "leglower"sv, "calf"sv, "shin"sv, "shank"sv, "knee"sv, "ひざd"sv, "小腿"sv, "ひざ"sv, "膝"sv, "ヒザ"sv, "leg"sv};
inline constexpr std::array role_ankle{
    "ankle"sv, "foot"sv, "足首d"sv, "足首"sv, "脚踝"sv, "脚"sv, "足"sv};
inline constexpr std::array role_foot{
    "toebase"sv, "toe"sv, "toes"sv, "ball"sv, "foot"sv, "足先ex"sv, "つま先"sv, "爪先"sv, "足先"sv, "脚趾"sv};
inline constexpr std::array role_shoulder{
    "upperarm"sv, "uparm"sv, "armupper"sv, "arm"sv, "humerus"sv, "shldr"sv, "shoulder"sv, "上腕"sv, "上臂"sv, "大臂"sv, "腕"sv};
inline constexpr std::array role_collar{
    "clavicle"sv, "collar"sv, "collarbone"sv, "scapula"sv, "shoulder"sv, "肩"sv, "鎖骨"sv, "锁骨"sv};
inline constexpr std::array role_elbow{
    "lowerarm"sv, "forearm"sv, "lowarm"sv, "armlower"sv, "elbow"sv, "ひじ"sv, "肘"sv, "前臂"sv, "小臂"sv};
inline constexpr std::array role_wrist{
    "hand"sv, "wrist"sv, "手首"sv, "手"sv};
inline constexpr std::array role_pelvis{
    "hips"sv, "pelvis"sv, "hip"sv, "下半身"sv, "骨盤"sv, "骨盆"sv, "腰"sv};
inline constexpr std::array role_neck{
    "neck"sv, "necklower"sv, "首"sv, "颈"sv, "脖子"sv};
inline constexpr std::array role_head{
    "head"sv, "頭"sv, "头"sv};
inline constexpr std::array left{
    "left"sv, "l"sv, "lf"sv, "lft"sv, "左"sv};
inline constexpr std::array right{
    "right"sv, "r"sv, "rt"sv, "rgt"sv, "右"sv};
inline constexpr std::array noise{
    "mixamorig"sv, "bip"sv, "cc"sv, "base"sv, "def"sv, "j"sv, "c"sv, "b"sv, "jnt"sv, "joint"sv, "bone"sv, "bn"sv, "armature"sv, "character"sv, "valvebiped"sv, "rig"sv, "bend"sv, "stretch"sv, "m"sv, "x"sv, "skin"sv, "bind"sv};
inline constexpr std::array helpers{
    "twist"sv, "roll"sv, "ik"sv, "fk"sv, "pole"sv, "target"sv, "end"sv, "nub"sv, "tip"sv, "ctrl"sv, "control"sv, "helper"sv, "socket"sv, "effector"sv, "share"sv, "adj"sv, "mch"sv, "org"sv, "weapon"sv, "hair"sv, "skirt"sv, "breast"sv, "eye"sv, "eyelid"sv, "jaw"sv, "tongue"sv, "teeth"sv, "thumb"sv, "index"sv, "middle"sv, "ring"sv, "pinky"sv, "little"sv, "finger"sv, "metacarpal"sv, "heel"sv};
inline constexpr std::array vrm_spine{
    "spine"sv, "chest"sv, "upperChest"sv};
inline constexpr std::array vrm{
    std::pair{"pelvis"sv, "hips"sv}, std::pair{"neck"sv, "neck"sv}, std::pair{"head"sv, "head"sv}, std::pair{"left_hip"sv, "leftUpperLeg"sv}, std::pair{"left_knee"sv, "leftLowerLeg"sv}, std::pair{"left_ankle"sv, "leftFoot"sv}, std::pair{"left_foot"sv, "leftToes"sv}, std::pair{"right_hip"sv, "rightUpperLeg"sv}, std::pair{"right_knee"sv, "rightLowerLeg"sv}, std::pair{"right_ankle"sv, "rightFoot"sv}, std::pair{"right_foot"sv, "rightToes"sv}, std::pair{"left_collar"sv, "leftShoulder"sv}, std::pair{"left_shoulder"sv, "leftUpperArm"sv}, std::pair{"left_elbow"sv, "leftLowerArm"sv}, std::pair{"left_wrist"sv, "leftHand"sv}, std::pair{"right_collar"sv, "rightShoulder"sv}, std::pair{"right_shoulder"sv, "rightUpperArm"sv}, std::pair{"right_elbow"sv, "rightLowerArm"sv}, std::pair{"right_wrist"sv, "rightHand"sv}};

}  // namespace wayfarer::words
