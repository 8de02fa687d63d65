using System;
using System.Collections.Generic;
using System.IO;

namespace Wayfarer
{
    /// <summary>
    /// Unpacks the frames of each tier of a stream into poses with the bones of the first (clients/README.md, "Far
    /// people"). Allocates nothing once the longest chunk has come.
    /// </summary>
    public sealed class TierUnpacker
    {
        private const int BodyBones = 22;
        private const int CyclePoses = 16;
        private const int MaxBones = 1024;
        private const double TurnUnit = Math.PI / 32768;

        private readonly int[] bones;
        private readonly Packing[] tiers;
        private readonly double[] stand;
        private readonly double[] cycle;
        private readonly double[] up;
        private readonly double[] mixed = new double[4];
        private float[] scratch = new float[0];

        /// <exception cref="InvalidDataException">The header cannot be read.</exception>
        public TierUnpacker(string basisName, IReadOnlyList<int> bones, IReadOnlyList<Tier> tiers)
        {
            Basis basis = Known(basisName);
            up = basis.UpAxis;
            stand = Turned(GaitTable.Stand, basis);
            cycle = Turned(GaitTable.Cycle, basis);
            this.bones = new int[bones.Count];
            for (int k = 0; k < bones.Count; k++)
            {
                this.bones[k] = bones[k];
            }
            this.tiers = new Packing[tiers.Count];
            for (int k = 0; k < tiers.Count; k++)
            {
                this.tiers[k] = new Packing(tiers[k], this.bones);
            }
        }

        /// <summary>Numbers of a frame: hips x, y, z, then x, y, z, w per bone.</summary>
        public int Width => 3 + 4 * bones.Length;

        /// <summary>
        /// Read <paramref name="count"/> frames of a tier that begin at byte <paramref name="start"/>.
        /// </summary>
        public void Unpack(byte[] bytes, int start, int count, int tier, float[] into)
        {
            Packing packing = tiers[tier];
            if (packing.Encoding == PoseEncoding.Root)
            {
                for (int frame = 0; frame < count; frame++)
                {
                    ReadRoot(bytes, start + 16 * frame, into, Width * frame);
                }
                return;
            }
            if (packing.IsWhole)
            {
                Poses.Unpack(bytes, start, count, packing.Encoding, packing.Bones, into);
                return;
            }
            int own = 3 + 4 * packing.Bones;
            if (scratch.Length < own * count)
            {
                scratch = new float[own * count];
            }
            Poses.Unpack(bytes, start, count, packing.Encoding, packing.Bones, scratch);
            for (int frame = 0; frame < count; frame++)
            {
                int from = own * frame, to = Width * frame;
                Array.Copy(scratch, from, into, to, 3);
                for (int k = 0; k < bones.Length; k++)
                {
                    int at = to + 3 + 4 * k, slot = packing.Slots[k];
                    if (slot < 0)
                    {
                        Stand(bones[k], into, at);
                    }
                    else
                    {
                        Array.Copy(scratch, from + 3 + 4 * slot, into, at, 4);
                    }
                }
            }
        }

        private void Stand(int bone, float[] into, int at)
        {
            for (int n = 0; n < 4; n++)
            {
                into[at + n] = bone < BodyBones ? (float)stand[4 * bone + n] : n == 3 ? 1 : 0;
            }
        }

