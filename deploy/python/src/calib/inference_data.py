"""A campaign in the layout of ArviZ's InferenceData, as netCDF groups that `arviz.from_netcdf` opens.

    posterior             (chain, draw): every parameter
    posterior_predictive  (chain, draw, EXPERIMENT.reading): the model at the readings; of weighted samples only
    log_likelihood        (chain, draw): joint, of all fitted readings together; of weighted samples only
    sample_stats          (chain, draw): `sample`, the run that a draw is, and its `weight`; of weighted samples only
    prior                 (chain, draw): the samples of the first iteration, where those were drawn from the prior
    observed_data         (EXPERIMENT.reading): EXPERIMENT.OBSERVABLE
    constant_data         (EXPERIMENT.reading): EXPERIMENT.OBSERVABLE.sd, and EXPERIMENT.CONTROL
    weighted_samples      (sample): the ensemble itself, with `weight`, `log_likelihood` and `status` in names with a leading _

There is one chain. Draws are unweighted: of the emulator or of chains as they are, of weighted
samples by systematic resampling [Kitagawa 1996], in random order. Everything is SI, the unit in
the attribute `units` of each variable, as the layout asks for [python.arviz.org, InferenceData
schema specification].
"""

from __future__ import annotations

import datetime
import importlib.metadata
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from calib.answers import Array, Posterior, Samples, Status
from calib.errors import NotNow


class InferenceData(Mapping[str, xr.Dataset]):
    """Groups by name; also attributes: `data.posterior` is `data["posterior"]`."""

    def __init__(self, groups: Mapping[str, xr.Dataset]) -> None:
        self._groups = dict(groups)

    def __getitem__(self, group: str) -> xr.Dataset:
        return self._groups[group]

    def __getattr__(self, group: str) -> xr.Dataset:
        try:
            return self.__dict__["_groups"][group]  # type: ignore[no-any-return]
        except KeyError:
            raise AttributeError(f"no group {group}; there are {', '.join(self.__dict__.get('_groups', ()))}") from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._groups)

    def __len__(self) -> int:
        return len(self._groups)

    def to_netcdf(self, file: str | os.PathLike[str]) -> Path:
        """Writes a netCDF4 file with a group per dataset; it is there as a whole or as it was before."""
        path = Path(file)
        part = path.with_name(f"{path.name}.{os.getpid()}.part")
        try:
            mode: Any = "w"
            for name, dataset in self._groups.items():
                dataset.to_netcdf(part, mode=mode, group=name, engine="netcdf4")
                mode = "a"
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)
        return path


def resample(weight: Array, draws: int, rng: np.random.Generator) -> np.ndarray[Any, np.dtype[np.int64]]:
    """Positions of `draws` equally weighted draws from weights that sum to a positive number.

    Systematic: position i is drawn floor or ceil of draws * weight[i] / sum times. In random order.
    """
    ends = np.cumsum(weight)
    places = (rng.random() + np.arange(draws)) / draws * ends[-1]
    return rng.permutation(np.minimum(np.searchsorted(ends, places, side="right"), np.flatnonzero(weight)[-1]))


def _attributes(status: Status) -> dict[str, str]:
    version = importlib.metadata.version("calib")
    return {"created_at": datetime.datetime.now(datetime.timezone.utc).isoformat(), "creation_library": "calib",
            "creation_library_version": version, "creation_library_language": "Python", "inference_library": "calib",
            "inference_library_version": version, "campaign": status["campaign"], "model": status["name"],
            "method": status["method"]}


def _drawn(frame: pd.DataFrame) -> dict[str, xr.DataArray]:
    """Rows as draws of one chain."""
    units = frame.attrs.get("units", {})
    return {str(name): xr.DataArray(frame[name].to_numpy()[np.newaxis], dims=("chain", "draw"),
                                    attrs={"units": units[name]} if name in units else {})
            for name in frame.columns}


def _with_draws(variables: Mapping[str, xr.DataArray], draws: int) -> xr.Dataset:
    return xr.Dataset(dict(variables), coords={"chain": np.arange(1), "draw": np.arange(draws)})


