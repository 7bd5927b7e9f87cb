// Where does it fail.

import { h, replace } from "../dom.ts";
import type { Comparison } from "../documents.ts";
import type { Figure } from "../figures/figure.ts";
import { driftFigure, residualFigure, stageMap } from "../figures/residuals.ts";
import { absent, empty, FigureList, valueOf, watchAll, type View } from "./view.ts";
import { fitSentence } from "./fit.ts";

/// The figures that answer: stages, residuals of each observable, parameters fitted to each part.
export function misfitFigures(comparison: Comparison): Figure[] {
  const experiments = comparison.experiments ?? [];
  const observables = [...new Set(experiments.flatMap((one) =>
    one.observables.filter(({ residual }) => residual?.some((each) => each !== null)).map(({ name }) => name)))];
  return [
    ...(comparison.by_segment.length > 0 ? [stageMap(comparison)] : []),
    ...observables.map((name) => residualFigure(experiments, name)),
    ...comparison.parameter_drift.filter(({ fits }) => fits.length > 1).map((drift) => driftFigure(drift, experiments)),
  ];
}

function failures({ where_it_fails: sentences, p_value: p }: Comparison): HTMLElement | null {
  if (sentences === undefined || sentences.length === 0) return p === null ? null : h("p", {}, "No stage of loading stands out.");
  return h("ul", { class: "failures" }, sentences.map((sentence) => h("li", {}, sentence)));
}

export const misfitView: View = (root, context) => {
  const sentence = h("div", {});
  const figures = new FigureList("figures wide-first");
  replace(root, h("h2", {}, "Where does it fail?"), sentence, figures.element);
  return watchAll(context, [`campaigns/${context.campaign}/compare`], ([answer]) => {
    const comparison = valueOf<Comparison>(answer);
    const drawn = comparison === null ? [] : misfitFigures(comparison);
    replace(sentence, comparison === null
      ? absent(answer, "Residuals appear after the first iteration.")
      : drawn.length === 0 ? empty("No residuals yet", "They appear after the first iteration.", comparison.note) : [fitSentence(comparison), failures(comparison)]);
    figures.update(drawn);
  });
};
