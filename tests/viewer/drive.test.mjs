import assert from "node:assert/strict";
import { test } from "node:test";

const listeners = {};
globalThis.addEventListener = (kind, take) => (listeners[kind] = take);
const { Drive } = await import("../../viewer/drive.js");

/** Somebody at 10, 20, driven with a camera that looks along +X. */
function driven() {
  const told = [];
  const person = { shown: true, x: 10, y: 0, z: 20 };
  const drive = new Drive({
    stage: { camera: { position: { x: 0, z: 20 } }, controls: { target: { x: 10, z: 20 } } },
    person: () => person, attempt: (action) => action,
    commands: { drive: (who, goal) => told.push(goal), stop: (people) => told.push(people) },
  });
  drive.turn(true);
  return { drive, told, person };
}

function gamepads(...pads) {
  Object.defineProperty(globalThis, "navigator", { value: { getGamepads: () => pads }, configurable: true });
}

/** The last goal: metres ahead along the camera, metres to its right, m/s. */
function sent({ told, person }) {
  const { x, z, speed } = told.at(-1);
  return [x - person.x, z - person.z, speed].map((value) => Math.round(100 * value) / 100);
}

test("keys walk as the camera looks, and it ends when they are let go", () => {
  gamepads();
  const { drive, told, person } = driven();
  assert.equal(drive.press("w"), true);
  assert.equal(drive.press("q"), false);
  drive.advance(0, 1.5);
  assert.deepEqual(sent({ told, person }), [3.75, 0, 1.5]);
  drive.press("d");
  drive.advance(0.1, 1.5); // too soon after the one before
  assert.equal(told.length, 1);
  drive.advance(0.3, 1.5);
  assert.deepEqual(sent({ told, person }), [2.65, 2.65, 1.5]);
  for (const key of ["w", "D"]) listeners.keyup({ key });
  drive.advance(0.4, 1.5);
  assert.deepEqual(told.at(-1), [person]); // stops
  drive.advance(1, 1.5);
  assert.equal(told.length, 3); // once
});

test("a gamepad's stick sets direction and speed, and what it does at rest is nothing", () => {
  const { drive, told, person } = driven();
  gamepads(null, { axes: [0.1, -0.2] });
  drive.advance(0, 1);
  assert.deepEqual(told, []);
  gamepads(null, { axes: [-0.8, 0] });
  drive.advance(1, 2);
  assert.deepEqual(sent({ told, person }), [0, -5, 1.6]);
  gamepads(null, { axes: [0, 1] });
  drive.advance(2, 2);
  assert.deepEqual(sent({ told, person }), [-5, 0, 2]);
  gamepads();
  drive.advance(3, 2);
  assert.deepEqual(told.at(-1), [person]);
});

test("the stick on the screen walks, too, until driving ends", () => {
  gamepads();
  const { drive, told, person } = driven();
  drive.thumb = [0, 0.5];
  drive.advance(0, 1);
  assert.deepEqual(sent({ told, person }), [2.5, 0, 0.5]);
  drive.turn(false);
  drive.advance(1, 1);
  assert.deepEqual(told.at(-1), [person]);
  assert.deepEqual(drive.thumb, [0, 0]);
});
