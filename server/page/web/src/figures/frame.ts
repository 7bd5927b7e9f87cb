// The frame of a figure on the page: drawn when it comes into sight, at the width it has, one figure a task, so that no script
// holds the page up; its table, CSV and SVG beside it.

import { h, replace, svg } from "../dom.ts";
import { numberText } from "../units.ts";
import { csvText, type Figure, type KeyEntry, type Table } from "./figure.ts";

const kPaperWidth = 700; // px of A4 within its margins
const kPaperGap = 12;
const kNear = "400px"; // drawn before it is seen
const kSeen = new WeakMap<Element, () => void>();
const kPaper = new WeakMap<Element, (width: number) => void>();
const kWhenSeen = new IntersectionObserver(
  (entries) => {
    for (const entry of entries) if (entry.isIntersecting) kSeen.get(entry.target)?.();
  },
  { rootMargin: kNear },
);
const kWidths = new WeakMap<Element, () => void>();
const kWhenResized = new ResizeObserver((entries) => {
  for (const { target } of entries) kWidths.get(target)?.();
});

// Drawings that wait for their turn.
const kQueue: (() => void)[] = [];
function soon(task: () => void): void {
  kQueue.push(task);
  if (kQueue.length === 1) setTimeout(next);
}
function next(): void {
  kQueue[0]?.();
  kQueue.shift();
  if (kQueue.length > 0) setTimeout(next);
}

export interface Frame {
  element: HTMLElement;
  update(figure: Figure): void;
}

export function frameOf(first: Figure): Frame {
  let figure = first;
  let seen = false;
  let waiting = false;
  let drawnWidth = 0;
  const picture = h("div", { class: "picture" });
  const key = h("ul", { class: "key" });
  const title = h("h3", {});
  const caption = h("p", { class: "caption" });
  const tableHolder = h("div", { class: "scroll", tabindex: 0, role: "region", hidden: true });
  const tableButton = h("button", { type: "button", "aria-expanded": "false", onclick: () => toggleTable() }, "Table");
  const element = h(
    "figure",
    { class: "figure", "data-figure": figure.id },
    h("div", { class: "figure-head" }, title,
      h("div", { class: "tools", role: "group", "aria-label": "This figure as" },
        tableButton,
        h("button", { type: "button", onclick: () => save(`${fileName(figure.id)}.csv`, "text/csv", csvText(figure.table())) }, "CSV"),
        h("button", { type: "button", onclick: () => saveSvg() }, "SVG"),
      ),
    ),
    key,
    picture,
    h("figcaption", {}, caption),
    tableHolder,
  );

  function draw(width = Math.floor(picture.clientWidth)): void {
    waiting = false;
    if (width === 0 || !element.isConnected) return;
    drawnWidth = width;
    picture.replaceChildren(figure.draw(width));
    if (!tableHolder.hidden) replace(tableHolder, tableElement(figure.title, figure.table()));
  }
  function plan(): void {
    if (waiting || !seen) return;
    waiting = true;
    soon(() => draw());
  }
  function label(): void {
    title.textContent = figure.title;
    caption.textContent = figure.description;
    element.setAttribute("data-figure", figure.id);
    key.hidden = figure.key === undefined;
    replace(key, (figure.key ?? []).map(keyEntry));
    tableHolder.setAttribute("aria-label", `${figure.title}: table`);
  }
  function toggleTable(): void {
    tableHolder.hidden = !tableHolder.hidden;
    tableButton.setAttribute("aria-expanded", String(!tableHolder.hidden));
    if (!tableHolder.hidden) replace(tableHolder, tableElement(figure.title, figure.table()));
  }
  function saveSvg(): void {
    const shown = picture.querySelector("svg");
    if (shown !== null) save(`${fileName(figure.id)}.svg`, "image/svg+xml", standalone(shown));
  }

  label();
  kSeen.set(element, () => {
    seen = true;
    kWhenSeen.unobserve(element);
    plan();
  });
  kWhenSeen.observe(element);
  kPaper.set(element, draw);
  kWidths.set(picture, () => {
    if (Math.floor(picture.clientWidth) !== drawnWidth) plan();
  });
  kWhenResized.observe(picture);
  return {
    element,
    update(changed: Figure): void {
      figure = changed;
      label();
      plan();
    },
  };
}

