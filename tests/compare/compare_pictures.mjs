// Draws scenes with rtsg and with X_ITE in a headless Chromium, and says how alike the pictures are: how much of their
// silhouettes overlaps, and how similar they look (SSIM of luminance, Wang et al. 2004). A second browser, X3DOM, tells
// which pictures two programs agree on that know nothing of each other; it has fewer nodes.
//
// Both get the same document: the scene as `rtsg convert` writes it, with its TimeSensors switched off, so that nothing
// moves between the pictures, with the standard's default Viewpoint where it has none but those of a humanoid (rtsg would
// frame it, and binds a humanoid's), with the descriptions of Scripts declared in them, and without textures whose files are not there. rtsg draws no reflections, which a
// browser has not; X_ITE draws at its highest quality. Each scene is drawn three times: as it is, before a black and before
// a white background; a silhouette is what covers both. Writes DIR/index.html with the pictures, DIR/results.json and a line a scene.
// Exit status 0: compared, whatever came out; 77: skipped, with the reason, where Chromium or the packages of `./dev web`
// are not there. Usage: compare_pictures.mjs --program build/rtsg [-o DIR] [--size 960x720] [--only TEXT] FOLDER|FILE...
import {execFileSync} from 'node:child_process';
import {existsSync, mkdirSync, mkdtempSync, readFileSync, readdirSync, rmSync, statSync, writeFileSync} from 'node:fs';
import {createServer} from 'node:http';
import {createRequire} from 'node:module';
import {tmpdir} from 'node:os';
import path from 'node:path';
import {fileURLToPath} from 'node:url';

import {measure} from './measure.mjs';

const root = path.join(path.dirname(fileURLToPath(import.meta.url)), '../..');
const packages = path.join(root, 'sync/js/node_modules');

function options() {
  const found = {program: null, out: 'out/compare', size: [960, 720], only: '', inputs: []};
  const words = process.argv.slice(2);
  while (words.length) {
    const word = words.shift();
    if (word === '--program') found.program = path.resolve(words.shift());
    else if (word === '-o') found.out = words.shift();
    else if (word === '--size') found.size = words.shift().split('x').map(Number);
    else if (word === '--only') found.only = words.shift();
    else found.inputs.push(path.resolve(word));
  }
  if (!found.program || !found.inputs.length || found.size.length !== 2 || !found.size.every((n) => n > 0)) {
    console.error('usage: compare_pictures.mjs --program RTSG [-o DIR] [--size WxH] [--only TEXT] FOLDER|FILE...');
    process.exit(2);
  }
  return found;
}
function skip(why) {
  console.log(`SKIPPED: ${why}`);
  process.exit(77);
}
const given = options();
const chromium = ['/usr/bin/chromium', '/usr/bin/chromium-browser'].find(existsSync);
if (!chromium) skip('needs Chromium (apt install chromium)');
if (!['x_ite/dist/x_ite.min.mjs', 'x3dom/x3dom.js'].every((file) => existsSync(path.join(packages, file)))) skip('needs the packages that ./dev web fetches');
const playwright = createRequire(path.join(root, 'sync/js/package.json'))('playwright-core');

/** All scene files in a folder and below, in order. */
function scenesIn(place) {
  if (!statSync(place).isDirectory()) return [place];
  return readdirSync(place).sort().flatMap((name) => {
    const at = path.join(place, name);
    if (statSync(at).isDirectory()) return scenesIn(at);
    return /\.(x3d|x3dv|wrl|x3dz|json)$/.test(name) ? [at] : [];
  });
}

const scratch = mkdtempSync(path.join(tmpdir(), 'rtsg-compare-'));
const [width, height] = given.size;

/** Runs rtsg; what it says on standard error is in the result, and does not end the comparison. */
function rtsg(...args) {
  try {
    execFileSync(given.program, args, {stdio: ['ignore', 'pipe', 'pipe'], timeout: 600_000});
    return '';
  } catch (failed) {
    return `${failed.stderr ?? failed}`;
  }
}

