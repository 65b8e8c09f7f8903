// How long a frame of 10,000 changed translations takes to be decoded, applied and hashed; beside it JSON.parse of the same
// values, a bare loop over them, and a call of hash-wasm for each. JSON lines, medians, by the clock and in processor time.
import {readFileSync} from 'node:fs';
import {createXXHash128} from 'hash-wasm';
import {Decoder, Scene, Writer, readRecord, records} from './src/index.js';
import {xxh64} from './src/xxh3.js';

const COUNT = 10_000, FRAMES = 60;

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
scene.apply(readRecord(record(2, scene.state, scene.state + 1, new Writer().block(2, COUNT, created).done())), decoder);

/** Milliseconds by the clock, and of the processor's time, which what else runs on a machine leaves alone. */
function timed(work) {
  const start = performance.now(), before = process.cpuUsage();
  work();
  const used = process.cpuUsage(before);
  return {wall: performance.now() - start, cpu: (used.user + used.system) / 1000};
}
const wasm = await createXXHash128(1, 2);
const times = [], parses = [], loops = [], hashes = [];
for (let frame = 0; frame < FRAMES; ++frame) {
  const column = new Writer().u8(0).u8(0).u8(24).varint(field);
  for (let i = 0; i < COUNT; ++i) column.varint(i === 0 ? 2 * first : 2);
  const values = Float32Array.from({length: 3 * COUNT}, (_, i) => Math.sin(i + frame));
  const raw = new Uint8Array(values.buffer);
  column.raw(raw);
  const bytes = record(2, scene.state, scene.state + 1, new Writer().block(4, COUNT, column).done());
  const json = JSON.stringify(Array.from({length: COUNT}, (_, i) => [first + i, ...values.subarray(3 * i, 3 * i + 3)]));
  times.push(timed(() => {
    scene.apply(readRecord(bytes), decoder);
    scene.hash.hex();
  }));
  parses.push(timed(() => JSON.parse(json)));
  loops.push(timed(() => {
    const view = new DataView(values.buffer), all = [];
    for (let at = 0; at < raw.length; at += 12) all.push([view.getFloat32(at, true), view.getFloat32(at + 4, true), view.getFloat32(at + 8, true)]);
  }));
  hashes.push(timed(() => {
    for (let at = 0; at < raw.length; at += 12) {
      wasm.init();
      wasm.update(raw.subarray(at, at + 12));
      wasm.digest('binary');
    }
  }));
}
const median = (all, which) => +all.slice(FRAMES / 3).map((t) => t[which]).sort((a, b) => a - b)[Math.floor(FRAMES / 3)].toFixed(2);
for (const [which, words] of [['wall', 'decode, apply and hash'], ['cpu', 'decode, apply and hash, processor time']])
  for (const [name, all] of [['JSON.parse alone', parses], ['a loop that reads the values alone', loops], ['hash-wasm, a call a value, alone', hashes]])
    console.log(JSON.stringify({bench: 'sync.js', case: `${COUNT} changes a frame`, metric: words, unit: 'ms', value: median(times, which),
      baseline: {name, value: median(all, which)}, limit: {name: 'half a frame at 60 Hz', value: 8}}));
