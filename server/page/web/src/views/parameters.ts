// What are the parameters.

import { h, replace, value } from "../dom.ts";
import type { Answer } from "../answers.ts";
import type { ErrorSize, Lineage, Posterior } from "../documents.ts";
import { batchesFigure } from "../figures/batches.ts";
import { cornerFigure, inferredParameters, pathFigure, type NamedPosterior } from "../figures/parameters.ts";
import { chanceText, nameForPeople, numberText, quantityText, unitForPeople } from "../units.ts";
import { absent, empty, FigureList, keeper, valueOf, warnings, watchAll, type Context, type View } from "./view.ts";

const kMostInCorner = 6;

export function parameterTable(parameters: Posterior["parameters"], title = "parameter"): HTMLElement {
  const rows = Object.entries(parameters);
  return h("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": title === "parameter" ? "Parameters" : "Nuisance parameters" }, h("table", {},
    h("thead", {}, h("tr", {}, [title, "mean", "sd", "variation", "5 %", "median", "95 %", "prior", ""].map((name, i) =>
      h("th", { scope: "col", class: i === 0 || i === 8 ? "text" : "" }, name)))),
    h("tbody", {}, rows.map(([name, p]) => {
      const unit = unitForPeople(name, p.unit, Math.abs(p.mean ?? 0));
      const cell = (raw: number | null, digits = 4): HTMLElement => h("td", {}, value(raw, numberText(raw === null ? null : raw * unit.factor, digits)));
      return h("tr", { "data-parameter": name },
        h("th", { scope: "row", class: "name" }, nameForPeople(name), unit.label === "" ? null : h("span", { class: "unit" }, unit.label)),
        cell(p.mean), cell(p.sd, 2),
        h("td", {}, value(p.cov, p.cov === null ? "–" : `${numberText(100 * p.cov, 2)}\u202f%`)),
        cell(p.q05), cell(p.q50), cell(p.q95),
        h("td", {}, value(p.prior_min, quantityText(p.prior_min, name, p.unit, 3)), " … ", value(p.prior_max, quantityText(p.prior_max, name, p.unit, 3))),
        h("td", { class: "text" }, p.at_bound ? h("span", { class: "tag bad" }, "at its bound") : p.conditioned_on ? h("span", { class: "tag" }, "held fixed") : ""));
    }))));
}

function sourceSentence(posterior: Posterior): string {
  const words: Record<string, string> = {
    weights: "The posterior is that of the weighted samples.",
    tmcmc: "The posterior is that of equally weighted chains.",
    emulator: "The posterior was sampled on an emulator of the runs.",
    none: "Neither the weighted samples nor an emulator give a posterior: means stand without uncertainty.",
  };
  return words[posterior.posterior_from ?? ""] ?? "";
}

