// The command rtsg-log: what it prints about a log, and its exit status.
import assert from 'node:assert/strict';
import {spawnSync} from 'node:child_process';
import {mkdtempSync, readFileSync, rmSync, writeFileSync} from 'node:fs';
import {tmpdir} from 'node:os';
import path from 'node:path';
import {test} from 'node:test';
import {fileURLToPath} from 'node:url';

const command = fileURLToPath(new URL('../bin/rtsg-log.js', import.meta.url));
const folder = new URL('../../../tests/sync/conformance/', import.meta.url);
const outcomeOf = (name) => {
  const {status, stdout} = spawnSync(process.execPath, [command, fileURLToPath(new URL(name, folder))], {encoding: 'utf8'});
  return {status, ...JSON.parse(stdout)};
};

test('a session within a log that was not closed is told, as rtsg replay --verify tells it', () => {
  const whole = outcomeOf('sessions.rlog'), unclosed = outcomeOf('unclosed.rlog');
  assert.equal(whole.status, 0);
  assert.equal(whole.unclosed_sessions, 0);
  assert.equal(unclosed.status, 1);
  assert.equal(unclosed.unclosed_sessions, 1);
  assert.equal(unclosed.closed, true);  // the last one was
  assert.equal(unclosed.verified, unclosed.states);
  assert.equal(unclosed.gaps, 0);
});

test('a piece that another one follows, or is to come before, has no good status', () => {
  const whole = outcomeOf('pieces.rlog'), cut = outcomeOf('pieces_cut.rlog'), mixed = outcomeOf('pieces_mixed.rlog');
  assert.deepEqual([whole.status, whole.closed, whole.goes_on, whole.unclosed_sessions], [0, true, false, 0]);
  assert.deepEqual([cut.status, cut.closed, cut.goes_on, cut.unclosed_sessions], [1, false, true, 0]);
  assert.deepEqual([mixed.status, mixed.closed, mixed.goes_on, mixed.unclosed_sessions], [1, true, false, 2]);
});

test('a log that ends without having been closed has no good status', () => {
  const scratch = mkdtempSync(path.join(tmpdir(), 'rtsg-'));
  try {
    const bytes = readFileSync(new URL('raw.rlog', folder)), file = path.join(scratch, 'cut.rlog');
    writeFileSync(file, bytes.subarray(0, bytes.lastIndexOf('RTSGrec1')));  // at a record's boundary, so nothing is damaged
    const {status, stdout} = spawnSync(process.execPath, [command, file], {encoding: 'utf8'});
    const outcome = JSON.parse(stdout);
    assert.equal(outcomeOf('raw.rlog').closed, true);
    assert.equal(outcome.closed, false);
    assert.equal(outcome.damage.length, 0);
    assert.equal(outcome.verified, outcome.states);
    assert.equal(status, 1);
  } finally {
    rmSync(scratch, {recursive: true});
  }
});

test('a file that is not there is told in one line', () => {
  const {status, stderr} = spawnSync(process.execPath, [command, '/nowhere.rlog'], {encoding: 'utf8'});
  assert.equal(status, 1);
  assert.match(stderr, /^\/nowhere.rlog: .*ENOENT.*\n$/);
});
