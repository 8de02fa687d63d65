// How `follow` comes back, against a server that answers as the test says.

import assert from "node:assert/strict";
import { test } from "node:test";
import { create, fromBinary, toBinary } from "@bufbuild/protobuf";
import { Server, ServerCredentials, status } from "@grpc/grpc-js";
import { StreamMotionRequestSchema, StreamMotionResponseSchema } from "../src/gen/wayfarer/v1/motion_pb.js";
import { connect, follow } from "../src/index.js";

const METHOD = {
  streamMotion: {
    path: "/wayfarer.v1.MotionService/StreamMotion",
    requestStream: false,
    responseStream: true,
    requestSerialize: (message) => message,
    requestDeserialize: (bytes) => fromBinary(StreamMotionRequestSchema, bytes),
    responseSerialize: (message) =>
      Buffer.from(toBinary(StreamMotionResponseSchema, create(StreamMotionResponseSchema, message))),
    responseDeserialize: (bytes) => bytes,
  },
};
const header = { payload: { case: "header", value: { resumed: false } } };
const batch = (resumeToken) => ({ payload: { case: "batch", value: { resumeToken } } });
const refused = (code) => ({ code, details: "refused" });

/** A server that plays one script per stream, and what it was asked. */
async function playing(scripts) {
  const asked = [];
  const server = new Server();
  server.addService(METHOD, {
    streamMotion(call) {
      asked.push([call.request.resumeToken, call.metadata.get("x-api-key")[0]]);
      for (const step of scripts.shift() ?? []) {
        if (step.code !== undefined) return call.emit("error", step);
        call.write(step);
      }
      return call.end();
    },
  });
  const port = await new Promise((resolve, reject) => {
    server.bindAsync("127.0.0.1:0", ServerCredentials.createInsecure(), (error, bound) =>
      error ? reject(error) : resolve(bound));
  });
  const client = connect(`127.0.0.1:${port}`, { apiKey: "wf_1" });
  return { client, asked, end: () => [client.close(), server.forceShutdown()] };
}

async function tokens(client, options) {
  const found = [];
  for await (const { payload } of follow(client, { sessionId: "s" }, options)) {
    if (payload.case === "batch") found.push(payload.value.resumeToken);
  }
  return found;
}

test("a lost stream goes on where it was", async () => {
  const { client, asked, end } = await playing([
    [header, batch("t0"), batch("t1"), refused(status.UNAVAILABLE)],
    [refused(status.RESOURCE_EXHAUSTED)],
    [header, batch("t2")],
  ]);
  assert.deepEqual(await tokens(client), ["t0", "t1", "t2"]);
  assert.deepEqual(asked, [["", "wf_1"], ["t1", "wf_1"], ["t1", "wf_1"]]);
  end();
});

test("a refusal that will not pass is thrown", async () => {
  const { client, end } = await playing([[refused(status.NOT_FOUND)], [refused(status.RESOURCE_EXHAUSTED)]]);
  await assert.rejects(tokens(client), { code: status.NOT_FOUND });
  await assert.rejects(tokens(client), { code: status.RESOURCE_EXHAUSTED });
  end();
});

test("after the deadline it gives up", async () => {
  const { client, asked, end } = await playing(Array.from({ length: 50 }, () => [refused(status.UNAVAILABLE)]));
  await assert.rejects(tokens(client, { deadlineMs: 500 }), { code: status.UNAVAILABLE });
  assert.ok(asked.length > 2);
  end();
});
