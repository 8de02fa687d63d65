using System;
using System.Collections.Generic;
using System.IO;
using System.Linq;
using System.Text;
using System.Threading.Tasks;
using Newtonsoft.Json;
using Newtonsoft.Json.Linq;

namespace Wayfarer
{
    /// <summary>Where a stream connects.</summary>
    public struct StreamAddress
    {
        public string Url;
        public IReadOnlyList<string> Protocols;
    }

    /// <summary>
    /// The HTTP API as functions. A server's /docs is its reference; results are its JSON. Calls may be made from any
    /// thread. A call that is refused temporarily (429) is sent again after the server's waiting time.
    /// </summary>
    public sealed class Api
    {
        private const double AnswerSeconds = 10;
        private const double BakeSeconds = 60; // for calls that may take the server longer
        private const double PatienceSeconds = 15; // for which a call that is refused temporarily is repeated

        private readonly IHttp http;
        private readonly Func<double, Task> pause;

        /// <param name="server">Its address, as "http://localhost:8080".</param>
        /// <param name="access">The credentials; null: the server asks for no key.</param>
        /// <param name="http">Sends the calls; null: HttpClient.</param>
        /// <param name="pause">Waits a number of seconds; null: Task.Delay.</param>
        /// <exception cref="ArgumentException">That is no address of a server.</exception>
        public Api(string server, Access access = null, IHttp http = null, Func<double, Task> pause = null)
        {
            Uri address;
            if (!Uri.TryCreate(server, UriKind.Absolute, out address) || !address.Scheme.StartsWith("http"))
            {
                throw new ArgumentException("\"" + server + "\" is no address of a server, as http://localhost:8080");
            }
            Server = server.TrimEnd('/');
            Homes = new Homes(Server);
            Access = access ?? new Access();
            this.http = http ?? new Http();
            this.pause = pause ?? (seconds => Task.Delay(TimeSpan.FromSeconds(seconds)));
        }

        public string Server { get; }

        /// <summary>The known nodes of a cluster.</summary>
        public Homes Homes { get; }

        public Access Access { get; }

        /// <summary>A session in a scene, or with "" on an endless floor. Gives <c>session_id</c>, <c>endpoint</c> and more.</summary>
        public async Task<JObject> CreateSession(double leaseSeconds, string scene = "", string basis = "unity")
        {
            var wanted = new JObject { ["basis"] = basis, ["lease_s"] = leaseSeconds };
            Fields.Put(wanted, "scene", string.IsNullOrEmpty(scene) ? null : scene);
            return (JObject)await Call("POST", "/v1/sessions", wanted).ConfigureAwait(false);
        }

        /// <summary>A session's <c>basis</c>, <c>scene</c>, <c>agent_ids</c> and more.</summary>
        public async Task<JObject> Session(string sessionId)
        {
            return (JObject)await Call("GET", Path("sessions", sessionId)).ConfigureAwait(false);
        }

        public Task RenewSession(string sessionId)
        {
            return Call("POST", Path("sessions", sessionId) + "/renew");
        }

        public Task DeleteSession(string sessionId)
        {
            return Call("DELETE", Path("sessions", sessionId));
        }

        /// <summary>The server's version, limits, bases.</summary>
        public async Task<JObject> Info()
        {
            return (JObject)await Call("GET", "/v1/info").ConfigureAwait(false);
        }

        public async Task<JArray> Bodies()
        {
            return (JArray)(await Call("GET", "/v1/bodies").ConfigureAwait(false))["bodies"];
        }

        /// <summary>
        /// The body whose bones are as long as a character's: its <c>gender</c> and <c>betas</c> (for
        /// <see cref="AgentSpec.TakeBody"/>), <c>scale</c>, and by how much <c>lengths</c> differ.
        /// </summary>
        public async Task<JObject> FitBody(CharacterJoints character, string gender = null, string basis = "unity")
        {
            var joints = new JArray();
            for (int bone = 0; bone < Bones.Count; bone++)
            {
                double[] at = character.Place(bone);
                if (at != null)
                {
                    var place = new Place(at[0], at[1], at[2]);
                    joints.Add(new JObject { ["bone"] = Bones.Names[bone], ["position"] = place.Json() });
                }
            }
            var wanted = new JObject { ["joints"] = joints, ["basis"] = basis };
            Fields.Put(wanted, "floor", double.IsNaN(character.Floor) ? (double?)null : character.Floor);
            Fields.Put(wanted, "gender", gender);
            return (JObject)await Call("POST", "/v1/bodies:fit", wanted).ConfigureAwait(false);
        }

