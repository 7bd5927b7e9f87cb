"""What the service answers, as dictionaries, numpy arrays and pandas frames.

Numbers are SI, as in the JSON of calibctl, with the unit beside them: a column `unit`, or
`frame.attrs["units"]` by column. Stresses in Pa and strains as numbers, both compression positive.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypedDict

import numpy as np
import numpy.typing as npt
import pandas as pd

from calib.v1 import campaign_pb2

Array = npt.NDArray[np.float64]


class Document(dict[str, Any]):
    """A JSON document of calibctl; what its fields mean stands in server/ctl/OUTPUT.md."""

    def frame(self, key: str) -> pd.DataFrame:
        """The list of rows under a key as a frame: `compare(c).frame("by_observable")`."""
        rows = self[key]
        if not isinstance(rows, list):
            raise KeyError(f"'{key}' is no list of rows: {', '.join(k for k, v in self.items() if isinstance(v, list))} are")
        return pd.DataFrame(rows)


class Status(TypedDict):
    """How far a campaign is; the fields of `calibctl show --json`. None: not known, or there is none."""

    campaign: str
    name: str
    state: str  # queued running paused finished failed cancelled
    reason: str  # why paused or failed
    phase: str  # calibrating validating done
    method: str
    iteration: int  # from 0
    max_iterations: int
    samples: int  # of this iteration
    samples_done: int
    samples_running: int
    samples_resting: int
    samples_stopped_early: int
    samples_diverged: int
    samples_unknown: int
    effective_sample_size: float | None
    best_misfit: float | None  # of the best run, rms over readings in sd of the noise
    eta_seconds: float | None  # of this iteration
    model_evaluations: int
    core_hours: float
    converged: bool
    created_unix_ms: int
    owner: str | None
    priority: int  # among its owner's campaigns, the highest first
    parent: str | None
    purpose: str | None
    effects: list[str]
    problem: str | None
    nobody_may_run_it: str | None  # why what waits of it is run by nobody
    server_waits: str | None


def _or_none(value: float, known: bool) -> float | None:
    return value if known and math.isfinite(value) else None


def status_of(s: campaign_pb2.CampaignStatus) -> Status:
    """A message as a dictionary."""
    return Status(
        campaign=s.campaign, name=s.name, state=s.state, reason=s.reason, phase=s.phase, method=s.method,
        iteration=s.iteration, max_iterations=s.max_iterations, samples=s.samples, samples_done=s.samples_done,
        samples_running=s.samples_running, samples_resting=s.samples_resting,
        samples_stopped_early=s.samples_stopped_early, samples_diverged=s.samples_diverged, samples_unknown=s.samples_unknown,
        effective_sample_size=_or_none(s.effective_sample_size, s.effective_sample_size > 0),
        best_misfit=_or_none(s.best_misfit, s.best_misfit > 0),
        eta_seconds=_or_none(s.eta_seconds, s.eta_seconds >= 0),
        model_evaluations=s.model_evaluations, core_hours=s.core_hours, converged=s.converged,
        created_unix_ms=s.created_unix_ms, owner=s.owner or None, priority=s.priority, parent=s.parent or None,
        purpose=s.purpose or None, effects=list(s.effects), problem=s.problem or None,
        nobody_may_run_it=s.nobody_may or None, server_waits=s.server_waits or None)


PARAMETER_COLUMNS = ("mean", "sd", "cov", "q05", "q50", "q95", "unit", "at_bound", "prior_min", "prior_max",
                     "conditioned_on", "split_half")


@dataclasses.dataclass(frozen=True, eq=False)
class Posterior:
    """Parameters after the readings. Shapes: d parameters, n draws.

    `frame`: a row per parameter with its mean, sd, cov (sd over |mean|), q05, q50, q95, unit,
    at_bound, prior_min and prior_max (0.1 % and 99.9 % quantiles of a prior without bounds),
    conditioned_on (held, not inferred) and split_half. NaN: not told, as everything but the means
    where `posterior_from` is "none".
    """

    campaign: str
    iteration: int  # after which this is the posterior, from 0
    iterations: int  # complete
    converged: bool
    posterior_from: str  # weights | tmcmc | emulator | none
    frame: pd.DataFrame
    correlation: pd.DataFrame  # d x d
    draws: pd.DataFrame | None  # n x d, equally weighted; None: the posterior is that of weighted samples
    path: pd.DataFrame  # a row per load step as it was taken in: experiment, load_step, ess, mean.NAME, cov.NAME
    bands: pd.DataFrame  # of the emulator at the readings: experiment, observable, load_step, mean, q05, q95; SI
    scatter: pd.DataFrame  # between packings: experiment, observable, load_step, sd, share, from; SI
    log_evidence: float
    log_evidence_se: float
    ess: float  # effective samples
    pareto_k: float
    sigma: float | None
    noise: str  # given | inferred | ess_target
    noise_scale: pd.DataFrame  # noise inferred: observables, q05, q50, q95 of how much larger the errors are than stated
    predictive_p: float | None
    model_evaluations: int
    core_hours: float
    stopped_early: int
    stated_loss: float  # bound on the posterior mass that stopping early may have lost
    warnings: list[str]
    emulator: dict[str, object] | None

    @property
    def parameters(self) -> list[str]:
        """Names, in the order of rows and columns."""
        return [str(name) for name in self.frame.index]

    @property
    def units(self) -> dict[str, str]:
        """Unit of each parameter."""
        return dict(self.frame["unit"])


def posterior_of(p: campaign_pb2.Posterior) -> Posterior:
    """A message with its arrays in shape."""
    names = [q.name for q in p.parameters]
    d = len(names)
    units = {q.name: q.unit for q in p.parameters}
    frame = pd.DataFrame({column: [getattr(q, column) for q in p.parameters] for column in PARAMETER_COLUMNS},
                         index=pd.Index(names, name="parameter"))
    frame.attrs["units"] = {column: "unit of the row" for column in ("mean", "sd", "q05", "q50", "q95", "prior_min", "prior_max")}
    correlation = np.array(p.correlation).reshape(d, d) if len(p.correlation) == d * d else np.full((d, d), np.nan)
    draws = None
    if len(p.draws) > 0:
        draws = pd.DataFrame(np.array(p.draws).reshape(-1, d), columns=names)
        draws.attrs["units"] = units
    path = pd.DataFrame([{"experiment": point.experiment, "load_step": point.load_step, "ess": point.ess,
                          **{f"mean.{name}": value for name, value in zip(names, point.mean)},
                          **{f"cov.{name}": value for name, value in zip(names, point.cov)}} for point in p.path])
    path.attrs["units"] = {f"mean.{name}": unit for name, unit in units.items()}
    emulator = None
    if p.HasField("emulator"):
        e = p.emulator
        emulator = {"adequate": e.adequate, "reason": e.reason, "runs": e.runs, "components": e.components,
                    "cross_validated_error": e.error, "scatter": e.scatter, "calibration": e.calibration,
                    "unknown": e.unknown, "widened": e.widened}
    return Posterior(
        campaign=p.campaign, iteration=p.iteration, iterations=p.iterations, converged=p.converged,
        posterior_from=p.posterior_from, frame=frame,
        correlation=pd.DataFrame(correlation, index=names, columns=names), draws=draws, path=path,
        bands=_per_reading(p.bands, ("mean", "q05", "q95"), ()),
        scatter=_per_reading(p.scatter, ("sd",), ("share", "from", "correlation_length")),
        log_evidence=p.log_evidence, log_evidence_se=p.log_evidence_se, ess=p.ess, pareto_k=p.pareto_k,
        sigma=p.sigma if p.HasField("sigma") else None, noise=p.noise,
        noise_scale=pd.DataFrame([{"observables": list(s.observables), "q05": s.q05, "q50": s.q50, "q95": s.q95}
                                  for s in p.noise_scale], columns=["observables", "q05", "q50", "q95"]),
        predictive_p=p.predictive_p if p.HasField("predictive_p") else None, model_evaluations=p.model_evaluations,
        core_hours=p.core_hours, stopped_early=p.stopped_early, stated_loss=p.stated_loss, warnings=list(p.warnings),
        emulator=emulator)


def _per_reading(parts: Iterable[Any], at_readings: Sequence[str], of_all: Sequence[str]) -> pd.DataFrame:
    """A row per reading of messages that have lists along load_step."""
    columns = ["experiment", "observable", "load_step", *at_readings, *of_all]
    rows = [[part.experiment, part.observable, step, *(getattr(part, name)[i] for name in at_readings),
             *(getattr(part, name) for name in of_all)]
            for part in parts for i, step in enumerate(part.load_step)]
    return pd.DataFrame(rows, columns=columns)


@dataclasses.dataclass(frozen=True, eq=False)
class Samples:
    """The ensemble of a campaign. Shapes: n samples, d parameters; both frames are indexed by the sample's number."""

    parameters: pd.DataFrame  # n x d, SI; attrs["units"]
    frame: pd.DataFrame  # iteration, status, reason, weight, log_likelihood, attempts, purpose; NaN: none yet

    @property
    def weight(self) -> Array:
        """Of each sample in the posterior, zero where it has none: they sum to one once an iteration is complete."""
        weight: Array = np.nan_to_num(self.frame["weight"].to_numpy(dtype=np.float64), nan=0.0)
        return weight