/** Calls `edit` for every node of an X3D JSON document, with its type and fields. */
function eachNode(value, edit) {
  if (Array.isArray(value)) return value.forEach((v) => eachNode(v, edit));
  if (!value || typeof value !== 'object') return;
  for (const [key, content] of Object.entries(value)) {
    if (/^[A-Z]/.test(key) && content && typeof content === 'object' && !Array.isArray(content)) edit(key, content);
    eachNode(content, edit);
  }
}
const kKinds = ['whole', 'black', 'white'];
/** Makes all backgrounds of a document of one colour, and gives it one if it has none. */
function setBackground(document, color) {
  let any = false;
  eachNode(document, (type, fields) => {
    if (!/^(Texture)?Background$/.test(type)) return;
    any = true;
    if (fields['@USE']) return;
    for (const key of Object.keys(fields)) if (/^@(sky|ground)|Url$/.test(key) || /^-\w+Texture$/.test(key)) delete fields[key];
    Object.assign(fields, {'@skyColor': color, '@transparency': 0});
  });
  if (!any) (document.X3D.Scene['-children'] ??= []).unshift({Background: {'@skyColor': color}});
}

/** Whether a texture's files are all missing. */
function isGone(type, fields, folder) {
  return type === 'ImageTexture' && Boolean(fields['@url']?.length) &&
    fields['@url'].every((url) => /^(https?|ftp):/.test(url) || !/^data:/.test(url) && !existsSync(path.resolve(folder, url)));
}
/** Takes textures out of a document whose files cannot be found, and the places that use them again. */
function dropMissing(document, folder) {
  const gone = new Set();
  eachNode(document, (type, fields) => {
    if (isGone(type, fields, folder) && fields['@DEF']) gone.add(fields['@DEF']);
  });
  const drop = (value) => {
    if (!value || typeof value !== 'object') return;
    for (const [key, content] of Object.entries(value)) {
      const [type, fields] = key.startsWith('-') && content && !Array.isArray(content) ? Object.entries(content)[0] ?? [] : [];
      if (fields && (isGone(type, fields, folder) || gone.has(fields['@USE']))) delete value[key];
      else drop(content);
    }
  };
  drop(document);
}

/** Scripts have a `description` since X3D 4.0. X_ITE gives a program no variable of it, but of one that the Script declares, as those of
 * before do; to rtsg both are the same. */
function declareDescriptions(file) {
  const text = readFileSync(file, 'utf8').replaceAll(/<Script\b([^>]*[^>/]|)>(.*?)<\/Script>/gs, (whole, attributes, content) => {
    const value = / description=('[^']*')/.exec(attributes)?.[1];
    if (value === undefined && !/<connect nodeField='description'/.test(content)) return whole;
    return `<Script${attributes.replace(/ description='[^']*'/, '')}><field accessType='inputOutput' type='SFString' name='description'${
      value ? ` value=${value}` : ''}/>${content}</Script>`;
  });
  writeFileSync(file, text);
}

