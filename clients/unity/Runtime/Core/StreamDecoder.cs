using System;
using System.Collections.Generic;
using System.IO;
using System.Text;

namespace Wayfarer
{
    /// <summary>
    /// Reads StreamMotionResponse (proto/wayfarer/v1/motion.proto) from bytes, and holds the last message. A batch that
    /// introduces no agent allocates nothing.
    /// </summary>
    public sealed class StreamDecoder
    {
        private readonly ProtoReader reader = new ProtoReader();
        private readonly Column alias = new Column();
        private readonly Column seq = new Column();
        private readonly Column firstFrame = new Column();
        private readonly Column scheduledAt = new Column(long.MaxValue);
        private readonly Column goalRevision = new Column();
        private readonly Column state = new Column();
        private readonly Column flags = new Column();
        private readonly Column waypoint = new Column();
        private readonly Column candidates = new Column();
        private readonly Column[] columns; // columns of MotionChunks with a number for each chunk
        private readonly Column removed = new Column();
        private readonly Column hidden = new Column();
        private readonly List<Agent> added = new List<Agent>();
        private byte[] token = new byte[64];
        private int tokenLength;
        private int poses;
        private int posesLength;
        private int contacts;
        private int contactsLength;

        public StreamDecoder()
        {
            columns = new[]
            {
                alias, seq, firstFrame, scheduledAt, goalRevision, state, flags, waypoint, candidates,
            };
        }

        public MessageKind Kind { get; private set; }

        /// <summary>The server's clock when it sent the message: seconds since 1970.</summary>
        public double SentAt { get; private set; }

        public Header Header { get; private set; }

        public MotionEvent Event { get; private set; }

        /// <summary>Agents seen for the first time.</summary>
        public IReadOnlyList<Agent> Added => added;

        /// <summary>Number of chunks of the batch.</summary>
        public int Chunks => alias.Length;

        /// <summary>Number of deleted agents.</summary>
        public int Removed => removed.Length;

        /// <summary>Number of agents that have left the last ring.</summary>
        public int Hidden => hidden.Length;

        /// <summary>Tier of the chunks: index into the header's.</summary>
        public int Tier { get; private set; }

        /// <summary>The message's bytes, in which poses and contacts of a chunk are places.</summary>
        public byte[] Bytes => reader.Bytes;

        /// <summary>Resume token of the last batch that had one: everything up to it has come.</summary>
        public string ResumeToken => Encoding.UTF8.GetString(token, 0, tokenLength);

        /// <summary>Read a message: the first bytes of the array, which may not change while its chunks are read.</summary>
        /// <exception cref="InvalidDataException">It is malformed.</exception>
        public MessageKind Decode(byte[] message, int length)
        {
            reader.Load(message, length);
            Kind = MessageKind.None;
            SentAt = 0;
            Header = null;
            Event = null;
            added.Clear();
            removed.Length = 0;
            hidden.Length = 0;
            Tier = 0;
            foreach (Column column in columns)
            {
                column.Length = 0;
            }
            posesLength = contactsLength = 0;
            for (int field = reader.Next(); field != 0; field = reader.Next())
            {
                switch (field)
                {
                    case 1:
                        SentAt = reader.Varint() / 1e6;
                        break;
                    case 2:
                        Header = MessageReaders.ReadHeader(reader);
                        Kind = MessageKind.Header;
                        break;
                    case 3:
                        ReadBatch();
                        Kind = MessageKind.Batch;
                        break;
                    case 4:
                        reader.Block();
                        Kind = MessageKind.Heartbeat;
                        break;
                    case 5:
                        Event = MessageReaders.ReadEvent(reader);
                        Kind = MessageKind.Event;
                        break;
                    default:
                        reader.Skip();
                        break;
                }
            }
            Check();
            return Kind;
        }

