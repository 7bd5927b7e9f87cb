// Does it fit: readings with error bars, the model's median and bands over the posterior, single runs.

import * as Plot from "@observablehq/plot";
import type { FittedExperiment, FittedObservable, Maybe, Run } from "../documents.ts";
import { axisLabel, largest, nameForPeople, quantityText, unitForPeople } from "../units.ts";
import { below, drawn, finite, scaled, withValues, type Column, type Figure, type KeyEntry, type Table } from "./figure.ts";

/// Against what readings are drawn: the control, or another observable of the test.
interface Abscissa {
  name: string;
  unit: string;
  values: Maybe[];
  sd: Maybe[] | null;
  median: Maybe[] | null;
  runs: Maybe[][] | null; // null: as the values
}

function abscissaOf(experiment: FittedExperiment, name: string): Abscissa {
  const observable = experiment.observables.find((one) => one.name === name);
  if (observable === undefined) {
    const values = experiment.control_values;
    return { name: experiment.control || "reading", unit: experiment.control_unit, values, sd: null, median: null, runs: null };
  }
  const { unit, values, total_sd: sd, runs } = observable;
  return { name, unit, values, sd, median: medianOf(observable), runs };
}

const known = (values: Maybe[] | null | undefined): Maybe[] | null => (values?.some(finite) ? values : null);

const medianOf = ({ bands }: FittedObservable): Maybe[] | null => known(bands?.q50) ?? known(bands?.mean);

const ended = (run: Run): boolean => run.status === "finished";

