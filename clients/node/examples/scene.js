// A yard with a wall: somebody finds her way around it, and around a crate that is put there as she
// walks. node examples/scene.js [address]

import { EventKind, connect, follow } from "../src/index.js";

const client = connect(process.argv[2] ?? "localhost:50051", { timeoutMs: 60_000 });
const corner = (x, z) => ({ x, z });
const box = (x, z, width, depth) => ({
  shape: { case: "box", value: { position: { x, z }, size: { x: width, y: 2, z: depth } } },
});

const { scene } = await client.scenes.createScene({
  name: "yard",
  floors: [{ outline: [corner(-5, -5), corner(5, -5), corner(5, 5), corner(-5, 5)] }],
  solids: [box(0, 0, 4, 0.3)],
});
const { sceneId } = scene;
console.log(`${scene.areaM2.toFixed(0)} m²`);

const { session: { sessionId } } = await client.sessions.createSession({ scene: sceneId });
const { agents: [ada] } = await client.agents.createAgents({
  sessionId,
  agents: [{ name: "Ada", position: { z: -2 } }],
});
const goal = { position: { x: 0, z: 2 } };
const way = await client.scenes.queryPath({ sceneId, start: { z: -2 }, goal: goal.position });
console.log(`${way.length.toFixed(1)} m around the wall`);
await client.goals.setGoal({ agentId: ada.agentId, goal });
const change = await client.scenes.putObstacle({ sceneId, name: "crate", obstacle: box(2.8, 0, 1, 1) });
console.log(`version ${change.scene.version}`);

for await (const { payload } of follow(client, { sessionId })) {
  if (payload.case === "event") console.log(EventKind[payload.value.kind], payload.value.detail);
  if (payload.case === "event" && payload.value.kind === EventKind.PATH_DONE) break;
}
await client.sessions.deleteSession({ sessionId });
await client.scenes.deleteScene({ sceneId });
client.close();
