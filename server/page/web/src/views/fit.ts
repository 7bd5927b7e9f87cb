// Does it fit.

import { h, replace, value } from "../dom.ts";
import type { Comparison, FittedExperiment, MisfitRow } from "../documents.ts";
import { fitFigure } from "../figures/fit.ts";
import { chanceText, nameForPeople, numberText } from "../units.ts";
import { absent, empty, FigureList, keeper, valueOf, warnings, watchAll, type Context, type View } from "./view.ts";

/// The errors of a comparison in a sentence.
export function fitSentence(comparison: Comparison): HTMLElement | null {
  const { rms_error: error, heldout_rms_error: held, p_value: p } = comparison;
  if (error === null) return comparison.note === "" ? null : h("p", { class: "answer" }, comparison.note);
  return h("p", { class: "answer" },
    "The fitted data are missed by ", h("strong", { "data-name": "rms_error" }, value(error, numberText(error, 3)), " sd"),
    held === null ? null : [", those held out by ", h("strong", { "data-name": "heldout_rms_error" }, value(held, numberText(held, 3)), " sd")],
    "; 1 is as expected.",
    p === null ? null : [" A right model would be as far off with probability ", value(p, chanceText(p)), "."]);
}

function misfitText(row: MisfitRow | undefined): HTMLElement | null {
  if (row === undefined || row.rms_error === null) return null;
  return h("span", { class: "sub" }, nameForPeople(row.observable), ": ", value(row.rms_error, numberText(row.rms_error, 3)), " sd");
}

export const fitView: View = (root, context) => {
  const sections = new Map<string, { element: HTMLElement; head: HTMLElement; figures: FigureList }>();
  const chooser = h("div", { class: "choosers" });
  const sentence = h("div", {});
  const holder = h("div", {});
  const x = context.options.get("x") ?? "";
  const [keepSentence, keepChooser] = [keeper(sentence), keeper(chooser)];
  replace(root, h("h2", {}, "Does it fit?"), sentence, chooser, holder);
  return watchAll(context, [`campaigns/${context.campaign}/compare`], ([answer]) => {
    const comparison = valueOf<Comparison>(answer);
    const experiments = comparison?.experiments ?? [];
    if (comparison === null || experiments.length === 0) {
      keepSentence([answer?.state, comparison?.note], () => comparison === null ? absent(answer, "Readings and runs are drawn from the first run on; the median and its bands after the first iteration.") : empty("Nothing to compare", comparison.note));
      return;
    }
    const { rms_error, heldout_rms_error, p_value, note } = comparison;
    keepSentence([rms_error, heldout_rms_error, p_value, note, comparison.warnings], () => [fitSentence(comparison), warnings(comparison.warnings)]);
    keepChooser(experiments.map((one) => [one.control, one.observables.map(({ name }) => name)]), () => axisChooser(experiments, x, context));
    for (const experiment of experiments) {
      let section = sections.get(experiment.experiment);
      if (section === undefined) {
        const head = h("div", { class: "section-head" });
        const figures = new FigureList();
        section = { element: h("section", { "data-experiment": experiment.experiment }, head, figures.element), head, figures };
        sections.set(experiment.experiment, section);
        holder.appendChild(section.element);
      }
      const rows = comparison.by_observable.filter((row) => row.experiment === experiment.experiment);
      replace(section.head, h("h3", {}, experiment.experiment), h("span", { class: "sub" }, nameForPeople(experiment.test)),
        experiment.role === "validate" ? h("span", { class: "tag held" }, "held out") : null,
        experiment.observables.map(({ name }) => misfitText(rows.find((row) => row.observable === name))));
      section.figures.update(experiment.observables.filter(({ name }) => name !== x).map((observable) => fitFigure(experiment, observable, x)));
    }
  });
};

function axisChooser(experiments: readonly FittedExperiment[], x: string, context: Context): HTMLElement | null {
  const observables = [...new Set(experiments.flatMap((one) => one.observables.map(({ name }) => name)))];
  if (observables.length < 2) return null;
  const choice = (name: string, text: string): HTMLElement =>
    h("option", { value: name, selected: name === x }, text);
  return h("label", {}, "Drawn against ",
    h("select", { name: "x", onchange: (event) => context.choose("x", (event.target as HTMLSelectElement).value) },
      choice("", [...new Set(experiments.map(({ control }) => nameForPeople(control || "reading")))].join(", ")),
      observables.map((name) => choice(name, nameForPeople(name)))));
}
