// Detects that the browser froze this page, or that its machine slept. No DOM but the document's events.

const SUSPENDED = 3000; // ms by which the wall clock is ahead of the page's clock, which stops meanwhile
const LOOK = 1000; // ms

/** Calls `wake()` afterwards. The other arguments are the browser's, or a test's. */
export function watchSleep(wake, page = document, wall = Date.now, steady = () => performance.now(), every = setInterval) {
  page.addEventListener("resume", wake);
  let ahead = wall() - steady();
  every(() => {
    const now = wall() - steady();
    if (now - ahead > SUSPENDED) wake();
    ahead = now;
  }, LOOK);
}
