import assert from "node:assert/strict";
import { test } from "node:test";
import { Access, Api, ApiError } from "../src/index.js";

/** An Api whose server gives one answer, and the requests it was asked. */
function api(status, body) {
  const asked = [];
  const fetcher = async (url, { method, body: sent }) => {
    asked.push([method, url, sent && JSON.parse(sent)]);
    return new Response(status === 204 ? null : body, { status });
  };
  return { api: new Api("", { fetcher }), asked };
}

test("calls have the method, path and body of the API", async () => {
  const { api: client, asked } = api(200, '{"agents": [1], "bodies": [2], "revision": 3}');
  await client.createSession(60);
  await client.renewSession("s/1");
  assert.deepEqual(await client.bodies(), [2]);
  assert.deepEqual(await client.createAgents("s/1", [{ gender: "male" }]), [1]);
  await client.setPath("a", [{ x: 1.5, z: -2, speed: 0.8, stop: false }, { x: 0, z: 0, heading: 1 }]);
  await client.appendGoals("a", [{ x: 3, z: 4, stop: false }]);
  await client.wander("a", { x: 1, z: 2 }, 9, { speed: 0.5 });
  await client.clearGoal("a");
  await client.deleteAgent("a");
  assert.deepEqual(asked, [
    ["POST", "/v1/sessions", { basis: "gltf", lease_s: 60 }],
    ["POST", "/v1/sessions/s%2F1/renew", undefined],
    ["GET", "/v1/bodies", undefined],
    ["POST", "/v1/sessions/s%2F1/agents", { agents: [{ gender: "male" }] }],
    ["PUT", "/v1/agents/a/path", {
      goals: [
        { position: { x: 1.5, y: 0, z: -2 }, speed: 0.8, stop: false },
        { position: { x: 0, y: 0, z: 0 }, heading: 1 },
      ],
    }],
    ["POST", "/v1/agents/a/goals", { goals: [{ position: { x: 3, y: 0, z: 4 }, stop: false }] }],
    ["PUT", "/v1/agents/a/wander", { area: { center: { x: 1, y: 0, z: 2 }, radius: 9 }, speed: 0.5 }],
    ["DELETE", "/v1/agents/a/goal", undefined],
    ["DELETE", "/v1/agents/a", undefined],
  ]);
});

test("calls on scenes have the method, path and body of the API", async () => {
  const { api: client, asked } = api(200, '{"examples": [1], "scenes": [2], "came": 3}');
  await client.createSession(60, "scene-1");
  assert.deepEqual(await client.exampleScenes(), [1]);
  assert.deepEqual(await client.scenes(), [2]);
  await client.createExampleScene("town_square");
  await client.putObstacle("scene-1", "a/b", { prism: {} });
  await client.removeObstacle("scene-1", "a/b");
  await client.queryPath("scene-1", { x: 0, y: 0, z: 0 }, { x: 1, y: 3, z: 1 });
  await client.populate("s", 40);
  await client.roam("a", { speed: 1 });
  await client.behave("a", { follow: { agent_id: "b" } });
  await client.setPath("a", [{ x: 1, y: 3, z: 2 }]);
  assert.deepEqual(asked, [
    ["POST", "/v1/sessions", { basis: "gltf", lease_s: 60, scene: "scene-1" }],
    ["GET", "/v1/scenes/examples", undefined],
    ["GET", "/v1/scenes", undefined],
    ["POST", "/v1/scenes/examples/town_square", {}],
    ["PUT", "/v1/scenes/scene-1/obstacles/a%2Fb", { prism: {} }],
    ["DELETE", "/v1/scenes/scene-1/obstacles/a%2Fb", undefined],
    ["POST", "/v1/scenes/scene-1/path", { start: { x: 0, y: 0, z: 0 }, goal: { x: 1, y: 3, z: 1 } }],
    ["POST", "/v1/sessions/s/crowd", { count: 40 }],
    ["PUT", "/v1/agents/a/wander", { speed: 1 }],
    ["PUT", "/v1/agents/a/behaviour", { follow: { agent_id: "b" } }],
    ["PUT", "/v1/agents/a/path", { goals: [{ position: { x: 1, y: 3, z: 2 } }] }],
  ]);
});

