// How far is it.

import { h, replace, value } from "../dom.ts";
import type { Lineage, Shown, Status } from "../documents.ts";
import { linkTo } from "../route.ts";
import { originOf } from "./family.ts";
import { dateText, durationText, nameForPeople } from "../units.ts";
import { absent, copyable, keeper, plainReading, reading, stateBadge, valueOf, warnings, watchAll, type View } from "./view.ts";

interface Part {
  name: string;
  count: number;
  className: string;
}

function partsOf(s: Status): Part[] {
  const plain = s.samples_done - s.samples_stopped_early - s.samples_diverged - s.samples_unknown;
  const waiting = s.samples - s.samples_done - s.samples_running - s.samples_resting;
  return [
    { name: "done", count: Math.max(0, plain), className: "done" },
    { name: "stopped early", count: s.samples_stopped_early, className: "stopped" },
    { name: "diverged", count: s.samples_diverged, className: "diverged" },
    { name: "unknown", count: s.samples_unknown, className: "diverged" },
    { name: "running", count: s.samples_running, className: "running" },
    { name: "resting", count: s.samples_resting, className: "resting" },
    { name: "waiting", count: Math.max(0, waiting), className: "waiting" },
  ];
}

function bar(s: Status): HTMLElement {
  const parts = partsOf(s).filter(({ count }) => count > 0);
  const text = parts.map(({ name, count }) => `${count} ${name}`).join(", ");
  return h("div", { class: "samples" },
    h("div", { class: "bar", role: "img", "aria-label": `Samples of this iteration: ${text || "none yet"}` },
      parts.map(({ count, className }) => {
        const part = h("span", { class: className });
        part.style.flexGrow = String(count);
        return part;
      })),
    h("ul", { class: "bar-key" }, partsOf(s).filter(({ count, name }) => count > 0 || name === "done").map(({ name, count, className }) =>
      h("li", {}, h("span", { class: `swatch ${className}`, "aria-hidden": "true" }), value(count, String(count)), ` ${name}`))),
  );
}

const kKinShown = 12;

function kin(lineage: Lineage | null, shown: Shown): HTMLElement | null {
  const nodes = lineage?.nodes ?? [];
  const parent = nodes.find(({ campaign }) => campaign === shown.parent);
  // Calibrated models before runs that served a question.
  const children = nodes.filter((node) => node.parent === shown.campaign).sort((a, b) => Number(b.purpose === "extension") - Number(a.purpose === "extension"));
  if (parent === undefined && children.length === 0) return null;
  const entry = (node: (typeof nodes)[number]): HTMLElement =>
    h("li", {}, h("a", { href: linkTo(node.campaign, "progress") }, node.name || node.campaign), " ", h("span", { class: "id" }, node.campaign),
      h("span", { class: "sub" }, originOf(node)), " ", stateBadge(node.state));
  return h("section", { class: "kin" }, h("h2", {}, "Where it comes from, what came of it"),
    parent === undefined ? null : [h("h3", {}, "Comes from"), h("ul", {}, entry(parent))],
    children.length === 0 ? null : [h("h3", {}, "Came of it"), h("ul", {}, children.slice(0, kKinShown).map(entry)),
      children.length > kKinShown ? h("p", { class: "sub" }, `and ${children.length - kKinShown} more, in the list of campaigns`) : null]);
}

export const progressView: View = (root, context) => {
  const id = context.campaign;
  const [now, said, next, family] = [h("div", {}), h("div", {}), h("div", {}), h("div", {})];
  const [keepSaid, keepNext, keepFamily] = [keeper(said), keeper(next), keeper(family)];
  replace(root, now, said, next, family);
  return watchAll(context, [`campaigns/${id}`, `campaigns/${id}/lineage`], ([answer, lineage]) => {
    const shown = valueOf<Shown>(answer);
    if (shown === null) {
      replace(now, absent(answer, "The campaign's progress."));
      return;
    }
    const problems = [shown.problem, shown.nobody_may_run_it === null ? null : `Nothing runs: ${shown.nobody_may_run_it}.`, shown.server_waits, ...shown.warnings].filter((text): text is string => text !== null);
    const nodes = valueOf<Lineage>(lineage);
    keepSaid(problems, () => warnings(problems));
    keepNext(shown.next_command ?? null, () =>
      shown.next_command ? h("section", {}, h("h2", {}, "What next"), copyable(shown.next_command, "the command")) : null);
    keepFamily([nodes, shown.parent], () => kin(nodes, shown));
    const live = shown.state === "running" || shown.state === "queued";
    replace(now,
      h("h2", {}, "How far is it?"),
      h("p", { class: "answer" },
        shown.state === "finished" ? (shown.converged ? "It has finished, and the posterior no longer moves." : "It has finished.") :
        shown.state === "running" ? `Iteration ${shown.iteration + 1} of ${shown.max_iterations}${shown.phase === "" ? "" : `, ${nameForPeople(shown.phase)}`}.` :
        `It is ${shown.state}${shown.reason === "" ? "." : `: ${shown.reason}`}`),
      h("p", { class: "sub" }, `Method: ${nameForPeople(shown.method)}${shown.owner === null ? "" : `; submitted by ${shown.owner}`}, ${dateText(shown.created_unix_ms)}`),
      bar(shown),
      h("dl", { class: "readings" },
        reading("iteration", shown.iteration, `${shown.iteration + 1} / ${shown.max_iterations}`),
        reading("samples done", shown.samples_done, `${shown.samples_done} / ${shown.samples}`),
        plainReading("effective sample size", shown.effective_sample_size),
        plainReading("best misfit", shown.best_misfit, 3, "sd of the noise, best single run"),
        live ? plainReading("states per second", shown.states_per_second ?? null) : null,
        live ? reading("time left", shown.eta_seconds, durationText(shown.eta_seconds), "of this iteration") : null,
        plainReading("model evaluations", shown.model_evaluations, 6),
        plainReading("core hours", shown.core_hours),
      ),
    );
  });
};

