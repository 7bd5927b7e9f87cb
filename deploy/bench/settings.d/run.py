"""Settings of tests as parameters, ties, and a code beside ours: makes the data, calibrates, prints Markdown; see README.md."""

import argparse
import csv
import json
import math
import os
import pathlib
import random
import re
import shutil
import statistics
import subprocess

HERE = pathlib.Path(__file__).parent
VECTORS = ((4.123e9, 0.064, math.radians(30.387), 0.148, 0.202),  # the papers' [Cheng 2018, Table 5]
           (3.41e9, 0.27, math.radians(32.4), 0.155, 0.55),  # deploy/examples/toyoura
           (1e9, 0.2, math.radians(30), 0.0, 0.0))
SPECIMENS = ("on the packing that was measured", "on four others")


class Bench:
    def __init__(self, options):
        self.calibctl = str(pathlib.Path(options.calibctl).resolve())
        self.state, self.workers = options.state.resolve(), options.workers

    def folder(self, name, text, **data):
        """A folder of its own with campaign.yaml and data; what is there stays, since campaigns go on from it."""
        folder = self.state / name
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "campaign.yaml").write_text(text)
        for file, rows in data.items():
            with (folder / f"{file}.csv").open("w") as out:
                csv.writer(out, lineterminator="\n").writerows(rows)
        return folder

    def simulate(self, folder, values):
        """Rows of states, one run at these values; kept, since it takes minutes with YADE."""
        states = folder / "states.csv"
        if not states.exists():
            given = [word for name, value in values.items() for word in ("--set", f"{name}={value!r}")]
            call = [self.calibctl, "simulate", "campaign.yaml", *given, "-o", "states.new"]
            subprocess.run(call, cwd=folder, check=True, stderr=subprocess.DEVNULL)
            (folder / "states.new").rename(states)
        return [{key: float(value) for key, value in row.items() if key != "experiment"} for row in csv.DictReader(states.open())]

    def run(self, folder):
        answer = folder / "posterior.json"
        if not answer.exists():
            call = [self.calibctl, "run", "campaign.yaml", "--state", "state", "--workers", str(self.workers), "--json"]
            text = subprocess.run(call, cwd=folder, check=True, text=True, stdout=subprocess.PIPE).stdout
            answer.write_text(text)
        return json.loads(answer.read_text())

    def ask(self, folder, *verb):
        call = [self.calibctl, *verb, "--state", "state", "--json"]
        return json.loads(subprocess.run(call, cwd=folder, check=True, text=True, stdout=subprocess.PIPE).stdout)


def replaced(text, *changes):
    for old, new in changes:
        assert text.count(old) == 1, (old, text.count(old))
        text = text.replace(old, new)
    return text


def shown(number, factor=1.0):
    """`mean +- sd` to two digits of the sd; a mean alone where there is no sd."""
    mean, sd = number["mean"] * factor, (number["sd"] or 0) * factor
    if sd == 0:
        return f"{mean:.3g}, no interval"
    digits = max(0, 1 - math.floor(math.log10(sd)))
    return f"{mean:.{digits}f} +- {sd:.{digits}f}"


def off(number, truth):
    return "-" if number["sd"] is None else f"{(number['mean'] - truth) / number['sd']:+.1f}"


def pressure(bench):
    """0.21 MPa where 0.2 are stated; two draws of the errors on the packing itself, one with four other packings."""
    truth = {"young_modulus": 6e8, "friction_coefficient": 0.5, "tx.confining_pressure": 0.21e6}
    text = (HERE / "pressure.yaml").read_text()
    line = next(one for one in text.splitlines(True) if "tx.confining_pressure" in one)
    other = (("seed: 1}", "seed: 11}"), ("    data:", "    realizations: 4\n    data:"))
    strains = [0.003 * k for k in range(21)]
    head = ("axial_strain", "deviatoric_stress", "volumetric_strain")
    folder = bench.folder("pressure/measured", text, tx=[head, *((e, 1, 1) for e in strains)])
    states = bench.simulate(folder, truth)
    print("| model | errors drawn | pressure | MPa (truth 0.21) | friction (truth 0.5) | off [sd] | E [MPa] (truth 600) | "
          "off [sd] | error [sd], p | runs |\n|---|---|---|---|---|---|---|---|---|---|")
    for specimen, draw in (*((SPECIMENS[0], k) for k in (1, 2)), (SPECIMENS[1], 1)):
        rnd = random.Random(draw)
        rows = [(e, s["deviatoric_stress"] + rnd.gauss(0, math.hypot(0.01 * s["deviatoric_stress"], 2e3)),
                 s["volumetric_strain"] + rnd.gauss(0, 3e-4)) for e, s in zip(strains, states)]
        for kind, gone in (("nuisance", ""), ("as stated", line)):
            model = replaced(text, *(other if specimen == SPECIMENS[1] else ()), *(((gone, ""),) if gone else ()))
            name = f"pressure/{'own' if specimen == SPECIMENS[0] else 'other'}-{draw}-{kind.replace(' ', '-')}"
            folder = bench.folder(name, model, tx=[head, *rows])
            found = bench.run(folder)
            fit = bench.ask(folder, "compare", "c1")
            p, mu, e = (found["nuisance_parameters"].get("tx.confining_pressure"), found["parameters"]["friction_coefficient"],
                        found["parameters"]["young_modulus"])
            print(f"| {specimen} | {draw} | {kind} | {shown(p, 1e-6) if p else '-'} | {shown(mu)} | {off(mu, 0.5)} | "
                  f"{shown(e, 1e-6)} | {off(e, 6e8)} | {fit['rms_error']:.2f}, {fit['p_value']:.2g} | "
                  f"{found['model_evaluations']} |", flush=True)


