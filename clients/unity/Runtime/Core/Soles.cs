using System;
using System.Collections.Generic;
using System.Linq;

namespace Wayfarer
{
    /// <summary>Soles of a character, from its mesh at rest: clients/README.md, "Retargeting", 5.</summary>
    public sealed class Soles
    {
        private const int Round = 8; // number of directions around the vertical, for each
        private static readonly double[] Steep = { 45, 75 }; // directions to outermost points, degrees off straight down

        private Soles(double floor, double[][] fixedPoints, double[][] toes)
        {
            Floor = floor;
            Fixed = fixedPoints;
            Toes = toes;
        }

        /// <summary>Height of the lowest point of the mesh that may touch the ground, in the basis.</summary>
        public double Floor { get; }

        /// <summary>For each foot, x, y, z of the points that the ankle moves, from the ankle's joint.</summary>
        internal double[][] Fixed { get; }

        /// <summary>For each foot, x, y, z of the points that the toes move, from the toes' joint.</summary>
        internal double[][] Toes { get; }

        /// <summary>Measures the soles. Null: a foot has no vertices, or they end above its ankle.</summary>
        /// <param name="map">The character's map.</param>
        /// <param name="places">Vertices of its mesh, x, y, z each, in its own space at rest.</param>
        /// <param name="nodes">The node of the rig that moves each vertex most.</param>
        /// <param name="basis">The basis of the character's space.</param>
        public static Soles Measure(BoneMap map, IReadOnlyList<double> places, IReadOnlyList<int> nodes, Basis basis)
        {
            Rig rig = map.Rig;
            double[] turn = new CharacterJoints(map, basis).Turn;
            var numbers = new Dictionary<int, int>();
            for (int b = 0; b < Bones.Count; b++)
            {
                if (map.Node(Bones.Names[b]) >= 0)
                {
                    numbers[map.Node(Bones.Names[b])] = b;
                }
            }
            int[] owner = Enumerable.Range(0, rig.Count).Select(k =>
                new[] { k }.Concat(rig.Ancestors(k)).Where(numbers.ContainsKey).Select(n => numbers[n]).DefaultIfEmpty(-1).First()).ToArray();
            double[][] directions = Directions(basis);
            double floor = double.PositiveInfinity;
            var parts = new[] { new double[2][], new double[2][] };
            for (int leg = 0; leg < 2; leg++)
            {
                for (int part = 0; part < 2; part++)
                {
                    int bone = RetargetRest.Legs[leg][2 + part], node = map.Node(Bones.Names[bone]);
                    var found = new double[directions.Length][];
                    var best = new double[directions.Length];
                    for (int k = 0; node >= 0 && k < nodes.Count; k++)
                    {
                        if (owner[nodes[k]] != bone)
                        {
                            continue;
                        }
                        double[] v = Turned(turn, new[] { places[3 * k], places[3 * k + 1], places[3 * k + 2] });
                        floor = Math.Min(floor, Vectors.Dot(v, basis.UpAxis));
                        for (int d = 0; d < directions.Length; d++)
                        {
                            double far = Vectors.Dot(v, directions[d]);
                            if (found[d] == null || far > best[d])
                            {
                                best[d] = far;
                                found[d] = v;
                            }
                        }
                    }
                    double[] joint = node < 0 ? null : Turned(turn, rig.Place(node));
                    parts[part][leg] = found.Where(v => v != null).Distinct().SelectMany(v => Vectors.Minus(v, joint)).ToArray();
                }
                int ankle = map.Node(Bones.Names[RetargetRest.Legs[leg][2]]);
                bool none = parts[0][leg].Length + parts[1][leg].Length == 0;
                if (none || floor >= Vectors.Dot(Turned(turn, rig.Place(ankle)), basis.UpAxis))
                {
                    return null;
                }
            }
            return new Soles(floor, parts[0], parts[1]);
        }

        /// <summary>Directions down, and obliquely down all around.</summary>
        private static double[][] Directions(Basis basis)
        {
            var found = new List<double[]> { Vectors.Times(-1, basis.UpAxis) };
            foreach (double degrees in Steep)
            {
                double steep = degrees * Math.PI / 180;
                for (int k = 0; k < Round; k++)
                {
                    double angle = 2 * Math.PI * k / Round;
                    double[] beside = Vectors.Plus(
                        Vectors.Times(Math.Cos(angle), basis.ForwardAxis), Vectors.Times(Math.Sin(angle), basis.LeftAxis));
                    found.Add(Vectors.Minus(Vectors.Times(Math.Sin(steep), beside), Vectors.Times(Math.Cos(steep), basis.UpAxis)));
                }
            }
            return found.ToArray();
        }

        private static double[] Turned(double[] q, double[] v)
        {
            var turned = new double[3];
            Quaternions.Rotate(q, 0, v, 0, turned, 0);
            return turned;
        }
    }
}
