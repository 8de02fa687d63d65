// Tells when this page was frozen by the browser, or its machine slept. No DOM but the document's events.

const SUSPENDED = 3000; // ms that the clock on the wall is ahead of the page's, which stands still meanwhile
const LOOK = 1000; // ms

/** Call `wake()` afterwards. The rest is the browser's, and a test's. */
export function watchSleep(wake, page = document, wall = Date.now, steady = () => performance.now(), every = setInterval) {
  page.addEventListener("resume", wake);
  let ahead = wall() - steady();
  every(() => {
    const now = wall() - steady();
    if (now - ahead > SUSPENDED) wake();
    ahead = now;
  }, LOOK);
}
