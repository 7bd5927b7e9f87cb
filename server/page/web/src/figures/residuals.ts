// Where it fails: residuals along the path, a map of stages, parameters fitted to each part alone.

import * as Plot from "@observablehq/plot";
import type { Comparison, Drift, FittedExperiment, Maybe } from "../documents.ts";
import { axisLabel, largest, nameForPeople, numberText, unitForPeople } from "../units.ts";
import { below, cycled, drawn, finite, kSeries, kSymbols, scaled, withValues, type Figure, type KeyEntry } from "./figure.ts";

/// How far the control has gone until each reading: turning points unfolded.
export function travelled(control: readonly number[]): number[] {
  let sum = control.length === 0 ? 0 : Math.abs(control[0]!);
  return control.map((value, i) => {
    if (i > 0) sum += Math.abs(value - control[i - 1]!);
    return sum;
  });
}

interface Stage {
  experiment: string;
  name: string;
  from: number;
  to: number;
}

function stagesOf(experiment: FittedExperiment, path: readonly number[]): Stage[] {
  const stages: Stage[] = [];
  experiment.segments.forEach((name, i) => {
    const last = stages.at(-1);
    const here = path[i] ?? 0;
    if (last !== undefined && last.name === name) {
      last.to = here;
    } else {
      stages.push({ experiment: experiment.experiment, name, from: here, to: here });
    }
  });
  return stages;
}

const kExpected = 2; // sd: 95 % of the residuals of a right model lie within

/// The residuals of one observable, an experiment a row.
export function residualFigure(experiments: readonly FittedExperiment[], observable: string): Figure {
  interface Point {
    experiment: string;
    role: string;
    stage: string;
    reading: number;
    path: number;
    residual: Maybe;
  }
  const points: Point[] = [];
  const stages: Stage[] = [];
  let control = { name: "", unit: "" };
  for (const one of experiments) {
    const found = one.observables.find(({ name }) => name === observable);
    if (found === undefined || found.residual === null) continue;
    control = { name: one.control, unit: one.control_unit };
    const path = travelled(one.control_values);
    stages.push(...stagesOf(one, path));
    found.residual.forEach((residual, reading) => {
      const stage = one.segments[reading] ?? "";
      points.push({ experiment: one.experiment, role: one.role, stage, reading, path: path[reading] ?? 0, residual });
    });
  }
  const names = [...new Set(points.map(({ experiment }) => experiment))];
  const unit = unitForPeople(control.name, control.unit, largest(points.map(({ path }) => path)));
  const title = `Residuals of ${nameForPeople(observable)} along the path`;
  const description =
    "Model minus measurement in standard deviations of noise and scatter; shaded: ± 2, where 95 % of a right model's lie. " +
    "Turning points of the control are unfolded; thin lines part the loading stages.";
  const key: KeyEntry[] = [{ mark: "dot", color: "var(--model)", text: "fitted" }];
  if (points.some(({ role }) => role === "validate")) key.push({ mark: "ring", color: "var(--held)", text: "held out" });

  const draw = (width: number): SVGSVGElement => {
    const rowHeight = 132;
    const labelled = stages.filter(({ from, to }) => to > from);
    const element = drawn(`${title}. ${description}`, {
      width,
      height: 66 + rowHeight * Math.max(1, names.length),
      marginLeft: 44,
      marginTop: 30,
      marginRight: 16,
      fy: { domain: names, label: null, axis: null, padding: 0.22 },
      x: below(`path of ${axisLabel(control.name || "reading", unit)}`),
      y: { label: "sd", nice: true, grid: true, ticks: 5 },
      marks: [
        Plot.rect(names, { fy: (name: string) => name, y1: -kExpected, y2: kExpected, fill: "var(--model)", fillOpacity: 0.1 }),
        Plot.ruleY([0], { stroke: "var(--rule-strong)" }),
        Plot.ruleX(stages.filter(({ from }, i) => i > 0 && from > 0), {
          fy: "experiment", x: ({ from }: Stage) => from * unit.factor, stroke: "var(--rule)",
        }),
        Plot.text(labelled, {
          fy: "experiment", x: ({ from, to }: Stage) => ((from + to) / 2) * unit.factor, frameAnchor: "bottom", dy: -4,
          text: ({ name, from, to }: Stage) =>
            ((to - from) / Math.max(...points.map(({ path }) => path))) * width > 5 * name.length ? nameForPeople(name) : "",
          fill: "var(--faint)", fontSize: 10,
        }),
        Plot.text(names, { fy: (name: string) => name, text: (name: string) => name, frameAnchor: "top-left", dx: 2, dy: -15, fontWeight: 600, fill: "var(--ink)" }),
        Plot.ruleX(points, {
          fy: "experiment", x: ({ path }: Point) => path * unit.factor, y: (p: Point) => scaled(p.residual, 1),
          stroke: ({ role }: Point) => (role === "validate" ? "var(--held)" : "var(--model)"), strokeOpacity: 0.5,
        }),
        Plot.dot(points, {
          fy: "experiment", x: ({ path }: Point) => path * unit.factor, y: (p: Point) => scaled(p.residual, 1), r: 2.6,
          fill: ({ role }: Point) => (role === "validate" ? "var(--paper)" : "var(--model)"),
          stroke: ({ role }: Point) => (role === "validate" ? "var(--held)" : "var(--model)"), className: "residuals",
          title: (p: Point) => `${p.experiment}, reading ${p.reading}, ${nameForPeople(p.stage)}: ${numberText(p.residual, 3)} sd`,
        }),
      ],
    });
    return withValues(element, "residuals", points.map(({ residual }) => residual));
  };
  return {
    id: `residual-${observable}`, title, description, key, draw,
    table: () => ({
      columns: [{ name: "experiment" }, { name: "role" }, { name: "stage" }, { name: "reading" }, { name: "residual", unit: "sd" }],
      rows: points.map((p) => [p.experiment, p.role, p.stage, p.reading, p.residual]),
    }),
  };
}

