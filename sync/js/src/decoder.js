// Decodes the blocks of a frame or keyframe (PROTOCOL.md, "Changes") and calls a sink for each change.
//
// A sink has the methods of Scene in scene.js. Malformed input throws a FormatError; the sink's state is then
// undefined.

import {FormatError, Reader, addDelta} from './reader.js';
import {Memory} from './prediction.js';
import {readType, typeOfCatalogue, wordsOfScenes} from './types.js';
import {readPacked} from './arrays.js';
import {fixedSize, lanesOf, readHashBytes, MFNODE, SFNODE, isKnown} from './values.js';

const kMostChanges = 1 << 26, kMostInflated = 2 ** 30;

let inflateRaw = globalThis.process?.getBuiltinModule?.('node:zlib')?.inflateRawSync;  // Node 20.16 and later

/** Sets the function that inflates the deflated blocks of scene files: `inflate(bytes, {maxOutputLength, dictionary})`
 * inflates a raw deflate stream like inflateRawSync of node:zlib, which Node uses by default. */
export function setInflate(inflate) { inflateRaw = inflate; }

function inflated(body, dictionary) {
  const size = body.varint();
  if (!inflateRaw) throw new FormatError('a deflated block, and nothing here that inflates it: see setInflate()');
  if (size > kMostInflated) throw new FormatError(`a deflated block of ${size} bytes`);
  let bytes;
  try {
    bytes = inflateRaw(body.take(body.left), {maxOutputLength: Math.max(size, 1), ...(dictionary && {dictionary})});
  } catch (problem) {
    throw new FormatError(`a deflated block is damaged: ${problem.message}`);
  }
  if (bytes.length !== size) throw new FormatError(`a deflated block of ${bytes.length} bytes instead of ${size}`);
  return new Reader(new Uint8Array(bytes));  // its own memory, so that words are aligned
}

export class Decoder {
  constructor() { this.restart(); }
  /** Begins another epoch. */
  restart() {
    this.types = new Map();
    this.catalogued = 0;  // types below this are the catalogue's
    this.memory = new Memory();
  }

  /** `record` must be of kind frame, keyframe or scene. */
  decode(record, sink) {
    this.memory.begin(record.kind === 'frame' ? record.flags : 4);
    this.remembers = record.kind === 'frame' && (record.flags & 1) !== 0;
    const reader = new Reader(record.payload);
    this.words = record.kind === 'scene' ? wordsOfScenes() : null;
    if (record.kind === 'scene') this.startScene(reader, sink);
    this.blocks(reader, sink, true);
  }

  /** Reads what a scene record has before its blocks. */
  startScene(reader, sink) {
    const version = reader.u16();
    if (version !== 1) throw new FormatError(`a scene of version ${version}; this reader knows 1`);
    this.restart();
    this.catalogued = reader.u16();
    const root = reader.u16();
    sink.defineType(root, this.typeOf(root));
  }

  blocks(reader, sink, mayInflate) {
    while (reader.left) {
      const kind = reader.u8(), count = reader.varint(), body = reader.part();
      if (count > kMostChanges) throw new FormatError(`${count} changes in one block`);
      if (kind === 14 && mayInflate) this.blocks(inflated(body, this.words), sink, false);
      else this.block(kind, count, body, sink);
    }
  }

  block(kind, count, b, sink) {
    let node = 0, other = 0;
    if (kind === 4) return this.column(count, b, sink);
    if (kind > 8) return undefined;  // of a later version, or a filler
    for (let i = 0; i < count; ++i) {
      if (kind === 0 || kind === 1) {
        const number = kind === 0 ? b.varint() : Math.floor(b.varint() / 2);
        const type = readType(b);
        if (kind === 0 || !this.types.has(number)) this.types.set(number, type);
        sink.defineType(number, this.types.get(number));
        continue;
      }
      if (kind === 3) {
        node = this.link(b, node, sink);
        continue;
      }
      if (kind === 6) {
        const tag = b.u8();
        node = b.node(node);
        const from = b.varint(), to = b.node(node), into = b.varint();
        sink.route((tag & 1) === 0, node, from, to, into, (tag & 4) !== 0);
        continue;
      }
      node = addDelta(node, Math.floor(b.varint() / 2));
      if (kind === 2) {
        const type = b.varint();
        other = b.node(other);
        sink.create(node, this.typeOf(type), other);
      } else if (kind === 5) {
        sink.name(node, b.take(b.varint()));
      } else if (kind === 7) {
        sink.destroy(node);
      } else {
        const field = b.varint(), type = b.u8();
        if (!isKnown(type)) throw new FormatError(`value type ${type}`);
        sink.event(node, field, type, readHashBytes(b, type));
      }
    }
    return undefined;
  }

  typeOf(number) {
    let type = this.types.get(number);
    if (!type && number < this.catalogued) this.types.set(number, type = typeOfCatalogue(number));
    if (!type) throw new FormatError(`node type ${number} is not described`);
    return type;
  }

  link(b, before, sink) {
    const tag = b.u8(), node = b.node(before), field = b.varint();
    if ((tag & 3) === 0) {
      sink.setNode(node, field, b.node(node));
    } else if ((tag & 3) === 1) {
      const children = new Uint32Array(b.count(1));
      for (let k = 0, child = node; k < children.length; ++k) children[k] = child = b.node(child);
      sink.setNodes(node, field, children);
    } else {
      const child = b.node(node), index = b.varint();
      if ((tag & 3) === 2) sink.insert(node, field, child, index);
      else sink.remove(node, field, child, index);
    }
    return node;
  }

  column(count, b, sink) {
    const coding = b.u8();
    b.u8();  // flags: the origin
    const type = b.u8(), field = b.varint();
    if (coding > 3) return;  // of a later version
    if (!isKnown(type) || type === SFNODE || type === MFNODE) throw new FormatError(`a column of value type ${type}`);
    const lanes = lanesOf(type);
    if (coding === 1 || coding === 2) {
      if (!this.remembers) throw new FormatError('foretold values in a record that has none');
      const {nodes, words} = this.memory.column(b, count, coding, type, field);
      sink.setWords(nodes, field, type, lanes, words);
      return;
    }
    if (count > b.left) throw new FormatError(`${count} values in ${b.left} bytes`);
    const nodes = new Uint32Array(count);
    for (let i = 0, node = 0; i < count; ++i) nodes[i] = node = b.node(node);
    if (coding === 3) {
      for (let i = 0; i < count; ++i) sink.setBytes(nodes[i], field, type, readPacked(b, type));
      return;
    }
    if (lanes) {
      const words = new Int32Array(b.take(count * fixedSize(type)).slice().buffer);
      if (this.remembers) for (let i = 0; i < count; ++i) this.memory.remember(nodes[i], field, type, words, i * lanes);
      sink.setWords(nodes, field, type, lanes, words);
      return;
    }
    for (let i = 0; i < count; ++i) sink.setBytes(nodes[i], field, type, readHashBytes(b, type));
  }
}
