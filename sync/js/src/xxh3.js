// XXH3 with 64 and 128 bits. Long inputs are hashed by hash-wasm. Terms of a state hash mostly have 1 to 16 bytes and a
// seed of their own, for which a call into WebAssembly would cost several times as much as the hash. These are computed
// here. Numbers of 64 bits are pairs of unsigned 32-bit halves, low one first. Source: xxHash 0.8,
// XXH3_128bits_withSeed.

import {createXXHash128, createXXHash3} from 'hash-wasm';

const sum64 = await createXXHash3(0, 0);
const sum128 = await createXXHash128(1, 0);

/** Where the saved state of hash-wasm has the secret made of the seed, and the seed. */
const kSecretAt = 68, kSeedAt = 548, kSecretSize = 192;
const saved = (() => {
  sum128.init();
  const state = sum128.save();
  if (state.length !== 580 || state[kSeedAt] !== 1) throw new Error('hash-wasm keeps its state otherwise than expected');
  return state;
})();
const savedView = new DataView(saved.buffer, saved.byteOffset, saved.byteLength);
/** XXH3's secret without a seed. */
const secret = (() => {
  const words = new BigUint64Array(kSecretSize / 8);
  for (let i = 0; i < words.length; ++i)
    words[i] = savedView.getBigUint64(kSecretAt + 8 * i, true) + (i % 2 ? 1n : -1n);
  return words;
})();
const low = (word) => Number(word & 0xFFFFFFFFn);
const high = (word) => Number(word >> 32n);
/** Secret words i and i + 1, one xor the other. */
const flip = (i) => { const f = secret[i] ^ secret[i + 1]; return [low(f), high(f)]; };
const [F4l, F4h] = flip(2), [F9l, F9h] = flip(4), [F9Hl, F9Hh] = flip(6);
const F1 = (low(secret[0]) ^ high(secret[0])) >>> 0, F1H = (low(secret[1]) ^ high(secret[1])) >>> 0;

/** XXH3-64 of a whole record with seed 0, as a BigInt. */
export function xxh64(bytes) {
  sum64.init();
  sum64.update(bytes);
  const digest = sum64.digest('binary');  // big endian
  return new DataView(digest.buffer, digest.byteOffset, 8).getBigUint64(0, false);
}

// The result of a multiplication: up to four halves, low one first. A variable would need an object for each number
// above 2^31, so it is a typed array. All numbers are kept below 2^32, so that the engine computes with integers.
const m = new Uint32Array(4);

/** The 64 bits of a * b. */
function multiply32(a, b) {
  const al = a & 0xFFFF, ah = a >>> 16, bl = b & 0xFFFF, bh = b >>> 16;
  const p = Math.imul(al, bl) >>> 0;
  const q = (Math.imul(ah, bl) + (p >>> 16)) >>> 0;
  const r = (Math.imul(al, bh) + (q & 0xFFFF)) >>> 0;
  m[0] = (r << 16) | (p & 0xFFFF);
  m[1] = Math.imul(ah, bh) + (q >>> 16) + (r >>> 16);
}
/** The 128 bits of (al, ah) * (bl, bh). */
function multiply(al, ah, bl, bh) {
  multiply32(al, bl);
  const r0 = m[0], c1 = m[1];
  multiply32(ah, bl);
  let r1 = (c1 + m[0]) >>> 0;
  const c2 = (m[1] + (r1 < c1 ? 1 : 0)) >>> 0;
  multiply32(al, bh);
  const before = r1;
  r1 = (r1 + m[0]) >>> 0;
  const d2 = (m[1] + (r1 < before ? 1 : 0)) >>> 0;
  const e2 = (c2 + d2) >>> 0, over = e2 < c2 ? 1 : 0;
  multiply32(ah, bh);
  const r2 = (m[0] + e2) >>> 0;
  m[3] = m[1] + over + (r2 < e2 ? 1 : 0);
  m[2] = r2;
  m[1] = r1;
  m[0] = r0;
}
/** The low 64 bits. */
function multiplyLow(al, ah, bl, bh) {
  multiply32(al, bl);
  m[1] += Math.imul(ah, bl) + Math.imul(al, bh);
}

