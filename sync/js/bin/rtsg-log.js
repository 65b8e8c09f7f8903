#!/usr/bin/env node
// rtsg-log LOG: reads a log, verifies every state, and prints a summary as JSON; with --dump all of the last state.
import {readFileSync} from 'node:fs';
import {Replay} from '../src/index.js';

const [file, option] = process.argv.slice(2);
if (!file || (option && option !== '--dump')) {
  console.error('usage: rtsg-log LOG [--dump]');
  process.exit(2);
}
let bytes;
try {
  bytes = readFileSync(file);
} catch (error) {
  console.error(`${file}: ${error.message}`);
  process.exit(1);
}
const replay = new Replay(new Uint8Array(bytes));
let first = null;
for (let record = replay.step(); record; record = replay.step()) if (!replay.equal && first === null) first = record.to;
const {scene, states, verified, gaps, damage, closed, goesOn, unclosedSessions} = replay;
console.log(JSON.stringify({states, verified, first_divergence: first, gaps, damage, closed,
  goes_on: goesOn,  unclosed_sessions: unclosedSessions, state: scene.state, t: scene.time, hash: scene.hash.hex(), nodes: scene.nodes.size - 1}));
if (option) console.log(JSON.stringify(scene.dump(), null, 1));
process.exit(states > 0 && verified === states && gaps === 0 && damage.length === 0 && closed && unclosedSessions === 0 ? 0 : 1);
