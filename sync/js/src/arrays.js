// Packed arrays (PROTOCOL.md, "Arrays"): columns of coding 3, which scene files have.
import {FormatError} from './reader.js';

const kBlock = 1024, kDecimal = 128, kSmallestLane = 10;
const kLanes = new Map([[3, 1], [5, 1], [21, 2], [25, 3], [15, 3], [29, 4], [17, 4], [33, 4]]);  // by value type
const kMfInt32 = 3;
const kPowers = [1, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10];
const float = new Float32Array(1), bitsOfFloat = new Uint32Array(float.buffer);

/** Reads `bits` bits of each number from `first` on, least significant first. */
function unpack(bytes, bits, numbers, first) {
  let word = 0, filled = 0, at = 0;  // up to 39 bits, so no 32-bit arithmetic
  const scale = 2 ** bits;
  for (let i = first; i < numbers.length; ++i) {
    while (filled < bits) {
      word += bytes[at++] * 2 ** filled;
      filled += 8;
    }
    numbers[i] = word % scale;
    word = Math.floor(word / scale);
    filled -= bits;
  }
}

/** Writes one component of a block into every `stride`-th word from `to` on. */
function readLane(reader, size, isFloat, words, to, stride) {
  const form = reader.u8(), lag = reader.u8(), base = reader.u32(), bits = form % kDecimal, decimal = form >= kDecimal;
  if (bits > 32 || lag < 1 || lag > 8 || (decimal && !isFloat)) throw new FormatError('unknown packing');
  const exponent = decimal ? reader.u8() : 0, odd = decimal ? reader.u8() : 0;
  if (exponent > 10 || odd > 32) throw new FormatError('unknown packing');
  const odds = Array.from({length: odd}, () => [reader.u16(), reader.u32()]);
  if (odds.some(([at]) => at >= size)) throw new FormatError('a number beyond its block');
  const numbers = new Uint32Array(size), first = Math.min(lag, size);
  for (let i = 0; i < first; ++i) numbers[i] = reader.u32();
  unpack(reader.take(Math.ceil((size - first) * bits / 8)), bits, numbers, first);
  for (let i = first; i < size; ++i) numbers[i] += numbers[i - lag] + base;
  for (let i = 0; i < size; ++i) {
    let word = numbers[i];
    if (decimal) {
      float[0] = (word | 0) / kPowers[exponent];
      word = bitsOfFloat[0];
    } else if (isFloat && (word | 0) < 0) {
      word ^= 0x7FFFFFFF;
    }
    words[to + i * stride] = word;
  }
  for (const [at, bits32] of odds) words[to + at * stride] = bits32;
}

/** The bytes of an array as a state hash takes them. */
export function readPacked(reader, type) {
  const lanes = kLanes.get(type), size = reader.varint();
  if (!lanes) throw new FormatError(`packed values of type ${type}`);
  if (Math.ceil(size / kBlock) * lanes * kSmallestLane > reader.left) {
    throw new FormatError(`${size} packed elements in ${reader.left} bytes`);
  }
  const words = new Uint32Array(size * lanes);
  for (let i = 0; i < size; i += kBlock) {
    for (let lane = 0; lane < lanes; ++lane) {
      readLane(reader, Math.min(kBlock, size - i), type !== kMfInt32, words, i * lanes + lane, lanes);
    }
  }
  return new Uint8Array(words.buffer);
}
