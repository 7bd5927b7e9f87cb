#!/usr/bin/env python3
"""Times YADE, LAMMPS, LIGGGHTS and this engine on the same packings: see deploy/bench/peers.

usage: side_by_side.py FOLDER_OF_OUR_BINARIES [--repeats N] [--grains 1000,5000,10000] [--threads 1,2] [--only speed|flow|together|emptying|drum|heap|evaluation|curves]
           [--cases base,rolling,linear] [--tests '0.2 MPa,oedometric'] [--rate 0.1] [--keep FOLDER] [--quick]
Every round runs all codes once, one after the other, so that what disturbs the machine disturbs all of them; the tables
hold medians over the rounds. One thread is timed by processor time, so that other work on the machine takes nothing
from anybody; two threads by wall time, which wants an idle machine. Prints Markdown.
"""
import argparse
import csv
import json
import math
import os
import random
import re
import statistics
import subprocess
import sys
import tempfile
import time

import curves
import moving

HERE = os.path.dirname(os.path.abspath(__file__))
DATA = os.path.join(os.environ["CALIB_DATA"], "toyoura_triaxial")
SKIN = {1000: 2e-4, 5000: 1e-4, 10000: 8e-5}  # m, near the fastest of LAMMPS and LIGGGHTS
STEP = {1000: 4e-5, 5000: 1.5e-5, 10000: 1e-5}  # s, of LAMMPS and LIGGGHTS
# Vessels that empty, turn or are lifted, as in tests/bench/flow_bench.cc. LIGGGHTS' dashpot is sqrt(5/6) b times ours at a restitution of
# exp(-pi b/sqrt(1 - b^2)); ours has a damping ratio of 0.2.
DRAIN = -0.02  # m
DASHPOT = 0.2 / math.sqrt(5 / 6)
RESTITUTION = math.exp(-math.pi * DASHPOT / math.sqrt(1 - DASHPOT ** 2))

# One drained triaxial evaluation: 50 stages to 20 %, packing and stages in files beside it. Rate and balance as in
# yade_triaxial.py; damping while settling is left to the engine (0.7; YADE has 0.9).
TRIAXIAL = """name: complete evaluation
model:
  contact: linear
  effects: [rolling_resistance, twisting_resistance]
  density: 2650000 kg/m^3
  fixed: {young_modulus: 1 GPa, poisson_ratio: 0.25, rolling_resistance.stiffness: 0.13, rolling_resistance.friction: 0.13,
          twisting_resistance.stiffness: 0.13, twisting_resistance.friction: 0.13}
parameters: {friction_angle: {prior: uniform, min: 10 deg, max: 45 deg}}
experiments:
  - name: triaxial
    test: triaxial_drained
    confining_pressure: 0.5 MPa
    packing: {file: packing.txt}
    data: {file: triaxial_data.csv, strain: logarithmic}
    control: axial_strain
    staging: {rate: RATE 1/s, step: 0.004, unbalanced: 1e-3}
    observables: {stress_ratio: {noise: {absolute: 0.1}}, volumetric_strain: {noise: {absolute: 1e-3}}}
"""


def run(command, environment=None):
    """Runs to the end; wall and processor time [s], largest resident memory [MiB], output. Ends the program with the
    output on failure."""
    start = time.time()
    with tempfile.TemporaryFile("w+") as output:
        child = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT,
            env={**os.environ, **(environment or {})})
        _, status, usage = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
        wall = time.time() - start
        output.seek(0)
        text = output.read()
    if child.returncode != 0:
        sys.exit(f"{' '.join(command)} ended with {child.returncode}:\n{text[-2000:]}")
    return (wall, usage.ru_utime + usage.ru_stime), usage.ru_maxrss / 1024, text


