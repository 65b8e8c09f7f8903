// What users of the value reader can rely on.
import assert from 'node:assert/strict';
import {readFileSync} from 'node:fs';
import {test} from 'node:test';
import {Replay} from '../src/index.js';
import {editRecord} from '../src/writer.js';

test('a value that was got stays as it was, however the scene goes on', () => {
  const replay = new Replay(new Uint8Array(readFileSync(new URL('../../../tests/sync/conformance/raw.rlog', import.meta.url))));
  const kept = new Map(), seen = new Map();
  let moved = 0;
  while (replay.step()) {
    for (const [id, node] of replay.scene.nodes) {
      node.type.fields.forEach((def, field) => {
        if (!Array.isArray(node.values[field])) return;
        const key = `${id}.${field}`, now = JSON.stringify(node.get(field));
        if (kept.has(key)) assert.equal(JSON.stringify(kept.get(key)), seen.get(key), `${node.type.name}.${def.name}`);
        if (seen.has(key) && seen.get(key) !== now) ++moved;
        kept.set(key, node.get(field));
        seen.set(key, now);
      });
    }
    assert.ok(replay.equal);
  }
  assert.ok(moved > 0, 'something moves in that log');
});

test('values of types from outside are read, and not sent', () => {
  for (const type of [42, 43]) assert.throws(() => editRecord([{node: 2, field: 0, type, value: [1]}]), TypeError);
});
