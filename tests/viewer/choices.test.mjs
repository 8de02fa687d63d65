import assert from "node:assert/strict";
import { test } from "node:test";
import {
  arranged, crowdText, dragHeading, escort, eventText, formation, freePlace, othersThan, pick, randomAgents, recipients,
} from "../../viewer/choices.js";

const HEIGHTS = { female: [1.5, 1.8], male: [1.55, 1.9] };

function chance(seed) {
  let state = seed;
  return () => (state = (state * 16807) % 2147483647) / 2147483647;
}

test("random agents differ, fit the bodies and keep their distance", () => {
  const taken = [{ x: 0, z: 0 }];
  const agents = randomAgents(60, HEIGHTS, taken, { random: chance(3) });
  assert.equal(agents.length, 60);
  assert.equal(new Set(agents.map(({ gender }) => gender)).size, 2);
  for (const { gender, phenotype, heading, name } of agents) {
    const [least, most] = HEIGHTS[gender];
    assert.ok(phenotype.height_m >= least && phenotype.height_m <= most);
    for (const share of [phenotype.weight, phenotype.muscle]) assert.ok(share >= 0 && share <= 1);
    assert.ok(phenotype.age >= 20 && phenotype.age <= 80);
    assert.ok(Math.abs(heading) <= Math.PI);
    assert.ok(name.length > 0);
  }
  const places = [...taken, ...agents.map(({ position }) => position)];
  places.forEach((a, i) => places.slice(i + 1).forEach((b) => {
    assert.ok(Math.hypot(a.x - b.x, a.z - b.z) >= 1);
  }));
});

test("a free place is found however full the middle is", () => {
  const taken = [];
  for (let x = -5; x <= 5; x += 1) for (let z = -5; z <= 5; z += 1) taken.push({ x, z });
  const { x, z } = freePlace(taken, { random: chance(1) });
  assert.ok(taken.every((other) => Math.hypot(other.x - x, other.z - z) >= 1));
});

test("a formation begins on the point and does not crowd", () => {
  const places = formation({ x: 3, z: -2 }, 64);
  assert.deepEqual(places[0], { x: 3, z: -2 });
  places.forEach((a, i) => places.slice(i + 1).forEach((b) => {
    assert.ok(Math.hypot(a.x - b.x, a.z - b.z) > 0.7);
  }));
  assert.deepEqual(formation({ x: 0, z: 0 }, 0), []);
});

test("a group keeps its shape, or stands in a line or in rows, and nobody crosses another's way", () => {
  const people = [{ x: 0, z: 0 }, { x: 2, z: 1 }, { x: -2, z: 0.5 }, { x: 1, z: -1 }, { x: -1, z: -0.5 }];
  const point = { x: 0, z: 10 }; // they go along z
  const kept = arranged(point, people, "kept");
  kept.forEach((place, k) => assert.ok(Math.abs(place.x - people[k].x) < 1e-9 && Math.abs(place.z - people[k].z - 10) < 1e-9));
  const line = arranged(point, people, "line");
  for (const { z } of line) assert.ok(Math.abs(z - 10) < 1e-9);
  assert.deepEqual([2, 4, 0, 3, 1].map((k) => Math.round(10 * line[k].x)), [-18, -9, 0, 9, 18]);
  const rows = arranged(point, people, "rows");
  assert.deepEqual(rows.map(({ z }) => Math.round(10 * (10 - z))), [0, 0, 0, 9, 9]); // who is in front stays there
  assert.ok(rows[2].x < rows[0].x && rows[0].x < rows[1].x && rows[4].x < rows[3].x);
  for (const shape of ["cluster", "line", "rows", "kept"]) assert.deepEqual(arranged(point, [], shape), []);
});

test("a click sends those that the mode names", () => {
  const near = { x: 1, z: 0 };
  const far = { x: 5, z: 0 };
  const point = { x: 0, z: 0 };
  assert.deepEqual(recipients("all", [far, near], [], point), [near, far]);
  assert.deepEqual(recipients("nearest", [far, near], [far], point), [near]);
  assert.deepEqual(recipients("selected", [far, near], [far], point), [far]);
  assert.deepEqual(recipients("selected", [far, near], [far, near], point), [near, far]);
  assert.deepEqual(recipients("selected", [far, near], [], point), []);
  assert.deepEqual(recipients("nearest", [], [], point), []);
});

test("a drag gives the heading it points to, a twitch none", () => {
  const from = { x: 1, z: 1 };
  assert.equal(dragHeading(from, { x: 1, z: 3 }), 0);
  assert.equal(dragHeading(from, { x: 3, z: 1 }), Math.PI / 2);
  assert.equal(dragHeading(from, { x: 1.1, z: 1.1 }), null);
});

