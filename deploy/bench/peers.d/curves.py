"""Curves of YADE and of this engine from the same packings with the same laws and staging: a part of side_by_side.py.

Each case is computed by both codes from the same packings of 1000 grains, a packing for each repeat, in which every coordinate of
every grain is moved by up to 1e-6 m (repeats of one code then scatter as other packings of the same density would at small
strain). The mean curves are compared over the path; the tolerance is two standard deviations of the difference of the means,
from the scatter of the repeats, but not less than a floor below which closeness of codes means nothing.
"""
import csv
import json
import math
import os
import random
import statistics
import sys

HERE = os.path.dirname(os.path.abspath(__file__))

# Case: what YADE is told, and the same as a model of ours.
CASES = {
    "base": (
        {"law": "mindlin", "young": 0.8e9, "poisson": 0.2, "friction": 0.55},
        "contact: hertz_mindlin, fixed: {young_modulus: 0.8 GPa, poisson_ratio: 0.2}"),
    "rolling": (
        {"law": "mindlin", "young": 1.3e9, "poisson": 0.2, "friction": 0.35, "rolling": [0.6, 0.08]},
        "contact: hertz_mindlin, effects: [rolling_resistance], fixed: {young_modulus: 1.3 GPa, poisson_ratio: 0.2, "
        "rolling_resistance.stiffness: 0.6, rolling_resistance.friction: 0.08}"),
    "linear": (
        {"law": "linear", "young": 0.12e9, "poisson": 0.6, "friction": 0.5},
        "contact: linear, fixed: {young_modulus: 0.12 GPa, poisson_ratio: 0.6}"),
}

# Test: kind, pressure [Pa], file of yade_cases whose axial strains are walked, floors of the rms difference: stress ratio and axial
# stress over their largest values, volumetric strain.
TESTS = {
    "0.2 MPa": ("triaxial_drained", 2e5, "triaxial_0.2MPa.csv", 0.025, 6e-4),
    "0.5 MPa": ("triaxial_drained", 5e5, "triaxial_0.5MPa.csv", 0.015, 4e-4),
    "1.0 MPa": ("triaxial_drained", 1e6, "triaxial_1.0MPa.csv", 0.015, 4e-4),
    "oedometric": ("oedometric", 1e5, "oedometric.csv", 0.015, None),
}

CAMPAIGN = """name: curve
model: {{{model}, density: 2650000 kg/m^3}}
parameters: {{friction_coefficient: {{prior: uniform, min: 0.1, max: 1}}}}
experiments:
  - name: curve
    test: {test}
    confining_pressure: {pressure} Pa
    packing: {{file: {packing}}}
    data: {{file: {data}, strain: logarithmic}}
    control: axial_strain
    staging: {{rate: {rate} 1/s, step: 0.002, damping: [0.2, 0.9], unbalanced: 5e-4}}
    observables: {{axial_stress: {{noise: {{absolute: 1 MPa}}}}}}
"""


def strains_of(data, case, file, quick):
    """Axial strains that the stored case walks, consolidation left out."""
    with open(os.path.join(data, "yade_cases", case, file)) as rows:
        strains = [float(row["axial_strain"]) for row in csv.DictReader(rows) if row["stage"] != "iso"]
    return strains[:4] if quick else strains


def moved_packing(source, target, repeat):
    """Copies a packing, every coordinate moved by up to 1e-6 m; as it is for repeat 0."""
    shift = random.Random(repeat)
    with open(source) as rows, open(target, "w") as file:
        file.write(rows.readline())
        for line in rows:
            words = line.split()
            if words:
                print(*[repr(float(x) + (repeat > 0) * shift.uniform(-1e-6, 1e-6)) for x in words[:3]], *words[3:], file=file)


def as_curve(axial, lateral, volume):
    return {"stress ratio": [a / l for a, l in zip(axial, lateral)], "axial stress": axial, "volumetric strain": volume}


def yade_curve(work, run, job):
    out, path = work.path("curve_yade.txt"), work.path("curve_yade.json")
    with open(path, "w") as file:
        json.dump({**job, "out": out}, file)
    run(["yade", "-n", "-x", "-j1", os.path.join(HERE, "yade_curves.py"), path])
    with open(out) as file:
        rows = [[float(word) for word in line.split()] for line in file]
    return as_curve([row[2] for row in rows], [row[3] for row in rows], [row[1] for row in rows])