        /// <summary>Create agents, all or none; gives <c>agent_id</c>, <c>alias</c>, <c>rest_offsets</c> and more of each.</summary>
        public async Task<JArray> CreateAgents(string sessionId, params AgentSpec[] agents)
        {
            var wanted = new JObject { ["agents"] = new JArray(agents.Select(agent => agent.Json())) };
            JToken reply = await Call("POST", Path("sessions", sessionId) + "/agents", wanted).ConfigureAwait(false);
            return (JArray)reply["agents"];
        }

        public async Task<JArray> Agents(string sessionId)
        {
            return (JArray)(await Call("GET", Path("sessions", sessionId) + "/agents").ConfigureAwait(false))["agents"];
        }

        public Task DeleteAgent(string agentId)
        {
            return Call("DELETE", Path("agents", agentId));
        }

        /// <summary>Send an agent to places in turn.</summary>
        public Task SetPath(string agentId, params Goal[] goals)
        {
            return Call("PUT", Path("agents", agentId) + "/path", Goals(goals));
        }

        /// <summary>Add places to the end of its path.</summary>
        public Task AppendGoals(string agentId, params Goal[] goals)
        {
            return Call("POST", Path("agents", agentId) + "/goals", Goals(goals));
        }

        /// <summary>Make an agent wander within some metres of a place. <paramref name="how"/>: speed … of the API.</summary>
        public Task Wander(string agentId, Place centre, double radius, JObject how = null)
        {
            var area = new JObject { ["center"] = centre.Json(), ["radius"] = radius };
            var wanted = new JObject(how ?? new JObject()) { ["area"] = area };
            return Call("PUT", Path("agents", agentId) + "/wander", wanted);
        }

        /// <summary>Make an agent wander all over its scene.</summary>
        public Task Roam(string agentId, JObject how = null)
        {
            return Call("PUT", Path("agents", agentId) + "/wander", how ?? new JObject());
        }

        /// <summary>Give an agent a behaviour: <c>{"follow": {"agent_id": …}}</c> … (docs/scenes.md).</summary>
        public Task Behave(string agentId, JObject behaviour)
        {
            return Call("PUT", Path("agents", agentId) + "/behaviour", behaviour);
        }

        public Task ClearGoal(string agentId)
        {
            return Call("DELETE", Path("agents", agentId) + "/goal");
        }

        /// <summary>Scenes that come with the server: <c>name</c>, <c>summary</c>.</summary>
        public async Task<JArray> ExampleScenes()
        {
            return (JArray)(await Call("GET", "/v1/scenes/examples").ConfigureAwait(false))["examples"];
        }

        /// <summary>Make one of the server's scenes; gives <c>scene_id</c> and more.</summary>
        public async Task<JObject> CreateExampleScene(string name)
        {
            string path = Path("scenes/examples", name);
            return (JObject)await Call("POST", path, new JObject(), BakeSeconds).ConfigureAwait(false);
        }

        public async Task<JArray> Scenes()
        {
            return (JArray)(await Call("GET", "/v1/scenes").ConfigureAwait(false))["scenes"];
        }

        /// <summary>Place or move an obstacle: <c>{"box": …}</c> … (docs/scenes.md).</summary>
        public Task PutObstacle(string sceneId, string name, JObject obstacle)
        {
            return Call("PUT", Path("scenes", sceneId) + "/obstacles/" + Uri.EscapeDataString(name), obstacle);
        }

        public Task RemoveObstacle(string sceneId, string name)
        {
            return Call("DELETE", Path("scenes", sceneId) + "/obstacles/" + Uri.EscapeDataString(name));
        }

        /// <summary>Populate the session's scene with walking people.</summary>
        public async Task<JObject> Populate(string sessionId, int count)
        {
            string path = Path("sessions", sessionId) + "/crowd";
            return (JObject)await Call("POST", path, new JObject { ["count"] = count }, BakeSeconds).ConfigureAwait(false);
        }

        /// <summary>Statistics of the server.</summary>
        public async Task<JObject> Stats()
        {
            return (JObject)await Call("GET", "/v1/stats").ConfigureAwait(false);
        }

