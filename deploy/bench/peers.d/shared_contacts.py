#!/usr/bin/env python3
"""How many contacts several parameter sets share along a drained triaxial test of one packing: what one list for all of
them, each set in a lane of a vector unit, would have to go through. Needs numpy.

usage: CALIB_DATA=... shared_contacts.py CALIBCTL
Eight friction angles (20 to 40 degrees), packing_1000 at 0.5 MPa, linear contacts with rolling and twisting, 50 stages to
20 %. Prints, for some of the stages, the mean number of contacts and that of the union of four and of eight sets over it.
"""
import base64
import os
import re
import shutil
import struct
import subprocess
import sys
import tempfile

import numpy as np

from side_by_side import TRIAXIAL

ANGLES = (20, 24, 26, 28, 32, 34, 36, 40)  # degrees
STAGES = (0, 2, 4, 9, 14, 24, 36, 49)
TYPES = {"Float64": np.float64, "Int32": np.int32, "Int64": np.int64, "UInt8": np.uint8}


def arrays(path):
    """Of a VTK file in XML, by name."""
    found = {}
    with open(path) as file:
        text = file.read()
    for kind, name, body in re.findall(r'<DataArray type="(\w+)" Name="(\w+)"[^>]*>([^<]*)<', text):
        raw = base64.b64decode(body.strip())
        size = struct.unpack("<Q", raw[:8])[0]
        found[name] = np.frombuffer(raw[8:8 + size], TYPES[kind])
    return found


def contacts(folder, stage):
    """Pairs of grain ids that touch."""
    grains = arrays(f"{folder}/triaxial/grains_{stage:04d}.vtu")
    ends = arrays(f"{folder}/triaxial/contacts_{stage:04d}.vtp")["points"].reshape(-1, 2, 3)
    centres, length = grains["points"].reshape(-1, 3), grains["cell_length"]

    def ids(points):
        apart = points[:, None, :] - centres[None]
        apart -= length * np.round(apart / length)
        return grains["id"][(apart ** 2).sum(-1).argmin(1)]
    return set(map(tuple, np.sort(np.stack([ids(ends[:, 0]), ids(ends[:, 1])], 1), 1).tolist()))


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    with tempfile.TemporaryDirectory(prefix="calib-contacts-") as folder:
        with open(f"{folder}/campaign.yaml", "w") as file:
            file.write(TRIAXIAL)
        shutil.copy(os.path.join(os.environ["CALIB_DATA"], "toyoura_triaxial", "packing_1000.txt"), f"{folder}/packing.txt")
        with open(f"{folder}/triaxial_data.csv", "w") as file:
            print("axial_strain,stress_ratio,volumetric_strain", *(f"{0.004 * k:.3f},3,0" for k in range(1, 51)), sep="\n", file=file)
        for angle in ANGLES:
            subprocess.run([os.path.abspath(sys.argv[1]), "simulate", f"{folder}/campaign.yaml", "--set", f"friction_angle={angle}deg",
                            "-o", f"{folder}/{angle}.csv", "--vtk", f"{folder}/{angle}"], check=True, stderr=subprocess.DEVNULL)
        print("| strain | contacts | union of 4 sets | union of 8 sets |\n|---|---|---|---|")
        for stage in STAGES:
            sets = [contacts(f"{folder}/{angle}", stage) for angle in ANGLES]
            mean = np.mean([len(own) for own in sets])
            fours = np.mean([len(set.union(*sets[part])) for part in (slice(4), slice(4, 8), slice(0, 8, 2), slice(1, 8, 2))])
            print(f"| {0.4 * (stage + 1):.1f} % | {mean:.0f} | {fours / mean:.2f} | {len(set.union(*sets)) / mean:.2f} |")


if __name__ == "__main__":
    main()
