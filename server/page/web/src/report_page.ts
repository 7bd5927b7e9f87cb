// A report: the same views of documents that stand in the file itself, one below the other, what decides first. The file is
// made by server/report/documents/report_page.cc: page.css and page.js inline, `Embedded` in the element "documents".

import { Answers } from "./answers.ts";
import { append, h } from "./dom.ts";
import type { Improvement, Shown } from "./documents.ts";
import { drawForPaper, drawForScreen, drawSoon } from "./figures/frame.ts";
import { dateText, nameForPeople } from "./units.ts";
import { errorView } from "./views/error.ts";
import { fitView } from "./views/fit.ts";
import { misfitView } from "./views/misfit.ts";
import { missingView } from "./views/missing.ts";
import { parametersView } from "./views/parameters.ts";
import { progressView } from "./views/progress.ts";
import { recordView } from "./views/record.ts";
import { sensitivityView } from "./views/sensitivity.ts";
import { stateBadge, type View } from "./views/view.ts";

/// documents: by their paths below /api/v1, as "campaigns/c1/compare".
export interface Embedded {
  campaign: string;
  documents: Record<string, unknown>;
}

const kInSightFirst = 300; // ms

export function showReport({ campaign, documents }: Embedded): void {
  const answers = new Answers(async (path) => {
    const found = documents[path];
    return found === undefined
      ? { status: 404, text: JSON.stringify({ error: "This report does not hold it." }), etag: null }
      : { status: 200, text: JSON.stringify(found), etag: null };
  });
  const shown = documents[`campaigns/${campaign}`] as Shown | undefined;
  const improvement = documents[`campaigns/${campaign}/improvement`] as Improvement | undefined;
  const [first, last] = [improvement?.steps[0], improvement?.steps.at(-1)];
  const main = h("main", { class: "report" });
  const name = shown?.name || campaign;
  append(main, [
    h("div", { class: "heading" }, h("h1", {}, name), h("span", { class: "id" }, campaign), shown ? stateBadge(shown.state) : null),
    shown ? h("p", { class: "sub" }, `${nameForPeople(shown.method)}, submitted ${dateText(shown.created_unix_ms)}`) : null,
  ]);
  append(document.body, [main]);
  document.title = `${name} – calib`;

  const add = (view: View, of: string, needs: string, title: string | null = null): void => {
    if (documents[`campaigns/${of}${needs}`] === undefined) return;
    const root = h("div", { class: "view" });
    append(main, [title === null ? null : h("h2", { class: "part" }, title), root]);
    view(root, { answers, campaign: of, options: new URLSearchParams(), inReport: true, choose: () => {} });
  };
  if (first === undefined || last === undefined || first.campaign === last.campaign) {
    add(fitView, campaign, "/compare");
  } else {
    add(fitView, first.campaign, "/compare", "Before");
    add(fitView, last.campaign, "/compare", `After: with ${last.effects.map(nameForPeople).join(", ")}`);
  }
  add(errorView, campaign, "/improvement");
  add(missingView, campaign, "/diagnosis");
  add(misfitView, campaign, "/compare");
  add(parametersView, campaign, "/posterior");
  add(sensitivityView, campaign, "/sensitivity");
  add(progressView, campaign, "");
  add(recordView, campaign, "/record");
  // Whoever searches, saves or prints has all of it.
  setTimeout(() => drawSoon(document), kInSightFirst);
  addEventListener("beforeprint", () => drawForPaper(document));
  addEventListener("afterprint", () => drawForScreen(document));
}
