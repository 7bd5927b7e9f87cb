// What a figure is, wherever it stands: a drawing for eyes, a table of the same numbers for whoever reads or goes on with them.
// Figures are made from documents alone, so that the live page and the report draw them by the same code.

import * as Plot from "@observablehq/plot";
import type { DisplayUnit } from "../units.ts";

/// Values are the document's own (SI); `shown` says in which unit they are drawn.
export interface Column {
  name: string;
  unit?: string;
  shown?: DisplayUnit;
}

export interface Table {
  columns: Column[];
  rows: (string | number | null)[][];
}

export interface KeyEntry {
  mark: "dot" | "ring" | "line" | "dash" | "band" | "box" | "faint";
  color: string;
  text: string;
}

export interface Figure {
  id: string; // unique on a page, a file name
  title: string;
  description: string; // a sentence that says what is drawn, for those who do not see it and below the figure
  key?: KeyEntry[];
  draw(width: number): SVGSVGElement; // width in px
  table(): Table;
}

/// The library's default colours are not used: theirs come from the style sheet, so that light, dark and print need no drawing
/// anew. Okabe & Ito's palette, told apart by all kinds of sight; a shape or a dash goes with each.
export const kSeries = ["var(--s0)", "var(--s1)", "var(--s2)", "var(--s3)", "var(--s4)", "var(--s5)"];
export const kDashes = ["none", "6 3", "2 3", "8 3 2 3", "1 4", "10 4"];
export const kSymbols = ["circle", "square", "triangle", "diamond", "cross", "star"] as const;

/// kSeries and its kin go on from the start where there are more.
export function cycled<T>(values: readonly T[], index: number): T {
  return values[index % values.length] as T;
}

/// A plot without the style element that the library puts in, which the content security policy forbids; page.css says the same.
export function drawn(label: string, options: Plot.PlotOptions): SVGSVGElement {
  const element = Plot.plot({
    className: "plot",
    grid: false,
    insetTop: 4,
    marginTop: 22,
    marginBottom: 40,
    ...options,
    style: {},
  }) as unknown as SVGSVGElement;
  for (const style of element.querySelectorAll("style")) style.remove();
  // A drawing is one image with one label; its table is what is read piece by piece.
  for (const part of element.querySelectorAll("[aria-label]")) part.removeAttribute("aria-label");
  element.setAttribute("role", "img");
  element.setAttribute("aria-label", label);
  return element;
}

/// An abscissa whose label stands in the middle below its ticks.
export const below = (label: string): Plot.ScaleOptions => ({ label, labelAnchor: "center", labelArrow: "none", labelOffset: 34 });

/// Writes beside each element of a mark (`group`: its class) the document's number that it stands for.
export function withValues(
  element: SVGSVGElement,
  group: string,
  values: readonly (number | string | null | undefined)[],
): SVGSVGElement {
  for (const parent of element.querySelectorAll(`g.${group}`)) {
    for (const child of parent.children) {
      const index = (child as Element & { __data__?: unknown }).__data__;
      if (typeof index !== "number") continue;
      child.setAttribute("data-value", String(values[index] ?? "null"));
      child.setAttribute("data-index", String(index));
    }
  }
  return element;
}

/// RFC 4180, SI, with a header line of names and units.
export function csvText(table: Table): string {
  const cell = (value: string | number | null): string => {
    if (value === null) return "";
    const text = String(value);
    return /[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
  };
  const header = table.columns.map((column) =>
    cell(column.unit === undefined || column.unit === "" || column.unit === "1" ? column.name : `${column.name} [${column.unit}]`),
  );
  return [header, ...table.rows.map((row) => row.map(cell))].map((row) => row.join(",")).join("\r\n") + "\r\n";
}

export const finite = (value: number | null | undefined): value is number => value != null && Number.isFinite(value);

/// value * factor; what is not known stays so, as a gap in a line.
export function scaled(value: number | null | undefined, factor: number): number {
  return finite(value) ? value * factor : NaN;
}
