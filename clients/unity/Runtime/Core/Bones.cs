using System.Collections.Generic;

namespace Wayfarer
{
    /// <summary>The 22 bones of a stream's profile <c>body</c>, in order; parents come first.</summary>
    public static class Bones
    {
        public const int Count = 22;

        private static readonly string[] NameOf =
        {
            "pelvis", "left_hip", "right_hip", "spine1", "left_knee", "right_knee", "spine2", "left_ankle",
            "right_ankle", "spine3", "left_foot", "right_foot", "neck", "left_collar", "right_collar", "head",
            "left_shoulder", "right_shoulder", "left_elbow", "right_elbow", "left_wrist", "right_wrist",
        };

        private static readonly int[] ParentOf =
        {
            -1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19,
        };

        public static IReadOnlyList<string> Names => NameOf;

        /// <summary>Number of each bone's parent; -1: none.</summary>
        public static IReadOnlyList<int> Parents => ParentOf;

        /// <summary>Number of a bone, or -1.</summary>
        public static int IndexOf(string name)
        {
            return System.Array.IndexOf(NameOf, name);
        }

        internal static int Parent(int bone)
        {
            return ParentOf[bone];
        }
    }
}
