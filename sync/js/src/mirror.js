// A client of a mirror server (PROTOCOL.md, "Mirror") for any transport: it calls `send(first, second)`, and
// receive(first, second) must be called with what comes. It follows the stream, compares the hash after every record,
// acknowledges, reconnects without a snapshot if possible, and sends events.

import {FormatError, Reader} from './reader.js';
import {readRecord} from './record.js';
import {readHead} from './types.js';
import {Decoder} from './decoder.js';
import {Scene} from './scene.js';
import {Writer, editRecord, eventRecord, lockRecord, redoRecord, undoRecord} from './writer.js';

const HELLO = 1, ACK = 2, PING = 3, PONG = 4, BYE = 5, SUBMIT = 9, CONTROL = 10, WELCOME = 16, DATA = 17, UNKNOWN = 18,
  REFUSED = 19, VERDICT = 22, REPLY = 23;
const NEAR_FIRST = 3;  // when slow
const kSubmitPart = 8 << 10;
const kHelloAgain = 500, kHelloLost = 2000, kMostDoublings = 4, kPing = 500, kTimeout = 2500, kRequestAgain = 1000;  // ms
const kMostRecord = 2 ** 30;

function message(type) {
  return new Writer().raw([0x52, 0x54, 0x53, 0x47, 1, type, 0, 0]);  // RTSG, version 1
}

function random64() {
  const words = crypto.getRandomValues(new BigUint64Array(1));
  return words[0] || 1n;
}

export class Mirror {
  /** `options`: name, window (bytes), lag (ms behind at most, 0: any), rate (bytes a second at most, 0: any), nearFirst (on a
   * slow link views, sounds and what is near the viewer come before what is far), parts (DEF names, or one `region:EYE,50`), and any of the functions
   * onState(record, equal), onReset(), onWelcome(resumed), onBye(state), onRefused(reason),
   * onOrigin(lost) (a relay has lost its origin, or hears it again),
   * onVerdict({request, reason, state, kept}), onReply(text), onTrouble(text). */
  constructor(send, options = {}) {
    this.send = send;
    this.options = {name: 'JavaScript', window: 8 << 20, lag: 250, rate: 0, nearFirst: false, parts: [], ...options};
    this.scene = new Scene();
    this.decoder = new Decoder();
    this.session = random64();
    this.client = random64();
    this.epoch = 0n;
    this.serverHash = [0n, 0n];
    this.hasState = false;
    this.connected = false;
    this.originLost = false;
    this.unanswered = 0;  // hellos since the last answer
    this.gone = false;  // the server said goodbye
    this.nextRequest = 1;
    this.requests = new Map();
    this.count = {states: 0, equal: 0, unequal: 0, keyframes: 0, gaps: 0, garbage: 0, bytes: 0, resumed: 0};
    this.heard = this.greeted = this.pinged = this.ticked = 0;
    this.forgetPart();
  }
  tell(name, ...given) { this.options[name]?.(...given); }

  /** Call it when a connection to the server is there. */
  hello(afresh = false) {
    ++this.session;
    this.session &= 0xFFFFFFFFFFFFFFFFn;
    this.received = this.acknowledged = 0;
    this.forgetPart();
    this.connected = false;
    if (afresh) this.hasState = false;
    const o = this.options, known = this.hasState;
    const m = message(HELLO).u64(this.session).u64(0).u64(known ? this.epoch : 0).u64(known ? this.scene.state : 0).u64(o.window);
    m.text(o.name.slice(0, 100)).u64(this.client).u8(o.nearFirst ? NEAR_FIRST : 0).u32(0).u32(0).texts(o.parts).u8(0).u32(o.lag).u64(o.rate);
    for (const half of known ? this.serverHash : [0n, 0n]) m.u64(half);
    this.asked = known ? this.scene.state : 0;
    this.send(m.done());
    ++this.unanswered;
    this.greeted = performance.now();
  }
  /** Another hello makes the answer to the last one void. On a slow link that answer may take seconds. */
  mayGreet(now) {
    return now - this.greeted > (this.unanswered ? kHelloLost * 2 ** Math.min(this.unanswered - 1, kMostDoublings) : kHelloAgain);
  }
  bye() { this.send(message(BYE).done()); }

