// What is missing.

import { h, replace, value } from "../dom.ts";
import type { Candidate, Comparison, Diagnosis, Shown } from "../documents.ts";
import { modelName, probabilityFigure, signatureFigure } from "../figures/diagnosis.ts";
import { chanceText, nameForPeople, numberText, quantityText } from "../units.ts";
import { absent, copyable, FigureList, valueOf, warnings, watchAll, type View } from "./view.ts";

const kDrawnCandidates = 4; // told apart by eye over one residual

const kHardly = 0.01; // probability below which an effect is named on demand only

/// Effects that may act, most probable first as the document has them; the others folded.
export function candidateTable(diagnosis: Diagnosis): HTMLElement | null {
  const likely = diagnosis.candidates.filter(({ probability }, i) => i === 0 || (probability ?? 1) >= kHardly);
  const others = diagnosis.candidates.filter((candidate) => !likely.includes(candidate));
  if (likely.length === 0) return null;
  return h("div", {}, rowsOf(diagnosis, likely, "Effects"),
    others.length === 0 ? null : h("details", {}, h("summary", {}, others.length === 1 ? "one effect with less than 1 %" : `${others.length} effects with less than 1 %`), rowsOf(diagnosis, others, "Effects that hardly act")));
}

function rowsOf(diagnosis: Diagnosis, candidates: readonly Candidate[], name: string): HTMLElement {
  return h("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": name }, h("table", {},
    h("thead", {}, h("tr", {}, ["effect", "acts with probability", "strength, alone", "error with it [sd]", "explains", "p", "hard to tell from"].map((title) =>
      h("th", { scope: "col", class: ["effect", "strength, alone", "hard to tell from"].includes(title) ? "text" : "" }, title)))),
    h("tbody", {}, candidates.map((c) => h("tr", { "data-effect": c.effect },
      h("th", { scope: "row", class: "name" }, nameForPeople(c.effect), c.alone ? h("span", { class: "tag good" }, "named by itself") : null),
      h("td", {}, value(c.probability, chanceText(c.probability))),
      h("td", { class: "text" }, Object.entries(c.amplitude ?? {}).map(([parameter, amplitude]) =>
        h("span", { class: "line" }, nameForPeople(parameter.slice(c.effect.length + 1) || parameter), " ", value(amplitude, quantityText(amplitude, parameter, diagnosis.units[parameter] ?? "1", 3))))),
      h("td", {}, value(c.predicted_rms_error, numberText(c.predicted_rms_error, 3))),
      h("td", {}, value(c.explained_fraction, c.explained_fraction === null ? "–" : `${numberText(100 * c.explained_fraction, 2)}\u202f%`)),
      h("td", {}, value(c.p_value, numberText(c.p_value, 2))),
      h("td", { class: "text" }, c.confusable_with.map(nameForPeople).join(", ") || "–"),
    )))));
}

const kVerdicts: Record<string, string> = {
  adequate: "Nothing is missing",
  missing_effect: "An effect is missing",
  ambiguous: "Something is missing; what, these tests cannot tell",
  unexplained: "Something is missing that no effect of the library makes",
};

