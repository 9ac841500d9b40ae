// What the gateway has told, and how old it is by now.

const RANK = { stale: 1, expected: 2, left: 3, active: 4 };

const byId = (all) => new Map(all.map((one) => [one.entity_id, one]));

/** What to call a status. */
export const STATUS = { expected: 'not heard' };

export class Model {
  constructor() {
    this.rows = new Map();
    this.expected = new Map(); // who is known beforehand, heard or not
    this.sources = [];
    this.version = 0; // rises with each change of what is listed, or of its order
    this.ahead = Infinity; // how far this machine's clock is ahead of the gateway's, in ms
    this.sorted = [];
    this.sortedVersion = -1;
  }

  /** Everything anew. */
  replace(snapshot) {
    this.tick(snapshot.timestamp);
    this.sources = snapshot.sources;
    this.expected = byId(snapshot.expected);
    const heard = this.rows;
    this.rows = new Map();
    for (const row of snapshot.items) this.put(row, snapshot.timestamp, heard.get(row.entity_id));
    for (const id of this.expected.keys()) this.miss(id);
    this.version += 1;
  }

  /** One event. */
  apply(kind, body) {
    this.tick(body.timestamp);
    if (kind === 'expected') this.expect(body.expected);
    if (!body.beacon) return;
    const id = body.beacon.entity_id;
    if (kind === 'expired') {
      this.rows.delete(id);
      this.miss(id);
    } else this.put(body.beacon, body.timestamp, this.rows.get(id));
    this.version += 1;
  }

  /** Rows that were asked for because they are in view: only when they were heard is news. */
  refresh(items, timestamp) {
    this.tick(timestamp);
    for (const item of items) {
      const row = this.rows.get(item.entity_id);
      if (row && row.status !== 'expected') row.heardMs = Math.max(row.heardMs, this.heard(item, timestamp));
    }
  }

  /** Seconds since it was heard. */
  age(row) {
    return Math.max(0, (Date.now() - row.heardMs) / 1000); // of one that was never heard: NaN
  }

  /** Ids of those that need this one. */
  dependents(entityId) {
    const found = [];
    for (const row of this.rows.values()) {
      if (row.depends_on?.includes(entityId)) found.push(row.entity_id);
    }
    return found;
  }

  /** How many there are of each status; a conflict is counted besides. */
  tally() {
    const counts = { active: 0, stale: 0, left: 0, expected: 0, conflict: 0 };
    for (const row of this.rows.values()) {
      counts[row.status] += 1;
      if (row.conflict) counts.conflict += 1;
    }
    return counts;
  }

  /** All rows, what needs attention first. */
  ordered() {
    if (this.sortedVersion !== this.version) {
      this.sorted = [...this.rows.values()].sort(
        (a, b) => a.rank - b.rank || (a.key < b.key ? -1 : a.key > b.key ? 1 : 0),
      );
      this.sortedVersion = this.version;
    }
    return this.sorted;
  }

  // Others are known beforehand: who was missed only for that is not any more.
  expect(all) {
    for (const row of this.rows.values()) if (row.status === 'expected') this.rows.delete(row.entity_id);
    this.expected = byId(all);
    for (const id of this.expected.keys()) this.miss(id);
    this.version += 1;
  }

  // One that is known beforehand stays in the table when nothing is heard of it.
  miss(entityId) {
    const known = this.expected.get(entityId);
    if (!known || this.rows.has(entityId)) return;
    const silent = { status: 'expected', conflict: false, restarts: 0, sources: [], ttl_sec: 1, expiry_sec: 2, age_sec: NaN };
    this.put({ ...known, ...silent }, '', null);
  }

  put(row, timestamp, known) {
    row.rank = row.conflict ? 0 : RANK[row.status];
    row.key = (row.display_name || row.entity_id).toLowerCase() + '\0' + row.entity_id;
    row.words = [
      row.entity_id, row.display_name, row.component_id, row.hostname, row.process_id,
      row.process_name, row.transport_type, STATUS[row.status] ?? row.status, row.conflict ? 'conflict' : '',
      ...row.sources.map((one) => one.source),
    ].join('\n').toLowerCase();
    row.heardMs = this.heard(row, timestamp);
    if (known && known.restarts === row.restarts) row.heardMs = Math.max(row.heardMs, known.heardMs);
    this.rows.set(row.entity_id, row);
  }

  heard(row, timestamp) {
    return Date.parse(timestamp) + this.ahead - row.age_sec * 1000;
  }

  // The message that was under way for the shortest time shows best how the clocks differ.
  tick(timestamp) {
    this.ahead = Math.min(this.ahead, Date.now() - Date.parse(timestamp));
  }
}
