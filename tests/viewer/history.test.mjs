import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { vrmAnimation, withMotion } from "../../viewer/animated_glb.js";
import { BONES, PARENTS, PoseTrack, multiply, rotate } from "../../viewer/client/index.js";
import { History } from "../../viewer/history.js";
import { decodePast, pastOf } from "../../viewer/packed_past.js";
import { decodeScript, encodeScript, scriptOf } from "../../viewer/script.js";
import { Timeline } from "../../viewer/timeline.js";

const WIDTH = 7; // hips and one bone

/** A person walks along z at 1 m/s from `begin` to `end`. The left foot stands in even half seconds, the right in odd ones. */
function walker(alias, begin, end) {
  const track = new PoseTrack(WIDTH);
  for (let time = begin; time < end; time += 0.2) {
    const frames = [], contacts = [];
    for (let k = 0; k < 8; k += 1) {
      frames.push(0, 1, time + k / 40, 0, 0, 0, 1);
      contacts.push(Math.floor((time + k / 40) * 2 + 1e-6) % 2 ? 2 : 1);
    }
    track.push(time, 40, frames, 8, contacts);
  }
  return { agent: { alias }, played: { track, frame: new Float32Array(WIDTH) } };
}

test("what was shown is shown again, at any moment of the last minute and no other", () => {
  const history = new History();
  const ada = walker(1, 100, 109);
  for (let now = 100.5; now < 107; now += 0.7) history.note(now, [ada]); // few pictures: nothing is lost between
  const frame = new Float32Array(WIDTH);
  for (const moment of [101, 103.33, 106.2]) {
    assert.ok(history.sample(1, moment, frame));
    assert.ok(Math.abs(frame[2] - moment) < 0.005);
  }
  assert.equal(history.sample(1, 99, frame), false);
  assert.equal(history.sample(1, 110, frame), false);
  assert.equal(history.sample(2, 103, frame), false);
  const { speeds, contacts } = history.strip(1, 101, 106, 50);
  assert.ok(speeds.slice(5, 45).every((speed) => Math.abs(speed - 1) < 0.05));
  assert.deepEqual([contacts[2], contacts[7]], [1, 2]);
});

test("only a minute is kept, and another stream begins anew", () => {
  const history = new History();
  for (let start = 0; start < 80; start += 4) {
    const part = walker(1, start, start + 5);
    for (let now = start; now < start + 4; now += 0.1) history.note(now, [part]);
  }
  assert.ok(history.last - history.first <= 60.001 && history.last - history.first > 59);
  assert.equal(history.sample(1, history.first - 1, new Float32Array(WIDTH)), false);
  history.note(1000, []);
  assert.equal(history.first, 1000);
});

test("of a crowd fewer frames each are kept, and all of them when most people have left", () => {
  const history = new History();
  const frame = new Float32Array(WIDTH);
  for (let now = 0; now < 90; now += 0.1) {
    const part = walker(1, now - 0.2, now + 0.2);
    const others = Array.from({ length: now < 70 ? 599 : 0 }, (_, k) => ({ agent: { alias: 2 + k }, played: { since: Infinity } }));
    history.note(now, [part, ...others]);
  }
  const { count } = history.tracks.get(1); // 40 s of 10 frames a second, and 20 of 30
  assert.ok(count > 950 && count < 1050, `${count} frames`);
  for (const moment of [30.5, 45, 69.9, 70.4, 80, 89.5]) {
    assert.ok(history.sample(1, moment, frame));
    assert.ok(Math.abs(frame[2] - moment) < 0.005, `${frame[2]} at ${moment}`);
  }
});

test("the timeline pauses, scrubs, steps, lags in slow motion, and comes back to now", () => {
  const history = { first: 40, last: 100 };
  const timeline = new Timeline(history);
  assert.equal(timeline.advance(1), null);
  timeline.pause();
  assert.equal(timeline.advance(5), 100);
  timeline.scrub(0.5);
  assert.equal(timeline.advance(5), 70);
  timeline.step(3);
  assert.ok(Math.abs(timeline.advance(0) - 70.1) < 1e-9);
  timeline.setRate(0.25);
  timeline.play();
  assert.ok(Math.abs(timeline.advance(4) - 71.1) < 1e-9);
  timeline.scrub(-1);
  assert.equal(timeline.advance(0), 40);
  timeline.setRate(1);
  timeline.play();
  assert.equal(timeline.advance(100), null); // it has caught up
  assert.ok(timeline.live && timeline.share === 1);
  timeline.setRate(0.5);
  history.last = 102;
  assert.equal(timeline.advance(2), 101);
});

