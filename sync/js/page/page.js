// The page: follows the server from which it was loaded, shows the replica, and tells in every frame whether its hash
// is the origin's.

import {followWebSocket} from '/src/index.js';
import {PagePointer} from '/page/pointer.js';
import {SceneSound} from '/page/sound.js';

const $ = (id) => document.getElementById(id);
const text = (id, value) => { const e = $(id); if (e.textContent !== value) e.textContent = value; };

/** The page's options stand behind the #, which browsers do not send: token, quality=low or full, slow=merge. */
const settings = new URLSearchParams(location.hash.slice(1));
const token = settings.get('token') ?? '';
const url = `${location.protocol === 'https:' ? 'wss' : 'ws'}://${location.host}/mirror${token ? `?token=${encodeURIComponent(token)}` : ''}`;

/** X_ITE blocks the page's only thread when it starts. So the state is fetched first, if that takes less than this, in
 * ms. */
const kStateWithin = 150;

const arrivals = [];  // time and number of the last states
let begin;
const firstState = new Promise((done) => { begin = done; });
let view = null, chosen = '', originsView = 0, first, reached = false, left = false;

function connection(state, words) {
  $('connection').dataset.state = state;
  text('connection', words ?? state);
  // The last comparison says nothing about the origin's present state.
  if (state === 'following' || !$('equality').dataset.equal) return;
  $('equality').dataset.equal = 'past';
  text('verdict', 'not compared now');
}
function notice(words) { text('notice', words); }

/** The address of what a node's url names. It contains the state, so that a changed url is loaded anew. */
function fileUrl(kind, id, index) {
  return `/${kind}/${id}/${index}?state=${mirror.scene.state}${token ? `&token=${encodeURIComponent(token)}` : ''}`;
}
/** Pictures that are loading since the first state came, while X_ITE starts. Each is loaded once. */
const early = new Map();
function askForPictures() {
  for (const {id, type, values} of mirror.scene.nodes.values()) {
    const url = type.name === 'ImageTexture' ? type.fields.findIndex((f) => f.name === 'url') : -1;
    if (!values[url]?.length || values[url][0].startsWith('data:')) continue;
    const href = fileUrl('picture', id, 0);
    early.set(`${id}/0`, href);
    document.head.append(Object.assign(document.createElement('link'), {rel: 'preload', as: 'image', crossOrigin: 'anonymous', href}));
  }
}
function pictureUrl(id, index) {
  const place = `${id}/${index}`, asked = early.get(place);
  early.delete(place);
  return asked ?? fileUrl('picture', id, index);
}

async function load(mirror) {
  await Promise.race([firstState, new Promise((done) => setTimeout(done, kStateWithin))]);
  if (mirror.hasState) askForPictures();
  let module;
  try {
    module = await import('/page/x3d_view.js');
  } catch (error) {
    console.warn(error);
    notice('The replica is followed and compared. Its picture needs X_ITE: run ./dev web where the server runs.');
    return;
  }
  view = new module.X3dView($('picture'), mirror.scene, {
    pictureUrl,
    quality: settings.get('quality'),
  });
  $('coarse').hidden = !(view.coarse && view.drawnByCpu);
  if (mirror.hasState) await rebuild();
}

async function rebuild() {
  if (!view || !await view.rebuild()) return;
  notice('');
  listViewpoints();
  followView(true);
  // The picture is drawn in this frame and shown when the next one begins.
  requestAnimationFrame(() => {
    $('picture').dataset.ready = 'true';
    $('picture').dataset.after ??= `${Math.round(performance.now())}`;  // ms since navigation, for measurements
  });
}

// ---- viewpoints --------------------------------------------------------------------------------------------------------

function listViewpoints() {
  const select = $('viewpoints'), found = view.viewpoints();
  const wanted = found.map((v) => `${v.id}:${v.name}`).join('\n');
  if (select.dataset.list === wanted) return;
  select.dataset.list = wanted;
  select.replaceChildren(new Option('as the origin', ''), ...found.map((v) => new Option(v.name, v.id)));
  select.value = found.some((v) => `${v.id}` === chosen) ? chosen : chosen = '';
}
function followView(anew) {
  const id = chosen ? Number(chosen) : view.originsViewpoint();
  if (id && (anew || id !== originsView)) view.bind(id);
  originsView = id;
}
$('viewpoints').onchange = (event) => {
  chosen = event.target.value;
  if (view) followView(true);
};

$('coarse').onclick = () => {
  settings.set('quality', 'full');
  location.hash = settings.toString();
  location.reload();
};

// ---- pointer -----------------------------------------------------------------------------------------------------------

let hush = 0;
function say(words) {
  text('said', words);
  clearTimeout(hush);
  hush = setTimeout(() => text('said', ''), 8000);
}

// ---- status
// --------------------------------------------------------------------------------------------------------------

