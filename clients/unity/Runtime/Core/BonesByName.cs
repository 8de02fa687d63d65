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

        private static readonly Regex Tokens = new Regex("[A-Za-z]+|[^\\u0000-\\u007f]+");

        private static readonly string[][] Limbs = // pairs of a role and the role of the bone that it hangs from
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
            Take("neck", "neck", "", -1);
            Take("head", "head", "", Node("neck"));
            Take("pelvis", "pelvis", "", -1);
            FindPelvis();
            FindSpine();
            return bones;
        }

        /// <summary>A node of a limb whose name gives the other side than its bone; -1: none, or most agree with it.</summary>
        public static int Contradicted(BoneMap map)
        {
            var names = new BonesByName(map.Rig);
            int against = -1, told = 0;
            foreach (string bone in Bones.Names)
            {
                int node = map.Node(bone);
                string which = bone.Split('_')[0];
                if (node < 0 || !BoneMap.Sides.Contains(which) || names.side[node] == "")
                {
                    continue;
                }
                told += names.side[node] == which ? 1 : -1;
                if (names.side[node] != which && against < 0)
                {
                    against = node;
                }
            }
            return told < 0 ? against : -1;
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
            string[] tokens = Tokens.Matches(Breaks.Replace(last, " ")).Cast<Match>()
                .Select(match => match.Value.ToLowerInvariant()).ToArray();
            if (tokens.Any(BoneNames.Helpers.Contains))
            {
                return;
            }
            foreach (string each in tokens)
            {
                string token = Unsided(Unsided(each, BoneNames.Left, "left", node), BoneNames.Right, "right", node);
                if (!BoneNames.Noise.Contains(token))
                {
                    rest[node] += token;
                }
            }
        }

        /// <summary>A token without the side at its start, where words begin with it in scripts without spaces.</summary>
        private string Unsided(string token, IEnumerable<string> marks, string which, int node)
        {
            foreach (string mark in marks)
            {
                if (token == mark || (mark[0] > 127 && token.StartsWith(mark, StringComparison.Ordinal)))
                {
                    side[node] = which;
                    return token.Substring(mark.Length);
                }
            }
            return token;
        }

        /// <summary>
        /// The uppermost node with the first of the role's words that any node has. Nodes below <paramref
        /// name="inside"/> come first. Otherwise it may be anywhere: feet of IK rigs hang from the root. A word of two
        /// roles, such as foot, is not looked for there.
        /// </summary>
        private void Take(string bone, string role, string which, int inside)
        {
            foreach (int within in inside < 0 ? new[] { -1 } : new[] { inside, -1 })
            {
                foreach (string word in BoneNames.Roles[role])
                {
                    int first = -1;
                    bool shared = within < 0 && inside >= 0 && role == "foot" && word == "foot";
                    for (int k = 0; k < rig.Count && !shared; k++)
                    {
                        bool fits = rest[k] == word && side[k] == which && !taken.Contains(k)
                            && (within < 0 || above[k].Contains(within));
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
        }

        /// <summary>The nodes at the end of the trunk: the neck, or the head, or both arms.</summary>
        private int[] Top()
        {
            int one = Node("neck") >= 0 ? Node("neck") : Node("head");
            if (one >= 0)
            {
                return new[] { one };
            }
            int[] arms = BoneMap.Sides.Select(
                which => Node(which + "_collar") >= 0 ? Node(which + "_collar") : Node(which + "_shoulder")).ToArray();
            return arms.Min() >= 0 ? arms : new int[0];
        }

        private int[] Thighs()
        {
            return BoneMap.Sides.Select(which => Node(which + "_hip")).Where(node => node >= 0).ToArray();
        }

        /// <summary>Moves the pelvis to the lowest node that carries both legs and the trunk.</summary>
        private void FindPelvis()
        {
            int[] legs = Thighs();
            if (legs.Length < 2)
            {
                return;
            }
            foreach (int[] carried in new[] { legs.Concat(Top()).ToArray(), legs })
            {
                List<int> shared = Shared(carried);
                if (shared.Contains(Node("pelvis")))
                {
                    return;
                }
                if (shared.Count > 0)
                {
                    bones["pelvis"] = shared[0];
                    return;
                }
            }
        }

        /// <summary>The common ancestors of these nodes, from below.</summary>
        private List<int> Shared(int[] nodes)
        {
            return above[nodes[0]].Where(k => nodes.All(n => above[n].Contains(k))).ToList();
        }

        /// <summary>
        /// The trunk's bones, from which no thigh hangs. Where rigs only number them, with neck and head, as Rigify
        /// does, where arms branch off tells them apart.
        /// </summary>
        private void FindSpine()
        {
            int[] top = Top();
            if (top.Length == 0 || Node("pelvis") < 0)
            {
                return;
            }
            if (top.Length == 1)
            {
                BonesByTable.SpreadSpine(Trunk(top[0]), bones);
                return;
            }
            List<int> shared = Shared(top);
            if (shared.Count == 0 || !above[shared[0]].Contains(Node("pelvis")))
            {
                return;
            }
            int chest = shared[0];
            var chain = new List<int>();
            for (List<int> next = Onward(chest); next.Count == 1; next = Onward(next[0]))
            {
                chain.Add(next[0]);
            }
            List<int> line = Trunk(chest);
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

        /// <summary>Named nodes below this one, from the lowest, except ancestors of thighs.</summary>
        private List<int> Trunk(int top)
        {
            int[] legs = Thighs();
            return above[top].TakeWhile(k => !legs.Any(leg => above[leg].Contains(k)))
                .Where(k => rest[k] != "" && side[k] == "").Reverse().ToList();
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
