using System;
using System.Collections.Generic;
using System.Threading.Tasks;
using Newtonsoft.Json.Linq;
using UnityEngine;

namespace Wayfarer
{
    /// <summary>
    /// Makes a character walk: Humanoid, or any rig with legs. It moves the transforms of the bones, and its own object
    /// along with them; it needs no animation clips.
    /// </summary>
    [AddComponentMenu("Wayfarer/Wayfarer Character")]
    [DefaultExecutionOrder(100)]
    [DisallowMultipleComponent]
    public sealed class WayfarerCharacter : MonoBehaviour
    {
        private const float Nudge = 0.25f; // metres that the target moves before the agent is sent again
        private const float Patience = 0.5f; // seconds between two commands that follow the target

        [Tooltip("None: the session that is enabled.")]
        public WayfarerSession session;

        [Tooltip("Id of an existing agent. Empty: an agent is created here, and deleted at the end.")]
        public string agentId = "";

        [Tooltip("Make the agent with this character's proportions, so that its steps fit the character's legs.")]
        public bool fitBody = true;

        [Tooltip("Where it walks to. Move the target, and it follows.")]
        public Transform target;

        [Tooltip("Metres per second, 0.2 to 4.")]
        public float speed = 1.2f;

        [Tooltip("Without a target: it walks about within this many metres of its first place. 0: it stands.")]
        public float wanderRadius;

        [Tooltip("Move this object along, without the sway of the hips: for colliders, cameras, culling.")]
        public bool moveObject = true;

        [Tooltip("Leave the Animator on: for fingers and face. It must not move other bones.")]
        public bool keepAnimator;

        [Tooltip("Height of the soles in the character's file, if it differs from the lowest point of its mesh.")]
        public float soleHeight;

        [Tooltip("Corrections of the found nodes.")]
        public List<BoneChoice> corrections = new List<BoneChoice>();

        private CharacterRig rig;
        private Session seen; // the session that the rest belongs to
        private Task<string> creating;
        private string id = "";
        private PlayedAgent played;
        private Vector3 sentTo;
        private float sentAt = float.NegativeInfinity;

        /// <summary>The map of its bones; null: it is no humanoid.</summary>
        public BoneMap Map => rig == null ? null : rig.Map;

        /// <summary>Id of its agent; "": there is none yet.</summary>
        public string Id => id;

        /// <summary>Its agent, once it is shown; or null.</summary>
        public PlayedAgent Played => played;

        /// <summary>The agent's pose on its bones; null before it is shown.</summary>
        public Retarget Retarget { get; private set; }

        /// <summary>A point on the ground and a heading that do not sway; null before it is shown.</summary>
        public SmoothRoot Root { get; private set; }

        private WayfarerSession Source => session != null ? session : WayfarerSession.Current;

        /// <summary>Send it to a place of the scene; with a yaw (degrees) to face there.</summary>
        /// <exception cref="InvalidOperationException">It has no agent yet: <see cref="Id"/> is empty.</exception>
        public Task GoTo(Vector3 world, float? yaw = null)
        {
            Place place = Source.PlaceOf(world);
            double? heading = null;
            if (yaw.HasValue)
            {
                heading = Math.IEEERemainder(yaw.Value - Source.transform.eulerAngles.y, 360) * Math.PI / 180;
            }
            return Agents().SetPath(id, new Goal(place.X, place.Y, place.Z) { Speed = speed, Heading = heading });
        }

        /// <summary>Make it wander within some metres of a place of the scene.</summary>
        /// <exception cref="InvalidOperationException">It has no agent yet: <see cref="Id"/> is empty.</exception>
        public Task Wander(Vector3 world, float radius)
        {
            return Agents().Wander(id, Source.PlaceOf(world), radius, new JObject { ["speed"] = speed });
        }

        /// <summary>Stop it.</summary>
        /// <exception cref="InvalidOperationException">It has no agent yet: <see cref="Id"/> is empty.</exception>
        public Task Stop()
        {
            return Agents().ClearGoal(id);
        }

        private void Awake()
        {
            var animator = GetComponentInChildren<Animator>();
            try
            {
                rig = new CharacterRig(transform, animator, corrections);
            }
            catch (ArgumentException error)
            {
                Debug.LogError("Wayfarer: " + name + " cannot walk: " + error.Message + ". Set corrections.", this);
                enabled = false;
                return;
            }
            if (animator != null)
            {
                animator.applyRootMotion = false;
                animator.enabled = keepAnimator;
            }
        }

        private void OnDisable()
        {
            if (seen != null && agentId == "" && id != "")
            {
                Watch(seen.Api.DeleteAgent(id), "");
            }
            Forget(null);
        }

        private void LateUpdate()
        {
            Session now = Source == null ? null : Source.Session;
            if (now != seen)
            {
                Forget(now);
            }
            if (seen == null || rig == null)
            {
                return;
            }
            if (played != null && played.Hidden)
            {
                played = null; // it has left the last ring; another comes when it is back
            }
            if (id == "")
            {
                FindId();
            }
            else if (played == null)
            {
                FindAgent();
            }
            if (target != null && id != "")
            {
                FollowTarget();
            }
            if (played != null && played.Shown)
            {
                Pose();
            }
        }

