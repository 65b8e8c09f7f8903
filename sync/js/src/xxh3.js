// XXH3 with 64 and 128 bits. Long inputs go through hash-wasm. Terms of a state hash are mostly of 1 to 16 bytes, each with
// a seed of its own, for which a call into WebAssembly costs several times what the hash does: these are computed here.
// Source: xxHash 0.8, XXH3_128bits_withSeed. Numbers of 64 bits are pairs of unsigned 32-bit halves, low one first.

import {createXXHash128, createXXHash3} from 'hash-wasm';

const sum64 = await createXXHash3(0, 0);
const sum128 = await createXXHash128(1, 0);

/** Where hash-wasm's saved state has the secret that is made of the seed, and the seed. */
const kSecretAt = 68, kSeedAt = 548, kSecretSize = 192;
const saved = (() => {
  sum128.init();
  const state = sum128.save();
  if (state.length !== 580 || state[kSeedAt] !== 1) throw new Error('hash-wasm keeps its state otherwise than expected');
  return state;
})();
const savedView = new DataView(saved.buffer, saved.byteOffset, saved.byteLength);
/** XXH3's secret, as it is without a seed. */
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

/** XXH3-64, seed 0, of a whole record: as a BigInt. */
export function xxh64(bytes) {
  sum64.init();
  sum64.update(bytes);
  const digest = sum64.digest('binary');  // big endian
  return new DataView(digest.buffer, digest.byteOffset, 8).getBigUint64(0, false);
}

// Scratch of the functions below: results of a multiplication, and the hash itself.
let m0 = 0, m1 = 0, m2 = 0, m3 = 0;

/** The 64 bits of a * b: m0, m1. */
function multiply32(a, b) {
  const al = a & 0xFFFF, ah = a >>> 16, bl = b & 0xFFFF, bh = b >>> 16;
  const p = al * bl;
  const q = ah * bl + (p >>> 16);
  const r = al * bh + (q & 0xFFFF);
  m0 = ((r << 16) | (p & 0xFFFF)) >>> 0;
  m1 = (ah * bh + (q >>> 16) + (r >>> 16)) >>> 0;
}
/** The 128 bits of (al, ah) * (bl, bh): m0 to m3. */
function multiply(al, ah, bl, bh) {
  multiply32(al, bl);
  const r0 = m0;
  let r1 = m1;
  multiply32(ah, bl);
  r1 += m0;
  let r2 = m1 + (r1 > 0xFFFFFFFF ? 1 : 0);
  r1 >>>= 0;
  multiply32(al, bh);
  r1 += m0;
  r2 += m1 + (r1 > 0xFFFFFFFF ? 1 : 0);
  r1 >>>= 0;
  multiply32(ah, bh);
  r2 += m0;
  m3 = (m1 + Math.floor(r2 / 0x100000000)) >>> 0;
  m2 = r2 >>> 0;
  m1 = r1;
  m0 = r0;
}
/** The low 64 bits: m0, m1. */
function multiplyLow(al, ah, bl, bh) {
  multiply32(al, bl);
  m1 = (m1 + Math.imul(ah, bl) + Math.imul(al, bh)) >>> 0;
}

/** The low 64 bits of a number of 32 bits times (low, high), low one first. */
export function times(number, low, high) {
  multiplyLow(number, 0, low, high);
  return [m0, m1];
}

const swap = (x) => ((x << 24) | ((x & 0xFF00) << 8) | ((x >>> 8) & 0xFF00) | (x >>> 24)) >>> 0;

/** XXH3's last mixing of (l, h): m0, m1. */
function avalanche(l, h) {
  l = (l ^ (h >>> 5)) >>> 0;  // h >> 37
  multiplyLow(l, h, 0x9E3779F9, 0x16566791);
  m0 = (m0 ^ m1) >>> 0;  // h >> 32
}
/** XXH64's. */
function avalanche64(l, h) {
  l = (l ^ (h >>> 1)) >>> 0;  // h >> 33
  multiplyLow(l, h, 0x27D4EB4F, 0xC2B2AE3D);
  const x = (m0 ^ ((m0 >>> 29) | (m1 << 3))) >>> 0, y = (m1 ^ (m1 >>> 29)) >>> 0;
  multiplyLow(x, y, 0x9E3779F9, 0x165667B1);
  m0 = (m0 ^ m1) >>> 0;  // h >> 32
}

function finish(into, at, l0, l1, h0, h1) {
  into[at] = l0;
  into[at + 1] = l1;
  into[at + 2] = h0;
  into[at + 3] = h1;
}

