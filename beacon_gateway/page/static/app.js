// The page: one stream of events, and what is in view asked for once a second.

import { counter, duration, say } from './dom.js';
import { Drawer } from './drawer.js';
import { Model } from './model.js';
import { Relay } from './relay.js';
import { Events, Sources } from './side.js';
import { Stream } from './stream.js';
import { Table } from './table.js';

const REFRESH_MS = 1_000;
const HEALTH_MS = 2_000;
const TICK_MS = 250;
const MOST_IDS = 80; // in one address

const api = new URL('api/v1/', document.baseURI);
const at = (id) => document.getElementById(id);
const tile = (name) => document.querySelector(`.tile[data-count="${name}"] b`);

const model = new Model();
const link = { up: false, lostMs: Date.now(), reason: '', nextMs: 0, locked: '', tried: false };
let token = sessionStorage.getItem('token') ?? '';
let accepted = false; // the token has opened something
let changed = true;

const headers = () => (token ? { Authorization: `Bearer ${token}` } : {});

async function ask(path) {
  const shown = token;
  try {
    const answer = await fetch(new URL(path, api), { headers: headers(), cache: 'no-store' });
    // The stream goes on with the rights that it was opened with.
    if (answer.status === 401 && shown === token && link.up) lock();
    return answer.ok ? await answer.json() : null;
  } catch {
    return null; // the stream says that the line is down
  }
}

const table = new Table(model, {
  grid: at('grid'), canvas: at('canvas'), shown: at('shown'), empty: at('empty'),
});
const events = new Events(at('events'), at('quiet'));
const sources = new Sources(at('sources'), {
  expired: tile('expired'), rejected: tile('rejected'), limited: tile('limited'),
  fill: at('fill'), fillText: at('fill-text'),
});
const relay = new Relay(document.querySelector('.panel.relay'), at('relay'));
const drawer = new Drawer(model, {
  node: at('drawer'), title: at('drawer-title'), detail: at('detail'), close: at('close'),
  ask: (query) => ask(`x-medkit-beacon${query}`),
  about: (href) => ask(new URL(`.${href}`, document.baseURI)),
  closed: () => {
    history.replaceState(null, '', location.pathname + location.search);
    at('grid').focus();
  },
});

const stream = new Stream(new URL('x-medkit-beacon/stream', api), {
  headers,
  tell: (kind, body) => {
    if (kind === 'snapshot') model.replace(body);
    else {
      model.apply(kind, body);
      if (kind !== 'expected') events.add(kind, body);
      if (body.beacon) {
        table.flash(body.beacon.entity_id);
        if (body.beacon.entity_id === drawer.entityId) drawer.refresh();
      }
    }
    changed = true;
  },
  state: (now) => {
    if (link.up && !now.up) link.lostMs = Date.now();
    if (now.locked) {
      lock();
      return;
    }
    Object.assign(link, { reason: '', locked: '' }, now, { tried: true });
    if (now.up) {
      accepted = Boolean(token);
      health();
    }
    drawLink();
  },
});

// Nothing more is told: ask for a token, and say what was wrong with the one there was.
function lock() {
  stream.close();
  if (link.up) link.lostMs = Date.now();
  let why = 'This gateway asks for an access token.';
  if (accepted) why = 'Your access token does not count any more: it has expired, or was taken back.';
  else if (token) why = 'That access token is not accepted.';
  Object.assign(link, { up: false, reason: '', locked: why, tried: true });
  forget();
  drawLink();
  at('token').focus();
}

function forget() {
  token = '';
  accepted = false;
  sessionStorage.removeItem('token');
}

// A browser shows no token when it follows a link: what is behind it is fetched, and then shown.
async function follow(event) {
  const to = event.target.closest?.('a[href]');
  if (!token || !to?.href || !/^https?:/.test(to.href) || to.getAttribute('href').startsWith('#')) return;
  event.preventDefault();
  try {
    const answer = await fetch(to.href, { headers: headers(), cache: 'no-store' });
    location.assign(URL.createObjectURL(await answer.blob()));
  } catch {
    // the stream says that the line is down
  }
}

