// What an entity needs, and who needs it: one step each way.

import { drawn, element, hashOf } from './dom.js';

const MOST = 8; // to each side; more are counted
const WIDE = 128;
const HIGH = 30;
const GAP = 10;
const WIDTH = 460;

const short = (text) => (text.length > 17 ? `${text.slice(0, 16)}…` : text);

function box(model, entityId, x, y, chosen = '') {
  const row = model.rows.get(entityId);
  const heard = row && row.status !== 'expected';
  const status = heard ? (row.conflict ? 'conflict' : row.status) : 'missing';
  const name = chosen || row?.display_name || entityId;
  const title = drawn('title', {});
  title.textContent = `${name} (${entityId}): ${heard ? status : 'not heard'}`;
  const text = drawn('text', { x: x + WIDE / 2, y: y + HIGH / 2 + 4, 'text-anchor': 'middle' });
  text.textContent = short(name);
  const parts = [title, drawn('rect', { x, y, width: WIDE, height: HIGH, rx: 6 }), text];
  const link = chosen ? drawn('g', {}, ...parts) : drawn('a', { href: hashOf(entityId) }, ...parts);
  link.setAttribute('class', `node ${status}${chosen ? ' chosen' : ''}`);
  return link;
}

function column(model, ids, x, height) {
  const shown = ids.slice(0, MOST);
  const top = (height - shown.length * (HIGH + GAP) + GAP) / 2;
  return shown.map((id, index) => ({ id, y: top + index * (HIGH + GAP), x }));
}

/** Whether all that it needs is there, or what is not and by which way; nothing if it needs nobody. */
export function rollUp(about) {
  const active = about?.depends_on_active;
  if (active === undefined) return null;
  const line = element('p', 'rollup', active ? 'All it depends on is active.'
    : `${about.depends_on_reason}: ${about.reason_chain.join(' → ')}`);
  line.dataset.active = active;
  return line;
}

/** The graph, or nothing if there is none. */
export function graph(model, entityId, name, needs, neededBy) {
  if (!needs.length && !neededBy.length) return null;
  const most = Math.min(MOST, Math.max(needs.length, neededBy.length, 1));
  const height = most * (HIGH + GAP) - GAP + 8;
  const middle = { x: (WIDTH - WIDE) / 2, y: (height - HIGH) / 2 };
  const left = column(model, neededBy, 1, height);
  const right = column(model, needs, WIDTH - WIDE - 1, height);
  const line = (x1, y1, x2, y2) => drawn('path', {
    class: 'edge', d: `M${x1} ${y1 + HIGH / 2}C${(x1 + x2) / 2} ${y1 + HIGH / 2} ${(x1 + x2) / 2} ${y2 + HIGH / 2} ${x2} ${y2 + HIGH / 2}`,
  });
  const svg = drawn('svg', { viewBox: `0 0 ${WIDTH} ${height}`, role: 'group', 'aria-label': 'Dependencies' },
    ...left.map((one) => line(one.x + WIDE, one.y, middle.x, middle.y)),
    ...right.map((one) => line(middle.x + WIDE, middle.y, one.x, one.y)),
    ...[...left, ...right].map((one) => box(model, one.id, one.x, one.y)),
    box(model, entityId, middle.x, middle.y, name));
  const more = (ids) => (ids.length > MOST ? `, ${ids.length - MOST} more` : '');
  return element('figure', 'graph',
    element('figcaption', '', element('span', '', `needed by ${neededBy.length}${more(neededBy)}`),
      element('span', '', `needs ${needs.length}${more(needs)}`)), svg);
}
