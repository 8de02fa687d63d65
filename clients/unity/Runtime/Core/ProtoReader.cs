using System;
using System.Collections.Generic;
using System.IO;
using System.Text;

namespace Wayfarer
{
    /// <summary>Numbers of a repeated field; it keeps its memory when it is emptied.</summary>
    internal sealed class Column
    {
        public long[] Values = new long[16];
        public int Length;
        private readonly long most;

        public Column(long most = int.MaxValue)
        {
            this.most = most;
        }

        public void Push(ulong value)
        {
            if (value > (ulong)most)
            {
                throw new InvalidDataException("malformed message: a number above 2^31");
            }
            if (Length == Values.Length)
            {
                Array.Resize(ref Values, 2 * Length);
            }
            Values[Length++] = (long)value;
        }
    }

    /// <summary>
    /// A reader for protobuf messages, as much as the motion stream needs
    /// (https://protobuf.dev/programming-guides/encoding/). It returns places in <see cref="Bytes"/>, which belong to
    /// the caller.
    /// </summary>
    internal sealed class ProtoReader
    {
        private static readonly byte[] Nothing = new byte[0];
        private int end;
        private int wireType;

        public byte[] Bytes { get; private set; } = Nothing;

        public int At { get; private set; }

        /// <summary>Begin with a message: the first <paramref name="length"/> of the bytes.</summary>
        public void Load(byte[] message, int length)
        {
            Bytes = message;
            At = 0;
            end = length;
        }

        /// <summary>Move to the next field; its number, or 0 at the end of the message.</summary>
        public int Next()
        {
            if (At >= end)
            {
                return 0;
            }
            ulong tag = Raw();
            wireType = (int)(tag & 7);
            if (tag >> 3 == 0 || tag >> 3 > int.MaxValue)
            {
                throw new InvalidDataException("malformed message: field number " + (tag >> 3));
            }
            return (int)(tag >> 3);
        }

        /// <summary>Go into an embedded message; give what this returns to <see cref="Leave"/> at its end.</summary>
        public int Enter()
        {
            int outer = end;
            int length = Block();
            end = At;
            At -= length;
            return outer;
        }

        public void Leave(int outer)
        {
            At = end;
            end = outer;
        }

        public ulong Varint()
        {
            Expect(0);
            return Raw();
        }

        /// <summary>A whole number up to 2^31; a greater one is an error.</summary>
        public int Small()
        {
            ulong value = Varint();
            if (value > int.MaxValue)
            {
                throw new InvalidDataException("malformed message: a number above 2^31");
            }
            return (int)value;
        }

        /// <summary>int32: negative ones come as 10 bytes, two's complement of 64 bits.</summary>
        public int Int32()
        {
            return unchecked((int)Varint());
        }

        public double Double()
        {
            Expect(1);
            return BitConverter.ToDouble(Bytes, Fixed(8));
        }

        /// <summary>Skip a field of bytes; returns their number. They end where the reader is.</summary>
        public int Block()
        {
            Expect(2);
            ulong length = Raw();
            if (length > (ulong)(end - At))
            {
                throw new InvalidDataException("malformed message: a field passes its end");
            }
            At += (int)length;
            return (int)length;
        }

        public string String()
        {
            int length = Block();
            return Encoding.UTF8.GetString(Bytes, At - length, length);
        }

        /// <summary>Read a repeated field of floats (size 4) or doubles (8), packed or one at a time.</summary>
        public void Floats(int size, List<double> into)
        {
            if (wireType != 2)
            {
                Expect(size == 8 ? 1 : 5);
                into.Add(Float(size, Fixed(size)));
                return;
            }
            int length = Block();
            if (length % size != 0)
            {
                throw new InvalidDataException("malformed message: broken packed field");
            }
            for (int at = At - length; at < At; at += size)
            {
                into.Add(Float(size, at));
            }
        }

        /// <summary>Append a repeated varint field, packed or one at a time.</summary>
        public void Varints(Column into)
        {
            if (wireType != 2)
            {
                into.Push(Varint());
                return;
            }
            int outer = Enter();
            while (At < end)
            {
                into.Push(Raw());
            }
            Leave(outer);
        }

        /// <summary>Skip the value of a field that is not needed.</summary>
        public void Skip()
        {
            switch (wireType)
            {
                case 0: Raw(); break;
                case 1: Fixed(8); break;
                case 2: Block(); break;
                case 5: Fixed(4); break;
                default: throw new InvalidDataException("malformed message: wire type " + wireType);
            }
        }

        private double Float(int size, int at)
        {
            return size == 8 ? BitConverter.ToDouble(Bytes, at) : BitConverter.ToSingle(Bytes, at);
        }

        private void Expect(int wanted)
        {
            if (wireType != wanted)
            {
                throw new InvalidDataException("malformed message: wire type " + wireType + " in place of " + wanted);
            }
        }

        private ulong Raw()
        {
            ulong value = 0;
            for (int count = 0; count < 10; count++)
            {
                if (At >= end)
                {
                    throw new InvalidDataException("malformed message: it ends in a number");
                }
                byte read = Bytes[At++];
                value |= (ulong)(read & 0x7f) << (7 * count);
                if (read < 0x80)
                {
                    return value;
                }
            }
            throw new InvalidDataException("malformed message: a number has more than 10 bytes");
        }

        /// <summary>Move past a number of bytes; returns where they begin.</summary>
        private int Fixed(int size)
        {
            int start = At;
            if (size > end - start)
            {
                throw new InvalidDataException("malformed message: a field passes its end");
            }
            At += size;
            return start;
        }
    }
}
