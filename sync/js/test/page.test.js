// The page's document requests every module at once. If each were found only through another one, it would cost a round
// trip more.
import assert from 'node:assert/strict';
import {readFileSync} from 'node:fs';
import path from 'node:path';
import {test} from 'node:test';
import {fileURLToPath} from 'node:url';

const root = path.join(path.dirname(fileURLToPath(import.meta.url)), '..');
const html = readFileSync(path.join(root, 'page/index.html'), 'utf8');
const map = JSON.parse(html.match(/<script type="importmap"[^>]*>([^]*?)<\/script>/)[1]).imports;

/** All that `name` (a path from the server's root) imports, itself included; not what packages import of their own. */
function reached(name, found = new Set()) {
  if (found.has(name)) return found;
  found.add(name);
  if (name.startsWith('/node_modules/')) return found;
  const text = readFileSync(path.join(root, name), 'utf8');
  for (const [, wanted] of text.matchAll(/^(?:import|export)\s[^;]*?from '([^']+)'/gm))
    reached(wanted.startsWith('.') ? path.posix.join(path.posix.dirname(name), wanted) : map[wanted] ?? wanted, found);
  return found;
}

test('every module of the page is asked for at once, and no other', () => {
  const preloaded = [...html.matchAll(/<link rel="modulepreload" href="([^"]+)">/g)].map(([, href]) => href);
  const main = html.match(/<script type="module" src="([^"]+)">/)[1];
  // import() loads those two, so that the page can say what is missing.
  const all = reached('/page/x3d_view.js', reached('/page/page.js', reached(main)));
  assert.ok(all.has('/src/decoder.js') && all.has(map.x_ite), `${[...all]}`);
  all.delete(main);
  assert.deepEqual(preloaded.sort(), [...all].sort());
});
