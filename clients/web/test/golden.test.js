// The traces that every client follows: tests/golden/README.md.

import assert from "node:assert/strict";
import { test } from "node:test";
import { BASES, PlayoutClock, PoseTrack, Retarget, Rig, SmoothRoot, BONES, mapBones, measureSoles } from "../src/core/index.js";
import { golden } from "./golden.js";

const playout = golden("playout.json");
const { walk, cases, bones, refused } = golden("retarget.json");

const near = (found, wanted, within, what) => [...wanted].forEach((value, k) => (
  assert.ok(Math.abs(found[k] - value) <= within, `${what}: ${found[k]} is not ${value} (${k})`)));

/** Rotations: q and -q are the same. */
function nearTurn(found, wanted, within, what) {
  const sign = [0, 1, 2, 3].reduce((sum, k) => sum + found[k] * wanted[k], 0) < 0 ? -1 : 1;
  near(found.map((value) => sign * value), wanted, within, what);
}

for (const [kind, events] of Object.entries(playout.clock)) {
  test(`playout clock: ${kind}`, () => {
    const clock = new PlayoutClock();
    for (const [what, now, ...rest] of events) {
      if (what === "message") clock.observe(now, rest[0]);
      else if (what === "chunk") clock.observeChunk(now, rest[0]);
      else if (what === "resumed") clock.resumed(rest[0]);
      else near([clock.advance(now), clock.delay(now)], rest, 1e-6, `at ${now}`);
    }
  });
}

for (const [kind, events] of Object.entries(playout.track)) {
  test(`pose track: ${kind}`, () => {
    const track = new PoseTrack(11);
    const out = new Float32Array(11);
    for (const [what, time, ...rest] of events) {
      if (what === "push") {
        const [fps, frames, contacts] = rest;
        track.push(time, fps, frames.flat(), frames.length, contacts);
        continue;
      }
      const [pose, contacts, buffered, underruns] = rest;
      assert.equal(track.sample(time, out), pose !== null);
      if (!pose) continue;
      near(out.subarray(0, 3), pose.slice(0, 3), 1e-5, `hips at ${time}`);
      for (const at of [3, 7]) nearTurn([...out.subarray(at, at + 4)], pose.slice(at, at + 4), 1e-5, `turn at ${time}`);
      assert.equal(track.contacts, contacts);
      assert.equal(track.underruns, underruns);
      near([track.buffered(time)], [buffered], 1e-6, "buffered");
    }
  });
}

test("smooth root", () => {
  const root = new SmoothRoot(BASES.gltf);
  for (const [time, hips, turn, ground, point, heading] of playout.root) {
    root.update(time, [...hips, ...turn], ground);
    near([...root.point, root.heading], [...point, heading], 1e-5, `at ${time}`);
  }
});

for (const { name, basis, nodes, humanoid, found_by, map, mesh, floor, ratio, poses } of cases) {
  test(`retarget: ${name}`, () => {
    assert.deepEqual(BONES, bones);
    const found = mapBones(new Rig(nodes), humanoid, BASES[basis]);
    assert.equal(found.foundBy, found_by);
    assert.deepEqual(found.table(), map);
    const { rest_offsets, hips, rotations } = walk[basis];
    const soles = mesh && measureSoles(found, mesh.places.flat(), mesh.nodes, BASES[basis]);
    if (mesh) near([soles.floor], [floor], 1e-5, "floor");
    const retarget = new Retarget(found, rest_offsets.flat(), BASES[basis], NaN, soles);
    assert.deepEqual([...retarget.loose], Object.keys(poses[0].moved).map((bone) => BONES.indexOf(bone)));
    near([retarget.ratio], [ratio], 1e-5, "ratio");
    const unit = basis.startsWith("unreal") ? 100 : 1;
    poses.forEach((pose, k) => {
      retarget.pose([...hips[k], ...rotations[k].flat()]);
      BONES.forEach((bone, b) => {
        assert.equal(bone in pose.places, retarget.nodes[b] >= 0);
        if (!(bone in pose.places)) return;
        near(retarget.places.subarray(3 * b, 3 * b + 3), pose.places[bone], 1e-4 * unit, `${bone} of frame ${k}`);
        nearTurn([...retarget.rotations.subarray(4 * b, 4 * b + 4)], pose.rotations[bone], 1e-4, `${bone} of frame ${k}`);
        if (bone in pose.moved) near(retarget.moved.subarray(3 * b, 3 * b + 3), pose.moved[bone], 1e-4 * (name === "centimetres" ? 100 : unit), `${bone} of frame ${k}`);
      });
    });
  });
}

for (const { name, nodes, says } of refused) {
  test(`refused: ${name}`, () => {
    assert.throws(() => mapBones(new Rig(nodes)), ({ message }) => message.includes(says));
  });
}
