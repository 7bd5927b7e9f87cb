// What moves what: the part of each parameter in the variance of each output.

import * as Plot from "@observablehq/plot";
import type { MovedQuantity, Sensitivity } from "../documents.ts";
import { nameForPeople } from "../units.ts";
import { below, drawn, finite, scaled, withValues, type Figure } from "./figure.ts";

interface Part {
  output: string;
  parameter: string;
  part: number | null;
  error: number | null;
}

// What is drawn of a quantity and a parameter: the first of these of which anything is known.
const kKinds = [
  {
    axis: "total Sobol index", low: 0,
    of: (q: MovedQuantity, name: string) => ({ part: q.total?.[name]?.index, error: q.total?.[name]?.error }),
    description: "The part of each parameter in the variance of an output over the prior, alone and with the others (total Sobol index, ± its error), from emulators of the finished runs.",
  },
  {
    axis: "rank correlation over the prior", low: -1,
    of: (q: MovedQuantity, name: string) => ({ part: q.prior.correlation?.[name]?.rank, error: q.prior.correlation?.[name]?.error }),
    description: "Rank correlation of each output with each parameter over the prior, from emulators of the finished runs; priors that are tied have no Sobol indices.",
  },
  {
    axis: "rank correlation over the posterior", low: -1,
    of: (q: MovedQuantity, name: string) => ({ part: q.posterior?.correlation?.[name]?.rank, error: q.posterior?.correlation?.[name]?.error }),
    description: "Rank correlation of each output with each parameter over the posterior, from emulators of the finished runs, which do not reach over the prior.",
  },
];

export function sensitivityFigure(sensitivity: Sensitivity): Figure {
  const { parameters, quantities } = sensitivity;
  const known = kKinds.find(({ of }) => quantities.some((q) => parameters.some((name) => finite(of(q, name).part))));
  const { axis, low, of, description } = known ?? kKinds[0]!;
  const parts: Part[] = quantities.flatMap((q) => parameters.map((name) => {
    const { part, error } = of(q, name);
    return { output: `${nameForPeople(q.quantity)}, ${q.experiment}`, parameter: nameForPeople(name), part: part ?? null, error: error ?? null };
  }));
  const outputs = [...new Set(parts.map(({ output }) => output))];
  const names = parameters.map(nameForPeople);
  const title = "Outputs by parameters";
  const draw = (width: number): SVGSVGElement => {
    const beside = width >= 170 * names.length + 200;
    const labels = Math.min(0.42 * width, 12 + 6.4 * Math.max(...outputs.map((name) => name.length)));
    const ends = (sign: number) => ({ part, error }: Part): number => scaled(finite(part) && finite(error) ? Math.min(1, Math.max(low, part + sign * error)) : null, 1);
    const element = drawn(`${title}. ${description}`, {
      width, marginLeft: labels, marginTop: 26,
      height: (beside ? 1 : names.length) * (34 + 22 * outputs.length) + 50,
      x: { ...below(axis), domain: [low, 1], ticks: 3 },
      y: { domain: outputs, label: null, tickSize: 0 },
      ...(beside ? { fx: { domain: names, label: null, padding: 0.12 } } : { fy: { domain: names, label: null, padding: 0.12 } }),
      marks: [
        Plot.barX(parts, {
          ...(beside ? { fx: "parameter" } : { fy: "parameter" }),
          x: ({ part }: Part) => scaled(part, 1), y: "output", insetTop: 5, insetBottom: 5, rx: 2, fill: "var(--model)", fillOpacity: 0.75, className: "parts",
        }),
        Plot.ruleY(parts, { ...(beside ? { fx: "parameter" } : { fy: "parameter" }), x1: ends(-1), x2: ends(1), y: "output", stroke: "var(--ink)", strokeWidth: 1.2 }),
        Plot.ruleX([0], { stroke: "var(--rule-strong)" }),
      ],
    });
    return withValues(element, "parts", parts.map(({ part }) => part));
  };
  return {
    id: "sensitivity", title, description, draw,
    table: () => ({
      columns: ["output", "parameter", axis, "error", "explained by the emulator"].map((name) => ({ name })),
      rows: quantities.flatMap((q, i) => parameters.map((parameter, j) => {
        const part = parts[i * parameters.length + j]!;
        return [part.output, nameForPeople(parameter), part.part, part.error, q.explained];
      })),
    }),
  };
}
