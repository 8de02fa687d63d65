// Session, agents, goals, stream, goal change, disconnect, resume, against the server that
// WAYFARER_ADDRESS names (tests/clients/test_node.py starts one).

import assert from "node:assert/strict";
import { test } from "node:test";
import { status } from "@grpc/grpc-js";
import {
  Basis, ChunkFlag, EventKind, Gender, PoseEncoding, PoseProfile, connect, follow, unpackChunks,
} from "../src/index.js";

const address = process.env.WAYFARER_ADDRESS;
const options = { skip: address ? false : "WAYFARER_ADDRESS names no server" };

test("session, agents, goals, stream, goal change, resume", options, async () => {
  const client = connect(address);
  const { session } = await client.sessions.createSession({ basis: Basis.UNITY, seed: 7 });
  const { sessionId } = session;
  const { agents } = await client.agents.createAgents({
    sessionId,
    agents: [{ name: "Ada" }, { name: "Bo", gender: Gender.MALE, position: { x: 2 }, phenotype: { heightM: 1.9 } }],
  });
  const [ada] = agents;
  const first = await client.goals.setGoal({ agentId: ada.agentId, goal: { position: { z: 3 } } });
  assert.equal(first.revision, 1);

  const format = { encoding: PoseEncoding.SMALLEST_THREE, profile: PoseProfile.BONES, bones: ["pelvis", "head"], fps: 20 };
  const request = { sessionId, format };
  let header;
  let last; // Ada's last chunk
  let token;
  let travelled = 0;
  for await (const { payload } of follow(client, request)) {
    if (payload.case === "header") header = payload.value;
    if (payload.case !== "batch") continue;
    token = payload.value.resumeToken;
    const chunks = unpackChunks(payload.value.chunks, header);
    for (const chunk of chunks.filter(({ alias }) => alias === ada.alias)) {
      if (!last) assert.ok(chunk.flags & ChunkFlag.FIRST);
      last = chunk;
      const { frames, contacts } = chunk;
      assert.equal(frames.length, 4); // 8 at 40 fps are 4 at 20
      assert.equal(contacts.length, 4);
      for (const frame of frames) {
        for (const bone of [3, 7]) assert.ok(Math.abs(Math.hypot(...frame.subarray(bone, bone + 4)) - 1) < 1e-5);
      }
      travelled = frames.at(-1)[2];
    }
    if (travelled > 0.5) break;
  }
  assert.deepEqual([...header.bones], [0, 15]);
  assert.deepEqual([header.sentFps, header.frameBytes, header.resumed], [20, 24, false]);

  // another goal while nobody listens; what was missed comes first, without a gap
  await assert.rejects(
    client.goals.setGoal({ agentId: ada.agentId, goal: { position: { x: -1 } }, expectedRevision: 0 }),
    { code: status.ABORTED },
  );
  const change = await client.goals.setGoal({
    agentId: ada.agentId, goal: { position: { x: 0.3, z: travelled + 0.8 } }, expectedRevision: first.revision,
  });
  assert.equal(change.revision, 2);
  await new Promise((resolve) => setTimeout(resolve, 600));
  const events = [];
  for await (const { payload } of follow(client, { ...request, resumeToken: token })) {
    if (payload.case === "header") assert.equal(payload.value.resumed, true);
    if (payload.case === "event") {
      events.push(payload.value.kind);
      if (payload.value.kind === EventKind.PATH_DONE) break;
    }
    if (payload.case !== "batch") continue;
    const chunks = unpackChunks(payload.value.chunks, header);
    for (const chunk of chunks.filter(({ alias }) => alias === ada.alias)) {
      assert.equal(chunk.seq, last.seq + 1n);
      last = chunk;
    }
  }
  assert.equal(last.goalRevision, 2);
  assert.ok(events.includes(EventKind.GOAL_REACHED) && !events.includes(EventKind.GAP));

  await client.sessions.deleteSession({ sessionId });
  await assert.rejects(client.sessions.getSession({ sessionId }), { code: status.NOT_FOUND });
  client.close();
});

test("control: commands are answered, motion comes beside them", options, async () => {
  const client = connect(address);
  const { session: { sessionId } } = await client.sessions.createSession();
  const { agents: [agent] } = await client.agents.createAgents({ sessionId, agents: [{}] });
  const { agentId } = agent;
  const control = client.control.control();
  control.write({ payload: { case: "open", value: { sessionId } } });
  control.write({ commandId: 5n, payload: { case: "setGoal", value: { agentId, goal: { position: { z: 2 } } } } });
  control.write({ commandId: 6n, payload: { case: "clearGoal", value: { agentId, expectedRevision: 0 } } });
  const replies = new Map();
  let batches = 0;
  for await (const { payload } of control) {
    if (payload.case === "reply") replies.set(payload.value.commandId, payload.value);
    const motion = payload.case === "motion" ? payload.value : null;
    if (motion?.payload.case === "batch") {
      batches += 1;
      const { resumeToken, chunks } = motion.payload.value;
      const playheadUs = chunks?.scheduledAtUs[0] ?? motion.sentAtUs;
      control.write({ payload: { case: "ack", value: { resumeToken, playheadUs } } });
    }
    if (batches >= 5 && replies.size === 2) break;
  }
  assert.equal(replies.get(5n).revision, 1);
  assert.equal(replies.get(6n).problem.code, status.ABORTED);
  await client.sessions.deleteSession({ sessionId });
  client.close();
});
