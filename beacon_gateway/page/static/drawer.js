// One entity, with all that is known of it.

import { duration, element, say } from './dom.js';
import { graph, rollUp } from './graph.js';
import { drawAge } from './table.js';

const FIELDS = [
  ['display_name', 'display name'], ['stable_id', 'stable id'], ['component_id', 'component'],
  ['hostname', 'host'], ['process_id', 'process id'], ['process_name', 'process'],
  ['transport_type', 'transport'], ['negotiated_format', 'format'],
  ['function_ids', 'functions'], ['depends_on', 'depends on'],
];

const plain = (value) => (Array.isArray(value) ? value.join(', ') : value ? String(value) : '');

function section(title, ...children) {
  return element('section', '', element('h3', '', title), ...children);
}

function status(name) {
  const chip = element('span', 'status', name);
  chip.dataset.status = name;
  return chip;
}

/** One line for each field, one column for each source; what differs is marked. */
function sideBySide(sources, names, ages) {
  const head = element('tr', '', element('td'), ...sources.map((one) => element('th', '', one.source)));
  const line = (name, values, texts) => {
    if (!texts.some(Boolean)) return null;
    const differs = new Set(texts).size > 1;
    const title = element('th', '', name);
    title.scope = 'row';
    return element('tr', differs ? 'differs' : '', title, ...values.map((value) => element('td', '', value)));
  };
  const texts = (name, values) => line(name, values, values);
  const lines = [
    line('status', sources.map((one) => status(one.status)), sources.map((one) => one.status)),
    line('heard', sources.map((one, index) => {
      const node = element('span', 'age');
      ages.push([node, index]);
      return node;
    }), ['x']),
    line('first heard', sources.map((one) => new Date(one.firstMs).toLocaleString([], { hour12: false })), ['x']),
    texts('cause', sources.map((one) => [one.cause, one.reason].filter(Boolean).join(': '))),
    texts('sender', sources.map((one) => one.sender)),
    texts('restarts', sources.map((one) => String(one.restarts))),
    ...names.map(([key, name]) => texts(name, sources.map((one) => plain(one.hint[key])))),
  ];
  const metadata = new Set(sources.flatMap((one) => Object.keys(one.hint.metadata)));
  for (const key of metadata) lines.push(texts(key, sources.map((one) => one.hint.metadata[key] ?? '')));
  for (const th of head.querySelectorAll('th')) th.scope = 'col';
  return element('table', 'sides', element('thead', '', head), element('tbody', '', ...lines.filter(Boolean)));
}

function history(sources, nothing) {
  const steps = sources.flatMap((one) => one.history.map((step) => ({ ...step, source: one.source })));
  steps.sort((a, b) => (a.at < b.at ? 1 : -1));
  if (!steps.length) return element('p', 'none', nothing);
  const several = sources.length > 1;
  return element('ol', 'history', ...steps.map((step) => {
    const time = element('time', '', new Date(step.at).toLocaleTimeString([], { hour12: false }));
    time.dateTime = step.at;
    const why = [step.cause, step.reason, several ? `as ${step.source} has it` : ''].filter(Boolean).join(' · ');
    return element('li', '', time, status(step.status), element('small', '', why));
  }));
}

function claims(all) {
  return element('ul', 'claims', ...all.map((one) => element('li', '',
    element('b', '', one.hostname || 'no host given'), ' ',
    [one.process_name, one.process_id && `process ${one.process_id}`, `sender ${one.sender}`, `${duration(one.age_sec)} ago`]
      .filter(Boolean).join(' · '))));
}

export class Drawer {
  constructor(model, { node, title, detail, close, ask, about, closed }) {
    Object.assign(this, { model, node, title, detail, ask, about, closed });
    this.entityId = '';
    this.drawn = '';
    this.ages = [];
    close.addEventListener('click', () => this.leave());
    node.addEventListener('keydown', (event) => event.key === 'Escape' && this.leave());
  }

  /** Show an entity. */
  async open(entityId) {
    if (this.entityId !== entityId) {
      this.entityId = entityId;
      this.drawn = '';
      this.detail.replaceChildren();
      say(this.title, this.model.rows.get(entityId)?.display_name || entityId);
    }
    if (this.node.hidden) {
      this.node.hidden = false;
      document.body.classList.add('drawer-open');
      this.node.focus();
    }
    await this.refresh();
  }

