#!/usr/bin/env python3
"""Hidden effects in collisions: is what bends the rebound of a sphere from a wall named?

A sphere of 5 mm (Hertz-Mindlin) hits a wall: over the angle at 1 m/s and over the speed at 30 degrees, both fitted; over the angle at
2 m/s, held out. Restitutions are measured to 0.01, contact duration and overlap to 1 %. Modulus and friction are drawn for each
seed; there is no packing, hence no scatter, and a run takes milliseconds. Each effect at one strength; prints Markdown.
"""
import argparse
import csv
import json
import math
import os
import random
import subprocess
import sys
import tempfile

# Effect: its parameters. Friction of the one wall is what friction_coefficient is, too: wall_friction changes nothing here.
HIDDEN = {
    None: {},
    "contact_plasticity": {"stiffness_ratio": 1.5},
    "viscous_damping": {"ratio": 0.1},
    "hertz_nonlinearity": {"exponent": 1.3},
    "rolling_resistance": {"stiffness_ratio": 0.3, "friction": 0.1},
    "adhesion_dmt": {"work_of_adhesion": 3.0},
    "linear_cohesion": {"energy_density": 1e6},
}
NOISE = {"normal_restitution": (0, 0.01), "tangential_restitution": (0, 0.01), "contact_duration": (0.01, 0), "peak_overlap": (0.01, 0)}
DEGREES = math.pi / 180
TESTS = {  # control, its values, the other setting, role
    "angle": ("impact_angle", [10 * k * DEGREES for k in range(8)], "impact_speed: 1 m/s", "calibrate"),
    "speed": ("impact_speed", [0.1 * 2 ** (k / 2) for k in range(9)], "impact_angle: 30 deg", "calibrate"),
    "held": ("impact_angle", [(5 + 10 * k) * DEGREES for k in range(7)], "impact_speed: 2 m/s", "validate"),
}


def campaign(effect):
    hidden = "".join(f", {effect}.{name}: {value}" for name, value in HIDDEN[effect].items())
    text = f"""name: collisions
model: {{contact: hertz_mindlin, effects: [{effect or ''}], density: 2500 kg/m^3, fixed: {{poisson_ratio: 0.25{hidden}}}}}
parameters:
  young_modulus: {{prior: log_uniform, min: 0.02 GPa, max: 1 GPa}}
  friction_coefficient: {{prior: uniform, min: 0.05, max: 1.0}}
experiments:
"""
    for name, (control, _, setting, role) in TESTS.items():
        text += f"""  - name: {name}
    test: collision
    radius: 5 mm
    {setting}
    data: {{file: {name}.csv}}
    control: {control}
    role: {role}
    observables:
"""
        for observable, (relative, absolute) in NOISE.items():
            text += f"      {observable}: {{noise: {{{f'relative: {relative}' if relative else f'absolute: {absolute}'}}}}}\n"
    return text + "inference: {method: iterative_bayesian_filter, samples: 24, max_iterations: 3}\nseed: 7\n"


def write_data(folder, values):
    """values(name, number of the reading, observable)"""
    for name, (control, at, _, _) in TESTS.items():
        with open(os.path.join(folder, name + ".csv"), "w") as file:
            print(control, *NOISE, sep=",", file=file)
            for i, x in enumerate(at):
                print(repr(x), *[repr(values(name, i, observable)) for observable in NOISE], sep=",", file=file)


def call(calibctl, *arguments):
    done = subprocess.run([calibctl, *arguments], capture_output=True, text=True, stdin=subprocess.DEVNULL)
    if done.returncode != 0:
        sys.exit(f"{arguments[0]} ended with {done.returncode}: {done.stderr.strip()[-300:]}")
    return done.stdout


def measure(calibctl, folder, effect, seed):
    draw = random.Random(seed)
    truth = {"young_modulus": 1e8 * 4 ** draw.random(), "friction_coefficient": draw.uniform(0.2, 0.6)}
    write_data(folder, lambda *_: 1.0)
    path, states = os.path.join(folder, "campaign.yaml"), os.path.join(folder, "states.csv")
    with open(path, "w") as file:
        file.write(campaign(effect))
    call(calibctl, "simulate", path, "-o", states, *[word for k, v in truth.items() for word in ("--set", f"{k}={v!r}")])
    rows = {name: [] for name in TESTS}
    with open(states) as file:
        for row in csv.DictReader(file):
            rows[row["experiment"]].append(row)

    def measured(name, i, observable):
        true, (relative, absolute) = float(rows[name][i][observable]), NOISE[observable]
        return true + draw.gauss(0, 1) * math.hypot(relative * true, absolute)
    write_data(folder, measured)
    with open(path, "w") as file:
        file.write(campaign(None))
    return path


def verdict(calibctl, effect, seed, improve):
    """The diagnosis of a measurement; with improve the model that it ends with beside it."""
    with tempfile.TemporaryDirectory(prefix="calib-collisions-") as folder:
        path = measure(calibctl, folder, effect, seed)
        common = ["--state", os.path.join(folder, "state"), "--workers", "1", "--json"]
        name = json.loads(call(calibctl, "run", path, *common))["campaign"]
        found = json.loads(call(calibctl, "diagnose", name, *common))
        return found, json.loads(call(calibctl, "improve", name, *common)) if improve else None


def kind(found, effect):
    """alone | group | adequate | unexplained | wrong"""
    if found["verdict"] == "missing_effect":
        return "alone" if found["effect"] == effect else "wrong"
    if found["verdict"] == "ambiguous":
        first = found["candidates"][0]
        return "group" if effect in [first["effect"], *first["confusable_with"]] else "wrong"
    return found["verdict"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--calibctl", required=True)
    parser.add_argument("--seeds", type=int, default=5, help="measurements of each effect")
    parser.add_argument("--only", help="hidden effects, separated by commas; nothing: no effect")
    parser.add_argument("--improve", action="store_true", help="also which model improve ends with (minutes each)")
    arguments = parser.parse_args()
    chosen = [e for e in HIDDEN if not arguments.only or (e or "nothing") in arguments.only.split(",")]
    kinds = ("alone", "group", "adequate", "unexplained", "wrong")
    print(f"{arguments.seeds} measurements each.\n")
    improved = " improve: found | adequate | error held out |" if arguments.improve else ""
    print("| hidden | misfit of the model without [sd] | named alone | in the group | adequate | unexplained | something else named |" + improved)
    print("|---" * (7 + improved.count("|")) + "|", flush=True)
    for effect in chosen:
        answers = [verdict(arguments.calibctl, effect, seed, arguments.improve) for seed in range(1, arguments.seeds + 1)]
        counts = [kind(found, effect) for found, _ in answers]
        misfits = [found["adequacy"]["rms"] for found, _ in answers]
        row = [effect or "nothing", f"{min(misfits):.1f} .. {max(misfits):.1f}", *[str(counts.count(k)) for k in kinds]]
        if arguments.improve:
            last = [improvement["steps"][-1] for _, improvement in answers]
            row += [str(sum(step["effects"] == ([effect] if effect else []) for step in last)),
                    str(sum(step["verdict"] == "adequate" for step in last)),
                    ", ".join(f"{improvement['steps'][0]['heldout_rms_error']:.3g} -> {improvement['steps'][-1]['heldout_rms_error']:.3g}"
                              for _, improvement in answers)]
        print("| " + " | ".join(row) + " |", flush=True)


if __name__ == "__main__":
    main()