test("a mesh is sent as it is", async () => {
  let sent;
  const fetcher = async (url, request) => {
    sent = [url, request.headers["content-type"], request.body];
    return new Response('{"scene_id": "scene-1"}');
  };
  const client = new Api("", { fetcher });
  const bytes = new ArrayBuffer(8);
  await client.createMeshScene(bytes, "glb", "my level.glb");
  assert.deepEqual(sent, ["/v1/scenes/mesh?format=glb&name=my+level.glb", "application/octet-stream", bytes]);
});

test("an answer without content is null", async () => {
  assert.equal(await api(204, "").api.deleteAgent("a"), null);
});

test("a refusal says what the problem document says", async () => {
  const document = { title: "Invalid argument", detail: "too far", errors: [{ field: "position", detail: "too far" }] };
  await assert.rejects(api(422, JSON.stringify(document)).api.setPath("a", [{ x: 9e9, z: 0 }]), (error) => {
    assert.ok(error instanceof ApiError);
    assert.equal(error.status, 422);
    assert.equal(error.message, "position: too far");
    assert.equal(error.problem.title, "Invalid argument");
    return true;
  });
  await assert.rejects(api(404, '{"detail": "no agent a"}').api.clearGoal("a"), /no agent a/);
  await assert.rejects(api(502, "<html>").api.stats(), /HTTP 502/);
});

test("no answer is an error of its own", async () => {
  const fetcher = async () => {
    throw new TypeError("fetch failed");
  };
  const client = new Api("", { fetcher });
  await assert.rejects(client.stats(), { name: "ApiError", status: 0, message: /does not answer/ });
});

test("an answer that ends after its status is no answer", async () => {
  const cut = new ReadableStream({ pull: (body) => body.error(new DOMException("signal timed out", "TimeoutError")) });
  const client = new Api("", { fetcher: async () => new Response(cut) });
  await assert.rejects(client.stats(), { name: "ApiError", status: 0, message: /does not answer \(signal timed out\)/ });
});

test("a body that Node has lost is sent again, and what Node says no more of has its cause told", async () => {
  const lost = (code) => new TypeError("fetch failed", { cause: Object.assign(new Error(`it is ${code}`), { code }) });
  const fails = [lost("UND_ERR_REQ_CONTENT_LENGTH_MISMATCH"), lost("ECONNREFUSED")];
  const { api: server } = api(200, '{"session_id": "s"}');
  const client = new Api("", {
    fetcher: async (...asked) => {
      if (fails.length) throw fails.shift();
      return server.fetcher(...asked);
    },
  });
  await assert.rejects(client.createSession(60), /the server does not answer \(it is ECONNREFUSED\)/);
  assert.equal((await client.createSession(60)).session_id, "s");
});

test("the stream's address follows the page's", () => {
  const client = new Api();
  const of = (href, ...rest) => client.streamAddress("s 1", ...rest, new URL(href)).url;
  assert.equal(of("http://host:8080/", {}, ""), "ws://host:8080/v1/stream?session=s+1");
  assert.equal(
    of("https://host/x/", { encoding: "smallest_three", fps: 20 }, "r.1"),
    "wss://host/v1/stream?session=s+1&encoding=smallest_three&fps=20&resume_token=r.1",
  );
});

test("a server that asks who calls gets a token, asked for once", async () => {
  const typed = ["wrong", "a+b?~"];
  const reasons = [];
  const access = new Access("", async (reason) => {
    reasons.push(reason);
    return typed.shift();
  });
  const good = "Bearer a+b?~";
  const fetcher = async (url, { headers }) => (headers.authorization === good
    ? new Response('{"bodies": []}')
    : new Response('{"detail": "credentials are missing"}', { status: 401 }));
  const client = new Api("", { access, fetcher });
  await Promise.all([client.bodies(), client.bodies(), client.bodies()]);
  assert.deepEqual(reasons, ["credentials are missing", "credentials are missing"]);
  assert.equal(access.token, "a+b?~");
  assert.deepEqual(client.streamAddress("s", {}, "", new URL("http://h/")).protocols, [
    "wayfarer.v1", "wayfarer.token.YStiP34",
  ]);
});

