// How long a frame of 10,000 changed translations takes to be decoded, applied and hashed; beside it JSON.parse of the same
// values, which neither applies nor hashes. One JSON line each, medians.
import {readFileSync} from 'node:fs';
import {Decoder, Scene, readRecord, records} from './src/index.js';
import {xxh64} from './src/xxh3.js';

const COUNT = 10_000, FRAMES = 60;

class Writer {
  bytes = [];
  u8(x) { this.bytes.push(x); return this; }
  varint(x) {
    for (; x >= 128; x = Math.floor(x / 128)) this.bytes.push(x % 128 + 128);
    return this.u8(x);
  }
  raw(array) { for (const byte of array) this.bytes.push(byte); return this; }
  block(kind, count, body) { return this.u8(kind).varint(count).varint(body.bytes.length).raw(body.bytes); }
}

function record(kind, from, to, payload) {
  const bytes = new Uint8Array(64 + payload.length), view = new DataView(bytes.buffer);
  bytes.set(new TextEncoder().encode('RTSGrec1'));
  bytes[16] = kind;
  view.setUint32(18, payload.length, true);
  view.setBigUint64(24, BigInt(from), true);
  view.setBigUint64(32, BigInt(to), true);
  bytes.set(payload, 64);
  view.setBigUint64(8, xxh64(bytes.subarray(16)), true);
  return bytes;
}

/** The descriptions of types in a log that has Transforms, as they are. */
function descriptions() {
  const log = new Uint8Array(readFileSync(new URL('../../tests/sync/conformance/raw.rlog', import.meta.url)));
  for (const r of records(log)) {
    if (r.kind !== 'keyframe' && !(r.kind === 'frame' && r.from === 0)) continue;
    const decoder = new Decoder(), scene = new Scene();
    scene.apply(r, decoder);
    for (const [number, type] of decoder.types) if (type.name === 'Transform') return {r, number, type};
  }
  throw new Error('no Transform in raw.rlog');
}

const {r, number, type} = descriptions();
const field = type.fields.findIndex((f) => f.name === 'translation');
const scene = new Scene(), decoder = new Decoder();
scene.apply(r, decoder);
const first = 1000;
const created = new Writer();
for (let i = 0; i < COUNT; ++i) created.varint(i === 0 ? 4 * first : 4).varint(number).varint(0);
scene.apply(readRecord(record(2, scene.state, scene.state + 1, new Writer().block(2, COUNT, created).bytes)), decoder);

const times = [], parses = [];
for (let frame = 0; frame < FRAMES; ++frame) {
  const column = new Writer().u8(0).u8(0).u8(24).varint(field);
  for (let i = 0; i < COUNT; ++i) column.varint(i === 0 ? 2 * first : 2);
  const values = Float32Array.from({length: 3 * COUNT}, (_, i) => Math.sin(i + frame));
  column.raw(new Uint8Array(values.buffer));
  const bytes = record(2, scene.state, scene.state + 1, new Writer().block(4, COUNT, column).bytes);
  const json = JSON.stringify(Array.from({length: COUNT}, (_, i) => [first + i, ...values.subarray(3 * i, 3 * i + 3)]));
  let start = performance.now();
  scene.apply(readRecord(bytes), decoder);
  scene.hash.hex();
  times.push(performance.now() - start);
  start = performance.now();
  JSON.parse(json);
  parses.push(performance.now() - start);
}
const median = (x) => x.slice(FRAMES / 3).sort((a, b) => a - b)[Math.floor(FRAMES / 3)];
console.log(JSON.stringify({bench: 'sync.js', case: `${COUNT} changes a frame`, metric: 'decode, apply and hash', unit: 'ms',
  value: +median(times).toFixed(2), baseline: {name: 'JSON.parse alone', value: +median(parses).toFixed(2)},
  limit: {name: 'half a frame at 60 Hz', value: 8}}));
