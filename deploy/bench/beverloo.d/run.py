#!/usr/bin/env python3
"""Beverloo's law from silos of this engine: see deploy/bench/beverloo.

Grains of 4 mm (radii within 15 %), E 5 MPa, damping ratio 0.3, friction 0.3, in a silo three times as wide as its widest opening or
more. Each filling has grains and places of its own seed and is drained through every opening. d is the mean diameter.
  W = C (D - k d)^n   [Beverloo et al. 1961; n = 3/2 in the plane, 5/2 in space, k between 1 and 2]
Fitted to the logarithms of all flows by least squares; errors by leaving out one filling after the other (jackknife). Three fits,
because n and k bend the curve much alike: both free; n with k = 1.4; k with n as in theory. Prints Markdown.
"""
import argparse
import csv
import math
import os
import statistics
import subprocess
import sys
import tempfile

CAMPAIGN = """name: silo
model:
  contact: hertz_mindlin
  effects: [viscous_damping]
  density: 2500 kg/m^3
  fixed: {{young_modulus: 5 MPa, poisson_ratio: 0.25, viscous_damping.ratio: 0.3}}
parameters: {{friction_coefficient: {{prior: uniform, min: 0.1, max: 1}}}}
experiments:
  - name: silo
    test: silo_discharge
    flat: {flat}
    silo_width: {width} m
    packing: {{generate: {{particles: {grains}, radii: {{mean: {radius} m, spread: 0.15}}, seed: {seed}}}}}
    data: {{file: openings.csv}}
    control: opening
    observables: {{mass_flow_rate: {{noise: {{absolute: 1}}}}}}
seed: {seed}
"""
DIAMETER = 0.004


def flows(arguments, openings, seed, folder):
    """Mass flow rate [kg/s] through each opening of one filling; kept in the folder."""
    kind = "round" if arguments.round else "flat"
    path = os.path.join(folder, f"{kind}_{arguments.grains}_{arguments.openings}_{arguments.width:g}_{seed}.csv")
    if not os.path.exists(path):
        with tempfile.TemporaryDirectory(prefix="calib-beverloo-") as work:
            with open(os.path.join(work, "openings.csv"), "w") as file:
                print("opening,mass_flow_rate", file=file)
                for opening in openings:
                    print(opening * DIAMETER, 1, sep=",", file=file)
            with open(os.path.join(work, "silo.yaml"), "w") as file:
                file.write(CAMPAIGN.format(flat=int(not arguments.round), width=arguments.width * DIAMETER, grains=arguments.grains,
                                           radius=0.5 * DIAMETER, seed=seed))
            done = subprocess.run(
                [arguments.calibctl, "simulate", os.path.join(work, "silo.yaml"), "--set", "friction_coefficient=0.3", "-o", path],
                stdin=subprocess.DEVNULL, capture_output=True, text=True, env={**os.environ, "OMP_NUM_THREADS": "1"})
            if done.returncode != 0:
                sys.exit(f"filling {seed}: {done.stderr.strip()}")
    with open(path) as file:
        rows = list(csv.DictReader(file))
    return [float(row["mass_flow_rate"]) for row in rows], [int(float(row["jams"])) for row in rows]


def line(x, y):
    """Slope, offset and sum of squares of the straight line through the points."""
    mean_x, mean_y = statistics.mean(x), statistics.mean(y)
    slope = sum((a - mean_x) * (b - mean_y) for a, b in zip(x, y)) / sum((a - mean_x) ** 2 for a in x)
    offset = mean_y - slope * mean_x
    return slope, offset, sum((b - offset - slope * a) ** 2 for a, b in zip(x, y))


def misfit(points, k, n=None):
    """Exponent and sum of squares of log W over log(D/d - k), the exponent free or given."""
    x = [math.log(opening - k) for opening, _ in points]
    y = [math.log(flow) for _, flow in points]
    if n is None:
        slope, _, squares = line(x, y)
        return slope, squares
    rest = [b - n * a for a, b in zip(x, y)]
    mean = statistics.mean(rest)
    return n, sum((value - mean) ** 2 for value in rest)


