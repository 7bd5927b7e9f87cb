// What are the parameters: a corner plot of one or several campaigns, and how the estimate comes about along the readings.

import * as Plot from "@observablehq/plot";
import { svg } from "../dom.ts";
import type { Posterior } from "../documents.ts";
import { axisLabel, largest, nameForPeople, unitForPeople, type DisplayUnit } from "../units.ts";
import { below, cycled, drawn, finite, kDashes, kSeries, scaled, withValues, type Figure, type KeyEntry } from "./figure.ts";

export interface NamedPosterior {
  name: string; // of the campaign, as the key shows it
  posterior: Posterior;
}

/// Those that the first posterior has inferred.
export function inferredParameters(posterior: Posterior): string[] {
  return Object.entries(posterior.parameters)
    .filter(([, one]) => !one.conditioned_on && one.member !== true)
    .map(([name]) => name);
}

interface Axis {
  name: string;
  unit: DisplayUnit;
  domain: [number, number]; // as shown
}

const kWidest = 4; // sd about the mean, as far as the prior reaches
const kMargin = { left: 52, top: 8, right: 6, bottom: 46 };

// What is drawn of a parameter: where any of the posteriors has mass, within its prior.
function axisOf(name: string, posteriors: readonly NamedPosterior[]): Axis {
  let low = Infinity;
  let high = -Infinity;
  let unit = "1";
  for (const { posterior } of posteriors) {
    const one = posterior.parameters[name];
    if (one === undefined) continue;
    unit = one.unit;
    const draws = columnOf(posterior, name);
    if (draws.length > 0) {
      low = Math.min(low, ...draws);
      high = Math.max(high, ...draws);
    }
    if (finite(one.mean) && finite(one.sd)) {
      low = Math.min(low, Math.max(one.mean - kWidest * one.sd, one.prior_min ?? -Infinity));
      high = Math.max(high, Math.min(one.mean + kWidest * one.sd, one.prior_max ?? Infinity));
    } else if (finite(one.prior_min) && finite(one.prior_max)) {
      low = Math.min(low, one.prior_min);
      high = Math.max(high, one.prior_max);
    }
  }
  if (!(low < high)) [low, high] = [low - 1, low + 1];
  const shown = unitForPeople(name, unit, largest([low, high]));
  return { name, unit: shown, domain: [low * shown.factor, high * shown.factor] };
}

function columnOf(posterior: Posterior, name: string): number[] {
  const column = posterior.draws?.parameters.indexOf(name) ?? -1;
  return column < 0 ? [] : posterior.draws!.values.map((row) => row[column]!).filter(finite);
}

/// Every parameter alone (diagonal) and every pair. names: which, in order.
export function cornerFigure(posteriors: readonly NamedPosterior[], names: readonly string[]): Figure {
  const title = "Parameters alone and in pairs";
  const several = posteriors.length > 1;
  const description =
    "On the diagonal the density of each parameter: prior dashed, posterior filled. Below it draws of the posterior for each pair, " +
    "with lines of equal density.";
  const key: KeyEntry[] = [
    { mark: "dash", color: "var(--faint)", text: "prior" },
    ...posteriors.map(({ name }, i): KeyEntry => ({ mark: "line", color: cycled(kSeries, i), text: several ? name : "posterior" })),
  ];
  const draw = (width: number): SVGSVGElement => {
    const axes = names.map((name) => axisOf(name, posteriors));
    const n = axes.length;
    const cell = Math.max(84, Math.min(280, (width - kMargin.left - kMargin.right) / n));
    const size = kMargin.left + kMargin.right + n * cell;
    const height = kMargin.top + kMargin.bottom + n * cell;
    const root = svg("svg", {
      class: "plot corner", width: size, height, viewBox: `0 0 ${size} ${height}`, role: "img", "aria-label": `${title}. ${description}`,
    });
    for (let row = 0; row < n; ++row) {
      for (let column = 0; column <= row; ++column) {
        const left = column === 0 ? kMargin.left : 0;
        const bottom = row === n - 1 ? kMargin.bottom : 0;
        const frame = {
          width: cell + left, height: cell + bottom, marginLeft: left + 3, marginRight: 3, marginTop: 3, marginBottom: bottom + 3,
        };
        const panel =
          row === column
            ? density(axes[row]!, posteriors, frame, row === n - 1, column === 0)
            : pair(axes[column]!, axes[row]!, posteriors, frame, row === n - 1, column === 0);
        panel.setAttribute("x", String(kMargin.left + column * cell - left));
        panel.setAttribute("y", String(kMargin.top + row * cell));
        root.appendChild(panel);
      }
    }
    return root;
  };
  return {
    id: "corner", title, description, key, draw,
    table: () => ({
      columns: ["campaign", "parameter", "unit", "mean", "sd", "q05", "q50", "q95", "prior_min", "prior_max"].map((name) => ({ name })),
      rows: posteriors.flatMap(({ posterior }) =>
        names.map((name) => {
          const p = posterior.parameters[name];
          return [posterior.campaign, name, p?.unit ?? "", p?.mean ?? null, p?.sd ?? null, p?.q05 ?? null, p?.q50 ?? null, p?.q95 ?? null, p?.prior_min ?? null, p?.prior_max ?? null];
        }),
      ),
    }),
  };
}

