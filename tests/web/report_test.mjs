// The report of the demonstration in a headless Chromium as wide as a phone, 390 pixels: nothing sticks out, every picture is
// there, and the sound can be played. Runs the demonstration, shortened, for it.
//
// Exit status 0: all well; 1: a check failed; 77: skipped, with the reason, where Chromium or the packages of `./dev web` are
// not there. Usage: report_test.mjs --program build/rtsg [--shot FILE.png]
import assert from 'node:assert/strict';
import {execFileSync} from 'node:child_process';
import {existsSync, mkdtempSync, rmSync} from 'node:fs';
import {createRequire} from 'node:module';
import {tmpdir} from 'node:os';
import path from 'node:path';
import {fileURLToPath, pathToFileURL} from 'node:url';

const root = path.join(path.dirname(fileURLToPath(import.meta.url)), '../..');
const given = (name) => process.argv.includes(name) ? process.argv[process.argv.indexOf(name) + 1] : null;

function skip(why) {
  console.log(`SKIPPED: ${why}`);
  process.exit(77);
}
const chromium = ['/usr/bin/chromium', '/usr/bin/chromium-browser'].find(existsSync);
if (!chromium) skip('needs Chromium (apt install chromium)');
let playwright;
try {
  playwright = createRequire(path.join(root, 'sync/js/package.json'))('playwright-core');
} catch {
  skip('needs the packages that ./dev web fetches');
}

const scratch = mkdtempSync(path.join(tmpdir(), 'rtsg-report-'));
let browser;
try {
  const out = path.join(scratch, 'out');
  execFileSync(path.join(root, 'examples/demo/run'), [out], {stdio: ['ignore', 'ignore', 'inherit'],
    env: {...process.env, RTSG: path.resolve(given('--program')), SECONDS_TO_RUN: '3', FPS: '30', NO_COLOR: '1'}});
  browser = await playwright.chromium.launchPersistentContext(path.join(scratch, 'profile'), {executablePath: chromium, headless: true,
    args: ['--headless', '--no-sandbox', '--disable-gpu', '--no-first-run'], viewport: {width: 390, height: 844}, isMobile: true,
    deviceScaleFactor: 2});
  const page = await browser.newPage();
  await page.goto(pathToFileURL(path.join(out, 'report.html')).href, {waitUntil: 'load'});
  if (given('--shot')) await page.screenshot({path: given('--shot'), fullPage: true});
  const found = await page.evaluate(() => ({
    width: document.documentElement.scrollWidth,
    // What may be scrolled within the page (tables of bands) is no part of its width.
    out: [...document.body.querySelectorAll('*')].filter((e) => !e.closest('.wide, svg') && e.getBoundingClientRect().right > 390.5).map((e) => e.outerHTML.slice(0, 80)),
    pictures: [...document.images].map((image) => image.complete && image.naturalWidth > 0),
    sounds: [...document.querySelectorAll('audio')].map((sound) => sound.error === null),
    charts: document.querySelectorAll('svg polyline').length,
    letters: Math.min(...[...document.querySelectorAll('p, li, td')].map((e) => parseFloat(getComputedStyle(e).fontSize))),
  }));
  assert.ok(found.width <= 390, `the page is ${found.width} pixels wide`);
  assert.deepEqual(found.out, [], 'what sticks out');
  assert.ok(found.pictures.length >= 4 && found.pictures.every(Boolean), `pictures: ${found.pictures}`);
  assert.deepEqual(found.sounds, [true]);
  assert.ok(found.charts >= 2, `${found.charts} lines in charts`);
  assert.ok(found.letters >= 12, `letters of ${found.letters} pixels`);
  console.log('ok: readable at 390 pixels');
} finally {
  await browser?.close();
  rmSync(scratch, {recursive: true, force: true});
}
