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
