// Records (PROTOCOL.md, "Records"), the unit of log and wire.

import {FormatError} from './reader.js';
import {xxh64} from './xxh3.js';

export const HEADER = 64;
const MAGIC = Uint8Array.from('RTSGrec1', (c) => c.charCodeAt(0));
const KINDS = {1: 'head', 2: 'frame', 3: 'keyframe', 4: 'index', 5: 'input', 6: 'request', 7: 'scene'};

/** Returns the record at `at` after checking its checksum. Throws a FormatError that says what is wrong. State numbers
 * may be up to 2^53. */
export function readRecord(bytes, at = 0, mostPayload = 2 ** 30) {
  const fail = (why) => { throw new FormatError(`at byte ${at}: ${why}`); };
  if (bytes.length - at < HEADER) fail('a record cut short');
  if (MAGIC.some((byte, i) => bytes[at + i] !== byte)) fail('no record');
  const view = new DataView(bytes.buffer, bytes.byteOffset + at, bytes.length - at);
  const length = view.getUint16(18, true) + view.getUint32(20, true) * 2 ** 16;
  if (bytes[at + 17] > 7) fail('flags of a later version');
  if (length > mostPayload) fail(`a payload of ${length} bytes`);
  if (length > bytes.length - at - HEADER) fail('a record cut short');
  if (xxh64(bytes.subarray(at + 16, at + HEADER + length)) !== view.getBigUint64(8, true)) fail('a wrong checksum');
  if (!Number.isFinite(view.getFloat64(40, true))) fail('no time');
  const hex = (from) => view.getBigUint64(from, true).toString(16).padStart(16, '0');
  return {
    kind: KINDS[bytes[at + 16]] ?? 'other', flags: bytes[at + 17], from: Number(view.getBigUint64(24, true)),
    to: Number(view.getBigUint64(32, true)), time: view.getFloat64(40, true), hash: hex(56) + hex(48),
    payload: bytes.subarray(at + HEADER, at + HEADER + length), size: HEADER + length, offset: at,
  };
}

/** Finds the next magic from `at` on; returns the end if there is none. */
export function findRecord(bytes, at) {
  for (let i = bytes.indexOf(MAGIC[0], at); i >= 0; i = bytes.indexOf(MAGIC[0], i + 1))
    if (MAGIC.every((byte, k) => bytes[i + k] === byte)) return i;
  return bytes.length;
}
