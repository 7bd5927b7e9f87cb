"""Parts drum and heap of side_by_side.py: a container of triangles moves with grains in it, in LIGGGHTS and in this engine (Moving of
tests/bench/flow_bench.cc) from the same state; the same measures of what both wrote.
"""
import math
import os
import statistics
import sys

DIAMETER = 0.002  # m, of the grains in the mean
RIM = 10 * DIAMETER  # m, radius of the rim about 1000 grains


def frames_of(path):
    """[[(x, y, z, radius)]] of a dump, ours or of LIGGGHTS."""
    frames = []
    with open(path) as file:
        for line in file:
            words = line.split()
            if line.startswith("ITEM: ATOMS"):
                frames.append([])
            elif words[0] != "ITEM:" and len(words) == 4:
                frames[-1].append(tuple(map(float, words)))
    return frames


def slope_of(points):
    s, h = (statistics.mean(values) for values in zip(*points))
    return sum((a - s) * (b - h) for a, b in points) / sum((a - s) ** 2 for a, _ in points)


def surface_slope(grains, diameter):
    """SurfaceSlope of dem/measure over the middle 60 %, in degrees."""
    low, high = min(g[0] for g in grains), max(g[0] for g in grains)
    top = {}
    for x, _, z, r in grains:
        column = int((x - low) / diameter)
        top[column] = max(top.get(column, -math.inf), z + r)
    places = [(low + (column + 0.5) * diameter, h) for column, h in top.items()]
    return math.degrees(math.atan(slope_of([(x, h) for x, h in places if abs(x - 0.5 * (low + high)) <= 0.3 * (high - low)])))


def centre_of_mass(grains):
    mass = sum(r ** 3 for *_, r in grains)
    return [sum(g[axis] * g[3] ** 3 for g in grains) / mass for axis in range(3)]


def conical_heap(grains, centre, diameter):
    """ConicalHeap of dem/measure: slope [degrees] and height [m]."""
    top = {}
    for x, y, z, r in grains:
        ring = int(math.hypot(x - centre[0], y - centre[1]) / diameter)
        sector = min(int((math.atan2(y - centre[1], x - centre[0]) / (2 * math.pi) + 0.5) * 8), 7)
        cells = top.setdefault(ring, {})
        cells[sector] = max(cells.get(sector, -math.inf), z + r)
    surface = [((ring + 0.5) * diameter, sum(cells.values()) / (len(cells) if ring == 0 else 8)) for ring, cells in sorted(top.items())]
    height = max(h for _, h in surface)
    low = max(0.15 * height, diameter)
    for k, (_, h) in enumerate(surface):
        if h < low:
            surface = surface[:k]
            break
    surface = [(s, h) for s, h in surface if h <= 0.85 * height]
    stands = height >= 2 * diameter and len(surface) >= 3
    return math.degrees(max(0.0, math.atan(-slope_of(surface)))) if stands else 0.0, height


def both(work, run, what, grains, seed):
    """`drum` or `heap`: the container's centre, and of ours and of LIGGGHTS the frames [[(x, y, z, radius)]], one per 0.01 s."""
    run([os.path.join(work.binaries, "dem_bench"), f"--benchmark_filter=Moving/{what}/{grains}/{seed}/"], {"CALIB_BENCH_STATE": work.folder})
    with open(work.path("motion.txt")) as file:
        *motion, count = file.read().split()
    x, y, z, *velocity, wx, wy, wz, rest, every = (float(word) for word in motion)
    speed = math.hypot(wx, wy, wz)
    if speed > 0:
        move = f"rotate origin {x} {y} {z} axis {wx / speed} {wy / speed} {wz / speed} period {2 * math.pi / speed}"
    else:
        move = "linear {} {} {}".format(*velocity)
    step = work.state_for_liggghts()
    stride = round(every / step)
    work.run_liggghts(what + ".liggghts", {
        "folder": work.folder, "skin": 6e-4, "dt": step, "move": move, "before": round(rest / every) * stride, "every": stride,
        "steps": int(count) * stride, "frames": work.path("theirs.txt")})
    frames = frames_of(work.path("frames.txt")), frames_of(work.path("theirs.txt"))[1:]
    if any(len(of) != int(count) or len(of[-1]) != grains for of in frames):
        sys.exit(f"{what}, filling {seed}: not all of {count} frames of {grains} grains were written")
    return (x, y, z), *frames


