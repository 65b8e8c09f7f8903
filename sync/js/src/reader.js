// Reads the primitives of the format (PROTOCOL.md, "Primitives") from a Uint8Array. Truncated or malformed input throws
// a FormatError; it never gives a wrong value.

export class FormatError extends Error {}

const decoder = new TextDecoder('utf-8');

export class Reader {
  constructor(bytes) {
    this.bytes = bytes;
    this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    this.at = 0;
  }
  get left() { return this.bytes.length - this.at; }
  /** Skips `count` bytes and returns where they begin. */
  skip(count) {
    if (!(count <= this.left)) throw new FormatError(`cut short: ${count} bytes at ${this.at} of ${this.bytes.length}`);
    this.at += count;
    return this.at - count;
  }
  take(count) {
    const from = this.skip(count);
    return this.bytes.subarray(from, from + count);
  }
  u8() { return this.bytes[this.skip(1)]; }
  u16() { return this.view.getUint16(this.skip(2), true); }
  u32() { return this.view.getUint32(this.skip(4), true); }
  i32() { return this.view.getInt32(this.skip(4), true); }
  f32() { return this.view.getFloat32(this.skip(4), true); }
  f64() { return this.view.getFloat64(this.skip(8), true); }
  u64() { return this.view.getBigUint64(this.skip(8), true); }
  /** Reads counts, lengths and node numbers up to 2^53, which is more than any number of bytes. */
  varint() {
    let result = 0;
    let scale = 1;
    for (let i = 0; i < 10; ++i) {
      const byte = this.u8();
      result += (byte & 127) * scale;
      if (byte < 128) {
        if (!Number.isSafeInteger(result)) throw new FormatError(`a number too large at ${this.at}`);
        return result;
      }
      scale *= 128;
    }
    throw new FormatError(`a varint without end at ${this.at}`);
  }
  /** Reads a count of things that take at least `least` bytes each, so that no memory is allocated for impossible
   * counts. */
  count(least) {
    const n = this.varint();
    if (n * least > this.left) throw new FormatError(`${n} elements in ${this.left} bytes`);
    return n;
  }
  signed() {
    const coded = this.varint();
    return coded % 2 ? -(coded + 1) / 2 : coded / 2;
  }
  /** Reads a node number relative to `previous`. */
  node(previous) { return addDelta(previous, this.varint()); }
  text() { return decoder.decode(this.take(this.varint())); }
  texts() { return Array.from({length: this.count(1)}, () => this.text()); }
  part() { return new Reader(this.take(this.varint())); }
}

export function addDelta(previous, coded) {
  const difference = coded % 2 ? -(coded + 1) / 2 : coded / 2;
  const node = previous + difference;
  if (node < 0 || node > 0xFFFFFFFF) throw new FormatError(`node number ${node}`);
  return node;
}
