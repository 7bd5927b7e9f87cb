"""The worked example of the client."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import xarray as xr

from conftest import PROGRAMS


def test_the_example_finds_what_its_truth_has(tmp_path: Path) -> None:
    environment = {**os.environ, "PATH": f"{PROGRAMS}:{os.environ['PATH']}"}
    example = Path(os.environ["CALIB_SOURCE"]) / "deploy" / "python" / "example.py"
    ran = subprocess.run([sys.executable, example, tmp_path], capture_output=True, text=True, env=environment)
    assert ran.returncode == 0, ran.stderr
    before, after = (float(number) for number in re.findall(r"^error ([0-9.]+) sd", ran.stdout, re.MULTILINE))
    assert before > 4 and after < 1.3, ran.stdout
    data = xr.open_dataset(tmp_path / "impacts.nc", group="posterior")
    ratio = data["viscous_damping.ratio"].to_numpy()
    assert np.quantile(ratio, 0.005) < 0.05 < np.quantile(ratio, 0.995), "the dashpot of the truth"
