import assert from "node:assert/strict";
import { test } from "node:test";

import { Homes } from "../../clients/web/src/core/homes.js";
import { otherNodes } from "../../service/wayfarer/transport/viewer/nodes.js";

const PAGE = { href: "http://h:1/?scene=x#y", protocol: "http:", host: "h:1" };
const ABOUT = "session-00ff1234";

const answering = (policy) => async (href, { method }) => {
  assert.deepEqual([href, method], [PAGE.href, "HEAD"]);
  return { headers: new Headers(policy ? { "content-security-policy": policy } : {}) };
};

test("the nodes are those that the page's policy names", async () => {
  const policy = "default-src 'none'; connect-src 'self' h:1 h:2 other.example:80 ws: wss: data:; base-uri h:9";
  assert.deepEqual(await otherNodes(PAGE, answering(policy)), ["http://h:2", "http://other.example:80"]);
  assert.deepEqual(await otherNodes(PAGE, answering("connect-src 'self' ws:")), []);
  assert.deepEqual(await otherNodes(PAGE, answering("")), []);
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
