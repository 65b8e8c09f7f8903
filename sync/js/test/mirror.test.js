// The client of a mirror, against a server that is simulated here: records of the conformance set in messages as in
// PROTOCOL.md.
import assert from 'node:assert/strict';
import {readFileSync} from 'node:fs';
import {test} from 'node:test';
import {Mirror, Reader, Writer, eventRecord, readHead, readRecord, records} from '../src/index.js';

const HELLO = 1, ACK = 2, PONG = 4, BYE = 5, SUBMIT = 9, CONTROL = 10;
const log = new Uint8Array(readFileSync(new URL('../../../tests/sync/conformance/raw.rlog', import.meta.url)));
const all = [...records(log)];
const bytesOf = (r) => log.subarray(r.offset, r.offset + r.size);
const head = all.find((r) => r.kind === 'head');
const EPOCH = readHead(head.payload).epoch;
const keyframe = all.find((r) => r.kind === 'keyframe' && r.to === 1);
const frames = [];
for (let state = keyframe.to, next; (next = all.find((r) => r.kind === 'frame' && r.from === state)); state = next.to) frames.push(next);
assert.ok(frames.length >= 3);

const message = (type) => new Writer().raw([0x52, 0x54, 0x53, 0x47, 1, type, 0, 0]);
const none = new Uint8Array(0);

class Server {
  constructor(options = {}) {
    this.said = [];
    this.states = [];
    this.mirror = new Mirror((first, second) => this.hear(first.slice(), second?.slice()),
      {...options, onState: (record, equal) => this.states.push([record.to, equal])});
    this.mirror.hello();
  }
  hear(first, second) {
    const r = new Reader(first);
    assert.deepEqual([...r.take(5)], [0x52, 0x54, 0x53, 0x47, 1]);
    const type = r.u8();
    r.u16();
    const m = {type, second};
    if (type === HELLO) {
      Object.assign(m, {session: r.u64(), dictionary: r.u64(), epoch: r.u64(), state: Number(r.u64()), window: Number(r.u64()), name: r.text(),
        client: r.u64(), slow: r.u8(), rate1000: r.u32(), aspects: r.u32(), parts: r.texts(), inputs: r.u8(), lag: r.u32(), rate: r.u64(),
        low: r.u64(), high: r.u64()});
      this.session = m.session;
    } else if (type === ACK) {
      Object.assign(m, {session: r.u64(), state: Number(r.u64()), bytes: Number(r.u64())});
    } else if (type === SUBMIT) {
      Object.assign(m, {session: r.u64(), request: Number(r.u64()), size: Number(r.u64()), offset: Number(r.u64())});
    } else if (type === CONTROL) {
      Object.assign(m, {session: r.u64(), text: r.text()});
    }
    assert.ok(type === BYE || type === PONG || r.left === 0 || type === 3);
    this.said.push(m);
  }
  last(type) { return this.said.findLast((m) => m.type === type); }
  welcome(epoch = EPOCH) {
    this.mirror.receive(message(16).u64(this.session).u64(epoch).u64(500).done(), bytesOf(head));
  }
  send(record, part = 1e9, session = this.session) {
    const bytes = record instanceof Uint8Array ? record : bytesOf(record);
    for (let at = 0; at < bytes.length; at += part)
      this.mirror.receive(message(17).u64(session).u64(bytes.length).u64(at).u64(0).done(), bytes.slice(at, at + part));
  }
}

test('follows, in parts as they come, and acknowledges', () => {
  const s = new Server({name: 'test', lag: 100, parts: ['A']});
  const hello = s.last(HELLO);
  assert.deepEqual([hello.dictionary, hello.epoch, hello.state, hello.name, hello.lag, hello.parts, hello.slow], [0n, 0n, 0, 'test', 100, ['A'], 0]);
  assert.equal(new Server({nearFirst: true}).last(HELLO).slow, 3);
  s.welcome();
  assert.equal(s.last(ACK).bytes, 0);
  s.send(keyframe, 100);
  for (const f of frames) s.send(f);
  assert.deepEqual(s.states.map(([state]) => state), [keyframe.to, ...frames.map((f) => f.to)]);
  assert.ok(s.states.every(([, equal]) => equal));
  const ack = s.last(ACK);
  assert.equal(ack.state, frames.at(-1).to);
  assert.equal(ack.bytes, keyframe.size + frames.reduce((sum, f) => sum + f.size, 0));
});

