using System;
using System.Collections.Generic;
using System.Linq;
using System.Threading.Tasks;
using Newtonsoft.Json.Linq;
using NUnit.Framework;

namespace Wayfarer.Tests
{
    /// <summary>Calls, refusals, and a session's lease.</summary>
    public class ApiTests
    {
        [Test]
        public void Calls_have_the_method_path_and_body_of_the_API()
        {
            var http = new FakeHttp().Answer(200, "{\"agents\": [{\"agent_id\": \"a\"}], \"bodies\": [2], \"session_id\": \"s\"}");
            Api api = Of(http);
            Wait(api.CreateSession(60));
            Wait(api.CreateSession(60, "scene-1", "gltf"));
            Wait(api.RenewSession("s/1"));
            Wait(api.Bodies());
            var ada = new AgentSpec { Name = "Ada", Gender = "female", Position = new Place(1, 0, 2), HeightM = 1.7, Outfit = "suit", Seed = 7 };
            JArray made = api.CreateAgents("s/1", ada, new AgentSpec { Betas = new[] { 0.5 }, FootLock = false, Heading = 1 }).Result;
            Assert.AreEqual("a", (string)made[0]["agent_id"]);
            Wait(api.SetPath("a", new Goal(1.5, 0, -2) { ["speed"] = 0.8, ["stop"] = false }, new Goal(0, 0, 0) { ["heading"] = 1.0, ["dwell"] = 2.0 }));
            Wait(api.AppendGoals("a", new Goal(3, 0, 4) { ["radius"] = 0.5, ["strafe"] = true, ["speed"] = null }));
            Wait(api.Wander("a", new Place(1, 0, 2), 9, new JObject { ["speed"] = 0.5 }));
            Wait(api.Roam("a"));
            Wait(api.Behave("a", JObject.Parse("{\"follow\": {\"agent_id\": \"b\"}}")));
            Wait(api.ClearGoal("a"));
            Wait(api.DeleteAgent("a"));
            Wait(api.DeleteSession("s/1"));
            Wait(api.CreateExampleScene("town_square"));
            Wait(api.PutObstacle("scene-1", "a/b", new JObject { ["prism"] = new JObject() }));
            Wait(api.RemoveObstacle("scene-1", "a/b"));
            Wait(api.Populate("s", 40));
            string[] wanted =
            {
                "POST /v1/sessions {\"basis\":\"unity\",\"lease_s\":60.0}",
                "POST /v1/sessions {\"basis\":\"gltf\",\"lease_s\":60.0,\"scene\":\"scene-1\"}",
                "POST /v1/sessions/s%2F1/renew ",
                "GET /v1/bodies ",
                "POST /v1/sessions/s%2F1/agents {\"agents\":[{\"name\":\"Ada\",\"gender\":\"female\","
                    + "\"position\":{\"x\":1.0,\"y\":0.0,\"z\":2.0},\"phenotype\":{\"height_m\":1.7},\"outfit\":\"suit\",\"seed\":7},"
                    + "{\"heading\":1.0,\"betas\":[0.5],\"foot_lock\":false}]}",
                "PUT /v1/agents/a/path {\"goals\":[{\"position\":{\"x\":1.5,\"y\":0.0,\"z\":-2.0},\"speed\":0.8,\"stop\":false},"
                    + "{\"position\":{\"x\":0.0,\"y\":0.0,\"z\":0.0},\"heading\":1.0,\"dwell\":2.0}]}",
                "POST /v1/agents/a/goals {\"goals\":[{\"position\":{\"x\":3.0,\"y\":0.0,\"z\":4.0},\"radius\":0.5,\"strafe\":true}]}",
                "PUT /v1/agents/a/wander {\"speed\":0.5,\"area\":{\"center\":{\"x\":1.0,\"y\":0.0,\"z\":2.0},\"radius\":9.0}}",
                "PUT /v1/agents/a/wander {}",
                "PUT /v1/agents/a/behaviour {\"follow\":{\"agent_id\":\"b\"}}",
                "DELETE /v1/agents/a/goal ",
                "DELETE /v1/agents/a ",
                "DELETE /v1/sessions/s%2F1 ",
                "POST /v1/scenes/examples/town_square {}",
                "PUT /v1/scenes/scene-1/obstacles/a%2Fb {\"prism\":{}}",
                "DELETE /v1/scenes/scene-1/obstacles/a%2Fb ",
                "POST /v1/sessions/s/crowd {\"count\":40}",
            };
            Assert.AreEqual(wanted, http.Asked.Select(
                call => call.Method + " " + call.Url.Substring("http://host:8080".Length) + " " + call.Body).ToArray());
            Assert.IsTrue(http.Asked.All(call => call.Authorization == null));
        }

