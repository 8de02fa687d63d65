using System;
using System.Collections.Generic;
using System.Linq;

namespace Wayfarer
{
    /// <summary>A skin of a character, in numbers. Matrices have 16 numbers, by columns.</summary>
    public sealed class Skin
    {
        /// <summary>Its joints, by number among the nodes; -1: none of them.</summary>
        public int[] Joints;

        /// <summary>Inverse bind matrix of each joint.</summary>
        public double[][] Inverses;

        /// <summary>The space of its mesh, as it is: the skin may have been bound in it.</summary>
        public double[] Space;

        /// <summary>x, y, z of each vertex, in the space of the mesh.</summary>
        public double[] Vertices = new double[0];

        /// <summary>The joint that moves each vertex most.</summary>
        public int[] Movers = new int[0];
    }

    /// <summary>Rest is the bind pose of the skin, whatever frame of an animation the nodes stand in.</summary>
    public static class Skins
    {
        private const double Posed = 0.01; // of the skeleton's size, and of an axis: joints this far off are not in the bind pose

        /// <summary>The nodes in the bind pose of the skins; the same ones if they stand in it.</summary>
        public static RigNode[] Bound(IReadOnlyList<RigNode> nodes, IEnumerable<Skin> skins)
        {
            double[][] world = Worlds(nodes);
            var wanted = new Dictionary<int, double[]>();
            foreach (Skin skin in skins.OrderByDescending(each => each.Joints.Length))
            {
                double[][] found = BoundJoints(nodes, world, skin);
                for (int k = 0; found != null && k < found.Length; k++)
                {
                    if (!wanted.ContainsKey(skin.Joints[k]))
                    {
                        wanted[skin.Joints[k]] = found[k];
                    }
                }
            }
            var placed = new double[nodes.Count][];
            var rest = new RigNode[nodes.Count];
            for (int k = 0; k < nodes.Count; k++)
            {
                double[] above = nodes[k].Parent < 0 ? Identity() : placed[nodes[k].Parent];
                rest[k] = nodes[k];
                if (wanted.TryGetValue(k, out placed[k]))
                {
                    rest[k] = Parts(nodes[k], Product(Inverse(above), placed[k]));
                }
                else
                {
                    placed[k] = Product(above, Local(nodes[k]));
                }
            }
            return rest;
        }

        /// <summary>Vertices of the skins with the nodes at rest, x, y, z each, and the node that moves each most.</summary>
        public static void Points(
            IReadOnlyList<RigNode> rest, IEnumerable<Skin> skins, List<double> places, List<int> movers)
        {
            double[][] world = Worlds(rest);
            foreach (Skin skin in skins)
            {
                for (int v = 0; v < skin.Movers.Length; v++)
                {
                    int joint = skin.Joints[skin.Movers[v]];
                    if (joint < 0)
                    {
                        continue;
                    }
                    double[] m = Product(world[joint], skin.Inverses[skin.Movers[v]]);
                    double x = skin.Vertices[3 * v], y = skin.Vertices[3 * v + 1], z = skin.Vertices[3 * v + 2];
                    for (int n = 0; n < 3; n++)
                    {
                        places.Add(m[n] * x + m[4 + n] * y + m[8 + n] * z + m[12 + n]);
                    }
                    movers.Add(joint);
                }
            }
        }

        /// <summary>A node's own transform.</summary>
        public static double[] Local(RigNode node)
        {
            double[] q = node.Rotation ?? new double[] { 0, 0, 0, 1 }, s = node.Scale ?? new double[] { 1, 1, 1 };
            double[] p = node.Position ?? new double[3];
            double length = Math.Sqrt(q.Sum(value => value * value));
            double x = q[0] / length, y = q[1] / length, z = q[2] / length, w = q[3] / length;
            return new[]
            {
                s[0] * (1 - 2 * (y * y + z * z)), 2 * s[0] * (x * y + w * z), 2 * s[0] * (x * z - w * y), 0,
                2 * s[1] * (x * y - w * z), s[1] * (1 - 2 * (x * x + z * z)), 2 * s[1] * (y * z + w * x), 0,
                2 * s[2] * (x * z + w * y), 2 * s[2] * (y * z - w * x), s[2] * (1 - 2 * (x * x + y * y)), 0,
                p[0], p[1], p[2], 1,
            };
        }

        public static double[] Product(double[] a, double[] b)
        {
            var product = new double[16];
            for (int column = 0; column < 16; column += 4)
            {
                for (int row = 0; row < 4; row++)
                {
                    for (int n = 0; n < 4; n++)
                    {
                        product[column + row] += a[4 * n + row] * b[column + n];
                    }
                }
            }
            return product;
        }