/** The scene as it stands, and before its two backgrounds, as XML in `scratch`; what went wrong. */
function prepare(scene, name) {
  const json = path.join(scratch, `${name}.json`);
  const said = rtsg('convert', scene, json, '--force');
  if (!existsSync(json)) return said || 'it was not converted';
  for (const kind of kKinds) {
    const document = JSON.parse(readFileSync(json, 'utf8'));
    eachNode(document, (type, fields) => {
      if (fields['@USE']) return;
      if (type === 'TimeSensor') fields['@enabled'] = false;
    });
    if (kind !== 'whole') setBackground(document, kind === 'black' ? [0, 0, 0] : [1, 1, 1]);
    dropMissing(document, path.dirname(scene));
    let seen = false;
    const own = structuredClone(document);
    eachNode(own, (type, fields) => { if (type === 'HAnimHumanoid') delete fields['-viewpoints']; });
    eachNode(own, (type) => { seen ||= /^(Ortho|Geo)?Viewpoint$/.test(type); });  // those in Inlines are bound by nobody (7.2.2)
    if (!seen) (document.X3D.Scene['-children'] ??= []).unshift({Viewpoint: {}});
    if (document.X3D) document.X3D['@version'] = '4.0', document.X3D['@profile'] = 'Full';
    writeFileSync(json, JSON.stringify(document));
    rtsg('convert', json, path.join(scratch, `${name}-${kind}.x3d`), '--force');
    declareDescriptions(path.join(scratch, `${name}-${kind}.x3d`));
    rtsg('render', path.join(scratch, `${name}-${kind}.x3d`), '-o', path.join(given.out, `${name}-${kind}-rtsg.png`), '--size',
      `${width}x${height}`, '--spp', '16', '--shadows', 'authored', '--depth', '0', '--base', path.dirname(scene), '--allow', path.dirname(path.dirname(scene)));
  }
  return said;
}

/** The fonts that rtsg takes for X3D's families, for those that X_ITE brings: so that letters can be compared, not fonts. */
function fontInPlaceOf(asked) {
  const folder = '/usr/share/fonts/truetype/dejavu';
  const bold = /Bold|-BI?\./.test(asked), italic = /Italic|-[RB]I\./.test(asked), serif = /Serif/.test(asked), mono = /Mono/.test(asked);
  const style = (bold ? 'Bold' : '') + (italic ? (serif ? 'Italic' : 'Oblique') : '');
  return path.join(folder, `DejaVu${serif ? 'Serif' : mono ? 'SansMono' : 'Sans'}${style && '-'}${style}.ttf`);
}

/** A page in which X3DOM, which takes its nodes from the page, finds those of a document. It shall not encode colours of classic
 * Materials, as it does by default; its TimeSensors run even if they are switched off, and lead nowhere without routes. */
function pageOfX3dom(document) {
  const scene = document.replace(/^\s*<\?xml[^>]*>\s*/, '').replace(/^<!DOCTYPE[^>]*>\s*/, '').replace(/<head>.*?<\/head>/s, '')
    .replace(/^<X3D[^>]*>/, `<X3D width="${width}px" height="${height}px" showLog="false" showStat="false" showProgress="false">`)
    .replaceAll(/<ROUTE [^>]*>/g, '').replace(/<Scene>|<Scene [^>]*>/, '$&<Environment gammaCorrectionDefault="none"/>');
  return `<html xmlns="http://www.w3.org/1999/xhtml"><head><title>X3DOM</title><script src="/packages/x3dom/x3dom.js"></script>
<link rel="stylesheet" href="/packages/x3dom/x3dom.css"/><style>body{margin:0;background:#000}X3D,x3d{border:0;outline:0;background:#000}</style></head><body>${scene}</body></html>`;
}

const kTypes = {'.mjs': 'text/javascript', '.js': 'text/javascript', '.css': 'text/css', '.html': 'text/html', '.x3d': 'model/x3d+xml',
  '.png': 'image/png', '.jpg': 'image/jpeg', '.json': 'model/x3d+json', '.wasm': 'application/wasm'};