def our_curve(work, run, job, model, test):
    campaign, out, data = work.path("curve.yaml"), work.path("curve.csv"), work.path("curve_data.csv")
    with open(data, "w") as file:
        print("axial_strain,axial_stress", file=file)
        for strain in job["strains"]:
            print(repr(strain), job["pressure"], sep=",", file=file)
    with open(campaign, "w") as file:
        file.write(CAMPAIGN.format(model=model, test=test, pressure=job["pressure"], packing=job["packing"], data=data,
                                   rate=job["rate"]))
    run([os.path.join(work.binaries, "calibctl"), "simulate", campaign, "--set", f"friction_coefficient={job['friction']}", "-o", out],
        {"OMP_NUM_THREADS": "1"})
    with open(out) as file:
        rows = list(csv.DictReader(file))
    return as_curve(*[[float(row[name]) for row in rows] for name in ("axial_stress", "lateral_stress", "volumetric_strain")])


def rms(values):
    return math.sqrt(statistics.mean(value * value for value in values))


def compared(ours, theirs, what, floor):
    """Rms difference of the mean curves, two standard deviations of it by the scatter of the repeats (rms over the path), and the
    tolerance, stresses over the largest value of the other code's mean curve."""
    columns = [list(zip(*(curve[what] for curve in curves))) for curves in (ours, theirs)]
    means = [[statistics.mean(values) for values in column] for column in columns]
    scale = 1.0 if what == "volumetric strain" else max(means[1])
    difference = rms([(a - b) / scale for a, b in zip(*means)])
    two_sd = 0.0
    if len(ours) > 1:
        two_sd = 2 * math.sqrt(statistics.mean(
            (statistics.variance(a) + statistics.variance(b)) / len(a) / scale**2 for a, b in zip(*columns)))
    return difference, two_sd, max(two_sd, floor)


def kept(path, compute):
    """What compute() returns, or what it returned before if the file is there already."""
    if not os.path.exists(path):
        value = compute()
        with open(path + ".part", "w") as file:
            json.dump(value, file)
        os.replace(path + ".part", path)
    with open(path) as file:
        return json.load(file)


def curves(work, run, data, names, tests, repeats, folder, rate):
    """Prints the table, a line as soon as its case is done. Curves are kept in the folder, which must be for these programs only."""
    print(f"\nMean curves of {repeats} repeats, YADE and calib from the same packings: rms difference (two standard deviations of it), "
          "stresses over the largest value; tolerance: the larger of the two standard deviations and the floor.\n")
    print("| case | test | stress ratio | axial stress | volumetric strain | floors | within |")
    print("|---|---|---|---|---|---|---|", flush=True)
    beyond = 0
    for name in names:
        told, model = CASES[name]
        for test in tests:
            kind, pressure, file, relative, strain = TESTS[test]
            job = {**told, "drained": kind == "triaxial_drained", "pressure": pressure, "rate": rate, "packing": work.path("curve_packing.txt"),
                   "strains": strains_of(data, name, file, work.quick)}
            ours, theirs = [], []
            for repeat in range(repeats):
                moved_packing(work.packing(1000), job["packing"], repeat)
                stem = os.path.join(folder, f"{name}_{test}_{rate:g}_{repeat}_".replace(" ", ""))
                ours.append(kept(stem + "calib.json", lambda: our_curve(work, run, job, model, kind)))
                theirs.append(kept(stem + "yade.json", lambda: yade_curve(work, run, job)))
                print(f"curves: {name}, {test}, repeat {repeat + 1}", file=sys.stderr, flush=True)
            cells, good = [], True
            for what, floor in (("stress ratio", relative), ("axial stress", relative), ("volumetric strain", strain)):
                if floor is None:  # imposed by the test
                    cells.append("")
                    continue
                difference, two_sd, tolerance = compared(ours, theirs, what, floor)
                good &= difference <= tolerance
                cells.append(f"{difference:.1e} ({two_sd:.1e})" if what == "volumetric strain" else
                             f"{100 * difference:.2f} % ({100 * two_sd:.2f} %)")
            beyond += not good
            floors = f"{100 * relative:.1f} %" + (f", {strain:.0e}" if strain else "")
            print(f"| {name} | {test} | " + " | ".join(cells) + f" | {floors} | {'yes' if good else 'no'} |", flush=True)
    print(f"\n{'All within their tolerance.' if beyond == 0 else f'{beyond} beyond their tolerance.'}")
