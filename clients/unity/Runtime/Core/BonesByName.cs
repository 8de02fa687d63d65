using System;
using System.Collections.Generic;
using System.Linq;
using System.Text.RegularExpressions;

namespace Wayfarer
{
    /// <summary>Bones of a rig by the words of its nodes' names: clients/README.md, "Bones of a character".</summary>
    internal sealed class BonesByName
    {
        private static readonly Regex Breaks = new Regex(
            "(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])|(?<=[A-Za-z])(?=[0-9])|(?<=[0-9])(?=[A-Za-z])");

        private static readonly string[][] Limbs = // role, and the role of the bone that it hangs from
        {
            new[] { "hip", "" }, new[] { "knee", "hip" }, new[] { "ankle", "knee" }, new[] { "foot", "ankle" },
            new[] { "shoulder", "" }, new[] { "elbow", "shoulder" }, new[] { "wrist", "elbow" }, new[] { "collar", "" },
        };

        private readonly Rig rig;
        private readonly string[] side; // of each node: "left", "right", ""
        private readonly string[] rest; // of each node: the other words of its name; "": it is no bone
        private readonly List<int>[] above;
        private readonly Dictionary<string, int> bones = new Dictionary<string, int>();
        private readonly HashSet<int> taken = new HashSet<int>();

        public BonesByName(Rig rig)
        {
            this.rig = rig;
            side = new string[rig.Count];
            rest = new string[rig.Count];
            above = new List<int>[rig.Count];
            for (int k = 0; k < rig.Count; k++)
            {
                Split(k);
                above[k] = rig.Ancestors(k);
            }
        }

        public Dictionary<string, int> Find()
        {
            foreach (string which in BoneMap.Sides)
            {
                foreach (string[] limb in Limbs)
                {
                    Take(which + "_" + limb[0], limb[0], which, Node(which + "_" + limb[1]));
                }
            }
            Take("pelvis", "pelvis", "", -1);
            int left = Node("left_hip"), right = Node("right_hip");
            if (left >= 0 && right >= 0)
            {
                List<int> shared = above[left].Where(above[right].Contains).ToList();
                if (shared.Count > 0 && !shared.Contains(Node("pelvis")))
                {
                    bones["pelvis"] = shared[0];
                }
            }
            Take("neck", "neck", "", -1);
            Take("head", "head", "", Node("neck"));
            int low = Node("pelvis"), top = Node("neck") >= 0 ? Node("neck") : Node("head");
            if (low >= 0 && top < 0)
            {
                FindTrunk(low);
            }
            else if (low >= 0 && above[top].Contains(low))
            {
                BonesByTable.SpreadSpine(Between(low, top), bones);
            }
            return bones;
        }

        private int Node(string bone)
        {
            int node;
            return bones.TryGetValue(bone, out node) ? node : -1;
        }

        /// <summary>Side and the rest of a name; a helper has no rest.</summary>
        private void Split(int node)
        {
            side[node] = rest[node] = "";
            string last = (rig.Name(node) ?? "").Split(':', '|').Last();
            string[] tokens = Regex.Split(Breaks.Replace(last, " "), "[^A-Za-z]+")
                .Where(token => token.Length > 0).Select(token => token.ToLowerInvariant()).ToArray();
            if (tokens.Any(BoneNames.Helpers.Contains))
            {
                return;
            }
            foreach (string token in tokens)
            {
                if (BoneNames.Left.Contains(token))
                {
                    side[node] = "left";
                }
                else if (BoneNames.Right.Contains(token))
                {
                    side[node] = "right";
                }
                else if (!BoneNames.Noise.Contains(token))
                {
                    rest[node] += token;
                }
            }
        }

        /// <summary>The uppermost node of a role's first word that any has, below <paramref name="inside"/> (-1: all).</summary>
        private void Take(string bone, string role, string which, int inside)
        {
            foreach (string word in BoneNames.Roles[role])
            {
                int first = -1;
                for (int k = 0; k < rig.Count; k++)
                {
                    bool fits = rest[k] == word && side[k] == which && !taken.Contains(k)
                        && (inside < 0 || above[k].Contains(inside));
                    if (fits && (first < 0 || above[k].Count < above[first].Count))
                    {
                        first = k;
                    }
                }
                if (first >= 0)
                {
                    bones[bone] = first;
                    taken.Add(first);
                    return;
                }
            }
        }

        /// <summary>Nodes with a name between two, from below.</summary>
        private List<int> Between(int low, int top)
        {
            return above[top].TakeWhile(k => k != low).Reverse().Where(k => rest[k] != "").ToList();
        }

        /// <summary>Spine, neck and head of a rig that only numbers them, as Rigify: by where arms branch off.</summary>
        private void FindTrunk(int pelvis)
        {
            int[] arms = BoneMap.Sides.Select(
                which => Node(which + "_collar") >= 0 ? Node(which + "_collar") : Node(which + "_shoulder")).ToArray();
            if (arms.Min() < 0)
            {
                return;
            }
            List<int> shared = above[arms[0]].Where(above[arms[1]].Contains).ToList();
            if (shared.Count == 0 || !above[shared[0]].Contains(pelvis))
            {
                return;
            }
            int chest = shared[0];
            var chain = new List<int>();
            for (List<int> next = Onward(chest); next.Count == 1; next = Onward(next[0]))
            {
                chain.Add(next[0]);
            }
            List<int> line = Between(pelvis, chest);
            line.Add(chest);
            BonesByTable.SpreadSpine(line, bones);
            List<int> joints = BonesByShape.Joints(rig, chain, 0.01 * Extent());
            if (joints.Count > 1)
            {
                bones["neck"] = joints[0];
            }
            if (joints.Count > 0)
            {
                bones["head"] = joints[joints.Count - 1];
            }
        }

        private List<int> Onward(int node)
        {
            return rig.Children(node).Where(k => rest[k] != "" && side[k] == "").ToList();
        }

        /// <summary>The longest edge of the box around all nodes.</summary>
        private double Extent()
        {
            double most = 0;
            for (int n = 0; n < 3; n++)
            {
                double[] values = Enumerable.Range(0, rig.Count).Select(k => rig.Place(k)[n]).ToArray();
                most = Math.Max(most, values.Max() - values.Min());
            }
            return most;
        }
    }
}
