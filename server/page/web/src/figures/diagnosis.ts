// What is missing, and what it brings to add it: probabilities of models, what an effect would change beside what the model
// lacks, errors by step.

import * as Plot from "@observablehq/plot";
import type { Candidate, Diagnosis, FittedExperiment, Improvement, Maybe } from "../documents.ts";
import { axisLabel, chanceText, largest, nameForPeople, numberText, unitForPeople } from "../units.ts";
import { below, cycled, drawn, finite, kDashes, kSeries, kSymbols, scaled, withValues, type Figure, type KeyEntry } from "./figure.ts";
import { travelled } from "./residuals.ts";

export function modelName(effects: readonly string[]): string {
  if (effects.length === 0) return "the model as it is";
  if (effects.length === 1 && effects[0] === "other") return "others together";
  if (effects.length === 1 && effects[0] === "none_of_these") return "none of these";
  return effects.map(nameForPeople).join(" + ");
}

const kMostModels = 10;

export function probabilityFigure(diagnosis: Diagnosis): Figure {
  const inSet = new Set((diagnosis.credible_set ?? []).map((effects) => effects.join("\n")));
  const all = [...(diagnosis.probabilities ?? []), { effects: ["none_of_these"], probability: diagnosis.none_of_these ?? 0 }]
    .map(({ effects, probability }) => ({ name: modelName(effects), probability, credible: inSet.has(effects.join("\n")) }))
    .sort((a, b) => b.probability - a.probability);
  const named = ["none of these", "the model as it is"];
  const rows = all.filter(({ name }, i) => i < kMostModels || named.includes(name));
  const title = "Models by probability";
  const description =
    "Which effects act, by the readings: filled bars are the fewest models that hold 95 %." +
    (rows.length < all.length ? ` The ${rows.length} most probable of ${all.length}; the table has all.` : "");
  type Row = (typeof rows)[number];
  const key: KeyEntry[] = [
    { mark: "band", color: "var(--model)", text: "in the credible set" },
    { mark: "box", color: "var(--model)", text: "outside" },
  ];
  const draw = (width: number): SVGSVGElement => {
    const narrow = width < 520;
    const labels = narrow ? 8 : Math.min(0.45 * width, 12 + 6.6 * Math.max(...rows.map(({ name }) => name.length)));
    const element = drawn(`${title}. ${description}`, {
      width, height: 16 + (narrow ? 40 : 27) * rows.length, marginLeft: labels, marginTop: 6, marginBottom: 6, marginRight: 52,
      x: { domain: [0, 1], axis: null },
      y: { domain: rows.map(({ name }) => name), label: null, tickSize: 0, axis: narrow ? null : "left" },
      marks: [
        Plot.barX(rows, {
          x: "probability", y: "name", insetTop: narrow ? 19 : 5, insetBottom: 5, rx: 2, fill: "var(--model)",
          fillOpacity: ({ credible }: Row) => (credible ? 0.85 : 0.12), stroke: "var(--model)", className: "probabilities",
        }),
        narrow ? Plot.text(rows, { y: "name", x: 0, text: "name", textAnchor: "start", dy: -9, fill: "var(--ink)" }) : null,
        Plot.text(rows, { x: "probability", y: "name", text: ({ probability }: Row) => chanceText(probability), dx: 6, dy: narrow ? 7 : 0, textAnchor: "start", fill: "var(--ink)", fontVariant: "tabular-nums" }),
        Plot.ruleX([0], { stroke: "var(--rule-strong)" }),
      ],
    });
    return withValues(element, "probabilities", rows.map(({ probability }) => probability));
  };
  return {
    id: "probabilities", title, description, key, draw,
    table: () => ({
      columns: [{ name: "model" }, { name: "probability" }, { name: "credible set" }],
      rows: all.map(({ name, probability, credible }) => [name, probability, credible ? "yes" : ""]),
    }),
  };
}

