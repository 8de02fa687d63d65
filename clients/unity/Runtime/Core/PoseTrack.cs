using System;

namespace Wayfarer
{
    /// <summary>
    /// The frames of one agent, and its pose at moments that never go back: clients/README.md, "Playout". Nothing is
    /// allocated after warm-up.
    /// </summary>
    public sealed class PoseTrack
    {
        private const double Blend = 0.2; // seconds to blend from a held pose to the stream again
        private const int Kept = 400; // most frames: a program in the background receives, but does not play

        private readonly float[] heldPose; // to blend from
        private readonly float[] shown;
        private double[] times = new double[32]; // rings
        private byte[] contacts = new byte[32];
        private float[] frames;
        private int first;
        private int count;
        private bool starving;
        private double heldAt = double.NaN; // when the blend began; NaN: there is none

        /// <param name="width">Numbers per frame: hips x, y, z, then x, y, z, w per bone.</param>
        public PoseTrack(int width)
        {
            Width = width;
            frames = new float[32 * width];
            heldPose = new float[width];
            shown = new float[width];
        }

        public int Width { get; }

        /// <summary>How often frames ran out.</summary>
        public int Underruns { get; private set; }

        /// <summary>Bits of the frame at or before the moment shown: 1 left foot, 2 right foot.</summary>
        public int Contacts { get; private set; }

        /// <summary>Whether frames have run out, and the last one is shown.</summary>
        public bool Held { get; private set; }

        /// <summary>Number of frames in the queue.</summary>
        public int Length => count;

        /// <summary>
        /// Add frames that stand one behind the other, the first of which is for <paramref name="time"/>, with a byte of
        /// contacts each, from <paramref name="at"/> on. Known ones are dropped.
        /// </summary>
        public void Push(double time, double fps, float[] poses, int number, byte[] feet, int at = 0)
        {
            double last = count > 0 ? times[Slot(count - 1)] : double.NegativeInfinity;
            for (int k = 0; k < number; k++)
            {
                double when = time + k / fps;
                if (when <= last + 0.25 / fps)
                {
                    continue;
                }
                if (count == Kept)
                {
                    Drop();
                }
                else if (count == times.Length)
                {
                    Grow();
                }
                int slot = Slot(count);
                times[slot] = when;
                contacts[slot] = feet[at + k];
                Array.Copy(poses, Width * k, frames, Width * slot, Width);
                count++;
            }
        }

        /// <summary>Seconds of frames after <paramref name="time"/>; negative when they have run out.</summary>
        public double Buffered(double time)
        {
            return count > 0 ? times[Slot(count - 1)] - time : double.NegativeInfinity;
        }

        /// <summary>Write the pose at a time; false when no frame has come yet.</summary>
        public bool Sample(double time, float[] into)
        {
            if (count == 0)
            {
                return false;
            }
            while (count > 1 && times[Slot(1)] <= time)
            {
                Drop(); // one frame before the time stays, to interpolate from
            }
            Held = count == 1 && time > times[first];
            if (Held)
            {
                Underruns += starving ? 0 : 1;
                starving = true;
            }
            else if (starving && count > 1)
            {
                starving = false;
                Array.Copy(shown, heldPose, Width);
                heldAt = time;
            }
            Between(time, into);
            double share = (time - heldAt) / Blend;
            if (share >= 1)
            {
                heldAt = double.NaN;
            }
            else if (!double.IsNaN(share))
            {
                Mix(heldPose, 0, into, 0, share * share * (3 - 2 * share), into, Width);
            }
            Array.Copy(into, shown, Width);
            Contacts = contacts[first];
            return true;
        }

        /// <summary>
        /// o = between poses a (at i) and b (at j): hips on a line, rotations along the shorter arc. o may be a or b.
        /// </summary>
        public static void Mix(float[] a, int i, float[] b, int j, double share, float[] o, int width)
        {
            for (int k = 0; k < 3; k++)
            {
                o[k] = (float)(a[i + k] + (b[j + k] - a[i + k]) * share);
            }
            for (int k = 3; k < width; k += 4)
            {
                int p = i + k, q = j + k;
                double dot = (double)a[p] * b[q] + (double)a[p + 1] * b[q + 1] + (double)a[p + 2] * b[q + 2]
                    + (double)a[p + 3] * b[q + 3];
                int sign = dot < 0 ? -1 : 1;
                dot *= sign;
                double fromA = 1 - share, fromB = share * sign;
                if (dot < 0.9995)
                {
                    double angle = Math.Acos(dot);
                    double sine = Math.Sin(angle);
                    fromA = Math.Sin((1 - share) * angle) / sine;
                    fromB = Math.Sin(share * angle) / sine * sign;
                }
                double x = a[p] * fromA + b[q] * fromB, y = a[p + 1] * fromA + b[q + 1] * fromB;
                double z = a[p + 2] * fromA + b[q + 2] * fromB, w = a[p + 3] * fromA + b[q + 3] * fromB;
                double length = Math.Sqrt(x * x + y * y + z * z + w * w);
                length = length > 0 ? length : 1;
                o[k] = (float)(x / length);
                o[k + 1] = (float)(y / length);
                o[k + 2] = (float)(z / length);
                o[k + 3] = (float)(w / length);
            }
        }

        private void Between(double time, float[] into)
        {
            double before = times[first];
            if (count == 1 || time <= before)
            {
                Array.Copy(frames, Width * first, into, 0, Width);
                return;
            }
            int next = Slot(1);
            Mix(frames, Width * first, frames, Width * next, (time - before) / (times[next] - before), into, Width);
        }

        private int Slot(int k)
        {
            return (first + k) & (times.Length - 1);
        }

        private void Drop()
        {
            first = Slot(1);
            count--;
        }

        private void Grow()
        {
            int size = times.Length;
            var longerTimes = new double[2 * size];
            var longerContacts = new byte[2 * size];
            var longerFrames = new float[2 * size * Width];
            for (int k = 0; k < count; k++)
            {
                int slot = Slot(k);
                longerTimes[k] = times[slot];
                longerContacts[k] = contacts[slot];
                Array.Copy(frames, Width * slot, longerFrames, Width * k, Width);
            }
            times = longerTimes;
            contacts = longerContacts;
            frames = longerFrames;
            first = 0;
        }
    }
}
