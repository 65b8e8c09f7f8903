// What the page plays of a scene: where sounds are, how loud they are, and which part of a clip is heard when. A
// context that takes notes stands in for the browser; tests/web/page_test.mjs listens to a real one.
import assert from 'node:assert/strict';
import {test} from 'node:test';
import {Places, pointBefore, pointThrough, times, transformOf} from '../page/places.js';
import {SceneSound, loudness} from '../page/sound.js';

const SFNODE = 12, MFNODE = 13, kHidden = new Set(['body']);
const kReferring = {source: SFNODE, children: MFNODE, layers: MFNODE, body: MFNODE, periodicWave: SFNODE, proxy: SFNODE};
let lastId = 1;
function make(type, values = {}, kind = 'built in') {
  const fields = Object.keys(values).map((name) => ({name, type: kReferring[name] ?? 0, hidden: kHidden.has(name), default: undefined}));
  const ids = (value) => Array.isArray(value) ? value.map((n) => n.id) : value.id;
  return {id: ++lastId, type: {name: type, kind, fields}, values: Object.entries(values).map(([name, value]) => name in kReferring ? ids(value) : value),
    made: Object.entries(values).filter(([name]) => name in kReferring).flatMap(([, value]) => value)};
}
function sceneOf(...children) {
  const root = make('RtsgScene', {children}), nodes = new Map();
  const add = (node) => { nodes.set(node.id, node); node.made.forEach(add); };
  add(root);
  return {root, nodes, state: 1};
}
const set = (node, name, value) => { node.values[node.type.fields.findIndex((f) => f.name === name)] = value; };
const close = (a, b, tolerance = 1e-12) => assert.ok(a.length === b.length && a.every((x, i) => Math.abs(x - b[i]) <= tolerance), `${a} is not ${b}`);
const still = {translation: [0, 0, 0], rotation: [0, 0, 1, 0], scale: [1, 1, 1], center: [0, 0, 0], scaleOrientation: [0, 0, 1, 0]};

test('a Transform moves points as its clause says', () => {
  const m = transformOf(make('Transform', {...still, translation: [0, 1, 0], rotation: [0, 2, 0, Math.PI / 2], scale: [2, 3, 4], center: [1, 0, 0]}));
  close(pointThrough(m, [2, 1, 0]), [1, 4, -2]);
  close(pointBefore(m, [1, 4, -2]), [2, 1, 0]);
  // The space is stretched along the diagonal of x and y. The distance across it stays the same.
  const slanted = transformOf(make('Transform', {...still, scale: [3, 1, 1], scaleOrientation: [0, 0, 1, Math.PI / 4]}));
  close(pointThrough(slanted, [1, 1, 0]), [3, 3, 0]);
  close(pointThrough(slanted, [-1, 1, 5]), [-1, 1, 5]);
  const away = transformOf(make('Transform', {...still, translation: [5, 0, 0]}));
  close(pointThrough(times(away, m), [2, 1, 0]), [6, 4, -2]);
  assert.equal(pointBefore(transformOf(make('Transform', {...still, scale: [1, 0, 1]})), [1, 0, 0]), null);
  assert.equal(transformOf(make('Group', {children: []})), null);
});

test('each way to a node is a place; what is not chosen has none', () => {
  const sound = make('Sound'), other = make('Sound'), never = make('Sound');
  const left = make('Transform', {...still, translation: [-2, 0, 0], children: [sound]});
  const right = make('Transform', {...still, translation: [2, 0, 0], children: [make('Lamp', {body: [make('Group', {children: [sound]}), never]}, 'PROTO')]});
  const choice = make('Switch', {whichChoice: 1, children: [never, other]});
  const scene = sceneOf(left, right, choice, make('Collision', {children: [], proxy: never}), make('LOD', {children: [make('Group'), never]}),
    make('Inline', {body: [other]}), make('Group', {visible: false, children: [never]}));
  const places = new Places(scene, ['Sound']);
  places.find();
  assert.deepEqual(places.ways.map((w) => w.node), [sound, sound, other, other]);
  assert.equal(new Set(places.ways.map((w) => w.key)).size, 4);
  close(pointThrough(places.worldFromLocal(places.ways[0]), [0, 0, 0]), [-2, 0, 0]);
  close(pointThrough(places.worldFromLocal(places.ways[1]), [0, 0, 0]), [2, 0, 0]);
  assert.equal(places.isStale, false);
  places.change([left, 0]);
  assert.equal(places.isStale, false);
  places.change([left, 0, choice, 0]);
  assert.equal(places.isStale, true);
  set(choice, 'whichChoice', -1);
  places.find();
  assert.equal(places.ways.length, 3);
  // A scene that contains itself ends.
  set(left, 'children', [left.id, sound.id]);
  places.find();
  assert.ok(places.ways.length > 3 && places.ways.length < 100);
});

