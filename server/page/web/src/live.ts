// The server's events: what has changed, never what it is now. The stream is opened again by our own clock, so that the page can
// say when.

import { kLeastInterval, type Answers } from "./answers.ts";

export type Connection =
  | { state: "connecting" }
  | { state: "open" }
  | { state: "server_away" } // the page's server answers; the one behind it does not
  | { state: "lost"; retryInS: number };

const kFirstRetryS = 1;
const kLastRetryS = 15;

interface CampaignEvent {
  campaign: string;
  concluded?: number;
}

// What follows from the samples of whole iterations, and from what was concluded about them.
const kConclusions = ["posterior", "compare", "diagnosis", "improvement", "grains"];
// How often what grows with every run is asked for again [ms]: no eye needs it faster, and each question costs the server.
const kStatus = 2000;
const kLists = 5000;
const kUnconcluded = 15000; // of a campaign that has no conclusion yet: the server reads all its runs for it

export class Live {
  private retryS = kFirstRetryS;
  private wasOpen = false;
  private readonly concluded = new Map<string, number>();

  constructor(
    private readonly answers: Answers,
    private readonly tell: (connection: Connection) => void,
  ) {}

  /// Opens the stream, once and for all.
  start(): void {
    // Nobody looks: nothing is asked. Who comes back sees what is so now.
    document.addEventListener("visibilitychange", () => {
      if (!document.hidden) this.answers.mark(() => kLeastInterval);
    });
    this.open();
  }

  private open(): void {
    this.tell({ state: "connecting" });
    const source = new EventSource("api/v1/events");
    source.onopen = () => {
      this.retryS = kFirstRetryS;
      this.tell({ state: "open" });
      if (this.wasOpen) this.answers.mark(() => kLeastInterval); // whatever happened in between
      this.wasOpen = true;
    };
    source.onerror = () => {
      source.close();
      this.countDown(this.retryS);
      this.retryS = Math.min(2 * this.retryS, kLastRetryS);
    };
    source.addEventListener("campaign", (event) => this.onCampaign(parse(event) as CampaignEvent));
    source.addEventListener("campaigns", () => this.mark((path) => (path === "campaigns" || path.split("/").length === 2 || path.endsWith("/lineage") ? kLeastInterval : null)));
    source.addEventListener("workers", () => this.mark((path) => (path === "workers" ? kLeastInterval : null)));
    for (const name of ["hello", "server"]) {
      source.addEventListener(name, (event) => {
        const { up } = parse(event) as { up?: boolean };
        this.tell({ state: up === false ? "server_away" : "open" });
        if (name === "server" && up === true) this.answers.mark(() => kLeastInterval);
      });
    }
  }

  private mark(which: Parameters<Answers["mark"]>[0]): void {
    if (!document.hidden) this.answers.mark(which);
  }

  private countDown(seconds: number): void {
    if (seconds <= 0) {
      this.open();
      return;
    }
    this.tell({ state: "lost", retryInS: seconds });
    setTimeout(() => this.countDown(seconds - 1), 1000);
  }

  private onCampaign(event: CampaignEvent): void {
    const id = event.campaign;
    if (typeof id !== "string") return;
    const concluded = event.concluded ?? 0;
    const isNew = this.concluded.get(id) !== concluded;
    this.concluded.set(id, concluded);
    const soon = (patience: number): number => (isNew ? kLeastInterval : patience);
    this.mark((path, answer) => {
      if (path === "campaigns") return soon(kLists);
      if (path === `campaigns/${id}`) return soon(kStatus);
      if (!path.startsWith(`campaigns/${id}/`)) return null;
      const [last = ""] = (path.split("/")[2] ?? "").split("?");
      if (last === "samples") return soon(kLists);
      if (!kConclusions.includes(last)) return null;
      if (answer.state !== "here") return soon(kLists); // a refusal costs nothing
      if (!isConclusion(answer.value)) return kUnconcluded;
      return isNew ? kLeastInterval : null;
    });
  }
}

function isConclusion(value: unknown): boolean {
  if (value === null || typeof value !== "object") return false;
  return (value as { rms_error?: unknown }).rms_error !== null;
}

function parse(event: Event): unknown {
  try {
    return JSON.parse((event as MessageEvent<string>).data) as unknown;
  } catch {
    return {};
  }
}
