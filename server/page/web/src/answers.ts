// The documents that are shown, each held once: asked for when a view wants it, and again when an event has said that it
// changed, at most once in kLeastInterval, and later where that is soon enough. Nothing is asked that nobody shows.

/// What is known of a document. sentence: why it is not here, in the server's words.
export type Answer<T> =
  | { state: "asked" }
  | { state: "here"; value: T }
  | { state: "none"; sentence: string } // there is none yet, or none of this name
  | { state: "failed"; sentence: string; status: number }; // status 0: no server answered

export interface Reply {
  status: number;
  text: string;
  etag: string | null;
}

/// Asks for a path below /api/v1. Rejects where no server answers.
export type Ask = (path: string, etag: string | null) => Promise<Reply>;

export const kLeastInterval = 1000; // ms between two questions for one document

const kNotModified = 304;
const kNotThere = [404, 409]; // no such document; not before something else is done
const kTryAgainAfter = 3000; // ms, where the server said that it cannot answer now

type Listener = (answer: Answer<unknown>) => void;

interface Held {
  path: string;
  answer: Answer<unknown>;
  text: string;
  etag: string | null;
  listeners: Set<Listener>;
  stale: boolean;
  busy: boolean;
  askedAt: number;
  patience: number; // ms between two questions that whoever marked it last is content with
  due: number; // when it will be asked for again; infinite: no question is planned
}

export class Answers {
  private readonly held = new Map<string, Held>();

  constructor(
    private readonly ask: Ask,
    private readonly now: () => number = () => performance.now(),
    private readonly later: (task: () => void, ms: number) => void = (task, ms) => void setTimeout(task, ms),
  ) {}

  /// Calls `listener` with what is known of the document, at once and whenever that changes, until the returned function is
  /// called.
  watch<T>(path: string, listener: (answer: Answer<T>) => void): () => void {
    const entry = this.entry(path);
    const heard = listener as Listener;
    entry.listeners.add(heard);
    heard(entry.answer);
    this.plan(entry);
    return () => {
      entry.listeners.delete(heard);
    };
  }

  /// Documents may have changed: `which` says how many ms after the last question they may be asked for again at the earliest;
  /// null: this one has not changed. What was marked more urgently stays so.
  mark(which: (path: string, answer: Answer<unknown>) => number | null): void {
    for (const entry of this.held.values()) {
      const patience = which(entry.path, entry.answer);
      if (patience === null) continue;
      entry.patience = Math.max(kLeastInterval, entry.stale ? Math.min(entry.patience, patience) : patience);
      entry.stale = true;
      this.plan(entry);
    }
  }

  private entry(path: string): Held {
    let entry = this.held.get(path);
    if (entry === undefined) {
      entry = {
        path,
        answer: { state: "asked" },
        text: "",
        etag: null,
        listeners: new Set(),
        stale: true,
        busy: false,
        askedAt: -Infinity,
        patience: kLeastInterval,
        due: Infinity,
      };
      this.held.set(path, entry);
    }
    return entry;
  }

  private plan(entry: Held): void {
    if (!entry.stale || entry.busy || entry.listeners.size === 0) return;
    const due = entry.askedAt + entry.patience;
    if (due <= this.now()) {
      void this.fetch(entry);
    } else if (due < entry.due) {
      entry.due = due;
      this.later(() => {
        if (entry.due === due) entry.due = Infinity;
        this.plan(entry);
      }, due - this.now());
    }
  }

  private async fetch(entry: Held): Promise<void> {
    entry.busy = true;
    entry.stale = false;
    entry.askedAt = this.now();
    try {
      const reply = await this.ask(entry.path, entry.etag);
      this.take(entry, reply);
    } catch {
      this.tell(entry, { state: "failed", status: 0, sentence: "The server does not answer." });
    }
    entry.busy = false;
    this.plan(entry);
  }

  private take(entry: Held, reply: Reply): void {
    const unchanged = reply.text === entry.text && entry.answer.state === "here";
    if (reply.status === kNotModified || (reply.status === 200 && unchanged)) return;
    entry.etag = reply.status === 200 ? reply.etag : null;
    entry.text = reply.status === 200 ? reply.text : "";
    if (reply.status === 200) {
      try {
        this.tell(entry, { state: "here", value: JSON.parse(reply.text) as unknown });
      } catch {
        this.tell(entry, { state: "failed", status: 200, sentence: "The server's answer is not complete." });
      }
    } else if (kNotThere.includes(reply.status)) {
      this.tell(entry, { state: "none", sentence: sentenceOf(reply) });
    } else {
      this.tell(entry, { state: "failed", status: reply.status, sentence: sentenceOf(reply) });
      if (reply.status === 503) {
        this.later(() => {
          entry.stale = true;
          this.plan(entry);
        }, kTryAgainAfter);
      }
    }
  }

  // What was here stays in sight while the server is away: the head of the page says that it is.
  private tell(entry: Held, answer: Answer<unknown>): void {
    if (answer.state === "failed" && entry.answer.state === "here" && answer.status !== 401) return;
    entry.answer = answer;
    for (const listener of [...entry.listeners]) listener(answer);
  }
}

function sentenceOf(reply: Reply): string {
  try {
    const error = (JSON.parse(reply.text) as { error?: unknown }).error;
    if (typeof error === "string" && error !== "") return error;
  } catch {
    // not ours: the status has to do
  }
  if (reply.status === 401) return "The server wants its token: open the address that `calibctl page` prints.";
  return `The server answered with status ${reply.status}.`;
}

/// Over HTTP, relative to the page.
export const askServer: Ask = async (path, etag) => {
  const headers: Record<string, string> = etag === null ? {} : { "If-None-Match": etag };
  const response = await fetch(`api/v1/${path}`, { headers, credentials: "same-origin", cache: "no-store" });
  return {
    status: response.status,
    text: response.status === kNotModified ? "" : await response.text(),
    etag: response.headers.get("ETag"),
  };
};