test("nothing is paused before there is something", () => {
  const timeline = new Timeline(new History());
  timeline.pause();
  timeline.scrub(0.2);
  timeline.step(1);
  assert.ok(timeline.live);
});

test("a script goes through a link unchanged, and a broken link is refused in words", async () => {
  const person = {
    agent: { id: "a", name: "Zoë", gender: "female", betas: Float32Array.of(0.12345, -1) }, shown: true,
    x: 1.00004, y: 0, z: -2, heading: 0.5, wanders: false, ahead: [{ x: 3, y: 0, z: 4.123456, speed: 1.2 }],
  };
  const roams = { ...person, agent: { ...person.agent, id: "b" }, wanders: true };
  const script = scriptOf({
    scene: "corridor", crates: new Map([["crate 1", { top: [{ x: 1, y: 0.9, z: 0 }], bottom: 0 }]]),
    agents: [{ agent_id: "a", seed: 4294967295 }, { agent_id: "b", seed: 0 }], people: [person, roams, { ...person, shown: false }],
    camera: { eye: [1, 2, 3], target: [0, 0, 0] },
  });
  assert.deepEqual(script.people.map(({ seed, goals }) => [seed, goals]), [[4294967295, [{ x: 3, y: 0, z: 4.1235, speed: 1.2 }]], [0, "roam"]]);
  const text = await encodeScript(script);
  assert.match(text, /^[\w-]+$/);
  assert.deepEqual(await decodeScript(text), script);
  for (const broken of ["", "x", text.slice(0, -9), await encodeScript({ version: 99, people: [] })]) {
    await assert.rejects(decodeScript(broken), /not whole/);
  }
});

test("bodies' files get one animation, and a VRM animation has bones alone", () => {
  const json = new TextEncoder().encode(JSON.stringify({
    asset: { version: "2.0" }, nodes: [{ name: "pelvis", translation: [0, 1, 0] }, { mesh: 0, skin: 0 }], buffers: [{ byteLength: 4 }],
    bufferViews: [{ buffer: 0, byteLength: 4 }], accessors: [{ bufferView: 0 }], scenes: [{ nodes: [0, 1] }],
    skins: [{ joints: [0], inverseBindMatrices: 0 }], meshes: [{ primitives: [{ attributes: { POSITION: 0 } }] }],
  }).padEnd(400));
  const glb = new Uint8Array(12 + 8 + json.length + 8 + 4);
  const view = new DataView(glb.buffer);
  [0x46546c67, 2, glb.length, json.length, 0x4e4f534a].forEach((value, k) => view.setUint32(4 * k, value, true));
  glb.set(json, 20);
  view.setUint32(20 + json.length, 4, true);
  view.setUint32(24 + json.length, 0x004e4942, true);
  const frames = Float32Array.of(0, 1, 0, 0, 0, 0, 1, 0, 1, 2, 0, 0, 0, -1); // -q is the same turn
  const people = ["Ada", "Bo"].map((name) => ({ name, glb: glb.buffer, times: [0, 0.5], frames }));
  const read = (bytes) => {
    const made = new DataView(bytes);
    const size = made.getUint32(12, true);
    assert.equal(made.getUint32(8, true), made.byteLength);
    return { made, size, document: JSON.parse(new TextDecoder().decode(new Uint8Array(bytes, 20, size))) };
  };
  const { made, size, document } = read(withMotion(people, ["pelvis"]));
  const [{ channels, samplers }] = document.animations;
  assert.deepEqual(channels.map(({ target }) => [target.node, target.path]), [[0, "translation"], [0, "rotation"], [3, "translation"], [3, "rotation"]]);
  const { byteOffset } = document.bufferViews[document.accessors[samplers[3].output].bufferView];
  assert.equal(made.getFloat32(28 + size + byteOffset + 28, true), 1); // w of the second frame
  assert.equal(document.buffers[0].byteLength, 2 * (4 + 8 + 24 + 32));
  assert.deepEqual(document.scenes[0].nodes.map((node) => document.nodes[node].name ?? document.nodes[node].mesh), ["Ada", 0, "Bo", 1]);
  assert.deepEqual(document.nodes[5].children, [3]);
  assert.deepEqual([document.skins[1], document.nodes[4]], [{ joints: [3], inverseBindMatrices: 4 }, { mesh: 1, skin: 1 }]);
  assert.throws(() => withMotion(people, ["tail"]), /no bone tail/);
  const { document: bones } = read(vrmAnimation(people[0], ["pelvis"]));
  assert.deepEqual(bones.extensions.VRMC_vrm_animation.humanoid.humanBones, { hips: { node: 0 } });
  assert.deepEqual([bones.nodes, bones.meshes, bones.buffers[0].byteLength], [[{ name: "hips", translation: [0, 1, 0] }], undefined, 8 + 24 + 32]);
});

