// @ts-check
/** The line to the server: one request of a kind in flight, and of those that wait the newest. */

export class Link {
  /** @param {(message: any) => void} heard */
  constructor(heard) {
    this.heard = heard;
    this.number = 0;
    /** @type {Map<number, (answer: any) => void>} */
    this.waiting = new Map();
    /** @type {Map<string, {busy: boolean, next: any}>} */
    this.kinds = new Map();
    /** @type {WebSocket | null} */
    this.socket = null;
    this.open();
  }

  open() {
    const token = new URLSearchParams(location.search).get("token") ?? "";
    const socket = new WebSocket(`ws://${location.host}/live?token=${encodeURIComponent(token)}`);
    this.socket = socket;
    socket.onopen = () => { this.kinds.clear(); this.waiting.clear(); this.heard({ connected: true }); };
    socket.onmessage = (event) => {
      const message = JSON.parse(event.data);
      const done = this.waiting.get(message.id);
      if (done) { this.waiting.delete(message.id); done(message); } else this.heard(message);
    };
    socket.onclose = () => {
      this.heard({ connected: false });
      setTimeout(() => this.open(), 700);
    };
  }

  /** Ask, in order, and hear the answer. @param {any} message @returns {Promise<any>} */
  ask(message) {
    return new Promise((resolve) => {
      if (this.socket?.readyState !== WebSocket.OPEN) { resolve({ error: "not connected" }); return; }
      const id = ++this.number;
      this.waiting.set(id, resolve);
      this.socket.send(JSON.stringify({ id, ...message }));
    });
  }

  /** Ask of a kind of which only the latest matters, such as where the cursor is.
   * @param {string} kind @param {any} message @param {(answer: any) => void} done
   * @param {(error: string) => void} failed */
  latest(kind, message, done, failed = () => {}) {
    const state = this.kinds.get(kind) ?? { busy: false, next: null };
    this.kinds.set(kind, state);
    if (state.busy) { state.next = [message, done, failed]; return; }
    state.busy = true;
    this.ask(message).then((answer) => {
      state.busy = false;
      if (answer.error) failed(answer.error); else done(answer);
      if (state.next) { const [m, d, f] = state.next; state.next = null; this.latest(kind, m, d, f); }
    });
  }
}
