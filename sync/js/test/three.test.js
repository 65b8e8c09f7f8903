// rtsg/three without a picture: what follows changes is what is built from scratch, and a change touches what it is about.
import assert from 'node:assert/strict';
import {readFileSync, readdirSync} from 'node:fs';
import {test} from 'node:test';
import {fileURLToPath} from 'node:url';

import {Replay, Scene} from '../src/index.js';

const logs = fileURLToPath(new URL('../../../tests/sync/conformance/', import.meta.url));
let three = null;
try {
  three = {...await import('../three/index.js'), ...await import('./three_seen.js')};
} catch { /* not installed */ }
const options = {skip: three ? false : 'no three.js here (npm install)'};
const quiet = {onTrouble: () => {}};

for (const name of readdirSync(logs).filter((file) => file.endsWith('.rlog'))) {
  test(`following ${name} gives what is built from scratch`, options, () => {
    const replay = new Replay(new Uint8Array(readFileSync(logs + name))), replica = new three.Replica(replay.scene, {...quiet, batch: 2});
    try {
      for (let states = 0; replay.step(); ++states) {
        if (states % 5 && states > 20) continue;
        const {listener} = replay.scene, fresh = new three.Replica(replay.scene, {...quiet, batch: 2});
        assert.ok(three.seen(replica).join() === three.seen(fresh).join(), `state ${replay.scene.state}`);
        fresh.dispose();
        assert.equal(replay.scene.listener, listener);
        three.assertBatches(replica);
      }
    } catch (error) {
      if (error.name !== 'FormatError') throw error;  // a log that only its writer can run
    }
    replica.dispose();
    assert.equal(replica.resources.size, 0);
    assert.equal(replica.objects.size, 0);
  });
}

test('a texture that cannot be loaded is told, and another listener is called first', options, () => {
  const scene = new Scene(), told = [];
  scene.listener = (changed) => told.push(changed.length);
  const replica = new three.Replica(scene, quiet);
  scene.listener([]);
  assert.deepEqual(told, [0]);
  replica.dispose();
});

/** A node with these fields alone. */
const made = (name, fields) => ({id: 1, type: {name, fields: Object.keys(fields).map((field) => ({name: field}))}, get: (field) => fields[field]});

test('what counts more than there is takes no memory', options, async () => {
  const {arraysOf} = await import('../three/geometry.js'), {makeTexture} = await import('../three/material.js');
  const coordinate = made('Coordinate', {point: new Float32Array(12)}), child = (node, field) => field === 'coord' ? coordinate : null;
  const huge = Int32Array.of(2 ** 31 - 1, 2 ** 31 - 1);
  const more = {ccw: true, normalPerVertex: true, solid: true};
  assert.equal(arraysOf(made('TriangleStripSet', {stripCount: huge, ...more}), child).position.length, 2 * 9);
  assert.equal(arraysOf(made('TriangleFanSet', {fanCount: huge, ...more}), child).position.length, 2 * 9);
  assert.equal(arraysOf(made('LineSet', {vertexCount: huge}), child).position.length, 3 * 6);
  assert.equal(arraysOf(made('IndexedTriangleSet', {index: Int32Array.of(0, 1, 99), ...more}), child).position.length, 0);
  assert.equal(arraysOf(made('ElevationGrid', {xDimension: 2 ** 31 - 1, zDimension: 2 ** 31 - 1, xSpacing: 1, zSpacing: 1, height: new Float32Array(4)}), child).position.length, 0);
  assert.throws(() => arraysOf(made('Extrusion', {crossSection: new Float32Array(2 * 3000), spine: new Float32Array(3 * 3000), scale: [], orientation: []}), child), /9000000 points/);
  const {image} = makeTexture(made('PixelTexture', {image: [65535, 65535, 4, 255], repeatS: true, repeatT: true}), false, null, () => {});
  assert.deepEqual([image.width, image.height], [1, 1]);
});

test('normals are smooth within the crease angle, and around a point with many faces', options, async () => {
  const {arraysOf} = await import('../three/geometry.js');
  // Two squares that meet at a right angle along the y axis.
  const roof = made('Coordinate', {point: Float32Array.of(0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, -1, 0, 1, -1)});
  const two = (creaseAngle) => arraysOf(made('IndexedFaceSet', {coordIndex: Int32Array.of(0, 1, 2, 3, -1, 4, 0, 3, 5, -1), normalIndex: [], colorIndex: [], texCoordIndex: [],
    normalPerVertex: true, colorPerVertex: true, creaseAngle, convex: true, ccw: true}), (node, field) => field === 'coord' ? roof : null).normal;
  const first = (normals) => Array.from(normals.slice(0, 3), (x) => +x.toFixed(3));
  assert.deepEqual(first(two(1.5)), [0, 0, 1]);
  assert.deepEqual(first(two(1.6)), [-0.707, 0, 0.707]);
  const n = 20_000, fan = made('Coordinate', {point: Float32Array.from({length: 3 * (n + 1)}, (_, i) => i < 3 ? 0 : [Math.cos((i - i % 3) / 3 * 6.28 / n), Math.sin((i - i % 3) / 3 * 6.28 / n), 0][i % 3])});
  const {normal} = arraysOf(made('TriangleFanSet', {fanCount: Int32Array.of(n + 1), ccw: true, normalPerVertex: true}), (node, field) => field === 'coord' ? fan : null);
  assert.deepEqual(first(normal), [0, 0, 1]);
});
