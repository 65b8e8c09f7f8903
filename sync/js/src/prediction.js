// Predicts values from earlier ones (PROTOCOL.md, "Prediction"). Numbers are 32-bit integers that grow with the f32
// they represent, or positions on a grid. All arithmetic on them is modulo 2^32.

import {FormatError} from './reader.js';
import {SFROTATION, lanesOf} from './values.js';

const UNKNOWN = -1;
const LARGEST = 3.4028234663852886e38;
const bits = new Int32Array(1), float = new Float32Array(bits.buffer);
const flipped = (n) => n < 0 ? n ^ 0x7FFFFFFF : n;  // maps f32 bits to numbers and back; it is its own inverse
function toFloat(n) {
  bits[0] = flipped(n);
  return float[0];
}
function ofFloat(x) {
  float[0] = x;
  return flipped(bits[0]);
}
const sizeOf = (d) => d === -0x80000000 ? 32 : 32 - Math.clz32(Math.abs(d));

/** Rounds to the nearest whole number, ties to even; 0 from 2^21 on. */
function toPlace(x) {
  if (!(Math.abs(x) < 2 ** 21)) return 0;
  let n = Math.round(x);
  if (n - x === 0.5 && n % 2 !== 0) --n;
  return Math.abs(n) < 2 ** 21 ? n | 0 : 0;
}
function toGrid(type, n, width) {
  const f = Array.from(n, toFloat);
  const v = type === SFROTATION ? [f[0] * f[3], f[1] * f[3], f[2] * f[3], 0] : f;
  return Int32Array.from(v, (x) => toPlace(x / width));
}
function fromGrid(type, n, width) {
  const v = Array.from(n, (x) => x * width);
  if (type !== SFROTATION) return Int32Array.from(v, ofFloat);
  const angle = Math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
  const turned = angle > 0 ? [v[0] / angle, v[1] / angle, v[2] / angle, angle] : [0, 0, 1, 0];
  return Int32Array.from(turned, ofFloat);
}

/** What is remembered of a field: its last values as numbers, newest first. */
class Past {
  constructor(now, sync) {
    this.values = [now];
    this.width = 0;
    this.sync = sync;
    this.orders = [0, 0, 0, 0];
    this.sizes = [UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN];
  }
  /** Converts the values to the numbers of a column: on a grid of this width, or without a grid. */
  bring(type, width) {
    if (this.width === width) return;
    if (this.width) this.values = this.values.map((n) => fromGrid(type, n, this.width));
    if (width) this.values = this.values.map((n) => toGrid(type, n, width));
    this.width = width;
  }
  forecast(lane, order) {
    const [a, b, c] = this.values;
    if (order === 0) return a[lane];
    if (this.width) return (order === 1 ? 2 * a[lane] - b[lane] : 3 * (a[lane] - b[lane]) + c[lane]) | 0;
    const x = toFloat(a[lane]), y = toFloat(b[lane]);
    const next = order === 1 ? 2 * x - y : 3 * (x - y) + toFloat(c[lane]);
    return Math.abs(next) <= LARGEST ? ofFloat(next) : a[lane];
  }
  /** `residual(lane, foretold)` reads or makes the residuals. Returns the new numbers and learns from them. */
  code(type, residual) {
    const lanes = type === SFROTATION && this.width ? 3 : lanesOf(type);
    const depth = this.values.length;
    const now = new Int32Array(4), sizes = [UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN];
    const last = type === SFROTATION && !this.width ? this.longest() : -1;
    const take = (lane, foretold) => {
      const d = residual(lane, foretold) | 0;
      now[lane] = foretold + d;
      sizes[lane] = sizeOf(d);
    };
    for (let lane = 0; lane < lanes; ++lane)
      if (lane !== last) take(lane, this.forecast(lane, Math.min(this.orders[lane], depth - 1)));
    if (last >= 0) {
      // The axis has length 1, so its longest component follows from the others.
      const p = toFloat(now[last === 0 ? 1 : 0]), q = toFloat(now[last === 2 ? 1 : 2]);
      const square = 1 - p * p - q * q, size = square > 0 ? Math.sqrt(square) : 0;
      take(last, ofFloat(toFloat(this.values[0][last]) < 0 ? -size : size));
    }
    const orders = [0, 0, 0, 0];
    for (let lane = 0; lane < lanes; ++lane) {
      orders[lane] = depth === 1 ? 1 : 0;
      let least = Infinity;
      for (let order = 0; depth > 1 && order < depth; ++order) {
        const miss = Math.abs((now[lane] - this.forecast(lane, order)) | 0);
        if (miss < least) least = miss, orders[lane] = order;
      }
    }
    this.orders = orders;
    this.sizes = sizes;
    this.values = [now, ...this.values.slice(0, 2)];
    return now;
  }
  longest() {
    const [x, y, z] = [0, 1, 2].map((lane) => toFloat(this.values[0][lane]));
    if (!(Math.abs(x * x + y * y + z * z - 1) < 1e-5)) return -1;
    const size = [Math.abs(x), Math.abs(y), Math.abs(z)];
    return size.indexOf(Math.max(...size));
  }
}

