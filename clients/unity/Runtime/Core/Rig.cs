using System;
using System.Collections.Generic;

namespace Wayfarer
{
    /// <summary>A node of a character: its name, its parent's number (-1: none), its rest transform relative to the parent.</summary>
    public struct RigNode
    {
        public string Name;
        public int Parent;

        /// <summary>x, y, z; null: 0.</summary>
        public double[] Position;

        /// <summary>x, y, z, w; null: none.</summary>
        public double[] Rotation;

        /// <summary>x, y, z; null: 1.</summary>
        public double[] Scale;
    }

    /// <summary>A character's nodes, parents before children, and where they are at rest in the character's own space.</summary>
    public sealed class Rig
    {
        private static readonly double[] Origin = { 0, 0, 0 };
        private static readonly double[] NoTurn = { 0, 0, 0, 1 };
        private static readonly double[] NoScale = { 1, 1, 1 };

        private readonly string[] names;
        private readonly int[] parents;
        private readonly List<int>[] children;
        private readonly double[] rotations;
        private readonly double[] places;
        private readonly double[] own; // scales of the nodes by themselves
        private readonly double[] scales; // products from the top; right if each is equal along all axes

        /// <exception cref="ArgumentException">A parent does not stand before its child.</exception>
        public Rig(IReadOnlyList<RigNode> nodes)
        {
            Count = nodes.Count;
            names = new string[Count];
            parents = new int[Count];
            children = new List<int>[Count];
            rotations = new double[4 * Count];
            places = new double[3 * Count];
            scales = new double[3 * Count];
            own = new double[3 * Count];
            for (int k = 0; k < Count; k++)
            {
                Put(nodes[k], k);
            }
        }

        /// <summary>Number of nodes.</summary>
        public int Count { get; }

        public string Name(int node)
        {
            return names[node];
        }

        /// <summary>Number of its parent, or -1.</summary>
        public int Parent(int node)
        {
            return parents[node];
        }

        public IReadOnlyList<int> Children(int node)
        {
            return children[node];
        }

        /// <summary>Place of a node, x, y, z; the origin for -1.</summary>
        public double[] Place(int node)
        {
            return node < 0 ? new double[3] : Cut(places, 3 * node, 3);
        }

        /// <summary>Rotation of a node in the character's space; the identity for -1.</summary>
        public double[] Rotation(int node)
        {
            return node < 0 ? (double[])NoTurn.Clone() : Cut(rotations, 4 * node, 4);
        }

        /// <summary>Scale of a node in the character's space; one for -1.</summary>
        public double[] Scale(int node)
        {
            return node < 0 ? (double[])NoScale.Clone() : Cut(scales, 3 * node, 3);
        }

        /// <summary>Scale of a node relative to its parent.</summary>
        public double[] OwnScale(int node)
        {
            return Cut(own, 3 * node, 3);
        }

        /// <summary>A node and all below it, level by level.</summary>
        public List<int> Subtree(int node)
        {
            var found = new List<int> { node };
            for (int k = 0; k < found.Count; k++)
            {
                found.AddRange(children[found[k]]);
            }
            return found;
        }

        /// <summary>Ancestors of a node, from its parent to the top.</summary>
        public List<int> Ancestors(int node)
        {
            var found = new List<int>();
            for (int k = parents[node]; k >= 0; k = parents[k])
            {
                found.Add(k);
            }
            return found;
        }

        private void Put(RigNode node, int k)
        {
            if (node.Parent < -1 || node.Parent >= k)
            {
                throw new ArgumentException("node " + k + " (" + node.Name + "): its parent must stand before it");
            }
            names[k] = node.Name;
            parents[k] = node.Parent;
            children[k] = new List<int>();
            double[] position = node.Position ?? Origin;
            double[] turn = node.Rotation ?? NoTurn;
            double[] scale = node.Scale ?? NoScale;
            double length = Math.Sqrt(
                turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2] + turn[3] * turn[3]);
            for (int n = 0; n < 4; n++)
            {
                rotations[4 * k + n] = turn[n] / length;
            }
            Array.Copy(position, 0, places, 3 * k, 3);
            Array.Copy(scale, 0, scales, 3 * k, 3);
            Array.Copy(scale, 0, own, 3 * k, 3);
            int p = node.Parent;
            if (p < 0)
            {
                return;
            }
            children[p].Add(k);
            for (int n = 0; n < 3; n++)
            {
                places[3 * k + n] *= scales[3 * p + n];
                scales[3 * k + n] *= scales[3 * p + n];
            }
            Quaternions.Multiply(rotations, 4 * p, rotations, 4 * k, rotations, 4 * k);
            Quaternions.Rotate(rotations, 4 * p, places, 3 * k, places, 3 * k);
            for (int n = 0; n < 3; n++)
            {
                places[3 * k + n] += places[3 * p + n];
            }
        }

        private static double[] Cut(double[] from, int start, int length)
        {
            var part = new double[length];
            Array.Copy(from, start, part, 0, length);
            return part;
        }
    }
}
