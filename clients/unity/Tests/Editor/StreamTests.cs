using System;
using System.Collections.Generic;
using System.Linq;
using Newtonsoft.Json.Linq;
using NUnit.Framework;

namespace Wayfarer.Tests
{
    /// <summary>A stream over sockets and a clock that the test drives by hand.</summary>
    public class StreamTests
    {
        private readonly List<FakeSocket> sockets = new List<FakeSocket>();
        private readonly List<string> heard = new List<string>();
        private MotionPlayer player;
        private MotionStream stream;

        [SetUp]
        public void Begin()
        {
            sockets.Clear();
            heard.Clear();
            player = new MotionPlayer();
            player.HeaderReceived += (header, again) => heard.Add("header " + header.Resumed + " " + again);
            player.AgentAdded += played => heard.Add("added");
            player.AgentRemoved += played => heard.Add("removed");
            player.ChunkReceived += (played, chunk) => heard.Add("chunk " + chunk.Seq);
            player.EventReceived += told => heard.Add("event " + told.Kind);
            stream = new MotionStream(
                token => new StreamAddress { Url = "ws://x/" + token, Protocols = new[] { "p" } }, player, NewSocket);
            stream.StatusChanged += (status, detail) => heard.Add(status.ToString());
            stream.Ended += reason => heard.Add("ended " + reason);
            stream.Refused += reason => heard.Add("refused " + reason);
            stream.Failed += reason => heard.Add("failed " + reason);
            stream.Update(0);
        }

        [Test]
        public void Header_agents_chunks_and_removals_arrive_in_order()
        {
            sockets[0].Say("header");
            sockets[0].Say("batch");
            sockets[0].Say("heartbeat");
            stream.Update(0.1);
            Heard("Connecting", "header False False", "Open", "added", "chunk 12", "removed");
            Assert.AreEqual(3, player.Stats.Messages);
            Assert.AreEqual(new[] { "p" }, sockets[0].Protocols.ToArray());
        }

        [Test]
        public void All_tiers_are_shown_alike_and_who_is_hidden_is_taken_away()
        {
            sockets[0].Say("header_tiers");
            sockets[0].Say("batch_root");
            stream.Update(0.1);
            player.Advance(0.2);
            PlayedAgent played = player.Agents[0];
            Assert.IsTrue(played.Shown && played.Tier == 2 && played.Frame.Length == 11);
            CollectionAssert.AreEqual(new[] { 0f, 0.5f, 0.25f }, played.Frame.Take(3));
            Tier middle = player.Header.Tiers[1];
            Assert.AreEqual(30.5, middle.Radius);
            Assert.IsTrue(middle.Encoding == PoseEncoding.SmallestThree && middle.SentFps == 20 && middle.FrameBytes == 18);
            sockets[0].Say(new byte[] { 0x1a, 4, 0x32, 2, 0xac, 2 }); // batch { hidden: [300] }
            stream.Update(0.3);
            Assert.IsTrue(played.Hidden && player.Agents.Count == 0);
            sockets[0].Say("batch_root");
            stream.Update(0.4);
            Assert.IsTrue(player.Agents.Count == 1 && !player.Agents[0].Hidden);
            sockets[0].Say("header");
            sockets[0].Say("batch_root");
            stream.Update(0.5);
            StringAssert.Contains("1 tiers, not of 2", heard.Last());
        }

        [Test]
        public void Who_comes_nearer_goes_on_and_who_was_not_introduced_is_not_shown()
        {
            var hiding = new byte[] { 0x1a, 4, 0x32, 2, 0xac, 2 }; // batch { hidden: [300] }
            sockets[0].Say("header_tiers");
            sockets[0].Say("batch_closer");
            stream.Update(0.1);
            Assert.AreEqual(0, player.Agents.Count);
            sockets[0].Say("batch_root");
            stream.Update(0.2);
            PlayedAgent played = player.Agents[0];
            Assert.AreEqual(2, played.Tier);
            sockets[0].Say("batch_closer");
            stream.Update(0.3);
            player.Advance(0.4);
            Assert.IsTrue(played.Shown && played.Tier == 1 && player.Agents[0] == played);
            sockets[0].Say(hiding);
            sockets[0].Say("batch_closer");
            stream.Update(0.5);
            Assert.AreEqual(0, player.Agents.Count);
            Assert.AreEqual(1, heard.Count(said => said == "added"));
        }