test('comes back with the state and hash that it has', () => {
  const s = new Server();
  s.welcome();
  s.send(keyframe);
  s.send(frames[0]);
  s.mirror.cut();
  s.mirror.hello();
  const hello = s.last(HELLO);
  assert.equal(hello.epoch, EPOCH);
  assert.equal(hello.state, frames[0].to);
  assert.equal(hello.high.toString(16).padStart(16, '0') + hello.low.toString(16).padStart(16, '0'), frames[0].hash);
  s.welcome();
  s.send(frames[1]);
  assert.deepEqual(s.states.at(-1), [frames[1].to, true]);
  assert.equal(s.mirror.count.resumed, 1);
  assert.equal(s.mirror.count.keyframes, 1);
  // In another run nothing from before counts.
  s.mirror.hello();
  s.welcome(EPOCH + 1n);
  s.send(frames[2]);
  assert.equal(s.last(HELLO).epoch, 0n);
  s.welcome(EPOCH + 1n);
  s.send(keyframe);
  assert.deepEqual(s.states.at(-1), [keyframe.to, true]);
});

test('gaps, damage, wrong parts and other sessions are noticed', () => {
  const s = new Server();
  s.welcome();
  s.send(keyframe);
  const hellos = () => s.said.filter((m) => m.type === HELLO).length;
  s.send(frames[0], 1e9, s.session - 1n);
  assert.equal(s.states.length, 1);
  s.send(frames[1]);
  assert.equal(hellos(), 2);
  assert.equal(s.last(HELLO).state, keyframe.to);
  s.welcome();
  const damaged = bytesOf(frames[0]).slice();
  damaged[70] ^= 1;
  s.send(damaged);
  assert.equal(hellos(), 3);
  s.welcome();
  s.mirror.receive(message(17).u64(s.session).u64(1000).u64(500).u64(0).done(), new Uint8Array(100));
  assert.equal(hellos(), 4);
  s.welcome();
  s.send(frames[0]);
  assert.deepEqual(s.states.at(-1), [frames[0].to, true]);
  const before = s.mirror.count.garbage;
  for (const bad of [none, new Uint8Array(3), message(17).u64(1).done(), message(16).done(), new Uint8Array(100)]) s.mirror.receive(bad, none);
  assert.ok(s.mirror.count.garbage >= before + 4);
  assert.equal(s.mirror.scene.state, frames[0].to);
});

test('a state with another hash is told and thrown away', () => {
  const s = new Server();
  s.welcome();
  s.send(keyframe);
  s.mirror.scene.hash.sum[0] += 1;  // as if a value had been changed behind its back
  s.send(frames[0]);
  assert.deepEqual(s.states.at(-1), [frames[0].to, false]);
  assert.equal(s.mirror.count.unequal, 1);
  assert.equal(s.last(HELLO).epoch, 0n);
  s.welcome();
  s.send(keyframe);
  assert.deepEqual(s.states.at(-1), [keyframe.to, true]);
});

test('events go upstream once, and again only without an answer', () => {
  const verdicts = [];
  const s = new Server({onVerdict: (v) => verdicts.push(v)});
  s.welcome();
  s.send(keyframe);
  const number = s.mirror.submitEvents([{node: 7, field: 3, type: 0, value: true}, {node: 5, field: 2, type: 24, value: [1, 2, 3]}]);
  const m = s.last(SUBMIT), r = readRecord(m.second);
  assert.deepEqual([m.request, m.offset, m.size], [number, 0, m.second.length]);
  assert.deepEqual([r.kind, r.from, r.to], ['frame', 1, 1]);
  const p = new Reader(r.payload);
  assert.deepEqual([p.u8(), p.varint()], [8, 2]);
  const b = p.part();
  assert.deepEqual([b.varint(), b.varint(), b.u8(), b.u8()], [2 * 14 + 1, 3, 0, 1]);
  assert.deepEqual([b.varint(), b.varint(), b.u8(), b.f32(), b.f32(), b.f32()], [2 * 3 + 1, 2, 24, 1, 2, 3]);
  s.mirror.tick(performance.now());
  assert.equal(s.said.filter((x) => x.type === SUBMIT).length, 1);
  s.mirror.tick(performance.now() + 1100);
  assert.equal(s.said.filter((x) => x.type === SUBMIT).length, 2);
  const verdict = message(22).u64(s.session).u64(number).u64(9).text('').varint(0).done();
  s.mirror.receive(verdict, none);
  s.mirror.receive(verdict, none);
  assert.deepEqual(verdicts, [{request: number, state: 9, reason: '', kept: ''}]);
  assert.throws(() => eventRecord([{node: 1, field: 1, type: 24, value: [1]}]), TypeError);
  s.mirror.submit(new Uint8Array(20000));
  assert.deepEqual(s.said.filter((x) => x.type === SUBMIT && x.size === 20000).map((x) => [x.offset, x.second.length]), [[0, 8192], [8192, 8192], [16384, 3616]]);
});