def silo(bench):
    """An outlet that nobody measured, friction known and wanted; truths were run on other fillings, with 2 % of error."""
    print("| hidden | friction | opening [mm] | off [sd] | friction found (truth 0.3) | off [sd] | runs |\n"
          "|---|---|---|---|---|---|---|")
    head, text = ("opening", "mass_flow_rate"), (HERE / "silo.yaml").read_text()

    def weighed(opening, seed):
        folder = bench.folder(f"silo/measured-{seed}", replaced(text, ("seed: 7", f"seed: {seed}")), silo=[head, (0.022, 1)])
        flow = bench.simulate(folder, {"silo.opening": opening})[0]["mass_flow_rate"]
        return flow * (1 + 0.02 * random.Random(seed).gauss(0, 1))

    known = [head, (0.032, weighed(0.032, 201))]
    for seed, opening in ((101, 0.020), (102, 0.025), (103, 0.030)):
        rows = [head, (0.022, weighed(opening, seed))]  # what stands for the opening is replaced
        for name, words in (("silo", "known"), ("silo_friction", "wanted"))[:1 + (seed == 102)]:
            folder = bench.folder(f"{name}/{seed}", (HERE / f"{name}.yaml").read_text(), silo=rows, known=known)
            found = bench.run(folder)
            width, mu = found["parameters"]["silo.opening"], found["parameters"].get("friction_coefficient")
            print(f"| {1e3 * opening:g} mm | {words} | {shown(width, 1e3)} | {off(width, opening)} | {shown(mu) if mu else '-'} | "
                  f"{off(mu, 0.3) if mu else '-'} | {found['model_evaluations']} |", flush=True)


def toyoura(bench):
    """One stiffness and one limit for rolling and twisting (equal_to) on Toyoura sand at 0.2 MPa."""
    names = {"young_modulus": 1e-9, "poisson_ratio": 1, "rolling_resistance.stiffness": 1, "rolling_resistance.friction": 1,
             "friction_angle": 180 / math.pi}
    text = (HERE / "toyoura.yaml").read_text()
    before, after = text.split("  method: iterative_bayesian_filter\n")
    adaptive = before + "  method: adaptive_emulator\n  max_runs: 250\n" + after[after.index("failure:"):]
    print("| method | E [GPa] | nu | stiffness [N m/rad] | limit | friction [deg] | error [sd] | p | ESS | emulator's error [sd] | runs |\n"
          "|---|---|---|---|---|---|---|---|---|---|---|")
    for method, model in (("iterative_bayesian_filter", text), ("adaptive_emulator", adaptive)):
        folder = bench.folder("toyoura" if model is text else f"toyoura-{method}", model)
        found = bench.run(folder)
        fit = bench.ask(folder, "compare", "c1")
        cells = [shown(found["parameters"][one], factor) for one, factor in names.items()]
        errors = ", ".join(f"{one['observable']} {one['rms_error']:.2f}" for one in fit["by_observable"])
        print(f"| {method} | {' | '.join(cells)} | {fit['rms_error']:.2f}: {errors} | {fit['p_value']:.2g} | {found['ess']:.1f} | "
              f"{found['emulator']['cross_validated_error']:.2g} | {found['model_evaluations']} |", flush=True)


def funnel(askew):
    """Text of an STL sheet: the test's own funnel for grains of 96 mm, its lower opening beside where it should be [m]."""
    ring = [(math.cos(2 * math.pi * k / 16), math.sin(2 * math.pi * k / 16)) for k in range(17)]
    point = [[f"vertex {r * x} {r * y + askew} {z}" for x, y in ring] for r, z in ((0.288, 0), (0.672, 0.672))]
    faces = [corners for k in range(16) for corners in ((point[0][k], point[0][k + 1], point[1][k + 1]),
                                                       (point[0][k], point[1][k + 1], point[1][k]))]
    return "solid funnel\n" + "".join(f"facet normal 0 0 0\nouter loop\n{chr(10).join(f)}\nendloop\nendfacet\n"
                                      for f in faces) + "endsolid funnel\n"


