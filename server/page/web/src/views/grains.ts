// The grains of a run at a load step. What draws them is loaded only here.

import { h, replace, value } from "../dom.ts";
import type { Comparison, Grains, Samples } from "../documents.ts";
import { nameForPeople, quantityText } from "../units.ts";
import { kColorings, type Coloring } from "../grains/colorings.ts";
import type { Scene } from "../grains/scene.ts";
import { absent, copyable, empty, valueOf, watchAll, type View } from "./view.ts";

type SceneModule = typeof import("../grains/scene.ts");
const loadScene = (): Promise<SceneModule> => import("./grains.js" as string) as Promise<SceneModule>;

const kColoringUnits: Record<Coloring, string> = { speed: "m/s", coordination: "1", force: "N" };

export const grainsView: View = (root, context) => {
  const { campaign, options } = context;
  const holder = h("div", {});
  const choosers = h("div", { class: "choosers" });
  let scene: Scene | null = null;
  let ended = false;
  let stopGrains = (): void => {};
  replace(root, h("h2", {}, "The grains"), choosers, holder);
  replace(holder, absent(undefined, null));

  const coloring = kColorings.find((name) => name === options.get("color")) ?? "force";
  const query = (sample: string): string => {
    const asked = new URLSearchParams();
    for (const name of ["experiment", "load_step"]) {
      const chosen = options.get(name);
      if (chosen !== null) asked.set(name, chosen);
    }
    const text = asked.toString();
    return `campaigns/${campaign}/grains/${encodeURIComponent(sample)}${text === "" ? "" : `?${text}`}`;
  };

  const showGrains = async (grains: Grains): Promise<void> => {
    const canvas = h("canvas", { tabindex: 0, role: "img", "aria-label": `${grains.grains.x.length} grains of sample ${grains.sample}, ${grains.experiment}, load step ${grains.load_step}. Drag or use the arrow keys to turn, + and - to come nearer.` });
    const range = h("p", { class: "sub" });
    replace(holder, h("div", { class: "stage" }, canvas), range, h("dl", { class: "readings" },
      h("div", { class: "reading" }, h("dt", {}, "grains"), h("dd", {}, value(grains.grains.x.length, String(grains.grains.x.length)))),
      h("div", { class: "reading" }, h("dt", {}, "contacts"), h("dd", {}, value(grains.contacts.i.length, String(grains.contacts.i.length)))),
      h("div", { class: "reading" }, h("dt", {}, "load step"), h("dd", {}, value(grains.load_step, String(grains.load_step))))));
    const { makeScene } = await loadScene();
    if (ended) return;
    scene?.dispose();
    try {
      scene = makeScene(canvas, grains, coloring);
      const [low, high] = scene.range;
      const name = coloring === "force" ? "normal force" : coloring;
      replace(range, `${nameForPeople(name)}: dark ${quantityText(low, name, kColoringUnits[coloring], 3)} to bright ${quantityText(high, name, kColoringUnits[coloring], 3)}`);
    } catch {
      replace(holder, empty("This browser draws no 3D", "WebGL is off or missing. ParaView shows the same grains:", copyable(`calibctl vtk ${campaign} ${grains.sample} -o grains`, "the command")));
    }
  };

  const select = (name: string, label: string, chosen: string, choices: readonly (readonly [string, string])[]): HTMLElement =>
    h("label", {}, `${label} `, h("select", { name, onchange: (event) => context.choose(name, (event.target as HTMLSelectElement).value) },
      choices.map(([key, text]) => h("option", { value: key, selected: key === chosen }, text))));

  const stopChoice = watchAll(context, [`campaigns/${campaign}/compare`, `campaigns/${campaign}/samples`], ([compared, sampled]) => {
    const experiments = valueOf<Comparison>(compared)?.experiments ?? [];
    const best = experiments[0]?.runs.filter(({ rank }) => rank !== null).map(({ sample }) => sample) ?? [];
    const finished = (valueOf<Samples>(sampled)?.samples ?? []).filter(({ status }) => status === "finished").map(({ index }) => index);
    const candidates = best.length > 0 ? best : finished.slice(-20);
    const sample = options.get("sample") ?? (candidates[0] === undefined ? null : String(candidates[0]));
    if (sample === null) {
      replace(holder, empty("No grains yet", "A packing is drawn here when a run has finished."));
      return;
    }
    const samples = [...new Set([sample, ...candidates.map(String)])];
    stopGrains();
    stopGrains = context.answers.watch<Grains>(query(sample), (answer) => {
      const steps = answer.state === "here" ? answer.value.load_steps.map(String) : [];
      replace(choosers,
        select("sample", "Run", sample, samples.map((one, i) => [one, best.includes(Number(one)) ? `${one} (best ${i + 1})` : one])),
        experiments.length > 1 ? select("experiment", "Experiment", options.get("experiment") ?? (answer.state === "here" ? answer.value.experiment : ""), experiments.map((one) => [one.experiment, one.experiment])) : null,
        steps.length > 1 ? select("load_step", "Load step", String(answer.state === "here" ? answer.value.load_step : ""), steps.map((step) => [step, step])) : null,
        select("color", "Colour", coloring, kColorings.map((name) => [name, name === "force" ? "contact forces" : name])));
      if (answer.state === "here") {
        void showGrains(answer.value);
      } else if (answer.state === "none") {
        replace(holder, empty("No packing of this run was kept", "It is run again, with the same bits, drawn here and written for ParaView by:",
          copyable(`calibctl vtk ${campaign} ${sample} --keep -o grains`, "the command"), answer.sentence));
      } else if (answer.state === "failed") {
        replace(holder, empty("The server could not answer", answer.sentence));
      }
    });
  });
  return () => {
    ended = true;
    stopChoice();
    stopGrains();
    scene?.dispose();
  };
};

