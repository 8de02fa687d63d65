using System.Collections.Generic;
using System.Linq;
using Newtonsoft.Json.Linq;
using NUnit.Framework;

namespace Wayfarer.Tests
{
    /// <summary>The traces that every client follows: tests/golden/README.md.</summary>
    public class PlayoutTests
    {
        private static readonly JObject Document = Golden.Document("playout.json");

        public static IEnumerable<TestCaseData> Clocks()
        {
            return Cases("clock");
        }

        public static IEnumerable<TestCaseData> Tracks()
        {
            return Cases("track");
        }

        [TestCaseSource("Clocks")]
        public void A_clock_shows_the_moments_of_the_trace(JToken events)
        {
            var clock = new PlayoutClock();
            foreach (JToken told in events)
            {
                double now = (double)told[1];
                switch ((string)told[0])
                {
                    case "message": clock.Observe(now, (double)told[2]); break;
                    case "chunk": clock.ObserveChunk(now, (double)told[2]); break;
                    case "resumed": clock.Resumed((double)told[2]); break;
                    default:
                        Golden.Near(clock.Advance(now), (double)told[2], 1e-6, "moment at " + now);
                        Golden.Near(clock.Delay(now), (double)told[3], 1e-6, "delay at " + now);
                        break;
                }
            }
        }

        [TestCaseSource("Tracks")]
        public void A_track_gives_the_poses_of_the_trace(JToken events)
        {
            var track = new PoseTrack(11);
            var found = new float[11];
            foreach (JToken told in events)
            {
                double time = (double)told[1];
                if ((string)told[0] == "push")
                {
                    byte[] contacts = told[4].Select(bits => (byte)(int)bits).ToArray();
                    track.Push(time, (double)told[2], Golden.Floats(told[3]), told[3].Count(), contacts);
                    continue;
                }
                Assert.AreEqual(told[2].Type != JTokenType.Null, track.Sample(time, found));
                if (told[2].Type == JTokenType.Null)
                {
                    continue;
                }
                double[] pose = Golden.Doubles(told[2]);
                for (int k = 0; k < 3; k++)
                {
                    Golden.Near(found[k], pose[k], 1e-5, "hips at " + time);
                }
                foreach (int at in new[] { 3, 7 })
                {
                    Golden.NearTurn(Golden.Part(found, at, 4), Golden.Part(pose, at, 4), 1e-5, "turn at " + time);
                }
                Assert.AreEqual((int)told[3], track.Contacts);
                Golden.Near(track.Buffered(time), (double)told[4], 1e-6, "buffered at " + time);
                Assert.AreEqual((int)told[5], track.Underruns);
            }
        }

        [Test]
        public void A_smooth_root_follows_the_trace()
        {
            var root = new SmoothRoot(Basis.Gltf);
            foreach (JToken told in Document["root"])
            {
                double time = (double)told[0];
                root.Update(time, Golden.Floats(told[1], told[2]), (double)told[3]);
                for (int k = 0; k < 3; k++)
                {
                    Golden.Near(root.Point[k], (double)told[4][k], 1e-5, "point at " + time);
                }
                Golden.Near(root.Heading, (double)told[5], 1e-5, "heading at " + time);
            }
        }

        [Test]
        public void A_background_program_keeps_a_bounded_number_of_frames()
        {
            var track = new PoseTrack(7);
            for (int k = 0; k < 1000; k++)
            {
                track.Push(0.2 * k, 40, new float[7 * 8], 8, new byte[8]);
            }
            Assert.AreEqual(400, track.Length);
            Golden.Near(track.Buffered(0), 199.8 + 7 / 40.0, 1e-9, "the newest are kept");
        }

        private static IEnumerable<TestCaseData> Cases(string key)
        {
            return ((JObject)Document[key]).Properties()
                .Select(entry => new TestCaseData(entry.Value).SetName(key + " " + entry.Name));
        }
    }
}