        [Test]
        public void Texts_are_sent_once_the_header_has_come_the_last_of_those_in_a_tenth_of_a_second()
        {
            stream.Say("a");
            stream.Update(0.1);
            Assert.AreEqual(0, sockets[0].Sent.Count);
            sockets[0].Say("header");
            stream.Update(0.2);
            stream.Say("b");
            stream.Say("c");
            stream.Update(0.25);
            stream.Update(0.31);
            stream.Say("c");
            stream.Update(1);
            CollectionAssert.AreEqual(new[] { "a", "c" }, sockets[0].Sent);
        }

        [Test]
        public void A_session_looks_from_where_it_is_told_and_says_so_again_when_it_connects()
        {
            double now = 0;
            var options = new SessionOptions
            {
                Interest = JObject.Parse("{'rings': [{'radius': 10}], 'viewpoints': [{'position': {'x': 0, 'y': 0, 'z': 0}}]}"),
                NewSocket = NewSocket,
                Http = new FakeHttp(),
                Now = () => now,
            };
            Session session = Session.Join("http://x", "s", options);
            session.Update();
            session.Look(1, 2, 3, 4);
            sockets.Last().Say("header");
            session.Update();
            string view = "{\"viewpoints\":[{\"position\":{\"x\":1.0,\"y\":2.0,\"z\":3.0},\"reach\":4.0}]}";
            CollectionAssert.AreEqual(new[] { view }, sockets.Last().Sent);
            sockets.Last().End(1006);
            session.Update();
            now = 1;
            session.Update();
            StringAssert.Contains("%22reach%22%3A4.0", sockets.Last().Url);
            options.Interest = null;
            Assert.Throws<InvalidOperationException>(() => Session.Join("http://x", "s", options).Look(0, 0, 0));
        }

        [Test]
        public void A_lost_connection_is_opened_again_later_each_time()
        {
            sockets[0].End(1006);
            stream.Update(1);
            stream.Update(1.49);
            Assert.AreEqual(1, sockets.Count);
            stream.Update(1.5);
            Assert.AreEqual(2, sockets.Count);
            sockets[1].End(4503, "the server is shutting down");
            stream.Update(2);
            stream.Update(2.9);
            Assert.AreEqual(2, sockets.Count);
            stream.Update(3);
            Assert.AreEqual(3, sockets.Count);
            sockets[2].Say("header"); // success: the first wait is short again
            sockets[2].End(1001);
            stream.Update(3.1);
            stream.Update(3.6);
            Assert.AreEqual(4, sockets.Count);
            Assert.AreEqual(
                "Connecting Lost Connecting Lost Connecting Open Lost Connecting",
                string.Join(" ", heard.Where(name => !name.StartsWith("header")).ToArray()));
        }

        [Test]
        public void The_pause_between_attempts_does_not_grow_beyond_8_s()
        {
            double now = 0;
            for (int k = 0; k < 12; k++)
            {
                sockets.Last().End(1006);
                stream.Update(now);
                now += 8;
                stream.Update(now);
                Assert.AreEqual(k + 2, sockets.Count);
            }
        }

        [Test]
        public void A_stream_goes_on_where_it_was_and_says_so()
        {
            sockets[0].Say("header");
            sockets[0].Say("batch");
            sockets[0].End(1006);
            stream.Update(0.1);
            stream.Update(0.6);
            Assert.AreEqual(new[] { "ws://x/", "ws://x/r.1.41" }, sockets.Select(socket => socket.Url).ToArray());
            sockets[1].Say("header_small");
            sockets[1].Say("batch_small");
            stream.Update(0.7);
            Assert.AreEqual("header True True", heard[heard.Count - 4]);
            Assert.AreEqual("chunk 13", heard.Last());
        }