def chute(bench):
    """Equal flows to both sides of a transfer chute in 40 runs; the best point run again on five other fillings."""
    print("| funnel | angle [deg], y, z [m], belt [m/s] | difference [kg/s] | runs, of these below 2 kg/s, the first | "
          "run again: left | right | right - left |\n|---|---|---|---|---|---|---|")
    text = (HERE / "chute.yaml").read_text()
    mesh = replaced(text, ("    data:", "    meshes: {funnel: {file: funnel.stl, unit: m}}\n    data:"))
    data = [("belt_speed", "mass_flow_difference"), (4, 0)]
    for name, model in (("the test's own", text), ("0.15 m askew", mesh)):
        short = name.split()[-1]

        def prepared(folder):
            (folder / "funnel.stl").write_text(funnel(-0.15))
            return folder

        folder = prepared(bench.folder(f"chute/{short}", model, chute=data))
        bench.run(folder)
        runs = [one for one in bench.ask(folder, "samples", "c1")["samples"] if one["log_likelihood"] is not None]
        missed = [2 * math.sqrt(max(0, -2 * (one["log_likelihood"] + math.log(2 * math.sqrt(2 * math.pi))))) for one in runs]
        best = min(range(len(runs)), key=missed.__getitem__)
        good = [k for k, one in enumerate(missed) if one < 2]
        point = runs[best]["parameters"]
        again = []
        for seed in range(101, 106):
            other = replaced(model, ("seed: 7", f"seed: {seed}"), ("seed: 1}", f"seed: {seed}}}"))
            again += bench.simulate(prepared(bench.folder(f"chute/{short}-{seed}", other, chute=data)), point)
        left, right = ([one[f"mass_flow_{side}"] for one in again] for side in ("left", "right"))
        cells = [f"{statistics.mean(one):.1f} +- {statistics.stdev(one):.1f}"
                 for one in (left, right, [r - l for l, r in zip(left, right)])]
        place = ", ".join(f"{point[f'funnel_shift_{axis}']:.2f}" for axis in "yz")
        print(f"| {name} | {math.degrees(point['funnel_angle']):.1f}, {place}, {point['belt_speed']:.2f} | {missed[best]:.2f} | "
              f"{len(runs)}, {len(good)}, {good[0] + 1 if good else '-'} | {' | '.join(cells)} |", flush=True)


def yade(bench):
    """The same parameters in YADE and in this engine on three orientations of the packing; Toyoura's readings at 0.2 MPa."""
    packing = pathlib.Path(os.environ["CALIB_DATA"], "toyoura_triaxial", "packing_1000.txt").read_text().splitlines()
    print("| E [GPa], nu, friction [deg], rolling stiffness [N m/rad], limit | observable | YADE - engine, mean of the curve | "
          "sd of the three, YADE, engine | difference in sd of a mean, rms |\n|---|---|---|---|---|")
    columns = ("young_modulus", "poisson_ratio", "friction_angle", "rolling_resistance.stiffness", "rolling_resistance.friction")
    for number, vector in enumerate(VECTORS):
        curves = {"yade": [], "engine": []}
        for axes in ("xyz", "yzx", "zxy"):
            order = ["xyz".index(axis) for axis in axes]
            turned = ["##PERIODIC:: " + " ".join(packing[0].split()[1 + k] for k in order)]
            turned += [" ".join([one[k] for k in order] + one[3:]) for one in map(str.split, packing[1:]) if one]
            for code in curves:
                folder = bench.folder(f"yade/{number}-{axes}-{code}", (HERE / f"curves_{code}.yaml").read_text())
                (folder / "packing.txt").write_text("\n".join(turned) + "\n")
                shutil.copy(HERE / "model.py", folder)
                curves[code].append(bench.simulate(folder, dict(zip(columns, vector))))
        for what in ("stress_ratio", "volumetric_strain"):
            mean, spread = {}, {}
            for code, runs in curves.items():
                readings = [[row[what] for row in rows] for rows in zip(*runs)]
                mean[code], spread[code] = [statistics.mean(r) for r in readings], [statistics.stdev(r) for r in readings]
            rms = {code: math.sqrt(statistics.mean(s * s for s in spread[code])) for code in spread}
            gap = [a - b for a, b in zip(mean["yade"], mean["engine"])]
            of_mean = math.sqrt((rms["yade"] ** 2 + rms["engine"] ** 2) / 3)
            label = (f"{vector[0] / 1e9:g}, {vector[1]:g}, {math.degrees(vector[2]):.1f}, {vector[3]:g}, {vector[4]:g}")
            print(f"| {label} | {what} | {statistics.mean(gap):+.2g} | {rms['yade']:.2g}, {rms['engine']:.2g} | "
                  f"{math.sqrt(statistics.mean(g * g for g in gap)) / of_mean:.2f} |", flush=True)


CASES = {"pressure": pressure, "silo": silo, "toyoura": toyoura, "chute": chute, "yade": yade}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--calibctl", required=True)
    parser.add_argument("--state", default="build/bench-settings", type=pathlib.Path, help="folder of what is finished")
    parser.add_argument("--workers", default=os.cpu_count(), type=int)
    parser.add_argument("case", nargs="*", default=list(CASES), help=f"of {', '.join(CASES)}; all unless given")
    options = parser.parse_args()
    unknown = set(options.case) - set(CASES)
    if unknown:
        parser.error(f"no such case: {', '.join(sorted(unknown))}; there are {', '.join(CASES)}")
    for case in options.case:
        print(f"\n{CASES[case].__doc__}\n")
        CASES[case](Bench(options))


if __name__ == "__main__":
    main()