function drawLink() {
  const state = link.up ? 'live' : link.tried ? 'lost' : 'connecting';
  at('link').dataset.state = state;
  say(at('link'), { live: 'Live', lost: 'Not connected', connecting: 'Connecting' }[state]);
  document.body.classList.toggle('lost', state === 'lost');
  // Who was told nothing is not to read that there is nothing.
  document.body.classList.toggle('untold', Boolean(link.locked) && !model.version);
  at('banner').hidden = state !== 'lost';
  at('token-form').hidden = !link.locked;
  at('retry').hidden = Boolean(link.locked);
  if (state !== 'lost') return;
  const known = model.rows.size ? ' What you see is the last that was heard; ages go on.' : '';
  if (link.locked) {
    say(at('banner-text'), `${link.locked}${known}`);
    return;
  }
  say(at('banner-text'), `Not connected since ${new Date(link.lostMs).toLocaleTimeString([], { hour12: false })}: ${link.reason}.${known}`);
}

function drawChanges() {
  requestAnimationFrame(drawChanges);
  if (!changed) return;
  changed = false;
  const tally = model.tally();
  for (const [name, number] of Object.entries(tally)) {
    counter(document.querySelector(`.tile[data-status="${name}"] b`), number);
  }
  const bad = tally.stale + tally.conflict + tally.expected;
  document.title = bad ? `(${bad}) Beacon` : 'Beacon';
  table.update();
  events.draw();
}

function tick() {
  table.tick();
  drawer.tick();
}

async function refresh() {
  if (link.up && !document.hidden) {
    const ids = table.inView().slice(0, MOST_IDS);
    const query = ids.map((id) => `id=${encodeURIComponent(id)}`).join('&');
    const body = ids.length ? await ask(`x-medkit-beacon?${query}`) : null;
    if (body) model.refresh(body.items, body.timestamp);
    await drawer.refresh();
  }
  setTimeout(refresh, REFRESH_MS);
}

async function health() {
  const body = link.up ? await ask('health') : null;
  const ours = body?.['x-medkit-beacon'];
  if (!ours) return;
  say(at('uptime'), `up ${duration(ours.uptime_sec)}`);
  sources.draw(ours, model.sources);
  const told = await ask('x-beacon-relay');
  if (told) relay.draw(told);
}

function route() {
  const found = /^#entity=(.+)$/.exec(location.hash);
  if (found) {
    try {
      drawer.open(decodeURIComponent(found[1]));
    } catch {
      drawer.leave(); // not an address that this page has made
    }
  } else drawer.leave();
}

function filter() {
  const pressed = document.querySelector('.tile[aria-pressed="true"]');
  table.filter(at('filter').value, pressed?.dataset.status ?? '');
}

function press(buttons, chosen, toggles) {
  for (const one of buttons) {
    const on = one === chosen && !(toggles && one.getAttribute('aria-pressed') === 'true');
    one.setAttribute('aria-pressed', on);
  }
}

const tiles = [...document.querySelectorAll('button.tile')];
for (const one of tiles) {
  one.addEventListener('click', () => {
    press(tiles, one, true);
    filter();
  });
}
const tabs = [...document.querySelectorAll('.tabs button')];
for (const one of tabs) {
  one.addEventListener('click', () => {
    press(tabs, one, false);
    document.body.dataset.tab = one.dataset.tab;
    table.draw();
  });
}
at('filter').addEventListener('input', filter);
at('retry').addEventListener('click', () => stream.open());
at('token-form').addEventListener('submit', (event) => {
  event.preventDefault();
  token = at('token').value.trim();
  if (!token) return;
  sessionStorage.setItem('token', token);
  at('token').value = '';
  stream.open();
});
document.addEventListener('click', follow);
document.addEventListener('keydown', (event) => {
  const typing = event.target.closest('input');
  if (event.key === '/' && !typing) {
    event.preventDefault();
    at('filter').focus();
  } else if (event.key === 'Escape') {
    if (typing) at('grid').focus();
    else drawer.leave();
  }
});
window.addEventListener('hashchange', route);
window.addEventListener('online', () => stream.open());

stream.open();
drawChanges();
refresh();
setInterval(tick, TICK_MS);
setInterval(health, HEALTH_MS);
route();
