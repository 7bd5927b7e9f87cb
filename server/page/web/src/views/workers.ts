// Who computes.

import type { Answers } from "../answers.ts";
import { h, replace, value } from "../dom.ts";
import type { Worker } from "../documents.ts";
import { durationText, numberText } from "../units.ts";
import { absent, empty } from "./view.ts";

export function workersView(root: HTMLElement, answers: Answers): () => void {
  const holder = h("div", {});
  replace(root, h("h1", {}, "Workers"), holder);
  return answers.watch<Worker[]>("workers", (answer) => {
    if (answer.state !== "here") {
      replace(holder, absent(answer, "Workers appear here when they connect."));
      return;
    }
    if (answer.value.length === 0) {
      replace(holder, empty("No worker yet", "One appears here when it connects:", h("code", {}, "calib-worker --server HOST:PORT")));
      return;
    }
    const word = (w: Worker): string => (w.left ? "left" : !w.connected ? "lost" : w.waits ? "waits" : w.draining ? "draining" : w.busy > 0 ? "computing" : "idle");
    replace(holder, h("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "Workers" }, h("table", {},
      h("thead", {}, h("tr", {}, ["worker", "state", "busy", "contact updates [1/s]", "last heard", "running", "processor"].map((name) =>
        h("th", { scope: "col", class: ["worker", "state", "running", "processor"].includes(name) ? "text" : "" }, name)))),
      h("tbody", {}, answer.value.map((w) => h("tr", { "data-worker": w.name },
        h("th", { scope: "row", class: "name" }, w.name),
        h("td", { class: "text" }, word(w), w.waits ? h("span", { class: "sub" }, w.waits) : ""),
        h("td", {}, value(w.busy, numberText(w.busy)), " / ", value(w.slots, numberText(w.slots))),
        h("td", {}, value(w.contact_updates_per_second, numberText(w.contact_updates_per_second, 3))),
        h("td", {}, value(w.seconds_since_heard, durationText(w.seconds_since_heard))),
        h("td", { class: "text" }, w.running.join(", ") || "–"),
        h("td", { class: "text" }, w.cpu, h("span", { class: "sub" }, w.engine_version)),
      ))))));
  });
}