        /// <summary>World matrix of each joint in the bind pose; null: the nodes stand in it.</summary>
        private static double[][] BoundJoints(IReadOnlyList<RigNode> nodes, double[][] world, Skin skin)
        {
            if (skin.Joints.Length < 2 || skin.Joints.Any(joint => joint < 0))
            {
                return null;
            }
            double[][] bound = skin.Inverses.Select(Inverse).ToArray();
            if (bound.Any(matrix => matrix.Any(double.IsNaN)))
            {
                return null;
            }
            double[][] shown = skin.Joints.Select(joint => world[joint]).ToArray();
            double[] back = Inverse(Product(shown[0], skin.Inverses[0]));
            double size = Enumerable.Range(12, 3).Max(n => bound.Max(m => m[n]) - bound.Min(m => m[n]));
            bool stands = true;
            for (int k = 0; k < bound.Length && stands; k++)
            {
                double[] since = Product(back, shown[k]);
                stands = Enumerable.Range(12, 3).All(n => Math.Abs(since[n] - bound[k][n]) <= Posed * size)
                    && Axes(since).Zip(Axes(bound[k]), (a, b) => Math.Abs(a - b)).Max() <= Posed;
            }
            if (stands)
            {
                return null;
            }
            int top = skin.Joints.OrderBy(joint => Above(nodes, joint).Count).First();
            var spaces = new List<double[]> { Identity(), skin.Space };
            spaces.AddRange(Above(nodes, top).Select(k => world[k]));
            double[] space = spaces.OrderBy(one => Off(bound, shown, one)).First();
            return bound.Select(matrix => Product(space, matrix)).ToArray();
        }

        /// <summary>Difference between bound joints, in a space, and shown ones: the median of angle and size.</summary>
        private static double Off(double[][] bound, double[][] shown, double[] space)
        {
            var off = new List<double>();
            for (int k = 0; k < bound.Length; k++)
            {
                double[] placed = Product(space, bound[k]);
                double trace = Axes(placed).Zip(Axes(shown[k]), (a, b) => a * b).Sum();
                double sizes = Math.Abs(Determinant(placed) / Determinant(shown[k]));
                off.Add(Math.Acos(Math.Min(1, Math.Max(-1, (trace - 1) / 2))) + 10 * Math.Abs(Math.Log(sizes)) / 3);
            }
            off.Sort();
            return off[off.Count / 2];
        }

        private static List<int> Above(IReadOnlyList<RigNode> nodes, int node)
        {
            var found = new List<int>();
            for (int k = nodes[node].Parent; k >= 0; k = nodes[k].Parent)
            {
                found.Add(k);
            }
            return found;
        }

        private static double[][] Worlds(IReadOnlyList<RigNode> nodes)
        {
            var world = new double[nodes.Count][];
            for (int k = 0; k < nodes.Count; k++)
            {
                double[] own = Local(nodes[k]);
                world[k] = nodes[k].Parent < 0 ? own : Product(world[nodes[k].Parent], own);
            }
            return world;
        }

        private static RigNode Parts(RigNode node, double[] m)
        {
            double[] own = Axes(m);
            double[][] columns = { own.Take(3).ToArray(), own.Skip(3).Take(3).ToArray(), own.Skip(6).ToArray() };
            double[][] straight = { new double[] { 1, 0, 0 }, new double[] { 0, 1, 0 }, new double[] { 0, 0, 1 } };
            return new RigNode
            {
                Name = node.Name,
                Parent = node.Parent,
                Position = new[] { m[12], m[13], m[14] },
                Rotation = Quaternions.Between(straight, columns),
                Scale = new[] { 0, 4, 8 }.Select(at => Length(m, at)).ToArray(),
            };
        }

        /// <summary>The three axes, of unit length, one after the other.</summary>
        private static double[] Axes(double[] m)
        {
            return new[] { 0, 4, 8 }.SelectMany(at => new[] { 0, 1, 2 }.Select(n => m[at + n] / Length(m, at))).ToArray();
        }

        private static double Length(double[] m, int at)
        {
            return Math.Sqrt(m[at] * m[at] + m[at + 1] * m[at + 1] + m[at + 2] * m[at + 2]);
        }

        private static double[] Identity()
        {
            return new double[] { 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1 };
        }

        private static double Determinant(double[] m)
        {
            return m[0] * (m[5] * m[10] - m[6] * m[9]) - m[4] * (m[1] * m[10] - m[2] * m[9])
                + m[8] * (m[1] * m[6] - m[2] * m[5]);
        }

        /// <summary>The inverse of a matrix whose last row is 0 0 0 1; NaN if there is none.</summary>
        private static double[] Inverse(double[] m)
        {
            double size = Determinant(m), d = Math.Abs(size) < 1e-12 ? double.NaN : 1 / size;
            var inverse = new[]
            {
                d * (m[5] * m[10] - m[6] * m[9]), d * (m[2] * m[9] - m[1] * m[10]), d * (m[1] * m[6] - m[2] * m[5]), 0,
                d * (m[6] * m[8] - m[4] * m[10]), d * (m[0] * m[10] - m[2] * m[8]), d * (m[2] * m[4] - m[0] * m[6]), 0,
                d * (m[4] * m[9] - m[5] * m[8]), d * (m[1] * m[8] - m[0] * m[9]), d * (m[0] * m[5] - m[1] * m[4]), 0,
                0, 0, 0, 1,
            };
            for (int n = 0; n < 3; n++)
            {
                inverse[12 + n] = -(inverse[n] * m[12] + inverse[4 + n] * m[13] + inverse[8 + n] * m[14]);
            }
            return inverse;
        }
    }
}