def best_k(points, n=None):
    """k of the least sum of squares between 0 and 0.2 below the smallest opening, to 1e-4, by a grid and then by thirds."""
    low, high = 0.0, min(opening for opening, _ in points) - 0.2
    grid = [low + (high - low) * i / 200 for i in range(201)]
    best = min(range(201), key=lambda i: misfit(points, grid[i], n)[1])
    low, high = grid[max(0, best - 1)], grid[min(200, best + 1)]
    while high - low > 1e-4:
        a, b = low + (high - low) / 3, high - (high - low) / 3
        if misfit(points, a, n)[1] < misfit(points, b, n)[1]:
            high = b
        else:
            low = a
    return 0.5 * (low + high)


def fits(points, theory):
    """Exponent and k, both free; exponent at k = 1.4; k at the exponent of theory."""
    k = best_k(points)
    return misfit(points, k)[0], k, misfit(points, 1.4)[0], best_k(points, theory)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--calibctl", required=True)
    parser.add_argument("--fillings", type=int, default=4, help="seeds 1, 2, ..., at least 3")
    parser.add_argument("--openings", default="4,5,6,7,8", help="in mean diameters, at least 4 of them above 3")
    parser.add_argument("--grains", type=int, default=800)
    parser.add_argument("--width", type=float, default=24, help="of the silo in mean diameters")
    parser.add_argument("--round", action="store_true", help="a cylinder and a round opening in place of a plane and a slot")
    parser.add_argument("--keep", help="folder for the flows, so that the command may be stopped and run again")
    arguments = parser.parse_args()
    openings = [float(word) for word in arguments.openings.split(",")]
    if len(openings) < 4 or min(openings) <= 3 or arguments.fillings < 3:
        parser.error("four openings above 3 diameters and three fillings are the least")
    if 3 * max(openings) > arguments.width:
        parser.error(f"the silo has to be three times as wide as its widest opening: --width {3 * max(openings):g} or more")
    theory = 2.5 if arguments.round else 1.5
    with tempfile.TemporaryDirectory(prefix="calib-beverloo-") as folder:
        if arguments.keep:
            folder = arguments.keep
            os.makedirs(folder, exist_ok=True)
        table = []
        for seed in range(1, arguments.fillings + 1):
            table.append(flows(arguments, openings, seed, folder))
            print(f"filling {seed} of {arguments.fillings}", file=sys.stderr, flush=True)
    print(f"{arguments.grains} grains, {arguments.fillings} fillings of a {'cylinder' if arguments.round else 'flat silo'}, "
          f"{arguments.width:g} d wide\n")
    print("| opening/d | flow, mean [kg/s] | sd of the fillings | arches |\n|---|---|---|---|")
    for index, opening in enumerate(openings):
        values = [flow[index] for flow, _ in table]
        print(f"| {opening:g} | {statistics.mean(values):.4f} | {100 * statistics.stdev(values) / statistics.mean(values):.1f} % | "
              f"{sum(jams[index] for _, jams in table)} |")
    rows = [[(opening, flow) for opening, flow in zip(openings, filling)] for filling, _ in table]
    whole = fits([point for row in rows for point in row], theory)
    left_out = [fits([point for row in rows if row is not out for point in row], theory) for out in rows]
    count = len(rows)
    errors = [math.sqrt((count - 1) / count * sum((value[i] - statistics.mean(v[i] for v in left_out)) ** 2 for value in left_out))
              for i in range(4)]
    print("\n| fit | exponent n | k |\n|---|---|---|")
    print(f"| both free | {whole[0]:.2f} +- {errors[0]:.2f} | {whole[1]:.2f} +- {errors[1]:.2f} |")
    print(f"| k = 1.4 | {whole[2]:.2f} +- {errors[2]:.2f} | 1.4 |")
    print(f"| n = {theory:g} | {theory:g} | {whole[3]:.2f} +- {errors[3]:.2f} |")


if __name__ == "__main__":
    main()
