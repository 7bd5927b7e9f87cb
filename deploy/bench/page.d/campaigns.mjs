// A campaign that is made in seconds: a table of runs, a closed form in the place of the DEM.

import { writeFileSync } from "node:fs";
import { join } from "node:path";

const kStates = 100;
const shared = (i) => (i / (kStates - 1)) * 0.08; // axial strain

// Additive recurrence of the plastic number: points that fill the unit square evenly [Roberts 2018].
const kPlastic = 1.32471795724474602596;
const share = (i, k) => (0.5 + i / kPlastic ** (k + 1)) % 1;

const stressRatio = (modulus, friction, strain) => 2.4 * friction * (1 - Math.exp((-strain * modulus) / 8e6)) + 1e-3;
const volumetric = (friction, strain) => 0.1 * strain * Math.exp(-60 * strain) - 0.3 * friction * Math.max(strain - 0.01, 0);

/// Writes large.yaml and its tables into the folder.
export function writeLarge(folder, samples) {
  const rows = ["sample,E,mu"];
  const states = ["sample,step,axial_strain,q,v"];
  for (let n = 0; n < samples; ++n) {
    const [modulus, friction] = [2e8 + 8e8 * share(n, 0), 0.2 + 0.6 * share(n, 1)];
    rows.push(`${n},${modulus},${friction}`);
    for (let i = 0; i < kStates; ++i) {
      states.push(`${n},${i},${shared(i)},${stressRatio(modulus, friction, shared(i))},${volumetric(friction, shared(i))}`);
    }
  }
  const data = ["axial_strain,q_over_p,volumetric_strain"];
  for (let i = 0; i < kStates; ++i) data.push(`${shared(i)},${stressRatio(6e8, 0.5, shared(i)) + 0.02 * Math.sin(9 * i)},${volumetric(0.5, shared(i)) + 3e-4 * Math.cos(7 * i)}`);
  writeFileSync(join(folder, "rows.csv"), rows.join("\n") + "\n");
  writeFileSync(join(folder, "states.csv"), states.join("\n") + "\n");
  writeFileSync(join(folder, "tx.csv"), data.join("\n") + "\n");
  writeFileSync(join(folder, "large.yaml"), `name: ${samples} runs of ${kStates} states
model:
  precomputed:
    parameters: rows.csv
    states: states.csv
    parameter_columns: {young_modulus: E, friction_coefficient: mu}
    state_columns: {q_over_p: q, volumetric_strain: v}
parameters:
  young_modulus: {prior: uniform, min: 0.2 GPa, max: 1 GPa}
  friction_coefficient: {prior: uniform, min: 0.2, max: 0.8}
experiments:
  - name: tx
    test: triaxial_drained
    confining_pressure: 100 kPa
    data: {file: tx.csv, strain: logarithmic}
    control: axial_strain
    observables:
      q_over_p: {noise: {absolute: 0.03}}
      volumetric_strain: {noise: {absolute: 0.0005}}
inference: {method: sqmc, samples: ${samples}}
seed: 1
`);
}
