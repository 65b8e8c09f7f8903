// rtsg/three in a headless Chromium: the example's page follows a server and opens a door there, and pictures of logs look as rtsg's do.
//
// Exit status 0: all well; 1: a check failed; 77: skipped, with the reason, where Chromium or the packages of `./dev web` are not there.
// Usage: three_test.mjs --program build/rtsg [--measure] [--shot DIR]. --measure prints, in place of the checks, what a picture and a state
// of 1,000 moving nodes take; the rate is that of the machine, which has no GPU if Chromium says SwiftShader.
import assert from 'node:assert/strict';
import {execFileSync, spawn} from 'node:child_process';
import {copyFileSync, existsSync, mkdirSync, mkdtempSync, readFileSync, rmSync, symlinkSync, writeFileSync} from 'node:fs';
import {createRequire} from 'node:module';
import {tmpdir} from 'node:os';
import path from 'node:path';
import {fileURLToPath} from 'node:url';

import {measure} from '../compare/measure.mjs';

const here = path.dirname(fileURLToPath(import.meta.url)), js = path.join(here, '../../sync/js');
const given = (name) => process.argv[process.argv.indexOf(name) + 1];
const program = path.resolve(given('--program')), shots = process.argv.includes('--shot') ? given('--shot') : null;
const kPatience = 180_000, kWidth = 480, kHeight = 360;

function skip(why) {
  console.log(`SKIPPED: ${why}`);
  process.exit(77);
}
const chromium = ['/usr/bin/chromium', '/usr/bin/chromium-browser'].find(existsSync);
if (!chromium) skip('needs Chromium (apt install chromium)');
if (!existsSync(path.join(js, 'node_modules/three'))) skip('needs the packages that ./dev web fetches');
const playwright = createRequire(path.join(js, 'package.json'))('playwright-core');

// A folder as a user has it: the example's page, and the packages.
const folder = mkdtempSync(path.join(tmpdir(), 'rtsg-three-')), modules = path.join(folder, 'node_modules');
mkdirSync(modules);
for (const name of ['three', 'hash-wasm']) symlinkSync(path.join(js, 'node_modules', name), path.join(modules, name));
symlinkSync(js, path.join(modules, 'rtsg'));
copyFileSync(path.join(js, 'examples/three.html'), path.join(folder, 'index.html'));
writeFileSync(path.join(folder, 'log.html'), readFileSync(path.join(folder, 'index.html'), 'utf8').replace(/<script type="module">[^]*<\/script>/, ''));

const running = [];
/** Starts a program; resolves with what `ready` finds in its output. */
function start(command, args, ready) {
  const child = spawn(command, args, {stdio: ['ignore', 'pipe', 'inherit']});
  running.push(child);
  let out = '';
  return new Promise((done, failed) => {
    child.stdout.on('data', (text) => {
      out += text;
      const found = ready.exec(out);
      if (found) done(found[1]);
    });
    child.on('exit', (status) => failed(new Error(`${command} ended with ${status}`)));
  });
}
const browser = await playwright.chromium.launch({executablePath: chromium, headless: true,
  args: ['--headless', '--no-sandbox', '--disable-gpu', '--no-first-run', '--enable-unsafe-swiftshader']});
async function open(url) {
  const page = await browser.newPage({viewport: {width: kWidth, height: kHeight}});
  page.errors = [];
  page.on('pageerror', (error) => page.errors.push(error.stack ?? `${error}`));
  page.setDefaultTimeout(kPatience);
  await page.goto(url);
  return page;
}
async function eventually(what, condition) {
  for (const end = Date.now() + kPatience; !(await condition());) {
    if (Date.now() > end) assert.fail(`never: ${what}`);
    await new Promise((done) => setTimeout(done, 200));
  }
}
/** How many pixels of a picture are redder than all else. */
async function red(page) {
  const png = (await page.locator('canvas').screenshot()).toString('base64');
  return page.evaluate(async (data) => {
    const image = new Image();
    image.src = `data:image/png;base64,${data}`;
    await image.decode();
    const context = Object.assign(document.createElement('canvas'), {width: image.width, height: image.height}).getContext('2d');
    context.drawImage(image, 0, 0);
    const {data: p} = context.getImageData(0, 0, image.width, image.height);
    let found = 0;
    for (let i = 0; i < p.length; i += 4) if (p[i] > 40 && p[i] > 2 * Math.max(p[i + 1], p[i + 2])) ++found;
    return found;
  }, png);
}

