using System;
using System.Collections.Generic;
using System.Linq;
using System.Threading.Tasks;
using Newtonsoft.Json.Linq;

namespace Wayfarer
{
    /// <summary>Options of a session; all have useful defaults.</summary>
    public sealed class SessionOptions
    {
        /// <summary>An API key or a JWT, for a server that asks for one.</summary>
        public string Token { get; set; } = "";

        /// <summary>Id of a scene; "": an endless floor.</summary>
        public string Scene { get; set; } = "";

        public string Basis { get; set; } = "unity";

        /// <summary>Time that the session outlives its last sign of life.</summary>
        public double LeaseSeconds { get; set; } = 60;

        /// <summary>Encoding, fps and others of the stream (docs/wire-format.md, "Asking for a stream").</summary>
        public IReadOnlyDictionary<string, string> Query { get; set; } =
            new Dictionary<string, string> { ["encoding"] = "smallest_three", ["fps"] = "20" };

        /// <summary>
        /// Levels of detail (docs/wire-format.md), as JSON: <c>{"rings": [{"radius": 15}, …], "viewpoints": [{"position":
        /// {"x": 0, "y": 1.7, "z": 0}}]}</c>; null: none. <see cref="Session.Look"/> moves the viewpoints.
        /// </summary>
        public JObject Interest { get; set; }

        /// <summary>Another HTTP client (WebGL), or null.</summary>
        public IHttp Http { get; set; }

        /// <summary>Another socket (WebGL), or null.</summary>
        public Func<ISocket> NewSocket { get; set; }

        /// <summary>The clock, in seconds, that never goes back.</summary>
        public Func<double> Now { get; set; } = () => Clock.Now;
    }

    /// <summary>
    /// A session of a server: made, kept alive, streamed and played. Use it from one thread, except for the awaited
    /// calls.
    /// </summary>
    public sealed class Session
    {
        private const double RenewalsPerLease = 3;

        private readonly SessionOptions options;
        private readonly bool own;
        private readonly JObject interest;
        private double renewAt;
        private Task renewal;
        private bool renewing;

        private Session(Api api, string id, SessionOptions options, bool own)
        {
            Api = api;
            Id = id;
            this.options = options;
            this.own = renewing = own;
            interest = (JObject)options.Interest?.DeepClone();
            var route = new Route(api.Homes, id);
            Stream = new MotionStream(token => api.StreamAddress(id, Query(), token), Player, options.NewSocket, route);
            renewAt = options.Now() + options.LeaseSeconds / RenewalsPerLease;
        }

        public Api Api { get; }

        public string Id { get; }

        /// <summary>All agents, their events, and statistics.</summary>
        public MotionPlayer Player { get; } = new MotionPlayer();

        /// <summary>The connection.</summary>
        public MotionStream Stream { get; }

        /// <summary>The page of the server that shows this session.</summary>
        public string ViewerUrl => Api.Homes.Home(Id) + "/?session=" + Uri.EscapeDataString(Id);

        /// <summary>
        /// A session of your own. It ends when you close it, or with its lease after your program.
        /// </summary>
        /// <exception cref="ApiException">The server refuses, or does not answer.</exception>
        public static async Task<Session> Open(string server, SessionOptions options = null)
        {
            options = options ?? new SessionOptions();
            Api api = ApiOf(server, options);
            JObject made = await api.CreateSession(options.LeaseSeconds, options.Scene, options.Basis).ConfigureAwait(false);
            return new Session(api, (string)made["session_id"], options, true);
        }

        /// <summary>Another program's session, to watch or to give goals in. It must have the basis of your space.</summary>
        public static Session Join(string server, string id, SessionOptions options = null)
        {
            options = options ?? new SessionOptions();
            return new Session(ApiOf(server, options), id, options, false);
        }

        /// <summary>Create agents; returns their ids. They are shown when the stream introduces them.</summary>
        public async Task<string[]> CreateAgents(params AgentSpec[] agents)
        {
            JArray made = await Api.CreateAgents(Id, agents).ConfigureAwait(false);
            return made.Select(agent => (string)agent["agent_id"]).ToArray();
        }

        /// <summary>Take all messages, and show all agents as at this moment, which is returned. Call it once per
        /// picture.</summary>
        public double Update()
        {
            double now = options.Now();
            Stream.Update(now);
            KeepAlive(now);
            return Player.Advance(now);
        }

        /// <summary>
        /// See the agents from a place, in a session with <see cref="SessionOptions.Interest"/>. Call it as often as
        /// the camera moves: ten calls a second at most are sent, and always the last. <paramref name="reach"/>: the
        /// rings are this many times as wide.
        /// </summary>
        /// <exception cref="InvalidOperationException">It has none.</exception>
        public void Look(double x, double y, double z, double reach = 1)
        {
            if (interest == null)
            {
                throw new InvalidOperationException("the session was opened without Interest");
            }
            var position = new JObject { ["x"] = x, ["y"] = y, ["z"] = z };
            var views = new JArray { new JObject { ["position"] = position, ["reach"] = reach } };
            interest["viewpoints"] = views;
            Stream.Say(new JObject { ["viewpoints"] = views }.ToString(Newtonsoft.Json.Formatting.None));
        }

        private IReadOnlyDictionary<string, string> Query()
        {
            if (interest == null)
            {
                return options.Query;
            }
            var query = options.Query.ToDictionary(pair => pair.Key, pair => pair.Value);
            query["interest"] = interest.ToString(Newtonsoft.Json.Formatting.None);
            return query;
        }

        /// <summary>Leave the session; your own ends.</summary>
        public async Task Close()
        {
            renewing = false;
            Stream.Close();
            Player.Clear();
            if (!own)
            {
                return;
            }
            try
            {
                await Api.DeleteSession(Id).ConfigureAwait(false);
            }
            catch (ApiException)
            {
                // its lease will end it
            }
        }

        /// <summary>Renew the lease three times in its length, until the session is gone.</summary>
        private void KeepAlive(double now)
        {
            if (renewal != null && renewal.IsCompleted)
            {
                ApiException error = renewal.Exception == null ? null : renewal.Exception.GetBaseException() as ApiException;
                renewing &= error == null || error.Status != 404; // other failures may be temporary
                renewal = null;
            }
            if (renewing && renewal == null && now >= renewAt)
            {
                renewAt = now + options.LeaseSeconds / RenewalsPerLease;
                renewal = Api.RenewSession(Id);
            }
        }

        private static Api ApiOf(string server, SessionOptions options)
        {
            return new Api(server, new Access(options.Token), options.Http);
        }
    }
}
