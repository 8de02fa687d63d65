using System;
using System.Collections.Generic;
using System.Linq;

namespace Wayfarer
{
    /// <summary>Bones of a rig by its shape: legs end lowest, the spine goes up between them, arms branch to both sides.</summary>
    internal sealed class BonesByShape
    {
        private const double Low = 0.1; // of the rig's height: a branch that ends below this reaches the ground
        private const double Apart = 0.05; // of that height: least distance between the ends of two legs
        private const double Toes = 0.02; // of that height: least distance of toes before the ankle
        private const double Far = 0.25; // of that height: least distance between two pairs of legs
        private static readonly string[] LegBones = { "hip", "knee", "ankle", "foot" };
        private static readonly string[] ArmBones = { "collar", "shoulder", "elbow", "wrist" };

        private readonly Rig rig;
        private readonly Basis basis;
        private readonly Dictionary<string, int> bones = new Dictionary<string, int>();
        private readonly double[] height;
        private readonly double tall;
        private readonly List<int>[] below;
        private readonly List<Pair> pairs = new List<Pair>();

        public BonesByShape(Rig rig, Basis basis)
        {
            this.rig = rig;
            this.basis = basis;
            height = Enumerable.Range(0, rig.Count).Select(k => Vectors.Dot(rig.Place(k), basis.UpAxis)).ToArray();
            below = Enumerable.Range(0, rig.Count).Select(rig.Subtree).ToArray();
            double floor = rig.Count == 0 ? 0 : height.Min();
            tall = rig.Count == 0 ? 0 : height.Max() - floor;
            int[] lowest = below.Select(nodes => nodes.Aggregate((low, k) => height[k] < height[low] ? k : low)).ToArray();
            for (int k = 0; k < rig.Count && tall > 0; k++)
            {
                List<int> feet = rig.Children(k).Where(child => height[lowest[child]] < floor + Low * tall).ToList();
                List<int>[] chains = feet.Select(leg => Joints(rig, Path(leg, lowest[leg]), 0.03 * tall)).ToArray();
                for (int a = 0; a < feet.Count; a++)
                {
                    for (int b = a + 1; b < feet.Count; b++)
                    {
                        double apart = Vectors.Length(Level(Gap(lowest[feet[b]], lowest[feet[a]])));
                        if (Math.Min(chains[a].Count, chains[b].Count) >= 3 && apart > Apart * tall)
                        {
                            pairs.Add(new Pair { Above = k, Chains = new[] { chains[a], chains[b] } });
                        }
                    }
                }
            }
        }

        /// <summary>The bones that the shape reveals, enough for a humanoid or not.</summary>
        public Dictionary<string, int> Find()
        {
            Pair pair = pairs.LastOrDefault(each => each.Chains.All(chain => Vectors.Length(ToesOf(chain)) >= Toes * tall));
            if (pair != null) // parents come first: the deepest. Without toes a skirt looks like legs
            {
                FindAll(pair.Above, pair.Chains.ToArray());
            }
            return bones;
        }

        /// <summary>A pair of legs of the same body that hangs far from these two thighs; null: none does.</summary>
        public int[] OtherLegs(int pelvis, int[] hips)
        {
            var line = new HashSet<int>(below[pelvis].Concat(rig.Ancestors(pelvis)));
            var own = new HashSet<int>(hips.Concat(hips.SelectMany(rig.Ancestors)));
            foreach (Pair pair in pairs)
            {
                int[] tops = pair.Chains.Select(chain => chain[0]).ToArray();
                if (!line.Contains(pair.Above) || tops.Any(own.Contains))
                {
                    continue;
                }
                double[] away = Vectors.Plus(Gap(hips[0], tops[0]), Gap(hips[1], tops[1]));
                if (Vectors.Length(Level(away)) / 2 > Far * tall)
                {
                    return tops;
                }
            }
            return null;
        }

        /// <summary>The nodes of a path, without those too near to the one kept before.</summary>
        public static List<int> Joints(Rig rig, IEnumerable<int> line, double least)
        {
            var found = new List<int>();
            foreach (int k in line)
            {
                bool far = found.Count == 0
                    || Vectors.Length(Vectors.Minus(rig.Place(k), rig.Place(found[found.Count - 1]))) >= least;
                if (far)
                {
                    found.Add(k);
                }
            }
            return found;
        }

