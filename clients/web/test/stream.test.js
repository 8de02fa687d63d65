import assert from "node:assert/strict";
import { EventEmitter } from "node:events";
import { test } from "node:test";
import { MotionPlayer, MotionStream, Session } from "../src/index.js";
import { golden } from "./golden.js";

const MESSAGES = golden("messages.json");

/** A stream over sockets and timers that the test drives by hand. */
function harness() {
  const sockets = [];
  const timers = [];
  const heard = [];
  const note = (name) => (...given) => heard.push([name, ...given]);
  const player = new MotionPlayer({
    header: note("header"), event: note("event"),
    added: ({ agent }) => heard.push(["added", agent.id]), removed: ({ agent }) => heard.push(["removed", agent.id]),
    chunk: (_, { seq, frames }) => heard.push(["chunk", seq, frames]),
  });
  const on = Object.fromEntries(["status", "ended", "refused", "failed"].map((name) => [name, note(name)]));
  const newSocket = (url, protocols) => {
    const socket = {
      url,
      protocols,
      closed: false,
      close() {
        this.closed = true;
        this.onclose({ code: 1006, reason: "" });
      },
      say(name) {
        const bytes = Buffer.from(MESSAGES[name], "hex");
        this.onmessage({ data: bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length) });
      },
    };
    sockets.push(socket);
    return socket;
  };
  const schedule = (callback, seconds) => timers.push({ callback, seconds });
  const address = (token) => ({ url: `ws://x/${token}`, protocols: ["p"] });
  const stream = new MotionStream(address, player, on, { newSocket, schedule, now: () => 5 });
  const names = () => heard.map(([name]) => name);
  const run = (seconds) => {
    const due = timers.filter((timer) => timer.seconds === seconds);
    due.forEach((timer) => timers.splice(timers.indexOf(timer), 1));
    due.forEach(({ callback }) => callback());
    return due.length;
  };
  return { stream, player, sockets, timers, heard, names, run };
}

const states = (heard) => heard.filter(([name]) => name === "status").map(([, state]) => state);

test("header, agents, chunks and removals arrive in order", () => {
  const { sockets, heard, names, player } = harness();
  sockets[0].say("header");
  sockets[0].say("batch");
  sockets[0].say("heartbeat");
  assert.deepEqual(names(), ["status", "header", "status", "added", "chunk", "removed"]);
  assert.deepEqual(heard.at(-2), ["chunk", 12, 3]);
  assert.deepEqual(states(heard), ["connecting", "open"]);
  assert.equal(player.stats.messages, 3);
});

test("a lost connection is opened again, later each time", () => {
  const { sockets, heard, timers, run } = harness();
  sockets[0].onclose({ code: 1006, reason: "" });
  assert.equal(run(0.5), 1);
  sockets[1].onclose({ code: 4503, reason: "the server is shutting down" });
  assert.equal(run(1), 1);
  assert.equal(sockets.length, 3);
  sockets[2].say("header"); // success: the first wait is short again
  sockets[2].onclose({ code: 1001, reason: "" });
  assert.ok(timers.some(({ seconds }) => seconds === 0.5));
  assert.deepEqual(states(heard), ["connecting", "lost", "connecting", "lost", "connecting", "open", "lost"]);
});

test("a stream goes on where it was, and says so", () => {
  const { sockets, heard, run } = harness();
  sockets[0].say("header");
  sockets[0].say("batch");
  sockets[0].onclose({ code: 1006, reason: "" });
  run(0.5);
  assert.deepEqual([sockets[0].url, sockets[1].url], ["ws://x/", "ws://x/r.1.41"]);
  assert.deepEqual(sockets[1].protocols, ["p"]);
  sockets[1].say("header_small");
  sockets[1].say("batch_small");
  const headers = heard.filter(([name]) => name === "header");
  assert.deepEqual(headers.map(([, header, again]) => [header.resumed, again]), [[false, false], [true, true]]);
  assert.deepEqual(heard.at(-1), ["chunk", 13, 2]);
});

test("events are handed on", () => {
  const { sockets, heard } = harness();
  sockets[0].say("header");
  sockets[0].say("event");
  assert.equal(heard.at(-1)[1].kind, "goal_reached");
});