        private void ReadRoot(byte[] bytes, int from, float[] into, int to)
        {
            for (int k = 0; k < 3; k++)
            {
                into[to + k] = BitConverter.ToSingle(bytes, from + 4 * k);
            }
            double half = BitConverter.ToInt16(bytes, from + 12) * TurnUnit / 2;
            double phase = bytes[from + 14] / 256.0 * CyclePoses;
            double share = Math.Min(1, bytes[from + 15] / 128.0 / GaitTable.Swing);
            int pose = (int)phase;
            for (int k = 0; k < bones.Length; k++)
            {
                int bone = bones[k], at = to + 3 + 4 * k;
                if (bone >= BodyBones)
                {
                    Stand(bone, into, at);
                    continue;
                }
                int before = 4 * (BodyBones * pose + bone), after = 4 * (BodyBones * ((pose + 1) % CyclePoses) + bone);
                Mix(cycle, before, cycle, after, phase - pose, mixed);
                Mix(stand, 4 * bone, mixed, 0, share, mixed);
                if (bone == 0)
                {
                    Turn(half);
                }
                for (int n = 0; n < 4; n++)
                {
                    into[at + n] = (float)mixed[n];
                }
            }
        }

        /// <summary>Turn the mixed rotation about up in the world.</summary>
        private void Turn(double half)
        {
            double sine = Math.Sin(half), aw = Math.Cos(half);
            double ax = sine * up[0], ay = sine * up[1], az = sine * up[2];
            double bx = mixed[0], by = mixed[1], bz = mixed[2], bw = mixed[3];
            mixed[0] = aw * bx + ax * bw + ay * bz - az * by;
            mixed[1] = aw * by - ax * bz + ay * bw + az * bx;
            mixed[2] = aw * bz + ax * by - ay * bx + az * bw;
            mixed[3] = aw * bw - ax * bx - ay * by - az * bz;
        }

        /// <summary>Interpolates two rotations linearly along the shorter arc, normalised.</summary>
        private static void Mix(double[] p, int i, double[] q, int j, double share, double[] into)
        {
            double cosine = p[i] * q[j] + p[i + 1] * q[j + 1] + p[i + 2] * q[j + 2] + p[i + 3] * q[j + 3];
            double from = 1 - share, to = cosine < 0 ? -share : share;
            double x = from * p[i] + to * q[j], y = from * p[i + 1] + to * q[j + 1];
            double z = from * p[i + 2] + to * q[j + 2], w = from * p[i + 3] + to * q[j + 3];
            double length = Math.Sqrt(x * x + y * y + z * z + w * w);
            into[0] = x / length;
            into[1] = y / length;
            into[2] = z / length;
            into[3] = w / length;
        }

        private static double[] Turned(float[] table, Basis basis)
        {
            var found = new double[table.Length];
            for (int k = 0; k < table.Length; k += 4)
            {
                for (int n = 0; n < 3; n++)
                {
                    found[k + n] = basis.Handed * (table[k] * basis.LeftAxis[n] + table[k + 1] * basis.UpAxis[n]
                        + table[k + 2] * basis.ForwardAxis[n]);
                }
                found[k + 3] = table[k + 3];
            }
            return found;
        }

        private static Basis Known(string name)
        {
            foreach (Basis basis in Basis.All)
            {
                if (basis.Name == name)
                {
                    return basis;
                }
            }
            return Basis.Gltf;
        }

        /// <summary>How a tier's frames lie in those of the first.</summary>
        private sealed class Packing
        {
            public readonly PoseEncoding Encoding;
            public readonly int Bones;
            public readonly bool IsWhole;
            public readonly int[] Slots; // of each bone in a frame of the tier; -1: not there

            public Packing(Tier tier, int[] bones)
            {
                Poses.FrameBytes(tier.Encoding, tier.Bones.Count); // an unknown encoding throws at once
                if (tier.Bones.Count > MaxBones)
                {
                    throw new InvalidDataException(tier.Bones.Count + " bones are too many");
                }
                Encoding = tier.Encoding;
                Bones = tier.Bones.Count;
                Slots = new int[bones.Length];
                IsWhole = Bones == bones.Length;
                for (int k = 0; k < bones.Length; k++)
                {
                    Slots[k] = -1;
                    for (int n = 0; n < Bones; n++)
                    {
                        Slots[k] = tier.Bones[n] == bones[k] ? n : Slots[k];
                    }
                    IsWhole &= Slots[k] == k;
                }
            }
        }
    }
}
