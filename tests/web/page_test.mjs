// The page of `rtsg serve --web` in a headless Chromium: it follows with equal hashes, shows what it follows, lists viewpoints,
// opens a door at the origin, comes back after a cut, plays a log, and is readable on a phone.
//
// Exit status 0: all well; 1: a check failed; 77: skipped, with the reason, where Chromium or the packages of `./dev web` are
// not there. Usage: page_test.mjs --program build/rtsg [--shot DIR]
import assert from 'node:assert/strict';
import {spawn} from 'node:child_process';
import {existsSync, mkdtempSync, rmSync} from 'node:fs';
import {createRequire} from 'node:module';
import {tmpdir} from 'node:os';
import path from 'node:path';
import {fileURLToPath} from 'node:url';

const here = path.dirname(fileURLToPath(import.meta.url)), root = path.join(here, '../..');
const given = (name) => process.argv[process.argv.indexOf(name) + 1];
const program = path.resolve(given('--program')), shots = process.argv.includes('--shot') ? given('--shot') : null;

function skip(why) {
  console.log(`SKIPPED: ${why}`);
  process.exit(77);
}
const chromium = ['/usr/bin/chromium', '/usr/bin/chromium-browser'].find(existsSync);
if (!chromium) skip('needs Chromium (apt install chromium)');
const require = createRequire(path.join(root, 'sync/js/package.json'));
let playwright;
try {
  if (!existsSync(path.join(root, 'sync/js/node_modules/x_ite/dist/x_ite.min.mjs'))) throw new Error();
  playwright = require('playwright-core');
} catch {
  skip('needs the packages that ./dev web fetches');
}

const scratch = mkdtempSync(path.join(tmpdir(), 'rtsg-page-'));
const running = new Set();

/** `rtsg serve` with these arguments; resolves with its first line as JSON. */
function serve(...args) {
  const child = spawn(program, ['serve', '--json', ...args], {cwd: scratch, stdio: ['ignore', 'pipe', 'pipe']});
  running.add(child);
  let out = '', err = '';
  child.stderr.on('data', (text) => { err += text; });
  const ended = new Promise((done) => child.on('exit', (status) => { running.delete(child); done(status); }));
  return new Promise((done, failed) => {
    child.stdout.on('data', (text) => {
      out += text;
      if (out.includes('\n')) done({...JSON.parse(out.split('\n')[0]), child, ended, get err() { return err; }});
    });
    ended.then((status) => failed(new Error(`rtsg serve ended with ${status}: ${err}`)));
  });
}
async function stop(server, signal = 'SIGINT') {
  server.child.kill(signal);
  return server.ended;
}

const args = ['--headless', '--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run', '--disable-background-networking',
  '--disable-component-update', '--disable-sync', '--enable-unsafe-swiftshader'];
const browser = await playwright.chromium.launchPersistentContext(path.join(scratch, 'profile'),
  {executablePath: chromium, args, headless: true, viewport: {width: 320, height: 320}});
const kPatience = 180_000;  // a machine without a GPU, and busy besides; only a failing test waits this long

async function open(url, {width = 320, height = 320, quality = 'low', picture = true} = {}) {
  const page = await browser.newPage();
  page.errors = [];
  page.on('pageerror', (error) => page.errors.push(error.stack ?? `${error}`));
  page.setDefaultTimeout(kPatience);
  await page.setViewportSize({width, height});
  await page.goto(`${url}${url.includes('#') ? '&' : '#'}quality=${quality}`);
  if (picture) await page.waitForSelector('#picture[data-ready=true]');
  return page;
}
const until = (page, condition, value) => page.waitForFunction(condition, value, {timeout: kPatience});
/** Share of the picture's pixels of which `test` (a function's text, of r, g, b) is true. */
async function share(page, test) {
  const png = (await page.locator('#picture').screenshot()).toString('base64');
  return page.evaluate(async ([data, text]) => {
    const image = new Image();
    image.src = `data:image/png;base64,${data}`;
    await image.decode();
    const canvas = document.createElement('canvas');
    [canvas.width, canvas.height] = [image.width, image.height];
    const context = canvas.getContext('2d');
    context.drawImage(image, 0, 0);
    const {data: p} = context.getImageData(0, 0, image.width, image.height);
    const [kind, limit] = text;
    let found = 0;
    for (let i = 0; i < p.length; i += 4) {
      const [r, g, b] = [p[i], p[i + 1], p[i + 2]];
      if (kind === 'red' ? r > limit * Math.max(g, b) && r > 40 : kind === 'green' ? g > limit * Math.max(r, b) && g > 60 : b > limit * r && b > g + 60) ++found;
    }
    return 4 * found / p.length;
  }, [png, test]);
}
async function eventually(what, condition) {
  const end = Date.now() + kPatience;
  while (!(await condition())) {
    if (Date.now() > end) assert.fail(`never: ${what}`);
    await new Promise((done) => setTimeout(done, 100));
  }
}
const counts = (page) => page.evaluate(() => ({...rtsg.mirror.count, state: rtsg.mirror.scene.state, shown: document.getElementById('state').textContent,
  equal: document.getElementById('equality').dataset.equal, hash: document.getElementById('hash').textContent}));
