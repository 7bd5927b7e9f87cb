// in_browser.mjs CHROMIUM BIN MODULES PICTURES: a campaign is submitted by calibctl, watched by the page to its end and improved;
// every view is held against the API; the server is restarted under the page. Spheres that hit a wall: milliseconds a run.

import assert from "node:assert/strict";
import { execFile, spawn } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { createServer } from "node:net";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { argv } from "node:process";
import { promisify } from "node:util";
import { assertAccessible, assertFits, get, goTo, launch, openTab, picture, tools, until } from "./looks.mjs";
import { assertList, assertTakenAlong, assertView, assertWorkers, kViews } from "./views.mjs";

const [chromium, bin, modules, pictures] = argv.slice(2);
const folder = mkdtempSync(join(tmpdir(), "calib-page-"));
const state = join(folder, "state");
const kHostile = `<img src=x onerror="document.title='broken in'"> & "sand"`;

// Three effects are thought of: ten times faster than all.
const kRace = ["viscous_damping", "hertz_nonlinearity", "contact_plasticity"];

// A dashpot that the model does not know, measured to 3 %; a faster impact held out.
const campaign = (name, effects, fixed) => `name: ${JSON.stringify(name)}
model: {contact: hertz_mindlin, effects: [${effects}], density: 2500 kg/m^3, fixed: {poisson_ratio: 0.25${fixed}}}
parameters:
  young_modulus: {prior: log_uniform, min: 0.02 GPa, max: 1 GPa}
  friction_coefficient: {prior: uniform, min: 0.05, max: 1}
experiments:
${["wall", "fast"].map((one) => `  - name: ${one}
    test: collision
    radius: 5 mm
    impact_speed: ${one === "wall" ? 1 : 2} m/s
    data: {file: ${one}.csv}
    control: impact_angle
    role: ${one === "wall" ? "calibrate" : "validate"}
    observables:
      normal_restitution: {noise: {absolute: 0.03}}
      tangential_restitution: {noise: {absolute: 0.03}}
      contact_duration: {noise: {relative: 0.03}}
`).join("")}inference: {method: iterative_bayesian_filter, max_iterations: 3, samples: 24}
seed: 5
`;

const calibctl = async (...words) =>
  (await promisify(execFile)(join(bin, "calibctl"), words, { cwd: folder, maxBuffer: 1 << 26 })).stdout;

async function measure() {
  const angles = [0.05, 0.2, 0.4, 0.6, 0.8, 1, 1.2];
  const header = "impact_angle,normal_restitution,tangential_restitution,contact_duration";
  for (const one of ["wall", "fast"]) writeFileSync(join(folder, `${one}.csv`), [header, ...angles.map((angle) => `${angle},1,1,1`)].join("\n") + "\n");
  writeFileSync(join(folder, "truth.yaml"), campaign("truth", "viscous_damping", ", viscous_damping.ratio: 0.05"));
  writeFileSync(join(folder, "model.yaml"), campaign(kHostile, "", ""));
  await calibctl("simulate", "truth.yaml", "--set", "young_modulus=0.2 GPa", "--set", "friction_coefficient=0.3", "-o", "all.csv");
  const [head, ...rows] = readFileSync(join(folder, "all.csv"), "utf8").trim().split("\n");
  for (const one of ["wall", "fast"]) {
    writeFileSync(join(folder, `${one}.csv`), [head, ...rows.filter((row) => row.startsWith(`${one},`))].join("\n") + "\n");
  }
}

const freePort = () =>
  new Promise((resolve) => {
    const probe = createServer().listen(0, "127.0.0.1", () => {
      const { port } = probe.address();
      probe.close(() => resolve(port));
    });
  });

const children = new Set();
function start(program, words) {
  const child = spawn(join(bin, program), words, { cwd: folder, stdio: ["ignore", "ignore", "pipe"] });
  child.said = "";
  child.stderr.on("data", (data) => (child.said += data));
  child.ended = new Promise((resolve) => child.on("exit", resolve));
  children.add(child);
  return child;
}
async function stop(child) {
  child.kill("SIGTERM");
  await child.ended;
  children.delete(child);
}

const begun = Date.now();
const say = (what) => console.log(`${((Date.now() - begun) / 1000).toFixed(1)} s  ${what}`);

