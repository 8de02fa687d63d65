// The reports of a local session whose model fails, as JSON. node test/local_failure.js EXPORT

import { readFile } from "node:fs/promises";
import { pathToFileURL } from "node:url";
import { LocalHost } from "../src/local/host.js";
import { unpacked } from "../src/local/unpacked.js";

const folder = `${pathToFileURL(process.argv[2]).href}/`;
const read = async (name) => {
  const { buffer, byteOffset, byteLength } = await readFile(new URL(name, folder));
  return unpacked(buffer.slice(byteOffset, byteOffset + byteLength));
};
const about = JSON.parse(new TextDecoder().decode(await read("wayfarer.json")));
const bodies = { female: await read("body_female.bin") };
const told = [];
const run = async () => { throw new Error("the graph cannot be run"); };
const host = new LocalHost({ about, bodies, run }, (message) => told.push(message));
host.add({ gender: "female", betas: new Array(10).fill(0), x: 0, y: 0, heading: 0, seed: 1n, footLock: true });
await new Promise((done) => setTimeout(done, 1000));
console.log(JSON.stringify(told));