export const parametersView: View = (root, context) => {
  const id = context.campaign;
  const others = (context.options.get("with") ?? "").split(",").filter((other) => other !== "" && other !== id);
  const top = h("div", {});
  const chooser = h("div", { class: "choosers" });
  const keepChooser = keeper(chooser);
  const corner = new FigureList("figures single");
  const paths = new FigureList();
  const along = h("h2", { hidden: true }, "How the estimate comes about");
  replace(root, h("h2", {}, "What are the parameters?"), top, chooser, corner.element, along, paths.element);
  const posteriorPaths = [id, ...others].map((one) => `campaigns/${one}/posterior`);
  return watchAll(context, [`campaigns/${id}/lineage`, ...posteriorPaths], ([lineage, own, ...rest]) => {
    const posterior = valueOf<Posterior>(own);
    if (posterior === null) {
      replace(top, absent(own, "Parameters appear when the first iteration is complete."));
      return;
    }
    const names = inferredParameters(posterior);
    if (names.length === 0 || posterior.posterior_from === null) {
      replace(top, empty("No parameters to show", "This campaign ran a table of parameter sets; nothing was inferred."));
      return;
    }
    replace(top, h("p", { class: "answer" }, sourceSentence(posterior), " Evidence: log ",
      value(posterior.log_evidence, numberText(posterior.log_evidence, 5)),
      posterior.log_evidence_se === null ? "." : [" ± ", value(posterior.log_evidence_se, numberText(posterior.log_evidence_se, 2)), "."],
      posterior.predictive_p === null ? null : [" Data like these or further off under the model: ", value(posterior.predictive_p, chanceText(posterior.predictive_p)), "."]),
      (posterior.noise_scale ?? []).map(({ observables, q05, q50, q95 }) => h("p", {}, `Errors of ${observables.map(nameForPeople).join(", ")} are `,
        value(q50, numberText(q50, 2)), ` times as large as stated (5 to 95 %: ${numberText(q05, 2)} to ${numberText(q95, 2)}).`)),
      (posterior.model_error ?? []).map(({ observables, relative, absolute }) => h("p", {},
        `Beside the stated errors the model is off in ${observables.map(nameForPeople).join(", ")} by `,
        relative === undefined ? null : errorSize(relative, 100, " % of a reading"),
        relative === undefined || absolute === undefined ? null : " and ",
        absolute === undefined ? null : errorSize(absolute, 1, " in the unit of the readings, SI"), ".")),
      warnings(posterior.warnings), parameterTable(posterior.parameters),
      Object.keys(posterior.nuisance_parameters ?? {}).length === 0 ? null : parameterTable(posterior.nuisance_parameters!, "nuisance"));
    const laid: NamedPosterior[] = [{ name: nameIn(lineage, id), posterior }];
    rest.forEach((answer, i) => {
      const other = valueOf<Posterior>(answer);
      if (other !== null) laid.push({ name: nameIn(lineage, others[i]!), posterior: other });
    });
    keepChooser(valueOf<Lineage>(lineage), () => overlayChooser(lineage, others, context));
    corner.update([cornerFigure(laid, names.slice(0, kMostInCorner))]);
    const batches = posterior.batches ?? [];
    along.hidden = posterior.path.length === 0 && batches.length === 0;
    paths.update([
      ...(batches.length === 0 ? [] : [batchesFigure(batches)]),
      ...(posterior.path.length === 0 ? [] : names.map((name) => pathFigure(posterior, name))),
    ]);
  });
};

function errorSize({ q05, q50, q95 }: ErrorSize, scale: number, of: string): (Node | string)[] {
  const shown = (x: number | null): string => numberText(x === null ? null : scale * x, 2);
  return [value(q50, shown(q50)), `${of} (5 to 95 %: ${shown(q05)} to ${shown(q95)})`];
}

function nameIn(lineage: Answer<unknown> | undefined, id: string): string {
  const node = valueOf<Lineage>(lineage)?.nodes.find(({ campaign }) => campaign === id);
  if (node === undefined) return id;
  return node.effects.length === 0 ? `${id} ${node.name}` : `${id} with ${node.effects.map(nameForPeople).join(", ")}`;
}

// Campaigns of the family whose parameters were inferred as well.
function overlayChooser(lineage: Answer<unknown> | undefined, chosen: readonly string[], context: Context): HTMLElement | null {
  const family = (valueOf<Lineage>(lineage)?.nodes ?? []).filter(
    ({ campaign, purpose }) => campaign !== context.campaign && (purpose === null || purpose === "extension"));
  if (family.length === 0) return null;
  return h("fieldset", {}, h("legend", {}, "Laid over it"), family.map(({ campaign }) =>
    h("label", {}, h("input", { type: "checkbox", name: "with", value: campaign, checked: chosen.includes(campaign), onchange: (event) => {
      const on = (event.target as HTMLInputElement).checked;
      context.choose("with", [...chosen.filter((one) => one !== campaign), ...(on ? [campaign] : [])].join(","));
    } }), " ", nameIn(lineage, campaign))));
}
