// A replica of a scene: nodes, values, names and routes. Its state hash (PROTOCOL.md, "State hash") is updated with
// each change.

import {FormatError} from './reader.js';
import {MFNODE, SFNODE, valueOf} from './values.js';
import {times, xxh128, xxh128OfWords} from './xxh3.js';

const kNode = 1, kField = 2, kNeighbours = 3, kName = 4, kRoute = 5, kNoField = 0xFFFF;
const utf8 = new TextDecoder('utf-8');
const term = new Uint32Array(4);
const scratch = new Uint8Array(16), scratchView = new DataView(scratch.buffer);
const empty = new Uint32Array(0), noKey = [0, 0];
let seedLow = 0, seedHigh = 0;  // of the present term

const sameBytes = (a, b) => a.length === b.length && a.every((x, i) => x === b[i]);

/** The sum of terms modulo 2^128, in four parts. Each may be out of range until it is read. */
class StateHash {
  constructor() { this.sum = new Float64Array(4); }
  add(t, at, sign) {
    const s = this.sum;
    s[0] += sign * t[at];
    s[1] += sign * t[at + 1];
    s[2] += sign * t[at + 2];
    s[3] += sign * t[at + 3];
    if (++this.pending === 1 << 20) this.carry();
  }
  carry() {
    this.pending = 0;
    let over = 0;
    for (let i = 0; i < 4; ++i) {
      const x = this.sum[i] + over;
      over = Math.floor(x / 2 ** 32);
      this.sum[i] = x - over * 2 ** 32;
    }
  }
  /** In the program's form: high half first. */
  hex() {
    this.carry();
    return [...this.sum].reverse().map((x) => x.toString(16).padStart(8, '0')).join('');
  }
}
StateHash.prototype.pending = 0;

export class Node {
  constructor(id, type, scope) {
    this.id = id;
    this.spread = times(id, 0x7F4A7C15, 0x9E3779B9);
    this.type = type;
    this.scope = scope;
    this.values = [];  // by field; missing ones have their default
    this.terms = null;  // hash terms of the values, four numbers each; null until there is one
    this.name = '';
    this.routes = [];  // the routes that it sends
  }
  /** Returns a field's value by name or number. */
  get(field) {
    const index = typeof field === 'number' ? field : this.type.fields.findIndex((f) => f.name === field);
    if (!(index in this.type.fields)) throw new RangeError(`${this.type.name} has no field ${field}`);
    const value = index in this.values ? this.values[index] : this.type.fields[index].default;
    return Array.isArray(value) ? value.slice() : value;  // a copy, because the scene changes its own
  }
}

export class Scene {
  constructor() {
    /** Called once for each record, after it is applied, with what it set: node, number of the field, node, number, and so on in
     * one flat array, values of new nodes too. Not in it are names, routes, and that nodes are gone. null: nobody is told. */
    this.listener = null;
    this.changed = null;
    /** In streams of version 2, hashes use the numbers of fields. */
    this.countsFields = false;
    this.reset();
  }
  reset() {
    this.nodes = new Map();
    this.names = new Map();
    this.hash = new StateHash();
    this.state = 0;
    this.time = 0;
    this.epoch = 0n;
    this.nodes.set(1, new Node(1, {name: 'RtsgScene', fields: [], nameHash: [0, 0]}, 0));
  }
  get root() { return this.nodes.get(1); }
  node(id) {
    const node = this.nodes.get(id);
    if (!node) throw new FormatError(`there is no node ${id}`);
    return node;
  }
  /** Finds a node by DEF name. If several scopes have the name, it returns any of them. */
  find(name) { return this.nodes.get(this.names.get(name)); }

  // ---- terms -------------------------------------------------------------------------------------------------

