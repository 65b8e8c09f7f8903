// Writes the primitives of the format, and the messages and records that a client sends (PROTOCOL.md, "Mirror").

import {xxh64} from './xxh3.js';
import {SFNODE, fixedSize, isCustom, typeName} from './values.js';

const utf8 = new TextEncoder();
const kStrings = 10, kImages = 18;  // value types of SFString and SFImage; MF types are one more

export class Writer {
  constructor() {
    this.bytes = new Uint8Array(64);
    this.view = new DataView(this.bytes.buffer);
    this.at = 0;
  }
  room(count) {
    const from = this.at;
    if (from + count > this.bytes.length) {
      const larger = new Uint8Array(Math.max(2 * this.bytes.length, from + count));
      larger.set(this.bytes.subarray(0, from));
      this.bytes = larger;
      this.view = new DataView(larger.buffer);
    }
    this.at += count;
    return from;
  }
  u8(x) { const at = this.room(1); this.view.setUint8(at, x); return this; }
  u16(x) { const at = this.room(2); this.view.setUint16(at, x, true); return this; }
  u32(x) { const at = this.room(4); this.view.setUint32(at, x, true); return this; }
  i32(x) { const at = this.room(4); this.view.setInt32(at, x, true); return this; }
  f32(x) { const at = this.room(4); this.view.setFloat32(at, x, true); return this; }
  f64(x) { const at = this.room(8); this.view.setFloat64(at, x, true); return this; }
  u64(x) { const at = this.room(8); this.view.setBigUint64(at, BigInt(x), true); return this; }
  raw(bytes) { const at = this.room(bytes.length); this.bytes.set(bytes, at); return this; }
  varint(x) {
    for (; x >= 128; x = Math.floor(x / 128)) this.u8(x % 128 + 128);
    return this.u8(x);
  }
  delta(difference) { return this.varint(difference >= 0 ? 2 * difference : -2 * difference - 1); }
  text(text) {
    const bytes = utf8.encode(text);
    return this.varint(bytes.length).raw(bytes);
  }
  texts(texts) {
    this.varint(texts.length);
    for (const text of texts) this.text(text);
    return this;
  }
  block(kind, count, body) { return this.u8(kind).varint(count).varint(body.at).raw(body.done()); }
  done() { return this.bytes.subarray(0, this.at); }
}

const kNumber = {0: 'u8', 1: 'i32', 2: 'f32', 3: 'f64', 4: 'f64', 6: 'u32', 11: 'f64', 13: 'f64', 15: 'f64', 18: 'f64', 20: 'f64'};

/** Writes a value of a value type, in the form of values.js. */
export function writeValue(w, type, value) {
  if (type === kStrings) return w.text(value);
  if (type === kStrings + 1) return w.texts(value);
  if (type === kImages || type === kImages + 1) throw new TypeError('images are not sent');
  if (isCustom(type)) throw new TypeError('values of types from outside are not sent');
  const put = kNumber[type >> 1] ?? 'f32';
  const size = {u8: 1, i32: 4, u32: 4, f32: 4, f64: 8}[put];
  const numbers = Array.isArray(value) || ArrayBuffer.isView(value) ? value : [value];
  const lanes = fixedSize(type) / size;
  if (type % 2) w.varint(numbers.length / lanes);
  else if (numbers.length !== lanes) throw new TypeError(`${typeName(type)} has ${lanes} numbers, not ${numbers.length}`);
  for (const x of numbers) w[put](Number(x));
  return w;
}

const FRAME = 2, REQUEST = 6;
const UNDO = 1, REDO = 2, LOCK = 3;

/** A record of a client with these blocks, or with a request's content in their place. Its states have no meaning. */
export function record(blocks, kind = FRAME) {
  const w = new Writer();
  w.raw(utf8.encode('RTSGrec1')).u64(0).u8(kind).u8(0).u32(0).u16(0).u64(1).u64(1).f64(0).u64(0).u64(0).raw(blocks);
  w.view.setUint16(18, blocks.length % 2 ** 16, true);
  w.view.setUint32(20, Math.floor(blocks.length / 2 ** 16), true);
  w.view.setBigUint64(8, xxh64(w.bytes.subarray(16, w.at)), true);
  return w.done();
}

export const undoRecord = () => record(new Writer().u8(UNDO).done(), REQUEST);
export const redoRecord = () => record(new Writer().u8(REDO).done(), REQUEST);

/** Reserves nodes for the author for so many ms (at most 60,000); 0 releases them. */
export function lockRecord(nodes, lease) {
  const w = new Writer().u8(LOCK).varint(lease).varint(nodes.length);
  nodes.forEach((node, i) => w.delta(node - (nodes[i - 1] ?? 0)));
  return record(w.done(), REQUEST);
}

/** Sets fields to values (not to nodes), [{node, field, type, value}], as one record. */
export function editRecord(edits) {
  const blocks = new Writer();
  for (const {node, field, type, value} of edits) {
    if (type >> 1 === SFNODE >> 1) throw new TypeError(`${typeName(type)} is not sent`);
    const column = new Writer().u8(0).u8(1).u8(type).varint(field).delta(node);
    writeValue(column, type, value);
    blocks.block(4, 1, column);
  }
  return record(blocks.done());
}

/** Sends input events, [{node, field, type, value}], as one record. */
export function eventRecord(events) {
  const body = new Writer();
  let node = 0;
  for (const e of events) {
    const d = e.node - node;
    node = e.node;
    body.varint(2 * (d >= 0 ? 2 * d : -2 * d - 1) + 1).varint(e.field).u8(e.type);
    writeValue(body, e.type, e.value);
  }
  return record(new Writer().block(8, events.length, body).done());
}
