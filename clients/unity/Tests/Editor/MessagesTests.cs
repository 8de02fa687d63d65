using System;
using System.Collections.Generic;
using System.IO;
using System.Linq;
using NUnit.Framework;

namespace Wayfarer.Tests
{
    /// <summary>Messages of the stream (tests/golden/messages.py says what is in them), and the player that takes them.</summary>
    public class MessagesTests
    {
        [Test]
        public void A_header_gives_rate_basis_skeleton_and_encoding()
        {
            StreamDecoder decoder = Decoded(Golden.Message("header"));
            Header header = decoder.Header;
            Assert.AreEqual(MessageKind.Header, decoder.Kind);
            Assert.AreEqual(1780000000.2, decoder.SentAt);
            Assert.AreEqual("1.2.3 s-1", header.ServerVersion + " " + header.SessionId);
            Assert.AreEqual(new[] { 40, 40, 44 }, new[] { header.Fps, header.SentFps, header.FrameBytes });
            Assert.AreEqual("gltf", header.BasisName);
            Assert.AreEqual(1, header.MetresPerUnit);
            Assert.AreEqual(PoseEncoding.F32Le, header.Encoding);
            Assert.AreEqual(new[] { "pelvis", "left_hip" }, header.Skeleton.Select(bone => bone.Name).ToArray());
            Assert.AreEqual(new[] { -1, 0 }, header.Skeleton.Select(bone => bone.Parent).ToArray());
            Assert.AreEqual(new[] { 0, 1 }, header.Bones.ToArray());
            Assert.IsFalse(header.Resumed);
            Header small = Decoded(Golden.Message("header_small")).Header;
            Assert.AreEqual(PoseEncoding.SmallestThree, small.Encoding);
            Assert.AreEqual(new[] { 10, 1, 18 }, new[] { small.SentFps, small.Bones.Single(), small.FrameBytes });
            Assert.IsTrue(small.Resumed);
        }

        [Test]
        public void A_batch_gives_new_agents_chunks_and_removals()
        {
            StreamDecoder decoder = Decoded(Golden.Message("batch"));
            Agent agent = decoder.Added.Single();
            Assert.AreEqual("a-7 Zoë anny52 male", agent.Id + " " + agent.Name + " " + agent.Body + " " + agent.Gender);
            Assert.AreEqual(300, agent.Alias);
            Assert.AreEqual(4294967295, agent.Seed);
            Assert.AreEqual(new[] { 0.5, -1.25, 3 }, agent.Betas);
            Assert.AreEqual(new[] { 0.0, 1, 2 }, agent.RestOffsets);
            Assert.AreEqual(2, decoder.Removed);
            Assert.AreEqual(new[] { 1, 300 }, new[] { decoder.RemovedAlias(0), decoder.RemovedAlias(1) });
            Assert.AreEqual("r.1.41", decoder.ResumeToken);
            Chunk chunk = decoder.Chunk(0);
            Assert.AreEqual(new[] { 300, 12, 96, 3, 3, 2, 8 }, new[]
            {
                chunk.Alias, chunk.Seq, chunk.FirstFrame, chunk.GoalRevision, chunk.Frames, chunk.Waypoint, chunk.Candidates,
            });
            Assert.AreEqual(1780000000.123456, chunk.ScheduledAt);
            Assert.AreEqual(AgentState.Walking, chunk.State);
            Assert.AreEqual(ChunkFlags.First | ChunkFlags.Arrived, chunk.Flags);
            Assert.AreEqual(new byte[] { 1, 3, 2 }, decoder.Bytes.Skip(chunk.Contacts).Take(3).ToArray());
            float[] last = Frames(decoder, 0, PoseEncoding.F32Le, 2).Skip(22).ToArray();
            Assert.AreEqual(new[] { 2, 2.5f, 2.25f, 0, 0, 0, 1, 0.5f, -0.5f, 0.5f, -0.5f }, last);
            Chunk second = decoder.Chunk(1);
            Assert.AreEqual(new[] { 7, 0 }, new[] { second.Alias, second.Seq });
            Assert.AreEqual(AgentState.Standing, second.State);
            Assert.AreEqual(1780000000.148456, second.ScheduledAt);
            Assert.AreEqual(3, Frames(decoder, 1, PoseEncoding.F32Le, 2)[0]);
        }

