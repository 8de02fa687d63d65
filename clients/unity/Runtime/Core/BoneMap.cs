using System;
using System.Collections.Generic;
using System.Globalization;
using System.Linq;

namespace Wayfarer
{
    /// <summary>
    /// Maps nodes of a rig to bones: clients/README.md, "Bones of a character". It can be shown and corrected.
    /// </summary>
    public sealed class BoneMap
    {
        internal static readonly string[] Sides = { "left", "right" };
        internal static readonly string[] Required =
        {
            "pelvis", "left_hip", "left_knee", "left_ankle", "right_hip", "right_knee", "right_ankle",
        };

        private const double Uneven = 1.01; // greatest ratio between the scales of a node's axes

        private static readonly string[] TrunkBones = { "pelvis", "spine1", "spine2", "spine3", "neck", "head" };
        private static readonly string[] Branching = { "hip", "collar", "shoulder" }; // may hang from any bone of the trunk

        private readonly Dictionary<string, int> bones;

        /// <summary>Your own map: the node of each bone that the rig has.</summary>
        /// <exception cref="ArgumentException">The map is no humanoid.</exception>
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

        /// <summary>Bones that the rig lacks; their children take over their rotations.</summary>
        public IReadOnlyList<string> Missing
        {
            get { return Bones.Names.Where(bone => !bones.ContainsKey(bone)).ToList(); }
        }

        /// <summary>
        /// The map of a rig. <paramref name="humanoid"/>: VRM's names (those of Unity's HumanBodyBones, with a small
        /// first letter) → nodes, or null. <paramref name="basis"/>: gives the up of the rig's space. <paramref
        /// name="correct"/>: as for <see cref="Corrected(IReadOnlyDictionary{string, int})"/>; it also serves rigs that
        /// would be refused without it.
        /// </summary>
        /// <exception cref="ArgumentException">
        /// It says what is missing, or why the rig is no biped.
        /// </exception>
        public static BoneMap Of(
            Rig rig, IReadOnlyDictionary<string, int> humanoid, Basis basis, IReadOnlyDictionary<string, int> correct = null)
        {
            string foundBy;
            Dictionary<string, int> found = Find(rig, humanoid, basis, out foundBy);
            if (correct != null && correct.Count > 0)
            {
                return new BoneMap(rig, Changed(found, correct));
            }
            var map = new BoneMap(rig, Kept(rig, found), foundBy);
            BipedCheck.Check(map, basis);
            return map;
        }

        /// <summary>The bones found, enough or not, and how they were found.</summary>
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

        /// <summary>The map with other nodes for some bones (by node name), or without them (null).</summary>
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

        /// <summary>The map with other nodes for some bones, or without them (-1).</summary>
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

        /// <summary>Checks that the bones are those of a humanoid.</summary>
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
                IEnumerable<string> known = lacking.Select(Role).Distinct()
                    .Select(role => role + ": " + string.Join(", ", BoneNames.Roles[role]));
                throw new ArgumentException(
                    "no node was found for " + string.Join(", ", lacking)
                    + ", neither by names nor by shape: say which they are, by a correction. Known names, with sides as in LeftFoot, "
                    + "foot_l, foot.L: " + string.Join("; ", known.ToArray()));
            }
            foreach (string bone in Bones.Names.Where(bones.ContainsKey))
            {
                string other = Misplaced(Rig, bones, bone);
                if (other != null)
                {
                    string said = bones[other] == bones[bone] ? "is " + other + ", too" : "hangs from " + other;
                    throw new ArgumentException(bone + ": \"" + Rig.Name(bones[bone]) + "\" " + said);
                }
            }
            foreach (int node in bones.Values.SelectMany(Rig.Ancestors).Distinct())
            {
                double[] scale = Rig.OwnScale(node);
                if (!(scale.Max() > 0 && scale.Max() <= Uneven * scale.Min()))
                {
                    string[] sizes = scale.Select(size => size.ToString("G6", CultureInfo.InvariantCulture)).ToArray();
                    throw new ArgumentException(
                        "\"" + Rig.Name(node) + "\" is scaled by " + string.Join(", ", sizes)
                        + ": bones below it would be sheared or mirrored as they turn. Apply its scale to the model, and export it again");
                }
            }
        }

        /// <summary>The bones without optional ones whose place is impossible.</summary>
        private static Dictionary<string, int> Kept(Rig rig, Dictionary<string, int> found)
        {
            var kept = new Dictionary<string, int>(found);
            foreach (string bone in Bones.Names)
            {
                if (kept.ContainsKey(bone) && !Required.Contains(bone) && Misplaced(rig, kept, bone) != null)
                {
                    kept.Remove(bone);
                }
            }
            return kept;
        }

        /// <summary>The bone that this one wrongly hangs from or shares a node with; null: none.</summary>
        private static string Misplaced(Rig rig, Dictionary<string, int> bones, string bone)
        {
            int node = bones[bone];
            string twin = Bones.Names.FirstOrDefault(b => b != bone && bones.ContainsKey(b) && bones[b] == node);
            if (twin != null)
            {
                return twin;
            }
            string above = rig.Ancestors(node)
                .Select(k => Bones.Names.FirstOrDefault(b => bones.ContainsKey(b) && bones[b] == k)).FirstOrDefault(b => b != null);
            if (above == null || Line(bone).Contains(above))
            {
                return null;
            }
            bool branches = Branching.Contains(Role(bone)) || TrunkBones.Contains(bone);
            return branches && TrunkBones.Contains(above) && !Line(above).Contains(bone) ? null : above;
        }

        /// <summary>The bones above a bone, up to the pelvis.</summary>
        private static IEnumerable<string> Line(string bone)
        {
            for (int k = Bones.Parent(Bones.IndexOf(bone)); k >= 0; k = Bones.Parent(k))
            {
                yield return Bones.Names[k];
            }
        }

        private static string Role(string bone)
        {
            return Sides.Contains(bone.Split('_')[0]) ? bone.Substring(bone.IndexOf('_') + 1) : bone;
        }
    }
}
