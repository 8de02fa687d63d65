// A stream that comes back: one that is lost is opened again where it left off.

import { setTimeout as sleep } from "node:timers/promises";
import { status } from "@grpc/grpc-js";
import { placeOf, retryAfterMs } from "./refusal.js";

const SILENCE_MS = 5000; // without even a heartbeat (one per second): the connection is dead
const PAUSE_MS = [100, 2000]; // first and longest between attempts
const PASSING = [status.UNAVAILABLE, status.RESOURCE_EXHAUSTED];

/**
 * Messages of StreamMotion, as an async iterator, over as many connections as it takes. Gives up when
 * there was no sign of life for `deadlineMs`. `for await … break` ends the stream.
 */
export async function* follow(client, request, { deadlineMs = 30_000 } = {}) {
  let resuming = { ...request };
  let heardAt = Date.now();
  let pause = PAUSE_MS[0];
  let begun = false;
  for (;;) {
    const call = client.motion.streamMotion(resuming);
    let heard = false; // over this connection
    const silence = setTimeout(() => call.destroy(new Error("nothing heard for 5 s")), SILENCE_MS);
    try {
      for await (const message of call) {
        silence.refresh();
        heardAt = Date.now();
        pause = PAUSE_MS[0];
        begun = heard = true;
        const { case: kind, value } = message.payload;
        if (kind === "batch" && value.resumeToken) resuming = { ...resuming, resumeToken: value.resumeToken };
        yield message;
      }
      return; // the session has ended
    } catch (error) {
      const asked = retryAfterMs(error); // to wait so long
      const moved = placeOf(error) !== null; // to where the next call goes
      const passes = moved || error.code === undefined || error.code === PASSING[0] || asked || (begun && PASSING.includes(error.code));
      const left = heardAt + deadlineMs - Date.now();
      if (!passes || left <= 0) throw error;
      if (moved && heard) continue;
      await sleep(Math.min(left, Math.max(asked, pause * (0.5 + Math.random() / 2))));
      pause = Math.min(2 * pause, PAUSE_MS[1]);
    } finally {
      clearTimeout(silence);
      call.cancel();
    }
  }
}
