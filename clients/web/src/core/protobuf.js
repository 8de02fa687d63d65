// A reader for protobuf messages, as much as the motion stream needs. https://protobuf.dev/programming-guides/encoding/

const TEXT = new TextDecoder();

/** Numbers of a repeated field; keeps its memory when it is emptied. Integers up to 2^31, or with `wide` up to 2^53. */
export class Column {
  /** @param {boolean} [wide] */
  constructor(wide = false) {
    this.values = wide ? new Float64Array(16) : new Int32Array(16);
    this.most = wide ? Number.MAX_SAFE_INTEGER : 2 ** 31 - 1;
    this.length = 0;
  }

  /** Appends the number in `from`; as an argument it would be boxed. @param {Float64Array} from */
  push(from) {
    if (from[0] > this.most) throw new Error("malformed message: a number above 2^31");
    if (this.length === this.values.length) this.#grow();
    this.values[this.length] = from[0];
    this.length += 1;
  }

  #grow() {
    const { values } = this;
    this.values = values instanceof Int32Array ? new Int32Array(2 * values.length) : new Float64Array(2 * values.length);
    this.values.set(values);
  }
}

/** Reads messages in turn, each from a copy in its own buffer `bytes`, and returns places in it. */
export class ProtoReader {
  constructor() {
    this.bytes = new Uint8Array(4096);
    this.view = new DataView(this.bytes.buffer);
    this.at = 0;
    this.end = 0;
    this.wireType = 0;
    /** The last varint; a large return value would be boxed. */
    this.number = new Float64Array(1);
  }

  /** Begins with a message. @param {Uint8Array} message */
  load(message) {
    if (message.length > this.bytes.length) {
      this.bytes = new Uint8Array(2 ** Math.ceil(Math.log2(message.length)));
      this.view = new DataView(this.bytes.buffer);
    }
    this.bytes.set(message);
    this.at = 0;
    this.end = message.length;
  }

  /** Moves to the next field; returns its number, or 0 at the end of the message. */
  next() {
    if (this.at >= this.end) return 0;
    this.#raw();
    const tag = this.number[0];
    this.wireType = tag & 7;
    const field = Math.floor(tag / 8);
    if (field === 0) throw new Error("malformed message: field number 0");
    return field;
  }

  /** Go into an embedded message; give what this returns to `leave` at its end. */
  enter() {
    const outer = this.end;
    const length = this.#length();
    this.end = this.at;
    this.at -= length;
    return outer;
  }

  /** @param {number} outer */
  leave(outer) {
    this.at = this.end;
    this.end = outer;
  }

  /** Unsigned integer up to 2^53; a greater one is an error, since JavaScript would round it. */
  varint() {
    this.#expect(0);
    this.#raw();
    return this.number[0];
  }

  /** int32: negative ones come as 10 bytes, two's complement of 64 bits. */
  int32() {
    this.#expect(0);
    let value = 0;
    for (let count = 0; count < 10; count += 1) {
      if (this.at >= this.end) throw new Error("malformed message: it ends in a number");
      const byte = this.bytes[this.at++];
      if (count < 5) value |= (byte & 0x7f) << (7 * count);
      if (byte < 0x80) return value;
    }
    throw new Error("malformed message: a number has more than 10 bytes");
  }

  double() {
    this.#expect(1);
    return this.view.getFloat64(this.#fixed(8), true);
  }

  /** Skip a field of bytes; returns their number. They end where the reader is. */
  block() {
    return this.#length();
  }

  string() {
    const length = this.#length();
    return TEXT.decode(this.bytes.subarray(this.at - length, this.at));
  }

  /** A repeated field of floats or doubles: packed, or one at a time. @param {4 | 8} size @param {number[]} into */
  floats(size, into) {
    const read = (/** @type {number} */ at) => (size === 8 ? this.view.getFloat64(at, true) : this.view.getFloat32(at, true));
    if (this.wireType === 2) {
      const length = this.#length();
      if (length % size) throw new Error("malformed message: broken packed field");
      for (let at = this.at - length; at < this.at; at += size) into.push(read(at));
    } else {
      this.#expect(size === 8 ? 1 : 5);
      into.push(read(this.#fixed(size)));
    }
  }

  /** Appends a repeated varint field to `into`, packed or one at a time. @param {Column} into */
  varints(into) {
    if (this.wireType === 2) {
      const outer = this.enter();
      while (this.at < this.end) {
        this.#raw();
        into.push(this.number);
      }
      this.leave(outer);
    } else {
      this.#expect(0);
      this.#raw();
      into.push(this.number);
    }
  }

  /** Skip the value of a field that is not needed. */
  skip() {
    if (this.wireType === 0) this.int32();
    else if (this.wireType === 1) this.#fixed(8);
    else if (this.wireType === 2) this.#length();
    else if (this.wireType === 5) this.#fixed(4);
    else throw new Error(`malformed message: wire type ${this.wireType}`);
  }

  /** @param {number} wireType */
  #expect(wireType) {
    if (this.wireType !== wireType) {
      throw new Error(`malformed message: wire type ${this.wireType} in place of ${wireType}`);
    }
  }

  /** Reads a varint into `number`. */
  #raw() {
    let value = 0;
    let scale = 1;
    for (let count = 0; count < 10; count += 1) {
      if (this.at >= this.end) throw new Error("malformed message: it ends in a number");
      const byte = this.bytes[this.at++];
      value += (byte & 0x7f) * scale;
      if (byte < 0x80) {
        if (value > Number.MAX_SAFE_INTEGER) throw new Error("malformed message: number above 2^53");
        this.number[0] = value;
        return;
      }
      scale *= 128;
    }
    throw new Error("malformed message: a number has more than 10 bytes");
  }

  /** Reads the length of a block. */
  #length() {
    this.#expect(2);
    this.#raw();
    const length = this.number[0];
    this.#fixed(length);
    return length;
  }

  /** Moves past `size` bytes; returns where they begin. @param {number} size */
  #fixed(size) {
    const start = this.at;
    if (size > this.end - start) throw new Error("malformed message: a field passes its end");
    this.at += size;
    return start;
  }
}