        [Test]
        public void Smallest_three_poses_and_held_motion()
        {
            StreamDecoder decoder = Decoded(Golden.Message("batch_small"));
            Assert.AreEqual(ChunkFlags.Held | ChunkFlags.Gap, decoder.Chunk(0).Flags);
            float[] second = Frames(decoder, 0, PoseEncoding.SmallestThree, 1).Skip(7).ToArray();
            Assert.AreEqual(new[] { 1, 1.5f, 1.25f }, second.Take(3).ToArray());
            Assert.That(second.Skip(3), Is.All.EqualTo(0.5).Within(1e-4));
        }

        [Test]
        public void An_event_says_what_happened_to_whom()
        {
            MotionEvent told = Decoded(Golden.Message("event")).Event;
            Assert.AreEqual(EventKind.GoalReached, told.Kind);
            Assert.AreEqual("a-7: goal 3 of 4 reached", told.AgentId + ": " + told.Detail);
            Assert.AreEqual(new[] { 300, 3, 2 }, new[] { told.Alias, told.GoalRevision, told.Waypoint });
            Assert.AreEqual(1780000000.123456, told.At);
        }

        [Test]
        public void A_decoder_keeps_nothing_of_the_message_before_but_the_token_to_resume()
        {
            StreamDecoder decoder = Decoded(Golden.Message("batch"));
            byte[] heartbeat = Golden.Message("heartbeat");
            Assert.AreEqual(MessageKind.Heartbeat, decoder.Decode(heartbeat, heartbeat.Length));
            Assert.AreEqual(new[] { 0, 0, 0 }, new[] { decoder.Chunks, decoder.Added.Count, decoder.Removed });
            Assert.AreEqual("r.1.41", decoder.ResumeToken);
        }

        [Test]
        public void What_is_malformed_is_refused_in_words()
        {
            Refused("columns", 0x1a, 6, 0x12, 4, 0x0a, 2, 1, 2); // two aliases, and nothing else
            Refused("wire type 3 in place of 0", 0x0b);
            Refused("field number 0", 0x00, 1);
            Refused("10 bytes", 0x08, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255);
            Refused("passes its end", 0x1a, 0xff, 0xff, 0xff, 0xff, 0x0f);
            Refused("above 2^31", 0x1a, 10, 0x12, 8, 0x10, 0xff, 0xff, 0xff, 0xff, 0x0f, 8, 1);
            Refused("wire type 3", 0xa3, 0x01);
            Refused("broken packed field", 0x1a, 5, 0x0a, 3, 0x3a, 1, 7);
        }

        [Test]
        public void Every_cut_of_a_message_is_an_error_or_a_shorter_message_never_a_hang()
        {
            byte[] whole = Golden.Message("batch");
            var decoder = new StreamDecoder();
            for (int length = 0; length < whole.Length; length++)
            {
                try
                {
                    decoder.Decode(whole, length); // bytes beyond its end are not read
                }
                catch (InvalidDataException error)
                {
                    StringAssert.Contains("malformed message", error.Message);
                }
            }
            Assert.Throws<InvalidDataException>(() => decoder.Decode(whole, whole.Length - 1));
        }

        [Test]
        public void Unknown_fields_of_every_wire_type_are_passed_over()
        {
            StreamDecoder decoder = Decoded( // fields 20 to 23: varint -1, fixed64, block, fixed32; then field 1 = 5
                0xa0, 0x01, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0x01,
                0xa9, 0x01, 1, 2, 3, 4, 5, 6, 7, 8, 0xb2, 0x01, 2, 7, 7, 0xbd, 0x01, 1, 2, 3, 4, 0x08, 5);
            Assert.AreEqual(MessageKind.None, decoder.Kind);
            Assert.AreEqual(5e-6, decoder.SentAt);
        }

