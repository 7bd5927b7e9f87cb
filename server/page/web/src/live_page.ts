// The live page: a head that says where one is and whether the server answers, a view below it.

import { Answers, askServer } from "./answers.ts";
import { append, h, replace } from "./dom.ts";
import type { Status } from "./documents.ts";
import { drawForPaper, drawForScreen } from "./figures/frame.ts";
import { Live, type Connection } from "./live.ts";
import { kViews, linkTo, readRoute, type ViewName } from "./route.ts";
import { campaignsView } from "./views/campaigns.ts";
import { errorView } from "./views/error.ts";
import { fitView } from "./views/fit.ts";
import { grainsView } from "./views/grains.ts";
import { misfitView } from "./views/misfit.ts";
import { missingView } from "./views/missing.ts";
import { parametersView } from "./views/parameters.ts";
import { progressView } from "./views/progress.ts";
import { stateBadge, type View } from "./views/view.ts";
import { workersView } from "./views/workers.ts";
import { nameForPeople } from "./units.ts";

const kQuestions: Record<ViewName, { question: string; view: View }> = {
  progress: { question: "How far", view: progressView },
  fit: { question: "Does it fit", view: fitView },
  misfit: { question: "Where it fails", view: misfitView },
  parameters: { question: "Parameters", view: parametersView },
  missing: { question: "What is missing", view: missingView },
  error: { question: "Does the error fall", view: errorView },
  grains: { question: "The grains", view: grainsView },
};

export function showLivePage(): void {
  const answers = new Answers(askServer);
  const [said, countdown] = [h("span", { role: "status" }), h("span", { "aria-hidden": "true" })];
  const connection = h("p", { class: "connection" }, h("span", { class: "lamp", "aria-hidden": "true" }), said, countdown);
  const nav = h("nav", { "aria-label": "Pages" });
  const main = h("main", { id: "content", tabindex: -1 });
  append(document.body, [
    h("a", { class: "skip", href: "#content", onclick: (event) => {
      event.preventDefault(); // the fragment is the route's
      main.focus();
    } }, "To the content"),
    h("header", { class: "top" }, h("a", { class: "brand", href: "#/" }, "calib"), nav, connection),
    main,
  ]);

  function sayConnection(now: Connection): void {
    const text = {
      connecting: "connecting …",
      open: "live",
      server_away: "calibd does not answer; shown is what was known",
      lost: "the server does not answer",
    }[now.state];
    connection.className = `connection ${now.state}`;
    if (said.textContent !== text) said.textContent = text; // what is said aloud is said once
    countdown.textContent = now.state === "lost" ? `; tried again in ${now.retryInS} s` : "";
  }

  let end = (): void => {};
  let here = "";

  function show(): void {
    const route = readRoute(location.hash);
    const place = `${route.campaign ?? ""}/${route.view}`;
    const moved = place !== here;
    here = place;
    end();
    replace(nav, [["#/", "Campaigns", "campaigns"], ["#/workers", "Workers", "workers"]].map(([href, text, name]) =>
      h("a", { href, "aria-current": route.view === name ? "page" : null }, text)));
    if (route.campaign === null) {
      document.title = `${route.view === "workers" ? "Workers" : "Campaigns"} – calib`;
      end = (route.view === "workers" ? workersView : campaignsView)(main, answers);
    } else {
      end = showCampaign(route.campaign, route.view as ViewName, route.options);
    }
    if (moved) {
      window.scrollTo(0, 0);
      if (document.activeElement !== document.body) main.focus({ preventScroll: true });
    }
  }

  function showCampaign(campaign: string, view: ViewName, options: URLSearchParams): () => void {
    const heading = h("div", { class: "heading" }, h("h1", {}, campaign));
    const root = h("div", { class: `view ${view}` });
    replace(main, heading,
      h("nav", { class: "views", "aria-label": "Views of the campaign" }, kViews.map((name) =>
        h("a", { href: linkTo(campaign, name), "aria-current": name === view ? "page" : null }, kQuestions[name].question))),
      root);
    main.querySelector(".views [aria-current]")?.scrollIntoView({ block: "nearest", inline: "center" });
    document.title = `${campaign} – calib`;
    const stopHead = answers.watch<Status>(`campaigns/${campaign}`, (answer) => {
      if (answer.state !== "here") return;
      const s = answer.value;
      document.title = `${s.name || campaign}: ${kQuestions[view].question.toLowerCase()} – calib`;
      replace(heading, h("h1", {}, s.name || campaign), h("span", { class: "id" }, campaign), stateBadge(s.state),
        s.effects.length === 0 ? null : h("span", { class: "sub" }, `with ${s.effects.map(nameForPeople).join(", ")}`));
    });
    const choose = (name: string, value: string): void => {
      const changed = Object.fromEntries(options);
      if (value === "") delete changed[name];
      else changed[name] = value;
      location.hash = linkTo(campaign, view, changed);
    };
    const stopView = kQuestions[view].view(root, { answers, campaign, options, choose });
    return () => {
      stopHead();
      stopView();
    };
  }

  addEventListener("hashchange", show);
  addEventListener("beforeprint", () => drawForPaper(document));
  addEventListener("afterprint", () => drawForScreen(document));
  show();
  new Live(answers, sayConnection).start();
}
