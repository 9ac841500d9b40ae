// The table. Only the rows in view exist: ten thousand scroll as ten do.

import { element, hashOf, say, duration, count } from './dom.js';
import { STATUS } from './model.js';

const SPARE = 6; // rows kept ready above and below
const TTL_AT = 50; // where on the age bar the time to live ends, in percent; at 100 is the expiry

/** How far along its bar an age is. */
export function along(age, ttl, expiry) {
  if (Number.isNaN(age)) return 0;
  if (age <= ttl) return (TTL_AT * age) / ttl;
  return Math.min(100, TTL_AT + ((100 - TTL_AT) * (age - ttl)) / Math.max(expiry - ttl, 0.001));
}

/** Draw an age into a bar and its text. */
export function drawAge(bar, text, age, row) {
  bar.style.setProperty('--age', `${along(age, row.ttl_sec, row.expiry_sec).toFixed(1)}%`);
  const state = row.status === 'left' ? 'left' : age < row.ttl_sec && row.status === 'active' ? 'fresh' : 'late';
  if (bar.dataset.state !== state) bar.dataset.state = state;
  say(text, duration(age));
}

export class Table {
  constructor(model, { grid, canvas, shown, empty, open }) {
    Object.assign(this, { model, grid, canvas, shown, empty, open });
    this.status = '';
    this.words = [];
    this.rows = [];
    this.pool = [];
    this.chosen = ''; // the entity the keyboard is at
    this.flashed = new Map();
    grid.addEventListener('scroll', () => this.draw(), { passive: true });
    grid.addEventListener('keydown', (event) => this.key(event));
    canvas.addEventListener('click', (event) => {
      const row = event.target.closest('.row');
      if (row) this.choose(row.dataset.id, true);
    });
    new ResizeObserver(() => this.draw()).observe(grid);
  }

  /** Show only rows with all these words, and of this status unless it is ''. */
  filter(text, status) {
    this.words = text.toLowerCase().split(/\s+/).filter(Boolean);
    this.status = status;
    this.grid.scrollTop = 0;
    this.update();
  }

  /** Which rows there are, or their order, may have changed. */
  update() {
    const all = this.model.ordered();
    const wanted = (row) =>
      (!this.status || (this.status === 'conflict' ? row.conflict : row.status === this.status)) &&
      this.words.every((word) => row.words.includes(word));
    this.rows = this.status || this.words.length ? all.filter(wanted) : all;
    const some = this.rows.length !== all.length;
    say(this.shown, some ? `${count(this.rows.length)} of ${count(all.length)}` : count(all.length));
    this.empty.hidden = this.rows.length > 0;
    say(this.empty, all.length ? 'Nothing here matches the filter.' : 'No beacon has been heard yet.');
    this.grid.setAttribute('aria-rowcount', this.rows.length + 1);
    this.draw();
  }

  /** Mark an entity of which something has just been told. */
  flash(entityId) {
    this.flashed.set(entityId, Date.now());
  }

  /** The ids of the rows in view. */
  inView() {
    return this.pool.filter((one) => !one.node.hidden).map((one) => one.node.dataset.id);
  }

  draw() {
    // As the style sheet has it: a row is higher on a phone.
    const height = parseFloat(getComputedStyle(this.grid).getPropertyValue('--row')) || 40;
    const tall = `${this.rows.length * height}px`;
    if (this.canvas.style.height !== tall) this.canvas.style.height = tall;
    const first = Math.max(0, Math.floor(this.grid.scrollTop / height) - SPARE);
    const fits = Math.ceil(this.grid.clientHeight / height) + 2 * SPARE;
    const last = Math.min(this.rows.length, first + fits);
    while (this.pool.length < last - first) this.pool.push(this.add());
    this.pool.forEach((one, index) => {
      const at = first + index;
      one.node.hidden = at >= last;
      if (!one.node.hidden) this.fill(one, this.rows[at], at, height);
    });
    const active = this.pool.find((one) => !one.node.hidden && one.node.dataset.id === this.chosen);
    if (active) this.grid.setAttribute('aria-activedescendant', active.node.id);
    else this.grid.removeAttribute('aria-activedescendant');
  }

