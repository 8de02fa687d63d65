using System;
using System.Collections.Generic;
using System.Threading.Tasks;
using Newtonsoft.Json.Linq;
using UnityEngine;

namespace Wayfarer
{
    /// <summary>
    /// A connection to a server, for walking people. This object's transform is the origin of their world (its scale
    /// must be 1). Characters find the session by themselves.
    /// </summary>
    [AddComponentMenu("Wayfarer/Wayfarer Session")]
    [DefaultExecutionOrder(-100)]
    [DisallowMultipleComponent]
    public sealed class WayfarerSession : MonoBehaviour
    {
        private const double RetrySeconds = 3;

        private static readonly string[] Seen = // bones of a person in the middle ring
        {
            "pelvis", "left_hip", "right_hip", "left_knee", "right_knee", "left_ankle", "right_ankle", "spine1", "spine2",
            "spine3", "neck", "head", "left_shoulder", "right_shoulder", "left_elbow", "right_elbow",
        };

        [Tooltip("Address of the server.")]
        public string server = "http://localhost:8080";

        [Tooltip("API key or JWT, for a server that asks for one. Anyone with your build can read it.")]
        public string token = "";

        [Tooltip("Id of a scene of the server. Empty: an endless floor.")]
        public string scene = "";

        [Tooltip("Id of a session that your program has made, in Unity's basis. Empty: it makes one.")]
        public string join = "";

        [Tooltip("Frames per second that are sent: 40, 20 or 10.")]
        public int fps = 20;

        [Tooltip("Levels of detail: all of an agent within this many metres of the viewpoint. 0: everywhere, and no rings.")]
        public float near;

        [Tooltip("Fewer frames and bones within this many metres. 0: no such ring.")]
        public float middle;

        [Tooltip("Only place, heading and gait within this many metres, and no agents beyond. 0: no such ring.")]
        public float far;

        [Tooltip("The viewpoint of the agents. Empty: the main camera.")]
        public Transform viewpoint;

        private Task<Session> opening;
        private double retryAt;

        /// <summary>A session has begun; after a restart of the server, another one.</summary>
        public event Action<Session> Opened;

        /// <summary>An agent is new.</summary>
        public event Action<PlayedAgent> AgentAdded;

        public event Action<PlayedAgent> AgentRemoved;

        /// <summary>An event: a goal is reached, a way is blocked, and others.</summary>
        public event Action<MotionEvent> Happened;

        /// <summary>The session that was enabled last, or null; characters without a session use it.</summary>
        public static WayfarerSession Current { get; private set; }

        /// <summary>The client behind it; null while there is none.</summary>
        public Session Session { get; private set; }

        /// <summary>Another socket, if .NET has none (WebGL). Set it before the component is enabled.</summary>
        public Func<ISocket> NewSocket { get; set; }

        /// <summary>Another HTTP client, if HttpClient does not work (WebGL).</summary>
        public IHttp Http { get; set; }

        /// <summary>A place of the scene in the agents' world.</summary>
        public Place PlaceOf(Vector3 world)
        {
            Vector3 local = transform.InverseTransformPoint(world);
            return new Place(local.x, local.y, local.z);
        }

        private void OnEnable()
        {
            Current = this;
            retryAt = 0;
        }

        private void OnDisable()
        {
            if (Current == this)
            {
                Current = null;
            }
            if (opening != null)
            {
                opening.ContinueWith(late => late.Result.Close(), TaskContinuationOptions.OnlyOnRanToCompletion);
                opening.ContinueWith(late => late.Exception, TaskContinuationOptions.OnlyOnFaulted);
                opening = null;
            }
            Leave();
        }

        private void Update()
        {
            if (Session == null)
            {
                Open();
            }
            if (Session != null)
            {
                Session.Update();
                Look();
            }
        }

        private void Look()
        {
            Transform eye = viewpoint != null ? viewpoint : Camera.main != null ? Camera.main.transform : null;
            if (Session != null && near > 0 && eye != null)
            {
                Place place = PlaceOf(eye.position);
                Session.Look(Math.Round(place.X, 1), Math.Round(place.Y, 1), Math.Round(place.Z, 1));
            }
        }

        private JObject Rings()
        {
            if (near <= 0)
            {
                return null;
            }
            var rings = new JArray { new JObject { ["radius"] = near } };
            if (middle > near)
            {
                var fewer = new JObject
                {
                    ["encoding"] = "smallest_three",
                    ["fps"] = 20,
                    ["profile"] = "bones",
                    ["bones"] = new JArray(Seen),
                };
                rings.Add(new JObject { ["radius"] = middle, ["format"] = fewer });
            }
            if (far > Math.Max(near, middle))
            {
                rings.Add(new JObject { ["radius"] = far, ["format"] = new JObject { ["encoding"] = "root" } });
            }
            var origin = new JObject { ["x"] = 0, ["y"] = 0, ["z"] = 0 };
            return new JObject { ["rings"] = rings, ["viewpoints"] = new JArray { new JObject { ["position"] = origin } } };
        }

        private void Open()
        {
            if (opening == null && Clock.Now >= retryAt)
            {
                SessionOptions options = Options();
                opening = join == ""
                    ? Session.Open(server, options)
                    : Task.FromResult(Session.Join(server, join, options));
            }
            if (opening == null || !opening.IsCompleted)
            {
                return;
            }
            Task<Session> done = opening;
            opening = null;
            if (done.Exception != null)
            {
                string reason = done.Exception.GetBaseException().Message;
                Debug.LogError("Wayfarer: no session of " + server + ": " + reason, this);
                retryAt = Clock.Now + RetrySeconds;
                return;
            }
            Begin(done.Result);
        }

        private void Begin(Session session)
        {
            Session = session;
            session.Player.AgentAdded += played => AgentAdded?.Invoke(played);
            session.Player.AgentRemoved += played => AgentRemoved?.Invoke(played);
            session.Player.EventReceived += told => Happened?.Invoke(told);
            session.Player.HeaderReceived += CheckBasis;
            session.Stream.Ended += reason => Lose("has ended: " + reason);
            session.Stream.Refused += reason => Lose("was refused: " + reason);
            session.Stream.Failed += reason => Lose("has failed: " + reason);
            Debug.Log("Wayfarer: session " + session.Id + "; to watch it in a browser: " + session.ViewerUrl, this);
            Opened?.Invoke(session);
        }

        /// <summary>Begin another session after a while: the server may have restarted.</summary>
        private void Lose(string what)
        {
            Debug.LogWarning("Wayfarer: session " + Session.Id + " " + what, this);
            retryAt = Clock.Now + RetrySeconds;
            Leave();
        }

        private void Leave()
        {
            if (Session != null)
            {
                Session left = Session;
                Session = null;
                left.Close();
            }
        }

        private void CheckBasis(Header header, bool again)
        {
            if (header.BasisName != Basis.Unity.Name)
            {
                Debug.LogError("Wayfarer: the session has the basis " + header.BasisName + ", not unity", this);
            }
        }

        private SessionOptions Options()
        {
            return new SessionOptions
            {
                Token = token,
                Scene = scene,
                NewSocket = NewSocket,
                Http = Http,
                Interest = Rings(),
                Query = new Dictionary<string, string> { ["encoding"] = "smallest_three", ["fps"] = fps.ToString() },
            };
        }
    }
}
