// Which campaigns are there, in which state, and which comes from which.

import type { Answers } from "../answers.ts";
import { h, replace, value } from "../dom.ts";
import type { Status } from "../documents.ts";
import { linkTo } from "../route.ts";
import { dateText, numberText } from "../units.ts";
import { familyRows, kFoldFrom, originOf, type Row } from "./family.ts";
import { absent, empty, stateBadge } from "./view.ts";

export function campaignsView(root: HTMLElement, answers: Answers): () => void {
  const unfolded = new Set<string>();
  let list: Status[] = [];
  const holder = h("div", {});
  replace(root, h("h1", {}, "Campaigns"), holder);
  const show = (): void => {
    if (list.length === 0) {
      replace(holder, empty("No campaign yet", "A campaign appears here as soon as it is submitted:", h("code", {}, "calibctl submit sand.yaml")));
      return;
    }
    const active = holder.contains(document.activeElement) ? document.activeElement : null;
    const focused = active?.closest<HTMLElement>("[data-campaign]")?.dataset["campaign"];
    replace(holder, h("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "Campaigns" },
      h("table", { class: "campaigns" },
        h("thead", {}, h("tr", {}, ["campaign", "state", "owner", "samples", "effective samples", "best misfit [sd]", "runs", "core hours", "submitted"].map((name, i) =>
          h("th", { scope: "col", class: i < 3 || i === 8 ? "text" : "" }, name)))),
        h("tbody", {}, familyRows(list, unfolded).map(row)),
      )));
    // The table is made anew; who was on a row stays there.
    if (active !== null && focused !== undefined) {
      holder.querySelector<HTMLElement>(`[data-campaign="${CSS.escape(focused)}"] ${active.localName}`)?.focus({ preventScroll: true });
    }
  };
  const row = ({ status: s, depth, kin }: Row): HTMLElement => {
    const open = unfolded.has(s.campaign);
    return h("tr", { "data-campaign": s.campaign },
      h("th", { scope: "row", class: `name depth${Math.min(depth, 4)}` },
        h("a", { href: linkTo(s.campaign, "progress") }, s.name || s.campaign),
        h("span", { class: "id" }, s.campaign),
        originOf(s) === "" ? null : h("span", { class: "sub" }, originOf(s)),
        kin < kFoldFrom ? null : h("button", { type: "button", class: "fold", "aria-expanded": String(open), onclick: () => {
          if (open) unfolded.delete(s.campaign);
          else unfolded.add(s.campaign);
          show();
        } }, open ? `fold ${kin} derived` : `${kin} derived`),
      ),
      h("td", { class: "text" }, stateBadge(s.state), s.reason === "" ? null : h("span", { class: "sub" }, s.reason)),
      h("td", { class: "text" }, s.owner ?? "–", (s.priority ?? 0) === 0 ? null : h("span", { class: "sub" }, `priority ${s.priority}`)),
      h("td", {}, value(s.samples_done, numberText(s.samples_done)), " / ", value(s.samples, numberText(s.samples)),
        h("span", { class: "sub" }, `iteration ${s.iteration + 1} of ${s.max_iterations}`)),
      h("td", {}, value(s.effective_sample_size, numberText(s.effective_sample_size, 3))),
      h("td", {}, value(s.best_misfit, numberText(s.best_misfit, 3))),
      h("td", {}, value(s.model_evaluations, numberText(s.model_evaluations))),
      h("td", {}, value(s.core_hours, numberText(s.core_hours, 3))),
      h("td", { class: "text" }, h("time", { datetime: new Date(s.created_unix_ms).toISOString() }, dateText(s.created_unix_ms))),
    );
  };
  return answers.watch<Status[]>("campaigns", (answer) => {
    if (answer.state === "here") {
      list = answer.value;
      show();
    } else {
      replace(holder, absent(answer, "Campaigns appear here."));
    }
  });
}