  /** Only the ages, of the rows in view. */
  tick() {
    for (const one of this.pool) {
      if (!one.node.hidden && one.row) drawAge(one.bar, one.age, this.model.age(one.row), one.row);
    }
  }

  add() {
    const cell = (name, ...children) => {
      const made = element('span', name, ...children);
      made.setAttribute('role', 'gridcell');
      return made;
    };
    const status = element('span', 'status');
    const name = element('b');
    const id = element('small');
    const badge = element('i', 'badge');
    const bar = element('i', 'bar');
    const age = element('span', 'age');
    const [component, host, transport, source] = ['component', 'host', 'transport', 'source'].map((one) => cell(one));
    const node = element(
      'div', 'row', cell('state', status), cell('name', name, badge, id),
      component, host, transport, source, cell('heard', bar, age),
    );
    node.setAttribute('role', 'row');
    node.id = `row-${this.pool.length}`;
    this.canvas.append(node);
    return { node, status, name, id, badge, component, host, transport, source, bar, age, row: null };
  }

  fill(one, row, at, height) {
    const { node } = one;
    one.row = row;
    node.dataset.id = row.entity_id;
    node.dataset.status = row.conflict ? 'conflict' : row.status;
    node.style.transform = `translateY(${at * height}px)`;
    node.setAttribute('aria-rowindex', at + 2);
    node.setAttribute('aria-selected', row.entity_id === this.chosen);
    const flashed = this.flashed.get(row.entity_id) ?? 0;
    node.classList.toggle('flash', Date.now() - flashed < 1500);
    say(one.status, row.conflict ? 'conflict' : (STATUS[row.status] ?? row.status));
    one.status.dataset.status = node.dataset.status;
    say(one.name, row.display_name || row.entity_id);
    say(one.id, row.display_name ? row.entity_id : '');
    say(one.badge, row.restarts ? `↻ ${row.restarts}` : '');
    one.badge.title = row.restarts ? `restarted ${row.restarts} times` : '';
    say(one.component, row.component_id ?? '');
    say(one.host, [row.hostname ?? '', row.process_id ? `: ${row.process_id}` : ''].join(' ').trim());
    say(one.transport, row.transport_type ?? '');
    say(one.source, row.sources.map((each) => each.source).join(', '));
    drawAge(one.bar, one.age, this.model.age(row), row);
  }

  choose(entityId, open) {
    this.chosen = entityId;
    this.draw();
    if (open) location.hash = hashOf(entityId);
  }

  key(event) {
    const page = Math.max(1, Math.floor(this.grid.clientHeight / 40) - 2);
    const steps = { ArrowDown: 1, ArrowUp: -1, PageDown: page, PageUp: -page, Home: -Infinity, End: Infinity };
    if (event.key === 'Enter' && this.chosen) this.choose(this.chosen, true);
    if (!(event.key in steps) || !this.rows.length) return;
    event.preventDefault();
    const now = this.rows.findIndex((row) => row.entity_id === this.chosen);
    const next = Math.min(this.rows.length - 1, Math.max(0, now + steps[event.key]));
    this.chosen = this.rows[next].entity_id;
    this.reveal(next);
    this.draw();
  }

  reveal(index) {
    const height = parseFloat(getComputedStyle(this.grid).getPropertyValue('--row')) || 40;
    const head = this.canvas.offsetTop;
    const top = index * height;
    const room = this.grid.clientHeight - head - height;
    if (top < this.grid.scrollTop) this.grid.scrollTop = top;
    else if (top > this.grid.scrollTop + room) this.grid.scrollTop = top - room;
  }
}