/** /packages/… and /files/…: what is on this machine, with the scenes' documents beside them at STILL-N-….x3d; all else is absent. */
function startServer() {
  const server = createServer((request, response) => {
    const at = decodeURIComponent(new URL(request.url, 'http://x').pathname);
    if (at === '/') {
      response.writeHead(200, {'content-type': 'text/html'});
      response.end(`<!doctype html><script type="importmap">{"imports":{"x_ite":"/packages/x_ite/dist/x_ite.min.mjs"}}</script>
<style>body{margin:0;background:#000}x3d-canvas{width:${width}px;height:${height}px;border:0;outline:0}</style>`);
      return;
    }
    let file = null;
    const still = /\/STILL-(\d+-(whole|black|white)\.x3d)$/.exec(at);
    const page = /\/STILL-(\d+-(whole|black|white))\.xhtml$/.exec(at);
    if (page && existsSync(path.join(scratch, `${page[1]}.x3d`))) {
      response.writeHead(200, {'content-type': 'application/xhtml+xml'});
      response.end(pageOfX3dom(readFileSync(path.join(scratch, `${page[1]}.x3d`), 'utf8')));
      return;
    }
    if (at.startsWith('/packages/x_ite/dist/assets/fonts/')) file = fontInPlaceOf(at);
    else if (at.startsWith('/packages/')) file = path.join(packages, at.slice('/packages/'.length));
    else if (still) file = path.join(scratch, still[1]);
    else if (at.startsWith('/files/')) file = at.slice('/files'.length);
    if (!file || !existsSync(file) || !statSync(file).isFile()) {
      response.writeHead(404).end();
      return;
    }
    response.writeHead(200, {'content-type': kTypes[path.extname(file)] ?? 'application/octet-stream'});
    response.end(readFileSync(file));
  });
  return new Promise((done) => server.listen(0, '127.0.0.1', () => done(server)));
}

/** A picture by X_ITE, once what the scene loads is there and two pictures are the same. */
async function drawInXIte(page, url) {
  await page.goto(new URL('/', url).href);
  await page.evaluate(async (url) => {
    const X3D = (await import('x_ite')).default;
    const canvas = X3D.createBrowser();
    for (const off of ['splashScreen', 'notifications', 'timings', 'contextMenu']) canvas.setAttribute(off, 'false');
    canvas.setAttribute('contentScale', '1');
    document.body.append(canvas);
    const browser = X3D.getBrowser(canvas);
    browser.setBrowserOption('StraightenHorizon', false);  // of viewpoints that lean: it is no part of the standard
    // Both as well as they can: by default X_ITE takes single pixels of textures that are small on the screen.
    for (const quality of ['TextureQuality', 'PrimitiveQuality']) browser.setBrowserOption(quality, 'HIGH');
    await browser.loadURL(new X3D.MFString(url));
  }, url);
  return whenStill(page, 'x3d-canvas');
}
async function drawInX3dom(page, url) {
  await page.goto(url);
  return whenStill(page, 'X3D, x3d');
}
/** What an element shows once two pictures of it are the same, and a while of frames has been drawn: where the machine is slow, two that
 * show nothing yet are the same as well. */
async function whenStill(page, element) {
  await page.evaluate(async () => { for (let i = 0; i < 30; ++i) await new Promise(requestAnimationFrame); });
  let before = null;
  for (let i = 0; i < 20; ++i) {
    await page.waitForTimeout(400);
    const now = await page.locator(element).first().screenshot();
    if (before && now.equals(before)) return now;
    before = now;
  }
  return before;
}

function escape(text) {
  return text.replaceAll('&', '&amp;').replaceAll('<', '&lt;');
}
function writePage(results, summary) {
  const rows = results.map((r) => `<tr class="${r.alike ? 'alike' : 'not'}"><td>${escape(r.scene)}<br>IoU ${r.iou?.toFixed(3) ?? '–'}, within a pixel ${r.near?.toFixed(3) ?? '–'}, SSIM ${
    r.ssim?.toFixed(3) ?? '–'}, mean difference ${r.difference?.toFixed(1) ?? '–'} of 255; X_ITE and X3DOM: IoU ${
    r.browsers?.iou.toFixed(3) ?? '–'}, SSIM ${r.browsers?.ssim.toFixed(3) ?? '–'}<pre>${escape(r.said.slice(0, 1500))}</pre></td><td><img src="${
    r.name}-whole-rtsg.png"></td><td><img src="${r.name}-whole-x_ite.png"></td><td><img src="${r.name}-whole-x3dom.png"></td></tr>`);
  writeFileSync(path.join(given.out, 'index.html'), `<!doctype html><meta charset="utf-8"><title>rtsg and browsers</title>
<style>body{font:15px sans-serif;margin:1em}td{vertical-align:top;padding:.4em;border-top:1px solid #ccc}img{max-width:100%}pre{font-size:11px;white-space:pre-wrap}
.not td:first-child{background:#fdd}</style><h1>rtsg, X_ITE and X3DOM</h1><p>${escape(summary)}</p><table>${rows.join('\n')}</table>`);
}

