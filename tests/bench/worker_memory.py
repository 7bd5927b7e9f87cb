#!/usr/bin/env python3
"""Largest resident memory of calib-worker while it runs one specimen of 5000 grains, and of the calibctl that started it.

usage: worker_memory.py FOLDER_OF_BINARIES; needs $CALIB_DATA/toyoura_triaxial/packing_5000.txt. Drained triaxial test at 0.5 MPa with
Hertz-Mindlin and rolling resistance to 0.2 %, one thread. Anonymous pages are the process's own; the others are of its program and
shared libraries, and of files. Reads /proc (Linux) every 20 ms.
"""
import os
import re
import subprocess
import sys
import tempfile
import time

CAMPAIGN = """name: memory
model:
  contact: hertz_mindlin
  effects: [rolling_resistance]
  density: 2650000 kg/m^3
  fixed: {{young_modulus: 1 GPa, poisson_ratio: 0.2, rolling_resistance.stiffness_ratio: 0.3, rolling_resistance.friction: 0.1}}
parameters: {{friction_coefficient: {{prior: uniform, min: 0.1, max: 1}}}}
experiments:
  - name: triaxial
    test: triaxial_drained
    confining_pressure: 0.5 MPa
    packing: {{file: {packing}}}
    data: {{file: {data}, strain: logarithmic}}
    control: axial_strain
    staging: {{rate: 0.1 1/s, step: 0.002, damping: [0.2, 0.9], unbalanced: 1e-3}}
    observables: {{stress_ratio: {{noise: {{absolute: 0.1}}}}}}
"""


def status(pid):
    """Peak and present sizes of a process [MiB]; None when it has gone."""
    try:
        with open(f"/proc/{pid}/status") as file:
            return {key: int(value) / 1024 for key, value in re.findall(r"^(VmHWM|RssAnon|RssFile):\s+(\d+) kB", file.read(), re.M)}
    except OSError:
        return None


def children(pid):
    try:
        with open(f"/proc/{pid}/task/{pid}/children") as file:
            return [int(word) for word in file.read().split()]
    except OSError:
        return []


def is_worker(pid):
    try:
        return os.path.basename(os.readlink(f"/proc/{pid}/exe")) == "calib-worker"
    except OSError:
        return False


def main():
    if len(sys.argv) != 2 or "CALIB_DATA" not in os.environ:
        sys.exit(__doc__)
    packing = os.path.join(os.environ["CALIB_DATA"], "toyoura_triaxial", "packing_5000.txt")
    largest = {}
    with tempfile.TemporaryDirectory() as folder:
        campaign, data = os.path.join(folder, "memory.yaml"), os.path.join(folder, "data.csv")
        with open(data, "w") as file:
            print("axial_strain,stress_ratio\n0,1\n0.002,2", file=file)
        with open(campaign, "w") as file:
            file.write(CAMPAIGN.format(packing=packing, data=data))
        run = subprocess.Popen([os.path.join(sys.argv[1], "calibctl"), "simulate", campaign, "--set", "friction_coefficient=0.5"],
                               stdout=subprocess.DEVNULL, env={**os.environ, "OMP_NUM_THREADS": "1"})
        while run.poll() is None:
            for pid in [run.pid] + [pid for pid in children(run.pid) if is_worker(pid)]:
                name = "calibctl" if pid == run.pid else "calib-worker"
                for key, value in (status(pid) or {}).items():
                    largest[name, key] = max(largest.get((name, key), 0), value)
            time.sleep(0.02)
    if run.returncode != 0 or ("calib-worker", "VmHWM") not in largest:
        sys.exit("the run failed")
    for name in ("calib-worker", "calibctl"):
        print(f"{name}: {largest[name, 'VmHWM']:.1f} MiB, of it anonymous {largest[name, 'RssAnon']:.1f} MiB, of files {largest[name, 'RssFile']:.1f} MiB")


if __name__ == "__main__":
    main()