  /** Call it when the connection is lost. The next hello goes on from the present state. */
  cut() {
    this.connected = false;
    this.unanswered = 0;
  }

  /** Call it a few times a second. Returns true while the server is heard. */
  tick(now = performance.now()) {
    // After this program has slept, the silence may be its own.
    if (now - this.ticked > kTimeout / 2) this.heard = now;
    this.ticked = now;
    if (!this.connected) {
      if (this.mayGreet(now)) this.hello();
      return false;
    }
    if (now - this.heard > kTimeout) {
      this.connected = false;
      return false;
    }
    if (now - this.pinged > kPing) {
      this.pinged = now;
      this.send(message(PING).u64(Math.round(now * 1e6)).done());
    }
    for (const [number, request] of this.requests) if (now - request.sentAt > kRequestAgain) this.sendRequest(number, request);
    return true;
  }

  receive(first, second) {
    try {
      const r = new Reader(first);
      const magic = r.take(4), version = r.u8(), type = r.u8();
      if (String.fromCharCode(...magic) !== 'RTSG' || r.u16() !== 0) throw new FormatError('none of this protocol');
      if (version !== 1) return this.meetVersion(version, type, r);
      this.heard = performance.now();
      this.take(type, r, second);
    } catch (error) {
      if (!(error instanceof FormatError)) throw error;
      ++this.count.garbage;
      this.tell('onTrouble', error.message);
      // A half applied record leaves no valid state.
      if (this.applying) this.hello(true);
      this.applying = false;
    }
    if (this.connected && this.received !== this.acknowledged) this.acknowledge();
  }

  /** A server of another version says so, if it knows how versions meet: a refusal is the same in all of them. */
  meetVersion(version, type, r) {
    if (this.connected) throw new FormatError(`a message of version ${version} of the protocol`);
    this.greeted = performance.now();
    this.tell('onRefused', type === REFUSED ? r.text()
      : `this server speaks version ${version} of the protocol, and this client version 1`);
  }

  take(type, r, second) {
    switch (type) {
      case WELCOME: return this.welcome(r, second);
      case DATA: return this.data(r, second);
      case PING: {
        const token = r.u64();
        if (r.left >= 8) this.originState = Number(r.u64());
        if (r.left >= 8) this.takeOrigin(r.u64() !== 0n);
        return this.send(message(PONG).u64(token).done());
      }
      case PONG: return undefined;
      case BYE:
        this.gone = true;
        this.connected = false;
        this.unanswered = 0;
        this.greeted = performance.now();
        this.bye();
        return this.tell('onBye', r.left >= 8 ? Number(r.u64()) : 0);
      case UNKNOWN: return this.connected ? this.hello() : undefined;
      case REFUSED:
        this.connected = false;
        this.unanswered = 0;
        this.greeted = performance.now();
        return this.tell('onRefused', r.text());
      case VERDICT: return this.verdict(r);
      case REPLY:
        r.u64();
        return this.tell('onReply', r.text());
      default: return undefined;
    }
  }

  /** A relay tells whether it hears its origin. */
  takeOrigin(lost) {
    if (lost !== this.originLost) this.tell('onOrigin', this.originLost = lost);
  }

  welcome(r, second) {
    if (r.u64() !== this.session) return;
    const epoch = r.u64();
    r.u64();
    const record = readRecord(second, 0, kMostRecord);
    if (record.kind !== 'head') throw new FormatError('a welcome without a head');
    this.unanswered = 0;
    this.head = readHead(record.payload);
    this.scene.countsFields = this.head.version < 3;
    const resumed = this.asked > 0 && epoch === this.epoch;
    if (epoch !== this.epoch) {
      this.hasState = false;
      this.requests.clear();
      this.decoder.restart();
      this.epoch = epoch;
    }
    this.connected = true;
    this.gone = false;
    this.takeOrigin(false);
    this.originState = 0;
    if (resumed) ++this.count.resumed;
    this.acknowledge();
    for (const [number, request] of this.requests) this.sendRequest(number, request);
    this.tell('onWelcome', resumed);
  }

  acknowledge() {
    this.send(message(ACK).u64(this.session).u64(this.hasState ? this.scene.state : 0).u64(this.received).done());
    this.acknowledged = this.received;
  }

  forgetPart() {
    this.partial = null;
    this.filled = 0;
  }