async function main() {
  const { puppeteer, axe } = tools(modules);
  await measure();
  const [port, http] = [await freePort(), await freePort()];
  const origin = `http://127.0.0.1:${http}`;
  const serve = async () => {
    const server = start("calibd", ["--state", state, "--listen", `127.0.0.1:${port}`, "--http", `127.0.0.1:${http}`]);
    await until("calibd says where its page is", () => server.said.includes("page: ") || server.exitCode !== null);
    assert.equal(server.exitCode, null, server.said);
    return server;
  };
  let server = await serve();
  const asked = ["--server", `127.0.0.1:${port}`];
  const token = readFileSync(join(state, "token"), "utf8").trim();
  const browser = await launch(puppeteer, chromium);

  // No token, no page; with it once, and never seen again.
  const opened = await openTab(browser, origin);
  const { tab } = opened;
  assert.equal((await fetch(`${origin}/`)).status, 401);
  await tab.goto(`${origin}/?token=${token}`);
  assert.ok(!tab.url().includes(token), "the token has left the address");
  await until("the empty list says what will appear", () => tab.evaluate(() => /calibctl submit/.test(document.querySelector(".empty")?.textContent ?? "")));
  await until("the page is live", () => tab.evaluate(() => document.querySelector(".connection.open") !== null));

  // Submitted, run and watched to the end, without a reload.
  await calibctl(...asked, "submit", "model.yaml");
  await until("the campaign appears by itself", () => tab.evaluate(() => document.querySelector('[data-campaign="c1"]') !== null));
  await goTo(tab, "#/c1/progress");
  const worker = start("calib-worker", ["--server", `127.0.0.1:${port}`, "--slots", "2"]);
  const seen = new Set();
  await until("the campaign is seen to finish", async () => {
    seen.add(await tab.evaluate(() => document.querySelector(".heading .state")?.dataset.value));
    return seen.has("finished");
  }, 90);
  assert.ok(seen.size > 1, `more than its end was seen: ${[...seen]}`);

  say("watched to the end");

  // Improved in the meantime: the conclusions appear in a view that is open.
  await goTo(tab, "#/c1/missing");
  const others = JSON.parse(await calibctl("effects", "--json")).map(({ name }) => name).filter((name) => !kRace.includes(name));
  const improving = calibctl(...asked, "improve", "c1", "--json", ...others.flatMap((name) => ["--without", name]));
  for (const name of ["progress", "fit", "misfit", "parameters"]) await assertView(tab, "c1", name);
  await goTo(tab, "#/c1/missing");
  await improving;
  await until("the diagnosis appears by itself", () => tab.evaluate(() => document.querySelector(".verdict") !== null));

  say("diagnosed and improved");

  // Every view, in both lights, on a desk and on a telephone.
  for (const [scheme, width] of [["light", 1280], ["dark", 1280], ["light", 360], ["dark", 2560]]) {
    const other = await openTab(browser, origin, { scheme, width });
    await other.tab.goto(`${origin}/`);
    const look = async (name) => {
      await assertFits(other.tab, `${name} at ${width} px`);
      await picture(other.tab, pictures, `${name}-${scheme}-${width}`);
      await assertAccessible(other.tab, axe, `${name}, ${scheme}`);
    };
    await assertList(other.tab);
    await look("campaigns");
    for (const name of Object.keys(kViews)) {
      await assertView(other.tab, "c1", name);
      await look(name);
    }
    await assertWorkers(other.tab);
    await look("workers");
    assert.deepEqual(other.wrong, []);
    assert.deepEqual(await other.violations(), []);
    await other.tab.close();
    say(`looked at, ${scheme}, ${width} px`);
  }

  await assertTakenAlong(tab, "c1");

  // Names are text.
  await goTo(tab, "#/c1/progress");
  assert.equal(await tab.evaluate(() => document.querySelector("h1").textContent), kHostile);
  assert.equal(await tab.evaluate(() => document.querySelectorAll("main img").length), 0);
  assert.ok(!(await tab.title()).startsWith("broken in"));

  // The server goes and comes back under the page.
  opened.expectLoss(true);
  await stop(server);
  await until("the page says that nobody answers", () => tab.evaluate(() => /does not answer; tried again in \d+ s/.test(document.querySelector(".connection").textContent)));
  assert.equal(await tab.evaluate(() => document.querySelector("h1").textContent), kHostile, "what was known stays in sight");
  await picture(tab, pictures, "server-away");
  server = await serve();
  await until("the page is live again", () => tab.evaluate(() => document.querySelector(".connection.open") !== null));
  opened.expectLoss(false);
  assert.equal((await get(tab, "campaigns/c1")).state, "finished");
  await assertView(tab, "c1", "fit");

  assert.deepEqual(opened.wrong, []);
  assert.deepEqual(await opened.violations(), []);
  await browser.close();
  await stop(worker);
  await stop(server);
}

try {
  await main();
  say(`all as it should be; pictures in ${pictures}`);
} finally {
  for (const child of children) child.kill("SIGKILL");
  rmSync(folder, { recursive: true, force: true });
}

