// The package's components against a live server, on stub transforms: one agent walks to a goal on characters of four
// kinds, whose bones are read back; then the sample's crowd walks about.
//   mono Live.exe http://localhost:8080 tests/golden/retarget.json
using System;
using System.Collections.Generic;
using System.IO;
using System.Linq;
using System.Threading;
using Newtonsoft.Json.Linq;
using UnityEngine;
using Wayfarer;
using Wayfarer.Samples;

internal static class Live
{
    private const float Away = 2.5f; // metres from where it begins to its target
    private const double Patience = 60; // seconds

    private static readonly string[] Kinds = { "unity", "a_pose", "centimetres", "vrm1" }; // the last one as a Humanoid
    private static readonly List<Walker> Walkers = new List<Walker>();

    private static void Main(string[] arguments)
    {
        JToken cases = JObject.Parse(File.ReadAllText(arguments[1]))["cases"];
        var origin = new GameObject("agents' world"); // elsewhere in the scene, and turned
        origin.transform.SetPositionAndRotation(new Vector3(10, 2, -5), Quaternion.Euler(0, 90, 0));
        var session = origin.AddComponent<WayfarerSession>();
        session.server = arguments[0];
        var target = new GameObject("target").transform;
        var start = new Vector3(11, 2, -4);
        target.position = start + new Vector3(0.6f * Away, 0, 0.8f * Away);

        foreach (string kind in Kinds)
        {
            var walker = new Walker(cases.First(found => (string)found["name"] == kind));
            walker.Character.transform.SetPositionAndRotation(start, Quaternion.Euler(0, 30, 0));
            Walkers.Add(walker);
        }
        WayfarerCharacter first = Walkers[0].Character;
        first.target = target;
        foreach (Walker walker in Walkers.Skip(1))
        {
            walker.Character.enabled = false; // until there is an agent
        }
        Until(() => first.Id != "", () => { }, "no agent");
        foreach (Walker walker in Walkers.Skip(1))
        {
            walker.Character.agentId = first.Id;
            walker.Character.enabled = true;
        }
        double arrived = double.PositiveInfinity;
        session.Happened += told => arrived = told.Kind == EventKind.PathDone ? told.At : arrived;
        var headers = new List<bool>();
        session.Session.Player.HeaderReceived += (header, again) => headers.Add(header.Resumed);
        double lostAt = Clock.Now + 1;
        Until(
            () => session.Session.Player.Moment > arrived + 0.5 && first.Played.Track.Contacts == 3,
            () =>
            {
                if (Clock.Now > lostAt)
                {
                    session.Session.Stream.Reconnect("the test has cut it", Clock.Now);
                    lostAt = double.PositiveInfinity;
                }
                Walkers.ForEach(walker => walker.Look());
            },
            "it has not arrived");
        Must(headers.Contains(true), "the stream was resumed");
        Walkers.ForEach(walker => walker.Check(target.position));
        PlayerStats stats = session.Session.Player.Stats;
        Must(stats.Gaps == 0, "no gap");
        Console.WriteLine("messages " + stats.Messages + ", underruns " + session.Session.Player.Underruns);
        Quiet();
        Stage.Clear();

        CrowdWalks(arguments[0]);
        Quiet();
        Stage.Clear();
        Thread.Sleep(500); // for the deletion of the session
    }

    private static void CrowdWalks(string server)
    {
        const int People = 5;
        var crowd = new GameObject("crowd").AddComponent<Crowd>();
        crowd.server = server;
        crowd.people = People;
        crowd.radius = 4;
        WayfarerCharacter[] shown = { };
        Until(
            () =>
            {
                shown = crowd.GetComponentsInChildren<WayfarerCharacter>(false);
                return shown.Length == People && shown.All(each => each.Retarget != null);
            },
            () => { },
            "the crowd has not come");
        Vector3[] before = shown.Select(each => each.transform.position).ToArray();
        Until(
            () => shown.Where((each, k) => (each.transform.position - before[k]).magnitude > 0.5f).Count() >= 3,
            () => { },
            "the crowd stands");
        Console.WriteLine("crowd: " + People + " people walk about");
    }

    private static void Until(Func<bool> done, Action each, string failure)
    {
        double end = Clock.Now + Patience;
        while (!done())
        {
            Must(Clock.Now < end, failure);
            Thread.Sleep(16);
            Stage.Frame();
            each();
        }
    }

