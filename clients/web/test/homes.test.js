// Where a call goes next: the cases of every client.

import assert from "node:assert/strict";
import { test } from "node:test";
import { Homes, placeOf } from "../src/core/index.js";
import { golden } from "./golden.js";

const { cases, reasons } = golden("homes.json");

for (const { name, entry, calls, about, home } of cases) {
  test(`a call goes where the rule says: ${name}`, () => {
    const homes = new Homes(entry);
    for (const call of calls) {
      const route = homes.route(call.about);
      call.called.forEach((address, k) => {
        assert.equal(route.address, address);
        const { answered, misdirected } = call.answers[k];
        const last = k === call.called.length - 1;
        if (answered !== undefined) {
          assert.ok(last && !call.fails);
          route.answered(answered);
        } else {
          assert.equal(misdirected ? route.misdirected(...misdirected) : route.unavailable(), !last);
        }
      });
    }
    assert.equal(homes.home(about), home);
  });
}

test("a stream's close reason names the node", () => {
  for (const [reason, host, port] of reasons) assert.deepEqual(placeOf(reason), { host, port });
});

test("an entry below a path of a proxy's names other nodes without it", () => {
  assert.equal(new Homes("https://example.org/wf").node("", 81), "https://example.org:81");
});
