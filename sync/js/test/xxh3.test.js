// Compares the short hashes computed here with those of hash-wasm, for several seeds and lengths.
import assert from 'node:assert/strict';
import {test} from 'node:test';
import {createXXHash128} from 'hash-wasm';
import {xxh128, xxh128OfWords} from '../src/xxh3.js';

test('XXH3-128 of any length, with any seed, is that of hash-wasm', async () => {
  const seed = Number(process.env.SEED ?? Date.now() % 2 ** 31);
  console.log(`# seed ${seed}`);
  let state = seed;
  const random = () => (state = (Math.imul(state, 1664525) + 1013904223) >>> 0);
  for (let round = 0; round < 12; ++round) {
    const special = [[1, 0], [0xFFFFFFFF, 0xFFFFFFFF], [0, 1], [0x80000000, 0x7FFFFFFF]];
    const [low, high] = special[round] ?? [(random() | 1) >>> 0, random()];
    const other = await createXXHash128(low, high);
    for (let length = 0; length <= 300; length += length < 24 ? 1 : 23) {
      const bytes = Uint8Array.from({length: length + 3}, () => round === 1 ? 255 : random() >>> 24);
      const into = new Uint32Array(8);
      xxh128(into, 4, bytes, new DataView(bytes.buffer), 3, length, low, high);
      other.init();
      other.update(bytes.subarray(3));
      const digest = other.digest('binary');
      const view = new DataView(digest.buffer, digest.byteOffset);
      const expected = [12, 8, 4, 0].map((at) => view.getUint32(at));
      assert.deepEqual([...into.subarray(4)], expected, `${length} bytes, seed ${low} ${high}`);
      if (length % 4 || length === 0 || length > 16) continue;
      const words = new Int32Array(bytes.slice(3).buffer);
      xxh128OfWords(into, 0, words, 0, length / 4, low, high);
      assert.deepEqual([...into.subarray(0, 4)], expected, `${length / 4} words`);
    }
  }
});
