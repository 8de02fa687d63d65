// Calls that are refused for now, against a server that answers as the test says.

import assert from "node:assert/strict";
import { test } from "node:test";
import { Metadata, Server, ServerCredentials, status } from "@grpc/grpc-js";
import { connect, retryAfterMs } from "../src/index.js";

// google.rpc.Status { code: 8, details: [ErrorInfo { reason: "X" }, RetryInfo { 0.2 s }] }, as grpcio packs it
const anyOf = (type, value) => {
  const url = Buffer.from(`type.googleapis.com/google.rpc.${type}`);
  const any = Buffer.concat([Buffer.from([0x0a, url.length]), url, Buffer.from([0x12, value.length]), value]);
  return Buffer.concat([Buffer.from([0x1a, any.length]), any]);
};
const NANOS = Buffer.from([0x10, 0x80, 0x84, 0xaf, 0x5f]); // 200,000,000
const RETRY = anyOf("RetryInfo", Buffer.concat([Buffer.from([0x0a, NANOS.length]), NANOS]));
const INFO = anyOf("ErrorInfo", Buffer.from([0x0a, 0x01, 0x58]));
const STATUS = Buffer.concat([Buffer.from([0x08, 0x08]), INFO, RETRY]);

function refusal(details) {
  const metadata = new Metadata();
  if (details) metadata.set("grpc-status-details-bin", details);
  return { code: status.RESOURCE_EXHAUSTED, details: "no room", metadata };
}

/** A server that refuses the first `refusals` calls; how often it was called. */
async function refusing(refusals, timeoutMs) {
  const calls = { count: 0 };
  const server = new Server();
  const bytes = { requestSerialize: (b) => b, requestDeserialize: (b) => b, responseSerialize: (b) => b, responseDeserialize: (b) => b };
  const path = "/wayfarer.v1.SessionService/DeleteSession";
  server.addService({ deleteSession: { path, requestStream: false, responseStream: false, ...bytes } }, {
    deleteSession(_, answer) {
      calls.count += 1;
      const next = refusals.shift();
      if (next) answer(next);
      else answer(null, Buffer.alloc(0));
    },
  });
  const port = await new Promise((resolve, reject) => {
    server.bindAsync("127.0.0.1:0", ServerCredentials.createInsecure(), (error, bound) =>
      error ? reject(error) : resolve(bound));
  });
  const client = connect(`127.0.0.1:${port}`, { timeoutMs });
  return { client, calls, end: () => [client.close(), server.forceShutdown()] };
}

test("the time to wait is read from the details", () => {
  assert.equal(retryAfterMs(refusal(STATUS)), 200);
  assert.equal(retryAfterMs(refusal(INFO)), 0);
  assert.equal(retryAfterMs(refusal(Buffer.from([0xff, 0xff]))), 0);
  assert.equal(retryAfterMs(refusal()), 0);
  assert.equal(retryAfterMs({ ...refusal(STATUS), code: status.INTERNAL }), 0);
});

test("a call that is refused for now is sent again when the server has said", async () => {
  const { client, calls, end } = await refusing([refusal(STATUS), refusal(STATUS)], 10_000);
  try {
    await client.sessions.deleteSession({ sessionId: "s" });
    assert.equal(calls.count, 3);
  } finally {
    end();
  }
});

test("not for ever, and not where the server has named no time", async () => {
  const forever = Array.from({ length: 100 }, () => refusal(STATUS));
  for (const [refusals, most] of [[forever, 5], [[refusal()], 1]]) {
    const { client, calls, end } = await refusing(refusals, 700);
    try {
      await assert.rejects(client.sessions.deleteSession({ sessionId: "s" }), { code: status.RESOURCE_EXHAUSTED });
      assert.ok(calls.count <= most);
    } finally {
      end();
    }
  }
});