/** Plays a log to its end in a page, and leaves `replay`, `replica` and `draw` there. */
async function play(page, log) {
  copyFileSync(log, path.join(folder, 'played.rlog'));
  await page.evaluate(async ([width, height]) => {
    const THREE = await import('three'), {Replay} = await import('rtsg'), {Replica} = await import('rtsg/three');
    const replay = new Replay(new Uint8Array(await (await fetch('played.rlog')).arrayBuffer()));
    replay.step();
    const world = new THREE.Scene(), replica = new Replica(replay.scene);
    while (replay.step()) if (!replay.equal) throw new Error(`state ${replay.scene.state} differs`);
    world.add(replica);
    const camera = new THREE.PerspectiveCamera(45, 1, 0.1, 1000), renderer = new THREE.WebGLRenderer({antialias: true, preserveDrawingBuffer: true});
    renderer.setSize(width, height);
    document.body.append(renderer.domElement);
    const draw = () => {
      replica.look(camera, width / height);
      replica.update(camera);
      renderer.render(world, camera);
    };
    Object.assign(window, {THREE, replay, replica, renderer, draw});
    draw();
  }, [kWidth, kHeight]);
}

const cases = {
  async 'the page of the example follows, and its pointer opens the door at the origin'(site) {
    const server = await start(program, ['serve', '--json', path.join(here, 'door.x3dv'), '--web', '0', '--upstream', 'events'], /"web":"http:\/\/([^/"]+)/);
    const page = await open(await start(process.execPath, [path.join(js, 'bin/rtsg-page.js'), folder, server], /(http:\S+)/));
    await eventually('the door is seen, red', async () => await red(page) > 0.03 * kWidth * kHeight);
    const closed = await red(page), box = await page.locator('canvas').boundingBox();
    await eventually('the door is open', async () => {
      await page.mouse.click(box.x + box.width / 2, box.y + box.height / 2, {delay: 150});
      return Math.abs(await red(page) - closed) > 0.2 * closed;
    });
    assert.deepEqual(page.errors, []);
    await page.close();
  },
  async 'what follows edits of all kinds is what is built from scratch'() {
    const {Replay} = await import('../../sync/js/src/index.js'), {Replica} = await import('../../sync/js/three/index.js');
    const {assertBatches, seen} = await import('../../sync/js/test/three_seen.js');
    const log = path.join(folder, 'edited.rlog'), quiet = {onTrouble() {}, batch: 2};
    const edits = ['CHOICE.whichChoice=1@0.1', 'CHOICE.whichChoice=0@0.3', 'RED.translation=0 0 1@0.1', 'RED.scale=1 2 -1@0.2', 'PAINT.diffuseColor=0 1 0@0.2', 'PAINT.transparency=0.5@0.3',
      'PLACES.point=[ 0 0 0 1 0 0 1 1 0 0 1 0 ]@0.4', 'SHAPE.visible=FALSE@0.2', 'SHAPE.visible=TRUE@0.4', 'RED.visible=FALSE@0.3', 'RED.visible=TRUE@0.5', 'LAMP.intensity=0.2@0.3', 'LAMP.on=FALSE@0.4',
      'TINTS.color=[ 0 1 0 1 1 0 ]@0.2', 'CUT.scale=3 3@0.2'];
    execFileSync(program, ['record', path.join(here, 'shapes.x3dv'), '-o', log, '--for', '0.7s', '--fps', '20', '--force', ...edits.flatMap((edit) => ['--set', edit])], {stdio: 'ignore'});
    const replay = new Replay(new Uint8Array(readFileSync(log))), replica = new Replica(replay.scene, quiet), different = new Set();
    while (replay.step()) {
      const fresh = new Replica(replay.scene, quiet);
      assert.ok(seen(replica).join() === seen(fresh).join(), `state ${replay.scene.state}`);
      fresh.dispose();
      assertBatches(replica);
      different.add(seen(replica).join());
    }
    assert.ok(different.size >= 6, `${different.size} different states`);
    replica.dispose();
    assert.equal(replica.resources.size + replica.objects.size, 0);
  },
  async 'pictures look as those of rtsg'(site) {
    for (const [scene, least] of [['shapes', 0.95], ['../../examples/door', 0.95], ['../../examples/room', 0.95]]) {
      const file = path.join(here, `${scene}.x3dv`), log = path.join(folder, 'made.rlog'), png = path.join(folder, 'ours.png');
      execFileSync(program, ['record', file, '-o', log, '--for', '0.05s', '--fps', '20', '--force'], {stdio: 'ignore'});
      execFileSync(program, ['render', file, '-o', png, '--size', `${kWidth}x${kHeight}`, '--spp', '4', '--shadows', 'authored', '--depth', '0'], {stdio: 'ignore'});
      const page = await open(`${site}log.html`);
      await play(page, log);
      const theirs = await page.locator('canvas').screenshot(), ours = readFileSync(png);
      if (shots) writeFileSync(path.join(shots, `${path.basename(scene)}-three.png`), theirs);
      const [a, b] = [ours, theirs].map((bytes) => bytes.toString('base64')).map((whole) => ({whole, black: whole, white: whole}));
      const {ssim, difference} = await page.evaluate(measure, {a, b});
      console.log(`${path.basename(scene)}: SSIM ${ssim.toFixed(3)}, mean difference ${difference.toFixed(1)} of 255`);
      assert.ok(ssim >= least, `${scene}: SSIM ${ssim}`);
      assert.deepEqual(page.errors, []);
      await page.close();
    }
  },
};

