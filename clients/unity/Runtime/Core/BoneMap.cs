using System;
using System.Collections.Generic;
using System.Linq;

namespace Wayfarer
{
    /// <summary>
    /// Which node of a rig is which bone: clients/README.md, "Bones of a character". It can be shown and corrected.
    /// </summary>
    public sealed class BoneMap
    {
        internal static readonly string[] Sides = { "left", "right" };
        internal static readonly string[] Required =
        {
            "pelvis", "left_hip", "left_knee", "left_ankle", "right_hip", "right_knee", "right_ankle",
        };

        private readonly Dictionary<string, int> bones;

        /// <summary>A map of your own: node of each bone that there is.</summary>
        /// <exception cref="ArgumentException">It is no humanoid.</exception>
        public BoneMap(Rig rig, IReadOnlyDictionary<string, int> bones, string foundBy = "user")
        {
            Rig = rig;
            FoundBy = foundBy;
            this.bones = bones.ToDictionary(pair => pair.Key, pair => pair.Value);
            Check();
        }

        public Rig Rig { get; }

        /// <summary>"vrm" (a table of the file or of a Humanoid avatar), "names", "shape" or "user".</summary>
        public string FoundBy { get; }

        /// <summary>Bones that the rig lacks; their turns go on into their children.</summary>
        public IReadOnlyList<string> Missing
        {
            get { return Bones.Names.Where(bone => !bones.ContainsKey(bone)).ToList(); }
        }

        /// <summary>
        /// The map of a rig. <paramref name="humanoid"/>: VRM's names (those of Unity's HumanBodyBones, with a small first
        /// letter) → nodes, or null; <paramref name="basis"/>: of the rig's space, for its up; <paramref name="correct"/>: as
        /// <see cref="Corrected(IReadOnlyDictionary{string, int})"/>, also of what would be refused without.
        /// </summary>
        /// <exception cref="ArgumentException">It names the hips or legs that are missing.</exception>
        public static BoneMap Of(
            Rig rig, IReadOnlyDictionary<string, int> humanoid, Basis basis, IReadOnlyDictionary<string, int> correct = null)
        {
            string foundBy;
            Dictionary<string, int> found = Find(rig, humanoid, basis, out foundBy);
            bool asFound = correct == null || correct.Count == 0;
            return asFound ? new BoneMap(rig, found, foundBy) : new BoneMap(rig, Changed(found, correct));
        }

        /// <summary>What is found, enough or not, and how.</summary>
        private static Dictionary<string, int> Find(
            Rig rig, IReadOnlyDictionary<string, int> humanoid, Basis basis, out string foundBy)
        {
            foundBy = "vrm";
            if (humanoid != null && humanoid.Count > 0)
            {
                return BonesByTable.Find(humanoid);
            }
            foundBy = "names";
            Dictionary<string, int> named = new BonesByName(rig).Find();
            if (Required.All(named.ContainsKey))
            {
                return named;
            }
            Dictionary<string, int> shaped = new BonesByShape(rig, basis).Find();
            if (!Required.All(shaped.ContainsKey))
            {
                return named;
            }
            foundBy = "shape";
            return shaped;
        }

        /// <summary>Node of a bone, or -1.</summary>
        public int Node(string bone)
        {
            int node;
            return bones.TryGetValue(bone, out node) ? node : -1;
        }

        /// <summary>Canonical name → name of the node: to show it, or keep it.</summary>
        public Dictionary<string, string> Table()
        {
            return Bones.Names.Where(bones.ContainsKey).ToDictionary(bone => bone, bone => Rig.Name(bones[bone]));
        }

        /// <summary>With other nodes for some bones (by node name), or without them (null).</summary>
        /// <exception cref="ArgumentException">There is no such bone or node, or the map is no humanoid then.</exception>
        public BoneMap Corrected(IReadOnlyDictionary<string, string> changes)
        {
            List<string> names = Enumerable.Range(0, Rig.Count).Select(Rig.Name).ToList();
            foreach (KeyValuePair<string, string> change in changes)
            {
                if (change.Value != null && !names.Contains(change.Value))
                {
                    throw new ArgumentException(change.Key + ": the rig has no node \"" + change.Value + "\"");
                }
            }
            return Corrected(changes.ToDictionary(change => change.Key, change => names.IndexOf(change.Value)));
        }

        /// <summary>With other nodes for some bones, or without them (-1).</summary>
        /// <exception cref="ArgumentException">There is no such bone, or the map is no humanoid then.</exception>
        public BoneMap Corrected(IReadOnlyDictionary<string, int> changes)
        {
            return new BoneMap(Rig, Changed(bones, changes));
        }

        private static Dictionary<string, int> Changed(Dictionary<string, int> found, IReadOnlyDictionary<string, int> changes)
        {
            var changed = new Dictionary<string, int>(found);
            foreach (KeyValuePair<string, int> change in changes)
            {
                changed.Remove(change.Key);
                if (change.Value >= 0)
                {
                    changed[change.Key] = change.Value;
                }
            }
            return changed;
        }

        /// <summary>That the bones are those of a humanoid.</summary>
        private void Check()
        {
            foreach (KeyValuePair<string, int> pair in bones)
            {
                if (Bones.IndexOf(pair.Key) < 0)
                {
                    throw new ArgumentException(
                        "\"" + pair.Key + "\" is no bone; bones are " + string.Join(", ", Bones.Names.ToArray()));
                }
            }
            string[] lacking = Required.Where(bone => !bones.ContainsKey(bone)).ToArray();
            if (lacking.Length > 0)
            {
                throw new ArgumentException(
                    "neither names nor shape of this rig tell its " + string.Join(", ", lacking)
                    + ": say which nodes these are, by a correction");
            }
            foreach (string side in Sides)
            {
                MustHang(side + "_hip", "pelvis");
                MustHang(side + "_knee", side + "_hip");
                MustHang(side + "_ankle", side + "_knee");
            }
            var boneOf = new Dictionary<int, string>();
            foreach (string bone in Bones.Names.Where(bones.ContainsKey))
            {
                boneOf[bones[bone]] = bone;
            }
            foreach (string bone in Bones.Names.Where(bones.ContainsKey))
            {
                string above = Rig.Ancestors(bones[bone]).Where(boneOf.ContainsKey).Select(n => boneOf[n]).FirstOrDefault();
                bool right = bone == "pelvis" ? above == null : above != null && Bones.IndexOf(above) < Bones.IndexOf(bone);
                if (!right)
                {
                    throw new ArgumentException(
                        bone + ": \"" + Rig.Name(bones[bone]) + "\" hangs from " + (above ?? "no bone"));
                }
            }
        }

        private void MustHang(string lower, string upper)
        {
            if (!Rig.Ancestors(bones[lower]).Contains(bones[upper]))
            {
                throw new ArgumentException(
                    lower + ": \"" + Rig.Name(bones[lower]) + "\" does not hang from the " + upper);
            }
        }
    }
}