/** Bits, least significant first in each byte. */
class Bits {
  constructor(bytes) {
    this.bytes = bytes;
    this.at = 0;
  }
  get(count) {
    let result = 0;
    for (let i = 0; i < count; ++i, ++this.at) {
      const byte = this.bytes[this.at >> 3];
      if (byte === undefined) throw new FormatError('residuals cut short');
      result |= (byte >> (this.at & 7) & 1) << i;
    }
    return result;
  }
  packed(size) {
    let width = size === UNKNOWN ? 12 : size === 0 ? 0 : size + 1;
    while (width < 32 && this.get(1)) width += 3;
    const z = this.get(Math.min(width, 32));
    return (z >>> 1) ^ -(z & 1);
  }
}

const CLASSES = [1, 2, 3, 4, 4, 5, 5, 6, 6, 6, 7, 7, 7, 7, 8, 8, 8, 8, 8, 8, 9, 9, 9, 9, 9, 9, 9, 9, 9, 9, 9, 9, 9];
const RATES = [1, 2, 3, 3, 4, 4, 4, 4, 4, 4, 5, 5, 5, 5, 5, 5];

class RangeCoder {
  constructor(bytes, models) {
    this.bytes = bytes;
    this.models = models;
    this.at = 4;
    this.range = 0xFFFFFFFF;
    this.code = [0, 1, 2, 3].reduce((code, i) => code * 256 + (bytes[i] ?? 0), 0);
  }
  decide(key) {
    let model = this.models.get(key);
    if (!model) this.models.set(key, model = {zero: 1 << 14, seen: 0});
    const bound = (this.range >>> 15) * model.zero, rate = RATES[model.seen];
    const bit = this.code >= bound ? 1 : 0;
    if (bit) {
      this.code -= bound;
      this.range -= bound;
      model.zero -= model.zero >> rate;
    } else {
      this.range = bound;
      model.zero += (32768 - model.zero) >> rate;
    }
    model.seen = Math.min(model.seen + 1, 15);
    while (this.range < 2 ** 24) {
      this.range *= 256;
      this.code = this.code * 256 % 2 ** 32 + (this.bytes[this.at++] ?? 0);
    }
    return bit;
  }
  /** `plain` has the lower bits. */
  number(plain, model, size) {
    const c = size === UNKNOWN ? 0 : CLASSES[size];
    if (!this.decide(`z${model} ${c}`)) return 0;
    let t = 1;
    for (let i = 0; i < 5; ++i) t = t << 1 | this.decide(`s${model} ${c} ${t}`);
    const n = (t & 31) + 1, negative = this.decide(`- ${model} ${c}`);
    let magnitude = 1;
    if (n >= 2) magnitude = 2 | this.decide(`t${model} ${n}`);
    if (n >= 3) magnitude = (magnitude * 2 ** (n - 2)) + (plain.get(n - 2) >>> 0);
    return negative ? -magnitude : magnitude;
  }
}

