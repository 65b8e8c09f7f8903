// The package as `npm pack` makes it, used from an empty folder: its version, its tables, its command and its types.
import assert from 'node:assert/strict';
import {execFileSync, spawn, spawnSync} from 'node:child_process';
import {cpSync, existsSync, mkdirSync, mkdtempSync, readFileSync, rmSync, symlinkSync, writeFileSync} from 'node:fs';
import {get} from 'node:http';
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
  for (const name of ['hash-wasm', 'three', '@types'])
    if (existsSync(path.join(here, 'node_modules', name))) symlinkSync(path.join(here, 'node_modules', name), path.join(modules, name));
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

test('it shows a scene by three.js, which one who does not need it need not have', (t) => {
  assert.equal(about.peerDependenciesMeta.three.optional, true);
  if (!existsSync(path.join(here, 'node_modules/three'))) return t.skip('no three.js here (npm install)');
  writeFileSync(path.join(used, 'three.js'), `
import {readFileSync} from 'node:fs';
import {Replay} from 'rtsg';
import {Replica} from 'rtsg/three';
const replay = new Replay(new Uint8Array(readFileSync(process.argv[2])));
const replica = new Replica(replay.scene, {onTrouble: () => {}});
while (replay.step());
console.log(replica.isGroup, replica.objects.size > 0, replay.equal);
`);
  const done = spawnSync(process.execPath, ['three.js', path.join(root, 'tests/sync/conformance/scene.rlog')], {cwd: used, encoding: 'utf8'});
  assert.equal(done.stderr, '');
  assert.equal(done.stdout, 'true true true\n');
});

test('the page of the example is short, and its command serves the folder it is in alone', async () => {
  const example = readFileSync(path.join(used, 'node_modules/rtsg/examples/three.html'), 'utf8');
  assert.ok(example.split('\n').length <= 31, 'a page of 30 lines');
  const command = path.join(used, 'node_modules/rtsg', about.bin['rtsg-page']);
  assert.equal(spawnSync(process.execPath, [command, used], {encoding: 'utf8'}).status, 2);
  writeFileSync(path.join(folder, 'secret.txt'), 'secret');
  writeFileSync(path.join(used, 'index.html'), 'mine');
  const child = spawn(process.execPath, [command, used, 'localhost:1'], {stdio: ['ignore', 'pipe', 'inherit']});
  try {
    const url = new URL(await new Promise((done) => child.stdout.once('data', (text) => done(`${text}`.trim()))));
    /** The answer to a path as it stands; URLs of fetch() lose their dots. */
    const ask = (target) => new Promise((done, failed) => get({host: url.hostname, port: url.port, path: target}, (answer) => {
      let text = '';
      answer.on('data', (part) => { text += part; }).on('end', () => done([answer.statusCode, text]));
    }).on('error', failed));
    assert.deepEqual(await ask('/'), [200, 'mine']);
    assert.deepEqual((await ask('/picture/1/0'))[0], 502);  // nobody serves there
    for (const outside of ['/../secret.txt', '/%2e%2e/secret.txt', '/..%2fsecret.txt', '/%00', '/%', '/nothing'])
      assert.deepEqual((await ask(outside))[0], 404, outside);
  } finally {
    child.kill();
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
  if (existsSync(path.join(here, 'node_modules/@types/three'))) {
    const shown = compile(`
import {PerspectiveCamera, Scene as World} from 'three';
import {Replay} from 'rtsg';
import {Replica} from 'rtsg/three';
const replica = new Replica(new Replay(new Uint8Array()).scene, {pictureUrl: (id, index) => \`\${id}/\${index}\`, batch: 8});
const camera = new PerspectiveCamera();
new World().add(replica);
const bound: number = replica.look(camera, 1.5, replica.viewpoints()[0]?.id);
replica.update(camera);
for (const object of replica.objects.get(bound) ?? []) console.log(object.name, object.userData.id);
replica.dispose();
`);
    assert.equal(shown.status, 0, shown.stdout);
    assert.match(compile(`
import {Replica} from 'rtsg/three';
new Replica().rebuilt();
`).stdout, /mine\.ts\(3,/);
  }
  const wrong = compile(`
import {Replay} from 'rtsg';
new Replay('session.rlog').stepp();
`);
  assert.match(wrong.stdout, /mine\.ts\(3,12\)[^]*stepp/);
});