/// Draws whatever has not come into sight, one figure a task.
export function drawSoon(root: ParentNode): void {
  for (const figure of root.querySelectorAll("figure")) kSeen.get(figure)?.();
}

/// Draws all now, in this task, as wide as they are on paper: alone or two beside each other (page.css).
export function drawForPaper(root: ParentNode): void {
  for (const figure of root.querySelectorAll("figure")) {
    kPaper.get(figure)?.(figure.closest(".single") === null ? kPaperWidth / 2 - kPaperGap : kPaperWidth);
  }
}

/// Draws anew what is not as wide as its place.
export function drawForScreen(root: ParentNode): void {
  for (const picture of root.querySelectorAll(".picture")) kWidths.get(picture)?.();
}

export function tableElement(caption: string, table: Table): HTMLTableElement {
  const factor = table.columns.map(({ shown }) => shown?.factor ?? 1);
  return h(
    "table",
    {},
    h("caption", {}, caption),
    h("thead", {}, h("tr", {}, table.columns.map(({ name, unit, shown }) => {
      const label = shown?.label ?? (unit === "1" ? "" : unit ?? "");
      return h("th", { scope: "col" }, label === "" ? name : `${name} [${label}]`);
    }))),
    h("tbody", {}, table.rows.map((row) =>
      h("tr", {}, row.map((cell, i) =>
        typeof cell === "string"
          ? h("td", { class: "text" }, cell)
          : h("td", { "data-value": cell ?? "null" }, numberText(cell === null ? null : cell * factor[i]!)),
      )),
    )),
  );
}

function keyEntry({ mark, color, text }: KeyEntry): HTMLElement {
  const shape = {
    dot: () => svg("circle", { cx: 6, cy: 6, r: 3.4, fill: color }),
    ring: () => svg("circle", { cx: 6, cy: 6, r: 3.4, fill: "none", stroke: color, "stroke-width": 1.8 }),
    line: () => svg("path", { d: "M1 6H23", stroke: color, "stroke-width": 2.2 }),
    dash: () => svg("path", { d: "M1 6H23", stroke: color, "stroke-width": 1.6, "stroke-dasharray": "5 3" }),
    faint: () => svg("path", { d: "M1 6H23", stroke: color, "stroke-width": 1, "stroke-opacity": 0.7 }),
    band: () => svg("rect", { x: 1, y: 1, width: 22, height: 10, fill: color, "fill-opacity": 0.3 }),
    box: () => svg("rect", { x: 1, y: 1.5, width: 22, height: 9, fill: "none", stroke: color }),
  }[mark]();
  const width = mark === "dot" || mark === "ring" ? 12 : 24;
  return h("li", {}, svg("svg", { width, height: 12, viewBox: `0 0 ${width} 12`, "aria-hidden": "true" }, shape), text);
}

const fileName = (id: string): string => id.replace(/[^A-Za-z0-9._-]+/g, "_");

function save(name: string, type: string, text: string): void {
  const url = URL.createObjectURL(new Blob([text], { type }));
  h("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 1000);
}

const kResolved = ["fill", "stroke", "color", "font-family", "font-size", "font-weight"];

// What the style sheet says of a drawing goes with it.
function standalone(shown: SVGSVGElement): string {
  const copy = shown.cloneNode(true) as SVGSVGElement;
  const originals = [shown, ...shown.querySelectorAll("*")];
  [copy, ...copy.querySelectorAll("*")].forEach((element, i) => {
    const style = getComputedStyle(originals[i]!);
    for (const name of kResolved) element.setAttribute(name, style.getPropertyValue(name));
  });
  copy.setAttribute("xmlns", "http://www.w3.org/2000/svg");
  return `<?xml version="1.0" encoding="UTF-8"?>\n${new XMLSerializer().serializeToString(copy)}\n`;
}
