// The page: follows the server that it came from, shows the replica, and says in every frame whether its hash is the origin's.

import {followWebSocket} from '/src/index.js';

const $ = (id) => document.getElementById(id);
const text = (id, value) => { const e = $(id); if (e.textContent !== value) e.textContent = value; };

/** Behind the #, which browsers do not send: token, quality=low. */
const settings = new URLSearchParams(location.hash.slice(1));
const token = settings.get('token') ?? '';
const url = `${location.protocol === 'https:' ? 'wss' : 'ws'}://${location.host}/mirror${token ? `?token=${encodeURIComponent(token)}` : ''}`;

let view = null, chosen = '', originsView = 0, states = 0, first, reached = false, left = false;

function connection(state, words) {
  $('connection').dataset.state = state;
  text('connection', words ?? state);
}
function notice(words) { text('notice', words); }

async function load(mirror) {
  let module;
  try {
    module = await import('/page/x3d_view.js');
  } catch (error) {
    console.warn(error);
    notice('The replica is followed and compared. Its picture needs X_ITE: run ./dev web where the server runs.');
    return;
  }
  view = new module.X3dView($('picture'), mirror.scene, {
    onTouch: (id, field, value) => touched(mirror, id, field, value),
    // The state is there so that a texture whose url has changed is fetched anew.
    pictureUrl: (id, index) => `/picture/${id}/${index}?state=${mirror.scene.state}${token ? `&token=${encodeURIComponent(token)}` : ''}`,
    options: settings.get('quality') === 'low' ? {Antialiased: false, PrimitiveQuality: 'LOW', TextureQuality: 'LOW', ContentScale: 0.5} : {},
  });
  if (mirror.hasState) await rebuild();
}

async function rebuild() {
  if (!view || !await view.rebuild()) return;
  notice('');
  $('picture').dataset.ready = 'true';
  listViewpoints();
  followView(true);
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

// ---- pointer -----------------------------------------------------------------------------------------------------------

/** What a TouchSensor here would send along its routes goes to where those lead, at the origin: inputs take events, outputs
 * do not. */
function touched(mirror, id, field, value) {
  const node = mirror.scene.nodes.get(id);
  const from = node?.type.fields.findIndex((f) => f.name === field) ?? -1;
  if (from < 0) return;
  const sent = field === 'touchTime' ? mirror.scene.time : typeof value === 'object' ? [...value] : value;
  const events = node.routes.filter((r) => r.fromField === from && !r.isConnection)
    .map((r) => ({node: r.to, field: r.toField, type: node.type.fields[from].type, value: sent}));
  if (events.length) mirror.submitEvents(events);
}

let hush = 0;
function say(words) {
  text('said', words);
  clearTimeout(hush);
  hush = setTimeout(() => text('said', ''), 8000);
}

// ---- what is said --------------------------------------------------------------------------------------------------------

function onState(record, equal, afresh) {
  ++states;
  text('state', `${record.to}`);
  text('time', (record.time - (first ??= record.time)).toFixed(2));
  $('equality').dataset.equal = `${equal}`;
  text('verdict', equal ? '✓ equal' : '✗ differs');
  text('hash', mirror.scene.hash.hex());
  const c = mirror.count;
  text('counts', `${c.equal} of ${c.states} states equal, ${(c.bytes / 1e6).toFixed(1)} MB`);
  if (afresh) rebuild();
}

/** A WebSocket that is refused does not say why; a picture that is does. */
async function askWhy() {
  const answer = await fetch(`/picture/0/0${token ? `?token=${encodeURIComponent(token)}` : ''}`).catch(() => null);
  if (answer?.status !== 403) return;
  const reason = (await answer.text()).trim();
  connection('refused', reason);
  notice(reason);
}

const follower = followWebSocket(url, {
  name: 'browser',
  onConnection(state) {
    if (state !== 'open' && !left) connection(state);
    if (state === 'open') reached = true;
    else if (state === 'lost' && !reached) askWhy();
  },
  onWelcome() {
    left = false;
    connection('following');
    if (!mirror.hasState) notice('');
    mirror.control('status');
  },
  onBye() {
    left = true;  // until there is another
    connection('left', 'the server has left');
  },
  onRefused(reason) { connection('refused', reason); },
  onTrouble(words) { console.warn(words); },
  onVerdict({reason}) { say(reason && `The origin refuses: ${reason}.`); },
  onReply: playerSays,
  onState,
});
const mirror = follower.mirror;
mirror.scene.listener = (changed) => {
  if (!view || mirror.afresh) return;
  view.change(changed);
  followView(false);
};
load(mirror);

// ---- a log that is played ------------------------------------------------------------------------------------------------

let paused = false, dragging = false;
function playerSays(reply) {
  if (reply.startsWith('refused')) return;
  const status = JSON.parse(reply);
  $('player').hidden = false;
  paused = status.paused;
  text('play', paused ? 'Play' : 'Pause');
  $('line').max = status.length;
  if (!dragging) $('line').value = status.t;
  text('clock', `${status.t.toFixed(1)} / ${status.length.toFixed(1)} s`);
}
$('play').onclick = () => mirror.control(paused ? 'play' : 'pause');
$('line').oninput = () => { dragging = true; };
$('line').onchange = () => {
  dragging = false;
  mirror.control(`seek ${$('line').value}`);
};
setInterval(() => { if (!$('player').hidden && mirror.connected) mirror.control('status'); }, 500);

const seconds = [];  // how many states came in each of the last five
setInterval(() => {
  seconds.push(states);
  states = 0;
  if (seconds.length > 5) seconds.shift();
  text('rate', (seconds.reduce((sum, n) => sum + n, 0) / seconds.length).toFixed(0));
}, 1000);
addEventListener('pagehide', () => follower.close());

/** For tests, and for people with a console. */
window.rtsg = {mirror, follower, get view() { return view; }};
