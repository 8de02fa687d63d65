using System;
using System.Collections.Generic;
using System.Linq;
using System.Text;
using Newtonsoft.Json.Linq;

namespace Wayfarer.Tests
{
    /// <summary>A made-up stream: people who walk, as a server would send them.</summary>
    internal static class Crowd
    {
        private const long Start = 1000000000000000;
        private static readonly JToken Walk = Golden.Document("retarget.json")["walk"]["unity"];
        private static readonly float[][] Frames = Walk["hips"]
            .Select((hips, k) => Golden.Floats(hips, Walk["rotations"][k])).ToArray();

        public static double[] RestOffsets => Golden.Doubles(Walk["rest_offsets"]);

        /// <summary>The first message, sent along with batch <paramref name="seq"/>: 22 bones in F32_LE at 40 fps.</summary>
        public static byte[] Header(int seq = 0)
        {
            byte[] fields = Join(
                Number(3, 40), Block(4, Number(1, 2)), Number(6, 1), Number(7, 40),
                Packed(8, Enumerable.Range(0, 22).Select(k => (long)k)), Number(9, 364));
            return Join(Number(1, Start + 200000L * seq), Block(2, fields));
        }

        /// <summary>Batch <paramref name="seq"/> of `count` agents: 8 frames of each. The first introduces them.</summary>
        public static byte[] Batch(int count, int seq)
        {
            long at = Start + 200000L * seq;
            long[] aliases = Enumerable.Range(1, count).Select(k => (long)k).ToArray();
            byte[] poses = Join(aliases.SelectMany(alias => Enumerable.Range(0, 8).Select(f =>
            {
                var frame = (float[])Frames[(seq + f + alias) % Frames.Length].Clone();
                frame[0] += alias;
                return Floats(frame);
            })).ToArray());
            Func<long, IEnumerable<long>> all = value => aliases.Select(_ => value);
            byte[] chunks = Join(
                Packed(1, aliases), Packed(2, all(seq)), Packed(3, all(8 * seq)), Packed(4, all(at)), Packed(5, all(1)),
                Packed(6, all(2)), Packed(7, all(0)), Packed(10, all(0)), Packed(11, all(1)), Block(8, poses),
                Block(9, Join(aliases.Select(_ => new byte[] { 1, 1, 1, 3, 2, 2, 2, 3 }).ToArray())));
            float[] offsets = RestOffsets.Select(value => (float)value).ToArray();
            byte[] added = seq > 0 ? new byte[0] : Join(aliases.Select(alias => Block(1, Join(
                Block(1, Encoding.UTF8.GetBytes("agent-" + alias)), Number(2, alias), Block(15, Floats(offsets))))).ToArray());
            byte[] token = Encoding.UTF8.GetBytes("epoch." + seq);
            return Join(Number(1, at), Block(3, Join(added, Block(2, chunks), Block(4, token))));
        }

        private static byte[] Varint(long value)
        {
            var bytes = new List<byte>();
            for (; value > 127; value >>= 7)
            {
                bytes.Add((byte)(value & 127 | 128));
            }
            bytes.Add((byte)value);
            return bytes.ToArray();
        }

        private static byte[] Number(int field, long value)
        {
            return Join(Varint(8 * field), Varint(value));
        }

        private static byte[] Block(int field, byte[] bytes)
        {
            return Join(Varint(8 * field + 2), Varint(bytes.Length), bytes);
        }

        private static byte[] Packed(int field, IEnumerable<long> values)
        {
            return Block(field, Join(values.Select(Varint).ToArray()));
        }

        private static byte[] Floats(float[] values)
        {
            var bytes = new byte[4 * values.Length];
            Buffer.BlockCopy(values, 0, bytes, 0, bytes.Length);
            return bytes;
        }

        private static byte[] Join(params byte[][] parts)
        {
            var joined = new byte[parts.Sum(part => part.Length)];
            int at = 0;
            foreach (byte[] part in parts)
            {
                Buffer.BlockCopy(part, 0, joined, at, part.Length);
                at += part.Length;
            }
            return joined;
        }
    }
}
