using System;
using System.Collections.Generic;
using System.IO;

namespace Wayfarer
{
    /// <summary>An agent as it is shown.</summary>
    public sealed class PlayedAgent
    {
        internal PlayedAgent(Agent agent, int width)
        {
            Agent = agent;
            Frame = new float[width];
            Track = new PoseTrack(width);
        }

        public Agent Agent { get; }

        /// <summary>Hips x, y, z, then x, y, z, w for each of the header's bones.</summary>
        public float[] Frame { get; }

        public PoseTrack Track { get; }

        /// <summary>Whether <see cref="Frame"/> holds a pose.</summary>
        public bool Shown { get; internal set; }

        /// <summary>Removed for having left the last ring; it may come again.</summary>
        public bool Hidden { get; internal set; }

        /// <summary>Number of its ring, from the last chunk.</summary>
        public int Tier { get; internal set; }

        /// <summary>Its state, from the last chunk.</summary>
        public AgentState State { get; internal set; } = AgentState.Standing;
    }

    /// <summary>Counts since the start; gaps, reduced and held count chunks with that flag.</summary>
    public struct PlayerStats
    {
        public long Messages;
        public long Bytes;
        public long Chunks;
        public long Frames;
        public long Gaps;
        public long Reduced;
        public long Held;
    }

    /// <summary>
    /// The agents of a stream, played smoothly: messages and times go in, poses come out. Times are seconds of any clock
    /// of this machine. Allocates only for new agents.
    /// </summary>
    public sealed class MotionPlayer
    {
        private readonly StreamDecoder decoder = new StreamDecoder();
        private readonly Dictionary<int, PlayedAgent> byAlias = new Dictionary<int, PlayedAgent>();
        private readonly List<PlayedAgent> agents = new List<PlayedAgent>();
        private PlayerStats stats;
        private TierUnpacker tiers;
        private float[] unpacked = new float[0];
        private int goneUnderruns;
        private bool begun;

        /// <summary>A stream begins; true: again, after a lost connection.</summary>
        public event Action<Header, bool> HeaderReceived;

        public event Action<PlayedAgent> AgentAdded;

        /// <summary>Raised also for an agent that has left the last ring and is hidden.</summary>
        public event Action<PlayedAgent> AgentRemoved;

        public event Action<PlayedAgent, Chunk> ChunkReceived;

        public event Action<MotionEvent> EventReceived;

        public PlayoutClock Clock { get; private set; } = new PlayoutClock();

        /// <summary>All agents; a loop by index allocates nothing.</summary>
        public IReadOnlyList<PlayedAgent> Agents => agents;

        public Header Header { get; private set; }

        /// <summary>The moment shown: server time, seconds since 1970.</summary>
        public double Moment { get; private set; } = double.NaN;

        public PlayerStats Stats => stats;

        /// <summary>The token from which the next stream resumes; "" at first.</summary>
        public string ResumeToken => decoder.ResumeToken;

        /// <summary>How often an agent's frames ran out.</summary>
        public int Underruns
        {
            get
            {
                int sum = goneUnderruns;
                for (int k = 0; k < agents.Count; k++)
                {
                    sum += agents[k].Track.Underruns;
                }
                return sum;
            }
        }

        /// <summary>Seconds of motion in the queue of the agent that has the least; infinity without agents.</summary>
        public double Buffered
        {
            get
            {
                double least = double.PositiveInfinity;
                for (int k = 0; k < agents.Count; k++)
                {
                    least = Math.Min(least, agents[k].Track.Buffered(Moment));
                }
                return least;
            }
        }

        /// <summary>The agent of an alias, or null.</summary>
        public PlayedAgent Find(int alias)
        {
            PlayedAgent found;
            return byAlias.TryGetValue(alias, out found) ? found : null;
        }

        /// <summary>A connection begins: its first message is a header.</summary>
        public void Begin()
        {
            begun = false;
        }

        /// <summary>
        /// Take a message of the stream (StreamMotionResponse, the first <paramref name="length"/> bytes) that came at
        /// local <paramref name="now"/>.
        /// </summary>
        /// <exception cref="InvalidDataException">
        /// It cannot be read; the connection is then of no more use.
        /// </exception>
        public MessageKind Receive(byte[] message, int length, double now)
        {
            MessageKind kind = decoder.Decode(message, length);
            stats.Messages++;
            stats.Bytes += length;
            if (kind == MessageKind.Header)
            {
                TakeHeader();
            }
            Clock.Observe(now, decoder.SentAt);
            if (kind == MessageKind.Batch)
            {
                TakeBatch(now);
            }
            else if (kind == MessageKind.Event)
            {
                EventReceived?.Invoke(decoder.Event);
            }
            return kind;
        }

