// A reader for protobuf messages, as much as the motion stream needs.
// https://protobuf.dev/programming-guides/encoding/

/** Reads the fields of one message from a Uint8Array, without copying. */
export class ProtoReader {
  constructor(bytes) {
    this.bytes = bytes;
    this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    this.at = 0;
    this.wireType = 0;
  }

  /** Move to the next field; returns its number, or 0 at the end of the message. */
  next() {
    if (this.at >= this.bytes.length) return 0;
    const tag = this.#raw();
    this.wireType = tag & 7;
    const field = Math.floor(tag / 8);
    if (field === 0) throw new Error("malformed message: field number 0");
    return field;
  }

  /** Unsigned integer up to 2^53; a greater one is an error, for JavaScript would round it. */
  varint() {
    this.#expect(0);
    return this.#raw();
  }

  #expect(wireType) {
    if (this.wireType !== wireType) {
      throw new Error(`malformed message: wire type ${this.wireType} in place of ${wireType}`);
    }
  }

  #raw() {
    let value = 0;
    let scale = 1;
    for (let count = 0; count < 10; count += 1) {
      if (this.at >= this.bytes.length) throw new Error("malformed message: it ends in a number");
      const byte = this.bytes[this.at++];
      value += (byte & 0x7f) * scale;
      if (byte < 0x80) {
        if (value > Number.MAX_SAFE_INTEGER) throw new Error("malformed message: number above 2^53");
        return value;
      }
      scale *= 128;
    }
    throw new Error("malformed message: a number has more than 10 bytes");
  }

  /** int32: negative ones come as 10 bytes, two's complement of 64 bits. */
  int32() {
    this.#expect(0);
    let value = 0;
    for (let count = 0; count < 10; count += 1) {
      if (this.at >= this.bytes.length) throw new Error("malformed message: it ends in a number");
      const byte = this.bytes[this.at++];
      if (count < 5) value |= (byte & 0x7f) << (7 * count);
      if (byte < 0x80) return value;
    }
    throw new Error("malformed message: a number has more than 10 bytes");
  }

  /** The bytes of a length-delimited field, a view into the message. */
  block() {
    this.#expect(2);
    const length = this.#raw();
    const start = this.#fixed(length);
    return this.bytes.subarray(start, this.at);
  }

  /** An embedded message. */
  message() {
    return new ProtoReader(this.block());
  }

  string() {
    return new TextDecoder().decode(this.block());
  }

  /** A repeated number field of fixed size: packed, or one at a time; appended to `into`. */
  numbers(size, into) {
    const read = size === 8 ? "getFloat64" : "getFloat32";
    if (this.wireType === 2) {
      const block = this.block();
      if (block.length % size) throw new Error("malformed message: broken packed field");
      const view = new DataView(block.buffer, block.byteOffset, block.byteLength);
      for (let at = 0; at < block.length; at += size) into.push(view[read](at, true));
    } else {
      this.#expect(size === 8 ? 1 : 5);
      into.push(this.view[read](this.#fixed(size), true));
    }
  }

  /** A repeated varint field: packed, or one at a time; appended to `into`. */
  varints(into) {
    if (this.wireType === 2) {
      const packed = this.message();
      while (packed.at < packed.bytes.length) into.push(packed.#raw());
    } else {
      into.push(this.varint());
    }
  }

  /** Pass over the value of a field that is not wanted. */
  skip() {
    if (this.wireType === 0) this.int32();
    else if (this.wireType === 1) this.#fixed(8);
    else if (this.wireType === 2) this.block();
    else if (this.wireType === 5) this.#fixed(4);
    else throw new Error(`malformed message: wire type ${this.wireType}`);
  }

  /** Move past `size` bytes; returns where they begin. */
  #fixed(size) {
    const start = this.at;
    this.at += size;
    if (this.at > this.bytes.length) throw new Error("malformed message: a field passes its end");
    return start;
  }
}
