import assert from "node:assert/strict";
import { test } from "node:test";

import { Homes } from "../../clients/web/src/core/homes.js";
import { nodesOf, watchNodes, watchPolicy } from "../../viewer/nodes.js";

const ABOUT = "session-00ff1234";

const answering = (policy) => async (href, { method }) => {
  assert.deepEqual([href, method], ["http://h:1/", "HEAD"]);
  return { headers: new Headers(policy ? { "content-security-policy": policy } : {}) };
};

test("the nodes are those that the policy of a node's page names, the latest first", async () => {
  const named = "h:1 h:2 other.example:80 h:* other.example:* *.later.example:*";
  const policy = `default-src 'none'; connect-src 'self' ${named} ws: wss: data:; base-uri h:9`;
  assert.deepEqual(await nodesOf("http://h:1", answering(policy)), ["http://other.example:80", "http://h:2", "http://h:1"]);
  assert.deepEqual(await nodesOf("http://h:1", answering("connect-src 'self' ws:")), []);
  assert.deepEqual(await nodesOf("http://h:1", answering("")), []);
});

test("the others are looked up again and again, at the node that answers", async () => {
  const homes = new Homes("http://h:1"), asked = [];
  const answers = [["http://h:1"], new Error("away"), ["http://h:3", "http://h:2", "http://h:1"], []];
  const seen = [];
  await watchNodes(homes, async (entry) => {
    asked.push(entry);
    const answer = answers.shift();
    if (answer instanceof Error) throw answer;
    return answer;
  }, async () => {
    seen.push(homes.others);
    if (answers.length === 2) homes.entry = "http://h:2"; // a call has turned
  });
  assert.deepEqual(asked, ["http://h:1", "http://h:1", "http://h:2", "http://h:2"]);
  assert.deepEqual(seen, [[], [], ["http://h:3", "http://h:1"]]);
});

test("where the page's policy forbids a call, it is said where to go on", () => {
  const page = new EventTarget(), told = [];
  watchPolicy((text) => told.push(text), () => "session-1", page);
  const forbid = (effectiveDirective, blockedURI) =>
    page.dispatchEvent(Object.assign(new Event("securitypolicyviolation"), { effectiveDirective, blockedURI }));
  forbid("img-src", "http://n9:8080/x.png");
  forbid("connect-src", "inline");
  assert.deepEqual(told, []);
  forbid("connect-src", "http://n9:8080/v1/agents/x");
  assert.match(told[0], /may not call n9:8080.*Go on at http:\/\/n9:8080\/\?session=session-1$/);
});

function cluster() {
  const homes = new Homes("http://h:1");
  homes.others = ["http://h:2", "http://h:3"];
  return homes;
}

test("when the page's node does not answer, the others are asked, and stay asked", () => {
  const homes = cluster();
  const route = homes.route(ABOUT);
  assert.equal(route.address, "http://h:1");
  assert.ok(route.refused(0));
  assert.equal(route.address, "http://h:2");
  assert.ok(route.refused(421, { host: "h", http_port: 3 }));
  assert.equal(route.address, "http://h:3");
  route.answered();
  assert.equal(homes.route(ABOUT).address, "http://h:3");
  assert.equal(homes.route("").address, "http://h:2");
});

test("each is asked once, and then the call has failed", () => {
  const route = cluster().route(ABOUT);
  const asked = [];
  do asked.push(route.address);
  while (route.refused(0));
  assert.deepEqual(asked, ["http://h:1", "http://h:2", "http://h:3"]);
});

test("a node that names one which is gone is not the last to be asked", () => {
  const route = cluster().route(ABOUT);
  assert.ok(route.refused(0)); // 1 is gone
  assert.ok(route.refused(421, { host: "h", http_port: 1 })); // as 2 does not know yet
  assert.equal(route.address, "http://h:1");
  assert.ok(route.refused(0));
  assert.equal(route.address, "http://h:3");
});

test("a stream that is lost begins again at another node", () => {
  const homes = cluster();
  const route = homes.route(ABOUT);
  assert.equal(route.closed(1006, ""), false);
  route.begin();
  assert.equal(route.address, "http://h:2");
  assert.ok(route.closed(4421, "call h:3"));
  assert.equal(route.address, "http://h:3");
});
