// For calls of which only the last one counts: a thing that is dragged, a picture that is renewed.

/**
 * Sends what it is given, one at a time; of what is given meanwhile, only the last. `send(value)` is a
 * promise; a failure goes to `failed(error)`, and does not keep the next from being sent.
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
