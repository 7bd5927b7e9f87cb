// pictures.mjs CHROMIUM MODULES REPORT FIGURE OUT.png: a figure of a report before and after, side by side; see deploy/pictures.

import { argv } from "node:process";
import { launch, tools, until } from "../tests/page/looks.mjs";

const [chromium, modules, report, figure, out] = argv.slice(2);
const kWidth = 1000; // px, at two pixels each

const browser = await launch(tools(modules).puppeteer, chromium);
const tab = await browser.newPage();
await tab.setViewport({ width: kWidth, height: 600, deviceScaleFactor: 2 });
await tab.emulateMediaFeatures([{ name: "prefers-color-scheme", value: "light" }]);
await tab.goto(`file://${report}`);
const asked = `[data-figure="${figure}"]`;
await until("both figures are there", () => tab.evaluate((of) => document.querySelectorAll(`${of} svg.plot`).length === 2, asked), 60);
await tab.evaluate((of) => {
  const row = document.createElement("div");
  row.id = "picture";
  row.style.cssText = "display: grid; grid-template-columns: 1fr 1fr; gap: 24px; padding: 12px; background: var(--paper)";
  ["Before", "After"].forEach((word, i) => {
    const one = document.querySelectorAll(of)[0]; // the first moves away
    one.querySelector(".tools").remove();
    one.querySelector("figcaption").remove();
    one.querySelector("h3").textContent = `${word}: the held-out test`;
    row.appendChild(one);
  });
  document.querySelector("main").replaceChildren(row);
}, asked);
await new Promise((resolve) => setTimeout(resolve, 1000)); // drawn anew at their new width
await (await tab.$("#picture")).screenshot({ path: out });
await browser.close();
console.log(out);