        [Test]
        public void A_player_shows_agents_tells_of_them_and_counts()
        {
            var heard = new List<string>();
            var player = new MotionPlayer();
            player.HeaderReceived += (header, again) => heard.Add("header " + again);
            player.AgentAdded += played => heard.Add("added " + played.Agent.Id);
            player.AgentRemoved += played => heard.Add("removed " + played.Agent.Id);
            player.ChunkReceived += (played, chunk) => heard.Add("chunk " + played.Agent.Id + " " + chunk.Seq);
            player.EventReceived += told => heard.Add("event " + told.Kind);
            Early(player);
            Receive(player, "header", 0);
            Assert.AreEqual(MessageKind.Batch, Receive(player, "batch", 0));
            Assert.AreEqual(new[] { "header False", "added a-7", "chunk a-7 12", "removed a-7" }, heard.ToArray());
            Assert.AreEqual(new[] { 3L, 2, 6, 0 }, new[]
            {
                player.Stats.Messages, player.Stats.Chunks, player.Stats.Frames, player.Stats.Gaps,
            });
            Assert.AreEqual("r.1.41", player.ResumeToken);
            Assert.AreEqual(double.PositiveInfinity, player.Buffered);
            player.Begin();
            Early(player);
            Receive(player, "header_small", 0.1);
            Receive(player, "batch_small", 0.1);
            PlayedAgent zoe = player.Agents.Single();
            Assert.AreSame(zoe, player.Find(300));
            player.Advance(0.2);
            Assert.IsTrue(zoe.Shown);
            Assert.AreEqual(AgentState.Standing, zoe.State);
            Assert.AreEqual(7, zoe.Frame.Length);
            Receive(player, "event", 0.2);
            Assert.AreEqual("event GoalReached", heard.Last());
            Assert.AreEqual(new[] { 1L, 1 }, new[] { player.Stats.Gaps, player.Stats.Held });
            player.Clear();
            Assert.AreEqual("removed a-7", heard.Last());
            CollectionAssert.IsEmpty(player.Agents);
        }

        [Test]
        public void Poses_that_are_not_whole_frames_are_refused()
        {
            var player = new MotionPlayer();
            Receive(player, "header", 0);
            var error = Assert.Throws<InvalidDataException>(() => Receive(player, "batch_small", 0));
            StringAssert.Contains("36 bytes of poses are not 2 frames of 44 bytes", error.Message);
        }

        [Test]
        public void Motion_that_was_missed_while_the_connection_was_lost_does_not_count_as_late()
        {
            var player = new MotionPlayer();
            Receive(player, Crowd.Header(), 100);
            Receive(player, Crowd.Batch(1, 0), 100);
            player.Begin();
            Receive(player, Crowd.Header(50), 110);
            Receive(player, Crowd.Batch(1, 1), 110);
            Golden.Near(player.Clock.WantedDelay(110), 0.35, 1e-6, "what was missed");
            Receive(player, Crowd.Batch(1, 50), 110.7);
            Golden.Near(player.Clock.WantedDelay(110.7), 0.76, 1e-6, "what is late now");
        }

        private static void Early(MotionPlayer player)
        {
            var error = Assert.Throws<InvalidDataException>(() => Receive(player, "batch", 0));
            StringAssert.Contains("motion came before the header", error.Message);
        }

        private static MessageKind Receive(MotionPlayer player, string name, double now)
        {
            return Receive(player, Golden.Message(name), now);
        }

        private static MessageKind Receive(MotionPlayer player, byte[] message, double now)
        {
            return player.Receive(message, message.Length, now);
        }

        private static void Refused(string said, params byte[] message)
        {
            StringAssert.Contains(said, Assert.Throws<InvalidDataException>(() => Decoded(message)).Message);
        }

        private static StreamDecoder Decoded(params byte[] message)
        {
            var decoder = new StreamDecoder();
            decoder.Decode(message, message.Length);
            return decoder;
        }

        private static float[] Frames(StreamDecoder decoder, int row, PoseEncoding encoding, int bones)
        {
            Chunk chunk = decoder.Chunk(row);
            var frames = new float[chunk.Frames * (3 + 4 * bones)];
            Poses.Unpack(decoder.Bytes, chunk.Poses, chunk.Frames, encoding, bones, frames);
            return frames;
        }
    }
}
