// Written by `python -m tests.golden` from the Python client's bone_names.json.
using System.Collections.Generic;

namespace Wayfarer
{
    internal static class BoneNames
    {
        internal static readonly Dictionary<string, string[]> Roles = new Dictionary<string, string[]>
            {
                ["hip"] = new[] { "upleg", "upperleg", "legupper", "thigh", "femur", "hip" },
                ["knee"] = new[] { "lowerleg", "lowleg", "leglower", "calf", "shin", "knee", "leg" },
                ["ankle"] = new[] { "ankle", "foot" },
                ["foot"] = new[] { "toebase", "toe", "toes", "ball", "foot" },
                ["shoulder"] = new[] { "upperarm", "uparm", "armupper", "arm", "humerus", "shldr", "shoulder" },
                ["collar"] = new[] { "clavicle", "collar", "collarbone", "scapula", "shoulder" },
                ["elbow"] = new[] { "lowerarm", "forearm", "lowarm", "armlower", "elbow" },
                ["wrist"] = new[] { "hand", "wrist" },
                ["pelvis"] = new[] { "hips", "pelvis", "hip" },
                ["neck"] = new[] { "neck", "necklower" },
                ["head"] = new[] { "head" },
            };

        internal static readonly HashSet<string> Left = new HashSet<string>
            { "left", "l", "lf", "lft" };

        internal static readonly HashSet<string> Right = new HashSet<string>
            { "right", "r", "rt", "rgt" };

        internal static readonly HashSet<string> Noise = new HashSet<string>
            { "mixamorig", "bip", "cc", "base", "def", "j", "c", "b", "jnt", "joint", "bone", "bn", "armature", "character", "valvebiped", "rig" };

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
