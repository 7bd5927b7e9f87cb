// run.mjs CHROMIUM BIN MODULES: what the live page costs whoever looks and the server; prints Markdown. States come from
// workers without mechanics (tests/load), so that 100 a second arrive whatever the machine does.

import { execFile, spawn } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { createServer } from "node:net";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { argv } from "node:process";
import { promisify } from "node:util";
import { launch, tools, until } from "../../../tests/page/looks.mjs";
import { writeLarge } from "./campaigns.mjs";

const [chromium, bin, modules] = argv.slice(2);
const kSamples = 2000; // of 100 states each
const kViews = 10;
const kWatchS = 30;
const kStatesPerSecond = 100;
const kStreams = 10;
const kRounds = 3;
const kLongTaskMs = 50; // from where a browser reports a task

const folder = mkdtempSync(join(tmpdir(), "calib-page-bench-"));
const children = [];
const pause = (ms) => new Promise((resolve) => setTimeout(resolve, ms));
const calibctl = async (...words) => (await promisify(execFile)(join(bin, "calibctl"), words, { cwd: folder, maxBuffer: 1 << 28 })).stdout;
const median = (values) => [...values].sort((a, b) => a - b)[Math.floor(values.length / 2)];

function start(program, words) {
  const child = spawn(join(bin, program), words, { cwd: folder, stdio: ["ignore", "ignore", "pipe"] });
  child.said = "";
  child.stderr.on("data", (data) => (child.said += data));
  children.push(child);
  return child;
}

const freePort = () =>
  new Promise((resolve) => {
    const probe = createServer().listen(0, "127.0.0.1", () => {
      const { port } = probe.address();
      probe.close(() => resolve(port));
    });
  });

/// Processor time of a process so far [s]: fields 14 and 15 of its stat, in ticks of 10 ms (proc(5)).
function processorSeconds(pid) {
  const fields = readFileSync(`/proc/${pid}/stat`, "utf8").replace(/^.*\) /, "").split(" ");
  return (Number(fields[11]) + Number(fields[12])) / 100;
}

/// States at a given rate from a worker without mechanics (tests/load); resolves to what it has seen.
const load = (asked, token, words) =>
  promisify(execFile)(join(bin, "load"), ["--server", asked, "--token", token, "--workers", "2", "--slots", "8", ...words], { cwd: folder })
    .then(({ stdout }) => JSON.parse(stdout));

/// Opens event streams and reads them until the returned function is called.
async function eventStreams(http, token, count) {
  const controller = new AbortController();
  let bytes = 0;
  for (let i = 0; i < count; ++i) {
    const reply = await fetch(`http://127.0.0.1:${http}/api/v1/events`, { headers: { Authorization: `Bearer ${token}` }, signal: controller.signal });
    void (async () => {
      for await (const chunk of reply.body) bytes += chunk.length;
    })().catch(() => {});
  }
  return () => {
    controller.abort();
    return bytes;
  };
}

async function firstView(browser, address, fragment) {
  const context = await browser.createBrowserContext();
  const tab = await context.newPage();
  await tab.setViewport({ width: 1280, height: 900 });
  await tab.evaluateOnNewDocument(() => {
    window.drawnAt = 0;
    new MutationObserver(() => {
      const inSight = [...document.querySelectorAll("figure")].filter((figure) => figure.getBoundingClientRect().top < innerHeight);
      if (window.drawnAt === 0 && inSight.length > 0 && inSight.every((figure) => figure.querySelector("svg.plot"))) {
        requestAnimationFrame(() => setTimeout(() => (window.drawnAt = performance.now()))); // after it is painted
      }
    }).observe(document, { childList: true, subtree: true });
  });
  await tab.goto(`${address}${fragment}`);
  const ms = await until("the first view is drawn", () => tab.evaluate(() => window.drawnAt));
  await context.close();
  return ms;
}

async function watched(browser, address, fragment) {
  const tab = await browser.newPage();
  await tab.evaluateOnNewDocument(() => {
    window.tasks = [];
    new PerformanceObserver((list) => window.tasks.push(...list.getEntries().map(({ duration }) => duration))).observe({ type: "longtask" });
  });
  await tab.goto(`${address}${fragment}`);
  await pause(3000); // its first drawing is the other figure's matter
  await tab.evaluate(() => (window.tasks.length = 0));
  await pause(1000 * kWatchS);
  const tasks = await tab.evaluate(() => window.tasks);
  await tab.close();
  return tasks;
}

