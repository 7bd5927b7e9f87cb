// node build.mjs [--out DIR]: bundles src into DIR (dist). --tests: the unit tests into dist-test instead.
import * as esbuild from "esbuild";
import { cpSync, mkdirSync, readdirSync, rmSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { argv } from "node:process";

const here = dirname(fileURLToPath(import.meta.url));
const tests = argv.includes("--tests");
const out = argv.includes("--out") ? argv[argv.indexOf("--out") + 1] : join(here, tests ? "dist-test" : "dist");
const shared = { absWorkingDir: here, bundle: true, format: "esm", target: ["es2021"], outdir: out, logLevel: "warning" };

rmSync(out, { recursive: true, force: true });
mkdirSync(out, { recursive: true });
if (tests) {
  const entries = readdirSync(join(here, "test")).filter((name) => name.endsWith(".test.ts"));
  await esbuild.build({ ...shared, entryPoints: entries.map((name) => join("test", name)), platform: "node" });
} else {
  // The grains come with three.js, which only who looks at them loads.
  await esbuild.build({
    ...shared,
    entryPoints: { page: "src/main.ts", grains: "src/grains/scene.ts" },
    external: ["./grains.js"],
    minify: true,
    legalComments: "eof",
    define: { "process.env.NODE_ENV": '"production"' },
  });
  await esbuild.build({ ...shared, entryPoints: { page: "src/page.css" }, minify: true });
  cpSync(join(here, "src/index.html"), join(out, "index.html"));
  cpSync(join(here, "src/icon.svg"), join(out, "icon.svg"));
}
