// The page: one stream of events, and what is in view asked for once a second.

import { counter, duration, say } from './dom.js';
import { Drawer } from './drawer.js';
import { Model } from './model.js';
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
const link = { up: false, lostMs: Date.now(), reason: '', nextMs: 0, locked: false, tried: false };
let token = sessionStorage.getItem('token') ?? '';
let changed = true;

const headers = () => (token ? { Authorization: `Bearer ${token}` } : {});

async function ask(path) {
  try {
    const answer = await fetch(new URL(path, api), { headers: headers(), cache: 'no-store' });
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
    Object.assign(link, { reason: '', locked: false }, now, { tried: true });
    if (now.up) health();
    drawLink();
  },
});

function drawLink() {
  const state = link.up ? 'live' : link.tried ? 'lost' : 'connecting';
  at('link').dataset.state = state;
  say(at('link'), { live: 'Live', lost: 'Not connected', connecting: 'Connecting' }[state]);
  document.body.classList.toggle('lost', state === 'lost');
  at('banner').hidden = state !== 'lost';
  at('token-form').hidden = !link.locked;
  at('retry').hidden = link.locked;
  if (state !== 'lost') return;
  if (link.locked) {
    say(at('banner-text'), 'This gateway asks for an access token.');
    return;
  }
  const known = model.rows.size ? ' What you see is the last that was heard; ages go on.' : '';
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
  sessionStorage.setItem('token', token);
  at('token').value = '';
  stream.open();
});
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
