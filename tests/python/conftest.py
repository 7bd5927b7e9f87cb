"""Servers and campaigns that several files of tests share: real processes, each in a folder of its own."""

from __future__ import annotations

import json
import os
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import calib

PROGRAMS = Path(os.environ["CALIB_PROGRAMS"])
START = 20.0  # s for a server to answer

SMALL = """name: small
model: {{contact: linear, density: 2650000 kg/m^3, fixed: {{poisson_ratio: 0.3}}}}
parameters:
  young_modulus: {{prior: log_uniform, min: 1e8 Pa, max: 1e9 Pa}}
  friction_coefficient: {{prior: uniform, min: 0.2, max: 0.8}}
experiments:
  - name: tx
    test: triaxial_drained
    confining_pressure: 100 kPa
    packing: {{generate: {{particles: 64, porosity: 0.42, radii: {{mean: 1 mm, spread: 0.2}}, seed: 3}}}}
    data: {{file: data.csv, strain: logarithmic}}
    control: axial_strain
    staging: {{rate: 1 1/s, step: 0.005, damping: [0.3, 0.9], unbalanced: 5e-3}}
    observables: {{q_over_p: {{noise: {{absolute: 0.3}}}}, volumetric_strain: {{noise: {{absolute: 0.002}}}}}}
inference: {{method: iterative_bayesian_filter, samples: {samples}, max_iterations: {iterations}}}
seed: {seed}
"""
IMPACTS = """name: impacts
model: {{contact: hertz_mindlin, density: 2500 kg/m^3, fixed: {{poisson_ratio: 0.3, young_modulus: 1 GPa}}}}
parameters:
  friction_coefficient: {{prior: uniform, min: 0.05, max: 1}}
experiments:
  - name: wall
    test: collision
    radius: 10 mm
    impact_speed: 1 m/s
    data: {{file: wall.csv}}
    control: impact_angle
    observables: {{rebound_angle: {{noise: {{absolute: 0.1}}}}}}
inference: {{method: iterative_bayesian_filter, samples: {samples}, max_iterations: 1}}
seed: 1
"""
READINGS = "axial_strain,q_over_p,volumetric_strain\n0.002,0.5,0.0008\n0.005,0.8,0.0012\n0.01,1.0,0.001\n"


def small_campaign(folder: Path, *, samples: int = 16, iterations: int = 2, seed: int = 7) -> Path:
    """A drained triaxial test on 64 grains, a fraction of a second a run."""
    (folder / "data.csv").write_text(READINGS)
    file = folder / f"small-{samples}-{iterations}-{seed}.yaml"
    file.write_text(SMALL.format(samples=samples, iterations=iterations, seed=seed))
    return file


def impacts(folder: Path, *, samples: int = 8) -> Path:
    """A sphere that hits a wall, milliseconds a run; its rebounds tell little of the one parameter."""
    (folder / "wall.csv").write_text("impact_angle,rebound_angle\n0.3,0.2\n0.6,0.4\n")
    file = folder / "impacts.yaml"
    file.write_text(IMPACTS.format(samples=samples))
    return file


def calibctl(*arguments: str | Path) -> Any:
    """The document that calibctl prints."""
    answer = subprocess.run([PROGRAMS / "calibctl", *arguments, "--json"], capture_output=True, text=True)
    assert answer.returncode == 0, answer
    return json.loads(answer.stdout)


def place(client: calib.Client) -> list[str | Path]:
    """Options by which calibctl asks the server of a client that was made for a state folder."""
    assert client._state is not None
    return ["--state", client._state]


class Daemon:
    """calibd as an administrator starts it."""

    def __init__(self, state: Path, *options: str | Path, listen: str = "127.0.0.1:0") -> None:
        self.state = state
        environment = {name: value for name, value in os.environ.items() if name not in ("CALIB_TLS", "CALIB_TOKEN")}
        self.process = subprocess.Popen(
            [PROGRAMS / "calibd", "--state", state, "--listen", listen, "--log", state.with_suffix(".log"), *options],
            env=environment)
        until = time.monotonic() + START
        while True:
            try:
                announced = json.loads((state / "server.json").read_text())
                if announced["pid"] == self.process.pid:
                    break
            except (OSError, ValueError):
                pass
            assert self.process.poll() is None and time.monotonic() < until, state.with_suffix(".log").read_text()
            time.sleep(0.01)
        self.address = str(announced["address"])

    def stop(self) -> None:
        if self.process.poll() is None:
            self.process.terminate()
        self.process.wait(START)


@pytest.fixture(autouse=True)
def account(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A home of its own, in which servers leave tokens; nothing of the environment of the account that runs the tests."""
    home = tmp_path_factory.mktemp("home")
    monkeypatch.setenv("HOME", str(home))
    for name in ("XDG_RUNTIME_DIR", "CALIB_TLS", "CALIB_TOKEN", "CALIB_SERVER"):
        monkeypatch.delenv(name, raising=False)
    return home


@pytest.fixture
def daemon(tmp_path: Path) -> Iterator[Callable[..., Daemon]]:
    """Starts servers that end with the test."""
    started: list[Daemon] = []

    def start(name: str, *options: str | Path, listen: str = "127.0.0.1:0") -> Daemon:
        started.append(Daemon(tmp_path / name, *options, listen=listen))
        return started[-1]

    yield start
    for one in started:
        one.stop()


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[calib.Client, str]]:
    """A client over a state folder with a finished calibration, and its id."""
    folder = tmp_path_factory.mktemp("finished")
    with calib.connect(state=folder / "state", programs=PROGRAMS, workers=2) as client:
        campaign = client.submit(small_campaign(folder))
        client.wait(campaign)
        yield client, campaign
