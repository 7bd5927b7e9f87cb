// What was done: how the answer came about, what a paper says of it, what it was made from. Of a report.

import { h, replace, value } from "../dom.ts";
import type { Iteration, Made } from "../documents.ts";
import { iterationsFigure } from "../figures/iterations.ts";
import { numberText } from "../units.ts";
import { spaced } from "./spaced.ts";
import { copyable, FigureList, valueOf, watchAll, type View } from "./view.ts";

function iterationTable(iterations: readonly Iteration[]): HTMLElement {
  return h("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "Iterations" }, h("table", {},
    h("thead", {}, h("tr", {}, ["after iteration", "effective samples", "Pareto index", "log evidence", "model evaluations"].map((name) => h("th", { scope: "col" }, name)))),
    h("tbody", {}, spaced(iterations).map((one) => h("tr", {},
      h("th", { scope: "row" }, one.iteration + 1),
      h("td", {}, value(one.ess, numberText(one.ess, 3))),
      h("td", {}, value(one.pareto_k, numberText(one.pareto_k, 2))),
      h("td", {}, value(one.log_evidence, numberText(one.log_evidence, 5)), one.log_evidence_se == null ? null : ` ± ${numberText(one.log_evidence_se, 2)}`),
      h("td", {}, value(one.model_evaluations, numberText(one.model_evaluations, 6))))))));
}

export const recordView: View = (root, context) => {
  const top = h("div", {});
  const figures = new FigureList();
  const below = h("div", {});
  replace(root, top, figures.element, below);
  return watchAll(context, [`campaigns/${context.campaign}/record`], ([answer]) => {
    const made = valueOf<Made>(answer);
    if (made === null) return;
    const names = Object.keys(made.iterations.at(-1)?.parameters ?? {});
    replace(top, made.iterations.length === 0 ? null : [h("h2", {}, "How the answer came about"), iterationTable(made.iterations)]);
    figures.update(made.iterations.length < 2 ? [] : names.map((name) => iterationsFigure(made.iterations, name)));
    replace(below,
      h("h2", {}, "Methods"),
      h("p", { class: "methods" }, made.methods.sentences.join(" ")),
      h("ol", { class: "references" }, made.methods.references.map((reference) => h("li", {}, reference))),
      made.latex === "" ? null : h("details", {}, h("summary", {}, "The parameters as a LaTeX table"), copyable(made.latex, "the table")),
      h("h2", {}, "Record"),
      h("dl", { class: "record" },
        made.entries.map(([term, text]) => [h("dt", {}, term), h("dd", {}, text)]),
        made.files.map(({ path, sha256 }) => [h("dt", {}, `file ${path}`), h("dd", {}, "SHA-256 ", h("code", {}, sha256))])),
      made.campaign_file === "" ? null : h("details", {}, h("summary", {}, "The campaign file"), h("pre", { tabindex: 0 }, made.campaign_file)));
  });
};
