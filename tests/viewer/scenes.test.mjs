import assert from "node:assert/strict";
import { test } from "node:test";
import { Latest } from "../../viewer/latest_call.js";
import {
  choicesOf, crateOn, meshFormat, outlinesOf, prismOf, SceneBook,
} from "../../viewer/scenes.js";

const OUTLINES = {
  vertices: [0, 0, 0, 4, 0, 0, 4, 0.5, 4], triangles: [0, 1, 2], version: 3,
  solids: [{ top: [0, 2, 0, 1, 2, 0, 1, 2, 1], bottom: 0, name: "" }],
  obstacles: [{ top: [2, 1, 2, 3, 1, 2, 3, 1, 3], bottom: 0, name: "door" }],
};

test("outlines are read as points, triangles and blocks", () => {
  const { vertices, triangles, solids, obstacles, version } = outlinesOf(OUTLINES);
  assert.deepEqual(vertices[2], { x: 4, y: 0.5, z: 4 });
  assert.deepEqual(triangles, [[0, 1, 2]]);
  assert.deepEqual(solids, [{ top: [{ x: 0, y: 2, z: 0 }, { x: 1, y: 2, z: 0 }, { x: 1, y: 2, z: 1 }], bottom: 0 }]);
  assert.deepEqual([...obstacles.keys()], ["door"]);
  assert.equal(version, 3);
});

test("an example that is there is joined; scenes of one's own come after", () => {
  const examples = [{ name: "town_square", summary: "A square." }, { name: "corridor", summary: "" }];
  const scenes = [{ scene_id: "s-1", name: "corridor" }, { scene_id: "s-2", name: "my.glb" }, { scene_id: "s-3", name: "" }];
  assert.deepEqual(choicesOf(examples, scenes).map(({ value, text, scene }) => [value, text, scene]), [
    ["town_square", "town square", undefined],
    ["corridor", "corridor", "s-1"],
    ["s-2", "my.glb", "s-2"],
    ["s-3", "s-3", "s-3"],
  ]);
});

test("a crate stands on its point, and is a prism to the API", () => {
  const { prism } = prismOf(crateOn({ x: 1, y: 0.5, z: -2 }));
  assert.equal(prism.outline.length, 4);
  assert.equal(prism.bottom, 0.5);
  assert.ok(Math.abs(prism.height - 0.9) < 1e-9);
  assert.equal(prism.outline.reduce((sum, { x }) => sum + x, 0) / 4, 1);
});

test("only level files are taken", () => {
  assert.equal(meshFormat("Level.GLB"), "glb");
  assert.equal(meshFormat("a.b.ply"), "ply");
  assert.equal(meshFormat("glb"), "glb"); // a file may be called so
  assert.equal(meshFormat("level.fbx"), null);
});

test("of calls that come too fast, the first and the last are made", async () => {
  const sent = [];
  const waiting = [];
  const latest = new Latest((value) => {
    sent.push(value);
    return new Promise((done) => waiting.push(done));
  }, assert.fail);
  const all = [1, 2, 3, 4].map((value) => latest.push(value));
  assert.deepEqual(sent, [1]);
  waiting.shift()();
  await new Promise(setImmediate);
  assert.deepEqual(sent, [1, 4]);
  waiting.shift()();
  await Promise.all(all);
  latest.push(5);
  assert.deepEqual(sent, [1, 4, 5]);
});

test("a failure is told, and the next call is made all the same", async () => {
  const failures = [];
  const latest = new Latest((value) => (value === 1 ? Promise.reject(new Error("no")) : Promise.resolve()), (error) => failures.push(error.message));
  await latest.push(1);
  await latest.push(2);
  assert.deepEqual(failures, ["no"]);
});

/** A server with one scene: obstacles are blocks by name. */
class FakeServer {
  constructor() {
    this.obstacles = {};
    this.version = 0;
    this.puts = [];
    this.refuses = false;
  }

  async scene() {
    if (this.gone) throw Object.assign(new Error("no scene"), { status: 404 });
    return { version: this.version };
  }

  async sceneOutlines() {
    const obstacles = Object.entries(this.obstacles).map(([name, { prism }]) => (
      { name, bottom: prism.bottom, top: prism.outline.flatMap(({ x, y, z }) => [x, y, z]) }
    ));
    return { ...OUTLINES, obstacles, version: this.version };
  }

  async putObstacle(id, name, obstacle) {
    this.puts.push([id, name]);
    if (this.refuses) throw Object.assign(new Error("no free ground would be left"), { status: 409 });
    this.obstacles[name] = obstacle;
    this.version += 1;
  }

  async removeObstacle(id, name) {
    delete this.obstacles[name];
    this.version += 1;
  }
}

async function opened() {
  const server = new FakeServer();
  const told = { changed: [], moved: 0, failed: [], gone: 0 };
  const book = new SceneBook(server, {
    changed: (outlines) => told.changed.push([...outlines.obstacles.keys()]),
    moved: () => (told.moved += 1),
    failed: (error) => told.failed.push(error.message),
    gone: () => (told.gone += 1),
  });
  await book.open("s-1");
  return { server, book, told };
}

test("a crate shows at once, and then as the server has it", async () => {
  const { server, book, told } = await opened();
  const adding = book.addCrate({ x: 0, y: 0, z: 0 });
  assert.equal(told.moved, 1);
  assert.equal(book.obstacles.size, 1);
  const name = await adding;
  assert.deepEqual(server.puts, [["s-1", name]]);
  assert.deepEqual(told.changed, [[], [name]]);
  assert.equal(book.version, 1);
  await book.remove(name);
  assert.deepEqual(told.changed.at(-1), []);
});

test("a crate that is refused is told and taken back", async () => {
  const { server, book, told } = await opened();
  server.refuses = true;
  await book.addCrate({ x: 0, y: 0, z: 0 });
  assert.deepEqual(told.failed, ["no free ground would be left"]);
  assert.equal(book.obstacles.size, 0);
});

test("what others change is seen, what nobody changed is not asked for", async () => {
  const { server, book, told } = await opened();
  await book.poll();
  assert.equal(told.changed.length, 1);
  await server.putObstacle("s-1", "theirs", prismOf(crateOn({ x: 1, y: 0, z: 1 })));
  await book.poll();
  assert.deepEqual(told.changed.at(-1), ["theirs"]);
  server.gone = true;
  await book.poll();
  assert.equal(told.gone, 1);
});

test("a scene that opens slowly is asked for once, and after a failure again", async () => {
  const server = new FakeServer();
  const { sceneOutlines } = server;
  const asked = [];
  let fail;
  server.sceneOutlines = () => new Promise((_, reject) => {
    asked.push("outlines");
    fail = reject;
  });
  const book = new SceneBook(server, { changed() {}, failed() {} });
  const opening = book.open("s");
  await book.poll();
  assert.deepEqual(asked, ["outlines"]);
  fail(new Error("no answer"));
  await assert.rejects(opening, /no answer/);
  server.sceneOutlines = sceneOutlines;
  await book.poll();
  assert.equal(book.version, 0);
});

test("an answer about a scene that was left is not shown", async () => {
  const { server, book, told } = await opened();
  const before = told.changed.length;
  let answer;
  server.sceneOutlines = () => new Promise((done) => (answer = done));
  server.version = 9;
  const polling = book.poll();
  await new Promise(setImmediate);
  await book.open("");
  answer({ ...OUTLINES, version: 9 });
  await polling;
  assert.equal(told.changed.length, before);
});