type Frame = Pick<Plot.PlotOptions, "width" | "height" | "marginLeft" | "marginRight" | "marginTop" | "marginBottom">;

const labelled = (axis: Axis, shown: boolean): Plot.ScaleOptions =>
  shown
    ? { ...below(axisLabel(axis.name, axis.unit)), labelOffset: 38, domain: axis.domain, ticks: 3 }
    : { domain: axis.domain, axis: null };

function density(axis: Axis, posteriors: readonly NamedPosterior[], frame: Frame, last: boolean, first: boolean): SVGSVGElement {
  const marks: Plot.Markish[] = [Plot.frame({ stroke: "var(--rule)" })];
  const inside = (points: readonly [number, number][]): [number, number][] => {
    const [low, high] = axis.domain;
    return points.map(([x, p]): [number, number] => [x * axis.unit.factor, p]).filter(([x]) => x >= low && x <= high);
  };
  // Densities are of different heights by far: each is drawn against its own largest, the prior against the first posterior's.
  const scale = Math.max(...(posteriors[0]?.posterior.parameters[axis.name]?.density ?? []).map(([, p]) => p), 0);
  posteriors.forEach(({ posterior }, i) => {
    const one = posterior.parameters[axis.name];
    const points = inside(one?.density ?? []);
    const most = Math.max(...points.map(([, p]) => p));
    const color = cycled(kSeries, i);
    const y = ([, p]: [number, number]): number => p / most;
    if (points.length > 0) {
      marks.push(Plot.areaY(points, { x: "0", y, fill: color, fillOpacity: 0.14 }));
      marks.push(Plot.lineY(points, { x: "0", y, stroke: color, strokeWidth: 1.6, strokeDasharray: cycled(kDashes, i) }));
    } else {
      const draws = columnOf(posterior, axis.name).map((value) => value * axis.unit.factor);
      if (draws.length > 0) marks.push(Plot.tickX(draws, { x: (value: number) => value, stroke: color, strokeOpacity: 0.3 }));
    }
    if (i === 0) {
      const prior = inside(one?.prior_density ?? []);
      const top = scale > 0 ? scale : Math.max(...prior.map(([, p]) => p));
      if (prior.length > 0) {
        marks.push(Plot.lineY(prior, { x: "0", y: ([, p]: [number, number]) => p / top, stroke: "var(--faint)", strokeDasharray: "4 3" }));
      }
    }
    if (finite(one?.q50)) {
      marks.push(Plot.ruleX([one.q50 * axis.unit.factor], { stroke: color, strokeOpacity: 0.7, y1: 0, y2: 0.08, strokeWidth: 2, className: "median" }));
    }
  });
  const element = drawn(nameForPeople(axis.name), {
    ...frame, x: labelled(axis, last), y: first ? { domain: [0, 1.08], label: null, ticks: 0 } : { domain: [0, 1.08], axis: null }, marks,
  });
  withValues(element, "median", [posteriors[0]?.posterior.parameters[axis.name]?.q50]);
  for (const name of ["role", "aria-label"]) element.removeAttribute(name);
  return element;
}