/** The low 64 bits of a number of 32 bits times (low, high), low one first. */
export function times(number, low, high) {
  multiplyLow(number, 0, low, high);
  return [m[0], m[1]];
}

const swap = (x) => ((x << 24) | ((x & 0xFF00) << 8) | ((x >>> 8) & 0xFF00) | (x >>> 24)) >>> 0;

/** XXH3's last mixing of (l, h). */
function avalanche(l, h) {
  multiplyLow((l ^ (h >>> 5)) >>> 0, h, 0x9E3779F9, 0x16566791);  // h >> 37
  m[0] ^= m[1];  // h >> 32
}
/** XXH64's last mixing. */
function avalanche64(l, h) {
  multiplyLow((l ^ (h >>> 1)) >>> 0, h, 0x27D4EB4F, 0xC2B2AE3D);  // h >> 33
  const x = m[0], y = m[1];
  multiplyLow((x ^ ((x >>> 29) | (y << 3))) >>> 0, (y ^ (y >>> 29)) >>> 0, 0x9E3779F9, 0x165667B1);
  m[0] ^= m[1];  // h >> 32
}

function finish(into, at, l0, l1) {
  into[at] = l0;
  into[at + 1] = l1;
  into[at + 2] = m[0];
  into[at + 3] = m[1];
}

/** Hashes 9 to 16 bytes, with the first eight in (a, b) and the last eight in (c, d). */
function hash9to16(into, at, a, b, c, d, length, seedLow, seedHigh) {
  let l = (F9l - seedLow) >>> 0, h = (F9h - seedHigh - (F9l < seedLow ? 1 : 0)) >>> 0;
  multiply((a ^ c ^ l) >>> 0, (b ^ d ^ h) >>> 0, 0x85EBCA87, 0x9E3779B1);
  const x0 = m[0], x1 = m[1] + ((length - 1) << 22), x2 = m[2], x3 = m[3];
  l = (F9Hl + seedLow) >>> 0;
  h = (F9Hh + seedHigh + (l < seedLow ? 1 : 0)) >>> 0;
  const il = (c ^ l) >>> 0, ih = (d ^ h) >>> 0;
  multiply32(il, 0x85EBCA76);
  const s = (x2 + il) >>> 0, y2 = (s + m[0]) >>> 0;
  const y3 = (x3 + ih + m[1] + (s < il ? 1 : 0) + (y2 < s ? 1 : 0)) >>> 0;
  multiply((x0 ^ swap(y3)) >>> 0, (x1 ^ swap(y2)) >>> 0, 0x27D4EB4F, 0xC2B2AE3D);
  const z0 = m[0], z1 = m[1], z2 = m[2], z3 = m[3];
  multiplyLow(y2, y3, 0x27D4EB4F, 0xC2B2AE3D);
  const w2 = (z2 + m[0]) >>> 0, w3 = (z3 + m[1] + (w2 < z2 ? 1 : 0)) >>> 0;
  avalanche(z0, z1);
  const r0 = m[0], r1 = m[1];
  avalanche(w2, w3);
  finish(into, at, r0, r1);
}

/** Hashes 4 to 8 bytes, with the first four in `a` and the last four in `b`. */
function hash4to8(into, at, a, b, length, seedLow, seedHigh) {
  const turned = (seedHigh ^ swap(seedLow)) >>> 0;
  const l = (F4l + seedLow) >>> 0, h = (F4h + turned + (l < seedLow ? 1 : 0)) >>> 0;
  multiply((a ^ l) >>> 0, (b ^ h) >>> 0, (0x85EBCA87 + (length << 2)) >>> 0, 0x9E3779B1);
  const low = m[0], high = m[1], twice = (low << 1) >>> 0, h2 = (m[2] + twice) >>> 0;
  const h3 = (m[3] + ((high << 1) | (low >>> 31)) + (h2 < twice ? 1 : 0)) >>> 0;
  const x0 = (low ^ ((h2 >>> 3) | (h3 << 29))) >>> 0, x1 = (high ^ (h3 >>> 3)) >>> 0;
  multiplyLow((x0 ^ (x1 >>> 3)) >>> 0, x1, 0x1E98DF25, 0x9FB21C65);  // >> 35
  const y0 = m[0], y1 = m[1];
  avalanche(h2, h3);
  finish(into, at, (y0 ^ ((y0 >>> 28) | (y1 << 4))) >>> 0, (y1 ^ (y1 >>> 28)) >>> 0);
}

