// The recorded sessions of the conformance set that every client has to follow: tests/sync/conformance.
import assert from 'node:assert/strict';
import {readFileSync, readdirSync} from 'node:fs';
import {test} from 'node:test';
import {Mirror, Reader} from '../src/index.js';

const HELLO = 1, SUBMIT = 9, CONTROL = 10, WELCOME = 16, UNKNOWN = 18, REFUSED = 19, VERDICT = 22;
const folder = new URL('../../../tests/sync/conformance/mirror/', import.meta.url);
const names = readdirSync(folder).filter((name) => name.endsWith('.session'));
assert.equal(names.length, 12);

const bytes = (hex) => Uint8Array.from(hex?.match(/../g) ?? [], (two) => parseInt(two, 16));
/** Numbers of a verdict's new nodes, which this client has no use for. */
function createdIn(first) {
  const r = new Reader(first.subarray(32)), created = [];
  r.text();
  for (let n = r.left ? r.varint() : 0; n > 0; --n) {
    r.varint();
    created.push(Number(r.varint()));
  }
  return created;
}

for (const name of names) {
  test(`${name} is followed as expected`, () => {
    const text = readFileSync(new URL(name.replace('.session', '.json'), folder), 'utf8');
    const expected = JSON.parse(text.replace(/"hellos":.*/, (line) => line.replace(/\d+/g, '"$&"')));
    const said = {states: [], hellos: [], verdicts: [], replies: [], refused: '', left: false};
    const mirror = new Mirror((first) => {
      const r = new Reader(first.slice(5));
      if (r.u8() !== HELLO) return;
      r.take(2 + 16);
      said.hellos.push([String(r.u64()), String(r.u64())]);
    }, {
      onState: (record, equal) => {
        assert.ok(equal, `state ${record.to}`);
        if (record.to !== said.states.at(-1)?.[0]) said.states.push([record.to, mirror.scene.hash.hex()]);
      },
      onVerdict: ({request, state, reason, kept}) => said.verdicts.push({request, state, refusal: reason, kept}),
      onReply: (reply) => said.replies.push(reply),
      onRefused: (reason) => (said.refused = reason),
      onBye: () => (said.left = true),
    });
    let hellos = 0;
    const created = [];
    for (const line of readFileSync(new URL(name, folder), 'utf8').trim().split('\n')) {
      const [who, one, two] = line.split(' ');
      const first = bytes(one), second = bytes(two), type = first[5];
      if (who === 'cut') mirror.cut();
      if (who === 'client' && type === HELLO && said.hellos.length < ++hellos) mirror.hello();
      if (who === 'client' && type === SUBMIT) mirror.submit(second);
      if (who === 'client' && type === CONTROL) mirror.control(new Reader(first.subarray(16)).text());
      if (who !== 'server') continue;
      if (type === VERDICT) created.push(createdIn(first));
      if (type >= WELCOME && type !== UNKNOWN && type !== REFUSED && first.length >= 16) {
        const view = new DataView(first.buffer);
        if (view.getBigUint64(8, true) >= 1000n) view.setBigUint64(8, mirror.session, true);
      }
      mirror.receive(first, second);
      assert.ok(said.hellos.length <= hellos + 1);
    }
    const {last, ...others} = expected;
    said.verdicts.forEach((verdict, i) => (verdict.created = created[i]));
    assert.deepEqual(said, others);
    const dump = mirror.scene.dump();
    assert.equal(dump.state, last.state);
    assert.equal(dump.hash, last.hash);
    assert.deepEqual(dump.routes, last.routes);
    assert.deepEqual(Object.keys(dump.nodes), Object.keys(last.nodes));
  });
}