        private void FindAll(int pelvis, List<int>[] chains)
        {
            double[] forward = Vectors.Plus(ToesOf(chains[0]), ToesOf(chains[1]));
            if (Vectors.Length(forward) < 0.01 * tall)
            {
                return;
            }
            double[] left = Vectors.Times(basis.Handed, Vectors.Cross(basis.UpAxis, forward));
            if (Vectors.Dot(Level(Gap(chains[1][0], chains[0][0])), left) < 0)
            {
                Array.Reverse(chains);
            }
            bones["pelvis"] = pelvis;
            for (int s = 0; s < 2; s++)
            {
                for (int k = 0; k < Math.Min(LegBones.Length, chains[s].Count); k++)
                {
                    bones[BoneMap.Sides[s] + "_" + LegBones[k]] = chains[s][k];
                }
            }
            int top = below[pelvis].Aggregate((high, k) => height[k] > height[high] ? k : high);
            FindUpper(Path(pelvis, top).Skip(1).ToList(), Vectors.Times(1 / Vectors.Length(left), left));
        }

        private void FindUpper(List<int> spine, double[] left)
        {
            double[] aside = Enumerable.Range(0, rig.Count).Select(k => Vectors.Dot(rig.Place(k), left)).ToArray();
            for (int k = 0; k < spine.Count; k++)
            {
                int chest = spine[k];
                List<int> arms = rig.Children(chest).Where(child => !spine.Contains(child)).ToList();
                List<int> reach = arms.Select(arm => below[arm].Aggregate(
                    (far, n) => Math.Abs(aside[n]) > Math.Abs(aside[far]) ? n : far)).ToList();
                int[] both =
                {
                    reach.FindIndex(end => aside[end] - aside[chest] > 0.15 * tall),
                    reach.FindIndex(end => aside[end] - aside[chest] < -0.15 * tall),
                };
                if (both.Min() < 0)
                {
                    continue;
                }
                BonesByTable.SpreadSpine(spine.Take(k + 1).ToList(), bones);
                for (int s = 0; s < 2; s++)
                {
                    FindArm(BoneMap.Sides[s], Joints(rig, Path(arms[both[s]], reach[both[s]]), 0.02 * tall));
                }
                List<int> rest = Joints(rig, spine.Skip(k + 1), 0.01 * tall);
                if (rest.Count > 0)
                {
                    bones[rest.Count == 1 ? "head" : "neck"] = rest[0];
                }
                if (rest.Count > 1)
                {
                    bones["head"] = rest[1];
                }
                return;
            }
            BonesByTable.SpreadSpine(spine.Take(1).ToList(), bones);
        }

        private void FindArm(string side, List<int> all)
        {
            int hand = all.FindIndex(node => rig.Children(node).Count >= 3); // fingers begin
            List<int> chain = hand < 0 ? all : all.Take(hand + 1).ToList();
            string[] names = ArmBones.Skip(chain.Count >= 4 ? 0 : 1).ToArray();
            List<int> ends = chain.Skip(Math.Max(0, chain.Count - 4)).ToList();
            for (int n = 0; n < Math.Min(names.Length, ends.Count); n++)
            {
                bones[side + "_" + names[n]] = ends[n];
            }
        }

        private double[] Gap(int from, int to)
        {
            return Vectors.Minus(rig.Place(to), rig.Place(from));
        }

        private double[] Level(double[] v)
        {
            return Vectors.Without(v, basis.UpAxis);
        }

        /// <summary>Where the toes of a leg point, level.</summary>
        private double[] ToesOf(List<int> chain)
        {
            return Level(Gap(chain[2], chain[Math.Min(3, chain.Count - 1)]));
        }

        /// <summary>The nodes from a node down to a descendant.</summary>
        private List<int> Path(int top, int bottom)
        {
            var line = new List<int> { bottom };
            for (int k = bottom; k != top; k = rig.Parent(k))
            {
                line.Add(rig.Parent(k));
            }
            line.Reverse();
            return line;
        }

        /// <summary>A node, and the joints of two branches of at least three that hang from it and reach the ground apart.</summary>
        private sealed class Pair
        {
            public int Above;
            public List<int>[] Chains;
        }
    }
}
