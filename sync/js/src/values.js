// Field types and their values (PROTOCOL.md, "Values"). A value type is 2k for the k-th SF type, 2k + 1 for its MF type.
//
// SFBool is a boolean; SFInt32, SFFloat, SFDouble, SFTime and SFNode are numbers; SFString a string; other SF types are
// arrays of numbers. A value of a type from outside is a number, an array of numbers, or its bytes as "0x0aff". MF values are
// arrays of these, but those of numbers are one array, element after element; it is typed where the type is X3D's.

import {FormatError} from './reader.js';

export const NAMES = ['Bool', 'Int32', 'Float', 'Double', 'Time', 'String', 'Node', 'Color', 'ColorRGBA', 'Image', 'Vec2f',
  'Vec2d', 'Vec3f', 'Vec3d', 'Vec4f', 'Vec4d', 'Rotation', 'Matrix3f', 'Matrix3d', 'Matrix4f', 'Matrix4d', 'Custom'];
const kBool = 0, kString = 5, kNode = 6, kImage = 9, kRotation = 16, kCustom = 21;
export const SFNODE = 2 * kNode, MFNODE = SFNODE + 1, SFROTATION = 2 * kRotation;

/** The numbers of an element, and how each is stored. */
const LAYOUT = [[1, 'u8'], [1, 'i32'], [1, 'f32'], [1, 'f64'], [1, 'f64'], null, [1, 'u32'], [3, 'f32'], [4, 'f32'], null,
  [2, 'f32'], [2, 'f64'], [3, 'f32'], [3, 'f64'], [4, 'f32'], [4, 'f64'], [4, 'f32'], [9, 'f32'], [9, 'f64'], [16, 'f32'],
  [16, 'f64'], null];
const SIZE = {u8: 1, i32: 4, u32: 4, f32: 4, f64: 8};
const ARRAY = {u8: Uint8Array, i32: Int32Array, u32: Uint32Array, f32: Float32Array, f64: Float64Array};

export const typeName = (type) => `${type % 2 ? 'MF' : 'SF'}${NAMES[type >> 1]}`;
export const isKnown = (type) => type >> 1 < NAMES.length;
/** Number of components for types that can be predicted, 1 to 4 f32; 0 for others. */
export function lanesOf(type) {
  const layout = type % 2 ? null : LAYOUT[type >> 1];
  return layout && layout[1] === 'f32' && layout[0] <= 4 ? layout[0] : 0;
}
/** Bytes of an SF value; 0 if they vary. */
export const fixedSize = (type) => LAYOUT[type >> 1] ? LAYOUT[type >> 1][0] * SIZE[LAYOUT[type >> 1][1]] : 0;

const sf = (numbers) => numbers.length === 1 ? numbers[0] : Array.from(numbers);
const aligned = (bytes, kind) => new ARRAY[kind](bytes.slice().buffer);

/** The default value of a type: zero, empty, NULL, identity or no rotation. */
export function zero(type) {
  const k = type >> 1;
  if (type % 2) return LAYOUT[k] ? new ARRAY[LAYOUT[k][1]](0) : [];
  if (k === kBool) return false;
  if (k === kString) return '';
  if (k === kImage) return [];
  if (k === kCustom) return null;  // of no type; fields have their type's, see customZero()
  if (k === kRotation) return [0, 0, 1, 0];
  const n = LAYOUT[k][0];
  if (n === 9 || n === 16) return Array.from({length: n}, (_, i) => i % (Math.sqrt(n) + 1) === 0 ? 1 : 0);
  return n === 1 ? 0 : new Array(n).fill(0);
}

/** Reads a value and returns its bytes for a term of the state hash. They are those of the wire, but with sizes (of 8
 * bytes) only before each string and image of an MF value. */
