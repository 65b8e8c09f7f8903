// The conformance set that every reader of the format has to pass: tests/sync/conformance.
import assert from 'node:assert/strict';
import {readFileSync, readdirSync} from 'node:fs';
import {test} from 'node:test';
import {inflateRawSync} from 'node:zlib';
import {Replay, setCatalogue, setInflate} from '../src/index.js';

setInflate(inflateRawSync);
const ofProtocol = (name) => new Uint8Array(readFileSync(new URL(`../../${name}`, import.meta.url)));
setCatalogue(ofProtocol('catalogue.bin'), ofProtocol('words.bin'));

const folder = new URL('../../../tests/sync/conformance/', import.meta.url);
const logsIn = (place) => readdirSync(new URL(place, folder)).filter((name) => name.endsWith('.rlog')).map((name) => place + name);

/** Expected values are the shortest decimals of f32 or f64; what is no number is null. */
function sameValue(given, expected, path) {
  if (Array.isArray(expected) || ArrayBuffer.isView(given)) {
    const flat = expected.flat();
    assert.equal(given.length, flat.length, path);
    flat.forEach((x, i) => sameValue(given[i], x, `${path}[${i}]`));
  } else if (typeof expected === 'number') {
    assert.ok(given === expected || given === Math.fround(expected), `${path}: ${given}, expected ${expected}`);
  } else if (expected === null) {
    assert.ok(!Number.isFinite(given) || given === 0, `${path}: ${given}, expected null`);
  } else {
    assert.deepEqual(given, expected, path);
  }
}

assert.equal(logsIn('./').length, 18);
assert.equal(logsIn('./format2/').length, 10);
for (const name of [...logsIn('./'), ...logsIn('./format2/')]) {
  test(`${name} is read as expected`, () => {
    const expected = JSON.parse(readFileSync(new URL(name.replace('.rlog', '.json'), folder), 'utf8'));
    const replay = new Replay(new Uint8Array(readFileSync(new URL(name, folder))));
    const states = [];
    for (let record = replay.step(); record; record = replay.step()) {
      assert.equal(record.hash, replay.scene.hash.hex(), `state ${record.to}`);
      states.push([record.to, replay.scene.hash.hex()]);
    }
    assert.deepEqual(states, expected.states);
    assert.equal(replay.gaps, expected.gaps);
    assert.deepEqual(replay.damage, expected.damage);
    assert.equal(replay.closed, expected.closed);
    assert.equal(replay.unclosedSessions, expected.unclosed_sessions ?? 0);
    const dump = replay.scene.dump();
    assert.equal(dump.state, expected.last.state);
    assert.equal(dump.hash, expected.last.hash);
    assert.deepEqual(dump.routes, expected.last.routes);
    assert.deepEqual(Object.keys(dump.nodes), Object.keys(expected.last.nodes));
    for (const [id, node] of Object.entries(expected.last.nodes)) {
      const {fields, ...rest} = dump.nodes[id];
      const {fields: theirs, ...others} = node;
      assert.deepEqual(rest, others);
      assert.deepEqual(Object.keys(fields).sort(), Object.keys(theirs).sort(), `fields of ${id}`);
      for (const [field, value] of Object.entries(theirs)) sameValue(fields[field], value, `${id}.${field}`);
    }
  });
}