  /** Sets seedLow and seedHigh. */
  seed(node, field, t) {
    if (this.countsFields) {
      seedLow = (field << 16 | t) >>> 0;
      seedHigh = node.id;
      return;
    }
    const key = field === kNoField ? noKey : this.fieldOf(node, field).key;
    const low = key[0] + t + node.spread[0];
    seedLow = low >>> 0;
    seedHigh = (key[1] + node.spread[1] + Math.floor(low / 0x100000000)) >>> 0;
  }
  fieldOf(node, field, type) {
    const def = node.type.fields[field];
    if (!def) throw new FormatError(`${node.type.name} has no field ${field}`);
    if (type !== undefined && def.type !== type) throw new FormatError(`${node.type.name}.${def.name} is of another type`);
    return def;
  }
  /** Replaces the term of a field by `term`, or by none. */
  replaceTerm(node, field, isDefault) {
    const terms = node.terms ??= new Uint32Array(4 * node.type.fields.length);
    const at = 4 * field;
    this.hash.add(terms, at, -1);  // four zeros if there is none
    for (let i = 0; i < 4; ++i) terms[at + i] = isDefault ? 0 : term[i];
    if (!isDefault) this.hash.add(term, 0, 1);
  }
  neighbours(node, field, a, b, sign) {
    if (a === 0 && b === 0) return;
    scratchView.setUint32(0, a, true);
    scratchView.setUint32(4, b, true);
    this.seed(node, field, kNeighbours);
    xxh128(term, 0, scratch, scratchView, 0, 8, seedLow, seedHigh);
    this.hash.add(term, 0, sign);
  }
  list(node, field, children, sign) {
    for (let i = 0; i <= children.length; ++i)
      this.neighbours(node, field, i > 0 ? children[i - 1] : 0, i < children.length ? children[i] : 0, sign);
  }
  nodeTerm(node, sign) {
    const [low, high] = node.type.nameHash;
    [low, high, node.scope, 0].forEach((x, i) => scratchView.setUint32(4 * i, x, true));
    this.seed(node, kNoField, kNode);
    xxh128(term, 0, scratch, scratchView, 0, 16, seedLow, seedHigh);
    this.hash.add(term, 0, sign);
  }
  nameTerm(node, bytes, sign) {
    if (!bytes.length) return;
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    this.seed(node, kNoField, kName);
    xxh128(term, 0, bytes, view, 0, bytes.length, seedLow, seedHigh);
    this.hash.add(term, 0, sign);
  }
  routeTerm(r, sign) {
    this.seed(this.node(r.from), r.fromField, kRoute);
    if (this.countsFields) {
      scratchView.setUint32(0, r.to, true);
      scratchView.setUint32(4, r.toField + (r.isConnection ? 0x10000 : 0), true);
      xxh128(term, 0, scratch, scratchView, 0, 8, seedLow, seedHigh);
    } else {
      const [low, high] = this.fieldOf(this.node(r.to), r.toField).key;
      [low, high, r.to, r.isConnection ? 1 : 0].forEach((x, i) => scratchView.setUint32(4 * i, x, true));
      xxh128(term, 0, scratch, scratchView, 0, 16, seedLow, seedHigh);
    }
    this.hash.add(term, 0, sign);
  }

  // ---- called by a decoder -------------------------------------------------------------------------------------

  defineType(number, type) {
    if (type.name === 'RtsgScene') this.root.type = type;
  }
  create(id, type, scope) {
    if (id === 0 || this.nodes.has(id)) throw new FormatError(`node ${id} is there already`);
    const node = new Node(id, type, scope);
    this.nodes.set(id, node);
    this.nodeTerm(node, 1);
  }
  setNode(id, field, child) {
    const node = this.node(id);
    this.fieldOf(node, field, SFNODE);
    node.values[field] = child;
    scratchView.setUint32(0, child, true);
    this.seed(node, field, kField);
    if (child) xxh128(term, 0, scratch, scratchView, 0, 4, seedLow, seedHigh);
    this.replaceTerm(node, field, child === 0);
    this.changed?.push(node, field);
  }
  childrenOf(node, field) {
    this.fieldOf(node, field, MFNODE);
    return node.values[field] ?? empty;
  }
  setNodes(id, field, children) {
    const node = this.node(id);
    this.list(node, field, this.childrenOf(node, field), -1);
    this.list(node, field, children, 1);
    node.values[field] = children;
    this.changed?.push(node, field);
  }
  insert(id, field, child, index) {
    const node = this.node(id), children = Array.from(this.childrenOf(node, field));
    if (index > children.length) throw new FormatError(`place ${index} of ${children.length}`);
    const a = children[index - 1] ?? 0, b = children[index] ?? 0;
    this.neighbours(node, field, a, b, -1);
    this.neighbours(node, field, a, child, 1);
    this.neighbours(node, field, child, b, 1);
    children.splice(index, 0, child);
    node.values[field] = Uint32Array.from(children);
    this.changed?.push(node, field);
  }
  remove(id, field, child, index) {
    const node = this.node(id), children = Array.from(this.childrenOf(node, field));
    if (children[index] !== child) throw new FormatError(`node ${child} is not at place ${index}`);
    const a = children[index - 1] ?? 0, b = children[index + 1] ?? 0;
    this.neighbours(node, field, a, child, -1);
    this.neighbours(node, field, child, b, -1);
    this.neighbours(node, field, a, b, 1);
    children.splice(index, 1);
    node.values[field] = Uint32Array.from(children);
    this.changed?.push(node, field);
  }
  /** Sets values of 1 to 4 f32, given as bits, one after the other. */
  setWords(nodes, field, type, lanes, words) {
    const {hash, changed} = this, all = this.nodes, numbers = new Float32Array(words.buffer, words.byteOffset, words.length);
    let known = null, defaults = null;  // most columns are for one type of node
    for (let i = 0, at = 0; i < nodes.length; ++i, at += lanes) {
      const node = all.get(nodes[i]) ?? this.node(nodes[i]);
      if (node.type !== known) {
        known = node.type;
        defaults = new Int32Array(this.fieldOf(node, field, type).defaultBytes.slice().buffer);
      }
      let isDefault = true;
      for (let k = 0; k < lanes; ++k) if (words[at + k] !== defaults[k]) isDefault = false;
      const terms = node.terms ??= new Uint32Array(4 * known.fields.length), own = 4 * field;
      hash.add(terms, own, -1);  // four zeros if there is none
      if (isDefault) {
        terms.fill(0, own, own + 4);
      } else {
        this.seed(node, field, kField);
        xxh128OfWords(terms, own, words, at, lanes, seedLow, seedHigh);
        hash.add(terms, own, 1);
      }
      this.setNumbers(node, field, lanes, numbers, at);
      if (changed !== null) changed.push(node, field);
    }
  }
  /** Writes into the existing array, if there is one, so that moving values make no garbage. Node.get returns copies
   * for those who keep values. */
  setNumbers(node, field, lanes, numbers, at) {
    if (lanes === 1) {
      node.values[field] = numbers[at];
      return;
    }
    const value = node.values[field];
    if (value === undefined) {
      node.values[field] = Array.from(numbers.subarray(at, at + lanes));
      return;
    }
    for (let k = 0; k < lanes; ++k) value[k] = numbers[at + k];
  }
  setBytes(id, field, type, bytes) {
    const node = this.node(id), def = this.fieldOf(node, field, type);
    const isDefault = sameBytes(bytes, def.defaultBytes);
    if (!isDefault) {
      const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
      this.seed(node, field, kField);
      xxh128(term, 0, bytes, view, 0, bytes.length, seedLow, seedHigh);
    }
    this.replaceTerm(node, field, isDefault);
    node.values[field] = valueOf(type, bytes);
    this.changed?.push(node, field);
  }
  name(id, bytes) {
    const node = this.node(id);
    this.nameTerm(node, node.nameBytes ?? empty, -1);
    if (this.names.get(node.name) === id) this.names.delete(node.name);
    node.nameBytes = bytes.slice();
    node.name = utf8.decode(bytes);
    this.nameTerm(node, node.nameBytes, 1);
    if (node.name) this.names.set(node.name, id);
  }
  route(added, from, fromField, to, toField, isConnection) {
    const node = this.node(from);
    const same = (r) => r.fromField === fromField && r.to === to && r.toField === toField && r.isConnection === isConnection;
    const at = node.routes.findIndex(same);
    if (added === at >= 0) throw new FormatError(`a route of node ${from} is ${added ? 'there already' : 'not there'}`);
    const route = added ? {from, fromField, to, toField, isConnection} : node.routes[at];
    if (added) node.routes.push(route);
    else node.routes.splice(at, 1);
    this.routeTerm(route, added ? 1 : -1);
  }
  destroy(id) {
    const node = this.node(id);
    this.nodeTerm(node, -1);
    this.nameTerm(node, node.nameBytes ?? empty, -1);
    if (this.names.get(node.name) === id) this.names.delete(node.name);
    node.type.fields.forEach((def, field) => {
      if (def.type === MFNODE && node.values[field]) this.list(node, field, node.values[field], -1);
      else if (node.terms) this.hash.add(node.terms, 4 * field, -1);
    });
    this.nodes.delete(id);
  }
  event() {}

