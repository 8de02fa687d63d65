using System;

namespace Wayfarer
{
    /// <summary>
    /// Rotations as unit quaternions x, y, z, w in flat arrays: (array, index of x). Left-handed bases have the same
    /// algebra. The output may be one of the inputs. Only <see cref="Between"/> allocates.
    /// </summary>
    public static class Quaternions
    {
        /// <summary>o = the rotation q, then p.</summary>
        public static void Multiply(double[] p, int i, double[] q, int j, double[] o, int k)
        {
            Product(p[i], p[i + 1], p[i + 2], p[i + 3], q, j, o, k);
        }

        /// <summary>o = the inverse of p, after q: what q is relative to p.</summary>
        public static void Relative(double[] p, int i, double[] q, int j, double[] o, int k)
        {
            Product(-p[i], -p[i + 1], -p[i + 2], p[i + 3], q, j, o, k);
        }

        /// <summary>o = the vector v, turned by q.</summary>
        public static void Rotate(double[] q, int i, double[] v, int j, double[] o, int k)
        {
            Turn(q[i], q[i + 1], q[i + 2], q[i + 3], v, j, o, k);
        }

        /// <summary>o = the vector v, turned back by q.</summary>
        public static void RotateBack(double[] q, int i, double[] v, int j, double[] o, int k)
        {
            Turn(-q[i], -q[i + 1], -q[i + 2], q[i + 3], v, j, o, k);
        }

        /// <summary>o = the least rotation that turns the direction of a into that of b.</summary>
        public static void Arc(double[] a, int i, double[] b, int j, double[] o, int k)
        {
            double n = Math.Sqrt((a[i] * a[i] + a[i + 1] * a[i + 1] + a[i + 2] * a[i + 2])
                * (b[j] * b[j] + b[j + 1] * b[j + 1] + b[j + 2] * b[j + 2]));
            double w = 1 + (a[i] * b[j] + a[i + 1] * b[j + 1] + a[i + 2] * b[j + 2]) / n;
            double x, y, z;
            if (w < 1e-9) // opposite: about any axis across
            {
                double ax = Math.Abs(a[i]), ay = Math.Abs(a[i + 1]), az = Math.Abs(a[i + 2]);
                if (ax <= ay && ax <= az)
                {
                    x = 0;
                    y = a[i + 2];
                    z = -a[i + 1];
                }
                else if (ay <= az)
                {
                    x = -a[i + 2];
                    y = 0;
                    z = a[i];
                }
                else
                {
                    x = a[i + 1];
                    y = -a[i];
                    z = 0;
                }
                w = 0;
            }
            else
            {
                x = (a[i + 1] * b[j + 2] - a[i + 2] * b[j + 1]) / n;
                y = (a[i + 2] * b[j] - a[i] * b[j + 2]) / n;
                z = (a[i] * b[j + 1] - a[i + 1] * b[j]) / n;
            }
            double length = Math.Sqrt(x * x + y * y + z * z + w * w);
            o[k] = x / length;
            o[k + 1] = y / length;
            o[k + 2] = z / length;
            o[k + 3] = w / length;
        }

        /// <summary>
        /// The rotation that turns the axes <paramref name="from"/> into <paramref name="to"/>, each three unit vectors of
        /// one handedness.
        /// </summary>
        internal static double[] Between(double[][] from, double[][] to)
        {
            // m[row][column] = sum over axes of to · fromᵀ, then Shepperd's method
            var m = new double[3, 3];
            for (int r = 0; r < 3; r++)
            {
                for (int c = 0; c < 3; c++)
                {
                    m[r, c] = to[0][r] * from[0][c] + to[1][r] * from[1][c] + to[2][r] * from[2][c];
                }
            }
            double trace = m[0, 0] + m[1, 1] + m[2, 2];
            int most = m[1, 1] > m[0, 0] ? 1 : 0;
            most = m[2, 2] > m[most, most] ? 2 : most;
            var q = new double[4];
            if (trace > m[most, most])
            {
                q[0] = m[2, 1] - m[1, 2];
                q[1] = m[0, 2] - m[2, 0];
                q[2] = m[1, 0] - m[0, 1];
                q[3] = 1 + trace;
            }
            else
            {
                int i = most, j = (most + 1) % 3, n = (most + 2) % 3;
                q[i] = 1 + m[i, i] - m[j, j] - m[n, n];
                q[j] = m[j, i] + m[i, j];
                q[n] = m[n, i] + m[i, n];
                q[3] = m[n, j] - m[j, n];
            }
            double length = Math.Sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
            for (int k = 0; k < 4; k++)
            {
                q[k] /= length;
            }
            return q;
        }

        private static void Product(double ax, double ay, double az, double aw, double[] q, int j, double[] o, int k)
        {
            double bx = q[j], by = q[j + 1], bz = q[j + 2], bw = q[j + 3];
            o[k] = aw * bx + ax * bw + ay * bz - az * by;
            o[k + 1] = aw * by - ax * bz + ay * bw + az * bx;
            o[k + 2] = aw * bz + ax * by - ay * bx + az * bw;
            o[k + 3] = aw * bw - ax * bx - ay * by - az * bz;
        }

        private static void Turn(double x, double y, double z, double w, double[] v, int j, double[] o, int k)
        {
            double a = v[j], b = v[j + 1], c = v[j + 2];
            double tx = 2 * (y * c - z * b), ty = 2 * (z * a - x * c), tz = 2 * (x * b - y * a);
            o[k] = a + w * tx + y * tz - z * ty;
            o[k + 1] = b + w * ty + z * tx - x * tz;
            o[k + 2] = c + w * tz + x * ty - y * tx;
        }
    }
}
