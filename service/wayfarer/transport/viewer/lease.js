// Keeps a session alive while this page is open. No DOM.

const RENEWALS_PER_LEASE = 3;

/**
 * Renew a session's lease until it is no more, which whoever uses it will be told, or `stop` is
 * called. `schedule(callback, seconds)` is a timer.
 */
export function keepAlive(api, sessionId, leaseSeconds, schedule = later) {
  let stopped = false;
  const renew = async () => {
    if (stopped) return;
    try {
      await api.renewSession(sessionId);
    } catch (error) {
      if (error.status === 404) return;
      // any other failure may pass: the lease is long enough for another attempt
    }
    schedule(renew, leaseSeconds / RENEWALS_PER_LEASE);
  };
  schedule(renew, leaseSeconds / RENEWALS_PER_LEASE);
  return () => {
    stopped = true;
  };
}

function later(callback, seconds) {
  setTimeout(callback, seconds * 1000);
}
