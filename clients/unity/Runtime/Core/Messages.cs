using System;
using System.Collections.Generic;

namespace Wayfarer
{
    /// <summary>The kind of a message of the stream.</summary>
    public enum MessageKind
    {
        None,
        Header,
        Batch,
        Heartbeat,
        Event,
    }

    /// <summary>What an agent is doing.</summary>
    public enum AgentState
    {
        Unknown,
        Standing,
        Walking,
        Stopping,
        Turning,
    }

    /// <summary>Flags of a chunk.</summary>
    [Flags]
    public enum ChunkFlags
    {
        None = 0,
        First = 1,
        Replanned = 2,
        Arrived = 4,
        Gap = 8,
        Reduced = 16,
        Held = 32,
    }

    /// <summary>The kind of an event (docs/wire-format.md, "Events").</summary>
    public enum EventKind
    {
        Unknown,
        GoalReached,
        PathDone,
        Gap,
        Draining,
        ModelChanged,
        Unreachable,
        Blocked,
        GoalMoved,
        BehaviourEnded,
        AgentLeft,
        Fault,
    }

    /// <summary>A bone of the header's skeleton; <c>Parent</c>: its number, -1: none.</summary>
    public sealed class SkeletonBone
    {
        public string Name { get; internal set; } = "";

        public int Parent { get; internal set; }
    }

    /// <summary>How frames are packed in a ring around the viewpoints.</summary>
    public sealed class Tier
    {
        /// <summary>Radius in units of the basis; infinite without rings.</summary>
        public double Radius { get; set; } = double.PositiveInfinity;

        public PoseEncoding Encoding { get; set; }

        public int SentFps { get; set; }

        public IReadOnlyList<int> Bones { get; set; } = new int[0];

        public int FrameBytes { get; set; }
    }

    /// <summary>Properties of a whole stream.</summary>
    public sealed class Header
    {
        public string ServerVersion { get; internal set; } = "";

        public string SessionId { get; internal set; } = "";

        /// <summary>Frames per second of the motion.</summary>
        public int Fps { get; internal set; }

        /// <summary>Frames per second that are sent.</summary>
        public int SentFps { get; internal set; }

        /// <summary>The basis's name, as in the API.</summary>
        public string BasisName { get; internal set; } = "gltf";

        public double MetresPerUnit { get; internal set; } = 1;

        public IReadOnlyList<SkeletonBone> Skeleton => Bones_;

        /// <summary>Numbers in <see cref="Skeleton"/> of the bones whose rotations are sent.</summary>
        public IReadOnlyList<int> Bones { get; internal set; } = new int[0];

        public PoseEncoding Encoding { get; internal set; }

        public int FrameBytes { get; internal set; }

        public bool Resumed { get; internal set; }

        /// <summary>Tier of each ring, from the inside out; one without rings.</summary>
        public IReadOnlyList<Tier> Tiers => Tiers_;

        internal readonly List<Tier> Tiers_ = new List<Tier>();

        internal readonly List<SkeletonBone> Bones_ = new List<SkeletonBone>();
    }

    /// <summary>An agent as the stream introduces it.</summary>
    public sealed class Agent
    {
        public string Id { get; internal set; } = "";

        /// <summary>Its number in chunks of this session.</summary>
        public int Alias { get; internal set; }

        public string Name { get; internal set; } = "";

        public string Body { get; internal set; } = "";

        /// <summary>"female" or "male".</summary>
        public string Gender { get; internal set; } = "female";

        public double[] Betas { get; internal set; } = new double[0];

        public ulong Seed { get; internal set; }

        /// <summary>x, y, z for each bone of the skeleton: its place relative to its parent in the T-pose.</summary>
        public double[] RestOffsets { get; internal set; } = new double[0];
    }

    /// <summary>The new frames of an agent.</summary>
    public struct Chunk
    {
        public int Alias;
        public int Seq;
        public int FirstFrame;

        /// <summary>Seconds since 1970, by the server's clock.</summary>
        public double ScheduledAt;

        public int GoalRevision;
        public AgentState State;
        public ChunkFlags Flags;
        public int Waypoint;
        public int Candidates;

        /// <summary>Number of frames.</summary>
        public int Frames;

        /// <summary>Where its poses begin in the message's bytes.</summary>
        public int Poses;

        /// <summary>Where its contacts begin: a byte for each frame, 1 left foot, 2 right foot.</summary>
        public int Contacts;
    }

    /// <summary>Something that happened.</summary>
    public sealed class MotionEvent
    {
        public EventKind Kind { get; internal set; }

        public string AgentId { get; internal set; } = "";

        public int Alias { get; internal set; }

        /// <summary>Seconds since 1970, by the server's clock.</summary>
        public double At { get; internal set; }

        public int GoalRevision { get; internal set; }

        public int Waypoint { get; internal set; }

        /// <summary>A sentence for people.</summary>
        public string Detail { get; internal set; } = "";
    }
}