def samples_of(document: Mapping[str, Any]) -> Samples:
    """The document of `calibctl samples --json` as frames."""
    rows = document["samples"]
    index = pd.Index([row["index"] for row in rows], name="sample", dtype="int64")
    columns = ["iteration", "status", "reason", "weight", "log_likelihood", "attempts", "purpose"]
    units = dict(document["units"])
    parameters = pd.DataFrame([row["parameters"] for row in rows], index=index, columns=list(units), dtype="float64")
    parameters.attrs["units"] = units
    frame = pd.DataFrame([[row[column] for column in columns] for row in rows], index=index, columns=columns)
    return Samples(parameters, frame.astype({"weight": "float64", "log_likelihood": "float64"}))


def states_of(messages: Iterable[campaign_pb2.SampleStates], units: Mapping[str, str]) -> pd.DataFrame:
    """A row per sample, experiment and load step with a column per observable.

    units: of each observable. NaN: no observable of that experiment.
    """
    parts: dict[tuple[int, str], list[pd.DataFrame]] = {}
    for m in messages:
        rows = [[state.load_step, *state.values] for state in m.states]
        parts.setdefault((m.sample, m.experiment), []).append(
            pd.DataFrame(rows, columns=["load_step", *m.observables]))
    if not parts:
        return pd.DataFrame(index=pd.MultiIndex.from_arrays([[], [], []], names=["experiment", "sample", "load_step"]))
    frame = pd.concat([pd.concat(some).assign(sample=sample, experiment=experiment)
                       for (sample, experiment), some in sorted(parts.items(), key=lambda item: (item[0][1], item[0][0]))])
    frame = frame.set_index(["experiment", "sample", "load_step"])
    frame.attrs["units"] = {name: units[name] for name in frame.columns if name in units}
    return frame


def prediction_frame(document: Mapping[str, Any]) -> pd.DataFrame:
    """A row per predicted point of the document of `predict()`.

    Columns: experiment, observable, unit, and the fields of a point: load_step, control, mean, sd,
    q05, q50, q95, sd_parameters, sd_model_error, sd_noise, ..., measured.
    """
    return pd.DataFrame([{"experiment": o["experiment"], "observable": o["observable"], "unit": o["unit"], **point}
                         for o in document["predictions"] for point in o["points"]])