test("a resume token that the server does not know is forgotten", () => {
  const { sockets, heard } = harness();
  sockets[0].say("header");
  sockets[0].say("batch");
  sockets[0].onclose({ code: 4422, reason: "not a resume token" });
  assert.equal(sockets[1].url, "ws://x/");
  sockets[1].onclose({ code: 4422, reason: "encoding: unknown" });
  assert.deepEqual(heard.at(-1), ["failed", "encoding: unknown"]);
  assert.equal(sockets.length, 2);
});

test("a caller that is not known may show who it is and open again", () => {
  const { stream, sockets, heard } = harness();
  sockets[0].onclose({ code: 4401, reason: "credentials are missing" });
  assert.deepEqual(heard.at(-1), ["refused", "credentials are missing"]);
  assert.equal(sockets.length, 1);
  stream.open();
  assert.equal(sockets.length, 2);
});

test("an ended or unknown session is not asked for again", () => {
  for (const code of [1000, 4404]) {
    const { sockets, heard, timers } = harness();
    const before = timers.length;
    sockets[0].onclose({ code, reason: "gone" });
    assert.deepEqual(heard.at(-1), ["ended", "gone"]);
    assert.equal(timers.length, before);
  }
});

test("what is not allowed is told", () => {
  const { sockets, heard } = harness();
  sockets[0].onclose({ code: 4403, reason: "web pages of this origin may not call" });
  assert.deepEqual(heard.at(-1), ["failed", "web pages of this origin may not call"]);
});

test("a silent connection is given up, a speaking one is kept", () => {
  const { sockets, run } = harness();
  sockets[0].say("header");
  for (let look = 0; look < 3; look += 1) run(0.75);
  assert.equal(sockets[0].closed, false);
  run(0.75);
  assert.equal(sockets[0].closed, true);
});

test("what cannot be read ends the stream with a reason", () => {
  const { sockets, heard } = harness();
  sockets[0].onmessage({ data: new Uint8Array([0x0b]).buffer });
  assert.match(heard.at(-1)[1], /cannot read the stream: malformed message/);
  sockets[0].onclose({ code: 1006, reason: "" });
  assert.equal(sockets.length, 1);
});

test("a batch before the header is an error", () => {
  const { sockets, heard } = harness();
  sockets[0].say("batch");
  assert.match(heard.at(-1)[1], /before the header/);
});

test("a stream that was closed stays closed and ignores late messages", () => {
  const { stream, sockets, timers, heard } = harness();
  stream.close();
  const count = heard.length;
  timers.forEach(({ callback }) => callback());
  assert.equal(sockets.length, 1);
  assert.equal(heard.length, count);
});

test("while it waits to try again, it can be told to do so at once, and does so once", () => {
  const { stream, sockets, run } = harness();
  sockets[0].close();
  assert.equal(sockets.length, 1);
  stream.reconnect();
  assert.equal(sockets.length, 2);
  assert.equal(run(0.5), 1); // the timer of the loss
  assert.equal(sockets.length, 2);
  sockets[1].close();
  run(1);
  assert.equal(sockets.length, 3);
});

test("after a sleep it connects at once, whatever the old socket still says, with a new clock", () => {
  const { stream, player, sockets, run, heard } = harness();
  sockets[0].say("header");
  const { clock } = player;
  const { onclose } = sockets[0];
  sockets[0].close = () => {}; // it takes its time
  stream.wake();
  assert.equal(sockets.length, 2);
  assert.notEqual(player.clock, clock);
  const before = heard.length;
  sockets[0].say("batch");
  onclose({ code: 1006, reason: "" });
  assert.equal(heard.length, before);
  sockets[1].onclose({ code: 1006, reason: "" }); // the network is not back yet
  stream.wake();
  assert.equal(sockets.length, 3);
  run(0.5); // the retry of before
  assert.equal(sockets.length, 3);
  sockets[2].onclose({ code: 4404, reason: "no session" });
  assert.deepEqual(heard.at(-1), ["ended", "no session"]);
  stream.wake();
  assert.equal(sockets.length, 3);
});