def _readings(measurements: Mapping[str, Any], units: Mapping[str, str]) -> tuple[xr.Dataset, xr.Dataset]:
    """observed_data and constant_data."""
    observed: dict[str, xr.DataArray] = {}
    constant: dict[str, xr.DataArray] = {}
    for experiment in measurements["experiments"]:
        name = experiment["experiment"]
        dims = (f"{name}.reading",)
        coords = {dims[0]: np.arange(len(experiment["control_values"]))}

        def array(values: Any, of: str) -> xr.DataArray:
            return xr.DataArray(np.array(values, dtype=np.float64), dims=dims, coords=coords,
                                attrs={"units": units[of]} if of in units else {})

        constant[f"{name}.{experiment['control']}"] = array(experiment["control_values"], experiment["control"])
        for o in experiment["observables"]:
            observed[f"{name}.{o['name']}"] = array(o["values"], o["name"])
            constant[f"{name}.{o['name']}.sd"] = array(o["sd"], o["name"])
    return xr.Dataset(observed), xr.Dataset(constant)


def _predictive(observed: xr.Dataset, states: pd.DataFrame, runs: np.ndarray[Any, np.dtype[np.int64]]) -> xr.Dataset:
    """The states of the runs at the readings; NaN where a run has none. runs: number of the sample of each draw."""
    variables: dict[str, xr.DataArray] = {}
    some = np.unique(runs)
    for name, data in observed.data_vars.items():
        experiment, _, observable = str(name).rpartition(".")
        of_experiment = states.xs(experiment, level="experiment")[observable].unstack("load_step")
        table = of_experiment.reindex(index=some, columns=np.arange(data.size)).to_numpy(dtype=np.float64)
        variables[str(name)] = xr.DataArray(table[np.searchsorted(some, runs)][np.newaxis],
                                            dims=("chain", "draw", *data.dims), attrs=data.attrs,
                                            coords={data.dims[0]: np.arange(data.size)})
    return _with_draws(variables, len(runs))


def build_inference_data(*, status: Status, posterior: Posterior, samples: Samples, states: pd.DataFrame,
                         measurements: Mapping[str, Any], observable_units: Mapping[str, str], draws: int,
                         seed: int) -> InferenceData:
    """The groups of a campaign; draws and seed of the resampling. NotNow: its posterior has no draws."""
    if draws < 1:
        raise ValueError(f"draws = {draws}: at least one is wanted")
    observed, constant = _readings(measurements, observable_units)
    groups: dict[str, xr.Dataset] = {}
    if posterior.draws is not None:
        groups["posterior"] = _with_draws(_drawn(posterior.draws), len(posterior.draws))
    elif posterior.posterior_from == "weights":
        chosen = resample(samples.weight, draws, np.random.default_rng(seed))
        runs = samples.frame.index.to_numpy(dtype=np.int64)[chosen]
        picked = samples.parameters.iloc[chosen]
        picked.attrs = samples.parameters.attrs
        groups["posterior"] = _with_draws(_drawn(picked), draws)
        groups["posterior_predictive"] = _predictive(observed, states, runs)
        of_runs = samples.frame.iloc[chosen]
        groups["log_likelihood"] = _with_draws({"all_readings": xr.DataArray(
            of_runs["log_likelihood"].to_numpy()[np.newaxis], dims=("chain", "draw"),
            attrs={"description": "joint log-likelihood of all fitted readings"})}, draws)
        groups["sample_stats"] = _with_draws({
            "sample": xr.DataArray(runs[np.newaxis], dims=("chain", "draw")),
            "weight": xr.DataArray(of_runs["weight"].to_numpy()[np.newaxis], dims=("chain", "draw"))}, draws)
        groups["posterior"].attrs["resampling"] = f"systematic, seed {seed}, {len(np.unique(runs))} distinct samples"
    else:
        raise NotNow(f"the posterior of {status['campaign']} has no draws: neither its weighted samples nor an emulator suffice")
    first = samples.parameters[(samples.frame["iteration"] == 0) & (samples.frame["purpose"] == "")]
    first.attrs = samples.parameters.attrs
    if status["parent"] is None and len(first) > 0:
        groups["prior"] = _with_draws(_drawn(first), len(first))
    groups["observed_data"] = observed
    groups["constant_data"] = constant
    units = samples.parameters.attrs["units"]
    groups["weighted_samples"] = xr.Dataset(
        {str(name): ("sample", samples.parameters[name].to_numpy(), {"units": units[name]}) for name in samples.parameters}
        | {f"_{name}": ("sample", samples.frame[name].to_numpy()) for name in ("weight", "log_likelihood")}
        | {"_status": ("sample", samples.frame["status"].to_numpy(dtype=str))},
        coords={"sample": samples.frame.index.to_numpy(dtype=np.int64)})
    for dataset in groups.values():
        dataset.attrs.update(_attributes(status))
    return InferenceData(groups)