/// What the model lacks of one observable (measurement - model), and what each candidate alone would add to it.
export function signatureFigure(
  experiments: readonly FittedExperiment[],
  observable: string,
  candidates: readonly Candidate[],
): Figure {
  interface Lack {
    experiment: string;
    path: number;
    lack: number; // SI
    sd: Maybe;
    changes: Maybe[]; // by each candidate
  }
  const lacks: Lack[] = [];
  let control = { name: "", unit: "1" };
  let siUnit = "1";
  for (const one of experiments) {
    const found = one.observables.find(({ name }) => name === observable);
    if (found === undefined || one.role !== "calibrate") continue;
    control = { name: one.control, unit: one.control_unit };
    const path = travelled(one.control_values);
    siUnit = found.unit;
    const curves = candidates.map((candidate) =>
      candidate.curves.find((each) => each.experiment === one.experiment && each.observable === observable));
    found.values.forEach((measured, i) => {
      const model = found.bands?.mean[i];
      if (!finite(measured) || !finite(model)) return;
      lacks.push({
        experiment: one.experiment, path: path[i]!, lack: measured - model, sd: found.total_sd[i] ?? null,
        changes: curves.map((curve) => curve?.change[i] ?? null),
      });
    });
  }
  const names = [...new Set(lacks.map(({ experiment }) => experiment))];
  const xUnit = unitForPeople(control.name, control.unit, largest(lacks.map(({ path }) => path)));
  const yUnit = unitForPeople(observable, siUnit, largest(lacks.map(({ lack }) => lack)));
  const title = `What is missing of ${nameForPeople(observable)}`;
  const description = "Points: measurement minus model, ± 1 sd, turning points of the control unfolded. Lines: what each effect alone would add to the model.";
  const key: KeyEntry[] = [
    { mark: "dot", color: "var(--measured)", text: "measurement minus model" },
    ...candidates.map(({ effect }, i): KeyEntry => ({ mark: i === 0 ? "line" : "dash", color: cycled(kSeries, i), text: nameForPeople(effect) })),
  ];
  const draw = (width: number): SVGSVGElement => {
    const beside = width >= 300 * names.length;
    const facet = beside ? { fx: "experiment" } : { fy: "experiment" };
    const marks: Plot.Markish[] = [
      Plot.ruleY([0], { stroke: "var(--rule-strong)" }),
      Plot.text(names, { ...(beside ? { fx: (name: string) => name } : { fy: (name: string) => name }), text: (name: string) => name, frameAnchor: "top-left", dx: 6, dy: 2, fontWeight: 600, fill: "var(--ink)" }),
      Plot.ruleX(lacks, {
        ...facet, x: (l: Lack) => l.path * xUnit.factor,
        y1: (l: Lack) => (l.lack - (l.sd ?? 0)) * yUnit.factor, y2: (l: Lack) => (l.lack + (l.sd ?? 0)) * yUnit.factor,
        stroke: "var(--measured)", strokeOpacity: 0.4,
      }),
    ];
    candidates.forEach((_, i) => {
      marks.push(Plot.line(lacks, {
        ...facet, x: (l: Lack) => l.path * xUnit.factor, y: (l: Lack) => scaled(l.changes[i], yUnit.factor), z: "experiment",
        stroke: cycled(kSeries, i), strokeWidth: i === 0 ? 2.2 : 1.5, strokeDasharray: cycled(kDashes, i),
      }));
    });
    marks.push(Plot.dot(lacks, { ...facet, x: (l: Lack) => l.path * xUnit.factor, y: (l: Lack) => l.lack * yUnit.factor, r: 2.4, fill: "var(--measured)", className: "lacks" }));
    const element = drawn(`${title}. ${description}`, {
      width, height: beside ? 260 : 60 + 190 * Math.max(1, names.length), marginLeft: 56,
      ...(beside ? { fx: { domain: names, label: null, axis: null, padding: 0.06 } } : { fy: { domain: names, label: null, axis: null, padding: 0.1 } }),
      x: { ...below(`path of ${axisLabel(control.name, xUnit)}`), ...(beside ? { ticks: 5 } : {}) },
      y: { label: axisLabel(observable, yUnit), nice: true, grid: true },
      marks,
    });
    return withValues(element, "lacks", lacks.map(({ lack }) => lack));
  };
  return {
    id: `signature-${observable}`, title, description, key, draw,
    table: () => ({
      columns: [
        { name: "experiment" }, { name: `path of ${control.name}`, unit: control.unit, shown: xUnit },
        { name: "measurement minus model", unit: siUnit, shown: yUnit }, { name: "sd", unit: siUnit, shown: yUnit },
        ...candidates.map(({ effect }) => ({ name: nameForPeople(effect), unit: siUnit, shown: yUnit })),
      ],
      rows: lacks.map((l) => [l.experiment, l.path, l.lack, l.sd, ...l.changes]),
    }),
  };
}

