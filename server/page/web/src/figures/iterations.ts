// A parameter after each iteration.

import * as Plot from "@observablehq/plot";
import type { Iteration } from "../documents.ts";
import { axisLabel, largest, nameForPeople, unitForPeople } from "../units.ts";
import { spaced } from "../views/spaced.ts";
import { below, drawn, scaled, withValues, type Figure } from "./figure.ts";

const kMostTicks = 10; // labels of more run into each other

export function iterationsFigure(iterations: readonly Iteration[], name: string): Figure {
  const points = iterations.filter((one) => one.parameters[name] !== undefined)
    .map((one) => ({ k: one.iteration + 1, ...one.parameters[name]! }));
  const unit = unitForPeople(name, points[0]?.unit ?? "1", largest(points.map(({ mean }) => mean)));
  type Point = (typeof points)[number];
  const title = `${nameForPeople(name)} over the iterations`;
  const description = "Mean and 5 to 95 % of the posterior after each iteration.";
  const draw = (width: number): SVGSVGElement =>
    withValues(drawn(`${title}. ${description}`, {
      width, height: 200, marginLeft: 56,
      x: { ...below("iteration"), ticks: spaced(points.map(({ k }) => k), kMostTicks), tickFormat: "d", inset: 12 },
      y: { label: axisLabel(name, unit), nice: true, grid: true },
      marks: [
        Plot.ruleX(points, { x: "k", y1: (p: Point) => scaled(p.q05, unit.factor), y2: (p: Point) => scaled(p.q95, unit.factor), stroke: "var(--model)", strokeWidth: 5, strokeOpacity: 0.25 }),
        Plot.lineY(points, { x: "k", y: (p: Point) => scaled(p.mean, unit.factor), stroke: "var(--model)", strokeWidth: 1.6 }),
        Plot.dot(points, { x: "k", y: (p: Point) => scaled(p.mean, unit.factor), r: 3, fill: "var(--model)", className: "means" }),
      ],
    }), "means", points.map(({ mean }) => mean));
  return {
    id: `iterations-${name}`, title, description, draw,
    table: () => ({
      columns: [{ name: "iteration" }, ...["mean", "q05", "q95"].map((column) => ({ name: column, unit: points[0]?.unit ?? "1", shown: unit }))],
      rows: points.map(({ k, mean, q05, q95 }) => [k, mean, q05, q95]),
    }),
  };
}
