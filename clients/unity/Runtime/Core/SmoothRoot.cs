using System;
using System.Collections.Generic;

namespace Wayfarer
{
    /// <summary>
    /// A smooth root for capsules, cameras and root motion, a point on the ground and a heading that do not sway with the
    /// hips: clients/README.md, "Smooth root". Allocates nothing.
    /// </summary>
    public sealed class SmoothRoot
    {
        private const double Smoothing = 0.3; // seconds: time constant of the critically damped filter
        private const double Jump = 2; // metres, or seconds between samples, beyond which it begins again at that place

        private readonly Basis basis;
        private readonly double jump;
        private readonly double[] values = { double.NaN, double.NaN, double.NaN, double.NaN }; // left, forward, up, heading
        private readonly double[] rates = new double[4];
        private readonly double[] point = new double[3];
        private double last = double.NaN;

        public SmoothRoot(Basis basis, double metresPerUnit = 1)
        {
            this.basis = basis;
            jump = Jump / metresPerUnit;
        }

        /// <summary>Point on the ground.</summary>
        public IReadOnlyList<double> Point => point;

        /// <summary>Radians, continuous beyond π. NaN before the first update.</summary>
        public double Heading => values[3];

        /// <summary>
        /// At <paramref name="time"/>: hips' place and rotation of a frame (its first seven numbers), height of the
        /// ground there.
        /// </summary>
        public void Update(double time, float[] frame, double ground)
        {
            double step = double.IsNaN(last) ? 0 : Math.Max(0, time - last);
            last = time;
            double[] left = basis.LeftAxis, forward = basis.ForwardAxis, up = basis.UpAxis;
            double x = frame[0], y = frame[1], z = frame[2];
            double heading = basis.HeadingOf(frame[3], frame[4], frame[5], frame[6]);
            if (!double.IsNaN(values[3]))
            {
                heading += 2 * Math.PI * Math.Floor((values[3] - heading) / (2 * Math.PI) + 0.5);
            }
            Follow(0, x * left[0] + y * left[1] + z * left[2], step);
            Follow(1, x * forward[0] + y * forward[1] + z * forward[2], step);
            Follow(2, ground, step);
            Follow(3, heading, step);
            for (int k = 0; k < 3; k++)
            {
                point[k] = values[0] * left[k] + values[1] * forward[k] + values[2] * up[k];
            }
        }

        private void Follow(int k, double target, double step)
        {
            bool jumped = k < 3 && Math.Abs(target - values[k]) > jump;
            if (double.IsNaN(values[k]) || step > Jump || jumped)
            {
                values[k] = target;
                rates[k] = 0;
            }
            else if (step > 0)
            {
                double theta = Math.Exp(-step / Smoothing);
                double ahead = values[k] + rates[k] * step;
                double off = target - ahead;
                values[k] = ahead + (1 - theta * theta) * off;
                rates[k] += (1 - theta) * (1 - theta) / step * off;
            }
        }
    }
}
