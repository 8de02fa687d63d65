import assert from "node:assert/strict";
import { test } from "node:test";
import { Names } from "../../viewer/names.js";
import { PerspectiveCamera } from "../../viewer/vendor/three.min.js";

const pen = { clearRect() {}, measureText: () => ({ width: 100 }), beginPath() {}, roundRect() {}, fill() {}, fillText(text) { pen.text = text; } };
const camera = new PerspectiveCamera(42, 1.6, 0.15, 600);
camera.position.set(0, 1.9, 10);
camera.updateMatrixWorld();

/** A person at a place, as `Names` reads it. */
const person = (name, x, z) => ({ agent: { name }, x, y: 0, z, height: 1.7, shown: true, group: { visible: true } });

/** Names on a stage whose renderer notes which text each place of the picture has. */
function made() {
  globalThis.document = { createElement: () => ({ getContext: () => pen }) };
  const pictures = new Map();
  const copyTextureToTexture = (_, to, __, { x, y }) => pictures.set(`${x / to.image.width} ${y / to.image.height}`, pen.text);
  const names = new Names();
  const { uv } = names.mesh.geometry.attributes;
  return {
    names,
    show: (people) => names.show(people, { camera, renderer: { copyTextureToTexture } }, 1440, 900),
    read: () => names.shown.map((_, k) => pictures.get(`${uv.getX(4 * k)} ${uv.getY(4 * k)}`)),
  };
}

test("of names that overlap the nearest is shown, and none of who is hidden or behind the camera", () => {
  const { names, show, read } = made();
  show([person("far", 0, -5), person("near", 0, 5), person("beside", 3, 5), person("behind", 0, 20), { ...person("gone", -3, 5), group: { visible: false } }]);
  assert.deepEqual(read(), ["near", "beside"]);
  assert.equal(names.mesh.geometry.drawRange.count, 12);
  show([]);
  assert.equal(names.mesh.visible, false);
});

test("each shows its own text, however many have been shown before", () => {
  const { show, read } = made();
  for (let round = 0; round < 12; round += 1) {
    const people = Array.from({ length: 36 }, (_, k) => ({ ...person(`${round} ${k}`, 2 * (k % 9) - 8, -5), y: Math.floor(k / 9) }));
    show(people);
    const first = read();
    assert.deepEqual(first, people.map(({ agent: { name } }) => name));
    show([...people].reverse());
    assert.deepEqual(read().sort(), first.sort());
  }
});
