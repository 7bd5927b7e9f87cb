"""The layout of ArviZ's InferenceData, read back from its file."""

from __future__ import annotations

from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray as xr

import calib
from calib.inference_data import resample
from conftest import PROGRAMS, impacts

Finished = tuple[calib.Client, str]


@pytest.mark.parametrize("seed", range(20))
def test_a_position_is_drawn_as_often_as_its_weight_says(seed: int) -> None:
    rng = np.random.default_rng(seed)
    weight = rng.exponential(size=30) ** 3
    weight[rng.integers(30, size=10)] = 0
    drawn = np.bincount(resample(weight, 500, rng), minlength=30)
    expected = 500 * weight / weight.sum()
    assert drawn.sum() == 500
    assert (drawn >= np.floor(expected - 1e-9)).all() and (drawn <= np.ceil(expected + 1e-9)).all()


def test_the_groups_of_a_campaign_come_back_from_the_file(finished: Finished, tmp_path: Path) -> None:
    client, campaign = finished
    data = client.to_inference_data(campaign, draws=400, seed=3)
    file = data.to_netcdf(tmp_path / "campaign.nc")
    assert [path.name for path in tmp_path.iterdir()] == ["campaign.nc"]
    with netCDF4.Dataset(file) as raw:
        assert set(raw.groups) == set(data)
    groups = {name: xr.open_dataset(file, group=name) for name in data}
    posterior = client.posterior(campaign)
    samples = client.samples(campaign)
    assert groups["posterior"].sizes["chain"] == 1
    assert groups["posterior"]["young_modulus"].dims == ("chain", "draw")
    assert groups["posterior"]["young_modulus"].attrs["units"] == "Pa"
    for name in posterior.parameters:
        row = posterior.frame.loc[name]
        far = 5 * row["sd"] / np.sqrt(groups["posterior"].sizes["draw"])
        assert abs(float(groups["posterior"][name].mean()) - row["mean"]) < far, name
        assert (groups["weighted_samples"][name].to_numpy() == samples.parameters[name].to_numpy()).all()
    np.testing.assert_array_equal(groups["observed_data"]["tx.q_over_p"], [0.5, 0.8, 1.0])
    np.testing.assert_array_equal(groups["constant_data"]["tx.q_over_p.sd"], [0.3, 0.3, 0.3])
    np.testing.assert_array_equal(groups["constant_data"]["tx.axial_strain"], [0.002, 0.005, 0.01])
    assert groups["prior"]["young_modulus"].shape == (1, 16)
    for group in groups.values():
        assert {"created_at", "creation_library", "inference_library"} <= set(group.attrs)


def test_draws_of_weighted_samples_know_their_runs(tmp_path: Path) -> None:
    with calib.connect(state=tmp_path / "state", programs=PROGRAMS, workers=2) as client:
        campaign = client.submit(impacts(tmp_path, samples=128))
        client.wait(campaign)
        posterior, samples, states = client.posterior(campaign), client.samples(campaign), client.states(campaign)
        data, again, other = (client.to_inference_data(campaign, draws=500, seed=seed) for seed in (3, 3, 4))
    assert posterior.posterior_from == "weights" and posterior.draws is None
    name = "friction_coefficient"
    mean = samples.weight @ samples.parameters[name]
    assert mean == pytest.approx(posterior.frame.loc[name, "mean"], rel=1e-12)
    spread = samples.parameters[name].max() - samples.parameters[name].min()
    assert abs(float(data.posterior[name].mean()) - mean) <= len(samples.frame) / 500 * spread
    runs = data.sample_stats["sample"].to_numpy()[0]
    np.testing.assert_array_equal(data.posterior[name].to_numpy()[0], samples.parameters[name].loc[runs])
    np.testing.assert_array_equal(data.sample_stats["weight"].to_numpy()[0], samples.frame["weight"].loc[runs])
    np.testing.assert_array_equal(data.log_likelihood["all_readings"].to_numpy()[0], samples.frame["log_likelihood"].loc[runs])
    for draw in (0, 499):
        np.testing.assert_array_equal(data.posterior_predictive["wall.rebound_angle"].to_numpy()[0, draw],
                                      states["rebound_angle"].loc["wall", runs[draw]])
    assert again.posterior.equals(data.posterior) and not other.posterior.equals(data.posterior)


def test_a_file_that_cannot_be_written_leaves_nothing(finished: Finished, tmp_path: Path) -> None:
    client, campaign = finished
    with pytest.raises(OSError):
        client.to_inference_data(campaign, draws=10).to_netcdf(tmp_path / "nowhere" / "a.nc")
    assert list(tmp_path.iterdir()) == []
