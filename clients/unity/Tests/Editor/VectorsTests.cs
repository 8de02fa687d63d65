using System;
using System.Collections.Generic;
using System.IO;
using System.Linq;
using Newtonsoft.Json.Linq;
using NUnit.Framework;

namespace Wayfarer.Tests
{
    /// <summary>The vectors that every client decodes: tests/golden/README.md.</summary>
    public class VectorsTests
    {
        private static readonly double[] Identity = { 0, 0, 0, 1 };
        private static readonly JObject Document = Golden.Document("vectors.json");

        public static IEnumerable<TestCaseData> Vectors()
        {
            return Document["vectors"].Select(vector => new TestCaseData(vector).SetName("vector " + vector["name"]));
        }

        [TestCaseSource("Vectors")]
        public void A_vector_is_decoded(JToken vector)
        {
            string name = (string)vector["encoding"];
            var encoding = name == "f32_le" ? PoseEncoding.F32Le : PoseEncoding.SmallestThree;
            int[] bones = vector["bones"].Select(bone => (int)bone).ToArray();
            int[] frames = vector["frames"].Select(frame => (int)frame).ToArray();
            byte[] bytes = Golden.Bytes((string)vector["poses"]);
            Assert.AreEqual((int)vector["frame_bytes"], Poses.FrameBytes(encoding, bones.Length));
            Assert.AreEqual((int)vector["frame_bytes"] * frames.Length, bytes.Length);
            int width = 3 + 4 * bones.Length;
            var found = new float[width * frames.Length];
            Poses.Unpack(bytes, 0, frames.Length, encoding, bones.Length, found);
            JToken wanted = Document["bases"][(string)vector["basis"]];
            double tolerance = (double)Document["tolerance_deg"][name];
            for (int k = 0; k < frames.Length; k++)
            {
                float[] place = Golden.Floats(wanted["translation"][frames[k]]);
                CollectionAssert.AreEqual(place, found.Skip(width * k).Take(3));
                var rotations = (JArray)wanted["rotations"][frames[k]];
                for (int b = 0; b < bones.Length; b++)
                {
                    double[] turn = bones[b] < rotations.Count ? Golden.Doubles(rotations[bones[b]]) : Identity;
                    double off = DegreesBetween(Golden.Part(found, width * k + 3 + 4 * b, 4), turn);
                    Assert.That(off, Is.LessThanOrEqualTo(tolerance), "bone " + bones[b] + " of frame " + frames[k]);
                }
            }
        }

        [Test]
        public void An_encoding_of_a_later_server_is_refused()
        {
            var error = Assert.Throws<InvalidDataException>(() => Poses.FrameBytes((PoseEncoding)9, 22));
            StringAssert.Contains("encoding 9 is not known: this client is older", error.Message);
        }

        public static IEnumerable<TestCaseData> Tiers()
        {
            return Golden.Document("tiers.json")["cases"].Select(own => new TestCaseData(own).SetName("tiers " + own["basis"]));
        }

        [TestCaseSource("Tiers")]
        public void Tiers_with_less_than_all_bones_become_whole_poses(JToken own)
        {
            int[] bones = own["bones"].Select(bone => (int)bone).ToArray();
            var tiers = new List<Tier> { new Tier { Encoding = PoseEncoding.F32Le, SentFps = 40, Bones = bones } };
            tiers.AddRange(own["tiers"].Select(tier => new Tier
            {
                Encoding = (PoseEncoding)(int)tier["encoding"],
                SentFps = (int)tier["sent_fps"],
                Bones = tier["bones"].Select(bone => (int)bone).ToArray(),
            }));
            var unpacker = new TierUnpacker((string)own["basis"], bones, tiers);
            for (int k = 1; k < tiers.Count; k++)
            {
                JToken tier = own["tiers"][k - 1];
                byte[] bytes = Golden.FromHex((string)tier["poses"]);
                int count = bytes.Length / (int)tier["frame_bytes"];
                Assert.AreEqual((int)tier["frame_bytes"], Poses.FrameBytes(tiers[k].Encoding, tiers[k].Bones.Count));
                var found = new float[91 * count];
                unpacker.Unpack(bytes, 0, count, k, found);
                double[] hips = Golden.Doubles(tier["hips"]), rotations = Golden.Doubles(tier["rotations"]);
                for (int frame = 0; frame < count; frame++)
                {
                    for (int n = 0; n < 3; n++)
                    {
                        Golden.Near(found[91 * frame + n], hips[3 * frame + n], 1e-3, "hips of frame " + frame);
                    }
                    for (int bone = 0; bone < 22; bone++)
                    {
                        double[] turn = Golden.Part(found, 91 * frame + 3 + 4 * bone, 4);
                        double[] wanted = Golden.Part(rotations, 88 * frame + 4 * bone, 4);
                        Golden.NearTurn(turn, wanted, 1e-3, "bone " + bone + " of frame " + frame + " of tier " + k);
                    }
                }
            }
        }

        /// <summary>Between two rotations; q and -q are the same one.</summary>
        private static double DegreesBetween(double[] a, double[] b)
        {
            double least = double.PositiveInfinity;
            foreach (int sign in new[] { 1, -1 })
            {
                least = Math.Min(least, Math.Sqrt(a.Zip(b, (x, y) => (x - sign * y) * (x - sign * y)).Sum()));
            }
            return 4 * Math.Asin(least / 2) * 180 / Math.PI;
        }
    }
}