class Work:
    def __init__(self, binaries, folder, quick):
        self.binaries, self.folder, self.quick = binaries, folder, quick

    def path(self, name):
        return os.path.join(self.folder, name)

    def packing(self, grains):
        return os.path.join(DATA, f"packing_{grains}.txt")

    def steps(self, grains):
        return (400 if self.quick else 4000) * 1000 // grains

    def yade(self, grains, threads):
        out = self.path(f"dense_{grains}")
        _, memory, _ = run(["yade", "-n", "-x", f"-j{threads}", os.path.join(HERE, "yade_dense.py"), self.packing(grains),
                            out, str(self.steps(grains))])
        with open(out + ".json") as file:
            timed = json.load(file)
        return timed["contacts"] * timed["steps"] / timed["cpu" if threads == 1 else "wall"] / 1e6, memory

    def data_file(self, grains):
        """The dense state as LAMMPS and LIGGGHTS read it."""
        path = self.path(f"dense_{grains}.data")
        if not os.path.exists(path):
            with open(self.path(f"dense_{grains}.geometry")) as file:
                count, *lengths, _ = file.readline().split()
                grains_at = [line.split() for line in file]
            with open(path, "w") as file:
                print(f"dense state\n\n{count} atoms\n1 atom types\n", file=file)
                for length, axis in zip(lengths, "xyz"):
                    print(f"0 {length} {axis}lo {axis}hi", file=file)
                print("\nAtoms\n", file=file)
                for number, (x, y, z, radius) in enumerate(grains_at, 1):
                    print(number, 1, 2 * float(radius), 2650000, x, y, z, file=file)
        return path

    def lammps_like(self, program, script, grains, threads):
        steps = 10 * self.steps(grains)
        command = [program, "-in", os.path.join(HERE, script), "-log", "none", "-var", "data", self.data_file(grains),
                   "-var", "skin", str(SKIN[grains]), "-var", "dt", str(STEP[grains]), "-var", "steps", str(steps)]
        if threads > 1:
            command = ["mpirun", "--allow-run-as-root", "--bind-to", "core", "-np", str(threads)] + command
        (wall, cpu), memory, text = run(command, {"OMP_NUM_THREADS": "1"})
        loop = [float(word) for word in re.findall(r"^Loop time of ([\d.eE+-]+)", text, re.M)][-1]
        if threads == 1:  # these codes time the loop by wall time only: what of it was their own
            loop *= min(cpu / wall, 1.0)
        rows = [line.split() for line in text.splitlines() if re.fullmatch(r"\s*\d+(\s+[\d.eE+-]+){2,}\s*", line)]
        rows = [row for row in rows if len(row) == 3][-2:]
        twice = statistics.mean(float(row[2]) for row in rows)
        return 0.5 * twice * steps / loop / 1e6, memory

    def ours(self, grains, threads):
        _, memory, text = run(
            [os.path.join(self.binaries, "dem_bench"), f"--benchmark_filter=ContactUpdates/hertz_rolling/{grains}/{threads}/",
             "--benchmark_format=json", f"--benchmark_min_time={0.3 if self.quick else 1.5}"],
            {"OMP_WAIT_POLICY": "active"})
        found = json.loads(text[text.index("{"):])["benchmarks"][0]
        own = found["cpu_time"] / found["real_time"] if threads == 1 else 1.0
        return found["contact_updates/s"] / own / 1e6, memory

    def rate(self, code, grains, threads):
        if code == "YADE":
            return self.yade(grains, threads)
        if code == "LAMMPS":
            return self.lammps_like("lmp", "dense.lammps", grains, threads)
        if code == "LIGGGHTS":
            return self.lammps_like("liggghts", "dense.liggghts", grains, threads)
        return self.ours(grains, threads)

    def our_flow(self, name):
        """Processor time of one step of ours [ms] and its contacts; leaves the state from which the other code goes on."""
        _, _, text = run(
            [os.path.join(self.binaries, "dem_bench"), f"--benchmark_filter=Discharge/{name}/", "--benchmark_format=json"],
            {"CALIB_BENCH_STATE": self.folder})
        found = json.loads(text[text.index("{"):])["benchmarks"][0]
        return found["cpu_time"] / 1e6, found["contact_updates/s"] * found["cpu_time"] / 1e9

    def state_for_liggghts(self):
        """Writes the state that ours left as LIGGGHTS reads it, flow.data; the time step [s]."""
        with open(self.path("flow.txt")) as file:
            step, *box = (float(word) for word in file.readline().split())
            grains = [line.split() for line in file]
        with open(self.path("flow.data"), "w") as file:
            print(f"flow\n\n{len(grains)} atoms\n1 atom types\n\n0 {box[0]} xlo xhi\n0 {box[1]} ylo yhi\n-0.03 {box[2] + 0.002} zlo zhi",
                  file=file)
            print("\nAtoms\n", file=file)
            for number, (x, y, z, radius, *_) in enumerate(grains, 1):
                print(number, 1, 2 * float(radius), 2500, x, y, z, file=file)
            print("\nVelocities\n", file=file)
            for number, words in enumerate(grains, 1):
                print(number, *words[4:], 0, 0, 0, file=file)
        return step

    def liggghts(self, skin, steps, before=0, every=100000):
        """Lets LIGGGHTS go on from the state that ours left. Processor time of one of the last steps [ms], the time step [s], and what it printed:
        step, grains, twice the contacts between grains, grains above the drain."""
        step = self.state_for_liggghts()
        (wall, cpu), _, text = self.run_liggghts("flow.liggghts", {
            "vessel": self.path("vessel.stl"), "skin": skin, "dt": step, "every": every, "drain": DRAIN, "before": before, "steps": steps})
        loop = [float(word) for word in re.findall(r"^Loop time of ([\d.eE+-]+)", text, re.M)][-1]
        rows = [[float(word) for word in line.split()] for line in text.splitlines() if re.fullmatch(r"\s*\d+(\s+[\d.eE+-]+){3}\s*", line)]
        return loop * min(cpu / wall, 1.0) * 1e3 / steps, step, rows

    def run_liggghts(self, script, given):
        """From the state of state_for_liggghts()."""
        given = {"data": self.path("flow.data"), "restitution": RESTITUTION, **given}
        return run(["liggghts", "-in", os.path.join(HERE, script), "-log", "none", *(a for k, v in given.items() for a in ("-var", k, str(v)))],
                   {"OMP_NUM_THREADS": "1"})

    def liggghts_flow(self, skin):
        """Processor time of a step [ms], and its contacts, from the state that our_flow() left."""
        time, _, rows = self.liggghts(skin, 1000, before=300)
        return time, 0.5 * statistics.mean(row[2] for row in rows[-2:])

    def emptying(self, grains, seed):
        """[(time [s], grains left)] of ours and of LIGGGHTS from the same state, a vessel that empties."""
        run([os.path.join(self.binaries, "dem_bench"), f"--benchmark_filter=Emptying/hopper/{grains}/{seed}/"], {"CALIB_BENCH_STATE": self.folder})
        with open(self.path("left.txt")) as file:
            ours = [tuple(float(word) for word in line.split()) for line in file]
        with open(self.path("flow.txt")) as file:
            step = float(file.readline().split()[0])
        every = max(1, round((ours[1][0] - ours[0][0]) / step))
        _, step, rows = self.liggghts(6e-4, every * (len(ours) + len(ours) // 5), every=every)
        return ours, [(row[0] * step, row[3]) for row in rows]

    def ours_at_once(self, grains, runs):
        """Million contact updates per second and core of that many runs at once, by the processor time of each."""
        command = [os.path.join(self.binaries, "dem_bench"), f"--benchmark_filter=ContactUpdates/hertz_rolling/{grains}/1/",
                   "--benchmark_format=json", f"--benchmark_min_time={0.3 if self.quick else 1.5}"]
        children = [subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
                    for _ in range(runs)]
        rates = []
        for child in children:
            text = child.communicate()[0]
            if child.returncode != 0:
                sys.exit(f"{' '.join(command)} ended with {child.returncode}:\n{text[-2000:]}")
            found = json.loads(text[text.index("{"):])["benchmarks"][0]
            rates.append(found["contact_updates/s"] * found["real_time"] / found["cpu_time"] / 1e6)
        return statistics.mean(rates)

    def yade_evaluation(self, repeat, rate):
        out = self.path("triaxial_yade.txt")
        run(["yade", "-n", "-x", "-j1", os.path.join(HERE, "yade_triaxial.py"), self.packing(1000), out, str(repeat), str(rate)])
        with open(out) as file:
            rows = [[float(word) for word in line.split()] for line in file]
        return rows[-1][5], int(rows[-1][3]), [row[2] for row in rows], [row[1] for row in rows]

    def our_evaluation(self, repeat, rate):
        campaign, out = self.path("triaxial.yaml"), self.path("triaxial.csv")
        with open(self.path("packing.txt"), "w") as file, open(self.packing(1000)) as source:
            file.write(source.readline())
            shift = random.Random(repeat)  # grain by grain, as yade_triaxial.py does
            for line in source:
                words = line.split()
                if words:
                    moved = [repr(float(x) * (1 + 1e-9 * shift.random() * (repeat > 0))) for x in words[:3]]
                    print(*moved, *words[3:], file=file)
        with open(self.path("triaxial_data.csv"), "w") as file:
            print("axial_strain,stress_ratio,volumetric_strain", file=file)
            for stage in range(1, 51):
                print(0.004 * stage, 3, 0, sep=",", file=file)
        with open(campaign, "w") as file:
            file.write(TRIAXIAL.replace("RATE", str(rate)))
        (_, cpu), _, _ = run([os.path.join(self.binaries, "calibctl"), "simulate", campaign, "--set", "friction_angle=29deg", "-o", out],
                         {"OMP_NUM_THREADS": "1"})
        with open(out) as file:
            rows = list(csv.DictReader(file))
        return cpu, None, [float(row["stress_ratio"]) for row in rows], [float(row["volumetric_strain"]) for row in rows]


def speed(work, grains_list, threads_list, repeats):
    codes = ("YADE", "LAMMPS", "LIGGGHTS", "calib")
    found = {}
    for repeat in range(repeats):
        for grains in grains_list:
            for threads in threads_list:
                for code in codes:
                    rate, memory = work.rate(code, grains, threads)
                    found.setdefault((code, grains, threads), []).append((rate, memory))
                    print(f"round {repeat + 1}, {grains} grains, {threads} threads, {code}: {rate:.2f}", file=sys.stderr, flush=True)
    median = {key: statistics.median(rate for rate, _ in values) for key, values in found.items()}
    print(f"\nHertz-Mindlin with rolling resistance, million contact updates per second (of processor time on one thread, of wall time on "
          f"two), medians of {repeats}:\n")
    print("| grains | threads | " + " | ".join(codes) + " | calib / fastest peer | calib / YADE | calib against its one thread |")
    print("|---" * (len(codes) + 5) + "|")
    for grains in grains_list:
        for threads in threads_list:
            values = [median[code, grains, threads] for code in codes]
            print(f"| {grains} | {threads} | " + " | ".join(f"{value:.2f}" for value in values)
                  + f" | {values[3] / max(values[:3]):.2f} | {values[3] / values[0]:.1f} | {values[3] / median['calib', grains, threads_list[0]]:.2f} |")
    print("\nLargest resident memory of one process, MiB, one thread:\n")
    print("| grains | " + " | ".join(codes) + " |")
    print("|---" * (len(codes) + 1) + "|")
    for grains in grains_list:
        print(f"| {grains} | " + " | ".join(
            f"{statistics.median(memory for _, memory in found[code, grains, threads_list[0]]):.0f}" for code in codes) + " |")


def together(work, grains_list, repeats):
    cores = os.cpu_count()
    print(f"\nParameter sets at once, one run a core on {cores} cores, as a worker does it: million contact updates per second and core "
          f"(processor time), beside the faster of LAMMPS and LIGGGHTS, alone on a core; medians of {repeats}:\n")
    print("| grains | faster peer | calib, per core | ratio, median of pairs |")
    print("|---|---|---|---|")
    for grains in grains_list:
        if not os.path.exists(work.path(f"dense_{grains}.geometry")):
            work.yade(grains, 1)  # its dense state is where the others begin
        pairs = []
        for repeat in range(repeats):
            peer = max(work.rate(code, grains, 1)[0] for code in ("LAMMPS", "LIGGGHTS"))
            pairs.append((peer, work.ours_at_once(grains, cores)))
            print(f"together {repeat + 1}, {grains} grains: peer {pairs[-1][0]:.2f}, calib {pairs[-1][1]:.2f}", file=sys.stderr, flush=True)
        print(f"| {grains} | {statistics.median(p for p, _ in pairs):.2f} | {statistics.median(o for _, o in pairs):.2f} | "
              f"{statistics.median(o / p for p, o in pairs):.2f} |")


def flow(work, repeats):
    print("\nGrains that flow out of a vessel, Hertz-Mindlin with a dashpot, one thread, from the same state with the same time step: "
          f"processor time of a step [ms], medians of {repeats} (least .. largest):\n")
    print("| vessel | LIGGGHTS | calib | ratio, median of pairs | contacts of grains in LIGGGHTS | of grains and walls in calib |")
    print("|---|---|---|---|---|---|")
    # With the skin of its list that was fastest among 0.4, 0.6, 0.8, 1.2 mm for the other code.
    vessels = (("silo/16000", "silo, 16 000 grains in a plane", 8e-4), ("hopper/10000", "hopper of triangles, 10 000 grains", 6e-4))
    for name, what, skin in (("silo/500", "silo, 500 grains in a plane", 8e-4),) if work.quick else vessels:
        pairs = []
        for repeat in range(repeats):
            ours, peer = work.our_flow(name), work.liggghts_flow(skin)
            pairs.append((peer, ours))
            print(f"flow {repeat + 1}, {name}: LIGGGHTS {peer[0]:.3f} ms, calib {ours[0]:.3f} ms", file=sys.stderr, flush=True)
        columns = [[peer[0] for peer, _ in pairs], [ours[0] for _, ours in pairs]]
        times = " | ".join(f"{statistics.median(c):.2f} ({min(c):.2f} .. {max(c):.2f})" for c in columns)
        print(f"| {what} | {times} | {statistics.median(p[0] / o[0] for p, o in pairs):.2f} | {pairs[0][0][1]:.0f} | {pairs[0][1][1]:.0f} |")


def flow_rate(curve):
    """Grains per second while between a fifth and three fifths of them have left: least squares."""
    first = curve[0][1]
    steady = [(time, left) for time, left in curve if 0.4 * first <= left <= 0.8 * first]
    times, lefts = zip(*steady)
    mean = statistics.mean(times)
    return -sum((t - mean) * left for t, left in steady) / sum((t - mean) ** 2 for t in times)


def emptying(work, repeats):
    grains = 500 if work.quick else 2000
    pairs = []
    for seed in range(1, min(repeats, 8) + 1):
        ours, theirs = (flow_rate(curve) for curve in work.emptying(grains, seed))
        pairs.append((ours, theirs))
        print(f"emptying {seed}: LIGGGHTS {theirs:.0f} grains/s, calib {ours:.0f}", file=sys.stderr, flush=True)
    print(f"\nA hopper of triangles (30 degrees, outlet of 8 diameters) with {grains} grains that empties, Hertz-Mindlin with a dashpot, from the same "
          "state; grains per second while a fifth to three fifths have left:\n")
    print("| filling | LIGGGHTS | calib | ratio |")
    print("|---|---|---|---|")
    for seed, (ours, theirs) in enumerate(pairs, 1):
        print(f"| {seed} | {theirs:.0f} | {ours:.0f} | {ours / theirs:.3f} |")
    if len(pairs) > 1:
        ratios = [ours / theirs for ours, theirs in pairs]
        print(f"\nmean ratio {statistics.mean(ratios):.4f} +- {statistics.stdev(ratios) / math.sqrt(len(ratios)):.4f}")


def agreement(rows, column):
    """difference of the two mean curves: rms over the largest value, share of states within two standard errors"""
    ours, theirs = (list(zip(*(v[column] for v in rows[code]))) for code in ("calib", "YADE"))
    differences = [statistics.mean(a) - statistics.mean(b) for a, b in zip(ours, theirs)]
    errors = [math.sqrt((statistics.variance(a) + statistics.variance(b)) / len(a)) for a, b in zip(ours, theirs)]
    largest = max(abs(statistics.mean(b)) for b in theirs)
    within = sum(abs(d) <= 2 * e for d, e in zip(differences, errors)) / len(errors)
    return math.sqrt(statistics.mean(d * d for d in differences)) / largest, within


def evaluation(work, repeats, rate):
    rows = {"YADE": [], "calib": []}
    for repeat in range(repeats):
        rows["YADE"].append(work.yade_evaluation(repeat, rate))
        rows["calib"].append(work.our_evaluation(repeat, rate))
        print(f"evaluation {repeat + 1}: YADE {rows['YADE'][-1][0]:.1f} s, calib {rows['calib'][-1][0]:.1f} s", file=sys.stderr, flush=True)
    print(f"\nOne drained triaxial evaluation, 1000 grains, linear contacts with rolling and twisting, 50 stages to 20 % at {rate:g}/s, damping while settling 0.9 in YADE and 0.7 here, one thread, "
          f"{repeats} repeats of shifted grains:\n")
    print("| | processor time, median [s] | peak stress ratio, mean (least .. largest) | mean over 16-20 % | volumetric strain at 20 % |")
    print("|---|---|---|---|---|")
    for code, values in rows.items():
        peaks, late, volume = ([max(v[2]) for v in values], [statistics.mean(v[2][40:]) for v in values], [v[3][-1] for v in values])
        print(f"| {code} | {statistics.median(v[0] for v in values):.2f} | " + " | ".join(
            f"{statistics.mean(x):.{digits}f} ({min(x):.{digits}f} .. {max(x):.{digits}f})"
            for x, digits in ((peaks, 2), (late, 2), (volume, 4))) + " |")
    ratio = statistics.median(y[0] / c[0] for y, c in zip(rows["YADE"], rows["calib"]))
    print(f"\nratio of processor times, median of pairs: {ratio:.1f}")
    if repeats > 1:
        for what, column in (("stress ratio", 2), ("volumetric strain", 3)):
            rms, within = agreement(rows, column)
            print(f"{what}: mean curves differ by {100 * rms:.1f} % of the largest value (rms); {100 * within:.0f} % of the states are within "
                  "two standard errors")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("binaries")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--grains", default="1000,5000,10000")
    parser.add_argument("--threads", default="1,2")
    parser.add_argument("--only", choices=("speed", "together", "flow", "emptying", "drum", "heap", "evaluation", "curves"), help="one of the parts")
    parser.add_argument("--cases", default=",".join(curves.CASES), help="of the part curves")
    parser.add_argument("--tests", default=",".join(curves.TESTS), help="of the part curves")
    parser.add_argument("--rate", type=float, default=0.1, help="of strain in the parts evaluation and curves [1/s]; the stored curves have 0.1")
    parser.add_argument("--keep", help="folder for the curves of the part curves, so that it may be stopped and run again")
    parser.add_argument("--quick", action="store_true", help="few steps, one repeat: shows that all programs run")
    parser.add_argument("--check", action="store_true", help="options only: nothing is run")
    arguments = parser.parse_args()
    repeats = 1 if arguments.quick else arguments.repeats
    grains = [int(word) for word in arguments.grains.split(",")]
    unknown = sorted(set(grains) - set(SKIN))
    if unknown:
        parser.error(f"no packing of {unknown} grains; there are {sorted(SKIN)}")
    cases, tests = arguments.cases.split(","), arguments.tests.split(",")
    for given, known in ((cases, curves.CASES), (tests, curves.TESTS)):
        if not set(given) <= set(known):
            parser.error(f"{sorted(set(given) - set(known))}: there are {sorted(known)}")
    if not arguments.rate > 0:
        parser.error("--rate: must be above 0")
    if arguments.check:
        return
    if arguments.quick:
        cases, tests = cases[:1], tests[:1]
    if arguments.keep:
        os.makedirs(arguments.keep, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="calib-peers-") as folder:
        work = Work(os.path.abspath(arguments.binaries), folder, arguments.quick)
        parts = {"speed": lambda: speed(work, grains, [int(word) for word in arguments.threads.split(",")], repeats),
                 "together": lambda: together(work, grains, repeats),
                 "flow": lambda: flow(work, repeats),
                 "emptying": lambda: emptying(work, repeats),
                 "drum": lambda: moving.drum(work, run, repeats),
                 "heap": lambda: moving.heap(work, run, repeats),
                 "evaluation": lambda: evaluation(work, repeats, arguments.rate),
                 "curves": lambda: curves.curves(work, run, os.environ["CALIB_DATA"], cases, tests, repeats, arguments.keep or folder,
                                             arguments.rate)}
        for name, part in parts.items():
            if arguments.only == name or (arguments.only is None and name != "curves"):  # those take an hour
                part()


if __name__ == "__main__":
    main()