const kNoted = 1; // sd: as expected
const kClear = 5; // sd: the darkest
const kDark = 4.2; // sd: from there light text is read more easily than dark

/// Error of every stage of every observable of every experiment.
export function stageMap(comparison: Comparison): Figure {
  const rows = comparison.by_segment;
  const title = "Error by experiment, observable and stage";
  const description =
    "Root mean square of the residuals in standard deviations: 1 is as expected. An arrow says where the model lies, " +
    "above (▲) or below (▼) the measurement, when its bias is beyond 3 sd.";
  const observables = [...new Set(rows.map(({ observable }) => observable))];
  const experiments = [...new Set(rows.map(({ experiment }) => experiment))];
  const stages = [...new Set(rows.map(({ segment }) => segment))];
  type Row = (typeof rows)[number];
  const draw = (width: number): SVGSVGElement => {
    // Observables beside each other, or below each other where that is too narrow.
    const least = 46 * stages.length;
    const beside = width - 110 >= least * observables.length;
    const element = drawn(`${title}. ${description}`, {
      width,
      height: 60 + 40 + (beside ? 1 : observables.length) * (34 * experiments.length + 24),
      marginLeft: 104,
      marginTop: 40,
      marginBottom: 62,
      marginRight: 8,
      ...(beside
        ? { fx: { domain: observables, label: null, padding: 0.04, tickFormat: nameForPeople } }
        : { fy: { domain: observables, label: null, padding: 0.2, axis: null } }),
      x: { domain: stages, label: null, tickRotate: -32, tickFormat: nameForPeople, tickSize: 0 },
      y: { domain: experiments, label: null, tickSize: 0 },
      opacity: { type: "linear", domain: [kNoted, kClear], range: [0.04, 0.92], clamp: true },
      marks: [
        Plot.cell(rows, {
          ...(beside ? { fx: "observable" } : { fy: "observable" }), x: "segment", y: "experiment", inset: 1.5, rx: 3,
          fill: "var(--misfit)", fillOpacity: (row: Row) => row.rms_error ?? 0, className: "stages",
          title: (row: Row) => `${row.experiment}, ${nameForPeople(row.observable)}, ${nameForPeople(row.segment)}: ${numberText(row.rms_error, 3)} sd over ${row.readings} readings, bias z = ${numberText(row.z, 2)}`,
        }),
        ...(beside ? [] : [Plot.text(observables, { fy: (name: string) => name, text: nameForPeople, frameAnchor: "top-left", dy: -14, fontWeight: 600, fill: "var(--ink)" })]),
        Plot.text(rows, {
          ...(beside ? { fx: "observable" } : { fy: "observable" }), x: "segment", y: "experiment", fontVariant: "tabular-nums",
          text: (row: Row) => numberText(row.rms_error, 2) + (finite(row.z) && Math.abs(row.z) > 3 ? (row.z > 0 ? " ▲" : " ▼") : ""),
          fill: (row: Row) => ((row.rms_error ?? 0) > kDark ? "var(--on-misfit)" : "var(--ink)"),
        }),
      ],
    });
    return withValues(element, "stages", rows.map(({ rms_error }) => rms_error));
  };
  return {
    id: "stages", title, description, draw,
    table: () => ({
      columns: ["experiment", "role", "observable", "stage", "readings", "rms_error", "z", "p_value"].map((name) => ({ name })),
      rows: rows.map((r) => [r.experiment, r.role, r.observable, r.segment, r.readings, r.rms_error, r.z, r.p_value]),
    }),
  };
}