function hash1to3(into, at, bytes, from, length, seedLow, seedHigh) {
  const first = bytes[from], middle = bytes[from + (length >> 1)], last = bytes[from + length - 1];
  const combined = ((first << 16) | (middle << 24) | last | (length << 8)) >>> 0;
  const swapped = swap(combined);
  const turned = ((swapped << 13) | (swapped >>> 19)) >>> 0;
  const l = (F1 + seedLow) >>> 0, h = (seedHigh + (l < seedLow ? 1 : 0)) >>> 0;
  avalanche64((combined ^ l) >>> 0, h);
  const x0 = m[0], x1 = m[1];
  const k = (F1H - seedLow) >>> 0, i = (-seedHigh - (F1H < seedLow ? 1 : 0)) >>> 0;
  avalanche64((turned ^ k) >>> 0, i);
  finish(into, at, x0, x1);
}

function hashLong(into, at, bytes, seedLow, seedHigh) {
  savedView.setUint32(kSeedAt, seedLow, true);
  savedView.setUint32(kSeedAt + 4, seedHigh, true);
  if (bytes.length > 240) {
    const seed = BigInt(seedHigh) << 32n | BigInt(seedLow);
    for (let i = 0; i < secret.length; ++i)
      savedView.setBigUint64(kSecretAt + 8 * i, secret[i] + (i % 2 ? -seed : seed), true);
  }
  sum128.load(saved);
  sum128.update(bytes);
  const digest = sum128.digest('binary');  // big endian, high half first
  const view = new DataView(digest.buffer, digest.byteOffset, 16);
  for (let i = 0; i < 4; ++i) into[at + i] = view.getUint32(12 - 4 * i);
}

/** XXH3-128 of `length` bytes from `from` on. Writes four numbers to into[at], low one first. The seed must not be 0.
 * */
export function xxh128(into, at, bytes, view, from, length, seedLow, seedHigh) {
  if (length > 16 || length === 0)
    hashLong(into, at, bytes.subarray(from, from + length), seedLow, seedHigh);
  else if (length > 8)
    hash9to16(into, at, view.getUint32(from, true), view.getUint32(from + 4, true),
              view.getUint32(from + length - 8, true), view.getUint32(from + length - 4, true), length, seedLow,
              seedHigh);
  else if (length >= 4)
    hash4to8(into, at, view.getUint32(from, true), view.getUint32(from + length - 4, true), length, seedLow, seedHigh);
  else
    hash1to3(into, at, bytes, from, length, seedLow, seedHigh);
}

/** The same for 1 to 4 numbers w[i] of 32 bits. */
export function xxh128OfWords(into, at, w, i, n, seedLow, seedHigh) {
  if (n === 1) hash4to8(into, at, w[i] >>> 0, w[i] >>> 0, 4, seedLow, seedHigh);
  else if (n === 2) hash4to8(into, at, w[i] >>> 0, w[i + 1] >>> 0, 8, seedLow, seedHigh);
  else if (n === 3) hash9to16(into, at, w[i] >>> 0, w[i + 1] >>> 0, w[i + 1] >>> 0, w[i + 2] >>> 0, 12, seedLow, seedHigh);
  else hash9to16(into, at, w[i] >>> 0, w[i + 1] >>> 0, w[i + 2] >>> 0, w[i + 3] >>> 0, 16, seedLow, seedHigh);
}
