using System;

namespace Wayfarer
{
    /// <summary>Vectors of three numbers, for code that runs once per character: each result is a new array.</summary>
    internal static class Vectors
    {
        public static double Dot(double[] a, double[] b)
        {
            return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        }

        public static double[] Cross(double[] a, double[] b)
        {
            return new[] { a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0] };
        }

        public static double[] Plus(double[] a, double[] b)
        {
            return new[] { a[0] + b[0], a[1] + b[1], a[2] + b[2] };
        }

        public static double[] Minus(double[] a, double[] b)
        {
            return new[] { a[0] - b[0], a[1] - b[1], a[2] - b[2] };
        }

        public static double[] Times(double factor, double[] a)
        {
            return new[] { factor * a[0], factor * a[1], factor * a[2] };
        }

        public static double Length(double[] a)
        {
            return Math.Sqrt(Dot(a, a));
        }

        /// <summary>A vector without its part along a unit vector.</summary>
        public static double[] Without(double[] a, double[] unit)
        {
            return Minus(a, Times(Dot(a, unit), unit));
        }
    }
}