const scenes = given.inputs.flatMap(scenesIn).filter((s) => s.includes(given.only));
mkdirSync(given.out, {recursive: true});
const server = await startServer();
const browser = await playwright.chromium.launchPersistentContext(path.join(scratch, 'profile'), {executablePath: chromium, headless: true,
  viewport: {width, height}, args: ['--headless', '--no-sandbox', '--disable-gpu', '--no-first-run', '--enable-unsafe-swiftshader']});
const isAlike = ({iou, ssim}) => iou >= .98 && ssim >= .95;
const results = [];
for (let i = 0; i < scenes.length; ++i) {
  const result = {scene: path.relative(process.cwd(), scenes[i]), name: `${i}`, said: '', alike: false};
  results.push(result);
  let page = null;
  try {
    page = await browser.newPage();
    page.setDefaultTimeout(120_000);
    page.on('console', (message) => { if (message.type() === 'error') result.said += `browser: ${message.text()}\n`; });
    result.said += prepare(scenes[i], `${i}`);
    const pictures = {rtsg: {}, xIte: {}, x3dom: {}};
    for (const kind of kKinds) {
      const still = `http://127.0.0.1:${server.address().port}/files${path.dirname(scenes[i])}/STILL-${i}-${kind}`;
      const pngs = {rtsg: readFileSync(path.join(given.out, `${i}-${kind}-rtsg.png`)), xIte: await drawInXIte(page, `${still}.x3d`),
        x3dom: await drawInX3dom(page, `${still}.xhtml`)};
      writeFileSync(path.join(given.out, `${i}-${kind}-x_ite.png`), pngs.xIte);
      writeFileSync(path.join(given.out, `${i}-${kind}-x3dom.png`), pngs.x3dom);
      for (const [who, png] of Object.entries(pngs)) pictures[who][kind] = png.toString('base64');
    }
    Object.assign(result, await page.evaluate(measure, {a: pictures.rtsg, b: pictures.xIte}));
    result.alike = isAlike(result);
    result.browsers = await page.evaluate(measure, {a: pictures.xIte, b: pictures.x3dom});
    result.agreed = isAlike(result.browsers);
    console.log(`${result.alike ? 'alike    ' : 'different'} IoU ${result.iou.toFixed(3)} near ${result.near.toFixed(3)} SSIM ${result.ssim.toFixed(3)}, the browsers ${
      result.agreed ? 'alike    ' : 'different'} ${result.browsers.iou.toFixed(3)} ${result.browsers.ssim.toFixed(3)} ${result.scene}`);
  } catch (failed) {
    result.said += `${failed}`;
    console.log(`failed    ${result.scene}: ${`${failed}`.split('\n')[0]}`);
  }
  await page?.close().catch(() => {});
}
await browser.close();
server.close();
const alike = results.filter((r) => r.alike).length;
const agreed = results.filter((r) => r.agreed);
const summary = `${alike} of ${results.length} scenes are alike (IoU at least .98 and SSIM at least .95); of ${
  results.filter((r) => !r.alike && r.near >= .98 && r.ssim >= .95).length} more the silhouettes lie within a pixel of each other. X_ITE and X3DOM are alike in ${
  agreed.length} scenes, of which rtsg and X_ITE are in ${agreed.filter((r) => r.alike).length}.`;
writePage(results, summary);
writeFileSync(path.join(given.out, 'results.json'), JSON.stringify(results, null, 1));
console.log(summary);
rmSync(scratch, {recursive: true, force: true});
