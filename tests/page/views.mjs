// Every view of a campaign, held against the documents it is drawn from.

import assert from "node:assert/strict";
import { assertHeights, figures, get, goTo, same, until } from "./looks.mjs";

const shownValue = (tab, selector) =>
  tab.evaluate((wanted) => document.querySelector(wanted)?.getAttribute("data-value") ?? null, selector);
const reading = (tab, name) => shownValue(tab, `[data-name="${name}"] .value`);
const known = (values) => values.filter((value) => value !== null);

async function progress(tab, id) {
  const shown = await get(tab, `campaigns/${id}`);
  assert.equal(Number(await reading(tab, "samples done")), shown.samples_done);
  assert.equal(Number(await reading(tab, "model evaluations")), shown.model_evaluations);
  assert.equal(Number(await reading(tab, "core hours")), shown.core_hours);
  assert.equal(await shownValue(tab, ".heading .state"), shown.state);
  assert.equal(await tab.evaluate(() => document.querySelector("h1").textContent), shown.name);
}

async function fit(tab, id) {
  const compared = await get(tab, `campaigns/${id}/compare`);
  const drawn = await figures(tab, compared.experiments.length);
  for (const experiment of compared.experiments) {
    for (const observable of experiment.observables) {
      const figure = drawn.find((one) => one.id === `fit-${experiment.experiment}-${observable.name}`);
      assert.ok(figure, `a figure of ${experiment.experiment}, ${observable.name}`);
      same(figure.groups.readings.map(({ value }) => value), observable.values, `readings of ${figure.id}`);
      assertHeights(figure.groups.readings, figure.id);
      const median = observable.bands?.q50 ?? observable.bands?.mean;
      if (median) assert.deepEqual(figure.lines.median, median, `median of ${figure.id}`);
    }
  }
  assert.equal(Number(await shownValue(tab, '[data-name="rms_error"] .value')), compared.rms_error);
}

async function misfit(tab, id) {
  const compared = await get(tab, `campaigns/${id}/compare`);
  const drawn = await figures(tab, 1 + compared.parameter_drift.length);
  const stages = drawn.find((one) => one.id === "stages");
  same(stages.groups.stages.map(({ value }) => value), compared.by_segment.map((row) => row.rms_error), "errors of the stages");
  for (const name of new Set(compared.experiments.flatMap((e) => e.observables.map((o) => o.name)))) {
    const expected = compared.experiments.flatMap((e) => known(e.observables.find((o) => o.name === name)?.residual ?? []));
    if (expected.length === 0) continue;
    const figure = drawn.find((one) => one.id === `residual-${name}`);
    same(figure.groups.residuals.map(({ value }) => value), expected, `residuals of ${name}`);
  }
}

async function parameters(tab, id) {
  const posterior = await get(tab, `campaigns/${id}/posterior`);
  const names = Object.keys(posterior.parameters);
  const drawn = await figures(tab, 1 + names.length);
  for (const name of names) {
    const one = posterior.parameters[name];
    const cells = await tab.evaluate((row) => [...document.querySelectorAll(`[data-parameter="${row}"] .value`)].map((e) => e.getAttribute("data-value")), name);
    assert.deepEqual(cells.map((text) => (text === "null" ? null : Number(text))), [one.mean, one.sd, one.cov, one.q05, one.q50, one.q95, one.prior_min, one.prior_max], name);
    const path = drawn.find((figure) => figure.id === `path-${name}`);
    same(path.groups.path.map(({ value }) => value), posterior.path.map((point) => point.mean[names.indexOf(name)]), `path of ${name}`);
    assertHeights(path.groups.path, path.id);
  }
}

async function missing(tab, id) {
  const diagnosis = await get(tab, `campaigns/${id}/diagnosis`);
  if (diagnosis === null) {
    assert.match(await tab.evaluate(() => document.querySelector(".empty").textContent), new RegExp(`calibctl diagnose ${id}`));
    return;
  }
  assert.equal(await shownValue(tab, ".verdict"), diagnosis.verdict);
  const drawn = await figures(tab, 1);
  const bars = drawn.find((figure) => figure.id === "probabilities").groups.probabilities;
  const all = [...diagnosis.probabilities.map(({ probability }) => probability), diagnosis.none_of_these].sort((a, b) => b - a);
  for (const { value } of bars) assert.ok(all.includes(value), `${value} is one of the probabilities`);
  assert.equal(bars[0].value, all[0]);
  const effects = await tab.evaluate(() => [...document.querySelectorAll("[data-effect]")].map((row) => [row.dataset.effect, row.querySelector(".value").dataset.value]));
  assert.deepEqual(effects.map(([effect, p]) => [effect, Number(p)]).sort(), diagnosis.candidates.map(({ effect, probability }) => [effect, probability]).sort());
}

