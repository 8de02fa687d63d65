using System.Collections.Generic;
using System.Threading.Tasks;
using Newtonsoft.Json.Linq;
using UnityEngine;

namespace Wayfarer
{
    /// <summary>
    /// Gives every agent of a session a character: agents that it creates itself, a crowd of the server, or those of a
    /// session that another program has made.
    /// </summary>
    [AddComponentMenu("Wayfarer/Wayfarer Spawner")]
    [DefaultExecutionOrder(-50)]
    public sealed class WayfarerSpawner : MonoBehaviour
    {
        [Tooltip("None: the session that is enabled.")]
        public WayfarerSession session;

        [Tooltip("Characters, taken in turn.")]
        public GameObject[] prefabs = new GameObject[0];

        [Tooltip("Agents to create; they walk about around this object. 0: use agents of other programs.")]
        public int count;

        [Tooltip("Radius around this object in which they walk about, metres.")]
        public float radius = 8;

        private readonly Dictionary<string, GameObject> shown = new Dictionary<string, GameObject>();
        private readonly List<string> gone = new List<string>();
        private Session seen;

        /// <summary>Characters, by id of their agent.</summary>
        public IReadOnlyDictionary<string, GameObject> Shown => shown;

        private void Update()
        {
            WayfarerSession source = session != null ? session : WayfarerSession.Current;
            Session now = source == null ? null : source.Session;
            if (now != seen)
            {
                Clear();
                seen = now;
                if (now != null && count > 0)
                {
                    Fill(now, source.PlaceOf(transform.position));
                }
            }
            if (seen != null && prefabs.Length > 0)
            {
                Match(source);
            }
        }

        private void OnDisable()
        {
            Clear();
            seen = null;
        }

        /// <summary>Keep one character for each agent.</summary>
        private void Match(WayfarerSession source)
        {
            IReadOnlyList<PlayedAgent> agents = seen.Player.Agents;
            for (int k = 0; k < agents.Count; k++)
            {
                string id = agents[k].Agent.Id;
                if (!shown.ContainsKey(id))
                {
                    shown[id] = Spawn(source, agents[k].Agent);
                }
            }
            if (shown.Count == agents.Count)
            {
                return;
            }
            gone.Clear();
            gone.AddRange(shown.Keys);
            for (int k = 0; k < agents.Count; k++)
            {
                gone.Remove(agents[k].Agent.Id);
            }
            foreach (string id in gone)
            {
                Destroy(shown[id]);
                shown.Remove(id);
            }
        }

        private GameObject Spawn(WayfarerSession source, Agent agent)
        {
            GameObject made = Instantiate(prefabs[agent.Alias % prefabs.Length], transform);
            made.name = agent.Name == "" ? agent.Id : agent.Name;
            made.SetActive(true);
            WayfarerCharacter character = made.GetComponent<WayfarerCharacter>();
            if (character == null)
            {
                character = made.AddComponent<WayfarerCharacter>();
            }
            character.session = source;
            character.agentId = agent.Id;
            return made;
        }

        private void Fill(Session into, Place middle)
        {
            var specs = new AgentSpec[count];
            for (int k = 0; k < count; k++)
            {
                // on a sunflower's spiral: evenly, and no two at one place
                double away = radius * System.Math.Sqrt((k + 0.5) / count), angle = k * 2.399963 % (2 * System.Math.PI);
                specs[k] = new AgentSpec
                {
                    Gender = k % 2 == 0 ? "female" : "male",
                    Heading = angle,
                    Position = new Place(
                        middle.X + away * System.Math.Sin(angle), middle.Y, middle.Z + away * System.Math.Cos(angle)),
                };
            }
            CreateAll(into, specs, middle).ContinueWith(
                failed => Debug.LogError("Wayfarer: no crowd: " + failed.Exception.GetBaseException().Message),
                TaskContinuationOptions.OnlyOnFaulted);
        }

        private async Task CreateAll(Session into, AgentSpec[] specs, Place middle)
        {
            double reach = radius; // fields of components belong to the main thread
            foreach (string id in await into.CreateAgents(specs).ConfigureAwait(false))
            {
                await into.Api.Wander(id, middle, reach, new JObject()).ConfigureAwait(false);
            }
        }

        private void Clear()
        {
            foreach (GameObject character in shown.Values)
            {
                if (character != null)
                {
                    Destroy(character);
                }
            }
            shown.Clear();
        }
    }
}