/** What one stream's reader remembers. */
export class Memory {
  constructor() {
    this.pasts = new Map();
    this.models = new Map();
    this.syncs = 0;
    this.before = new Uint32Array(0);
  }
  /** Call it before a frame with these flags, and with 4 before a keyframe. */
  begin(flags) {
    if (flags & 4) this.pasts.clear();
    if (flags & 6) {
      ++this.syncs;
      this.models.clear();
    }
    this.before = new Uint32Array(0);
  }
  past(node, field, type) {
    const past = this.pasts.get(`${node} ${field} ${type}`);
    if (past && past.sync !== this.syncs) {
      past.values.length = 1;
      past.sizes = [UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN];
      past.sync = this.syncs;
    }
    return past;
  }
  /** Learns from a raw value, whose f32 start at words[at]. */
  remember(node, field, type, words, at) {
    const lanes = lanesOf(type), now = new Int32Array(4);
    for (let lane = 0; lane < lanes; ++lane) now[lane] = flipped(words[at + lane]);
    const past = this.past(node, field, type);
    if (!past) {
      if (this.pasts.size >= 1 << 22) throw new FormatError('more fields to remember than a stream may have');
      this.pasts.set(`${node} ${field} ${type}`, new Past(now, this.syncs));
      return;
    }
    past.bring(type, 0);
    past.code(type, (lane, foretold) => now[lane] - foretold);
  }
  /** Reads the rest of a column with coding 1 or 2: its nodes and their values as f32 bits. */
  column(reader, count, coding, type, field) {
    const lanes = lanesOf(type), form = reader.u8();
    const width = form & 1 ? reader.f64() : 0, how = form >> 1 & 3;
    if (!lanes || (form & 1 && !(width > 0)) || (how === 3 && coding !== 2)) throw new FormatError('a malformed column');
    const nodes = new Uint32Array(count);
    if (how === 0) for (let i = 0, node = 0; i < count; ++i) nodes[i] = node = reader.node(node);
    else if (how === 1) readRuns(reader, nodes);
    else if (how === 2) {
      if (this.before.length !== count) throw new FormatError('a column of the nodes before has as many');
      nodes.set(this.before);
    }
    const kind = `${field} ${type} ${width ? 1 : 0}`;
    if (coding === 2 && !this.models.has(kind)) this.models.set(kind, new Map());
    const coder = coding === 2 ? new RangeCoder(reader.take(reader.varint()), this.models.get(kind)) : null;
    const plain = new Bits(reader.take(reader.left)), words = new Int32Array(count * lanes);
    for (let i = 0, node = 0, size = UNKNOWN; i < count; ++i) {
      if (how === 3) {
        const gap = coder.number(plain, 4, size);
        nodes[i] = node = node + gap;
        size = sizeOf(gap);
      }
      const past = this.past(nodes[i], field, type);
      if (!past) throw new FormatError(`a foretold value of node ${nodes[i]}, of which nothing is known`);
      past.bring(type, width);
      const now = past.code(type, coder ? (lane) => coder.number(plain, lane, past.sizes[lane])
                                        : (lane) => plain.packed(past.sizes[lane]));
      const off = width ? fromGrid(type, now, width) : now;
      for (let lane = 0; lane < lanes; ++lane) words[i * lanes + lane] = flipped(off[lane]);
    }
    this.before = nodes;
    return {nodes, words};
  }
}

function readRuns(reader, nodes) {
  let i = 0, node = 0;
  for (let runs = reader.count(2); runs > 0; --runs) {
    node = reader.node(node);
    const more = reader.varint(), step = more ? reader.signed() : 0;
    if (i + more + 1 > nodes.length) throw new FormatError('more nodes in runs than in the column');
    nodes[i++] = node;
    for (let k = 0; k < more; ++k) nodes[i++] = node += step;
  }
  if (i !== nodes.length) throw new FormatError('fewer nodes in runs than in the column');
}