function onState(record, equal, afresh) {
  begin();
  if (afresh) arrivals.length = 0;
  arrivals.push({at: performance.now(), state: record.to});
  text('state', `${record.to}`);
  text('time', (record.time - (first ??= record.time)).toFixed(2));
  $('equality').dataset.equal = `${equal}`;
  text('verdict', equal ? '✓ equal' : '✗ differs');
  text('hash', mirror.scene.hash.hex());
  const c = mirror.count;
  text('counts', `${c.equal} of ${c.states} states equal, ${(c.bytes / 1e6).toFixed(1)} MB`);
  if (afresh) {
    rebuild();
    sound.restart(mirror.epoch);
  }
  sound.update();
}

/** A refused WebSocket gives no reason; a refused picture does. */
async function askWhy() {
  const answer = await fetch(`/picture/0/0${token ? `?token=${encodeURIComponent(token)}` : ''}`).catch(() => null);
  if (answer?.status !== 403) return;
  const reason = (await answer.text()).trim();
  connection('refused', reason);
  notice(reason);
}

const follower = followWebSocket(url, {
  name: 'browser',
  nearFirst: settings.get('slow') !== 'merge',
  onConnection(state) {
    if (state !== 'open' && !left) connection(state);
    if (state === 'open') reached = true;
    else if (state === 'lost' && !reached) askWhy();
  },
  onWelcome() {
    left = false;
    pointer.welcome();
    sound.pace = 1;
    connection('following');
    if (!mirror.hasState) notice('');
    commands = [];  // earlier commands may have got no reply
    command('status');
  },
  onBye() {
    left = true;  // until another connection is there
    connection('left', 'the server has left');
  },
  onRefused(reason) { connection('refused', reason); },
  onOrigin(lost) {
    if (!left) connection(lost ? 'lost' : 'following', lost ? 'the relay has lost its origin' : undefined);
  },
  onTrouble(words) { console.warn(words); },
  onVerdict(verdict) {
    // Moving the viewer asks nothing of the origin.
    if (pointer.answered(verdict) && !view?.isOverSensor()) return;
    if (verdict.reason) say(`The origin refuses: ${verdict.reason}.`);
  },
  onReply: playerSays,
  onState,
});
const mirror = follower.mirror;
const pointer = new PagePointer($('picture'), mirror, (event) => view?.ray(event) ?? null);
const sound = new SceneSound(mirror.scene, {
  soundUrl: (id, index) => fileUrl('sound', id, index),
  ear: () => view?.camera() ?? null,
  onFound: (any) => { $('sound').hidden = !any; },
});
mirror.scene.listener = (changed) => {
  sound.change(changed);
  for (let i = 0; early.size && i < changed.length; i += 2) early.delete(`${changed[i].id}/0`);
  if (!view || mirror.afresh) return;
  view.change(changed);
  followView(false);
};
load(mirror);

// ---- sound -------------------------------------------------------------------------------------------------------------

$('sound').onclick = async () => {
  try {
    await (sound.isOn ? sound.stop() : sound.start());
  } catch (error) {
    say(`No sound: ${error.message}.`);
  }
  $('sound').setAttribute('aria-pressed', `${sound.isOn}`);
};
// A viewer who moves hears from another place, even if the scene rests.
setInterval(() => sound.update(), 50);

// ---- a log that is played ------------------------------------------------------------------------------------------------

let paused = false, dragging = false;
let commands = [];  // without a reply yet; replies come in the order of the commands
function command(words) {
  commands.push(words);
  mirror.control(words);
}
function playerSays(reply) {
  const asked = commands.shift();
  if (reply.startsWith('refused')) {
    if (asked === 'status') $('player').hidden = true;  // the server has a scene now, and no log
    return;
  }
  const status = JSON.parse(reply);
  $('player').hidden = false;
  paused = status.paused;
  text('play', paused ? 'Play' : 'Pause');
  sound.pace = status.rate;
  $('line').max = status.length;
  if (!dragging) $('line').value = status.t;
  text('clock', `${status.t.toFixed(1)} / ${status.length.toFixed(1)} s`);
}
$('play').onclick = () => command(paused ? 'play' : 'pause');
$('line').oninput = () => { dragging = true; };
$('line').onchange = () => {
  dragging = false;
  command(`seek ${$('line').value}`);
};
setInterval(() => { if (!$('player').hidden && mirror.connected) command('status'); }, 500);

/** States that came per second and, if some were merged, how many the origin had. Measured over about the last two
 * seconds, by the times at which they came. */
function showRate(now = performance.now()) {
  // Keeps one earlier state: after a pause of the page many come at once, and count for all of the pause.
  while (arrivals.length > 2 && arrivals[1].at < now - 2000) arrivals.shift();
  // If nothing came for a while, the last state ages.
  const [first] = arrivals, last = arrivals.at(-1), span = Math.max(last?.at - first?.at, now - last?.at - 500) / 1000;
  if (!(span > 0.2)) return;
  const say = (x) => x.toFixed(x < 9.95 ? 1 : 0), here = say((arrivals.length - 1) / span), there = say((last.state - first.state) / span);
  text('rate', here === there ? here : `${here} of ${there}`);
}
setInterval(showRate, 250);
addEventListener('pagehide', () => {
  pointer.leave();
  follower.close();
});

/** For tests, and for people at a console. */
window.rtsg = {mirror, follower, pointer, sound, get view() { return view; }};