        [Test]
        public void An_agent_takes_the_body_of_a_character()
        {
            JToken rig = Golden.Document("retarget.json")["cases"].First(found => (string)found["name"] == "unity");
            BoneMap map = RetargetTests.Map(rig).Corrected(new Dictionary<string, string> { ["neck"] = null });
            var http = new FakeHttp().Answer(200, "{\"gender\": \"male\", \"betas\": [0.5, -1], \"scale\": 1.0}");
            JObject fit = Of(http).FitBody(new CharacterJoints(map, Basis.Unity)).Result;
            JObject asked = JObject.Parse(http.Asked[0].Body);
            Assert.AreEqual("http://host:8080/v1/bodies:fit", http.Asked[0].Url);
            Assert.AreEqual(21, asked["joints"].Count());
            Assert.AreEqual(0, (double)asked["floor"]);
            JToken knee = asked["joints"].First(joint => (string)joint["bone"] == "left_knee")["position"];
            Assert.That((double)knee["x"], Is.LessThan(-0.05), "left is -x");
            Assert.That((double)knee["y"], Is.InRange(0.3, 0.7));
            AgentSpec spec = new AgentSpec { HeightM = 2 }.TakeBody(fit);
            Assert.AreEqual("male 0.5 -1 ", spec.Gender + " " + spec.Betas[0] + " " + spec.Betas[1] + " " + spec.HeightM);
        }

        [Test]
        public void A_refusal_says_what_the_problem_document_says()
        {
            const string Document = "{\"title\": \"Invalid argument\", \"detail\": \"too far\", "
                + "\"errors\": [{\"field\": \"position\", \"detail\": \"too far\"}]}";
            ApiException error = Refusal(new FakeHttp().Answer(422, Document));
            Assert.AreEqual("422 position: too far", error.Status + " " + error.Message);
            Assert.AreEqual("Invalid argument", (string)error.Problem["title"]);
            Assert.AreEqual("no agent a", Refusal(new FakeHttp().Answer(404, "{\"detail\": \"no agent a\"}")).Message);
            Assert.AreEqual("HTTP 502", Refusal(new FakeHttp().Answer(502, "<html>")).Message);
            error = Refusal(new FakeHttp { Failure = new TimeoutException("no answer within 10 s") });
            Assert.AreEqual("0 the server does not answer (no answer within 10 s)", error.Status + " " + error.Message);
        }

        [Test]
        public void A_call_that_is_refused_for_now_is_sent_again_with_patience()
        {
            const string Busy = "{\"detail\": \"busy\", \"retry_after_s\": 5}";
            var waited = new List<double>();
            var http = new FakeHttp().Answer(429, Busy).Answer(429, Busy).Answer(200, "{\"stats\": 1}");
            Assert.AreEqual(1, (int)Of(http, waited).Stats().Result["stats"]);
            Assert.AreEqual(new[] { 5.0, 5 }, waited.ToArray());
            waited.Clear();
            Assert.AreEqual("busy", Refusal(new FakeHttp().Answer(429, Busy), waited).Message);
            Assert.AreEqual(3, waited.Count);
        }

