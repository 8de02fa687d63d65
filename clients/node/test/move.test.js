// A Control stream whose node is drained or killed, in the cluster that WAYFARER_CLUSTER names (tests/clients/test_node.py
// starts one, and does that to the node; WAYFARER_KILLED: it is killed).

import assert from "node:assert/strict";
import { test } from "node:test";
import { connect, unpackChunks } from "../src/index.js";

const address = process.env.WAYFARER_CLUSTER;
const skip = address ? false : "WAYFARER_CLUSTER names no cluster";

const killed = Boolean(process.env.WAYFARER_KILLED); // the other node goes on from a copy of up to a second before

test(`control goes on where its session is${killed ? "" : ", without a gap"}`, { skip, timeout: 60_000 }, async () => {
  const client = connect(address);
  const { session: { sessionId } } = await client.sessions.createSession();
  const { agents: [{ agentId }] } = await client.agents.createAgents({ sessionId, agents: [{}] });
  const control = client.control.control();
  const goal = (commandId, z) => control.write({
    commandId, payload: { case: "setGoal", value: { agentId, goal: { position: { z } } } },
  });
  control.write({ payload: { case: "open", value: { sessionId } } });
  goal(1n, 50);
  const headers = [], seqs = [], revisions = [];
  for await (const { payload: { case: kind, value } } of control) {
    if (kind === "reply") revisions.push(value.revision);
    else if (value.payload.case === "header") {
      headers.push(value.payload.value);
      if (headers.length === 2) goal(2n, -50);
    } else if (value.payload.case === "batch") {
      seqs.push(...unpackChunks(value.payload.value.chunks, headers.at(-1)).map(({ seq }) => seq));
    }
    if (headers.length === 2 && revisions.length === 2) break;
  }
  assert.deepEqual(revisions, [1, 2]);
  if (!killed) {
    assert.equal(headers[1].resumed, true);
    assert.deepEqual(seqs, seqs.map((_, k) => seqs[0] + BigInt(k)));
  }
  assert.ok(seqs.length > 5);
  await client.sessions.deleteSession({ sessionId });
  client.close();
});