test("a ray picks the person it passes, not the one behind the viewer", () => {
  const front = { x: 0, z: -5, height: 1.7 };
  const aside = { x: 2, z: -5, height: 1.7 };
  const behind = { x: 0, z: 5, height: 1.7 };
  const people = [behind, aside, front];
  const origin = { x: 0, y: 1.2, z: 0 };
  assert.equal(pick(people, { origin, direction: { x: 0, y: 0, z: -1 } }), front);
  assert.equal(pick(people, { origin, direction: { x: 0, y: 0.6, z: -0.8 } }), null); // over the head
  assert.equal(pick(people, { origin, direction: { x: 0.371, y: 0, z: -0.928 } }), aside);
  assert.equal(pick([front], { origin: { x: 0.1, y: 9, z: -5 }, direction: { x: 0, y: -1, z: 0 } }), front);
  assert.equal(pick([], { origin, direction: { x: 0, y: 0, z: -1 } }), null);
});

test("events are told in a sentence, or not where the picture tells", () => {
  const reached = { kind: "goal_reached", waypoint: 1, detail: "" };
  assert.equal(eventText(reached, "Ada", 3), "Ada has reached goal 2");
  assert.equal(eventText({ ...reached, waypoint: 0 }, "Ada", 1), "Ada has reached the goal");
  assert.equal(eventText({ kind: "path_done", detail: "x" }, "Ada", 3), "");
  assert.match(eventText({ kind: "gap", detail: "3 publications" }, "", 0), /^some motion was skipped: this computer is busy$/);
  assert.match(eventText({ kind: "draining", detail: "" }, "", 0), /about to stop/);
  assert.equal(eventText({ kind: "unknown", detail: "of a later version" }, "", 0), "of a later version");
});

test("people start on free ground near what is looked at, at its height", () => {
  const heightAt = (x) => (x > 10 ? 1.2 : null);
  const agents = randomAgents(8, HEIGHTS, [], { middle: { x: 10, z: 4 }, heightAt, random: chance(5) });
  for (const { position } of agents) {
    assert.ok(position.x > 10 && Math.hypot(position.x - 10, position.z - 4) < 20);
    assert.equal(position.y, 1.2);
  }
});

test("where there is no ground at all, a place is found all the same", () => {
  assert.ok(freePlace([], { heightAt: () => null, random: chance(2) }));
});

test("nobody is told to follow himself", () => {
  const [a, b, c] = [{ x: 0, z: 0 }, { x: 1, z: 0 }, { x: 2, z: 0 }];
  assert.deepEqual(othersThan(a, "all", [a, b, c], []), [b, c]);
  assert.deepEqual(othersThan(a, "selected", [a, b, c], [a]), []);
  assert.deepEqual(othersThan(a, "selected", [a, b, c], [c]), [c]);
  assert.deepEqual(othersThan(a, "nearest", [a, c, b], []), [b]);
});

test("followers have places of their own, within what the API allows", () => {
  const places = Array.from({ length: 45 }, (_, k) => escort(k));
  assert.equal(new Set(places.map(({ behind, right }) => `${behind} ${right}`)).size, 45);
  for (const { behind, right } of places) assert.ok(behind >= 1 && behind <= 10 && Math.abs(right) <= 2);
});

test("events of a scene are told in words", () => {
  for (const kind of ["unreachable", "blocked", "goal_moved", "behaviour_ended"]) {
    assert.match(eventText({ kind, waypoint: 0, detail: "" }, "Ada", 1), /^Ada \w+/);
  }
});

test("a person on a platform is picked up there", () => {
  const person = { x: 0, y: 3, z: -5, height: 1.7 };
  const level = { x: 0, y: 0, z: -1 };
  assert.equal(pick([person], { origin: { x: 0, y: 4, z: 0 }, direction: level }), person);
  assert.equal(pick([person], { origin: { x: 0, y: 1, z: 0 }, direction: level }), null);
});

test("a crowd says who is here, and why the rest waits", () => {
  assert.equal(crowdText({ came: 50, waiting: 0, reason: "" }), "50 people are here");
  assert.equal(crowdText({ came: 1, waiting: 0, reason: "" }), "1 person is here");
  assert.equal(crowdText({ came: 0, waiting: 0, reason: "" }), "they leave");
  assert.equal(crowdText({ came: 3, waiting: 2, reason: "" }), "3 of 5 people are here; the rest are on their way");
  assert.equal(
    crowdText({ came: 32, waiting: 18, reason: "cannot add 1 agent" }),
    "32 of 50 people came; this computer is busy",
  );
});
