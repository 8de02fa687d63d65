// Keeps a session alive while this program runs.

const RENEWALS_PER_LEASE = 3;

/**
 * Renews a session's lease until the session is gone, which its next call reports, or until the returned function is
 * called. `schedule(callback, seconds)` is a timer.
 * @param {{ renewSession(sessionId: string): Promise<unknown> }} api @param {string} sessionId
 * @param {number} leaseSeconds @param {(callback: () => void, seconds: number) => void} [schedule]
 * @returns {() => void}
 */
export function keepAlive(api, sessionId, leaseSeconds, schedule = idly) {
  let stopped = false;
  const renew = async () => {
    if (stopped) return;
    try {
      await api.renewSession(sessionId);
    } catch (error) {
      if (/** @type {any} */ (error).status === 404) return;
      // other failures may be temporary: the lease is long enough for another attempt
    }
    schedule(renew, leaseSeconds / RENEWALS_PER_LEASE);
  };
  schedule(renew, leaseSeconds / RENEWALS_PER_LEASE);
  return () => {
    stopped = true;
  };
}

/** A timer. @param {() => void} callback @param {number} seconds */
export function later(callback, seconds) {
  setTimeout(callback, seconds * 1000);
}

/** A timer that keeps no program of Node running. @param {() => void} callback @param {number} seconds */
export function idly(callback, seconds) {
  const timer = setTimeout(callback, seconds * 1000);
  /** @type {any} */ (timer).unref?.();
}
