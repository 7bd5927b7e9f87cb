"""Measures by YADE with and without a hidden effect, calibrates YADE without it, asks which effect is missing; see README.md."""

import argparse
import json
import os
import pathlib
import random
import shutil
import subprocess

HERE = pathlib.Path(__file__).parent
PRESSURES = {"tx02": 2e5, "tx05": 5e5}  # [Pa]; the second is held out
TRUTH = {"young_modulus": 1.2e8, "friction_angle": 0.45}  # [Pa], [rad]
CASES = {"rolling": {"rolling.friction": 0.15}, "none": {}}  # what is hidden
RELATIVE, ABSOLUTE = 0.01, 3e-4  # errors of stress ratio and volumetric strain, as campaign.yaml states them


def measure(folder, hidden):
    """Both tests by model.py on the packing as it is, which is none of the model's orientations, with errors of a fixed seed."""
    draw = random.Random(5)
    packing = pathlib.Path(os.environ["CALIB_DATA"], "toyoura_triaxial", "packing_1000.txt")
    shutil.copy(packing, folder)
    for name, pressure in PRESSURES.items():
        if (folder / f"{name}.csv").exists():
            continue
        request = json.loads((HERE / "request.json").read_text())
        request["settings"]["confining_pressure"] = pressure
        request["parameters"] = {**TRUTH, **hidden}
        request["effects"] = sorted({parameter.split(".")[0] for parameter in hidden})
        answer = subprocess.run(["yade", "-n", "-x", "-j1", HERE / "model.py"], input=json.dumps(request), text=True, check=True,
                                stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, cwd=folder).stdout
        rows = ["axial_strain,stress_ratio,volumetric_strain"]
        for line in answer.splitlines():
            if line.startswith("{"):
                state = json.loads(line)
                rows.append(f"{state['axial_strain']},{state['stress_ratio'] * (1 + draw.gauss(0, RELATIVE))},"
                            f"{state['volumetric_strain'] + draw.gauss(0, ABSOLUTE)}")
        (folder / f"{name}.csv").write_text("\n".join(rows) + "\n")


def ask(folder, options, *verb):
    """The JSON that a verb of calibctl answers; the same call again goes on where it was interrupted."""
    call = [options.calibctl, *verb, "--state", str(folder / "state"), "--workers", str(options.workers), "--json"]
    return json.loads(subprocess.run(call, cwd=folder, check=True, text=True, stdout=subprocess.PIPE).stdout)


def named(effects):
    return " + ".join(effects) if effects else "none"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--calibctl", required=True)
    parser.add_argument("--state", default="build/bench-yade-hidden", type=pathlib.Path)
    parser.add_argument("--workers", default=os.cpu_count(), type=int)
    options = parser.parse_args()
    options.calibctl = str(pathlib.Path(options.calibctl).resolve())
    print("| hidden | error fitted, held out [sd] | verdict | models, 1 % and more | runs: base, diagnosis |\n|---|---|---|---|---|")
    for case, hidden in CASES.items():
        folder = (options.state / case).resolve()
        folder.mkdir(parents=True, exist_ok=True)
        for file in ("campaign.yaml", "model.py"):
            shutil.copy(HERE / file, folder)
        measure(folder, hidden)
        posterior = ask(folder, options, "run", "campaign.yaml")
        error = ask(folder, options, "compare", "c1")
        found = ask(folder, options, "diagnose", "c1")
        models = ", ".join(f"{named(one['effects'])} {100 * one['probability']:.0f} %" for one in found["probabilities"]
                           if one["probability"] >= 0.01)
        if found["none_of_these"] >= 0.01:
            models += f", none of these {100 * found['none_of_these']:.0f} %"
        effect = f": {named(found.get('effects') or [])}" if found["verdict"] == "missing_effect" else ""
        print(f"| {case} | {error['rms_error']:.2f}, {error['heldout_rms_error']:.2f} | {found['verdict']}{effect} | {models} | "
              f"{posterior['model_evaluations']}, {found['model_evaluations']} |", flush=True)


if __name__ == "__main__":
    main()
