// What a page is held to in the browser, wherever it comes from: what is drawn are the numbers of the API, nothing is asked of
// another host, nothing breaks the content security policy, no serious finding of axe-core, nothing wider than the screen.

import assert from "node:assert/strict";
import { mkdirSync } from "node:fs";
import { createRequire } from "node:module";
import { join } from "node:path";

/// modules: a folder with the page's node_modules, those for its development among them.
export function tools(modules) {
  const require = createRequire(join(modules, "package.json"));
  return { puppeteer: require("puppeteer-core"), axe: require("axe-core").source };
}

export async function launch(puppeteer, chromium) {
  return puppeteer.launch({
    executablePath: chromium,
    args: [
      "--no-sandbox", "--disable-dev-shm-usage", "--disable-background-networking", "--disable-component-update",
      "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist",
    ],
  });
}

/// A tab that keeps what must not happen in `wrong`. quiet(false) while the server is away on purpose.
export async function openTab(browser, origin, { width = 1280, height = 900, scheme = "light" } = {}) {
  const tab = await browser.newPage();
  const wrong = [];
  let quiet = true;
  const report = (text) => quiet && wrong.push(text);
  await tab.setViewport({ width, height });
  await tab.emulateMediaFeatures([{ name: "prefers-color-scheme", value: scheme }]);
  await tab.evaluateOnNewDocument(() => {
    window.violations = [];
    window.tasks = [];
    document.addEventListener("securitypolicyviolation", (event) => window.violations.push(`${event.effectiveDirective} ${event.blockedURI}`));
    new PerformanceObserver((list) => window.tasks.push(...list.getEntries().map(({ duration }) => duration))).observe({ type: "longtask", buffered: true });
  });
  tab.on("request", (request) => {
    const url = request.url();
    if (!url.startsWith(origin) && !url.startsWith("blob:") && !url.startsWith("data:")) report(`asked another host: ${url}`);
  });
  tab.on("pageerror", (error) => report(`script error: ${error.message}`));
  // 404 and 409 say that there is no such document yet; the browser writes them on the console all the same.
  tab.on("console", (message) => {
    if (message.type() === "error" && !/status of (404|409)/.test(message.text())) report(`console: ${message.text()}`);
  });
  return {
    tab,
    wrong,
    expectLoss: (lost) => (quiet = !lost),
    async violations() {
      return tab.evaluate(() => window.violations);
    },
  };
}

export const get = (tab, path) =>
  tab.evaluate(async (asked) => {
    const reply = await fetch(`api/v1/${asked}`, { cache: "no-store" });
    return reply.ok ? reply.json() : null;
  }, path);

/// Asks again and again; the machine may have other things to do.
export async function until(what, condition, timeoutS = 40) {
  const end = Date.now() + 1000 * timeoutS;
  for (;;) {
    const value = await condition();
    if (value) return value;
    if (Date.now() > end) assert.fail(`within ${timeoutS} s: ${what}`);
    await new Promise((resolve) => setTimeout(resolve, 100));
  }
}

export async function goTo(tab, fragment) {
  await tab.evaluate((to) => (location.hash = to), fragment);
  await until(`view of ${fragment}`, () =>
    tab.evaluate(() => document.querySelector("main h1") !== null && document.querySelector("main .asked") === null));
}

/// All figures of the view, drawn: scrolled through until each has its picture. Gives
/// [{id, groups: {class: [{index, value, x, y}]}, lines: {class: [value]}}], points in the order of the document.
export async function figures(tab, least = 1) {
  const undrawn = () => tab.evaluate(() => [...document.querySelectorAll("figure")].filter((f) => !f.querySelector("svg.plot")).length);
  const all = () => tab.evaluate(() => document.querySelectorAll("figure").length);
  await until(`${least} figures`, async () => (await all()) >= least);
  await until("every figure drawn", async () => {
    await tab.evaluate(async () => {
      for (const figure of document.querySelectorAll("figure")) {
        if (figure.querySelector("svg.plot")) continue;
        figure.scrollIntoView();
        // What has come into sight is told after the frame: the second one is past that.
        for (let frame = 0; frame < 2; ++frame) await new Promise((resolve) => requestAnimationFrame(resolve));
      }
      window.scrollTo(0, 0);
    });
    return (await undrawn()) === 0;
  });
  return tab.evaluate(() =>
    [...document.querySelectorAll("figure")].map((figure) => {
      const groups = {};
      for (const element of figure.querySelectorAll("svg.plot [data-value]")) {
        const group = element.parentElement.getAttribute("class");
        const box = element.getBoundingClientRect();
        (groups[group] ??= []).push({ index: Number(element.getAttribute("data-index")), value: Number(element.getAttribute("data-value")), x: box.x + box.width / 2, y: box.y + box.height / 2 });
      }
      for (const points of Object.values(groups)) points.sort((a, b) => a.index - b.index);
      const lines = {};
      for (const element of figure.querySelectorAll("svg.plot [data-values]")) {
        lines[element.parentElement.getAttribute("class")] = JSON.parse(element.getAttribute("data-values"));
      }
      return { id: figure.getAttribute("data-figure"), groups, lines };
    }),
  );
}

/// Heights on the screen are a linear function of the values: what is drawn is the number that stands beside it. To half a pixel.
export function assertHeights(points, what) {
  const sorted = [...points].sort((a, b) => a.value - b.value);
  const [low, high] = [sorted[0], sorted.at(-1)];
  if (sorted.length < 2 || high.value === low.value) return;
  assert.ok(high.y <= low.y, `${what}: the larger value is the higher`);
  for (const { value, y } of points) {
    const expected = low.y + ((value - low.value) / (high.value - low.value)) * (high.y - low.y);
    assert.ok(Math.abs(y - expected) < 0.75, `${what}: ${value} is drawn at ${y} px instead of ${expected} px`);
  }
}

export const same = (shown, known, what) =>
  assert.deepEqual(shown.map(Number), known.filter((value) => value !== null), what);

/// Serious and critical findings of axe-core on what is shown now. The script comes by the debugger, which no policy binds.
export async function assertAccessible(tab, axe, what) {
  if (!(await tab.evaluate(() => window.axe !== undefined))) await tab.evaluate(axe);
  const findings = await tab.evaluate(async () => {
    const { violations } = await window.axe.run(document, { resultTypes: ["violations"] });
    return violations.filter(({ impact }) => impact === "serious" || impact === "critical")
      .map(({ id, help, nodes }) => `${id}: ${help}: ${nodes.slice(0, 3).map(({ html }) => html).join(" | ")}`);
  });
  assert.deepEqual(findings, [], `axe-core on ${what}`);
}

export async function assertFits(tab, what) {
  const [width, window] = await tab.evaluate(() => [document.documentElement.scrollWidth, innerWidth]);
  assert.ok(width <= window, `${what} is ${width} px wide in a window of ${window}`);
}

export async function picture(tab, folder, name) {
  mkdirSync(folder, { recursive: true });
  await tab.screenshot({ path: join(folder, `${name}.png`), fullPage: true });
}
