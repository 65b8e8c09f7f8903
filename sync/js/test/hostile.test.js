// Logs with random changes, some with corrected checksums to reach what is behind them. A reader reports the problem or
// reads on. It never hangs, and never allocates memory for what is not there.
import assert from 'node:assert/strict';
import {readFileSync, readdirSync} from 'node:fs';
import {test} from 'node:test';
import {FormatError, Replay, records} from '../src/index.js';
import {xxh64} from '../src/xxh3.js';

const folder = new URL('../../../tests/sync/conformance/', import.meta.url);
const ROUNDS = Number(process.env.ROUNDS ?? 150);

test('whatever is in a log, reading it ends in a state or a FormatError', () => {
  const seed = Number(process.env.SEED ?? Date.now() % 2 ** 31);
  console.log(`# seed ${seed}`);
  let state = seed;
  const random = (n) => (state = (Math.imul(state, 1664525) + 1013904223) >>> 0) % n;
  let refused = 0;
  for (const name of readdirSync(folder).filter((n) => n.endsWith('.rlog'))) {
    const whole = new Uint8Array(readFileSync(new URL(name, folder)));
    const places = [...records(whole)].map(({offset, size}) => ({offset, size}));
    for (let round = 0; round < ROUNDS; ++round) {
      const bytes = whole.slice();
      for (let n = 1 + random(3); n > 0; --n) {
        const {offset, size} = places[random(places.length)];
        if (size <= 64) continue;
        bytes[offset + 64 + random(size - 64)] = random(4) ? random(256) : 255;
        const sum = xxh64(bytes.subarray(offset + 16, offset + size));
        new DataView(bytes.buffer).setBigUint64(offset + 8, sum, true);
      }
      const replay = new Replay(bytes);
      try {
        while (replay.step());
      } catch (error) {
        if (!(error instanceof FormatError)) throw error;
        ++refused;
      }
    }
  }
  assert.ok(refused > ROUNDS, `only ${refused} were noticed before a hash was`);
});

test('what is cut off anywhere is damage, not an error', () => {
  const whole = new Uint8Array(readFileSync(new URL('edits.rlog', folder)));
  for (let length = whole.length; length > 0; length -= 97) {
    const replay = new Replay(whole.subarray(0, length));
    while (replay.step()) assert.ok(replay.equal);
    assert.equal(replay.closed, length === whole.length);
  }
});