test('loudness falls as X3D says', () => {
  const sound = make('Sound', {location: [1, 0, 0], direction: [0, 0, 1], minFront: 2, minBack: 2, maxFront: 12, maxBack: 12});
  assert.equal(loudness(sound, [1, 0, 2]), 1);
  assert.ok(Math.abs(loudness(sound, [1, 7, 0]) - 10 ** -0.5) < 1e-12);  // half way: 10 dB
  assert.equal(loudness(sound, [1, 0, -12]), 0);
  // The range is longer in front than behind.
  const ahead = make('Sound', {minFront: 10, minBack: 1, maxFront: 20, maxBack: 2});
  assert.equal(loudness(ahead, [0, 0, 9.9]), 1);
  assert.equal(loudness(ahead, [0, 0, -0.99]), 1);
  assert.ok(loudness(ahead, [0, 0, -1.1]) < 1);
  assert.equal(loudness(ahead, [20 / 11 - 0.01, 0, 0]), 1);
  assert.ok(loudness(ahead, [20 / 11 + 0.01, 0, 0]) < 1);
  assert.equal(loudness(ahead, [0, 0, -2]), 0);
  const at = (values, ear) => loudness(make('SpatialSound', values), ear);
  assert.equal(at({}, [0, 0, 4]), 1 / 4);
  assert.equal(at({distanceModel: 'LINEAR', maxDistance: 11}, [6, 0, 0]), 0.5);
  assert.equal(at({distanceModel: 'EXPONENTIAL', rolloffFactor: 2}, [0, 3, 0]), 1 / 9);
  const cone = {coneInnerAngle: Math.PI / 2, coneOuterAngle: Math.PI, coneOuterGain: 0.2};
  assert.ok(Math.abs(at(cone, [0.5, 0, 0.8]) - 1) < 1e-12);
  assert.ok(Math.abs(at(cone, [0.5, 0, -0.5]) - 0.2) < 1e-12);
  assert.ok(Math.abs(at(cone, [Math.sin(3 * Math.PI / 8), 0, Math.cos(3 * Math.PI / 8)]) - 0.6) < 1e-12);
});

// ---- what is played ------------------------------------------------------------------------------------------------------

class FakeContext {
  constructor() { Object.assign(this, {currentTime: 0, made: [], destination: {}}); }
  node(kind, more = {}) {
    const param = () => ({value: 1, setTargetAtTime(value) { this.value = value; }});
    const made = {kind, to: [], connect(next) { this.to.push(next); return next; }, disconnect() { this.isGone = true; },
      gain: param(), frequency: param(), playbackRate: param(), positionX: param(), positionY: param(), positionZ: param(),
      start: (when, offset) => { made.startedAt = this.currentTime; made.offset = offset; }, stop: (when) => { made.stoppedAt = when; }, ...more};
    this.made.push(made);
    return made;
  }
  createGain() { return this.node('gain'); }
  createPanner() { return this.node('panner'); }
  createOscillator() { return this.node('tone'); }
  createBufferSource() { return this.node('clip'); }
  async decodeAudioData(bytes) {
    if (!bytes.byteLength) throw new Error('nothing there');
    return {duration: 2, length: 2 * bytes.byteLength, numberOfChannels: 1};
  }
  resume() {}
  close() { this.isClosed = true; }
  playing() { return this.made.filter((n) => (n.kind === 'clip' || n.kind === 'tone') && n.startedAt !== undefined && n.stoppedAt === undefined); }
}
const kEar = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
const clipAt = (more = {}) => make('AudioClip', {url: ['a.wav'], load: true, enabled: true, isActive: false, isPaused: false, elapsedTime: 0, pitch: 1, loop: false, gain: 1, ...more});

/** A scene that goes on, and who listens to it. */
class Listener {
  constructor(...children) {
    this.bytes = children[0].bytes ?? {1: 10};
    this.scene = sceneOf(...children);
    this.context = new FakeContext();
    this.asked = [];
    this.ear = kEar;
    this.sound = new SceneSound(this.scene, {soundUrl: (id, index) => `/sound/${id}/${index}`, ear: () => this.ear, load: async (url) => {
      this.asked.push(url);
      const bytes = this.bytes[Number(url.split('/').at(-1)) + 1];
      return {ok: bytes !== undefined, text: async () => 'There is no such file.', arrayBuffer: async () => new ArrayBuffer(bytes)};
    }});
    this.now = 0;
    this.sound.update(this.now);
    this.sound.start(this.context);
  }
  /** A state comes after so many seconds. */
  step(seconds = 1 / 60) {
    this.now += seconds;
    this.context.currentTime += seconds;
    ++this.scene.state;
    this.sound.update(this.now);
  }
  async come() { await new Promise((done) => setTimeout(done, 0)); }
  get playing() { return this.context.playing(); }
}

