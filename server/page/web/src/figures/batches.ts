// Where the runs of a calibration in batches went, and what each batch was expected to bring.

import * as Plot from "@observablehq/plot";
import type { PlacedBatch } from "../documents.ts";
import { spaced } from "../views/spaced.ts";
import { below, drawn, withValues, type Figure } from "./figure.ts";

const kMostTicks = 10; // labels of more run into each other

export function batchesFigure(batches: readonly PlacedBatch[]): Figure {
  let made = 0;
  const points = batches.map(({ runs, expected_gain }, i) => {
    made += runs;
    return { k: i + 1, runs, made, expected_gain, gain: 100 * expected_gain };
  });
  type Point = (typeof points)[number];
  const title = "What each batch was expected to bring";
  const description = "Part of the posterior's uncertainty that was expected to go with each batch, when it was chosen. " +
    "Runs that fill the prior or judge the emulator promise nothing. Above each: runs so far.";
  const draw = (width: number): SVGSVGElement =>
    withValues(drawn(`${title}. ${description}`, {
      width, height: 200, marginLeft: 56,
      x: { ...below("batch"), ticks: spaced(points.map(({ k }) => k), kMostTicks), tickFormat: "d", inset: 18 },
      y: { label: "uncertainty expected to go [%]", domain: [0, Math.max(1, ...points.map(({ gain }) => gain)) * 1.15], grid: true },
      marks: [
        Plot.ruleX(points, { x: "k", y1: 0, y2: (p: Point) => p.gain, stroke: "var(--model)", strokeWidth: 9 }),
        Plot.text(points, { x: "k", y: (p: Point) => p.gain, text: (p: Point) => String(p.made), dy: -8, fill: "var(--quiet)" }),
        Plot.dot(points, { x: "k", y: (p: Point) => p.gain, r: 2.5, fill: "var(--model)", className: "gains" }),
      ],
    }), "gains", points.map(({ expected_gain }) => expected_gain));
  return {
    id: "batches", title, description, draw,
    table: () => ({
      columns: [{ name: "batch" }, { name: "runs" }, { name: "runs so far" }, { name: "expected gain" }],
      rows: points.map(({ k, runs, made: sum, expected_gain }) => [k, runs, sum, expected_gain]),
    }),
  };
}