        /// <summary>
        /// Any call of the API. <paramref name="path"/> begins with /v1/; returns null for an empty answer.
        /// </summary>
        /// <exception cref="ApiException">The server refuses, or does not answer.</exception>
        public async Task<JToken> Call(string method, string path, JObject body = null, double seconds = AnswerSeconds)
        {
            double patience = PatienceSeconds;
            var route = new Route(Homes, path);
            for (;;)
            {
                double wait;
                try
                {
                    JToken answer = await Ask(route.Address, method, path, body, seconds).ConfigureAwait(false);
                    route.Answered(Made(answer as JObject));
                    return answer;
                }
                catch (ApiException error)
                {
                    JObject place = error.Problem["endpoint"] as JObject ?? new JObject();
                    if (route.Refused(error.Status, (string)place["host"] ?? "", (int?)place["http_port"] ?? 0))
                    {
                        continue;
                    }
                    wait = error.Status == 429 ? (double?)error.Problem["retry_after_s"] ?? 0 : 0;
                    if (!(wait > 0 && wait <= patience))
                    {
                        throw;
                    }
                }
                patience -= wait;
                await pause(wait).ConfigureAwait(false);
            }
        }

        /// <summary>
        /// Where MotionStream connects. <paramref name="options"/>: <c>encoding</c>, <c>fps</c> … of the query of WS /v1/stream.
        /// </summary>
        public StreamAddress StreamAddress(
            string sessionId, IReadOnlyDictionary<string, string> options = null, string resumeToken = "")
        {
            var query = new StringBuilder("session=" + Uri.EscapeDataString(sessionId));
            foreach (KeyValuePair<string, string> pair in options ?? new Dictionary<string, string>())
            {
                query.Append('&').Append(Uri.EscapeDataString(pair.Key)).Append('=').Append(Uri.EscapeDataString(pair.Value));
            }
            if (!string.IsNullOrEmpty(resumeToken))
            {
                query.Append("&resume_token=").Append(Uri.EscapeDataString(resumeToken));
            }
            string url = "ws" + Homes.Home(sessionId).Substring("http".Length) + "/v1/stream?" + query;
            return new StreamAddress { Url = url, Protocols = Access.Protocols };
        }

        /// <summary>The id of the session or scene that an answer has created, or "".</summary>
        private static string Made(JObject answer)
        {
            return answer == null ? "" : (string)answer["session_id"] ?? (string)answer["scene_id"] ?? "";
        }

        private async Task<JToken> Ask(string server, string method, string path, JObject body, double seconds)
        {
            var call = new HttpCall
            {
                Method = method,
                Url = server + path,
                Body = body == null ? null : body.ToString(Formatting.None),
                Authorization = Access.Header,
                Seconds = seconds,
            };
            HttpReply reply;
            try
            {
                reply = await http.Send(call).ConfigureAwait(false);
            }
            catch (Exception error)
            {
                string reason = error.GetBaseException().Message;
                throw new ApiException("the server does not answer (" + reason + ")", 0, null, error);
            }
            if (reply.Status < 200 || reply.Status > 299)
            {
                throw Refusal(reply);
            }
            return string.IsNullOrEmpty(reply.Body) ? null : Parse(reply.Body);
        }

        private static string Path(string kind, string id)
        {
            return "/v1/" + kind + "/" + Uri.EscapeDataString(id);
        }

        private static JObject Goals(Goal[] goals)
        {
            return new JObject { ["goals"] = new JArray(goals.Select(goal => goal.Json())) };
        }

        /// <summary>The text of an RFC 9457 problem document with its fields, or the bare status.</summary>
        private static ApiException Refusal(HttpReply reply)
        {
            string bare = "HTTP " + reply.Status;
            JObject problem;
            try
            {
                problem = Parse(reply.Body ?? "") as JObject;
            }
            catch (JsonException)
            {
                problem = null; // a proxy's page
            }
            if (problem == null)
            {
                return new ApiException(bare, reply.Status);
            }
            JArray errors = problem["errors"] as JArray ?? new JArray();
            string fields = string.Join("; ", errors.Select(error => error["field"] + ": " + error["detail"]).ToArray());
            string said = fields != "" ? fields : (string)problem["detail"] ?? (string)problem["title"] ?? bare;
            return new ApiException(said, reply.Status, problem);
        }

        private static JToken Parse(string text)
        {
            using (var reader = new JsonTextReader(new StringReader(text)) { DateParseHandling = DateParseHandling.None })
            {
                return JToken.ReadFrom(reader);
            }
        }
    }
}