        /// <summary>Chunk <paramref name="row"/> of the batch.</summary>
        public Chunk Chunk(int row)
        {
            int frames = contactsLength / Chunks;
            long found = state.Values[row];
            return new Chunk
            {
                Alias = (int)alias.Values[row],
                Seq = (int)seq.Values[row],
                FirstFrame = (int)firstFrame.Values[row],
                ScheduledAt = scheduledAt.Values[row] / 1e6,
                GoalRevision = (int)goalRevision.Values[row],
                State = found <= (long)AgentState.Turning ? (AgentState)found : AgentState.Unknown,
                Flags = (ChunkFlags)flags.Values[row],
                Waypoint = (int)waypoint.Values[row],
                Candidates = (int)candidates.Values[row],
                Frames = frames,
                Poses = poses + posesLength / Chunks * row,
                Contacts = contacts + frames * row,
            };
        }

        /// <summary>Alias of removed agent <paramref name="row"/>.</summary>
        public int RemovedAlias(int row)
        {
            return (int)removed.Values[row];
        }

        /// <summary>Alias of hidden agent <paramref name="row"/>.</summary>
        public int HiddenAlias(int row)
        {
            return (int)hidden.Values[row];
        }

        /// <summary>Checks that the chunks of the batch are whole frames of their tier.</summary>
        /// <exception cref="InvalidDataException">They are not, or the encoding is not known.</exception>
        public void CheckFrames(Header header)
        {
            if (Tier >= header.Tiers.Count)
            {
                throw new InvalidDataException(
                    "the header tells of " + header.Tiers.Count + " tiers, not of " + Tier);
            }
            Tier tier = header.Tiers[Tier];
            long each = Wayfarer.Poses.FrameBytes(tier.Encoding, tier.Bones.Count);
            if (posesLength != each * contactsLength)
            {
                throw new InvalidDataException(
                    posesLength + " bytes of poses are not " + contactsLength + " frames of " + each + " bytes");
            }
        }

        private void ReadBatch()
        {
            int outer = reader.Enter();
            for (int field = reader.Next(); field != 0; field = reader.Next())
            {
                switch (field)
                {
                    case 1: added.Add(MessageReaders.ReadAgent(reader)); break;
                    case 2: ReadChunks(); break;
                    case 3: reader.Varints(removed); break;
                    case 4: KeepToken(reader.Block()); break;
                    case 5: Tier = reader.Small(); break;
                    case 6: reader.Varints(hidden); break;
                    default: reader.Skip(); break;
                }
            }
            reader.Leave(outer);
        }

        private void ReadChunks()
        {
            int outer = reader.Enter();
            for (int field = reader.Next(); field != 0; field = reader.Next())
            {
                switch (field)
                {
                    case 1: reader.Varints(alias); break;
                    case 2: reader.Varints(seq); break;
                    case 3: reader.Varints(firstFrame); break;
                    case 4: reader.Varints(scheduledAt); break;
                    case 5: reader.Varints(goalRevision); break;
                    case 6: reader.Varints(state); break;
                    case 7: reader.Varints(flags); break;
                    case 8:
                        posesLength = reader.Block();
                        poses = reader.At - posesLength;
                        break;
                    case 9:
                        contactsLength = reader.Block();
                        contacts = reader.At - contactsLength;
                        break;
                    case 10: reader.Varints(waypoint); break;
                    case 11: reader.Varints(candidates); break;
                    default: reader.Skip(); break;
                }
            }
            reader.Leave(outer);
        }

        private void Check()
        {
            bool whole = posesLength % Math.Max(1, Chunks) == 0 && contactsLength % Math.Max(1, Chunks) == 0;
            foreach (Column column in columns)
            {
                whole &= column.Length == Chunks;
            }
            if (!whole)
            {
                throw new InvalidDataException("malformed message: columns of chunks differ in length");
            }
        }

        private void KeepToken(int length)
        {
            if (length > token.Length)
            {
                token = new byte[2 * length];
            }
            Buffer.BlockCopy(reader.Bytes, reader.At - length, token, 0, length);
            tokenLength = length;
        }
    }
}