test('edits, undo, redo and locks are requests as the page has them', () => {
  const verdicts = [];
  const s = new Server({onVerdict: (v) => verdicts.push(v)});
  s.welcome();
  s.send(keyframe);
  const asked = () => readRecord(s.last(SUBMIT).second);
  s.mirror.submitEdits([{node: 300, field: 200, type: 24, value: [1, 2, 3]}, {node: 5, field: 2, type: 10, value: 'so'}]);
  assert.equal(asked().kind, 'frame');
  const p = new Reader(asked().payload);
  assert.deepEqual([p.u8(), p.varint()], [4, 1]);
  const first = p.part();
  assert.deepEqual([first.u8(), first.u8(), first.u8(), first.varint(), first.varint()], [0, 1, 24, 200, 600]);
  assert.deepEqual([first.f32(), first.f32(), first.f32(), first.left], [1, 2, 3, 0]);
  assert.deepEqual([p.u8(), p.varint()], [4, 1]);
  const second = p.part();
  assert.deepEqual([second.u8(), second.u8(), second.u8(), second.varint(), second.varint(), second.text(), second.left, p.left], [0, 1, 10, 2, 10, 'so', 0, 0]);
  assert.throws(() => s.mirror.submitEdits([{node: 1, field: 0, type: 13, value: [2]}]), TypeError);
  for (const [ask, bytes] of [[() => s.mirror.undo(), [1]], [() => s.mirror.redo(), [2]], [() => s.mirror.lock([7, 300, 5], 500), [3, 0xF4, 3, 3, 14, 0xCA, 4, 0xCD, 4]]]) {
    const number = ask(), r = asked();
    assert.deepEqual([r.kind, r.from, r.to, [...r.payload], s.last(SUBMIT).request], ['request', 1, 1, bytes, number]);
  }
  const number = s.mirror.undo();
  s.mirror.receive(message(22).u64(s.session).u64(number).u64(12).text('').varint(1).varint(2 ** 31).varint(8).text('DOOR.rotation is another\'s').done(), none);
  assert.deepEqual(verdicts, [{request: number, state: 12, reason: '', kept: 'DOOR.rotation is another\'s'}]);
});

test('says goodbye back, answers pings, and asks again after a silence that is not its own', () => {
  const byes = [], origins = [];
  const s = new Server({onBye: (state) => byes.push(state), onOrigin: (lost) => origins.push(lost)});
  s.welcome();
  for (const lost of [0, 1, 1, 0, 1]) s.mirror.receive(message(3).u64(77).u64(5).u64(lost).done(), none);
  assert.equal(s.said.at(-1).type, PONG);
  assert.equal(s.mirror.originLost, true);
  assert.deepEqual(origins, [true, false, true]);
  const now = performance.now();
  for (let t = 0; t < 2400; t += 100) assert.equal(s.mirror.tick(now + t), true, `${t}`);
  assert.equal(s.mirror.tick(now + 60_000), true, 'asleep for a minute: others may have spoken');
  for (let t = 100; t < 2400; t += 100) s.mirror.tick(now + 60_000 + t);
  assert.equal(s.mirror.tick(now + 62_600), false);
  s.mirror.hello();
  s.welcome();
  s.mirror.receive(message(5).u64(12).done(), none);
  assert.equal(s.said.at(-1).type, BYE);
  assert.deepEqual(byes, [12]);
  s.mirror.control('seek 3');
  assert.equal(s.last(CONTROL).text, 'seek 3');
});
