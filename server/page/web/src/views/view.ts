// What views share: how they ask for documents, what they say while there is nothing to show, headings and warnings.

import type { Answer, Answers } from "../answers.ts";
import { h, replace, value, type Child } from "../dom.ts";
import type { Figure } from "../figures/figure.ts";
import { frameOf, type Frame } from "../figures/frame.ts";
import type { Status } from "../documents.ts";
import { numberText } from "../units.ts";

export interface Context {
  answers: Answers;
  campaign: string;
  options: URLSearchParams;
  inReport?: boolean; // nobody is there to go on with anything
  /// Goes to the same view with this option; empty: without it.
  choose(name: string, value: string): void;
}

/// A view fills `root` and returns what ends it.
export type View = (root: HTMLElement, context: Context) => () => void;

/// Watches several documents of a campaign and shows them together whenever one changes, at most once a task.
export function watchAll(
  context: Context,
  paths: readonly string[],
  show: (answers: Answer<unknown>[]) => void,
): () => void {
  const known: Answer<unknown>[] = paths.map(() => ({ state: "asked" }));
  let planned = false;
  let ended = false;
  const stops = paths.map((path, i) =>
    context.answers.watch(path, (answer) => {
      known[i] = answer;
      if (planned) return;
      planned = true;
      setTimeout(() => {
        planned = false;
        if (!ended) show(known);
      });
    }),
  );
  return () => {
    ended = true;
    for (const stop of stops) stop();
  };
}

export const valueOf = <T>(answer: Answer<unknown> | undefined): T | null =>
  answer?.state === "here" ? (answer.value as T) : null;

/// Figures that stay in place while their documents change: a frame per id, in the order of the last update.
export class FigureList {
  readonly element: HTMLElement;
  private readonly frames = new Map<string, Frame>();

  constructor(className = "figures") {
    this.element = h("div", { class: className });
  }

  update(figures: readonly Figure[]): void {
    const wanted = new Set(figures.map(({ id }) => id));
    for (const [id, frame] of this.frames) {
      if (wanted.has(id)) continue;
      frame.element.remove();
      this.frames.delete(id);
    }
    figures.forEach((figure, i) => {
      let frame = this.frames.get(figure.id);
      if (frame === undefined) {
        frame = frameOf(figure);
        this.frames.set(figure.id, frame);
      } else {
        frame.update(figure);
      }
      if (this.element.children[i] !== frame.element) this.element.insertBefore(frame.element, this.element.children[i] ?? null);
    });
  }
}

/// Fills an element anew only when what it shows has changed: what is open in it, chosen or focused stays.
export function keeper(element: HTMLElement): (shows: unknown, make: () => Child) => void {
  let last: string | null = null;
  return (shows, make) => {
    const key = JSON.stringify(shows);
    if (key === last) return;
    last = key;
    replace(element, make());
  };
}

/// What is said where nothing can be drawn: why, and what will come when.
export function empty(title: string, ...sentences: Child[]): HTMLElement {
  return h("div", { class: "empty" }, h("h3", {}, title), ...sentences.map((sentence) => h("p", {}, sentence)));
}

/// Of a document that is not here. comes: what it will show and when, said where there is none yet.
export function absent(answer: Answer<unknown> | undefined, comes: Child): HTMLElement | null {
  if (answer === undefined || answer.state === "asked") return h("p", { class: "asked" }, "Asking the server …");
  if (answer.state === "none") return empty("Nothing to show yet", comes, answer.sentence);
  if (answer.state === "failed") return empty("The server could not answer", answer.sentence);
  return null;
}

const kWarningsInSight = 2;

export function warnings(texts: readonly string[]): HTMLElement | null {
  if (texts.length === 0) return null;
  const list = (some: readonly string[]): HTMLElement => h("ul", {}, some.map((text) => h("li", {}, text)));
  const rest = texts.slice(kWarningsInSight);
  return h("section", { class: "warnings", "aria-label": "Warnings" }, list(texts.slice(0, kWarningsInSight)),
    rest.length === 0 ? null : h("details", {}, h("summary", {}, rest.length === 1 ? "1 more warning" : `${rest.length} more warnings`), list(rest)));
}

/// A number with its name: the instrument's dial.
export function reading(name: string, raw: number | string | null, shown: string, note: Child = null): HTMLElement {
  return h("div", { class: "reading", "data-name": name }, h("dt", {}, name), h("dd", {}, value(raw, shown), note === null ? null : h("small", {}, note)));
}

export const plainReading = (name: string, raw: number | null | undefined, digits = 3, note: Child = null): HTMLElement =>
  reading(name, raw ?? null, numberText(raw, digits), note);

const kStateMarks: Record<Status["state"], string> = {
  queued: "○", running: "◐", paused: "‖", finished: "●", failed: "✕", cancelled: "–",
};

export function stateBadge(state: Status["state"]): HTMLElement {
  return h("span", { class: `state ${kStateMarks[state] === undefined ? "" : state}`, "data-value": state },
    h("span", { "aria-hidden": "true" }, kStateMarks[state] ?? "?"), ` ${state}`);
}

/// A text to take along, as a command.
export function copyable(text: string, what: string): HTMLElement {
  const button = h("button", {
    type: "button", "aria-label": `Copy ${what}`,
    onclick: () => {
      void navigator.clipboard.writeText(text).then(
        () => said("Copied"),
        () => said("Select and copy by hand"),
      );
    },
  }, "Copy");
  const said = (word: string): void => {
    button.textContent = word;
    setTimeout(() => (button.textContent = "Copy"), 1500);
  };
  return h("div", { class: "copyable" }, h("pre", { tabindex: 0 }, h("code", {}, text)), button);
}
