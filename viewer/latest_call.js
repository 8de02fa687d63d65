// For calls of which only the last one counts: an object that is dragged, a picture that is renewed.

/**
 * Sends its values one at a time; of those that come meanwhile, only the last. `send(value)` returns a promise. A failure goes to
 * `failed(error)` and does not prevent the next value.
 */
export class Latest {
  #running = null;
  #next = null; // { value }

  constructor(send, failed) {
    this.send = send;
    this.failed = failed;
  }

  /** A promise of the moment when nothing is left to send. */
  push(value) {
    this.#next = { value };
    this.#running ??= this.#run();
    return this.#running;
  }

  async #run() {
    while (this.#next) {
      const { value } = this.#next;
      this.#next = null;
      try {
        await this.send(value);
      } catch (error) {
        this.failed(error);
      }
    }
    this.#running = null;
  }
}
