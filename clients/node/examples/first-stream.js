// One person walks to a goal; prints where she is. node examples/first-stream.js [address]

import { EventKind, connect, follow, unpackChunks } from "../src/index.js";

const client = connect(process.argv[2] ?? "localhost:50051");
const { session } = await client.sessions.createSession();
const { sessionId } = session;
const { agents: [ada] } = await client.agents.createAgents({ sessionId, agents: [{ name: "Ada" }] });
await client.goals.setGoal({ agentId: ada.agentId, goal: { position: { x: 2, z: 3 } } });

let header;
for await (const { payload } of follow(client, { sessionId })) {
  if (payload.case === "header") header = payload.value;
  if (payload.case === "batch") {
    for (const { firstFrame, frames } of unpackChunks(payload.value.chunks, header)) {
      const [x, , z] = frames.at(-1);
      console.log(`frame ${firstFrame}: (${x.toFixed(2)}, ${z.toFixed(2)})`);
    }
  }
  if (payload.case === "event" && payload.value.kind === EventKind.PATH_DONE) break;
}
await client.sessions.deleteSession({ sessionId });
client.close();