function pair(x: Axis, y: Axis, posteriors: readonly NamedPosterior[], frame: Frame, last: boolean, first: boolean): SVGSVGElement {
  const marks: Plot.Markish[] = [Plot.frame({ stroke: "var(--rule)" })];
  posteriors.forEach(({ posterior }, i) => {
    const xs = columnOf(posterior, x.name);
    const ys = columnOf(posterior, y.name);
    if (xs.length === 0 || xs.length !== ys.length) return;
    const points = xs.map((value, k): [number, number] => [value * x.unit.factor, ys[k]! * y.unit.factor]);
    const color = cycled(kSeries, i);
    marks.push(Plot.dot(points, { x: "0", y: "1", r: 1.1, fill: color, fillOpacity: 0.35, clip: true }));
    marks.push(Plot.density(points, { x: "0", y: "1", thresholds: 3, bandwidth: 12, stroke: color, strokeWidth: 1, strokeOpacity: 0.8, clip: true }));
  });
  const element = drawn(`${nameForPeople(y.name)} over ${nameForPeople(x.name)}`, {
    ...frame, x: labelled(x, last), y: { ...labelled(y, first), labelOffset: kMargin.left - 4 }, marks,
  });
  for (const name of ["role", "aria-label"]) element.removeAttribute(name);
  return element;
}

/// One parameter along the readings, in the order in which they are taken in.
export function pathFigure(posterior: Posterior, name: string): Figure {
  const column = Object.keys(posterior.parameters).indexOf(name);
  const one = posterior.parameters[name]!;
  const points = posterior.path.map((point, i) => {
    const mean = point.mean[column] ?? null;
    const cov = point.cov[column] ?? null;
    return { i, point, mean, sd: finite(mean) && finite(cov) ? Math.abs(mean * cov) : null };
  });
  const unit = unitForPeople(name, one.unit, largest(points.map(({ mean }) => mean)));
  const title = `${nameForPeople(name)} along the readings`;
  const description = "Mean ± 1 sd after each reading taken in, experiment after experiment.";
  type Point = (typeof points)[number];
  const starts = points.filter(({ point }, i) => i === 0 || points[i - 1]!.point.experiment !== point.experiment);
  const y = (shift: number) => ({ mean, sd }: Point): number => scaled(finite(mean) ? mean + shift * (sd ?? 0) : null, unit.factor);
  const draw = (width: number): SVGSVGElement => {
    const element = drawn(`${title}. ${description}`, {
      width, height: 200, marginLeft: 56, marginRight: 16,
      x: below("reading"),
      y: { label: axisLabel(name, unit), nice: true, grid: true },
      marks: [
        Plot.ruleX(starts.slice(1), { x: "i", stroke: "var(--rule)" }),
        Plot.text(starts, { x: "i", text: ({ point }: Point) => point.experiment, frameAnchor: "top-left", textAnchor: "start", dx: 4, dy: 4, fill: "var(--faint)", fontSize: 10 }),
        Plot.areaY(points, { x: "i", y1: y(-1), y2: y(1), z: ({ point }: Point) => point.experiment, fill: "var(--model)", fillOpacity: 0.18 }),
        Plot.lineY(points, { x: "i", y: y(0), z: ({ point }: Point) => point.experiment, stroke: "var(--model)", strokeWidth: 1.6 }),
        Plot.dot(points, { x: "i", y: y(0), r: 1.6, fill: "var(--model)", className: "path" }),
      ],
    });
    return withValues(element, "path", points.map(({ mean }) => mean));
  };
  return {
    id: `path-${name}`, title, description, draw,
    table: () => ({
      columns: [{ name: "experiment" }, { name: "load step" }, { name: "mean", unit: one.unit, shown: unit }, { name: "cov" }],
      rows: points.map(({ point, mean }) => [point.experiment, point.load_step, mean, point.cov[column] ?? null]),
    }),
  };
}
