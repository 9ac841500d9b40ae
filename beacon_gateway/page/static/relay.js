// The ends of the gateway's relay, if it has one: their links, their books and their topics.

import { count, duration, element, factList, rate, say } from './dom.js';

const MOST_TOPICS = 100;
const FINE = ['sent', 'delivered', 'conflated'];

const total = (ended, fine) =>
  Object.entries(ended).reduce((sum, [fate, number]) => sum + (FINE.includes(fate) === fine ? number : 0), 0);

/** What an end forwards and what it publishes, in one list. */
function topics(end) {
  const routes = (end.forward?.routes ?? []).map((one) => ({
    name: one.name && one.name !== one.topic ? `${one.topic} \u2192 ${one.name}` : one.topic,
    state: one.state,
    note: one.state === 'refused' ? one.reason : '',
  }));
  const lanes = (end.republish?.topics ?? []).map((one) => ({
    name: one.name,
    state: one.state,
    note: one.state === 'live' ? one.type : one.reason,
  }));
  return [...routes, ...lanes];
}

export class Relay {
  constructor(panel, list) {
    this.panel = panel;
    this.list = list;
    this.ends = new Map();
  }

  draw(told) {
    this.panel.hidden = !told.ends.length;
    const at = performance.now();
    for (const end of told.ends) this.end(end, at);
  }

  end(end, at) {
    let item = this.ends.get(end.name);
    if (!item) {
      item = this.made(end);
      this.ends.set(end.name, item);
      this.list.append(item.node);
    }
    const books = [end.forward, end.republish].filter(Boolean);
    const sum = (pick) => books.reduce((all, one) => all + pick(one), 0);
    const messages = sum((one) => one.messages);
    item.node.dataset.condition = end.link;
    say(item.condition, `link ${end.link}`);
    item.condition.title = `for ${duration(end.link_since_sec)}`;
    const facts = [rate(item.before, messages, at), count(messages), count(sum((one) => one.held)),
      count(sum((one) => total(one.ended, true))), count(sum((one) => total(one.ended, false))),
      count(sum((one) => one.missing ?? 0))];
    item.before = { total: messages, at };
    facts.forEach((fact, index) => say(item.facts[index], fact));
    this.topics(item, topics(end));
  }

  topics(item, all) {
    const shown = all.slice(0, MOST_TOPICS);
    while (item.topics.children.length > shown.length) item.topics.lastElementChild.remove();
    while (item.topics.children.length < shown.length) {
      item.topics.append(element('li', '', element('b'), element('span'), element('small')));
    }
    shown.forEach((one, index) => {
      const line = item.topics.children[index];
      line.dataset.state = one.state;
      [one.name, one.state, one.note].forEach((text, part) => say(line.children[part], text));
    });
    say(item.more, all.length > shown.length ? `and ${count(all.length - shown.length)} more` : '');
  }

  made(end) {
    const { list, facts } = factList('messages/s', 'messages', 'held', 'passed on', 'lost', 'missing');
    const condition = element('span', 'condition');
    const head = element('h3', '', end.name, ' ', element('small', '', `${end.network} · ${end.conduit}`));
    const made = { condition, facts, topics: element('ol'), more: element('small', '') };
    made.node = element('li', '', element('div', 'top', head, condition), list, made.topics, made.more);
    return made;
  }
}