/** Of 9 to 16 bytes, whose first eight are (a, b) and whose last eight are (c, d). */
function hash9to16(into, at, a, b, c, d, length, seedLow, seedHigh) {
  let l = F9l - seedLow, h = F9h - seedHigh - (l < 0 ? 1 : 0);
  multiply((a ^ c ^ l) >>> 0, (b ^ d ^ h) >>> 0, 0x85EBCA87, 0x9E3779B1);
  let x0 = m0, x1 = (m1 + ((length - 1) << 22)) >>> 0, x2 = m2, x3 = m3;
  l = F9Hl + seedLow;
  h = F9Hh + seedHigh + (l > 0xFFFFFFFF ? 1 : 0);
  const il = (c ^ l) >>> 0, ih = (d ^ h) >>> 0;
  multiply32(il, 0x85EBCA76);
  let s = x2 + il + m0;
  x3 = (x3 + ih + m1 + Math.floor(s / 0x100000000)) >>> 0;
  x2 = s >>> 0;
  x0 = (x0 ^ swap(x3)) >>> 0;
  x1 = (x1 ^ swap(x2)) >>> 0;
  multiply(x0, x1, 0x27D4EB4F, 0xC2B2AE3D);
  x0 = m0, x1 = m1;
  const y2 = m2, y3 = m3;
  multiplyLow(x2, x3, 0x27D4EB4F, 0xC2B2AE3D);
  s = y2 + m0;
  x3 = (y3 + m1 + (s > 0xFFFFFFFF ? 1 : 0)) >>> 0;
  x2 = s >>> 0;
  avalanche(x0, x1);
  x0 = m0, x1 = m1;
  avalanche(x2, x3);
  finish(into, at, x0, x1, m0, m1);
}

/** Of 4 to 8 bytes, whose first four are `a` and whose last four are `b`. */
function hash4to8(into, at, a, b, length, seedLow, seedHigh) {
  seedHigh = (seedHigh ^ swap(seedLow)) >>> 0;
  const l = F4l + seedLow, h = F4h + seedHigh + (l > 0xFFFFFFFF ? 1 : 0);
  multiply((a ^ l) >>> 0, (b ^ h) >>> 0, (0x85EBCA87 + (length << 2)) >>> 0, 0x9E3779B1);
  let s = m2 + ((m0 << 1) >>> 0);
  const h3 = (m3 + (((m1 << 1) | (m0 >>> 31)) >>> 0) + (s > 0xFFFFFFFF ? 1 : 0)) >>> 0, h2 = s >>> 0;
  let x0 = (m0 ^ ((h2 >>> 3) | (h3 << 29))) >>> 0, x1 = (m1 ^ (h3 >>> 3)) >>> 0;
  x0 = (x0 ^ (x1 >>> 3)) >>> 0;  // >> 35
  multiplyLow(x0, x1, 0x1E98DF25, 0x9FB21C65);
  x0 = (m0 ^ ((m0 >>> 28) | (m1 << 4))) >>> 0;
  x1 = (m1 ^ (m1 >>> 28)) >>> 0;
  avalanche(h2, h3);
  finish(into, at, x0, x1, m0, m1);
}

function hash1to3(into, at, bytes, from, length, seedLow, seedHigh) {
  const first = bytes[from], middle = bytes[from + (length >> 1)], last = bytes[from + length - 1];
  const combined = ((first << 16) | (middle << 24) | last | (length << 8)) >>> 0;
  const swapped = swap(combined);
  const turned = ((swapped << 13) | (swapped >>> 19)) >>> 0;
  let l = F1 + seedLow, h = seedHigh + (l > 0xFFFFFFFF ? 1 : 0);
  avalanche64((combined ^ l) >>> 0, h >>> 0);
  const x0 = m0, x1 = m1;
  l = F1H - seedLow;
  h = -seedHigh - (l < 0 ? 1 : 0);
  avalanche64((turned ^ l) >>> 0, h >>> 0);
  finish(into, at, x0, x1, m0, m1);
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
  finish(into, at, view.getUint32(12), view.getUint32(8), view.getUint32(4), view.getUint32(0));
}

/** XXH3-128 of `length` bytes from `from` on: four numbers into[at], low one first. The seed is not 0. */
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

/** The same of 4 × n bytes, 1 to 4 numbers w[i] of 32 bits. */
export function xxh128OfWords(into, at, w, i, n, seedLow, seedHigh) {
  if (n === 1) hash4to8(into, at, w[i] >>> 0, w[i] >>> 0, 4, seedLow, seedHigh);
  else if (n === 2) hash4to8(into, at, w[i] >>> 0, w[i + 1] >>> 0, 8, seedLow, seedHigh);
  else if (n === 3) hash9to16(into, at, w[i] >>> 0, w[i + 1] >>> 0, w[i + 1] >>> 0, w[i + 2] >>> 0, 12, seedLow, seedHigh);
  else hash9to16(into, at, w[i] >>> 0, w[i + 1] >>> 0, w[i + 2] >>> 0, w[i + 3] >>> 0, 16, seedLow, seedHigh);
}
