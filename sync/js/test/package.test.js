// The package as `npm pack` makes it, used from an empty folder: its version, its tables, its command and its types.
import assert from 'node:assert/strict';
import {execFileSync, spawnSync} from 'node:child_process';
import {cpSync, existsSync, mkdirSync, mkdtempSync, readFileSync, rmSync, symlinkSync, writeFileSync} from 'node:fs';
import {tmpdir} from 'node:os';
import path from 'node:path';
import {after, before, test} from 'node:test';
import {fileURLToPath} from 'node:url';

import * as all from '../src/index.js';

const here = fileURLToPath(new URL('..', import.meta.url)), root = path.join(here, '../..');
const about = JSON.parse(readFileSync(path.join(here, 'package.json'), 'utf8'));
const npm = (words, cwd) => execFileSync('npm', [...words, '--offline', '--no-audit', '--no-fund', '--silent'], {cwd, encoding: 'utf8'});
let folder, used;

before(() => {
  // Packed from a copy, as packing writes the tables beside the sources.
  folder = mkdtempSync(path.join(tmpdir(), 'rtsg-'));
  mkdirSync(path.join(folder, 'sync/js'), {recursive: true});
  for (const name of ['catalogue.bin', 'words.bin']) cpSync(path.join(root, 'sync', name), path.join(folder, 'sync', name));
  for (const name of [...about.files, 'package.json'])
    if (existsSync(path.join(here, name))) cpSync(path.join(here, name), path.join(folder, 'sync/js', name), {recursive: true});
  const packed = npm(['pack', '--pack-destination', folder], path.join(folder, 'sync/js')).trim().split('\n').at(-1);
  used = path.join(folder, 'used');
  const modules = path.join(used, 'node_modules');
  mkdirSync(path.join(modules, 'rtsg'), {recursive: true});
  execFileSync('tar', ['-xzf', path.join(folder, packed), '-C', path.join(modules, 'rtsg'), '--strip-components', '1']);
  symlinkSync(path.join(here, 'node_modules/hash-wasm'), path.join(modules, 'hash-wasm'));
  writeFileSync(path.join(used, 'package.json'), '{"type": "module"}');
});
after(() => rmSync(folder, {recursive: true}));

test('it has the version of the project and may be published', () => {
  const project = /project\(rtsg VERSION ([\d.]+)/.exec(readFileSync(path.join(root, 'CMakeLists.txt'), 'utf8'))[1];
  assert.equal(about.version, project);
  assert.equal(about.private, undefined);
});

test('a scene file is read with the tables that it brings', () => {
  cpSync(path.join(root, 'tests/sync/conformance/document.rlog'), path.join(used, 'document.rtsgb'));
  const command = path.join(used, 'node_modules/rtsg', about.bin['rtsg-log']);
  for (const scene of ['document.rtsgb', path.join(root, 'tests/sync/conformance/scene.rlog')]) {
    const done = spawnSync(process.execPath, [command, scene], {cwd: used, encoding: 'utf8'});
    assert.equal(done.stderr, '');
    const {states, verified} = JSON.parse(done.stdout);
    assert.ok(states >= 1 && verified === states, done.stdout);
  }
});

test('its types are those of what it exports', (t) => {
  const types = readFileSync(path.join(here, 'types/index.d.ts'), 'utf8');
  const declared = [...types.matchAll(/^export (?:class|function) (\w+)/gm)].map((match) => match[1]);
  assert.deepEqual(declared.sort(), Object.keys(all).sort());
  for (const [name, made] of Object.entries(all)) {
    if (!made.prototype || !new RegExp(`^export class ${name}\\b`, 'm').test(types)) continue;
    const body = new RegExp(`^export class ${name}\\b[^]*?(?:^}|\\{\\}$)`, 'm').exec(types)[0];
    for (const [, method] of body.matchAll(/^ {2}(\w+)\(/gm)) assert.equal(typeof made.prototype[method], 'function', `${name}.${method}`);
  }
  const compiler = path.join(here, 'node_modules/typescript/bin/tsc');
  if (!existsSync(compiler)) return t.skip('no TypeScript here (npm install)');
  const compile = (text) => {
    writeFileSync(path.join(used, 'mine.ts'), text);
    return spawnSync(process.execPath, [compiler, '--strict', '--noEmit', '--target', 'es2022', '--module', 'nodenext', 'mine.ts'], {cwd: used, encoding: 'utf8'});
  };
  const right = compile(`
import {Node, Replay, Scene, followWebSocket, loadCatalogue, typeName} from 'rtsg';
const replay = new Replay(new Uint8Array());
const scene: Scene = replay.scene;
scene.listener = (changed) => { for (const one of changed) if (typeof one !== 'number') console.log(one.type.name); };
for (let record = replay.step(); record; record = replay.step()) console.log(record.time, replay.equal, scene.hash.hex());
const door: Node | undefined = scene.find('DOOR');
console.log(door?.get('rotation'), typeName(4));
const {mirror, close} = followWebSocket('ws://localhost:1', {onState: (record, equal) => console.log(record.to, equal), onConnection: (state) => console.log(state)});
mirror.submitEdits([{node: 3, field: 1, type: 24, value: [1, 2, 3]}]);
await loadCatalogue();
close();
`);
  assert.equal(right.status, 0, right.stdout);
  const wrong = compile(`
import {Replay} from 'rtsg';
new Replay('session.rlog').stepp();
`);
  assert.match(wrong.stdout, /mine\.ts\(3,12\)[^]*stepp/);
});