        [Test]
        public void Addresses_and_keys()
        {
            Assert.Throws<ArgumentException>(() => new Api("localhost:8080"));
            Assert.Throws<ArgumentException>(() => new Api(""));
            var query = new Dictionary<string, string> { ["encoding"] = "smallest_three" };
            StreamAddress where = new Api("https://host/x/").StreamAddress("s 1", query, "r.1~a");
            Assert.AreEqual("wss://host/x/v1/stream?session=s%201&encoding=smallest_three&resume_token=r.1~a", where.Url);
            Assert.AreEqual(new[] { "wayfarer.v1" }, where.Protocols.ToArray());
            var http = new FakeHttp().Answer(200, "{}");
            var api = new Api("http://host:8080", new Access("a+b?~"), http);
            Wait(api.Stats());
            Assert.AreEqual("Bearer a+b?~", http.Asked[0].Authorization);
            Assert.AreEqual("ws://host:8080/v1/stream?session=s", api.StreamAddress("s").Url);
            Assert.AreEqual(new[] { "wayfarer.v1", "wayfarer.token.YStiP34" }, api.StreamAddress("s").Protocols.ToArray());
        }

        [Test]
        public void A_session_is_made_streamed_renewed_and_ended()
        {
            double now = 0;
            var socket = new FakeSocket();
            var http = new FakeHttp().Answer(200, "{\"session_id\": \"s-1\"}").Answer(503).Answer(204);
            Session session = Session.Open("http://host:8080", new SessionOptions
            {
                Http = http,
                Now = () => now,
                NewSocket = () => socket,
                Scene = "scene-1",
            }).Result;
            Assert.AreEqual("http://host:8080/?session=s-1", session.ViewerUrl);
            session.Update();
            Assert.AreEqual("ws://host:8080/v1/stream?session=s-1&encoding=smallest_three&fps=20", socket.Url);
            byte[] header = Crowd.Header(), batch = Crowd.Batch(3, 0);
            socket.Say(header, 0);
            socket.Say(batch, 0.1);
            for (now = 0; now < 70; now += 1)
            {
                socket.Say("heartbeat", now);
                session.Update();
            }
            Assert.AreEqual(3, session.Player.Agents.Count(played => played.Shown));
            string[] asked = http.Asked.Select(call => call.Method + " " + new Uri(call.Url).PathAndQuery).ToArray();
            string[] renewals = Enumerable.Repeat("POST /v1/sessions/s-1/renew", 3).ToArray(); // the first one failed
            Assert.AreEqual(new[] { "POST /v1/sessions" }.Concat(renewals).ToArray(), asked);
            Wait(session.Close());
            Assert.AreEqual("DELETE", http.Asked.Last().Method);
            Assert.IsTrue(socket.Closed);
            CollectionAssert.IsEmpty(session.Player.Agents);
        }

        [Test]
        public void A_session_that_is_no_more_is_not_renewed_and_one_that_was_joined_is_left_alone()
        {
            double now = 0;
            var http = new FakeHttp().Answer(200, "{\"session_id\": \"s-1\"}").Answer(404);
            var options = new SessionOptions { Http = http, Now = () => now, NewSocket = () => new FakeSocket() };
            Session own = Session.Open("http://host:8080", options).Result;
            Session joined = Session.Join("http://host:8080", "s-2", options);
            for (; now < 100; now += 1)
            {
                own.Update();
                joined.Update();
            }
            Assert.AreEqual(2, http.Asked.Count);
            Wait(joined.Close());
            Assert.AreEqual(2, http.Asked.Count);
        }

        private static Api Of(FakeHttp http, List<double> waited = null)
        {
            return new Api("http://host:8080", null, http, seconds =>
            {
                waited?.Add(seconds);
                return Task.FromResult(0);
            });
        }

        private static ApiException Refusal(FakeHttp http, List<double> waited = null)
        {
            var error = Assert.Throws<AggregateException>(() => Wait(Of(http, waited).SetPath("a", new Goal(1, 0, 2))));
            return (ApiException)error.GetBaseException();
        }

        private static void Wait(Task task)
        {
            task.Wait();
        }
    }
}