test('a clip starts and stops with its isActive, and who comes late is in the middle', async () => {
  const clip = clipAt(), l = new Listener(make('Sound', {source: clip}));
  await l.come();
  assert.deepEqual(l.asked, [`/sound/${clip.id}/0`]);
  l.step();
  assert.equal(l.playing.length, 0);
  set(clip, 'isActive', true);
  l.step();
  assert.equal(l.playing.length, 1);
  assert.equal(l.playing[0].offset, 0);
  for (let i = 1; i <= 30; ++i) {
    set(clip, 'elapsedTime', i / 60);
    l.step();
  }
  assert.equal(l.context.made.filter((n) => n.kind === 'clip').length, 1);
  set(clip, 'isPaused', true);
  l.step();
  assert.equal(l.playing.length, 0);
  set(clip, 'isPaused', false);
  l.step();
  assert.equal(l.playing[0].offset, 0.5);
  set(clip, 'isActive', false);
  l.step();
  assert.equal(l.playing.length, 0);

  // Twice as fast, in a loop: 3.25 s play 6.5 s of a clip of 2 s.
  const late = clipAt({isActive: true, elapsedTime: 3.25, pitch: 2, loop: true}), other = new Listener(make('SpatialSound', {children: [late]}));
  await other.come();
  other.step();
  assert.equal(other.playing[0].offset, 0.5);
  assert.equal(other.playing[0].playbackRate.value, 2);
  assert.equal(other.playing[0].loop, true);
  // After the end of a clip nothing is heard.
  const over = new Listener(make('Sound', {source: clipAt({isActive: true, elapsedTime: 2.5})}));
  await over.come();
  over.step();
  assert.equal(over.playing.length, 0);
});

test('a clip that is elsewhere than the origin\'s begins there; one whose pitch changes goes on', async () => {
  const clip = clipAt({isActive: true, loop: true}), l = new Listener(make('Sound', {source: clip}));
  await l.come();
  l.step();
  let elapsed = 0;
  const go = (seconds) => set(clip, 'elapsedTime', elapsed += seconds);
  for (let i = 0; i < 20; ++i) { go(0.1); l.step(0.1); }
  set(clip, 'pitch', 0.5);
  for (let i = 0; i < 20; ++i) { go(0.1); l.step(0.1); }
  assert.equal(l.context.made.filter((n) => n.kind === 'clip').length, 1);
  assert.equal(l.playing[0].playbackRate.value, 0.5);
  go(1);
  l.step();
  assert.equal(l.context.made.filter((n) => n.kind === 'clip').length, 2);
  assert.ok(Math.abs(l.playing[0].offset - elapsed * 0.5 % 2) < 1e-9);
  // A clip that begins again at the origin does so here, however short it was.
  elapsed -= 0.1;
  go(0);
  l.step();
  assert.equal(l.context.made.filter((n) => n.kind === 'clip').length, 3);
  // A log is played at twice the pace.
  l.sound.pace = 2;
  for (let i = 0; i < 20; ++i) { go(0.2); l.step(0.1); }
  assert.equal(l.context.made.filter((n) => n.kind === 'clip').length, 3);
  assert.equal(l.playing[0].playbackRate.value, 1);
});

test('a scene that stands still is silent, and so is a page that sees nothing', async () => {
  const clip = clipAt({isActive: true, loop: true}), l = new Listener(make('Sound', {source: clip}));
  await l.come();
  l.step();
  for (let i = 0; i < 15; ++i) {
    l.context.currentTime += 0.05;
    l.sound.update();
  }
  assert.equal(l.playing.length, 1);
  l.context.currentTime += 0.5;
  l.sound.update();
  assert.equal(l.playing.length, 0);
  set(clip, 'elapsedTime', 0.25);
  l.step();
  assert.equal(l.playing[0].offset, 0.25);
  l.ear = null;
  l.step();
  assert.equal(l.playing.length, 0);
});

