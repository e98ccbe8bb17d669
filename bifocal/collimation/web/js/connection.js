/**
 * The one road to the server: the state that is shown, the commands that change it, and the news
 * that others changed it. A command is kept until the server has answered it: what was typed while
 * the server was away is sent, in order, when it is back, and its id keeps it from counting twice.
 */
import { ahead } from "./ahead.js";
import { Shelf } from "./shelf.js";

const WAITS = [200, 400, 800, 1500];

/** The server understood and declined; the message is for the user. */
export class Refusal extends Error {}

/** The server cannot be reached, or no longer knows this page's token. */
class Away extends Error {
  constructor(locked) {
    super("away");
    this.locked = locked;
  }
}

const pause = (ms) => new Promise((done) => setTimeout(done, ms));

async function call(path, options) {
  let answer;
  try {
    answer = await fetch(path, options);
  } catch {
    throw new Away(false);
  }
  if (answer.status === 403) throw new Away(true);
  if (answer.ok) return answer;
  const body = await answer.json().catch(() => ({}));
  throw new Refusal(body.error ?? `${answer.status} ${answer.statusText}`);
}

/** A state with what changed since: values by key, and rows of lists by their names. */
function changed(state, { edition, values, rows }) {
  const lists = Object.entries(rows).map(([key, { order, rows: other }]) => {
    const known = new Map([...state[key], ...other].map((row) => [row.name, row]));
    return [key, order.map((name) => known.get(name))];
  });
  return { ...state, ...values, ...Object.fromEntries(lists), edition };
}

export class Connection extends EventTarget {
  constructor() {
    super();
    this.state = null;
    this.online = true;
    this.locked = false;
    this.unsent = [];
    this.shelf = new Shelf();
    this.running = false;
    this.heard = 0;
    this.moved = new Map();
  }

  /** Fetch the first state, take up what was left unsent, listen for news. */
  async start() {
    const first = await ahead;
    if (first) this.#adopt(first);
    else await this.#retry(() => this.refresh());
    this.shelf.inherit((commands) => {
      for (const { id, op, args } of commands) {
        this.#enqueue({ id, op, args, key: null }).catch((error) => this.#tell("refused", error));
      }
    });
    window.addEventListener("beforeunload", (event) => {
      if (this.unsent.length) event.preventDefault();
    });
    document.addEventListener("visibilitychange", () => this.#listen());
    this.#listen();
  }

  async refresh() {
    const answer = await call("api/state", { cache: "no-store", headers: this.#held() });
    if (!this.#adopt(await answer.json())) this.#adopt(await (await call("api/state", { cache: "no-store", headers: { "X-Edition": "none" } })).json());
  }

  /** Which edition of the state is here: the server then sends what changed since. */
  #held() {
    return { "X-Edition": this.state?.edition ?? "none" };
  }

  /** Send one command; resolves to its result, rejects with a Refusal in words. */
  send(op, args = {}) {
    return this.#enqueue({ id: crypto.randomUUID(), op, args, key: null });
  }

  /**
   * Send a pick that may still move: of those waiting for the same point only the last is sent.
   * The page shows it at once.
   */
  move(op, args) {
    const key = `${op}:${args.name}:${args.image}`;
    this.moved.set(key, [args.column, args.row]);
    const last = this.unsent.at(-1);
    if (last?.key === key && !last.sent) {
      Object.assign(last.args, args); // moved only, it stays as doubtful as it was
      this.#keep();
      this.dispatchEvent(new Event("state"));
      return last.promise;
    }
    this.dispatchEvent(new Event("state"));
    return this.#enqueue({ id: crypto.randomUUID(), op, args, key });
  }

  /** Where a pick is now: moved on the page, or as the server has it. */
  pick(kind, item, image) {
    return this.moved.get(`${kind}.pick:${item.name}:${image}`) ?? item.picks[image] ?? null;
  }

  /** Questions that change nothing: no queue, an answer or a Refusal. */
  async ask(path, question) {
    const answer = await this.#retry(() =>
      call(path, {
        method: "POST",
        headers: { "Content-Type": "application/json" },
        body: JSON.stringify(question),
      }),
    );
    return answer.json();
  }

  async get(path) {
    return (await this.#retry(() => call(path))).json();
  }

  async remove(path) {
    return call(path, { method: "DELETE" });
  }

  async upload(files) {
    const form = new FormData();
    files.forEach((file, index) => form.append(`photo${index + 1}`, file, file.name));
    const answer = await call("api/photos", { method: "POST", body: form });
    const body = await answer.json();
    this.#adopt(body.state ?? body);
  }

  #enqueue(command) {
    command.promise = new Promise((resolve, reject) => Object.assign(command, { resolve, reject }));
    this.unsent.push(command);
    this.#keep();
    this.#run();
    return command.promise;
  }

  async #run() {
    if (this.running) return;
    this.running = true;
    while (this.unsent.length) {
      const command = this.unsent[0];
      await this.#deliver(command);
      this.unsent.shift();
      this.#keep();
      if (command.key && !this.unsent.some(({ key }) => key === command.key)) {
        this.moved.delete(command.key);
        this.dispatchEvent(new Event("state"));
      }
    }
    this.running = false;
    this.#catchUp();
  }

  async #deliver(command) {
    try {
      const answer = await this.#retry(() => {
        command.sent = true;
        return call("api/command", {
          method: "POST",
          headers: { "Content-Type": "application/json", ...this.#held() },
          body: JSON.stringify({ id: command.id, op: command.op, ...command.args }),
        });
      });
      const { state, result } = await answer.json();
      if (!this.#adopt(state)) await this.#retry(() => this.refresh());
      command.resolve(result);
    } catch (error) {
      command.reject(error);
    }
  }

