"""Angle of repose and height of the heap in a LIGGGHTS dump:  python3 repose.py heap.dump"""
import math
import sys


def surface(path, diameter):
    """(Distance from the axis, height) in rings of one diameter, each the mean of eight sectors."""
    top = {}
    for line in open(path).read().split("ITEM: ATOMS id x y z radius")[1].splitlines()[1:]:
        x, y, z, radius = map(float, line.split()[1:5])
        place = int(math.hypot(x, y) / diameter), int((math.atan2(y, x) / math.pi + 1) * 4) % 8
        top[place] = max(top.get(place, 0.0), z + radius)
    rings = 1 + max(ring for ring, _ in top)
    return [((ring + 0.5) * diameter, sum(top.get((ring, sector), 0.0) for sector in range(8)) / 8)
            for ring in range(rings)]


def repose(path, diameter=0.005):
    """Slope [rad] of the surface from 85 to 15 % of its greatest height, and that height [m]."""
    points = surface(path, diameter)
    summit, height = max(points, key=lambda point: point[1])
    # Not within the summit: the rings about the axis hold too few grains for eight sectors.
    side = [(s, z) for s, z in points if s > summit and 0.15 * height <= z <= 0.85 * height]
    if height < 2 * diameter or len(side) < 3:
        return 0.0, height  # one layer is no heap
    s0, z0 = (sum(values) / len(side) for values in zip(*side))
    covariance = sum((s - s0) * (z - z0) for s, z in side)
    return math.atan(-covariance / sum((s - s0) ** 2 for s, _ in side)), height


if __name__ == "__main__":
    print(*repose(sys.argv[1]))