export const missingView: View = (root, context) => {
  const id = context.campaign;
  const top = h("div", {});
  const probabilities = new FigureList("figures single");
  const table = h("div", {});
  const signatures = new FigureList("figures single");
  const next = h("div", {});
  replace(root, h("h2", {}, "What is missing?"), top, probabilities.element, table, signatures.element, next);
  return watchAll(context, [`campaigns/${id}/diagnosis`, `campaigns/${id}/compare`, `campaigns/${id}`], ([answer, compared, shownAnswer]) => {
    const diagnosis = valueOf<Diagnosis>(answer);
    const shown = valueOf<Shown>(shownAnswer);
    if (diagnosis === null) {
      replace(top, absent(answer, [
        "Which physical effect the model lacks is found by runs with each effect, when the campaign has finished:",
        copyable(`calibctl diagnose ${id}`, "the command"),
      ]));
      return;
    }
    replace(top,
      h("p", { class: "verdict", "data-value": diagnosis.verdict }, kVerdicts[diagnosis.verdict] ?? diagnosis.verdict),
      h("p", { class: "answer" }, diagnosis.sentence),
      byEarlierRules(diagnosis) ? h("p", {}, "By rules of an earlier build. To ask again:", copyable(`calibctl diagnose ${id}`, "the command")) : null,
      diagnosis.only_adequacy ? h("p", { class: "sub" }, "Only whether the model is adequate was asked, not which effect would fit better.") : null,
      warnings([...(diagnosis.in_doubt ? ["This rests on errors that the readings contradict, or on few readings."] : []), ...diagnosis.warnings]),
      h("dl", { class: "readings" },
        diagnosis.credible_set === undefined ? null : h("div", { class: "reading" }, h("dt", {}, "credible set, 95 %"), h("dd", {}, h("ul", { class: "set" },
          diagnosis.credible_set.map((effects) => h("li", {}, modelName(effects)))))),
        (diagnosis.families ?? []).length === 0 ? null : h("div", { class: "reading" }, h("dt", {}, "one of these acts"), h("dd", {}, h("ul", { class: "set" },
          (diagnosis.families ?? []).map(({ effects, probability }) => h("li", {}, effects.map(nameForPeople).join(" or "), " ", value(probability, chanceText(probability))))))),
        h("div", { class: "reading" }, h("dt", {}, "adequacy of the model as it is"), h("dd", {}, value(diagnosis.adequacy.p_value, `p = ${numberText(diagnosis.adequacy.p_value, 2)}`))),
      ));
    probabilities.update((diagnosis.probabilities ?? []).length === 0 ? [] : [probabilityFigure(diagnosis)]);
    replace(table, candidateTable(diagnosis));
    const experiments = valueOf<Comparison>(compared)?.experiments ?? [];
    const drawn = diagnosis.candidates.filter(({ curves }) => curves.length > 0).slice(0, kDrawnCandidates);
    const observables = [...new Set(drawn.flatMap(({ curves }) => curves.map(({ observable }) => observable)))];
    signatures.update(experiments.length === 0 ? [] : observables.map((name) => signatureFigure(experiments, name, drawn)));
    replace(next, notNamed(diagnosis), nextSection(diagnosis, context.inReport ? null : shown?.next_command ?? null));
  });
};

const byEarlierRules = ({ probabilities, only_adequacy: only }: Diagnosis): boolean => probabilities === undefined && !only;

/// Effects that are no candidates, by the reason.
function reasons(title: string, list: readonly { effect: string; reason: string }[]): HTMLElement | null {
  if (list.length === 0) return null;
  const byReason = new Map<string, string[]>();
  for (const { effect, reason } of list) byReason.set(reason, [...(byReason.get(reason) ?? []), nameForPeople(effect)]);
  return h("details", {}, h("summary", {}, title), h("ul", {}, [...byReason].map(([reason, effects]) => h("li", {}, `${effects.join(", ")}: ${reason}`))));
}

function notNamed(diagnosis: Diagnosis): HTMLElement {
  const seen = Object.entries(diagnosis.detectable ?? {});
  return h("section", {},
    seen.length === 0 ? null : h("details", {}, h("summary", {}, "What these tests would have shown, with 90 % power"),
      h("ul", {}, seen.map(([effect, strengths]) => h("li", {}, `${nameForPeople(effect)}: `,
        Object.entries(strengths).map(([name, strength]) => `${nameForPeople(name.slice(effect.length + 1) || name)} ${quantityText(strength, name, diagnosis.units[name] ?? "1", 2)}`).join(", "))))),
    reasons("Not to be detected by these tests", diagnosis.undetectable ?? []),
    reasons("Not tried", diagnosis.not_excitable ?? []));
}

function nextSection(diagnosis: Diagnosis, command: string | null): HTMLElement {
  const experiment = diagnosis.next_experiment ?? null;
  return h("section", {}, h("h2", {}, "What next"),
    experiment === null ? null : [
      h("h3", {}, "The next experiment"),
      h("p", {}, experiment.in_words),
      h("dl", { class: "readings" },
        h("div", { class: "reading" }, h("dt", {}, "it decides with probability"), h("dd", {}, value(experiment.expected_power, chanceText(experiment.expected_power)))),
        experiment.forecast === null ? null : h("div", { class: "reading" }, h("dt", {}, "names a wrong one with"), h("dd", {}, value(experiment.forecast.names_wrong, chanceText(experiment.forecast.names_wrong))))),
      copyable(experiment.snippet, "the experiment for the campaign file"),
    ],
    command === null ? (experiment === null ? h("p", {}, "The diagnosis proposes no further test.") : null) : [h("h3", {}, "The command that goes on"), copyable(command, "the command")]);
}