        /// <summary>Begin again after the session has changed or gone.</summary>
        private void Forget(Session next)
        {
            seen = next;
            creating = null;
            id = "";
            played = null;
            sentAt = float.NegativeInfinity;
        }

        private void FindId()
        {
            if (agentId != "")
            {
                id = agentId;
                return;
            }
            if (creating == null)
            {
                creating = Create(seen.Api, seen.Id, Spec());
            }
            if (!creating.IsCompleted)
            {
                return;
            }
            if (creating.Exception != null)
            {
                string reason = creating.Exception.GetBaseException().Message;
                Debug.LogError("Wayfarer: " + name + " has no agent: " + reason, this);
                enabled = false;
                return;
            }
            id = creating.Result;
            if (target == null && wanderRadius > 0)
            {
                Watch(Wander(transform.position, wanderRadius), "does not wander");
            }
        }

        private AgentSpec Spec()
        {
            float yaw = transform.eulerAngles.y - Source.transform.eulerAngles.y;
            return new AgentSpec
            {
                Name = name.Length > 64 ? name.Substring(0, 64) : name,
                Position = Source.PlaceOf(transform.position),
                Heading = yaw * Math.PI / 180,
            };
        }

        private async Task<string> Create(Api api, string sessionId, AgentSpec spec)
        {
            if (fitBody)
            {
                spec.TakeBody(await api.FitBody(new CharacterJoints(rig.Map, Basis.Unity, rig.Soles)).ConfigureAwait(false));
            }
            JArray made = await api.CreateAgents(sessionId, spec).ConfigureAwait(false);
            return (string)made[0]["agent_id"];
        }

        private void FindAgent()
        {
            for (int k = 0; k < seen.Player.Agents.Count; k++)
            {
                PlayedAgent found = seen.Player.Agents[k];
                if (found.Agent.Id != id)
                {
                    continue;
                }
                played = found;
                double floor = soleHeight == 0 ? double.NaN : soleHeight;
                Retarget = new Retarget(rig.Map, found.Agent.RestOffsets, Basis.Unity, floor, rig.Soles);
                Root = new SmoothRoot(Basis.Unity);
            }
        }

        private void FollowTarget()
        {
            bool moved = (target.position - sentTo).sqrMagnitude > Nudge * Nudge;
            if (float.IsNegativeInfinity(sentAt) || (moved && Time.time - sentAt > Patience))
            {
                sentTo = target.position;
                sentAt = Time.time;
                Watch(GoTo(sentTo), "does not go to " + target.name);
            }
        }

        private void Pose()
        {
            Transform space = Source.transform;
            Retarget.Pose(played.Frame);
            Root.Update(seen.Player.Moment, played.Frame, Retarget.Ground);
            if (moveObject)
            {
                IReadOnlyList<double> point = Root.Point;
                var place = new Vector3((float)point[0], (float)point[1], (float)point[2]);
                Quaternion yaw = Quaternion.Euler(0, (float)(Root.Heading * 180 / Math.PI), 0);
                transform.SetPositionAndRotation(space.TransformPoint(place), space.rotation * yaw);
            }
            double[] hips = Retarget.Places;
            rig.Node(Retarget.Node(0)).SetPositionAndRotation(
                space.TransformPoint(new Vector3((float)hips[0], (float)hips[1], (float)hips[2])),
                space.rotation * Turn(Retarget.Rotations, 0));
            IReadOnlyList<int> mapped = Retarget.Mapped;
            for (int n = 1; n < mapped.Count; n++)
            {
                rig.Node(Retarget.Node(mapped[n])).localRotation = Turn(Retarget.Local, 4 * mapped[n]);
            }
            for (int n = 1; n < Retarget.Loose.Count; n++) // bones that hang from another than they follow
            {
                int b = Retarget.Loose[n];
                double[] at = Retarget.Places, turn = Retarget.Rotations;
                rig.Node(Retarget.Node(b)).SetPositionAndRotation(
                    space.TransformPoint(new Vector3((float)at[3 * b], (float)at[3 * b + 1], (float)at[3 * b + 2])),
                    space.rotation * Turn(turn, 4 * b));
            }
        }

        private Api Agents()
        {
            if (id == "")
            {
                throw new InvalidOperationException(name + " has no agent yet");
            }
            return seen.Api;
        }

        /// <summary>Log what went wrong with a call; "": ignore it.</summary>
        private void Watch(Task call, string what)
        {
            call.ContinueWith(
                failed =>
                {
                    string reason = failed.Exception.GetBaseException().Message;
                    if (what != "")
                    {
                        Debug.LogWarning("Wayfarer: agent " + id + " " + what + ": " + reason);
                    }
                },
                TaskContinuationOptions.OnlyOnFaulted);
        }

        private static Quaternion Turn(double[] q, int at)
        {
            return new Quaternion((float)q[at], (float)q[at + 1], (float)q[at + 2], (float)q[at + 3]);
        }
    }
}
