// CPU time of people who walk in local mode, by how many there are. node test/local_speed.js EXPORT

import { readFile } from "node:fs/promises";
import { pathToFileURL } from "node:url";
import { openExport } from "../src/local/graphs.js";
import { LocalWorld } from "../src/local/world.js";

const ort = await import("onnxruntime-web/wasm");
ort.env.wasm.numThreads = 1;
ort.env.wasm.wasmPaths = new URL(".", import.meta.resolve("onnxruntime-web/wasm")).href;
const folder = `${pathToFileURL(process.argv[2]).href}/`;
const { about, bodies, run } = await openExport(async (name) => {
  const { buffer, byteOffset, byteLength } = await readFile(new URL(name, folder));
  return buffer.slice(byteOffset, byteOffset + byteLength);
}, ort);
const cpu = () => {
  const { user, system } = process.cpuUsage();
  return (user + system) / 1000;
};

for (const [count, steps] of [[1, 100], [10, 50], [30, 30], [50, 30]]) {
  let graph = 0;
  const world = new LocalWorld(about, bodies, async (gender, feeds) => {
    const before = cpu(), outputs = await run(gender, feeds);
    graph += cpu() - before;
    return outputs;
  });
  for (let k = 0; k < count; k += 1) {
    world.add({ gender: k % 2 ? "male" : "female", x: 2 * k, seed: BigInt(k) }, 0).give([{ x: 2 * k, y: 1000 }], 0);
  }
  await world.advance(80, () => {});
  const [rows, began] = [world.stats.rows, cpu()];
  graph = 0;
  await world.advance(80 + 8 * steps, () => {});
  const made = world.stats.rows - rows, all = cpu() - began;
  console.log(`${count} people: ${(graph / made).toFixed(2)} ms in WASM and ${((all - graph) / made).toFixed(2)} in JavaScript`
    + ` per person and 0.2 s: ${Math.floor((200 * made) / all)} people per core`);
}