def beside(what, columns, rows):
    """Table of [(of LIGGGHTS, of ours)] per filling, a column per measure (name, format)."""
    print(f"\n{what}; LIGGGHTS, calib:\n")
    print("| filling | " + " | ".join(name for name, _ in columns) + " |")
    print("|---" * (len(columns) + 1) + "|")
    for seed, row in enumerate(rows, 1):
        print(f"| {seed} | " + " | ".join(f"{theirs:{form}}, {ours:{form}}" for (_, form), (theirs, ours) in zip(columns, row)) + " |")
    if len(rows) < 2:
        return
    print()
    for (name, form), values in zip(columns, zip(*rows)):
        theirs, ours = (statistics.mean(column) for column in zip(*values))
        apart = [b - a for a, b in values]
        error = statistics.stdev(apart) / math.sqrt(len(apart))
        print(f"{name}: LIGGGHTS {theirs:{form}}, calib {ours:{form}}, mean difference {ours - theirs:.2g} +- {error:.2g}, "
              f"mean ratio {ours / theirs:.4f} +- {error / theirs:.4f}")


def fillings(work, run, what, repeats, measure):
    """[[(of LIGGGHTS, of ours)]] of the measures of a container that moves, per filling."""
    grains = 100 if work.quick else 1000
    rows = []
    for seed in range(1, min(repeats, 8) + 1):
        centre, ours, theirs = both(work, run, what, grains, seed)
        rows.append(list(zip(measure(centre, theirs), measure(centre, ours))))
        print(f"{what} {seed}: " + "; ".join(f"LIGGGHTS {a:.5g}, calib {b:.5g}" for a, b in rows[-1]), file=sys.stderr, flush=True)
    return grains, rows


def drum(work, run, repeats):
    def measure(centre, frames):
        """After a quarter turn: direction [degrees] and distance [mm] of the centre of mass from the axis, slope of the surface [degrees]."""
        steady = frames[len(frames) // 4:]
        masses = [centre_of_mass(grains) for grains in steady]
        return (statistics.mean(math.degrees(math.atan2(x - centre[0], centre[2] - z)) for x, _, z in masses),
                1e3 * statistics.mean(math.hypot(x - centre[0], z - centre[2]) for x, _, z in masses),
                statistics.mean(surface_slope(grains, DIAMETER) for grains in steady))
    grains, rows = fillings(work, run, "drum", repeats, measure)
    beside(f"A drum of 48 flat sides with {grains} grains that turns at 4 rad/s, Hertz-Mindlin with a dashpot, from the same state; means over the last "
           "three quarters of a turn",
           (("centre of mass from the vertical [deg]", ".2f"), ("from the axis [mm]", ".3f"), ("slope of the surface [deg]", ".2f")), rows)


def heap(work, run, repeats):
    def measure(centre, frames):
        """At the end: slope [degrees], height of the centre of mass [mm], grains that have not left over the rim."""
        grains = frames[-1]
        rim = RIM * (len(grains) / 1000) ** (1 / 3)
        return (conical_heap(grains, centre, DIAMETER)[0], 1e3 * centre_of_mass(grains)[2],
                sum(math.hypot(x - centre[0], y - centre[1]) < rim for x, y, *_ in grains))
    grains, rows = fillings(work, run, "heap", repeats, measure)
    beside(f"A cylinder with {grains} grains that is lifted from a floor with a rim, Hertz-Mindlin with a dashpot, from the same state; the heap",
           (("slope [deg]", ".2f"), ("height of the centre of mass [mm]", ".3f"), ("grains within the rim", ".0f")), rows)
