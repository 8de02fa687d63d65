using System;
using System.Collections.Generic;
using System.Linq;

namespace Wayfarer
{
    /// <summary>
    /// Joints of a character at rest, upright in the basis: the server's input to make an agent with its proportions
    /// (<c>POST /v1/bodies:fit</c>).
    /// </summary>
    public sealed class CharacterJoints
    {
        private static readonly double Snap = Math.Cos(25 * Math.PI / 180); // an axis this near to one of the file's is that axis

        private readonly double[][] places = new double[Bones.Count][];

        /// <param name="map">The character's map.</param>
        /// <param name="basis">The basis of its space.</param>
        /// <param name="soles">Its soles, from its mesh, or null.</param>
        public CharacterJoints(BoneMap map, Basis basis, Soles soles = null)
        {
            Turn = Alignment(map, basis);
            for (int b = 0; b < Bones.Count; b++)
            {
                int node = map.Node(Bones.Names[b]);
                if (node >= 0)
                {
                    places[b] = new double[3];
                    Quaternions.Rotate(Turn, 0, map.Rig.Place(node), 0, places[b], 0);
                }
            }
            Lowest = RetargetRest.Legs.SelectMany(leg => leg.Skip(2)).Where(b => places[b] != null)
                .Min(b => Vectors.Dot(places[b], basis.UpAxis));
            int[][] legs = RetargetRest.Legs;
            double[] thighs = Vectors.Times(0.5, Vectors.Plus(places[legs[0][0]], places[legs[1][0]]));
            double above = Vectors.Dot(thighs, basis.UpAxis) - Lowest;
            Floor = soles != null ? soles.Floor : Lowest >= 0 && Lowest <= 0.25 * above ? 0 : double.NaN;
        }

        /// <summary>
        /// Height of its floor: the lowest point of its mesh, or 0 if its feet are close above the origin's level, or NaN.
        /// </summary>
        public double Floor { get; }

        /// <summary>The rotation from the character's axes to the basis.</summary>
        internal double[] Turn { get; }

        /// <summary>Height of the lowest ankle or ball.</summary>
        internal double Lowest { get; }

        /// <summary>Place of a bone's joint, x, y, z; null: the character lacks it.</summary>
        public double[] Place(int bone)
        {
            return places[bone];
        }

        /// <summary>Derives the rotation from its legs.</summary>
        private static double[] Alignment(BoneMap map, Basis basis)
        {
            Func<int, double[]> at = bone => map.Rig.Place(map.Node(Bones.Names[bone]));
            int[][] legs = RetargetRest.Legs;
            double[] ankles = Vectors.Plus(at(legs[0][2]), at(legs[1][2]));
            double[] up = Snapped(Vectors.Minus(Vectors.Plus(at(legs[0][0]), at(legs[1][0])), ankles));
            double[] across = Vectors.Minus(at(legs[0][0]), at(legs[1][0]));
            double[] left = Vectors.Without(Snapped(Vectors.Without(across, up)), up);
            left = Vectors.Times(1 / Vectors.Length(left), left);
            double[] forward = Vectors.Times(basis.Handed, Vectors.Cross(left, up));
            return Quaternions.Between(
                new[] { left, up, forward }, new[] { basis.LeftAxis, basis.UpAxis, basis.ForwardAxis });
        }

        /// <summary>A direction, or the axis of the file that is near to it.</summary>
        private static double[] Snapped(double[] direction)
        {
            double[] unit = Vectors.Times(1 / Vectors.Length(direction), direction);
            int k = 0;
            for (int n = 1; n < 3; n++)
            {
                k = Math.Abs(unit[n]) > Math.Abs(unit[k]) ? n : k;
            }
            if (Math.Abs(unit[k]) < Snap)
            {
                return unit;
            }
            var axis = new double[3];
            axis[k] = Math.Sign(unit[k]);
            return axis;
        }
    }
}