  data(r, part) {
    const session = r.u64(), size = Number(r.u64()), offset = Number(r.u64());
    if (session !== this.session || !this.connected) return;
    if (size > kMostRecord || !part.length || offset + part.length > size) throw new FormatError(`${part.length} bytes from ${offset} of ${size}`);
    this.received += part.length;
    this.count.bytes += part.length;
    if (offset === 0 && part.length === size) {
      this.forgetPart();
      return this.record(part);
    }
    if (offset === 0) {
      this.partial = new Uint8Array(size);
      this.filled = 0;
    }
    if (!this.partial || offset !== this.filled || size !== this.partial.length) {
      ++this.count.gaps;
      return this.hello();
    }
    this.partial.set(part, offset);
    this.filled += part.length;
    if (this.received - this.acknowledged > this.options.window / 4) this.acknowledge();
    if (this.filled < size) return undefined;
    const whole = this.partial;
    this.forgetPart();
    return this.record(whole);
  }

  record(bytes) {
    let record;
    try {
      record = readRecord(bytes, 0, kMostRecord);
    } catch (error) {
      this.tell('onTrouble', error.message);
      ++this.count.garbage;
      return this.hello();
    }
    if (record.kind !== 'frame' && record.kind !== 'keyframe') return undefined;
    const keyframe = record.kind === 'keyframe', follows = this.hasState && record.from === this.scene.state;
    if (!follows && !keyframe) {
      if (this.hasState && record.to <= this.scene.state) return undefined;  // applied already
      ++this.count.gaps;
      return this.hello(!this.hasState);
    }
    if (!follows) this.scene.reset();
    this.afresh = !follows || keyframe;  // tells listeners that everything in the scene is new
    this.applying = true;
    const equal = this.scene.apply(record, this.decoder);
    this.applying = false;
    this.hasState = true;
    this.serverHash = [BigInt(`0x${record.hash.slice(16)}`), BigInt(`0x${record.hash.slice(0, 16)}`)];
    ++this.count.states;
    ++this.count[equal ? 'equal' : 'unequal'];
    if (keyframe) ++this.count.keyframes;
    this.tell('onState', record, equal, this.afresh);
    if (!equal) {
      this.tell('onTrouble', `state ${record.to}: hash ${this.scene.hash.hex()} here, ${record.hash} at the origin`);
      this.hello(true);
    }
    return undefined;
  }

  // ---- upstream ----------------------------------------------------------------------------------------------------

  /** Sends input events, [{node, field, type, value}] with node and field numbers. Returns the request's number. */
  submitEvents(events) { return this.submit(eventRecord(events)); }
  /** Sends edits of fields, in the same form. */
  submitEdits(edits) { return this.submit(editRecord(edits)); }
  /** Takes back this author's last request, or does it again. The verdict's `kept` says what was left unchanged, and
   * why. */
  undo() { return this.submit(undoRecord()); }
  redo() { return this.submit(redoRecord()); }
  /** Reserves nodes, by number, for this author for so many ms, at most 60,000; 0 releases them. */
  lock(nodes, lease) { return this.submit(lockRecord(nodes, lease)); }
  submit(bytes) {
    const number = this.nextRequest++;
    const request = {bytes, sentAt: 0};
    this.requests.set(number, request);
    if (this.connected) this.sendRequest(number, request);
    return number;
  }
  sendRequest(number, request) {
    request.sentAt = performance.now();
    for (let at = 0; at < request.bytes.length; at += kSubmitPart) {
      const head = message(SUBMIT).u64(this.session).u64(number).u64(request.bytes.length).u64(at).done();
      this.send(head, request.bytes.subarray(at, at + kSubmitPart));
    }
  }
  verdict(r) {
    if (r.u64() !== this.session) return;
    const request = Number(r.u64()), state = Number(r.u64()), reason = r.text();
    for (let n = r.left ? r.varint() : 0; n > 0; --n) {
      r.varint();  // numbers of created nodes, which this client never asks for
      r.varint();
    }
    const kept = r.left ? r.text() : '';
    if (this.requests.delete(request)) this.tell('onVerdict', {request, state, reason, kept});
  }
  /** Sends a command to the player of a log: "pause", "seek 3", ... */
  control(command) {
    this.send(message(CONTROL).u64(this.session).text(command).done());
  }
}