test("where nobody can be asked, the call is refused", async () => {
  const fetcher = async () => new Response('{"detail": "credentials are missing"}', { status: 401 });
  await assert.rejects(new Api("", { fetcher }).bodies(), { status: 401, message: "credentials are missing" });
  assert.deepEqual(new Access().headers, {});
  assert.deepEqual(new Access().protocols, ["wayfarer.v1"]);
});

test("outside of a page, the server's address is said", () => {
  const { url } = new Api("https://walk.example").streamAddress("s", {}, "", undefined);
  assert.equal(url, "wss://walk.example/v1/stream?session=s");
});

/** An Api whose server refuses the first calls, and how long it waited before each further one. */
function refusing(...refusals) {
  const waited = [];
  const fetcher = async () => {
    const problem = refusals.shift();
    return problem ? new Response(JSON.stringify(problem), { status: 429 }) : new Response("{}");
  };
  const pause = async (seconds, error) => waited.push([seconds, error.message]);
  return { api: new Api("", { fetcher, pause }), waited };
}

test("a call that is refused for now is sent again when the server has said", async () => {
  const { api: client, waited } = refusing({ detail: "no room", retry_after_s: 5 }, { detail: "too fast", retry_after_s: 0.5 });
  await client.createAgents("s", [{}]);
  assert.deepEqual(waited, [[5, "no room"], [0.5, "too fast"]]);
});

test("but not for ever, and not where no time is named", async () => {
  const { api: client, waited } = refusing(...Array.from({ length: 9 }, () => ({ detail: "no room", retry_after_s: 5 })));
  await assert.rejects(client.stats(), { status: 429, message: "no room" });
  assert.equal(waited.length, 3);
  const { api: full, waited: never } = refusing({ detail: "too many" });
  await assert.rejects(full.stats(), { status: 429 });
  assert.deepEqual(never, []);
});

/** An Api at http://entry:1 of a cluster: `node` says what its nodes answer, by address. */
function clustered(node) {
  const asked = [];
  const fetcher = async (url) => {
    asked.push(url);
    const { host, pathname } = new URL(url);
    const answer = node(host, pathname);
    if (answer === null) throw new TypeError("connection refused");
    const [status, body] = answer;
    return new Response(JSON.stringify(body), { status });
  };
  return { api: new Api("http://entry:1", { fetcher }), asked };
}

const sentTo = (host, port) => [421, { detail: "elsewhere", endpoint: { host, http_port: port, grpc_port: 9 } }];

test("a call that belongs to another node goes there once, and the node is remembered", async () => {
  const { api: client, asked } = clustered((host) =>
    host === "entry:1" ? sentTo("a", 7) : [200, { session_id: "session-00ffaa", agents: [] }]);
  await client.createSession(60);
  await client.agents("session-00ffaa");
  await client.deleteAgent("agent-00ff77");
  assert.deepEqual(asked, [
    "http://entry:1/v1/sessions",
    "http://a:7/v1/sessions",
    "http://a:7/v1/sessions/session-00ffaa/agents",
    "http://a:7/v1/agents/agent-00ff77",
  ]);
  assert.match(client.streamAddress("session-00ffaa").url, /^ws:\/\/a:7\/v1\/stream/);
  await client.createSession(60);
  assert.equal(asked[4], "http://entry:1/v1/sessions", "what is new is placed by the entry");
});

test("a session whose node is gone is looked for again, and one that is sent round fails", async () => {
  let home = "a";
  const { api: client, asked } = clustered((host) => {
    if (host === "entry:1") return sentTo(home, 7);
    return host === `${home}:7` ? [200, { session_id: "session-00ffaa" }] : null;
  });
  await client.session("session-00ffaa");
  home = "b";
  await client.session("session-00ffaa");
  assert.deepEqual(asked.map((url) => new URL(url).host), ["entry:1", "a:7", "a:7", "entry:1", "b:7"]);

  const { api: lost, asked: round } = clustered(() => sentTo("c", 7));
  await assert.rejects(lost.session("session-00ffaa"), (error) => error.status === 421);
  assert.equal(round.length, 2);
});
