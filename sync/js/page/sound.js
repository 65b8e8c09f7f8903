// Plays the replica's sounds with the browser's Web Audio: clips and tones that are active at the origin, at their
// positions, as loud as X3D says at the ear of the page's viewer. Only direct sound: no walls and no delay.
//
// The origin decides when something sounds: isActive, isPaused and elapsedTime arrive like all fields. So a late page
// starts in the middle of a clip, and a scene that rests is silent. Source: ISO/IEC 19775-1 V4.0, 16.4.

import {Places, childrenOf, fieldOr, pointBefore, pointThrough, standIn} from './places.js';

const kMostPlaying = 32, kMostPaths = 1000, kMostDeep = 32;
const kMostSamples = 2 ** 26;  // of all clips, decoded: 256 MiB
const kSmooth = 0.015;  // s, for changes of loudness
const kFar = 0.25;  // s by which a clip may differ from the origin's clock, which advances in steps
const kSilence = 1;  // s without a state after which the scene counts as resting
const kFindAgain = 0.1;        // s

/** Loudness in X3D: full within one ellipsoid, none beyond another, 20 dB between them (16.4.17); or a law of distance
 * and a cone (16.4.18). `ear` is in the sound's own space. */
export function loudness(node, ear) {
  const at = fieldOr(node, 'location', [0, 0, 0]), axis = fieldOr(node, 'direction', [0, 0, 1]);
  const to = ear.map((x, i) => x - at[i]), distance = Math.hypot(...to), length = Math.hypot(...axis);
  const cosine = distance > 0 && length > 0 ? to.reduce((sum, x, i) => sum + x * axis[i], 0) / (distance * length) : 1;
  const number = (name, otherwise) => Math.max(0, fieldOr(node, name, otherwise));
  if (node.type.name === 'Sound') {
    const radius = (front, back) => {
      const sum = front + back - (front - back) * cosine;
      return sum > 0 ? 2 * front * back / sum : Math.max(front, back);
    };
    const inner = radius(number('minFront', 1), number('minBack', 1));
    const outer = Math.max(inner, radius(number('maxFront', 10), number('maxBack', 10)));
    return distance <= inner ? 1 : distance >= outer ? 0 : 10 ** (-(distance - inner) / (outer - inner));
  }
  const reference = Math.max(1e-6, fieldOr(node, 'referenceDistance', 1)), most = Math.max(reference, fieldOr(node, 'maxDistance', 1e4));
  const rolloff = number('rolloffFactor', 1), model = fieldOr(node, 'distanceModel', 'INVERSE'), beyond = Math.max(distance, reference);
  let level = reference / (reference + rolloff * (beyond - reference));
  if (model === 'LINEAR') level = most > reference ? Math.max(0, 1 - Math.min(1, rolloff) * (Math.min(beyond, most) - reference) / (most - reference)) : 1;
  if (model === 'EXPONENTIAL') level = (beyond / reference) ** -rolloff;
  const inside = fieldOr(node, 'coneInnerAngle', 6.2832), outside = fieldOr(node, 'coneOuterAngle', 6.2832);
  if ((inside >= 6.2831 && outside >= 6.2831) || !(length > 0) || !(distance > 0)) return level;
  const angle = Math.acos(Math.min(1, Math.max(-1, cosine))), inner = inside / 2, outer = Math.max(inner, outside / 2);
  const atTheSide = fieldOr(node, 'coneOuterGain', 0);
  return level * (angle <= inner ? 1 : angle >= outer ? atTheSide : 1 + (atTheSide - 1) * (angle - inner) / (outer - inner));
}

const detuned = (node) => 2 ** (fieldOr(node, 'detune', 0) / 1200);
/** The speed of a clip. */
const speedOf = (node) => Math.min(1e3, Math.max(1e-3,
  node.type.name === 'AudioClip' ? fieldOr(node, 'pitch', 1) : fieldOr(node, 'playbackRate', 1) * detuned(node)));
