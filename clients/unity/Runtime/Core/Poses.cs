using System;
using System.IO;

namespace Wayfarer
{
    /// <summary>How the rotations of a frame are packed.</summary>
    public enum PoseEncoding
    {
        F32Le = 1,
        SmallestThree = 3,

        /// <summary>No rotations: hips, heading, phase and swing of the gait.</summary>
        Root = 4,
    }

    /// <summary>Packed frames to numbers; docs/wire-format.md shows each encoding byte by byte.</summary>
    public static class Poses
    {
        private const int Middle = 16383; // the count that stands for 0
        private const double Step = 1 / (Middle * 1.4142135623730951);

        /// <summary>Bytes of a frame.</summary>
        /// <exception cref="InvalidDataException">The encoding is not known.</exception>
        public static int FrameBytes(PoseEncoding encoding, int bones)
        {
            switch (encoding)
            {
                case PoseEncoding.F32Le: return 12 + 16 * bones;
                case PoseEncoding.SmallestThree: return 12 + 6 * bones;
                case PoseEncoding.Root: return 16;
                default:
                    throw new InvalidDataException(
                        "pose encoding " + (int)encoding + " is not known: this client is older than the server");
            }
        }

        /// <summary>
        /// Read <paramref name="count"/> frames that begin at byte <paramref name="start"/> into
        /// <paramref name="into"/>, each hips x, y, z and then x, y, z, w per bone. Allocates nothing.
        /// </summary>
        public static void Unpack(byte[] bytes, int start, int count, PoseEncoding encoding, int bones, float[] into)
        {
            int rotation = (FrameBytes(encoding, bones) - 12) / Math.Max(1, bones);
            int from = start, to = 0;
            for (int frame = 0; frame < count; frame++)
            {
                for (int k = 0; k < 3; k++)
                {
                    into[to + k] = BitConverter.ToSingle(bytes, from + 4 * k);
                }
                from += 12;
                to += 3;
                for (int bone = 0; bone < bones; bone++)
                {
                    switch (encoding)
                    {
                        case PoseEncoding.F32Le: ReadFloats(bytes, from, into, to); break;
                        default: ReadSmallest(bytes, from, into, to); break;
                    }
                    from += rotation;
                    to += 4;
                }
            }
        }

        private static void ReadFloats(byte[] bytes, int at, float[] into, int to)
        {
            for (int k = 0; k < 4; k++)
            {
                into[to + k] = BitConverter.ToSingle(bytes, at + 4 * k);
            }
        }

        private static void ReadSmallest(byte[] bytes, int at, float[] into, int to)
        {
            int first = Word(bytes, at), second = Word(bytes, at + 2);
            int leftOut = (first >> 15) | ((second >> 15) << 1);
            double a = ((first & 0x7fff) - Middle) * Step;
            double b = ((second & 0x7fff) - Middle) * Step;
            double c = ((Word(bytes, at + 4) & 0x7fff) - Middle) * Step;
            double d = Math.Sqrt(Math.Max(0, 1 - a * a - b * b - c * c));
            into[to] = (float)(leftOut == 0 ? d : a);
            into[to + 1] = (float)(leftOut == 1 ? d : leftOut == 0 ? a : b);
            into[to + 2] = (float)(leftOut == 2 ? d : leftOut == 3 ? c : b);
            into[to + 3] = (float)(leftOut == 3 ? d : c);
        }

        private static int Word(byte[] bytes, int at)
        {
            return bytes[at] | (bytes[at + 1] << 8);
        }
    }
}
