using System;
using System.Collections.Generic;
using System.Linq;
using Newtonsoft.Json.Linq;
using NUnit.Framework;

namespace Wayfarer.Tests
{
    /// <summary>Bones of characters and poses on them: the traces that every client follows, and more.</summary>
    public class RetargetTests
    {
        private static readonly JObject Document = Golden.Document("retarget.json");
        private static readonly JToken Own = Document["cases"][0];

        public static IEnumerable<TestCaseData> Cases()
        {
            return Document["cases"].Select(found => new TestCaseData(found).SetName("retarget " + found["name"]));
        }

        public static IEnumerable<TestCaseData> ForeignRigs()
        {
            return ((JObject)Golden.Document("foreign_rigs.json")["rigs"]).Properties()
                .Select(rig => new TestCaseData(rig.Value).SetName("foreign rig " + rig.Name));
        }

        [TestCaseSource("Cases")]
        public void A_character_stands_where_the_trace_says(JToken wanted)
        {
            Basis basis = Basis.Of((string)wanted["basis"]);
            BoneMap map = Map(wanted);
            Assert.AreEqual((string)wanted["found_by"], map.FoundBy);
            CollectionAssert.AreEquivalent(wanted["map"].ToObject<Dictionary<string, string>>(), map.Table());
            Retarget retarget = Of(wanted, map);
            string[] loose = retarget.Loose.Select(b => Bones.Names[b]).ToArray();
            CollectionAssert.AreEqual(((JObject)wanted["poses"][0]["moved"]).Properties().Select(each => each.Name).ToArray(), loose);
            Golden.Near(retarget.Ratio, (double)wanted["ratio"], 1e-5, "ratio");
            double unit = basis.Name.StartsWith("unreal") ? 100 : 1;
            EachFrame(basis, (k, frame) =>
            {
                retarget.Pose(frame);
                JToken pose = wanted["poses"][k];
                for (int b = 0; b < Bones.Count; b++)
                {
                    string bone = Bones.Names[b];
                    Assert.AreEqual(pose["places"][bone] != null, retarget.Node(b) >= 0, bone);
                    if (retarget.Node(b) < 0)
                    {
                        continue;
                    }
                    double[] place = Golden.Doubles(pose["places"][bone]);
                    for (int n = 0; n < 3; n++)
                    {
                        Golden.Near(retarget.Places[3 * b + n], place[n], 1e-4 * unit, bone + " of frame " + k);
                    }
                    double[] turn = Golden.Doubles(pose["rotations"][bone]);
                    Golden.NearTurn(Golden.Part(retarget.Rotations, 4 * b, 4), turn, 1e-4, bone + " of frame " + k);
                    for (int n = 0; n < 3 && pose["moved"][bone] != null; n++)
                    {
                        double within = 1e-4 * ((string)wanted["name"] == "centimetres" ? 100 : unit);
                        Golden.Near(retarget.Moved[3 * b + n], (double)pose["moved"][bone][n], within, bone + " of frame " + k);
                    }
                }
            });
        }

        [TestCaseSource("Cases")]
        public void Local_rotations_give_the_same_places_through_the_nodes(JToken wanted)
        {
            Basis basis = Basis.Of((string)wanted["basis"]);
            Retarget retarget = Of(wanted, Map(wanted));
            EachFrame(basis, (k, frame) =>
            {
                retarget.Pose(frame);
                RigNode[] posed = Golden.Nodes(wanted["nodes"]).ToArray();
                foreach (int b in retarget.Mapped)
                {
                    posed[retarget.Node(b)].Rotation = Golden.Part(retarget.Local, 4 * b, 4);
                }
                foreach (int b in retarget.Loose)
                {
                    posed[retarget.Node(b)].Position = Golden.Part(retarget.Moved, 3 * b, 3);
                }
                var rig = new Rig(posed);
                foreach (int b in retarget.Mapped)
                {
                    double[] place = rig.Place(retarget.Node(b));
                    for (int n = 0; n < 3; n++)
                    {
                        Golden.Near(place[n], retarget.Places[3 * b + n], 1e-6 * Math.Max(1, Math.Abs(place[n])), Bones.Names[b]);
                    }
                }
            });
        }

