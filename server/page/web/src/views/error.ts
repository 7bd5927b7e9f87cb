// Does the error fall when what is missing is added.

import { h, replace, value } from "../dom.ts";
import type { Improvement } from "../documents.ts";
import { modelName, stepsFigure } from "../figures/diagnosis.ts";
import { linkTo } from "../route.ts";
import { chanceText, nameForPeople, numberText } from "../units.ts";
import { absent, copyable, FigureList, valueOf, watchAll, type View } from "./view.ts";

export function stepsTable(improvement: Improvement): HTMLElement {
  return h("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "Steps" }, h("table", {},
    h("thead", {}, h("tr", {}, ["model", "fitted [sd]", "held out [sd]", "probability", "verdict", "why"].map((name) =>
      h("th", { scope: "col", class: ["model", "verdict", "why"].includes(name) ? "text" : "" }, name)))),
    h("tbody", {}, improvement.steps.map((s) => h("tr", { "data-campaign": s.campaign },
      h("th", { scope: "row", class: "name" }, h("a", { href: linkTo(s.campaign, "fit") }, modelName(s.effects)), h("span", { class: "id" }, s.campaign)),
      h("td", {}, value(s.rms_error, numberText(s.rms_error, 3))),
      h("td", {}, value(s.heldout_rms_error, numberText(s.heldout_rms_error, 3))),
      h("td", {}, value(s.probability, chanceText(s.probability))),
      h("td", { class: "text" }, nameForPeople(s.verdict ?? "–")),
      h("td", { class: "text reason" }, s.reason),
    )))));
}

export const errorView: View = (root, context) => {
  const id = context.campaign;
  const top = h("div", {});
  const figures = new FigureList("figures single");
  const table = h("div", {});
  replace(root, h("h2", {}, "Does the error fall?"), top, figures.element, table);
  return watchAll(context, [`campaigns/${id}/improvement`], ([answer]) => {
    const improvement = valueOf<Improvement>(answer);
    if (improvement === null) {
      replace(top, absent(answer, [
        "The error of fitted and held-out data, effect by effect, appears when the model has been improved:",
        copyable(`calibctl improve ${id}`, "the command"),
      ]));
      return;
    }
    const first = improvement.steps[0];
    const last = improvement.steps.at(-1);
    replace(top, first === undefined || last === undefined || first === last ? null : h("p", { class: "answer" },
      "From ", value(first.rms_error, numberText(first.rms_error, 3)), " to ", value(last.rms_error, numberText(last.rms_error, 3)), " sd on the fitted data",
      first.heldout_rms_error === null || last.heldout_rms_error === null ? null :
        [", from ", value(first.heldout_rms_error, numberText(first.heldout_rms_error, 3)), " to ", value(last.heldout_rms_error, numberText(last.heldout_rms_error, 3)), " sd on those held out"],
      ` with ${modelName(last.effects)}.`));
    figures.update([stepsFigure(improvement)]);
    replace(table, stepsTable(improvement));
  });
};
