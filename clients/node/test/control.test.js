// A Control stream whose session moves or whose connection is lost, against nodes that answer as the test says.

import assert from "node:assert/strict";
import { test } from "node:test";
import { setTimeout as sleep } from "node:timers/promises";
import { create, fromBinary, toBinary } from "@bufbuild/protobuf";
import { Metadata, Server, ServerCredentials, status } from "@grpc/grpc-js";
import { ControlRequestSchema, ControlResponseSchema } from "../src/gen/wayfarer/v1/control_pb.js";
import { connect } from "../src/index.js";
import { SILENCE_MS } from "../src/patience.js";

const METHOD = {
  control: {
    path: "/wayfarer.v1.ControlService/Control",
    requestStream: true,
    responseStream: true,
    requestSerialize: (message) => message,
    requestDeserialize: (bytes) => fromBinary(ControlRequestSchema, bytes),
    responseSerialize: (message) => Buffer.from(toBinary(ControlResponseSchema, create(ControlResponseSchema, message))),
    responseDeserialize: (bytes) => bytes,
  },
};
const SESSION = "session-00ff12";
const batch = (resumeToken) => ({ payload: { case: "motion", value: { payload: { case: "batch", value: { resumeToken } } } } });
const reply = (commandId) => ({ payload: { case: "reply", value: { commandId, revision: 1 } } });
const goal = (commandId) => ({ commandId, payload: { case: "setGoal", value: { agentId: "agent-00ff34" } } });

/** Field 1, 2 or 3 of an encoded message. */
const field = (number, content) => {
  const bytes = Buffer.from(content);
  return Buffer.concat([Buffer.from([(number << 3) | 2, bytes.length]), bytes]);
};

function misdirected(port) {
  const pair = (key, value) => field(3, Buffer.concat([field(1, key), field(2, value)]));
  const info = Buffer.concat([field(1, "MISDIRECTED"), pair("grpc_port", String(port))]);
  const any = Buffer.concat([field(1, "type.googleapis.com/google.rpc.ErrorInfo"), field(2, info)]);
  const metadata = new Metadata();
  metadata.set("grpc-status-details-bin", Buffer.concat([Buffer.from([0x08, 9]), Buffer.from([0x1a, any.length]), any]));
  return { code: status.FAILED_PRECONDITION, details: "moved", metadata };
}

/** A node that calls `play(message, call)` for each message it hears; what those were. */
async function node(play) {
  const heard = [], server = new Server();
  server.addService(METHOD, {
    control(call) {
      call.on("data", (message) => {
        heard.push(message);
        play(message, call);
      });
      call.on("end", () => call.end());
    },
  });
  const port = await new Promise((resolve, reject) => {
    server.bindAsync("127.0.0.1:0", ServerCredentials.createInsecure(), (error, bound) => (error ? reject(error) : resolve(bound)));
  });
  return { heard, port, end: () => server.forceShutdown() };
}

async function next(stream) {
  const { value } = await stream.next();
  return value.payload;
}

test("when its session moves, it is opened again where it lives then, and goes on", async () => {
  const there = await node(({ commandId, payload }, call) => call.write(payload.case === "open" ? batch("t3") : reply(commandId)));
  const here = await node(({ commandId, payload }, call) => {
    if (payload.case === "open") call.write(batch("t1"));
    else if (commandId === 1n) [reply(1n), batch("t2")].forEach((message) => call.write(message));
    else if (commandId === 2n) call.emit("error", misdirected(there.port)); // it is not answered any more
  });
  const client = connect(`127.0.0.1:${here.port}`);
  try {
    const control = client.control.control(), stream = control[Symbol.asyncIterator]();
    const interest = { rings: [{ radius: 5 }], viewpoints: [] };
    control.write({ payload: { case: "open", value: { sessionId: SESSION, interest } } });
    assert.equal((await next(stream)).case, "motion");
    control.write({ payload: { case: "viewpoints", value: { viewpoints: [{ position: { x: 7 } }] } } });
    control.write(goal(1n));
    assert.equal((await next(stream)).value.commandId, 1n);
    await next(stream);
    control.write(goal(2n));
    const { case: kind, value } = await next(stream);
    assert.deepEqual([kind, value.commandId, value.problem.code], ["reply", 2n, status.UNAVAILABLE]);
    assert.equal((await next(stream)).value.payload.value.resumeToken, "t3");
    control.write(goal(3n));
    assert.equal((await next(stream)).value.commandId, 3n);
    const [open, ...others] = there.heard;
    assert.deepEqual([open.payload.value.sessionId, open.payload.value.resumeToken], [SESSION, "t2"]);
    assert.equal(open.payload.value.interest.viewpoints[0].position.x, 7);
    assert.deepEqual(others.map(({ commandId }) => commandId), [3n]);
    control.end();
    assert.ok((await stream.next()).done);
  } finally {
    client.close();
    here.end();
    there.end();
  }
});