        [TestCaseSource("ForeignRigs")]
        public void No_bone_of_a_foreign_rig_is_missing(JToken bones)
        {
            double half = Math.Sqrt(0.5);
            var nodes = new List<RigNode> { new RigNode { Name = "Armature", Parent = -1, Rotation = new[] { -half, 0, 0, half } } };
            foreach (JToken bone in bones)
            {
                int parent = (int)bone[1];
                double[] above = parent < 0 ? new double[3] : Golden.Doubles(bones[parent][2]);
                double[] head = Golden.Doubles(bone[2]);
                nodes.Add(new RigNode
                {
                    Name = (string)bone[0],
                    Parent = parent + 1,
                    Position = head.Zip(above, (a, b) => a - b).ToArray(),
                });
            }
            BoneMap map = BoneMap.Of(new Rig(nodes), null, Basis.Gltf);
            Assert.AreEqual("names", map.FoundBy);
            CollectionAssert.IsEmpty(map.Missing);
        }

        [Test]
        public void Rest_is_what_the_skin_was_bound_to()
        {
            RigNode[] bound = Golden.Nodes(Own["nodes"]).ToArray();
            var rig = new Rig(bound);
            int[] joints = Enumerable.Range(1, bound.Length - 1).ToArray();
            var skin = new Skin
            {
                Joints = joints,
                Space = Skins.Local(new RigNode()),
                Inverses = joints.Select(k => Skins.Local(new RigNode { Position = rig.Place(k).Select(x => -x).ToArray() })).ToArray(),
                Vertices = new double[] { 0.1, 0.2, 0.3 },
                Movers = new[] { 3 },
            };
            for (int k = 1; k < bound.Length; k++)
            {
                Golden.Near(Math.Abs(rig.Rotation(k)[3]), 1, 1e-6, "the case has bones without turns");
            }
            RigNode[] posed = Golden.Nodes(Own["nodes"]).ToArray();
            CollectionAssert.AreEqual(posed, Skins.Bound(posed, new[] { skin }));
            posed[1].Position = new[] { 0.3, 0.4, 0.2 };
            posed[2].Rotation = new[] { 0.6, 0, 0, 0.8 };
            var rest = new Rig(Skins.Bound(posed, new[] { skin }));
            for (int k = 1; k < bound.Length; k++)
            {
                for (int n = 0; n < 3; n++)
                {
                    Golden.Near(rest.Place(k)[n], rig.Place(k)[n], 1e-6, rig.Name(k));
                }
            }
            var places = new List<double>();
            var movers = new List<int>();
            Skins.Points(bound, new[] { skin }, places, movers);
            CollectionAssert.AreEqual(new[] { joints[3] }, movers);
            Golden.Near(places[0], 0.1, 1e-6, "x of a vertex");
        }

        public static IEnumerable<TestCaseData> Creatures()
        {
            return Document["refused"].Select(found => new TestCaseData(found).SetName("refused " + found["name"]));
        }

        [TestCaseSource("Creatures")]
        public void What_cannot_walk_on_two_legs_is_refused(JToken refused)
        {
            var rig = new Rig(Golden.Nodes(refused["nodes"]));
            var error = Assert.Throws<ArgumentException>(() => BoneMap.Of(rig, null, Basis.Gltf));
            StringAssert.Contains((string)refused["says"], error.Message);
        }

        [Test]
        public void Feet_stand_at_a_height_that_is_given_also_on_stairs()
        {
            Retarget retarget = Of(Own, Map(Own));
            float[] frame = Frame(Basis.Gltf, 0);
            retarget.Pose(frame, 0);
            var ground = (double[])retarget.Places.Clone();
            frame[1] += 3;
            retarget.Pose(frame, 3);
            for (int k = 0; k < ground.Length; k++)
            {
                Golden.Near(retarget.Places[k] - ground[k], k % 3 == 1 ? 3 : 0, 1e-6, Bones.Names[k / 3]);
            }
        }

        [Test]
        public void A_map_can_be_shown_and_corrected()
        {
            BoneMap map = Map(Own);
            Assert.AreEqual("left_knee", map.Table()["left_knee"]);
            CollectionAssert.IsEmpty(map.Missing);
            BoneMap other = map.Corrected(new Dictionary<string, string> { ["spine2"] = null, ["neck"] = "head", ["head"] = null });
            CollectionAssert.AreEqual(new[] { "spine2", "head" }, other.Missing);
            Assert.AreEqual("user", other.FoundBy);
            Assert.AreEqual("head", other.Table()["neck"]);
            Refused(map, "no node \"nose\"", "head", "nose");
            Refused(map, "\"tail\" is no bone", "tail", "head");
            Refused(map, "no node was found for left_knee, neither", "left_knee", null);
            Refused(map, "left_knee: \"head\" is head, too", "left_knee", "head");
            Refused(map, "spine3: \"head\" is head, too", "spine3", "head");
        }