test("texts are sent once the header has come, the last of those in a tenth of a second", () => {
  const { stream, sockets, run } = harness();
  const sent = [];
  const listen = (socket) => Object.assign(socket, { send: (text) => sent.push(text) });
  listen(sockets[0]);
  stream.say("a");
  assert.deepEqual(sent, []);
  sockets[0].say("header");
  assert.deepEqual(sent, ["a"]);
  stream.say("b");
  stream.say("c");
  assert.deepEqual(sent, ["a"]);
  assert.equal(run(0.1), 1);
  assert.deepEqual(sent, ["a", "c"]);
  run(0.1);
  sockets[0].onclose({ code: 1006, reason: "" });
  stream.say("d");
  run(0.5);
  assert.deepEqual(sent, ["a", "c"]);
  listen(sockets[1]).say("header");
  assert.deepEqual(sent, ["a", "c", "d"]);
});

test("a session looks from where it is told, and says so again when it connects", () => {
  const sockets = [];
  const newSocket = (url) => {
    sockets.push({ url, send() {}, close() {} });
    return sockets.at(-1);
  };
  const interest = { rings: [{ radius: 10 }], viewpoints: [{ position: { x: 0, y: 0, z: 0 } }] };
  const options = { interest, query: { fps: 20 }, stream: { newSocket, schedule: () => {} } };
  const session = Session.join("http://x", "s", options);
  const asked = () => new URL(sockets.at(-1).url).searchParams;
  assert.deepEqual(JSON.parse(asked().get("interest")), interest);
  assert.equal(asked().get("fps"), "20");
  session.look([{ position: { x: 1, y: 2, z: 3 }, reach: 2 }]);
  session.stream.reconnect();
  sockets[0].onclose({ code: 1006, reason: "" });
  session.stream.open();
  assert.equal(JSON.parse(asked().get("interest")).viewpoints[0].reach, 2);
  assert.throws(() => Session.join("http://x", "s", { stream: options.stream }).look([]), /without `interest`/);
});

test("a stream that is sent on follows at once, and asks the entry when its node is gone", () => {
  const ID = "session-00ff12";
  const sockets = [];
  const timers = [];
  const newSocket = (url) => {
    const socket = { url, close() {} };
    sockets.push(socket);
    return socket;
  };
  const schedule = (callback, seconds) => timers.push({ callback, seconds });
  const session = Session.join("http://entry:1", ID, { stream: { newSocket, schedule, now: () => 5 } });
  const end = (code, reason) => sockets.at(-1).onclose({ code, reason });
  const hosts = () => sockets.map(({ url }) => new URL(url).host);
  end(4421, "call a:7");
  assert.deepEqual(hosts(), ["entry:1", "a:7"]);
  const bytes = new Uint8Array(Buffer.from(MESSAGES.header, "hex"));
  sockets.at(-1).onmessage({ data: bytes.buffer });
  end(4421, "call b:7"); // it has moved
  assert.deepEqual(hosts(), ["entry:1", "a:7", "b:7"]);
  end(4421, "call c:7"); // again: the entry must know
  assert.deepEqual(hosts().slice(3), ["entry:1"]);
  end(4421, "call c:7");
  end(1006, "");
  assert.deepEqual(hosts().slice(4), ["c:7"]);
  timers.filter(({ seconds }) => seconds === 0.5).at(-1).callback();
  assert.deepEqual(hosts().slice(5), ["entry:1"]);
  session.stream.close();
});

test("a socket that fails before it opens ends no program", () => {
  // as the package "ws": an `error` that nobody listens to is thrown
  class Failing extends EventEmitter {
    set onmessage(listener) {}
    set onclose(listener) { this.on("close", listener); }
    set onerror(listener) { this.on("error", listener); }
    fail() {
      this.emit("error", new Error("connect ECONNREFUSED"));
      this.emit("close", { code: 1006, reason: "" });
    }
  }
  const sockets = [];
  const newSocket = () => sockets[sockets.push(new Failing()) - 1];
  const waits = [];
  const schedule = (callback, seconds) => waits.push([callback, seconds]);
  const address = () => ({ url: "ws://x", protocols: [] });
  new MotionStream(address, new MotionPlayer({}), {}, { newSocket, schedule, now: () => 5 });
  sockets[0].fail();
  waits.find(([, seconds]) => seconds === 0.5)[0]();
  assert.equal(sockets.length, 2);
});
