// Descriptions of node types (PROTOCOL.md, "Head").

import {Reader, FormatError} from './reader.js';
import {xxh64} from './xxh3.js';
import {customZero, isCustom, isKnown, readHashBytes, valueOf, zeroBytes} from './values.js';

const utf8 = new TextEncoder();

/** Hashes a name for the state hash: XXH3-64, low half first. */
function nameHash(name) {
  const hash = xxh64(utf8.encode(name));
  return [Number(hash & 0xFFFFFFFFn), Number(hash >> 32n)];
}

function readField(f) {
  const name = f.text(), type = f.u8();
  if (!isKnown(type)) throw new FormatError(`value type ${type}`);
  const use = f.u8(), bits = f.u8();
  const field = {name, type, access: ['initializeOnly', 'inputOnly', 'outputOnly', 'inputOutput'][use & 3], aspect: use >> 2,
    hidden: (bits & 2) !== 0, defaultBytes: null};
  field.key = nameHash(field.hidden ? name + '\0' : name);
  if (bits & 4) field.minimum = f.f64();
  if (bits & 8) field.maximum = f.f64();
  if (bits & 16) field.allowed = f.texts();
  if (bits & 32) field.accepts = f.texts();
  field.defaultBytes = bits & 64 ? readHashBytes(f, type) : zeroBytes(type);
  if (isCustom(type)) {
    const bytes = customZero(f);
    if (type % 2 === 0 && !(bits & 64)) field.defaultBytes = bytes;
  }
  field.default = valueOf(type, field.defaultBytes);
  return field;
}

export function readType(reader) {
  const r = reader.part();
  const name = r.text();
  const type = {name, component: r.text(), level: r.varint(), kind: ['built in', 'user', 'PROTO', 'EXTERNPROTO', 'Script'][r.u8()],
    container: r.text(), implements: r.texts(), declaration: r.text(), fields: []};
  for (let n = r.count(1); n > 0; --n) type.fields.push(readField(r.part()));
  type.nameHash = nameHash(name);
  return type;
}

const fs = globalThis.process?.getBuiltinModule?.('node:fs');  // Node 20.16 and later
let catalogue = null, words = null;

/** Sets the bytes of sync/catalogue.bin and sync/words.bin. Scene files name built-in types by their numbers in the
 * catalogue, and their deflated blocks refer to the words. A new enough Node finds these files by
 * itself. */
export function setCatalogue(bytes, wordBytes) {
  words = wordBytes;
  catalogue = [];
  for (const r = new Reader(bytes); r.left;) {
    const start = r.at;
    r.part();
    catalogue.push(bytes.subarray(start, r.at));
  }
}

/** Fetches the two files from `folder`, which is that of this package unless another is named; for browsers. */
export async function loadCatalogue(folder = new URL('../tables/', import.meta.url)) {
  const files = ['catalogue.bin', 'words.bin'].map(async (name) => {
    const answer = await fetch(new URL(name, new URL(folder, import.meta.url)));
    if (!answer.ok) throw new Error(`${answer.url}: ${answer.status} ${answer.statusText}`);
    return new Uint8Array(await answer.arrayBuffer());
  });
  setCatalogue(...await Promise.all(files));
}

function findCatalogue() {
  // Beside this folder: in the package's own, or in the repository's.
  const folder = fs && ['../tables/', '../../'].find((one) => fs.existsSync(new URL(`${one}catalogue.bin`, import.meta.url)));
  const read = (name) => new Uint8Array(fs.readFileSync(new URL(folder + name, import.meta.url)));
  if (!catalogue && folder) setCatalogue(read('catalogue.bin'), read('words.bin'));
  if (!catalogue) throw new FormatError('a scene file, and nothing here that knows its types: see loadCatalogue()');
}

export function wordsOfScenes() {
  findCatalogue();
  return words;
}

export function typeOfCatalogue(number) {
  findCatalogue();
  if (number >= catalogue.length) throw new FormatError(`type ${number} of the catalogue, which has ${catalogue.length} here`);
  return readType(new Reader(catalogue[number]));
}

/** Reads a head record's payload. */
export function readHead(payload) {
  const r = new Reader(payload);
  const version = r.u16(), oldest = r.u16();
  if (oldest > 3) throw new FormatError(`the stream is for readers of version ${oldest}; this one reads 3`);
  if (version < 2) throw new FormatError(`a stream of version ${version}; this reader knows 2 and 3`);
  const head = {version, epoch: r.u64(), dictionary: r.u64(), builtin: r.u16(), mode: ['state', 'input', 'lossy'][r.u8()],
    coding: r.u8(), maxError: r.f64(), creator: r.text()};
  if (!head.mode) throw new FormatError('a stream of an unknown mode');
  if (r.left >= 8) head.start = r.f64();  // of the session, in later pieces of a log
  return head;
}
