import assert from "node:assert/strict";
import test from "node:test";
import type { Status } from "../src/documents.ts";
import { csvText } from "../src/figures/figure.ts";
import { modelName } from "../src/figures/diagnosis.ts";
import { travelled } from "../src/figures/residuals.ts";
import { viridis } from "../src/grains/colorings.ts";
import { linkTo, readRoute } from "../src/route.ts";
import { familyRows } from "../src/views/family.ts";
import { spaced } from "../src/views/spaced.ts";

test("a link leads back to where it says, whatever the campaign is called", () => {
  for (const campaign of ["c1", "a b/c", "<script>", "ä%2F"]) {
    const route = readRoute(linkTo(campaign, "fit", { x: "axial strain&1" }));
    assert.equal(route.campaign, campaign);
    assert.equal(route.view, "fit");
    assert.equal(route.options.get("x"), "axial strain&1");
  }
});

test("fragments that nobody made lead somewhere", () => {
  assert.equal(readRoute("").view, "campaigns");
  assert.equal(readRoute("#/c1/nowhere").view, "progress");
  assert.equal(readRoute("#/%E0%A4%A/fit").campaign, "%E0%A4%A");
});

test("CSV quotes what needs it and leaves unknown values empty", () => {
  const text = csvText({
    columns: [{ name: "stage" }, { name: "stress", unit: "Pa" }, { name: "strain", unit: "1" }],
    rows: [['a "b", c', 1.5e5, null]],
  });
  assert.equal(text, 'stage,stress [Pa],strain\r\n"a ""b"", c",150000,\r\n');
});

test("a path is unfolded at its turning points", () => {
  assert.deepEqual(travelled([0, 1, 3, 2, 4]), [0, 1, 3, 4, 6]);
  assert.deepEqual(travelled([]), []);
});

test("models are named by their effects", () => {
  assert.equal(modelName([]), "the model as it is");
  assert.equal(modelName(["rolling_resistance", "strain_offset"]), "rolling resistance + strain offset");
  assert.equal(modelName(["none_of_these"]), "none of these");
});

test("viridis ends where it ends", () => {
  assert.deepEqual(viridis(0), [0.267, 0.005, 0.329]);
  assert.deepEqual(viridis(7), [0.993, 0.906, 0.144]);
  assert.deepEqual(viridis(NaN), viridis(0));
});

const status = (campaign: string, parent: string | null, purpose: string | null = null): Status =>
  ({ campaign, parent, purpose, name: campaign, effects: [] }) as unknown as Status;

test("campaigns stand below the one they come from; many are folded, calibrated ones never", () => {
  const list = [
    status("c1", null), status("c9", "c1", "extension"),
    ...[2, 3, 4, 5, 6, 7, 8].map((i) => status(`c${i}`, "c1", "screen")),
    status("c20", "gone"), status("c21", "c21"),
  ];
  const names = (unfolded: string[]): string[] => familyRows(list, new Set(unfolded)).map(({ status: s, depth }) => `${depth}${s.campaign}`);
  assert.deepEqual(names([]), ["0c1", "1c9", "0c20", "0c21"]);
  assert.equal(names(["c1"]).length, 11);
});

test("of many iterations the first and the last are among those shown", () => {
  const all = Array.from({ length: 111 }, (_, i) => i);
  assert.equal(spaced(all).length, 20);
  assert.equal(spaced(all)[0], 0);
  assert.equal(spaced(all).at(-1), 110);
  assert.deepEqual(spaced([3, 4]), [3, 4]);
});