    private static void Quiet()
    {
        lock (UnityEngine.Debug.Said)
        {
            string[] bad = UnityEngine.Debug.Said.Where(said => !said.StartsWith("log")).ToArray();
            Must(bad.Length == 0, string.Join("\n", bad));
        }
    }

    private static void Must(bool right, string what)
    {
        if (!right)
        {
            Console.Error.WriteLine("FAILED: " + what);
            lock (UnityEngine.Debug.Said)
            {
                UnityEngine.Debug.Said.ForEach(Console.Error.WriteLine);
            }
            Environment.Exit(1);
        }
    }

    /// <summary>A character of a golden case, as transforms.</summary>
    private sealed class Walker
    {
        private readonly string kind;
        private readonly Transform hips;
        private readonly Transform[] ankles;
        private float most; // height of a standing foot's ankle

        public Walker(JToken found)
        {
            kind = (string)found["name"];
            float mirror = (string)found["basis"] == "unity" ? 1 : -1; // of a glTF rig: x is the other way
            var root = new GameObject(kind);
            var made = new List<Transform>();
            foreach (JToken node in found["nodes"])
            {
                Transform bone = new GameObject((string)node["name"]).transform;
                float[] p = Numbers(node["position"]), q = Numbers(node["rotation"]), s = Numbers(node["scale"]);
                bone.SetParent((int)node["parent"] < 0 ? root.transform : made[(int)node["parent"]], false);
                bone.localPosition = new Vector3(mirror * p[0], p[1], p[2]);
                bone.localRotation = new Quaternion(q[0], mirror * q[1], mirror * q[2], q[3]);
                bone.localScale = new Vector3(s[0], s[1], s[2]);
                made.Add(bone);
            }
            if (found["humanoid"].Type != JTokenType.Null)
            {
                var animator = root.AddComponent<Animator>();
                foreach (JProperty pair in ((JObject)found["humanoid"]).Properties())
                {
                    string name = char.ToUpperInvariant(pair.Name[0]) + pair.Name.Substring(1);
                    var bone = (HumanBodyBones)Enum.Parse(typeof(HumanBodyBones), name);
                    animator.Human[bone] = made[(int)pair.Value];
                }
            }
            Character = root.AddComponent<WayfarerCharacter>();
            Must(Character.Map.FoundBy == (found["humanoid"].Type == JTokenType.Null ? "names" : "vrm"), kind + ": map");
            Func<string, Transform> bones = bone => made.First(node => node.name == (string)found["map"][bone]);
            hips = bones("pelvis");
            ankles = new[] { bones("left_ankle"), bones("right_ankle") };
        }

        public WayfarerCharacter Character { get; }

        public void Look()
        {
            if (Character.Retarget == null)
            {
                return;
            }
            for (int leg = 0; leg < 2; leg++)
            {
                if ((Character.Played.Track.Contacts & (1 << leg)) != 0)
                {
                    most = Math.Max(most, ankles[leg].position.y - 2);
                }
            }
        }

        public void Check(Vector3 goal)
        {
            Vector3 off = hips.position - goal;
            float high = off.y, wanted = (float)Character.Retarget.Ratio * Character.Played.Frame[1];
            off.y = 0;
            Must(off.magnitude < 0.5, kind + ": hips " + off.magnitude + " m from the goal");
            // the ratio is that of the thigh joints, and hips sink a little for short legs
            Must(Math.Abs(high / wanted - 1) < 0.04, kind + ": hips " + high + " m high in place of " + wanted);
            foreach (Transform ankle in ankles)
            {
                float ankleHigh = ankle.position.y - goal.y;
                Must(ankleHigh > 0.03 && ankleHigh < 0.2, kind + ": ankle " + ankleHigh + " m high");
            }
            Must(most < 0.3 && most > 0.03, kind + ": a standing foot's ankle " + most + " m high");
            Vector3 beside = Character.transform.position - hips.position;
            Must(Math.Abs(Character.transform.position.y - goal.y) < 0.02, kind + ": its object is on the ground");
            beside.y = 0;
            Must(beside.magnitude < 0.15, kind + ": its object is " + beside.magnitude + " m beside the hips");
            Console.WriteLine(kind + ": walked to " + hips.position.x + ", " + hips.position.z);
        }

        private static float[] Numbers(JToken values)
        {
            return values.Select(value => (float)value).ToArray();
        }
    }
}
