// Velocities that local mode lets people take among others. node test/local_avoid.js CROWDS.json [SCENE]

import { readFile } from "node:fs/promises";
import { pathToFileURL } from "node:url";
import { wayAround } from "../src/local/around.js";
import { avoid } from "../src/local/avoidance.js";
import { lane } from "../src/local/lanes.js";
import { turn } from "../src/local/passages.js";
import { LocalScene } from "../src/local/scene.js";

const [crowds, scenery] = process.argv.slice(2);
const scene = await LocalScene.read(async (name) => {
  const { buffer, byteOffset, byteLength } = await readFile(new URL(name, `${pathToFileURL(scenery).href}/`));
  return buffer.slice(byteOffset, byteOffset + byteLength);
});
const { people, ways, grids } = JSON.parse(await readFile(crowds, "utf8"));
const clear = (x, y) => scene.distance(x, y);
console.log(JSON.stringify({
  chosen: people.map((crowd) => crowd.map((self) => avoid(crowd, self, self.preferred, clear, 0.2, self.left, self.width))),
  lanes: people.map((crowd) => crowd.map((self) => lane(crowd, self, self.way, clear))),
  turns: people.map((crowd) => crowd.map((self) => turn(crowd, self, self.ahead, clear))),
  around: grids.map(({ room, columns }) => wayAround(
    { room: Float64Array.from(room), rows: room.length / columns, columns }, [0, 0], [room.length / columns - 1, columns - 1])),
  ways: ways.map(({ from, to }) => scene.path(from, to)),
}));