/// The error of each model that was tried, by what it is an error of.
export function stepsFigure(improvement: Improvement): Figure {
  const { steps } = improvement;
  const series = [
    { name: "fitted", values: steps.map(({ rms_error }) => rms_error), color: "var(--s0)" },
    { name: "held out", values: steps.map(({ heldout_rms_error }) => heldout_rms_error), color: "var(--s1)" },
  ].filter(({ values }) => values.some(finite));
  const labels = steps.map(({ effects, campaign }) => `${effects.length === 0 ? "base" : effects.map((name) => `+ ${nameForPeople(name)}`).join("\n")}\n${campaign}`);
  const title = "Error by step";
  const description = "Root mean square of residuals in standard deviations of noise and scatter, for each model tried; 1 is as expected of a right one.";
  const key: KeyEntry[] = series.map(({ name, color }, i) => ({ mark: i === 0 ? "dot" : "ring", color, text: name }));
  const draw = (width: number): SVGSVGElement => {
    const marks: Plot.Markish[] = [
      Plot.ruleY([1], { stroke: "var(--good)", strokeDasharray: "5 4" }),
      Plot.text([1], { y: 1, text: () => "as expected", frameAnchor: "left", dx: 4, dy: -7, fill: "var(--good)", textAnchor: "start" }),
    ];
    series.forEach(({ name, values, color }, i) => {
      const points = values.map((value, step) => ({ label: labels[step]!, value }));
      const side = i === 0 ? 1 : -1;
      marks.push(
        Plot.line(points, { x: "label", y: (p: (typeof points)[number]) => scaled(p.value, 1), stroke: color, strokeWidth: 2, strokeDasharray: cycled(kDashes, i) }),
        Plot.dot(points, { x: "label", y: (p: (typeof points)[number]) => scaled(p.value, 1), symbol: cycled(kSymbols, i), r: 5, fill: i === 0 ? color : "var(--paper)", stroke: color, strokeWidth: 2, className: `error-${name.replace(" ", "-")}` }),
        Plot.text(points, { x: "label", y: (p: (typeof points)[number]) => scaled(p.value, 1), text: (p: (typeof points)[number]) => numberText(p.value, 2), dx: side * 11, textAnchor: side > 0 ? "start" : "end", fill: color, fontVariant: "tabular-nums", fontWeight: 600 }),
      );
    });
    const element = drawn(`${title}. ${description}`, {
      width, height: 320, marginLeft: 46, marginBottom: 30 + 15 * Math.max(...labels.map((label) => label.split("\n").length)),
      x: { type: "point", domain: labels, label: null, padding: 0.5, tickSize: 0, tickPadding: 10 },
      y: { label: "error [sd]", domain: [0, 1.12 * largest(series.flatMap(({ values }) => values))], grid: true },
      marks,
    });
    for (const { name, values } of series) withValues(element, `error-${name.replace(" ", "-")}`, values);
    return element;
  };
  return {
    id: "steps", title, description, key, draw,
    table: () => ({
      columns: ["step", "campaign", "effects", "rms_error", "heldout_rms_error", "probability", "verdict"].map((name) => ({ name })),
      rows: steps.map((s, i) => [i, s.campaign, s.effects.join(" "), s.rms_error, s.heldout_rms_error, s.probability, s.verdict ?? ""]),
    }),
  };
}