/** Where joints are: x, y, z of each. `rest`: of each joint relative to its parent's. */
function joints(frame, rest) {
  const [turns, places, turned] = [Float64Array.from(frame.subarray(3)), new Float64Array(3 * BONES.length), new Float64Array(3)];
  places.set(frame.subarray(0, 3));
  for (let bone = 1; bone < BONES.length; bone += 1) {
    const parent = PARENTS[bone];
    rotate(turns, 4 * parent, Float64Array.from(rest[bone]), 0, turned, 0);
    for (let k = 0; k < 3; k += 1) places[3 * bone + k] = places[3 * parent + k] + turned[k];
    multiply(turns, 4 * parent, turns, 4 * bone, turns, 4 * bone);
  }
  return places;
}

test("what was seen fits into an address: within 2 cm, at the moment shared within 1 mm", async () => {
  const walk = JSON.parse(readFileSync(new URL("../golden/walk.json", import.meta.url)));
  const rest = BONES.map((_, bone) => walk.rest_offsets.slice(3 * bone, 3 * bone + 3));
  const track = new PoseTrack(3 + 4 * BONES.length), late = new PoseTrack(3 + 4 * BONES.length);
  const whole = walk.hips.map((place, k) => [...place, ...walk.rotations[k].flat()]);
  for (let k = 0; k < whole.length; k += 1) {
    track.push(k / walk.fps, walk.fps, whole[k], 1, walk.contacts, k);
    if (k >= walk.fps) late.push(k / walk.fps, walk.fps, whole[k], 1, walk.contacts, k);
  }
  const people = [track, late].map((found, alias) => ({ agent: { alias }, played: { track: found, frame: new Float32Array(91), since: alias } }));
  const history = new History();
  for (let at = 0; at < (whole.length - 2) / walk.fps; at += 0.05) history.note(at, people);
  const { text, seconds } = await pastOf(people, history, history.last, 50_000);
  assert.ok(seconds > 0.9 * (history.last - history.first) && text.length < 2 * 1200 * seconds + 400, `${text.length} characters for ${seconds} s`);
  const { count, people: [first, second] } = await decodePast(text);
  assert.equal(first.frames.length, count);
  assert.ok(Math.abs(second.frames.length - (history.last - 1) * 30) <= 1);
  const frame = new Float32Array(91);
  const off = first.frames.map((kept, k) => {
    assert.ok(history.sample(0, history.last - (count - 1 - k) / 30 + 1e-6, frame));
    const [a, b] = [joints(kept, rest), joints(frame, rest)];
    return Math.max(...a.map((place, n) => Math.abs(place - b[n])));
  });
  assert.ok(Math.max(...off) < 0.02, `${Math.max(...off)} m`);
  assert.ok(off.at(-1) < 0.001, `${off.at(-1)} m`);
  assert.deepEqual([...first.contacts].slice(-9), Array.from({ length: 9 }, (_, k) => history.contacts(0, history.last - (8 - k) / 30)));
  const less = await pastOf(people, history, history.last, 1500);
  assert.ok(less.text.length <= 1500 && less.seconds < seconds);
  await assert.rejects(decodePast(text.slice(0, -9)), /not whole/);
  assert.deepEqual(await pastOf([], new History(), NaN, 9000), { text: "", seconds: 0 });
});

test("links that were made before the last frame became finer are still read", async () => {
  const text = "Y2SUZZRleCWwjYMBBC6zMCCAIxJbHInNjcRmR2Iz42AzEsEmFXAyMDCUAgA"; // a walker's first second
  const { count, people: [{ frames }] } = await decodePast(text);
  assert.equal(frames.length, count);
  assert.ok(Math.abs(frames.at(-1)[1] - 1) < 2e-4 && frames.at(-1)[2] - frames[0][2] > 0.5 * (count / 30));
});