export function readHashBytes(reader, type) {
  const k = type >> 1;
  const checked = (bytes) => {
    if (k === kBool && bytes.some((b) => b > 1)) throw new FormatError('a boolean is 0 or 1');
    return bytes;
  };
  if (LAYOUT[k]) {
    const size = fixedSize(type);
    return checked(reader.take(type % 2 ? reader.count(size) * size : size));
  }
  const one = () => {
    const bytes = reader.take(k === kImage ? 4 * reader.count(4) : reader.varint());
    if (k === kCustom) customOf(bytes);
    return bytes;
  };
  if (type % 2 === 0) return one();
  const parts = Array.from({length: reader.count(1)}, one);
  const all = new Uint8Array(parts.reduce((sum, p) => sum + 8 + p.length, 0));
  let at = 0;
  for (const part of parts) {
    new DataView(all.buffer).setBigUint64(at, BigInt(part.length), true);
    all.set(part, at + 8);
    at += 8 + part.length;
  }
  return all;
}

const utf8 = new TextDecoder('utf-8');

const CUSTOM = ['u8', 'i32', 'f32', 'f64'];  // bytes, or numbers
function customHead(of, count, name) {
  if (of >= CUSTOM.length || count > 1024 || (count === 0 && of !== 0) || !/^[A-Z][A-Za-z0-9_]{0,63}$/.test(name) || NAMES.includes(name)) {
    throw new FormatError('a field type from outside without a name or a layout');
  }
  return {head: 4 + name.length, size: count * SIZE[CUSTOM[of]]};
}
/** A value of a field type from outside, which says what it is. */
function customOf(bytes) {
  const wrong = () => new FormatError('a value of a field type from outside that does not say what it is');
  if (bytes.length < 4) throw wrong();
  const of = bytes[0], count = bytes[1] | bytes[2] << 8, name = utf8.decode(bytes.subarray(4, 4 + bytes[3]));
  const {head, size} = customHead(of, count, name), rest = bytes.subarray(head);
  if (bytes.length < head || (size !== 0 && rest.length !== size)) throw wrong();
  return of === 0 ? `0x${Array.from(rest, (byte) => byte.toString(16).padStart(2, '0')).join('')}` : sf(aligned(rest, CUSTOM[of]));
}
/** Reads which type a field is of, and returns the bytes of its default where none was given. */
export function customZero(reader) {
  const of = reader.u8(), count = reader.u16(), name = reader.text();
  const {head, size} = customHead(of, count, name), bytes = new Uint8Array(head + size);
  bytes.set([of, count & 255, count >> 8, name.length]);
  bytes.set(new TextEncoder().encode(name), 4);
  return bytes;
}
export const isCustom = (type) => type >> 1 === kCustom;

/** Makes a value of the bytes from readHashBytes. */
export function valueOf(type, bytes) {
  const k = type >> 1, layout = LAYOUT[k];
  if (layout) {
    const numbers = aligned(bytes, layout[1]);
    if (k === kBool) return type % 2 ? Array.from(numbers, Boolean) : numbers[0] === 1;
    return type % 2 ? numbers : sf(numbers);
  }
  const one = (part) => k === kString ? utf8.decode(part) : k === kCustom ? customOf(part) : Array.from(aligned(part, 'i32'));
  if (type % 2 === 0) return k === kCustom && bytes.length === 0 ? null : one(bytes);
  const result = [];
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  for (let at = 0; at < bytes.length;) {
    const size = Number(view.getBigUint64(at, true));
    result.push(one(bytes.subarray(at + 8, at + 8 + size)));
    at += 8 + size;
  }
  return k === kCustom ? result.flat() : result;
}

/** Makes the bytes of a value, for defaults that are not given. */
export function zeroBytes(type) {
  const value = zero(type);
  if (type % 2 || typeof value === 'string' || type >> 1 === kImage || type >> 1 === kCustom) return new Uint8Array(0);
  const numbers = ARRAY[LAYOUT[type >> 1][1]].from(Array.isArray(value) ? value : [Number(value)]);
  return new Uint8Array(numbers.buffer);
}
