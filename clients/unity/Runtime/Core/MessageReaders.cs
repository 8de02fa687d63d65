using System.Collections.Generic;
using System.Linq;

namespace Wayfarer
{
    /// <summary>Readers of rare messages: they allocate their results.</summary>
    internal static class MessageReaders
    {
        private static readonly string[] BasisNames =
        {
            "gltf", "gltf", "unity", "unreal", "unreal_mannequin", "blender", "ros",
        };

        public static Header ReadHeader(ProtoReader reader)
        {
            var header = new Header();
            var bones = new Column();
            int outer = reader.Enter();
            for (int field = reader.Next(); field != 0; field = reader.Next())
            {
                switch (field)
                {
                    case 1: header.ServerVersion = reader.String(); break;
                    case 2: header.SessionId = reader.String(); break;
                    case 3: header.Fps = reader.Small(); break;
                    case 4: ReadBasis(reader, header); break;
                    case 5: ReadSkeleton(reader, header.Bones_); break;
                    case 6: header.Encoding = (PoseEncoding)reader.Small(); break;
                    case 7: header.SentFps = reader.Small(); break;
                    case 8: reader.Varints(bones); break;
                    case 9: header.FrameBytes = reader.Small(); break;
                    case 11: header.Resumed = reader.Varint() != 0; break;
                    case 12: header.Tiers_.Add(ReadTier(reader)); break;
                    default: reader.Skip(); break;
                }
            }
            reader.Leave(outer);
            header.Bones = Numbers(bones);
            if (header.Tiers_.Count == 0)
            {
                header.Tiers_.Add(new Tier
                {
                    Encoding = header.Encoding,
                    SentFps = header.SentFps,
                    Bones = header.Bones,
                    FrameBytes = header.FrameBytes,
                });
            }
            if (header.Encoding == PoseEncoding.Root)
            {
                header.Bones = Enumerable.Range(0, 22).ToArray(); // drawn with the bones of a body
            }
            return header;
        }

        private static Tier ReadTier(ProtoReader reader)
        {
            var tier = new Tier { Radius = 0 };
            var bones = new Column();
            int outer = reader.Enter();
            for (int field = reader.Next(); field != 0; field = reader.Next())
            {
                switch (field)
                {
                    case 1: tier.Radius = reader.Double(); break;
                    case 2: tier.Encoding = (PoseEncoding)reader.Small(); break;
                    case 3: tier.SentFps = reader.Small(); break;
                    case 4: reader.Varints(bones); break;
                    case 5: tier.FrameBytes = reader.Small(); break;
                    default: reader.Skip(); break;
                }
            }
            reader.Leave(outer);
            tier.Bones = Numbers(bones);
            return tier;
        }

        private static int[] Numbers(Column column)
        {
            var numbers = new int[column.Length];
            for (int k = 0; k < numbers.Length; k++)
            {
                numbers[k] = (int)column.Values[k];
            }
            return numbers;
        }

        public static Agent ReadAgent(ProtoReader reader)
        {
            var agent = new Agent();
            var betas = new List<double>();
            var offsets = new List<double>();
            int outer = reader.Enter();
            for (int field = reader.Next(); field != 0; field = reader.Next())
            {
                switch (field)
                {
                    case 1: agent.Id = reader.String(); break;
                    case 2: agent.Alias = reader.Small(); break;
                    case 4: agent.Name = reader.String(); break;
                    case 5: agent.Body = reader.String(); break;
                    case 6: agent.Gender = reader.Varint() == 2 ? "male" : "female"; break;
                    case 7: reader.Floats(8, betas); break;
                    case 8: agent.Seed = reader.Varint(); break;
                    case 15: reader.Floats(4, offsets); break;
                    default: reader.Skip(); break;
                }
            }
            reader.Leave(outer);
            agent.Betas = betas.ToArray();
            agent.RestOffsets = offsets.ToArray();
            return agent;
        }

        public static MotionEvent ReadEvent(ProtoReader reader)
        {
            var found = new MotionEvent();
            int outer = reader.Enter();
            for (int field = reader.Next(); field != 0; field = reader.Next())
            {
                switch (field)
                {
                    case 1:
                        ulong kind = reader.Varint();
                        found.Kind = kind <= (ulong)EventKind.Fault ? (EventKind)kind : EventKind.Unknown;
                        break;
                    case 2: found.AgentId = reader.String(); break;
                    case 3: found.Alias = reader.Small(); break;
                    case 4: found.At = reader.Varint() / 1e6; break;
                    case 5: found.GoalRevision = reader.Small(); break;
                    case 6: found.Waypoint = reader.Small(); break;
                    case 7: found.Detail = reader.String(); break;
                    default: reader.Skip(); break;
                }
            }
            reader.Leave(outer);
            return found;
        }

        private static void ReadBasis(ProtoReader reader, Header header)
        {
            int outer = reader.Enter();
            for (int field = reader.Next(); field != 0; field = reader.Next())
            {
                switch (field)
                {
                    case 1:
                        ulong number = reader.Varint();
                        header.BasisName = number < (ulong)BasisNames.Length ? BasisNames[number] : "unknown";
                        break;
                    case 2: header.MetresPerUnit = reader.Double(); break;
                    default: reader.Skip(); break;
                }
            }
            reader.Leave(outer);
        }

        private static void ReadSkeleton(ProtoReader reader, List<SkeletonBone> skeleton)
        {
            int outer = reader.Enter();
            for (int field = reader.Next(); field != 0; field = reader.Next())
            {
                if (field == 1)
                {
                    skeleton.Add(ReadBone(reader));
                }
                else
                {
                    reader.Skip();
                }
            }
            reader.Leave(outer);
        }

        private static SkeletonBone ReadBone(ProtoReader reader)
        {
            var bone = new SkeletonBone();
            int outer = reader.Enter();
            for (int field = reader.Next(); field != 0; field = reader.Next())
            {
                switch (field)
                {
                    case 1: bone.Name = reader.String(); break;
                    case 2: bone.Parent = reader.Int32(); break;
                    default: reader.Skip(); break;
                }
            }
            reader.Leave(outer);
            return bone;
        }
    }
}
