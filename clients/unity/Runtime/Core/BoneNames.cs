// Written by `python -m tests.golden` from the Python client's bone_names.json.
using System.Collections.Generic;

namespace Wayfarer
{
    internal static class BoneNames
    {
        internal static readonly Dictionary<string, string[]> Roles = new Dictionary<string, string[]>
            {
                ["hip"] = new[] { "upleg", "upperleg", "legupper", "thigh", "femur", "hip", "upperthigh", "\u8db3d", "\u5927\u817f", "\u592a\u3082\u3082", "\u8db3", "\u811a", "leg" },
                ["knee"] = new[] { "lowerleg", "lowleg", "leglower", "calf", "shin", "shank", "knee", "\u3072\u3056d", "\u5c0f\u817f", "\u3072\u3056", "\u819d", "\u30d2\u30b6", "leg" },
                ["ankle"] = new[] { "ankle", "foot", "\u8db3\u9996d", "\u8db3\u9996", "\u811a\u8e1d", "\u811a", "\u8db3" },
                ["foot"] = new[] { "toebase", "toe", "toes", "ball", "foot", "\u8db3\u5148ex", "\u3064\u307e\u5148", "\u722a\u5148", "\u8db3\u5148", "\u811a\u8dbe" },
                ["shoulder"] = new[] { "upperarm", "uparm", "armupper", "arm", "humerus", "shldr", "shoulder", "\u4e0a\u8155", "\u4e0a\u81c2", "\u5927\u81c2", "\u8155" },
                ["collar"] = new[] { "clavicle", "collar", "collarbone", "scapula", "shoulder", "\u80a9", "\u9396\u9aa8", "\u9501\u9aa8" },
                ["elbow"] = new[] { "lowerarm", "forearm", "lowarm", "armlower", "elbow", "\u3072\u3058", "\u8098", "\u524d\u81c2", "\u5c0f\u81c2" },
                ["wrist"] = new[] { "hand", "wrist", "\u624b\u9996", "\u624b" },
                ["pelvis"] = new[] { "hips", "pelvis", "hip", "\u4e0b\u534a\u8eab", "\u9aa8\u76e4", "\u9aa8\u76c6", "\u8170" },
                ["neck"] = new[] { "neck", "necklower", "\u9996", "\u9888", "\u8116\u5b50" },
                ["head"] = new[] { "head", "\u982d", "\u5934" },
            };

        internal static readonly HashSet<string> Left = new HashSet<string>
            { "left", "l", "lf", "lft", "\u5de6" };

        internal static readonly HashSet<string> Right = new HashSet<string>
            { "right", "r", "rt", "rgt", "\u53f3" };

        internal static readonly HashSet<string> Noise = new HashSet<string>
            { "mixamorig", "bip", "cc", "base", "def", "j", "c", "b", "jnt", "joint", "bone", "bn", "armature", "character", "valvebiped", "rig", "bend", "stretch", "m", "x", "skin", "bind" };

        internal static readonly HashSet<string> Helpers = new HashSet<string>
            { "twist", "roll", "ik", "fk", "pole", "target", "end", "nub", "tip", "ctrl", "control", "helper", "socket", "effector", "share", "adj", "mch", "org", "weapon", "hair", "skirt", "breast", "eye", "eyelid", "jaw", "tongue", "teeth", "thumb", "index", "middle", "ring", "pinky", "little", "finger", "metacarpal", "heel" };

        internal static readonly Dictionary<string, string> Vrm = new Dictionary<string, string>
            {
                ["pelvis"] = "hips",
                ["neck"] = "neck",
                ["head"] = "head",
                ["left_hip"] = "leftUpperLeg",
                ["left_knee"] = "leftLowerLeg",
                ["left_ankle"] = "leftFoot",
                ["left_foot"] = "leftToes",
                ["right_hip"] = "rightUpperLeg",
                ["right_knee"] = "rightLowerLeg",
                ["right_ankle"] = "rightFoot",
                ["right_foot"] = "rightToes",
                ["left_collar"] = "leftShoulder",
                ["left_shoulder"] = "leftUpperArm",
                ["left_elbow"] = "leftLowerArm",
                ["left_wrist"] = "leftHand",
                ["right_collar"] = "rightShoulder",
                ["right_shoulder"] = "rightUpperArm",
                ["right_elbow"] = "rightLowerArm",
                ["right_wrist"] = "rightHand",
            };

        internal static readonly string[] VrmSpine = new string[]
            { "spine", "chest", "upperChest" };
    }
}
