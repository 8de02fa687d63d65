using System;
using System.Collections.Generic;
using System.Linq;

namespace Wayfarer
{
    /// <summary>Bones of a rig by its shape: legs end lowest, the spine goes up between them, arms branch to both sides.</summary>
    internal sealed class BonesByShape
    {
        private static readonly string[] LegBones = { "hip", "knee", "ankle", "foot" };
        private static readonly string[] ArmBones = { "collar", "shoulder", "elbow", "wrist" };

        private readonly Rig rig;
        private readonly Basis basis;
        private readonly Dictionary<string, int> bones = new Dictionary<string, int>();
        private double[] height;
        private double tall;
        private List<int>[] below;

        public BonesByShape(Rig rig, Basis basis)
        {
            this.rig = rig;
            this.basis = basis;
        }

        public Dictionary<string, int> Find()
        {
            if (rig.Count == 0)
            {
                return bones;
            }
            height = Enumerable.Range(0, rig.Count).Select(k => Vectors.Dot(rig.Place(k), basis.UpAxis)).ToArray();
            double floor = height.Min();
            tall = height.Max() - floor;
            below = Enumerable.Range(0, rig.Count).Select(Subtree).ToArray();
            int[] lowest = below.Select(nodes => nodes.Aggregate((low, k) => height[k] < height[low] ? k : low)).ToArray();
            int pelvis = -1;
            var legs = new int[2];
            for (int k = 0; k < rig.Count && tall > 0; k++)
            {
                List<int> feet = rig.Children(k).Where(child => height[lowest[child]] < floor + 0.1 * tall).ToList();
                for (int a = 0; a < feet.Count; a++)
                {
                    for (int b = a + 1; b < feet.Count; b++)
                    {
                        if (Vectors.Length(Level(Gap(lowest[feet[b]], lowest[feet[a]]))) > 0.05 * tall)
                        {
                            pelvis = k; // parents come first: the deepest stays
                            legs = new[] { feet[a], feet[b] };
                        }
                    }
                }
            }
            if (pelvis >= 0)
            {
                FindAll(pelvis, legs, legs.Select(leg => Joints(rig, Path(leg, lowest[leg]), 0.03 * tall)).ToArray());
            }
            return bones;
        }

        /// <summary>Of a path, those at least so far from the one before.</summary>
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

        private void FindAll(int pelvis, int[] legs, List<int>[] chains)
        {
            if (chains.Any(chain => chain.Count < 3))
            {
                return;
            }
            double[][] toes = chains.Select(chain => Gap(chain[2], chain[Math.Min(3, chain.Count - 1)])).ToArray();
            double[] forward = Level(Vectors.Plus(toes[0], toes[1]));
            if (Vectors.Length(forward) < 0.01 * tall)
            {
                return; // no toes: nothing tells front from back
            }
            double[] left = Vectors.Times(basis.Handed, Vectors.Cross(basis.UpAxis, forward));
            if (Vectors.Dot(Level(Gap(legs[1], legs[0])), left) < 0)
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

        /// <summary>A node and all below it, level by level.</summary>
        private List<int> Subtree(int node)
        {
            var found = new List<int> { node };
            for (int k = 0; k < found.Count; k++)
            {
                found.AddRange(rig.Children(found[k]));
            }
            return found;
        }

        /// <summary>From a node down to one below it.</summary>
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
    }
}
