// The stream of events, read with `fetch`: so a token can be sent, and a refusal is understood.

const SILENT_MS = 35_000; // the gateway says something at least every 15 s
const FIRST_PAUSE_MS = 1_000;
const LONGEST_PAUSE_MS = 15_000;

export class Stream {
  /** `tell(kind, body)` for each event; `state({...})` whenever the line comes or goes. */
  constructor(url, { headers, tell, state }) {
    this.url = url;
    this.headers = headers;
    this.tell = tell;
    this.state = state;
    this.last = '';
    this.pauseMs = FIRST_PAUSE_MS;
    this.timer = 0;
    this.abort = null;
  }

  /** Connect now, whatever is going on. */
  async open() {
    clearTimeout(this.timer);
    this.abort?.abort();
    const abort = (this.abort = new AbortController());
    let reason = 'the gateway does not answer';
    let pauseMs = 0;
    try {
      const headers = { Accept: 'text/event-stream', ...this.headers() };
      if (this.last) headers['Last-Event-ID'] = this.last;
      const answer = await fetch(this.url, { headers, cache: 'no-store', signal: abort.signal });
      if (answer.status === 401 || answer.status === 403) {
        this.state({ up: false, locked: true });
        return;
      }
      if (!answer.ok) {
        pauseMs = 1000 * Number(answer.headers.get('Retry-After') ?? 0);
        throw new Error(answer.status === 503 ? 'it serves as many as it can' : `it answers ${answer.status}`);
      }
      this.pauseMs = FIRST_PAUSE_MS;
      this.state({ up: true });
      reason = await this.read(answer.body.getReader(), abort);
    } catch (error) {
      if (this.abort !== abort) return; // somebody has opened it anew
      if (error.name === 'AbortError') reason = 'nothing was heard for a while';
      else if (!(error instanceof TypeError)) reason = error.message;
    }
    if (this.abort !== abort) return;
    pauseMs ||= this.pauseMs;
    this.pauseMs = Math.min(2 * this.pauseMs, LONGEST_PAUSE_MS);
    this.state({ up: false, reason, nextMs: Date.now() + pauseMs });
    this.timer = setTimeout(() => this.open(), pauseMs);
  }

  /** Let go of the line, until it is opened again. */
  close() {
    clearTimeout(this.timer);
    const abort = this.abort;
    this.abort = null;
    abort?.abort();
  }

  async read(reader, abort) {
    const decoder = new TextDecoder();
    const silence = () => setTimeout(() => abort.abort(), SILENT_MS);
    let timer = silence();
    let pieces = [];
    let reason = 'the gateway closed the line';
    try {
      for (;;) {
        const { done, value } = await reader.read();
        clearTimeout(timer);
        if (done) return reason;
        timer = silence();
        const text = decoder.decode(value, { stream: true });
        // A snapshot comes in many pieces: they are put together once, at its end.
        if (!text.includes('\n\n') && !(pieces.at(-1)?.endsWith('\n') && text.startsWith('\n'))) {
          pieces.push(text);
          continue;
        }
        const blocks = (pieces.join('') + text).split('\n\n');
        pieces = [blocks.pop()];
        for (const block of blocks) reason = this.take(block) || reason;
      }
    } finally {
      clearTimeout(timer);
    }
  }

  // Returns why the line ends, if the gateway says so.
  take(block) {
    const fields = {};
    for (const line of block.split('\n')) {
      const at = line.indexOf(': ');
      if (at > 0) fields[line.slice(0, at)] = line.slice(at + 2);
    }
    if (!fields.event) return '';
    const body = JSON.parse(fields.data);
    if (fields.event === 'dropped' || fields.event === 'end') return body.reason;
    if (fields.id) this.last = fields.id;
    this.tell(fields.event, body);
    return '';
  }
}