        [Test]
        public void Events_are_handed_on()
        {
            sockets[0].Say("header");
            sockets[0].Say("event");
            stream.Update(0.1);
            Assert.AreEqual("event GoalReached", heard.Last());
        }

        [Test]
        public void A_resume_token_that_the_server_does_not_know_is_forgotten()
        {
            sockets[0].Say("header");
            sockets[0].Say("batch");
            sockets[0].End(4422, "not a resume token");
            stream.Update(0.1);
            Assert.AreEqual("ws://x/", sockets[1].Url);
            sockets[1].End(4422, "encoding: unknown");
            stream.Update(0.2);
            Assert.AreEqual("failed encoding: unknown", heard.Last());
            stream.Update(100);
            Assert.AreEqual(2, sockets.Count);
        }

        [Test]
        public void A_caller_that_is_not_known_may_show_who_it_is_and_open_again()
        {
            sockets[0].End(4401, "credentials are missing");
            stream.Update(0.1);
            Assert.AreEqual("refused credentials are missing", heard.Last());
            stream.Update(100);
            Assert.AreEqual(1, sockets.Count);
            stream.Open();
            stream.Update(100.1);
            Assert.AreEqual(2, sockets.Count);
        }

        [TestCase(1000)]
        [TestCase(4404)]
        public void An_ended_or_unknown_session_is_not_asked_for_again(int code)
        {
            sockets[0].End(code, "gone");
            stream.Update(0.1);
            stream.Update(100);
            Assert.AreEqual("ended gone", heard.Last());
            Assert.AreEqual(1, sockets.Count);
            Assert.IsTrue(stream.Closed);
        }

        [Test]
        public void What_is_not_allowed_is_told()
        {
            sockets[0].End(4403, "web pages of this origin may not call");
            stream.Update(0.1);
            Assert.AreEqual("failed web pages of this origin may not call", heard.Last());
        }

        [Test]
        public void A_silent_connection_is_given_up_a_speaking_one_is_kept()
        {
            stream.Update(2);
            sockets[0].Say("header");
            stream.Update(4);
            stream.Update(6.4);
            Assert.IsFalse(sockets[0].Closed);
            stream.Update(6.6);
            Assert.IsTrue(sockets[0].Closed);
            Assert.AreEqual("Lost", heard.Last());
            stream.Update(7.2);
            Assert.AreEqual(2, sockets.Count);
        }

        [Test]
        public void A_program_that_slept_takes_what_has_come_before_it_thinks_of_silence()
        {
            sockets[0].Say("header", 0.1);
            stream.Update(60);
            Assert.AreEqual("Open", heard.Last());
            Assert.IsFalse(sockets[0].Closed);
        }

        [Test]
        public void What_cannot_be_read_ends_the_stream_with_a_reason()
        {
            sockets[0].Say(new byte[] { 0x0b });
            stream.Update(0.1);
            StringAssert.Contains("cannot read the stream: malformed message", heard.Last());
            stream.Update(100);
            Assert.AreEqual(1, sockets.Count);
            Assert.IsTrue(sockets[0].Closed);
        }

        [Test]
        public void A_stream_that_was_closed_stays_closed_and_ignores_late_messages()
        {
            sockets[0].Say("header");
            stream.Close();
            int count = heard.Count;
            stream.Update(100);
            Assert.AreEqual(count, heard.Count);
            Assert.AreEqual(1, sockets.Count);
        }

        private void Heard(params string[] names)
        {
            Assert.AreEqual(names, heard.ToArray());
        }

        private ISocket NewSocket()
        {
            sockets.Add(new FakeSocket());
            return sockets.Last();
        }
    }
}