const isClip = (node) => node.type.name === 'AudioClip' || node.type.name === 'BufferAudioSource';
const isTone = (node) => node.type.name === 'OscillatorSource';
const kWaves = {SINE: 'sine', SQUARE: 'square', SAWTOOTH: 'sawtooth', TRIANGLE: 'triangle'};

export class SceneSound {
  /** `soundUrl(id, index)` is the address of a source's url. `ear()` is the viewer's pose as rows right, up, back and
   * position of four numbers each; null while unknown. `onFound(any)` tells whether the scene has sounds. */
  constructor(scene, {soundUrl, ear, onFound = () => {}, load = fetch.bind(globalThis)}) {
    Object.assign(this, {scene, soundUrl, ear, onFound, load});
    this.places = new Places(scene, ['Sound', 'SpatialSound', 'AudioDestination']);
    this.context = null;
    this.output = null;  // everything heard goes through it
    this.emitters = new Map();  // by place: {gain, panner, voices by path}
    this.clips = new Map();  // by node and urls: {buffer}; null while it loads
    this.samples = 0;
    this.pace = 1;  // of a log that is played
    this.seen = -1;
    this.foundAt = -Infinity;
  }
  get isOn() { return this.context !== null; }

  /** Browsers need a user's gesture first. */
  start(context = new AudioContext()) {
    this.context = context;
    this.output = context.createGain();
    this.output.connect(context.destination);
    this.seen = -1;
    this.update();
    return context.resume();
  }
  stop() {
    for (const key of this.emitters.keys()) this.drop(key);
    const {context} = this;
    this.context = null;
    return context?.close();
  }

  /** `changed` is the argument of a Scene's listener. */
  change(changed) { this.places.change(changed); }
  /** Call it when the scene begins anew. In another run of the server its numbers mean other nodes. */
  restart(epoch) {
    this.places.isStale = true;
    if (epoch === this.epoch) return;
    this.epoch = epoch;
    this.clips.clear();
    this.samples = 0;
  }

  /** Call it after each state, and a few times a second. */
  update(now = performance.now() / 1000) {
    if (this.places.isStale && now - this.foundAt > kFindAgain) {
      this.foundAt = now;
      this.places.find();
      this.onFound(this.places.ways.length > 0);
    }
    if (!this.context) return;
    const heard = this.context.currentTime, ear = this.ear();
    this.isNew = this.scene.state !== this.seen;
    if (this.isNew) {
      this.seen = this.scene.state;
      this.seenAt = heard;
    }
    const found = heard - this.seenAt < kSilence && ear ? this.listen(ear) : [];
    found.sort((a, b) => b.priority - a.priority || b.level - a.level);
    const wanted = new Map();
    for (const emitter of found) {
      const room = kMostPlaying - [...wanted.values()].reduce((sum, e) => sum + e.sources.size, 0);
      while (emitter.sources.size > room) emitter.sources.delete([...emitter.sources.keys()].at(-1));
      if (emitter.sources.size) wanted.set(emitter.key, emitter);
    }
    for (const key of [...this.emitters.keys()]) if (!wanted.has(key)) this.drop(key);
    for (const emitter of wanted.values()) this.play(emitter, heard);
  }

  // ---- from the scene
  // ----------------------------------------------------------------------------------------------------

