import assert from "node:assert/strict";
import { test } from "node:test";
import { Selection } from "../../viewer/selection.js";

test("several are selected, kept as a group, and selected again", () => {
  const [a, b, c] = [{}, {}, {}];
  let told = 0;
  const selection = new Selection(() => (told += 1));
  assert.equal(selection.person, null);
  selection.choose([a, b, a]);
  assert.deepEqual([selection.people, selection.person], [[a, b], a]);
  assert.equal(selection.keep(), 1);
  selection.toggle(a);
  selection.toggle(c);
  assert.deepEqual(selection.people, [b, c]);
  selection.recall(2); // there is none
  assert.deepEqual(selection.people, [b, c]);
  selection.recall(1);
  assert.deepEqual(selection.people, [a, b]);
  assert.equal(told, 5);
});

test("who has gone is in no selection and no group", () => {
  const [a, b] = [{}, {}];
  const selection = new Selection(() => {});
  selection.choose([a, b]);
  selection.keep();
  assert.equal(selection.prune(new Set([a, b])), false);
  assert.equal(selection.prune(new Set([b])), true);
  assert.deepEqual([selection.people, selection.groups], [[b], [[b]]]);
  selection.prune(new Set());
  selection.recall(1);
  assert.deepEqual(selection.people, []);
});