  /** Ask again; does nothing while nobody looks. */
  async refresh() {
    const entityId = this.entityId;
    if (!entityId) return;
    const body = await this.ask(`?full=true&id=${encodeURIComponent(entityId)}`);
    if (!body || this.entityId !== entityId) return;
    const row = body.items[0];
    const entity = row?.href ? await this.about(row.href) : null;
    if (this.entityId === entityId) this.draw(row, body.timestamp, entity?.['x-medkit']);
  }

  leave() {
    if (this.node.hidden) return;
    this.node.hidden = true;
    this.entityId = '';
    document.body.classList.remove('drawer-open');
    this.closed();
  }

  draw(row, timestamp, about) {
    if (!row) {
      this.drawn = '';
      this.detail.replaceChildren(element('p', 'gone', 'Nothing is heard of this entity: it has expired, or was never heard.'));
      return;
    }
    // By name: which of several was heard last changes with every word.
    row.sources.sort((a, b) => (a.source < b.source ? -1 : 1));
    for (const one of row.sources) one.firstMs = Date.parse(timestamp) - one.first_seen_sec * 1000;
    row.heard = row.sources.map((one) => this.model.heard(one, timestamp));
    this.row = row;
    const needs = [...new Set(row.sources.flatMap((one) => one.hint.depends_on))];
    const neededBy = this.model.dependents(row.entity_id);
    // The table's word, for title and graph too: of several sources each answer has another's.
    const name = this.nameOf(row.entity_id) || row.display_name || row.entity_id;
    const around = [...needs, ...neededBy].map((id) => [this.model.rows.get(id)?.status, this.nameOf(id)]);
    const whole = [about?.depends_on_active, about?.depends_on_reason, about?.reason_chain];
    // Whatever rises by itself is no reason to build it anew: a reader would lose the place.
    const ageless = (key, value) => (key === 'age_sec' || key === 'first_seen_sec' || key === 'heard' || key === 'firstMs' ? 0 : value);
    const { status, conflict, restarts, sources, claims } = row;
    const gist = JSON.stringify([name, status, conflict, restarts, sources, claims, neededBy, around, whole], ageless);
    if (gist !== this.drawn) this.build(row, name, needs, neededBy, rollUp(about));
    this.drawn = gist;
    this.tick();
  }

  nameOf(entityId) {
    return this.model.rows.get(entityId)?.display_name;
  }

  build(row, name, needs, neededBy, whole) {
    say(this.title, name);
    this.ages = [];
    this.bar = element('i', 'bar');
    this.age = element('span', 'age');
    const head = element('div', 'summary', status(row.conflict ? 'conflict' : row.status),
      element('code', '', row.entity_id), this.bar, this.age);
    const links = element('p', 'links');
    for (const [what, href] of [['entity', row.href], ['beacon', row.href && `${row.href}/x-medkit-beacon`]]) {
      if (!href) continue;
      const link = element('a', '', `${what} as JSON`);
      link.href = new URL(`.${href}`, document.baseURI).href;
      links.append(link);
    }
    const picture = graph(this.model, row.entity_id, name, needs, neededBy);
    const dependencies = [whole, picture].filter(Boolean);
    const parts = [head];
    if (row.conflict) parts.push(section('Who claims this id', claims(row.claims)));
    parts.push(section(row.sources.length > 1 ? 'As each source has it' : 'What it says', sideBySide(row.sources, FIELDS, this.ages)));
    if (dependencies.length) parts.push(section('Dependencies', ...dependencies));
    const restarts = row.restarts === 1 ? '1 restart' : `${row.restarts} restarts`;
    parts.push(section(`History, ${restarts}`, history(row.sources, 'Nothing but ordinary words since it was first heard.')), links);
    this.detail.replaceChildren(...parts);
  }

  /** Let the ages go on. */
  tick() {
    if (!this.drawn) return;
    const age = (heardMs) => Math.max(0, (Date.now() - heardMs) / 1000);
    drawAge(this.bar, this.age, age(Math.max(...this.row.heard)), this.row);
    for (const [node, index] of this.ages) say(node, `${duration(age(this.row.heard[index]))} ago`);
  }
}