/// One parameter, fitted to each part alone, over what sets the experiments apart.
export function driftFigure(drift: Drift, experiments: readonly FittedExperiment[]): Figure {
  const setting = drift.trend?.with ?? commonSetting(experiments);
  const of = (name: string): { value: number; unit: string } | undefined =>
    setting === null ? undefined : experiments.find(({ experiment }) => experiment === name)?.settings[setting];
  const known = setting !== null && drift.fits.every(({ experiment }) => of(experiment) !== undefined);
  const fits = drift.fits.filter(({ mean }) => finite(mean));
  const parts = [...new Set(fits.map(({ segment }) => segment ?? "whole test"))];
  const partOf = (segment: string | null): number => parts.indexOf(segment ?? "whole test");
  const yUnit = unitForPeople(drift.parameter, drift.unit, largest(fits.map(({ mean }) => mean)));
  const settingUnit = known ? of(fits[0]?.experiment ?? "")?.unit ?? "1" : "1";
  const xUnit = known
    ? unitForPeople(setting, settingUnit, largest(fits.map(({ experiment }) => of(experiment)?.value)))
    : { factor: 1, label: "" };
  type Fit = (typeof fits)[number];
  const title = `${nameForPeople(drift.parameter)}, fitted to each part alone`;
  const description =
    `Mean ± 1 sd on an emulator of the runs${known ? `, over ${nameForPeople(setting)}` : ", by experiment"}. ` +
    (drift.p_experiments === null ? "" : `One value for all experiments: p = ${numberText(drift.p_experiments, 2)}. `) +
    (drift.p_segments === null ? "" : `One value for all stages: p = ${numberText(drift.p_segments, 2)}.`);
  const key: KeyEntry[] = parts.map((part, i) => ({ mark: i === 0 ? "dot" : "ring", color: cycled(kSeries, i), text: nameForPeople(part) }));
  const draw = (width: number): SVGSVGElement => {
    const shift = (fit: Fit): number => (partOf(fit.segment) - (parts.length - 1) / 2) * 9;
    const marks: Plot.Markish[] = [];
    parts.forEach((_, i) => {
      const own = fits.filter(({ segment }) => partOf(segment) === i);
      if (own.length === 0) return;
      const x = known ? (fit: Fit) => (of(fit.experiment)?.value ?? NaN) * xUnit.factor : (fit: Fit) => fit.experiment;
      const dx = shift(own[0]!);
      const color = cycled(kSeries, i);
      const bar = {
        x, dx, stroke: color, strokeWidth: 1.4,
        y1: (fit: Fit) => scaled((fit.mean ?? NaN) - (fit.sd ?? 0), yUnit.factor),
        y2: (fit: Fit) => scaled((fit.mean ?? NaN) + (fit.sd ?? 0), yUnit.factor),
      };
      marks.push(Plot.ruleX(own, bar));
      marks.push(Plot.dot(own, {
        x, dx, y: (fit: Fit) => scaled(fit.mean, yUnit.factor), symbol: cycled(kSymbols, i), r: 4,
        fill: i === 0 ? color : "var(--paper)", stroke: color, strokeWidth: 1.6, className: `fits${i}`,
      }));
    });
    const element = drawn(`${title}. ${description}`, {
      width, height: 230, marginLeft: 56, marginRight: 24,
      x: known
        ? { ...below(axisLabel(setting, xUnit)), type: "log", inset: 36, ticks: [...new Set(fits.map(({ experiment }) => (of(experiment)?.value ?? 1) * xUnit.factor))], tickFormat: (value: number) => numberText(value, 3) }
        : { type: "point", label: null, padding: 0.6 },
      y: { label: axisLabel(drift.parameter, yUnit), nice: true, grid: true },
      marks,
    });
    parts.forEach((_, i) => withValues(element, `fits${i}`, fits.filter(({ segment }) => partOf(segment) === i).map(({ mean }) => mean)));
    return element;
  };
  return {
    id: `drift-${drift.parameter}`, title, description, key, draw,
    table: () => ({
      columns: [{ name: "experiment" }, { name: "stage" }, { name: "mean", unit: drift.unit, shown: yUnit }, { name: "sd", unit: drift.unit, shown: yUnit }, { name: "z" }],
      rows: drift.fits.map((fit) => [fit.experiment, fit.segment ?? "whole test", fit.mean, fit.sd, fit.z]),
    }),
  };
}

/// A setting in which the experiments differ, each having one; pressure before others.
function commonSetting(experiments: readonly FittedExperiment[]): string | null {
  const names = Object.keys(experiments[0]?.settings ?? {});
  const differing = names.filter((name) => {
    const values = experiments.map(({ settings }) => settings[name]?.value);
    return values.every((value) => value !== undefined && value > 0) && new Set(values).size > 1;
  });
  return differing.find((name) => name.includes("pressure")) ?? differing[0] ?? null;
}