        [Test]
        public void A_map_that_failed_is_completed_by_corrections()
        {
            Rig named = Map(Own).Rig;
            var rig = new Rig(Enumerable.Range(0, named.Count).Select(k => new RigNode // nor by shape
            {
                Name = named.Name(k).Replace("left_knee", "x"), Parent = named.Parent(k),
            }).ToArray());
            var error = Assert.Throws<ArgumentException>(() => BoneMap.Of(rig, null, Basis.Gltf));
            StringAssert.Contains("no node was found for left_knee, neither", error.Message);
            int knee = Enumerable.Range(0, rig.Count).Single(k => rig.Name(k) == "x");
            BoneMap found = BoneMap.Of(rig, null, Basis.Gltf, new Dictionary<string, int> { ["left_knee"] = knee });
            Assert.AreEqual("user", found.FoundBy);
            CollectionAssert.IsEmpty(found.Missing);
        }

        [Test]
        public void What_is_no_humanoid_is_refused_in_words()
        {
            var table = new Rig(new[]
            {
                new RigNode { Name = "table", Parent = -1 },
                new RigNode { Name = "leg1", Parent = 0, Position = new double[] { 0, -1, 0 } },
                new RigNode { Name = "leg2", Parent = 0, Position = new double[] { 1, -1, 0 } },
            });
            var error = Assert.Throws<ArgumentException>(() => BoneMap.Of(table, null, Basis.Unity));
            StringAssert.Contains("no node was found for pelvis, left_hip", error.Message);
            error = Assert.Throws<ArgumentException>(() => BoneMap.Of(new Rig(new RigNode[0]), null, Basis.Unity));
            StringAssert.Contains("neither by names nor by shape", error.Message);
            error = Assert.Throws<ArgumentException>(() => new Rig(new[] { new RigNode { Name = "a" } }));
            StringAssert.Contains("node 0 (a): its parent must stand before it", error.Message);
            error = Assert.Throws<ArgumentException>(() => new Retarget(Map(Own), new double[3], Basis.Gltf));
            StringAssert.Contains("rest offsets of 22 bones", error.Message);
        }

        [Test]
        public void A_heading_is_0_forwards_and_grows_as_a_turn_about_up_does()
        {
            foreach (Basis basis in Basis.All)
            {
                foreach (double angle in new[] { 0, 1, -2, 3.0 })
                {
                    double s = Math.Sin(angle / 2);
                    double found = basis.HeadingOf(s * basis.Up[0], s * basis.Up[1], s * basis.Up[2], Math.Cos(angle / 2));
                    Golden.Near(found, angle, 1e-9, basis.Name);
                }
            }
            Assert.AreEqual(new[] { 1, -1, -1, -1, 1, 1 }, Basis.All.Select(basis => (int)basis.Handed).ToArray());
            Assert.Throws<ArgumentException>(() => Basis.Of("maya"));
        }

        internal static BoneMap Map(JToken found)
        {
            var rig = new Rig(Golden.Nodes(found["nodes"]));
            return BoneMap.Of(rig, Golden.Humanoid(found["humanoid"]), Basis.Of((string)found["basis"]));
        }

        internal static Retarget Of(JToken found, BoneMap map)
        {
            string basis = (string)found["basis"];
            double[] offsets = Golden.Doubles(Document["walk"][basis]["rest_offsets"]);
            Soles soles = null;
            if (found["mesh"].HasValues)
            {
                double[] places = found["mesh"]["places"].SelectMany(place => Golden.Doubles(place)).ToArray();
                soles = Soles.Measure(map, places, found["mesh"]["nodes"].ToObject<int[]>(), Basis.Of(basis));
                Golden.Near(soles.Floor, (double)found["floor"], 1e-5, "floor");
            }
            return new Retarget(map, offsets, Basis.Of(basis), double.NaN, soles);
        }

        private static void Refused(BoneMap map, string said, string bone, string node)
        {
            var changes = new Dictionary<string, string> { [bone] = node };
            StringAssert.Contains(said, Assert.Throws<ArgumentException>(() => map.Corrected(changes)).Message);
        }

        private static void EachFrame(Basis basis, Action<int, float[]> check)
        {
            for (int k = 0; k < Document["walk"][basis.Name]["hips"].Count(); k++)
            {
                check(k, Frame(basis, k));
            }
        }

        private static float[] Frame(Basis basis, int k)
        {
            JToken walk = Document["walk"][basis.Name];
            return Golden.Floats(walk["hips"][k], walk["rotations"][k]);
        }
    }
}
