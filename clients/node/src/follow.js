// A stream that comes back: one that is lost is opened again where it left off.

import { setTimeout as sleep } from "node:timers/promises";
import { Patience, SILENCE_MS } from "./patience.js";
import { placeOf } from "./refusal.js";

/**
 * Messages of StreamMotion, as an async iterator, over as many connections as it takes. Gives up when
 * there was no sign of life for `deadlineMs`. `for await … break` ends the stream.
 */
export async function* follow(client, request, { deadlineMs } = {}) {
  let resuming = { ...request };
  const patience = new Patience(deadlineMs);
  for (;;) {
    const call = client.motion.streamMotion(resuming);
    let heard = false; // over this connection
    const silence = setTimeout(() => call.destroy(new Error("nothing heard for 5 s")), SILENCE_MS);
    try {
      for await (const message of call) {
        silence.refresh();
        patience.heard();
        heard = true;
        const { case: kind, value } = message.payload;
        if (kind === "batch" && value.resumeToken) resuming = { ...resuming, resumeToken: value.resumeToken };
        yield message;
      }
      return; // the session has ended
    } catch (error) {
      const wait = patience.next(error);
      if (wait === null) throw error;
      if (heard && placeOf(error)) continue; // the next call goes there
      await sleep(wait);
    } finally {
      clearTimeout(silence);
      call.cancel();
    }
  }
}
