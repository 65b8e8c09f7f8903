// Hashes that PROTOCOL.md and tests/core/scene/state_hash_test.cpp state. They must stay the same in both programs.
import assert from 'node:assert/strict';
import {test} from 'node:test';
import {Scene} from '../src/scene.js';
import {xxh64} from '../src/xxh3.js';
import {zeroBytes} from '../src/values.js';

const utf8 = new TextEncoder();
const halves = (x) => [Number(x & 0xFFFFFFFFn), Number(x >> 32n)];
const nameHash = (name) => halves(xxh64(utf8.encode(name)));
const SFVEC3F = 24, MFNODE = 13, SFFLOAT = 4;

function typeOf(name, fields) {
  return {name, nameHash: nameHash(name), fields: fields.map(([field, type, hidden]) =>
    ({name: field, type, key: nameHash(hidden ? `${field}\0` : field), defaultBytes: zeroBytes(type)}))};
}
const bytesOf = (...numbers) => new Uint8Array(Float32Array.from(numbers).buffer);

function exampleOf(rootFields, transformFields) {
  const scene = new Scene();
  const root = typeOf('RtsgScene', rootFields), transform = typeOf('Transform', transformFields);
  const at = (type, name) => type.fields.findIndex((f) => f.name === name);
  scene.defineType(0, root);
  scene.create(2, transform, 0);
  scene.setNodes(1, at(root, 'children'), Uint32Array.of(2));
  scene.setBytes(2, at(transform, 'translation'), SFVEC3F, bytesOf(1, 2, 3));
  scene.name(2, utf8.encode('A'));
  return scene;
}

test('the example of PROTOCOL.md has its hash, whatever other fields its types have', () => {
  const expected = 'f725bafa49fad5584f08f409851e47e5';
  assert.equal(exampleOf([['children', MFNODE]], [['translation', SFVEC3F]]).hash.hex(), expected);
  const later = exampleOf([['new', SFFLOAT], ['children', MFNODE]], [['wobble', SFFLOAT], ['spin', SFVEC3F], ['translation', SFVEC3F]]);
  assert.equal(later.hash.hex(), expected);
  later.setBytes(2, 0, SFFLOAT, bytesOf(1));
  assert.notEqual(later.hash.hex(), expected);
  later.setBytes(2, 0, SFFLOAT, bytesOf(0));
  assert.equal(later.hash.hex(), expected);
});

test('a route from one node is not that from its neighbour to a neighbouring field', () => {
  // Numbers in a term's seed and in its bytes must not compensate each other.
  const many = typeOf('Many', Array.from({length: 16}, (_, i) => [`in${i}`, SFVEC3F]));
  const hashOf = (from, field) => {
    const scene = new Scene();
    for (let id = 2; id < 40; ++id) scene.create(id, many, 0);
    scene.route(true, from, 0, 30, field, false);
    return scene.hash.hex();
  };
  const hashes = new Set();
  for (let from = 2; from < 20; ++from) for (let field = 0; field < 16; ++field) hashes.add(hashOf(from, field));
  assert.equal(hashes.size, 18 * 16);
});