test('what is heard is where it stands and as loud as all on the way says', async () => {
  const clip = clipAt({isActive: true, loop: true, gain: 0.5});
  const sound = make('Sound', {source: clip, location: [0, 0, 0], intensity: 0.5, minFront: 10, minBack: 10, maxFront: 20, maxBack: 20, spatialize: true, enabled: true});
  const l = new Listener(make('Transform', {...still, translation: [3, 1, -4], children: [sound]}));
  await l.come();
  l.step();
  const panner = () => l.context.made.findLast((n) => n.kind === 'panner');
  assert.equal(panner().panningModel, 'HRTF');
  assert.equal(panner().rolloffFactor, 0);
  close([panner().positionX.value, panner().positionY.value, panner().positionZ.value], [3, 1, -4]);
  assert.equal(l.playing[0].to[0].gain.value, 0.25);
  // After a quarter turn to the left it is behind to the right. Rows are right, up, back and position.
  l.ear = [0, 0, -1, 0, 0, 1, 0, 0, 1, 0, 0, 0, 1, 1, -2, 1];
  l.step();
  close([panner().positionX.value, panner().positionY.value, panner().positionZ.value], [2, 0, 2]);
  // At twice the inner radius, which is the outer one, nothing is heard.
  l.ear = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 3, 1, 16, 1];
  l.step();
  assert.equal(l.playing.length, 0);
  l.ear = kEar;
  set(sound, 'spatialize', false);
  l.step();
  assert.equal(l.playing.length, 1);
  assert.equal(l.playing[0].to[0].to[0].kind, 'gain');
  set(sound, 'enabled', false);
  l.step();
  assert.equal(l.playing.length, 0);
});

test('gains multiply along the audio graph, and the first url that can be read is played', async () => {
  const clip = clipAt({url: ['x', 'y', 'z'], isActive: true, loop: true, gain: 0.5});
  const graph = make('Gain', {gain: 0.5, children: [make('BiquadFilter', {type: 'LOWSHELF', gain: 12, children: [clip]}), make('Gain', {enabled: false, gain: 1, children: [clip]})]});
  const l = new Listener(Object.assign(make('AudioDestination', {gain: 0.8, children: [graph]}), {bytes: {2: 0, 3: 10}}));
  await l.come();
  l.step();
  assert.deepEqual(l.asked, [0, 1, 2].map((i) => `/sound/${clip.id}/${i}`));
  assert.equal(l.playing.length, 1);
  assert.ok(Math.abs(l.playing[0].to[0].gain.value - 0.2) < 1e-12);
  assert.equal(l.context.made.some((n) => n.kind === 'panner'), false);
  // Another url is another clip.
  set(clip, 'url', ['other', 'more', 'last']);
  l.step();
  assert.equal(l.playing.length, 0);
  await l.come();
  l.step();
  assert.equal(l.playing.length, 1);
  assert.equal(l.sound.samples, 20);
});

test('of more than can be played the nearest are, and those of higher priority before them', async () => {
  const tones = Array.from({length: 40}, (_, i) => make('OscillatorSource', {enabled: true, isActive: true, isPaused: false, elapsedTime: 1, frequency: 100 + i, gain: 1}));
  const sounds = tones.map((tone, i) => make('SpatialSound', {children: [tone], location: [1 + i, 0, 0], priority: i === 39 ? 1 : 0}));
  const l = new Listener(...sounds);
  l.step();
  const heard = l.playing.map((n) => n.frequency.value).sort((a, b) => a - b);
  assert.deepEqual(heard, [...Array.from({length: 31}, (_, i) => 100 + i), 139]);
  await l.sound.stop();
  assert.equal(l.playing.length, 0);
  assert.equal(l.context.isClosed, true);
  l.step();
});

test('no clip is fetched before anybody listens, nor more than there is room for', async () => {
  const clips = [clipAt(), clipAt()];
  const scene = sceneOf(...clips.map((source) => make('Sound', {source}))), asked = [], found = [];
  const sound = new SceneSound(scene, {soundUrl: (id) => `${id}`, ear: () => kEar, onFound: (any) => found.push(any),
    load: async (url) => { asked.push(url); return {ok: true, arrayBuffer: async () => ({byteLength: 2 ** 24 + 1})}; }});
  sound.update(1);
  assert.deepEqual([asked, found], [[], [true]]);
  sound.start(new FakeContext());
  await new Promise((done) => setTimeout(done, 0));
  assert.deepEqual(asked, clips.map((c) => `${c.id}`));
  assert.deepEqual([...sound.clips.values()].map((c) => c.buffer !== null), [true, false]);
  sound.restart(7n);
  assert.equal(sound.samples, 0);
  sound.update(2);
  await new Promise((done) => setTimeout(done, 0));
  assert.equal(asked.length, 4);
  sound.restart(7n);
  sound.update(3);
  assert.equal(asked.length, 4);
});