function allEqual(c) {
  assert.equal(c.unequal, 0);
  assert.equal(c.equal, 'true');
  assert.match(c.hash, /^[0-9a-f]{32}$/);
  assert.equal(c.garbage, 0);
}

const door = path.join(here, 'door.x3dv');
const cases = {
  async 'follows, shows and compares'() {
    const server = await serve(door, '--web', '0');
    const page = await open(server.web);
    await until(page, () => rtsg.mirror.count.states > 30);
    await eventually('the door is seen, red', async () => await share(page, ['red', 2]) > 0.03);
    await eventually('the lamp is seen, green, as its PROTO says', async () => await share(page, ['green', 2]) > 0.005);
    await eventually('the sign has its picture, blue in part', async () => await share(page, ['blue', 2]) > 0.002);
    allEqual(await counts(page));
    assert.deepEqual(await page.locator('#viewpoints option').allTextContents(), ['as the origin', 'In front', 'From aside']);
    if (shots) await page.screenshot({path: path.join(shots, 'door.png')});
    assert.deepEqual(page.errors, []);
    await page.close();
    assert.equal(await stop(server), 0, server.err);
  },
  async 'a viewpoint may be chosen here alone'() {
    const server = await serve(door, '--web', '0');
    const page = await open(server.web);
    await eventually('seen from the front', async () => await share(page, ['red', 2]) > 0.03);
    const before = await share(page, ['red', 2]);
    await page.selectOption('#viewpoints', {label: 'From aside'});
    await eventually('seen from aside', async () => Math.abs(await share(page, ['red', 2]) - before) > 0.01);
    allEqual(await counts(page));
    assert.deepEqual(page.errors, []);
    await page.close();
    await stop(server);
  },
  async 'a pointer opens the door at the origin'() {
    const server = await serve(door, '--web', '0', '--upstream', 'events');
    const page = await open(server.web);
    await eventually('the door is seen', async () => await share(page, ['red', 2]) > 0.03);
    const angle = () => page.evaluate(() => Math.abs(rtsg.mirror.scene.find('DOOR').get('rotation')[3]));
    assert.equal(await angle(), 0);
    const box = await page.locator('#picture').boundingBox();
    await eventually('the door is open', async () => {
      if (await angle() > 1.4) return true;
      if (await angle() === 0) await page.mouse.click(box.x + box.width / 2, box.y + box.height / 2, {delay: 150});
      await page.waitForTimeout(500);
      return false;
    });
    allEqual(await counts(page));
    assert.deepEqual(page.errors, []);
    await page.close();
    await stop(server);
  },
  async 'a server that takes no requests says so'() {
    const server = await serve(door, '--web', '0');
    const page = await open(server.web, {picture: false});
    await until(page, () => rtsg.mirror.count.states > 3);
    await page.evaluate(() => rtsg.mirror.submitEvents([{node: rtsg.mirror.scene.names.get('DOOR'), field: 0, type: 8, value: 1}]));
    await until(page, () => document.getElementById('said').textContent.includes('may only follow'));
    await page.close();
    await stop(server);
  },
  async 'comes back after a cut without a snapshot, and after another run with one'() {
    const log = path.join(scratch, 'session.rlog');
    const server = await serve(door, '--web', '0', '--record', log);
    const page = await open(server.web);
    await until(page, () => rtsg.mirror.count.states > 10);
    await page.evaluate(() => rtsg.follower.cut());
    await until(page, () => rtsg.mirror.count.resumed === 1 && rtsg.mirror.connected);
    const {state, keyframes} = await counts(page);
    assert.equal(keyframes, 1);
    await until(page, (before) => rtsg.mirror.scene.state > before + 5, state);
    const port = new URL(server.web).port;
    await stop(server, 'SIGKILL');
    await until(page, () => !rtsg.mirror.connected);
    assert.equal(await page.locator('#connection').getAttribute('data-state') === 'following', false);
    const next = await serve('--resume', log, '--web', port);
    await until(page, () => rtsg.mirror.connected);
    const after = await counts(page);
    await until(page, (before) => rtsg.mirror.scene.state > before + 5, after.state);
    allEqual(await counts(page));
    await stop(next);
    await until(page, () => document.getElementById('connection').dataset.state === 'left');
    const other = await serve(door, '--web', port);
    await until(page, () => document.getElementById('connection').dataset.state === 'following' && rtsg.mirror.count.keyframes > 1);
    allEqual(await counts(page));
    assert.deepEqual(page.errors, []);
    await page.close();
    await stop(other);
    // And then the log itself, with its time line.
    const player = await serve(log, '--web', '0', '--upstream', 'events', '--loop');
    const playing = await open(player.web);
    await playing.waitForSelector('#player:not([hidden])');
    await until(playing, () => rtsg.mirror.count.states > 3);
    await playing.click('#play');
    await until(playing, () => document.getElementById('play').textContent === 'Play');
    await playing.evaluate(() => { const line = document.getElementById('line'); line.value = 0.1; line.onchange(); });
    await until(playing, () => rtsg.mirror.connected && Math.abs(Number(document.getElementById('line').value) - 0.1) < 0.06);
    allEqual(await counts(playing));
    assert.deepEqual(playing.errors, []);
    await playing.close();
    await stop(player);
  },
  async 'beyond this machine only who knows the token'() {
    const server = await serve(door, '--web', '0.0.0.0:0');
    assert.match(server.web, /#token=[0-9a-f]{32}$/);
    const without = await open(server.web.replace(/#.*/, ''), {picture: false});
    await until(without, () => document.getElementById('connection').textContent.includes('token'));
    assert.equal((await counts(without)).states, 0);
    await without.close();
    const page = await open(server.web);
    await until(page, () => rtsg.mirror.count.states > 3);
    await eventually('the picture comes too', async () => await share(page, ['blue', 2]) > 0.002);
    await page.close();
    await stop(server);
  },
  async 'the demo on a phone'() {
    const server = await serve(path.join(root, 'examples/demo/hall.x3dv'), '--web', '0');
    const page = await open(server.web, {width: 390, height: 700});
    await until(page, () => rtsg.mirror.count.states > 20);
    allEqual(await counts(page));
    const {width, overflow} = await page.evaluate(() => ({width: innerWidth,
      overflow: [...document.querySelectorAll('body *')].filter((e) => e.getBoundingClientRect().right > innerWidth + 1).map((e) => e.id || e.tagName)}));
    assert.equal(width, 390);
    assert.deepEqual(overflow, []);
    assert.ok(await page.evaluate(() => document.getElementById('viewpoints').getBoundingClientRect().height) >= 44);
    if (shots) {
      await page.waitForTimeout(3000);
      await page.screenshot({path: path.join(shots, 'phone.png')});
    }
    assert.deepEqual(page.errors, []);
    await page.close();
    await stop(server);
  },
};

let failures = 0;
const only = process.argv.includes('--only') ? given('--only') : '';
try {
  for (const [name, run] of Object.entries(cases)) {
    if (!name.includes(only)) continue;
    const start = Date.now();
    try {
      await run();
      console.log(`ok      ${name} (${((Date.now() - start) / 1000).toFixed(1)} s)`);
    } catch (error) {
      ++failures;
      console.log(`FAILED  ${name}: ${error.stack ?? error}`);
      for (const page of browser.pages()) {
        if (page.errors?.length) console.log(page.errors.join('\n'));
        if (shots && page.url().startsWith('http')) await page.screenshot({path: path.join(shots, 'failed.png')}).catch(() => {});
        if (page.url().startsWith('http')) await page.close().catch(() => {});
      }
      for (const child of running) child.kill('SIGKILL');
    }
  }
} finally {
  await browser.close();
  for (const child of running) child.kill('SIGKILL');
  rmSync(scratch, {recursive: true, force: true});
}
process.exit(failures ? 1 : 0);