/** 1,000 nodes, each of which moves in each state, in a log: milliseconds of a state and of a picture, and pictures a second. */
async function measureMoving(site) {
  const scene = path.join(folder, 'moving.x3dv'), log = path.join(folder, 'moving.rlog'), n = 1000;
  const one = (i) => `DEF T${i} Transform { translation ${i % 40 - 20} ${Math.floor(i / 40) - 12} 0 children ${i ? 'USE BALL' : 'DEF BALL Shape { appearance Appearance { material Material { } } geometry Box { size 0.6 0.6 0.6 } }'} }
DEF P${i} PositionInterpolator { key [ 0 0.5 1 ] keyValue [ ${i % 40 - 20} ${Math.floor(i / 40) - 12} 0, ${i % 40 - 20} ${Math.floor(i / 40) - 12} ${1 + i % 3}, ${i % 40 - 20} ${Math.floor(i / 40) - 12} 0 ] }
ROUTE CLOCK.fraction_changed TO P${i}.set_fraction
ROUTE P${i}.value_changed TO T${i}.translation
`;
  writeFileSync(scene, `#X3D V4.0 utf8\nViewpoint { position 0 0 60 }\nDEF CLOCK TimeSensor { loop TRUE cycleInterval 2 }\n${Array.from({length: n}, (_, i) => one(i)).join('')}`);
  execFileSync(program, ['record', scene, '-o', log, '--for', '3s', '--fps', '60', '--force'], {stdio: 'ignore'});
  for (const batch of [16, Infinity]) {
    const page = await open(`${site}log.html`);
    copyFileSync(log, path.join(folder, 'played.rlog'));
    console.log(JSON.stringify(await page.evaluate(async ([batch, width, height]) => {
      const THREE = await import('three'), {Replay} = await import('rtsg'), {Replica} = await import('rtsg/three');
      const replay = new Replay(new Uint8Array(await (await fetch('played.rlog')).arrayBuffer()));
      replay.step();
      const world = new THREE.Scene(), replica = new Replica(replay.scene, {batch}), camera = new THREE.PerspectiveCamera(45, 1, 0.1, 1000);
      const renderer = new THREE.WebGLRenderer({antialias: false});
      renderer.setSize(width, height);
      document.body.append(renderer.domElement);
      world.add(replica);
      const spent = {state: 0, picture: 0}, begun = performance.now();
      let count = 0;
      await new Promise((done) => renderer.setAnimationLoop(() => {
        const start = performance.now(), more = replay.step();
        if (!more) return done();
        const middle = performance.now();
        replica.look(camera, width / height);
        replica.update(camera);
        renderer.render(world, camera);
        spent.state += middle - start;
        spent.picture += performance.now() - middle;
        ++count;
      }));
      const seconds = (performance.now() - begun) / 1000, gl = renderer.getContext(), info = gl.getExtension('WEBGL_debug_renderer_info');
      return {moving: replica.objects.size, batch, states: count, equal: replay.verified, pictures_per_s: +(count / seconds).toFixed(1), state_ms: +(spent.state / count).toFixed(2),
        picture_ms: +(spent.picture / count).toFixed(2), calls: renderer.info.render.calls, renderer: info ? gl.getParameter(info.UNMASKED_RENDERER_WEBGL) : ''};
    }, [batch, kWidth, kHeight])));
    await page.close();
  }
}

let failed = 0;
try {
  const site = await start(process.execPath, [path.join(js, 'bin/rtsg-page.js'), folder, 'localhost:1'], /(http:\S+)/);
  if (process.argv.includes('--measure')) await measureMoving(site);
  else {
    for (const [name, run] of Object.entries(cases)) {
      try {
        await run(site);
        console.log(`ok      ${name}`);
      } catch (error) {
        ++failed;
        console.log(`FAILED  ${name}: ${error.stack}`);
      }
    }
  }
} finally {
  for (const child of running) child.kill('SIGINT');
  await browser.close();
  rmSync(folder, {recursive: true, force: true});
}
process.exit(failed ? 1 : 0);