  /** Until the server answers: say that it is away, wait, try again. */
  async #retry(attempt) {
    for (let round = 0; ; round++) {
      try {
        const answer = await attempt();
        this.#reach(true, false);
        return answer;
      } catch (error) {
        if (!(error instanceof Away)) {
          this.#reach(true, false);
          throw error;
        }
        this.#reach(false, error.locked);
        await pause(WAITS[Math.min(round, WAITS.length - 1)]);
      }
    }
  }

  /**
   * Take a state unless it is older than what is shown; a restarted server counts anew. False if it
   * is what changed since a state that another answer has replaced meanwhile.
   */
  #adopt(told) {
    if (told.since && told.since !== this.state?.edition) return false;
    const state = told.since ? changed(this.state, told) : told;
    const same = this.state?.serving === state.serving;
    if (same && state.revision < this.state.revision) return true;
    if (!same) this.heard = state.revision;
    this.state = state;
    this.dispatchEvent(new Event("state"));
    return true;
  }

  #reach(online, locked) {
    if (online === this.online && locked === this.locked) return;
    Object.assign(this, { online, locked });
    this.dispatchEvent(new Event("reach"));
  }

  #keep() {
    this.shelf.put(this.unsent.map(({ id, op, args }) => ({ id, op, args })));
    if (this.state) this.dispatchEvent(new Event("reach"));
  }

  #tell(type, detail) {
    this.dispatchEvent(new CustomEvent(type, { detail }));
  }

  /** Only the tab that is looked at: a browser allows six connections to a server in all. */
  #listen() {
    this.source?.close();
    if (document.hidden) return;
    const source = new EventSource("api/events");
    this.source = source;
    source.onopen = () => this.#retry(() => this.refresh());
    source.onmessage = ({ data }) => {
      const news = JSON.parse(data);
      if (news.job) this.#progress(news.job);
      else {
        this.heard = news.revision;
        this.#catchUp();
      }
    };
    source.onerror = () => {
      if (source.readyState !== EventSource.CLOSED) return;
      setTimeout(() => this.source === source && this.#listen(), WAITS.at(-1));
    };
  }

  /** Fetch the state that was told of, unless the answer to a command is about to bring it. */
  #catchUp() {
    if (this.heard > this.state.revision && !this.running) this.#retry(() => this.refresh());
  }

  /** Show how far a job is; what has ended is shown together with what it made. */
  #progress(job) {
    if (job.state !== "running") {
      this.#retry(() => this.refresh());
      return;
    }
    const others = this.state.jobs.filter(({ id }) => id !== job.id);
    this.state = { ...this.state, jobs: [...others, job] };
    this.dispatchEvent(new Event("state"));
  }
}
