// Reads a log to its end, whatever is damaged (PROTOCOL.md, "Log").

import {FormatError} from './reader.js';
import {findRecord, readRecord} from './record.js';
import {readHead} from './types.js';
import {Decoder} from './decoder.js';
import {Scene} from './scene.js';

/** Returns every intact record. Calls `damage` with {offset, length} of the bytes between. */
export function* records(bytes, damage = () => {}) {
  let lostAt = -1;
  for (let at = 0; at < bytes.length;) {
    let record = null;
    try {
      record = readRecord(bytes, at);
    } catch (error) {
      if (!(error instanceof FormatError)) throw error;
      if (lostAt < 0) lostAt = at;
      at = findRecord(bytes, at + 1);
    }
    if (record || at >= bytes.length) {
      if (lostAt >= 0) damage({offset: lostAt, length: at - lostAt});
      lostAt = -1;
    }
    if (!record) continue;
    yield record;
    at += record.size;
  }
}

/** Plays a log into a scene, state by state. */
export class Replay {
  constructor(bytes) {
    this.scene = new Scene();
    this.decoder = new Decoder();
    this.head = null;
    this.states = this.verified = this.gaps = 0;
    this.damage = [];
    this.closed = false;
    this.goesOn = false;  // it ends with a piece that has a later piece
    this.ended = false;  // the last record other than heads was an index without a later piece, so the session is complete
    this.unclosedSessions = 0;  // times that it is unknown what lies between one session and the next
    this.lost = true;  // waiting for a keyframe
    this.told = false;  // missing frames have been counted until the next keyframe
    this.source = records(bytes, (place) => this.damage.push(place));
  }
  /** Returns the record that led to the next state; null at the end. */
  step() {
    for (let next = this.source.next(); !next.done; next = this.source.next()) {
      const record = next.value;
      this.closed = record.kind === 'index' && record.to === 0;
      this.goesOn = record.kind === 'index' && record.to !== 0;
      if (record.kind === 'head') {
        this.takeHead(record);
        continue;
      }
      this.ended = this.closed;
      if (record.kind === 'scene') return this.takeScene(record);
      if ((record.kind === 'frame' || record.kind === 'keyframe') && this.leadsOn(record)) return this.take(record);
    }
    return null;
  }
  takeHead(record) {
    const head = readHead(record.payload);
    if (this.head && head.epoch === this.head.epoch && head.version === this.head.version) return;
    if (head.mode === 'input') throw new FormatError('a log in input mode can only be run by the program that wrote it');
    if (this.head && head.epoch !== this.head.epoch && this.states > 0 && (!this.ended || head.start !== undefined))
      ++this.unclosedSessions;
    this.head = head;
    this.scene.countsFields = head.version < 3;
    this.decoder.restart();
    this.lost = true;
    this.told = false;
  }
  /** Reads a whole scene file. */
  takeScene(record) {
    this.head = null;
    this.scene.countsFields = false;
    const taken = this.take(record);
    this.lost = true;  // nothing follows
    return taken;
  }
  leadsOn(record) {
    if (!this.head) return false;
    if (!this.lost) {
      if (record.from === this.scene.state && !(record.kind === 'keyframe' && record.to === 0)) return true;
      if (record.to <= this.scene.state) return false;
      this.missFrames();
    }
    if (record.kind === 'frame') this.missFrames();
    return record.kind === 'keyframe';
  }
  /** Notes a frame that does not follow from the scene's state. Counts it once until the next keyframe. */
  missFrames() {
    this.lost = true;
    if (!this.told) ++this.gaps;
    this.told = true;
  }
  take(record) {
    this.equal = this.scene.apply(record, this.decoder);
    this.lost = this.told = false;
    ++this.states;
    if (this.equal) ++this.verified;
    return record;
  }
}
