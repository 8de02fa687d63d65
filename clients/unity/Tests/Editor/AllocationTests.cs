using System;
using System.Linq;
using Newtonsoft.Json.Linq;
using NUnit.Framework;

namespace Wayfarer.Tests
{
    /// <summary>After warm-up, 10,000 chunks are decoded, kept, shown and put on characters without an allocation.</summary>
    public class AllocationTests
    {
        private const int Agents = 25;
        private const int Warm = 400;
        private const int Counted = 10000 / Agents;
        private const int Pictures = 12; // each chunk of 0.2 s is shown in so many

        [Test]
        public void Nothing_is_allocated_after_warm_up()
        {
            var counter = typeof(GC).GetMethod("GetAllocatedBytesForCurrentThread");
            if (counter == null)
            {
                Assert.Ignore("this runtime has no GC.GetAllocatedBytesForCurrentThread");
            }
            var allocated = (Func<long>)Delegate.CreateDelegate(typeof(Func<long>), counter);
            byte[][] messages = Enumerable.Range(0, Warm + Counted).Select(seq => Crowd.Batch(Agents, seq)).ToArray();
            byte[] header = Crowd.Header();
            JToken[] rigs = Golden.Document("retarget.json")["cases"]
                .Where(found => (string)found["basis"] == "gltf").ToArray();
            var player = new MotionPlayer();
            var retargets = new Retarget[Agents + 1];
            var roots = new SmoothRoot[Agents + 1];
            player.AgentAdded += played =>
            {
                JToken rig = rigs[played.Agent.Alias % rigs.Length];
                retargets[played.Agent.Alias] = RetargetTests.Of(rig, RetargetTests.Map(rig));
                roots[played.Agent.Alias] = new SmoothRoot(Basis.Unity);
            };
            player.Receive(header, header.Length, 100);
            for (int seq = 0; seq < Warm; seq++)
            {
                Play(player, messages[seq], seq, retargets, roots);
            }
            long chunks = player.Stats.Chunks;
            long before = allocated();
            for (int seq = Warm; seq < messages.Length; seq++)
            {
                Play(player, messages[seq], seq, retargets, roots);
            }
            long bytes = allocated() - before;
            Assert.AreEqual(10000, player.Stats.Chunks - chunks);
            Assert.AreEqual(0, player.Underruns);
            Assert.AreEqual(0, bytes, "bytes allocated");

            before = allocated();
            var kept = new byte[100];
            Assert.That(allocated() - before, Is.GreaterThanOrEqualTo(kept.Length), "the counter counts");
        }

        private static void Play(MotionPlayer player, byte[] message, int seq, Retarget[] retargets, SmoothRoot[] roots)
        {
            double now = 100 + 0.2 * seq;
            player.Receive(message, message.Length, now);
            for (int k = 0; k < Pictures; k++)
            {
                player.Advance(now + 0.2 * k / Pictures);
                for (int n = 0; n < player.Agents.Count; n++)
                {
                    PlayedAgent played = player.Agents[n];
                    retargets[played.Agent.Alias].Pose(played.Frame);
                    roots[played.Agent.Alias].Update(player.Moment, played.Frame, 0);
                }
            }
        }
    }
}