  /** Applies a frame that follows from this state, or a keyframe or scene. A keyframe that does not follow begins anew.
   * Returns whether the state hash is then the record's. */
  apply(record, decoder) {
    if (record.kind !== 'frame' && !(record.from === this.state && this.nodes.size === 1)) {
      const {listener} = this;
      this.reset();
      this.listener = listener;
    }
    if (record.from !== this.state) throw new FormatError(`a frame from state ${record.from} in state ${this.state}`);
    this.changed = this.listener ? [] : null;
    decoder.decode(record, this);
    this.state = record.to;
    this.time = record.time;
    const changed = this.changed;
    this.changed = null;
    if (changed) this.listener(changed);
    return this.hash.hex() === record.hash;
  }

  /** Everything that differs from a scene of defaults, in a form for JSON; for tests and people. */
  dump() {
    const nodes = {};
    const label = (def, value) => Array.isArray(value) || ArrayBuffer.isView(value) ? Array.from(value) : value;
    for (const [id, node] of [...this.nodes].sort((a, b) => a[0] - b[0])) {
      const fields = {};
      node.type.fields.forEach((def, field) => {
        const given = field in node.values ? node.values[field] : undefined;
        if (given === undefined) return;
        const isDefault = def.type === MFNODE ? given.length === 0 : !node.terms || !node.terms.subarray(4 * field, 4 * field + 4).some(Boolean);
        if (!isDefault) fields[def.name] = label(def, given);
      });
      nodes[id] = {type: node.type.name, ...(node.name && {name: node.name}), ...(node.scope && {scope: node.scope}), fields};
    }
    const routes = [...this.nodes.values()].flatMap((node) => node.routes.map((r) =>
      `${r.isConnection ? 'IS' : 'ROUTE'} ${r.from}.${node.type.fields[r.fromField].name} TO ${r.to}.${this.node(r.to).type.fields[r.toField].name}`));
    return {state: this.state, hash: this.hash.hex(), nodes, routes: routes.sort()};
  }
}