async function error(tab, id) {
  const improvement = await get(tab, `campaigns/${id}/improvement`);
  if (improvement === null) {
    assert.match(await tab.evaluate(() => document.querySelector(".empty").textContent), new RegExp(`calibctl improve ${id}`));
    return;
  }
  const [steps] = await figures(tab, 1);
  same(steps.groups["error-fitted"].map(({ value }) => value), improvement.steps.map((step) => step.rms_error), "errors of the steps");
  assertHeights(steps.groups["error-fitted"], "errors of the steps");
  const held = improvement.steps.map((step) => step.heldout_rms_error);
  if (known(held).length > 0) same(steps.groups["error-held-out"].map(({ value }) => value), held, "held-out errors");
}

async function grains(tab) {
  assert.ok(await tab.evaluate(() => document.querySelector("canvas, .empty") !== null), "grains, or why there are none");
}

export const kViews = { progress, fit, misfit, parameters, missing, error, grains };

/// A figure as table, CSV and SVG, reached with the keyboard alone.
export async function assertTakenAlong(tab, id) {
  await goTo(tab, `#/${id}/fit`);
  await figures(tab, 1);
  const compared = await get(tab, `campaigns/${id}/compare`);
  const [{ observables, experiment }] = compared.experiments;
  const figure = `[data-figure="fit-${experiment}-${observables[0].name}"]`;
  await tab.evaluate(() => {
    window.taken = {};
    const make = URL.createObjectURL;
    URL.createObjectURL = (blob) => {
      void blob.text().then((text) => (window.taken[blob.type] = text));
      return make.call(URL, blob);
    };
  });
  await tab.focus(`${figure} .tools button`);
  for (let i = 0; i < 3; ++i) {
    await tab.keyboard.press("Enter");
    await tab.keyboard.press("Tab");
  }
  const rows = await tab.evaluate((of) => [...document.querySelectorAll(`${of} tbody tr`)].map((row) => row.children[3].getAttribute("data-value")), figure);
  assert.deepEqual(rows.map((text) => (text === "null" ? null : Number(text))), observables[0].values, "the table's readings");
  await until("CSV and SVG are made", () => tab.evaluate(() => window.taken["text/csv"] && window.taken["image/svg+xml"]));
  const { csv, svg } = await tab.evaluate(() => ({ csv: window.taken["text/csv"], svg: window.taken["image/svg+xml"] }));
  const [head, first] = csv.split("\r\n").map((line) => line.split(","));
  assert.deepEqual(head.slice(0, 2), ["reading", "stage"]);
  assert.equal(Number(first[3]), observables[0].values[0], "SI in the CSV");
  const alone = await tab.evaluate((text) => {
    const parsed = new DOMParser().parseFromString(text, "image/svg+xml");
    return { whole: parsed.querySelector("parsererror") === null, points: parsed.querySelectorAll(".readings circle").length };
  }, svg);
  assert.deepEqual(alone, { whole: true, points: observables[0].values.filter((value) => value !== null).length });
  assert.ok(!svg.includes("var("), "the drawing's colours go with it");
}

export async function assertView(tab, id, name) {
  await goTo(tab, `#/${id}/${name}`);
  await kViews[name](tab, id);
}

export async function assertWorkers(tab) {
  await goTo(tab, "#/workers");
  const workers = await get(tab, "workers");
  const shown = await tab.evaluate(() => [...document.querySelectorAll("[data-worker]")].map((row) => row.dataset.worker));
  assert.deepEqual(shown, workers.map(({ name }) => name));
}

export async function assertList(tab) {
  await goTo(tab, "#/");
  const list = await get(tab, "campaigns");
  const shown = await tab.evaluate(() => [...document.querySelectorAll("[data-campaign]")].map((row) => [row.dataset.campaign, row.querySelector(".state").dataset.value]));
  for (const [campaign, state] of shown) assert.equal(list.find((one) => one.campaign === campaign)?.state, state, campaign);
  assert.ok(shown.length > 0 && shown.length <= list.length);
}