        /// <summary>Show all agents as at local <paramref name="now"/>. Returns the moment shown, in server time.</summary>
        public double Advance(double now)
        {
            Moment = Clock.Advance(now);
            for (int k = 0; k < agents.Count; k++)
            {
                agents[k].Shown = agents[k].Track.Sample(Moment, agents[k].Frame);
            }
            return Moment;
        }

        /// <summary>Forget all agents, as if they were removed, and the clock.</summary>
        public void Clear()
        {
            while (agents.Count > 0)
            {
                Remove(agents[agents.Count - 1].Agent.Alias);
            }
            Clock = new PlayoutClock();
        }

        /// <summary>Forget an agent.</summary>
        public void Remove(int alias)
        {
            PlayedAgent played = Find(alias);
            if (played == null)
            {
                return;
            }
            goneUnderruns += played.Track.Underruns;
            byAlias.Remove(alias);
            agents.Remove(played);
            AgentRemoved?.Invoke(played);
        }

        private void TakeHeader()
        {
            bool again = Header != null;
            Header found = decoder.Header;
            tiers = new TierUnpacker(found.BasisName, found.Bones, found.Tiers);
            begun = true;
            Header = found;
            if (again)
            {
                Clock.Resumed(decoder.SentAt);
            }
            HeaderReceived?.Invoke(Header, again);
        }

        private void TakeBatch(double now)
        {
            if (!begun)
            {
                throw new InvalidDataException("motion came before the header");
            }
            decoder.CheckFrames(Header);
            int width = tiers.Width;
            for (int k = 0; k < decoder.Added.Count; k++)
            {
                Add(decoder.Added[k], width);
            }
            for (int row = 0; row < decoder.Chunks; row++)
            {
                TakeChunk(decoder.Chunk(row), width, now);
            }
            for (int row = 0; row < decoder.Removed; row++)
            {
                Remove(decoder.RemovedAlias(row));
            }
            for (int row = 0; row < decoder.Hidden; row++)
            {
                PlayedAgent played = Find(decoder.HiddenAlias(row));
                if (played != null)
                {
                    played.Hidden = true;
                    Remove(played.Agent.Alias);
                }
            }
        }

        /// <summary>A new agent, or a known one when a stream begins again.</summary>
        private void Add(Agent agent, int width)
        {
            PlayedAgent known = Find(agent.Alias);
            if (known != null && known.Agent.Id == agent.Id && known.Track.Width == width)
            {
                return;
            }
            Remove(agent.Alias);
            var played = new PlayedAgent(agent, width);
            byAlias[agent.Alias] = played;
            agents.Add(played);
            AgentAdded?.Invoke(played);
        }

        private void TakeChunk(Chunk chunk, int width, double now)
        {
            stats.Chunks++;
            stats.Frames += chunk.Frames;
            stats.Gaps += (chunk.Flags & ChunkFlags.Gap) != 0 ? 1 : 0;
            stats.Reduced += (chunk.Flags & ChunkFlags.Reduced) != 0 ? 1 : 0;
            stats.Held += (chunk.Flags & ChunkFlags.Held) != 0 ? 1 : 0;
            PlayedAgent played = Find(chunk.Alias);
            if (played == null)
            {
                return; // removed here, its last chunks still on the way
            }
            Clock.ObserveChunk(now, chunk.ScheduledAt);
            if (unpacked.Length < chunk.Frames * width)
            {
                unpacked = new float[2 * chunk.Frames * width];
            }
            int tier = decoder.Tier;
            tiers.Unpack(decoder.Bytes, chunk.Poses, chunk.Frames, tier, unpacked);
            played.Track.Push(
                chunk.ScheduledAt, Header.Tiers[tier].SentFps, unpacked, chunk.Frames, decoder.Bytes, chunk.Contacts);
            played.State = chunk.State;
            played.Tier = tier;
            ChunkReceived?.Invoke(played, chunk);
        }
    }
}