async function main() {
  writeLarge(folder, kSamples);
  const [port, http] = [await freePort(), await freePort()];
  const state = join(folder, "state");
  const server = start("calibd", ["--state", state, "--listen", `127.0.0.1:${port}`, "--http", `127.0.0.1:${http}`]);
  await until("calibd is up", () => server.said.includes("page: "));
  const asked = ["--server", `127.0.0.1:${port}`];
  const token = readFileSync(join(state, "token"), "utf8").trim();
  const address = `http://127.0.0.1:${http}/?token=${token}`;
  const { puppeteer } = tools(modules);
  const browser = await launch(puppeteer, chromium);

  await calibctl(...asked, "submit", "large.yaml");
  await calibctl(...asked, "watch", "c1").catch(() => {});
  console.log(`| view of ${kSamples} samples of 100 states | median of ${kViews} [ms] | all [ms] |\n|---|---|---|`);
  for (const [name, fragment] of [["does it fit", "#/c1/fit"], ["where it fails", "#/c1/misfit"], ["parameters", "#/c1/parameters"]]) {
    const times = [];
    for (let i = 0; i < kViews; ++i) times.push(Math.round(await firstView(browser, address, fragment)));
    console.log(`| ${name} | ${median(times)} | ${times.join(" ")} |`);
  }

  // Acknowledgements, alternately without and with event streams.
  const tokenFile = join(state, "token");
  console.log(`\n| ${kStatesPerSecond} states/s | p50 of acknowledgements [ms] | p99 [ms] |\n|---|---|---|`);
  for (let round = 0; round < kRounds; ++round) {
    for (const streams of [0, kStreams]) {
      const end = await eventStreams(http, token, streams);
      const seen = await load(asked[1], tokenFile, ["--rate", `${kStatesPerSecond}`, "--warm-up", "3", "--seconds", "15", "--samples", `${200 + 2 * round + (streams > 0)}`]);
      end();
      await calibctl(...asked, "cancel", seen.campaign);
      console.log(`| ${streams} event streams | ${seen.p50_ms.toFixed(1)} | ${seen.p99_ms.toFixed(1)} |`);
    }
  }

  const source = load(asked[1], tokenFile, ["--rate", `${kStatesPerSecond}`, "--warm-up", "0", "--seconds", `${4 * (kWatchS + 8)}`, "--samples", "1500"]);
  await pause(5000);
  const watchedId = JSON.parse(await calibctl(...asked, "--json", "list")).at(-1).campaign;
  const spent = async (what) => {
    const before = processorSeconds(server.pid);
    const tasks = await what();
    const { states_per_second: rate } = JSON.parse(await calibctl(...asked, "--json", "show", watchedId));
    return { rate, seconds: processorSeconds(server.pid) - before, tasks };
  };
  const rows = [];
  rows.push(["nobody looks", await spent(async () => (await pause(1000 * (kWatchS + 3)), []))]);
  rows.push(["how far", await spent(() => watched(browser, address, `#/${watchedId}/progress`))]);
  rows.push(["does it fit", await spent(() => watched(browser, address, `#/${watchedId}/fit`))]);
  rows.push(["campaigns", await spent(() => watched(browser, address, "#/"))]);
  console.log(`\n| ${kWatchS} s at about ${kStatesPerSecond} states/s, looked at | states/s | script tasks over ${kLongTaskMs} ms | longest [ms] | calibd [s of a core] |\n|---|---|---|---|---|`);
  for (const [name, { rate, seconds, tasks }] of rows) {
    console.log(`| ${name} | ${rate?.toFixed(0) ?? "–"} | ${tasks.length} | ${tasks.length === 0 ? "–" : Math.round(Math.max(...tasks))} | ${seconds.toFixed(2)} |`);
  }
  await source;
  await browser.close();
}

try {
  await main();
} finally {
  for (const child of children) {
    child.kill("SIGCONT");
    child.kill("SIGKILL");
  }
  rmSync(folder, { recursive: true, force: true });
}
