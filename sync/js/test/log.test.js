// The command rtsg-log: what it prints of a log, and with which status it ends.
import assert from 'node:assert/strict';
import {spawnSync} from 'node:child_process';
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