test("another error ends it", async () => {
  const here = await node((_, call) => {
    call.write(batch("t1"));
    call.emit("error", { code: status.UNAUTHENTICATED, details: "the key is gone" });
  });
  const client = connect(`127.0.0.1:${here.port}`);
  try {
    const control = client.control.control(), stream = control[Symbol.asyncIterator]();
    control.write({ payload: { case: "open", value: { sessionId: SESSION } } });
    await assert.rejects(async () => { for (;;) await next(stream); }, { code: status.UNAUTHENTICATED });
  } finally {
    client.close();
    here.end();
  }
});

const lost = { code: status.UNAVAILABLE, details: "the node is gone" };

/** A Control stream to a node that breaks off when it hears command 1, and refuses the next `refusals` openings. */
async function broken(refusals, options) {
  let opened = 0;
  const here = await node(({ commandId, payload }, call) => {
    if (payload.case === "open" && opened++ > 0 && opened <= refusals + 1) call.emit("error", lost);
    else if (payload.case === "open") call.write(batch(`t${opened}`));
    else if (commandId === 1n) call.emit("error", lost);
    else call.write(reply(commandId));
  });
  const client = connect(`127.0.0.1:${here.port}`);
  const control = client.control.control(options), stream = control[Symbol.asyncIterator]();
  control.write({ payload: { case: "open", value: { sessionId: SESSION } } });
  await next(stream);
  control.write(goal(1n));
  return { here, control, stream, end: () => [client.close(), here.end()] };
}

test("when its connection is lost, it is made again and goes on where it was", async () => {
  const { here, control, stream, end } = await broken(2);
  try {
    const { value: { commandId, problem } } = await next(stream);
    assert.deepEqual([commandId, problem.code], [1n, status.UNAVAILABLE]);
    control.write(goal(2n)); // while there is no connection
    const kinds = [await next(stream), await next(stream)];
    assert.equal(kinds[0].value.payload.value.resumeToken, "t4");
    assert.equal(kinds[1].value.commandId, 2n);
    const openings = here.heard.filter(({ payload }) => payload.case === "open").map(({ payload }) => payload.value.resumeToken);
    assert.deepEqual(openings, ["", "t1", "t1", "t1"]);
    control.end();
    assert.ok((await stream.next()).done);
  } finally {
    end();
  }
});

test("after the deadline it gives up", async () => {
  const { stream, end } = await broken(50, { deadlineMs: 500 });
  try {
    await next(stream); // command 1 is answered
    await assert.rejects(next(stream), { code: status.UNAVAILABLE });
  } finally {
    end();
  }
});

test("a stream that the server has ended is not made again, however long it is kept", async () => {
  const here = await node((_, call) => {
    call.write(batch("t1"));
    call.end();
  });
  const client = connect(`127.0.0.1:${here.port}`);
  try {
    const control = client.control.control();
    control.write({ payload: { case: "open", value: { sessionId: SESSION } } });
    await new Promise((resolve) => control.on("data", () => {}).on("end", resolve));
    await sleep(SILENCE_MS + 300);
    assert.equal(here.heard.length, 1);
    control.end();
  } finally {
    client.close();
    here.end();
  }
});