  /** Finds what sounds now and is loud enough to be heard: [{key, node, level, at, priority, sources}]. */
  listen(ear) {
    const result = [];
    for (const place of this.places.ways) {
      const {node, key} = place;
      if (!fieldOr(node, 'enabled', true)) continue;
      const sources = this.sourcesOf(node);
      for (const {source} of sources.values()) if (isClip(source)) this.clipOf(source);
      for (const [path, {source, gain}] of sources) if (gain === 0 || !this.isHeard(source)) sources.delete(path);
      if (!sources.size) continue;
      const world = this.places.worldFromLocal(place), stands = pointThrough(world, fieldOr(node, 'location', [0, 0, 0]));
      const own = pointBefore(world, ear.slice(12, 15)) ?? fieldOr(node, 'location', [0, 0, 0]);
      const isDirect = node.type.name === 'AudioDestination';
      const level = (isDirect ? 1 : loudness(node, own) * fieldOr(node, 'intensity', 1)) * fieldOr(node, 'gain', 1);
      if (!(Math.abs(level) > 1e-4) || !stands.every(Number.isFinite)) continue;
      // In the ear's frame: right, up, back.
      const at = [0, 4, 8].map((row) => {
        const length = Math.hypot(ear[row], ear[row + 1], ear[row + 2]);
        return [0, 1, 2].reduce((sum, i) => sum + (stands[i] - ear[12 + i]) * ear[row + i], 0) / (length || 1);
      });
      const isPlaced = !isDirect && fieldOr(node, 'spatialize', true);
      result.push({key: `${key}${isPlaced ? '' : ' everywhere'}`, node, level, at: isPlaced ? at : null, priority: fieldOr(node, 'priority', 0), sources});
    }
    return result;
  }
  /** Finds the sources that lead to a sound, by path, and their gain. */
  sourcesOf(sound) {
    const sources = new Map();
    let visits = 0;
    const down = (id, gain, path) => {
      const node = standIn(this.scene, id);
      if (!node || path.length > 8 * kMostDeep || ++visits > kMostPaths || !fieldOr(node, 'enabled', true)) return;
      // The gain of shelf and peaking filters is a parameter of the filter, in decibels.
      const own = node.type.name === 'BiquadFilter' && /SHELF|PEAKING/.test(fieldOr(node, 'type', '')) ? 1 : fieldOr(node, 'gain', 1);
      if (isClip(node) || isTone(node)) sources.set(path, {source: node, gain: gain * own});
      else for (const child of childrenOf(node, 'children')) down(child, gain * own, `${path}/${child}`);
    };
    for (const id of childrenOf(sound, sound.type.name === 'Sound' ? 'source' : 'children')) down(id, 1, `${id}`);
    return sources;
  }
  isHeard(source) {
    if (!fieldOr(source, 'isActive', false) || fieldOr(source, 'isPaused', false)) return false;
    if (isTone(source)) return true;
    const clip = this.clipOf(source)?.buffer;
    return Boolean(clip) && (fieldOr(source, 'loop', false) || fieldOr(source, 'elapsedTime', 0) * speedOf(source) < clip.duration);
  }

  // ---- clips -------------------------------------------------------------------------------------------------------------

  clipOf(source) {
    const urls = fieldOr(source, 'url', []);
    if (!urls.length || !fieldOr(source, 'load', true)) return null;
    const key = `${source.id} ${urls.join(' ')}`;
    if (!this.clips.has(key)) {
      for (const [other, {buffer}] of this.clips)
        if (other.startsWith(`${source.id} `)) {
          this.samples -= buffer ? buffer.length * buffer.numberOfChannels : 0;
          this.clips.delete(other);
        }
      const clip = {buffer: null};
      this.clips.set(key, clip);
      this.fetchClip(source.id, urls, clip).catch((error) => console.warn(`${source.name || source.type.name}: ${error.message}`));
    }
    return this.clips.get(key);
  }
  async fetchClip(id, urls, clip) {
    let why = 'no url';
    for (const [index, url] of urls.entries()) {
      const answer = await this.load(url.startsWith('data:') ? url : this.soundUrl(id, index));
      why = answer.ok ? 'this browser cannot read it' : (await answer.text()).trim();
      const buffer = answer.ok ? await this.context?.decodeAudioData(await answer.arrayBuffer()).catch(() => null) : null;
      if (!buffer) continue;
      const size = buffer.length * buffer.numberOfChannels;
      if (this.samples + size > kMostSamples) throw new Error('its clips take more memory than a page has for them');
      this.samples += size;
      clip.buffer = buffer;
      return;
    }
    throw new Error(`silent: ${why}`);
  }

  // ---- playing
  // -----------------------------------------------------------------------------------------------------------