/// x: the name of an observable of the test, or anything else for its control.
export function fitFigure(experiment: FittedExperiment, observable: FittedObservable, x = ""): Figure {
  const against = abscissaOf(experiment, x);
  const ofControl = against.runs === null;
  const xUnit = unitForPeople(against.name, against.unit, largest(against.values));
  const yUnit = unitForPeople(observable.name, observable.unit, largest(observable.values));
  const held = experiment.role === "validate";
  const color = held ? "var(--held)" : "var(--model)";
  const { bands } = observable;
  const median = medianOf(observable);
  const rows = observable.values.map((_, i) => i);
  const xOf = (i: number): number => scaled(against.values[i], xUnit.factor);
  const at = (values: Maybe[] | null | undefined) => (i: number): number => scaled(values?.[i], yUnit.factor);

  const runPoints = experiment.runs.flatMap((run, r) =>
    rows.map((i) => ({
      x: ofControl ? xOf(i) : scaled(against.runs?.[r]?.[i], xUnit.factor),
      y: scaled(observable.runs[r]?.[i], yUnit.factor),
      run,
    })),
  );

  const key: KeyEntry[] = [{ mark: "dot", color: "var(--measured)", text: "measured, ± 1 sd" }];
  if (median !== null) key.push({ mark: "line", color, text: known(bands?.q50) ? "median" : "mean" });
  if (ofControl && known(bands?.q25)) key.push({ mark: "band", color, text: bands?.q025 ? "50 and 95 %" : "50 and 90 %" });
  else if (ofControl && known(bands?.q05)) key.push({ mark: "band", color, text: "5 to 95 %" });
  if (experiment.runs.some(ended)) key.push({ mark: "faint", color: "var(--run)", text: "best runs" });
  if (experiment.runs.some((run) => !ended(run))) key.push({ mark: "dash", color: "var(--run)", text: "running, stopped early" });

  const title = `${nameForPeople(observable.name)} against ${nameForPeople(against.name)}`;
  const description =
    `${experiment.experiment}${held ? ", held out" : ""}: ${observable.values.filter(finite).length} readings` +
    (median === null
      ? ", no posterior yet."
      : known(bands?.q05)
        ? ", and the model over the posterior."
        : ", and the mean of the weighted runs; no interval is given.");

  const draw = (width: number): SVGSVGElement => {
    const band = (low: Maybe[] | null | undefined, high: Maybe[] | null | undefined, opacity: number): Plot.Markish =>
      ofControl && low && high
        ? Plot.areaY(rows, { x: xOf, y1: at(low), y2: at(high), fill: color, fillOpacity: opacity, className: "band" })
        : null;
    const element = drawn(`${title}. ${description}`, {
      width,
      height: Math.round(Math.min(360, Math.max(210, width * 0.62))),
      marginLeft: 52,
      x: { ...below(axisLabel(against.name, xUnit)), nice: true },
      y: { label: axisLabel(observable.name, yUnit), nice: true, grid: true },
      marks: [
        band(bands?.q025 ?? bands?.q05, bands?.q975 ?? bands?.q95, 0.16),
        band(bands?.q25, bands?.q75, 0.26),
        Plot.line(runPoints.filter(({ run }) => !ended(run)), {
          x: "x", y: "y", z: ({ run }: { run: Run }) => run.sample,
          stroke: "var(--run)", strokeWidth: 0.9, strokeOpacity: 0.45, strokeDasharray: "3 3",
        }),
        Plot.line(runPoints.filter(({ run }) => ended(run)), {
          x: "x", y: "y", z: ({ run }: { run: Run }) => run.sample,
          stroke: "var(--run)", strokeWidth: 0.9, strokeOpacity: 0.55,
        }),
        median === null ? null : Plot.line(rows, {
          x: ofControl ? xOf : (i: number) => scaled(against.median?.[i], xUnit.factor),
          y: at(median), stroke: color, strokeWidth: 2, className: "median",
        }),
        Plot.ruleX(rows, {
          x: xOf,
          y1: (i: number) => at(observable.values)(i) - at(observable.total_sd)(i),
          y2: (i: number) => at(observable.values)(i) + at(observable.total_sd)(i),
          stroke: "var(--measured)", strokeOpacity: 0.6,
        }),
        against.sd === null ? null : Plot.ruleY(rows, {
          y: at(observable.values),
          x1: (i: number) => xOf(i) - scaled(against.sd?.[i], xUnit.factor),
          x2: (i: number) => xOf(i) + scaled(against.sd?.[i], xUnit.factor),
          stroke: "var(--measured)", strokeOpacity: 0.6,
        }),
        Plot.dot(rows, {
          x: xOf, y: at(observable.values), r: 2.4, fill: "var(--measured)", className: "readings",
          title: (i: number) => [
            `${nameForPeople(against.name)} ${quantityText(against.values[i], against.name, against.unit)}`,
            `measured ${quantityText(observable.values[i], observable.name, observable.unit)} ± ${quantityText(observable.total_sd[i], observable.name, observable.unit, 2)}`,
            ...(median === null ? [] : [`model ${quantityText(median[i], observable.name, observable.unit)}`]),
          ].join("\n"),
        }),
      ],
    });
    withValues(element, "readings", observable.values);
    // A line is one element: its values in order, as the readings stand.
    const line = element.querySelector("g.median path");
    if (line !== null && median !== null) line.setAttribute("data-values", JSON.stringify(median));
    return element;
  };

  const table = (): Table => {
    const xColumn: Column = { name: against.name, unit: against.unit, shown: xUnit };
    const y = (name: string): Column => ({ name, unit: observable.unit, shown: yUnit });
    const columns: [Column, Maybe[] | null | undefined][] = [
      [xColumn, against.values],
      [y(observable.name), observable.values],
      [y("sd"), observable.total_sd],
    ];
    for (const [name, values] of Object.entries(bands ?? {})) {
      if (values !== null) columns.push([y(name), values as Maybe[]]);
    }
    return {
      columns: [{ name: "reading" }, { name: "stage" }, ...columns.map(([column]) => column)],
      rows: rows.map((i) => [i, experiment.segments[i] ?? "", ...columns.map(([, values]) => values?.[i] ?? null)]),
    };
  };

  return { id: `fit-${experiment.experiment}-${observable.name}`, title, description, key, draw, table };
}
