"""Campaigns from submission to their end, and what is answered about them: the same as calibctl says."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import calib
from conftest import PROGRAMS, READINGS, Daemon, calibctl, place, small_campaign

Finished = tuple[calib.Client, str]


def test_watch_tells_of_a_campaign_to_its_end(tmp_path: Path) -> None:
    with calib.connect(state=tmp_path / "state", programs=PROGRAMS, workers=1) as client:
        campaign = client.submit(small_campaign(tmp_path, samples=6, iterations=1))
        seen = list(client.watch(campaign))
    assert seen[-1]["state"] == "finished" and seen[-1]["samples_done"] == 6
    done = [(status["iteration"], status["samples_done"]) for status in seen]
    assert done == sorted(done)


def test_a_loop_that_is_left_leaves_the_campaign_running(tmp_path: Path) -> None:
    with calib.connect(state=tmp_path / "state", programs=PROGRAMS, workers=1) as client:
        campaign = client.submit(small_campaign(tmp_path, samples=4, iterations=1))
        for _ in client.watch(campaign):
            break
        assert client.wait(campaign)["state"] == "finished"


def test_status_and_list_are_those_of_calibctl(finished: Finished) -> None:
    client, campaign = finished
    shown = calibctl("show", campaign, *place(client))
    status = client.status(campaign)
    assert status == {name: shown[name] for name in status}
    listed = calibctl("list", *place(client))
    frame = client.campaigns()
    assert list(frame.index) == [row["campaign"] for row in listed]
    for name in frame.columns:
        assert [None if value != value else value for value in frame[name]] == [row[name] for row in listed], name


def test_the_posterior_is_that_of_calibctl_and_of_the_weighted_samples(finished: Finished) -> None:
    client, campaign = finished
    said = calibctl("posterior", campaign, *place(client))
    posterior = client.posterior(campaign)
    for name, row in posterior.frame.iterrows():
        for column, value in row.items():
            expected = said["parameters"][name][column]
            assert value == expected or (expected is None and math.isnan(value)), (name, column)
    assert posterior.units == {"young_modulus": "Pa", "friction_coefficient": "1"}
    assert posterior.correlation.to_numpy().tolist() == said["correlation"]
    for name in ("log_evidence", "ess", "posterior_from", "model_evaluations", "warnings", "converged", "emulator"):
        assert getattr(posterior, name) == said[name], name
    assert len(posterior.path) == len(said["path"])
    if posterior.posterior_from == "weights":
        samples = client.samples(campaign)
        mean = samples.weight @ samples.parameters.to_numpy()
        np.testing.assert_allclose(mean, posterior.frame["mean"], rtol=1e-9)


def test_an_earlier_iteration_can_be_asked_for(finished: Finished) -> None:
    client, campaign = finished
    first = client.posterior(campaign, iteration=0)
    assert first.iteration == 0
    assert not first.frame["mean"].equals(client.posterior(campaign).frame["mean"])
    with pytest.raises(calib.BadInput, match="counted from 0"):
        client.posterior(campaign, iteration=-1)


def test_samples_are_in_shape_with_their_units(finished: Finished) -> None:
    client, campaign = finished
    samples = client.samples(campaign)
    assert samples.parameters.shape == (len(samples.frame), 2)
    assert samples.parameters.attrs["units"] == {"young_modulus": "Pa", "friction_coefficient": "1"}
    assert samples.parameters["young_modulus"].between(1e8, 1e9).all()
    assert samples.weight.sum() == pytest.approx(1)
    ensemble = samples.frame[samples.frame["purpose"] == ""]
    assert set(ensemble["iteration"]) == {0, 1}
    assert set(samples.frame["status"]) <= {"finished", "diverged", "stopped_early"}


def test_states_are_those_of_calibctl(finished: Finished) -> None:
    client, campaign = finished
    said = calibctl("states", campaign, "3", *place(client))["experiments"][0]["states"]
    states = client.states(campaign, 3)
    assert states.index.names == ["experiment", "sample", "load_step"]
    assert list(states.index) == [("tx", 3, row["load_step"]) for row in said]
    for name in states.columns:
        assert list(states[name]) == [row[name] for row in said], name
    assert states.attrs["units"]["axial_stress"] == "Pa" and states.attrs["units"]["q_over_p"] == "1"
    everything = client.states(campaign)
    assert everything.xs(3, level="sample").equals(states.xs(3, level="sample"))
    with pytest.raises(calib.NotFound):
        client.states(campaign, 100000)


def test_measurements_are_what_the_file_says(finished: Finished) -> None:
    client, campaign = finished
    experiment = client.measurements(campaign)["experiments"][0]
    rows = [[float(cell) for cell in line.split(",")] for line in READINGS.splitlines()[1:]]
    assert experiment["control_values"] == [row[0] for row in rows]
    assert experiment["observables"][0]["values"] == [row[1] for row in rows]
    assert experiment["observables"][0]["sd"] == [0.3] * 3


def test_the_source_comes_back(finished: Finished, tmp_path: Path) -> None:
    client, campaign = finished
    text, files = client.source(campaign)
    assert text == small_campaign(tmp_path).read_text()
    assert files == {"data.csv": READINGS.encode()}


def test_compare_and_gate(finished: Finished) -> None:
    client, campaign = finished
    comparison = client.compare(campaign)
    assert comparison == calibctl("compare", campaign, *place(client))
    assert list(comparison.frame("by_observable")["observable"]) == ["q_over_p", "volumetric_strain"]
    with pytest.raises(KeyError, match="by_observable"):
        comparison.frame("note")
    gate = client.diagnose(campaign, gate=True)
    assert gate["only_adequacy"] is True and gate["verdict"] in ("adequate", "unexplained")


def test_a_prediction_as_rows(finished: Finished, tmp_path: Path) -> None:
    client, campaign = finished
    (tmp_path / "test.yaml").write_text(
        "name: other\ntest: triaxial_drained\nconfining_pressure: 150 kPa\n"
        "control: {column: axial_strain, to: 0.5 percent, readings: 3}\nobservables: [q_over_p]\n"
        "staging: {rate: 1 1/s, step: 0.005, damping: [0.3, 0.9], unbalanced: 5e-3}\n")
    document = client.predict(campaign, tmp_path / "test.yaml", draws=4, exceed=["q_over_p=0.1"])
    frame = calib.prediction_frame(document)
    assert len(frame) == 3 and set(frame["unit"]) == {"1"}
    assert (frame["q05"] <= frame["q50"]).all() and (frame["q50"] <= frame["q95"]).all()
    assert document["predictions"][0]["exceedance"][0]["level"] == 0.1


def test_simulate_needs_no_server_and_takes_units(finished: Finished, tmp_path: Path) -> None:
    client, _ = finished
    file = small_campaign(tmp_path)
    with_unit = client.simulate(file, {"young_modulus": "300 MPa", "friction_coefficient": 0.5})
    assert with_unit.equals(client.simulate(file, {"young_modulus": 3e8, "friction_coefficient": 0.5}))
    assert list(with_unit.index) == [("tx", 0), ("tx", 1), ("tx", 2)]
    with pytest.raises(calib.BadInput, match="friction_coefficient"):
        client.simulate(file, {"young_modulus": 3e8})


def test_a_campaign_is_paused_resumed_cancelled_and_deleted(tmp_path: Path) -> None:
    with calib.connect(state=tmp_path / "state", programs=PROGRAMS, workers=0) as client:
        campaign = client.submit(small_campaign(tmp_path))
        assert client.submit(small_campaign(tmp_path)) == campaign, "the same file is the same campaign"
        assert client.submit(small_campaign(tmp_path), seed=8) != campaign
        assert client.pause(campaign)["state"] == "paused"
        with pytest.raises(calib.NotNow, match="paused"):
            client.pause(campaign)
        assert client.resume(campaign)["state"] in ("queued", "running")
        assert client.set_priority(campaign, -5)["priority"] == -5
        with pytest.raises(calib.BadInput, match="-100 to 100"):
            client.set_priority(campaign, 101)
        owner = client.status(campaign)["owner"]
        assert client.set_quota(owner, 3)["slots"] == 3
        assert client.shares().loc[owner, ["slots", "campaigns"]].tolist() == [3, 2]
        assert client.set_quota(owner, None)["slots"] is None
        with pytest.raises(calib.NotNow):
            client.posterior(campaign)
        assert client.cancel(campaign)["state"] == "cancelled"
        with pytest.raises(calib.RequestFailed, match=f"{campaign} is cancelled"):
            client.wait(campaign)
        client.delete(campaign)
        with pytest.raises(calib.NotFound):
            client.status(campaign)


def test_what_is_wrong_in_a_file_is_said_line_by_line(finished: Finished, tmp_path: Path) -> None:
    client, _ = finished
    file = small_campaign(tmp_path)
    file.write_text(file.read_text().replace("contact: linear", "contact: linaer").replace("noise: {absolute: 0.3}", "noise: {}"))
    with pytest.raises(calib.BadInput) as refused:
        client.submit(file)
    problems = refused.value.problems
    assert len(problems) >= 2 and all(problem["file"] == str(file) for problem in problems)
    assert problems[0]["line"] == 2 and "linaer" in problems[0]["message"]
    assert str(refused.value).splitlines()[0].startswith(f"{file}:2: ")
    with pytest.raises(calib.BadInput, match="cannot be read"):
        client.submit(tmp_path / "nothing.yaml")


@pytest.mark.parametrize("question", [
    lambda c: c.status("c999"), lambda c: list(c.watch("c999")), lambda c: c.posterior("c999"), lambda c: c.samples("c999"),
    lambda c: c.compare("c999"), lambda c: c.diagnose("c999"), lambda c: c.extend("c999", "viscous_damping"),
    lambda c: c.improve("c999"), lambda c: c.pause("c999"), lambda c: c.delete("c999"), lambda c: c.to_inference_data("c999")])
def test_a_campaign_that_is_not_there_is_not_found(finished: Finished, question: Callable[[calib.Client], object]) -> None:
    with pytest.raises(calib.NotFound, match="c999"):
        question(finished[0])


def test_bad_arguments_are_said(finished: Finished, tmp_path: Path) -> None:
    client, campaign = finished
    with pytest.raises(calib.BadInput, match="needs an effect"):
        client.extend(campaign)
    with pytest.raises(calib.BadInput, match="nothing_of_the_kind"):
        client.extend(campaign, "nothing_of_the_kind")
    with pytest.raises(calib.BadInput, match="two services"):
        calib.connect("127.0.0.1:1", state=tmp_path)
    with pytest.raises(calib.BadInput, match="goes with state"):
        calib.connect("127.0.0.1:1", workers=2)
    with pytest.raises(calib.BadInput, match="is not HOST:PORT"):
        calib.connect("somewhere")
    with pytest.raises(calib.ProgramMissing, match=f"calibd is not in {tmp_path}"):
        calib.connect(state=tmp_path / "state", programs=tmp_path)


def test_nobody_answers() -> None:
    with pytest.raises(calib.Unreachable, match="no server answers at 127.0.0.1:9"):
        calib.connect("127.0.0.1:9")


def test_a_folder_that_is_served_is_shared(finished: Finished) -> None:
    client, campaign = finished
    with calib.connect(state=place(client)[1], programs=PROGRAMS) as guest:
        assert guest.address == client.address
        assert guest.status(campaign) == client.status(campaign)
    assert client.status(campaign)["state"] == "finished", "the guest has not ended the server"


def test_a_server_that_comes_back_is_asked_again(daemon: Callable[..., Daemon], tmp_path: Path) -> None:
    first = daemon("state")
    with calib.connect(state=tmp_path / "state", programs=PROGRAMS) as client:
        campaign = client.submit(small_campaign(tmp_path))
        watching = client.watch(campaign)
        assert next(watching)["state"] in ("queued", "running")
        first.process.send_signal(signal.SIGKILL)
        first.process.wait()
        daemon("state", listen=first.address)
        assert client.status(campaign)["campaign"] == campaign
        client.cancel(campaign)
        assert list(watching)[-1]["state"] == "cancelled"


def test_server_and_workers_end_with_the_process_that_started_them(tmp_path: Path) -> None:
    script = ("import calib, os, signal, sys; c = calib.connect(state=sys.argv[1], programs=sys.argv[2], workers=1); "
              "c.submit(sys.argv[3]); s = c._service; "
              "print(s._server.pid, *(w.pid for w in s._workers), flush=True); os.kill(os.getpid(), signal.SIGKILL)")
    killed = subprocess.run([sys.executable, "-c", script, str(tmp_path / "state"), str(PROGRAMS), str(small_campaign(tmp_path))],
                            capture_output=True, text=True)
    assert killed.returncode == -signal.SIGKILL, killed.stderr
    with calib.connect(state=tmp_path / "state", programs=PROGRAMS, workers=1) as client:  # once the folder is free
        assert client.wait(client.campaigns().index[0])["state"] == "finished"
    for process in killed.stdout.split():
        with pytest.raises(ProcessLookupError):
            os.kill(int(process), 0)