  play({key, level, at, sources}, heard) {
    if (!this.emitters.has(key)) this.emitters.set(key, this.makeEmitter(at !== null));
    const {panner, voices} = this.emitters.get(key);
    if (at) [panner.positionX.value, panner.positionY.value, panner.positionZ.value] = at;
    for (const path of [...voices.keys()]) if (!sources.has(path)) this.silence(voices, path);
    for (const [path, {source, gain}] of sources) this.voice(voices, path, panner, source, level * gain, heard);
  }
  /** Pans by HRTF; the scene decides the loudness. */
  makeEmitter(isPlaced) {
    const panner = isPlaced ? placedBy(this.context) : this.context.createGain();
    panner.connect(this.output);
    return {panner, voices: new Map()};
  }
  voice(voices, path, panner, source, gain, heard) {
    const elapsed = fieldOr(source, 'elapsedTime', 0), speed = (isClip(source) ? speedOf(source) : 1) * this.pace;
    let voice = voices.get(path);
    if (voice && !this.isInStep(voice, source, elapsed, heard)) {
      this.silence(voices, path);
      voice = null;
    }
    if (!voice) {
      voice = this.begin(source, elapsed, heard);
      voice.gain = this.context.createGain();
      voice.gain.gain.value = 0;
      voice.player.connect(voice.gain).connect(panner);
      voices.set(path, voice);
    }
    if (voice.speed !== speed) {
      voice.position += (heard - voice.since) * voice.speed;
      Object.assign(voice, {since: heard, speed});
      if (isClip(source)) voice.player.playbackRate.value = speed;
    }
    if (isTone(source)) voice.player.frequency.value = fieldOr(source, 'frequency', 440) * detuned(source);
    else voice.player.loop = fieldOr(source, 'loop', false);
    if (voice.level !== gain) voice.gain.gain.setTargetAtTime(gain, heard, kSmooth);
    voice.level = gain;
  }
  begin(source, elapsed, heard) {
    const voice = {since: heard, speed: this.pace, elapsed, position: elapsed, expected: elapsed};
    if (isTone(source)) {
      voice.player = this.context.createOscillator();
      const wave = standIn(this.scene, childrenOf(source, 'periodicWave')[0]);
      voice.player.type = wave ? kWaves[fieldOr(wave, 'type', 'SQUARE')] ?? 'sine' : 'sine';
      voice.player.start();
      return voice;
    }
    const clip = this.clipOf(source), speed = speedOf(source);
    voice.clip = clip;
    voice.player = this.context.createBufferSource();
    voice.player.buffer = clip.buffer;
    voice.player.loop = fieldOr(source, 'loop', false);
    voice.position = voice.expected = elapsed * speed;
    voice.speed = speed * this.pace;
    voice.player.playbackRate.value = voice.speed;
    voice.player.start(0, voice.player.loop ? voice.position % clip.buffer.duration : voice.position);
    return voice;
  }
  /** Returns whether the clip is where the origin's is; asked when there is news from the origin. */
  isInStep(voice, source, elapsed, heard) {
    if (isTone(source)) return true;
    if (voice.clip !== this.clipOf(source)) return false;
    if (!this.isNew) return true;
    const step = elapsed - voice.elapsed, speed = speedOf(source);
    voice.elapsed = elapsed;
    voice.expected += step * speed;
    const played = voice.position + (heard - voice.since) * voice.speed;
    return step >= 0 && Math.abs(played - voice.expected) <= kFar * Math.max(voice.speed, speed);
  }
  silence(voices, path) {
    const {player, gain} = voices.get(path), now = this.context.currentTime;
    gain.gain.setTargetAtTime(0, now, kSmooth / 3);
    player.stop(now + 2 * kSmooth);
    player.onended = () => gain.disconnect();
    voices.delete(path);
  }
  drop(key) {
    const {panner, voices} = this.emitters.get(key);
    for (const path of [...voices.keys()]) this.silence(voices, path);
    this.emitters.delete(key);
    setTimeout(() => panner.disconnect(), 4000 * kSmooth);
  }
}

/** Makes a panner by HRTF that does not change the loudness. */
function placedBy(context) {
  const panner = context.createPanner();
  panner.panningModel = 'HRTF';
  panner.rolloffFactor = 0;
  return panner;
}
