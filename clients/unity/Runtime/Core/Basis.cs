using System;
using System.Collections.Generic;

namespace Wayfarer
{
    /// <summary>
    /// A basis that a session may choose (docs/wire-format.md): unit vectors of a body at heading 0.
    /// </summary>
    public sealed class Basis
    {
        public static readonly Basis Gltf = new Basis("gltf", "+x", "+y", "+z");
        public static readonly Basis Unity = new Basis("unity", "-x", "+y", "+z");
        public static readonly Basis Unreal = new Basis("unreal", "-y", "+z", "+x");
        public static readonly Basis UnrealMannequin = new Basis("unreal_mannequin", "+x", "+z", "+y");
        public static readonly Basis Blender = new Basis("blender", "+x", "+z", "-y");
        public static readonly Basis Ros = new Basis("ros", "+y", "+z", "+x");

        public static readonly IReadOnlyList<Basis> All = new[] { Gltf, Unity, Unreal, UnrealMannequin, Blender, Ros };

        /// <summary>Its name, as in the API.</summary>
        public readonly string Name;

        /// <summary>1 when the axes are right-handed, -1 when left-handed.</summary>
        public readonly double Handed;

        internal readonly double[] LeftAxis;
        internal readonly double[] UpAxis;
        internal readonly double[] ForwardAxis;

        private Basis(string name, string left, string up, string forward)
        {
            Name = name;
            LeftAxis = Axis(left);
            UpAxis = Axis(up);
            ForwardAxis = Axis(forward);
            Handed = Vectors.Dot(Vectors.Cross(LeftAxis, UpAxis), ForwardAxis);
        }

        public IReadOnlyList<double> Left => LeftAxis;

        public IReadOnlyList<double> Up => UpAxis;

        public IReadOnlyList<double> Forward => ForwardAxis;

        /// <summary>The basis with a name of the API.</summary>
        /// <exception cref="ArgumentException">The name is unknown.</exception>
        public static Basis Of(string name)
        {
            foreach (Basis basis in All)
            {
                if (basis.Name == name)
                {
                    return basis;
                }
            }
            throw new ArgumentException("\"" + name + "\" is no basis that this client knows");
        }

        /// <summary>The angle about <see cref="Up"/> by which a rotation turns <see cref="Forward"/>, radians.</summary>
        public double HeadingOf(double x, double y, double z, double w)
        {
            double a = ForwardAxis[0], b = ForwardAxis[1], c = ForwardAxis[2];
            double tx = 2 * (y * c - z * b), ty = 2 * (z * a - x * c), tz = 2 * (x * b - y * a);
            double vx = a + w * tx + y * tz - z * ty;
            double vy = b + w * ty + z * tx - x * tz;
            double vz = c + w * tz + x * ty - y * tx;
            double[] up = UpAxis; // cross(up, forward), the same algebra in every basis
            double sx = up[1] * c - up[2] * b, sy = up[2] * a - up[0] * c, sz = up[0] * b - up[1] * a;
            return Math.Atan2(vx * sx + vy * sy + vz * sz, vx * a + vy * b + vz * c);
        }

        private static double[] Axis(string axis)
        {
            var unit = new double[3];
            unit["xyz".IndexOf(axis[1])] = axis[0] == '-' ? -1 : 1;
            return unit;
        }
    }
}
