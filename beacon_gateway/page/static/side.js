// What has happened, and how the sources are doing.

import { count, counter, duration, element, factList, hashOf, rate, say } from './dom.js';

const KEPT = 200;
const BAD = ['too-large', 'malformed', 'invalid', 'fault'];
const LIMITED = ['source-rate', 'global-rate'];

const sum = (counts, names) => names.reduce((total, name) => total + (counts[name] ?? 0), 0);

/** One line about an event. */
function about(kind, body) {
  if (body.rejected) {
    const reasons = body.rejected.reasons.map((one) => `${count(one.count)} × ${one.verdict}: ${one.detail}`);
    return reasons.join(' · ');
  }
  const row = body.beacon;
  const where = [row.hostname, row.process_id && `process ${row.process_id}`].filter(Boolean).join(', ');
  if (kind === 'restarted') return `now ${where || 'another process'}, restart ${row.restarts}`;
  if (kind === 'conflict') return 'two processes speak under this id';
  if (kind === 'stale' || kind === 'left') return [row.cause, row.reason].filter(Boolean).join(': ');
  if (kind === 'expired') return 'not heard any more';
  return where;
}

export class Events {
  constructor(list, quiet) {
    this.list = list;
    this.quiet = quiet;
    this.waiting = [];
  }

  add(kind, body) {
    this.waiting.push([kind, body]);
    if (this.waiting.length > KEPT) this.waiting.shift();
  }

  /** Bring what has come since the last time onto the page. */
  draw() {
    if (!this.waiting.length) return;
    this.quiet.hidden = true;
    const lines = this.waiting.map(([kind, body]) => this.line(kind, body)).reverse();
    this.waiting = [];
    this.list.prepend(...lines);
    while (this.list.children.length > KEPT) this.list.lastElementChild.remove();
  }

  line(kind, body) {
    const time = element('time', '', new Date(body.timestamp).toLocaleTimeString([], { hour12: false }));
    time.dateTime = body.timestamp;
    const chip = element('span', 'status', kind);
    chip.dataset.status = kind;
    const row = body.beacon;
    const name = row ? element('a', '', row.display_name || row.entity_id) : element('b', '', body.rejected.source);
    if (row) name.href = hashOf(row.entity_id);
    return element('li', '', time, chip, name, element('small', '', about(kind, body)));
  }
}

export class Sources {
  constructor(list, tiles) {
    this.list = list;
    this.tiles = tiles;
    this.items = new Map();
    this.before = new Map();
  }

  /** `sources` are those of the snapshot: they say how much each may hold. */
  draw(health, sources) {
    const at = performance.now();
    const now = new Map();
    const totals = { expired: 0, rejected: 0, limited: 0, held: 0, room: 0 };
    for (const source of health.sources) {
      const { messages, hints } = source;
      const heard = Object.values(messages).reduce((a, b) => a + b, 0);
      now.set(source.name, { total: heard, at });
      const room = sources.find((one) => one.name === source.name)?.max_hints ?? 0;
      totals.expired += hints.expired;
      totals.rejected += sum(messages, BAD);
      totals.limited += sum(messages, LIMITED);
      totals.held += hints.active + hints.stale;
      totals.room += room;
      this.item(source, rate(this.before.get(source.name), heard, at), room);
    }
    this.before = now;
    for (const name of ['expired', 'rejected', 'limited']) counter(this.tiles[name], totals[name]);
    say(this.tiles.fillText, `${count(totals.held)} / ${count(totals.room)}`);
    this.tiles.fill.style.setProperty('--age', `${(100 * totals.held) / Math.max(1, totals.room)}%`);
  }

  item(source, speed, room) {
    let item = this.items.get(source.name);
    if (!item) {
      item = this.made(source);
      this.items.set(source.name, item);
      this.list.append(item.node);
    }
    const { messages, hints } = source;
    const held = hints.active + hints.stale;
    item.node.dataset.condition = source.condition;
    say(item.condition, source.condition);
    say(item.detail, source.detail ?? '');
    item.meter.style.setProperty('--age', `${(100 * held) / Math.max(1, room)}%`);
    const facts = [speed, count(source.senders), `${count(held)} / ${count(room)}`,
      count(sum(messages, BAD)), count(sum(messages, LIMITED)), count(messages['store-full'] ?? 0),
      source.last_message_sec === undefined ? 'never' : `${duration(source.last_message_sec)} ago`, count(Math.floor(source.tokens))];
    facts.forEach((fact, index) => say(item.facts[index], fact));
  }

  made(source) {
    const { list, facts } = factList('messages/s', 'senders', 'held', 'unreadable', 'too fast', 'no room', 'last message', 'tokens left');
    const condition = element('span', 'condition');
    const detail = element('p', 'detail');
    const meter = element('i', 'meter');
    const head = element('h3', '', source.name, ' ', element('small', '', source.adapter));
    return { node: element('li', '', element('div', 'top', head, condition), detail, meter, list), condition, detail, meter, facts };
  }
}
