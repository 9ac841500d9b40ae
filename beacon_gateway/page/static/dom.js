// Elements and numbers. Whatever comes from a robot goes through `textContent` and nothing else.

/** An element with a class, and with texts and elements in it. */
export function element(tag, className = '', ...children) {
  const made = document.createElement(tag);
  if (className) made.className = className;
  made.append(...children.map((child) => (child instanceof Node ? child : String(child))));
  return made;
}

/** An SVG element. */
export function drawn(tag, attributes, ...children) {
  const made = document.createElementNS('http://www.w3.org/2000/svg', tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.append(...children);
  return made;
}

/** Set a text only where it differs: a changed node is drawn and announced again. */
export function say(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

/** Seconds, as short as they are worth. */
export function duration(seconds) {
  if (Number.isNaN(seconds)) return '–';
  if (seconds < 9.95) return `${Math.max(0, seconds).toFixed(1)} s`;
  if (seconds < 99.5) return `${Math.round(seconds)} s`;
  if (seconds < 3600) return `${Math.floor(seconds / 60)} min ${Math.floor(seconds % 60)} s`;
  const hours = Math.floor(seconds / 3600);
  if (hours < 48) return `${hours} h ${Math.floor((seconds % 3600) / 60)} min`;
  return `${Math.floor(hours / 24)} d ${hours % 24} h`;
}

const counts = new Intl.NumberFormat('en');

/** A count, with its thousands apart. */
export const count = (number) => counts.format(number);

/** A counter on the page; one of nothing stands back. */
export function counter(node, number) {
  say(node, count(number));
  node.classList.toggle('none', number === 0);
}

/** How many a second, since a total was this at that time (ms); a dash if there is no such time. */
export function rate(before, total, at) {
  if (!before) return '–';
  const speed = Math.max(0, total - before.total) / Math.max(0.001, (at - before.at) / 1000);
  return speed < 10 ? speed.toFixed(1) : count(Math.round(speed));
}

/** A list of named facts that are not known yet, and where to write each. */
export function factList(...names) {
  const facts = names.map(() => element('dd', '', '–'));
  const lines = names.map((name, index) => element('div', '', element('dt', '', name), facts[index]));
  return { list: element('dl', '', ...lines), facts };
}

/** The address of an entity on this page. */
export const hashOf = (entityId) => `#entity=${encodeURIComponent(entityId)}`;
