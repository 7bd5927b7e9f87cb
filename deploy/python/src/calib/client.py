"""`connect()` and the questions that a calibration service answers."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import tempfile
import uuid
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

import pandas as pd

from calib import errors
from calib.access import find_access, is_socket, problem_of_address
from calib.answers import Document, Posterior, Samples, Status, posterior_of, samples_of, states_of, status_of
from calib.channel import Channel
from calib.inference_data import InferenceData, build_inference_data
from calib.programs import Service, announced_address, ask_calibctl, find_program
from calib.v1 import campaign_pb2, common_pb2

DEFAULT_ADDRESS = "127.0.0.1:7443"
OVER = ("finished", "failed", "cancelled")  # states in which nothing goes on

PathLike = str | os.PathLike[str]


def connect(server: str | None = None, *, state: PathLike | None = None, workers: int | None = None,
            tls: PathLike | None = None, token: PathLike | None = None, programs: PathLike | None = None) -> Client:
    """The service at an address, or over a state folder.

    server: HOST:PORT or unix:/PATH [$CALIB_SERVER or 127.0.0.1:7443].
    state: a folder instead, made if need be: the process that serves it is joined; where none does,
    calibd is started over it and ended by `close()`.
    workers: local ones that are started with the first campaign where this process serves the
    folder [one per core].
    tls: folder of a certificate, from `calibctl certs issue` [$CALIB_TLS].
    token: file of the server's token [$CALIB_TOKEN, or where a server of this account leaves it].
    programs: folder of calibctl, calibd and calib-worker [those on the PATH].

    Unreachable, NotTrusted, NotAuthenticated or BadInput where there is no way to it.
    """
    return Client(server, state=state, workers=workers, tls=tls, token=token, programs=programs)


class Client:
    """A service that campaigns are submitted to and that answers about them. Not thread-safe.

    A campaign is named by its id, as `submit()` returns it. Every call may raise the exceptions of
    `calib.errors`: NotFound for an unknown campaign, Unreachable when the server is lost for more
    than a minute, NotAllowed where the caller's role does not do this.
    """

    def __init__(self, server: str | None = None, *, state: PathLike | None = None, workers: int | None = None,
                 tls: PathLike | None = None, token: PathLike | None = None, programs: PathLike | None = None) -> None:
        """As `connect()`."""
        if server is not None and state is not None:
            raise errors.BadInput("server and state name two services: one of them is wanted")
        if workers is not None and (state is None or workers < 0):
            raise errors.BadInput("workers is a number from 0 on and goes with state; workers of a server are calib-worker --server")
        self._state = Path(state).absolute() if state is not None else None
        self._workers = workers
        self._tls = Path(tls).absolute() if tls is not None else None
        self._token = Path(token).absolute() if token is not None else None
        self._programs = Path(programs).absolute() if programs is not None else None
        self._service: Service | None = None
        self._units_of_observables: dict[str, str] | None = None
        if self._state is not None:
            self._channel = self._serve_or_join(self._state)
        else:
            self._channel = self._open(server or os.environ.get("CALIB_SERVER") or DEFAULT_ADDRESS)
        try:
            self.campaigns()  # a refusal is said here
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Client:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Ends the connection and, where they were started here, workers and server; nothing that was computed is lost."""
        self._channel.close()
        if self._service is not None:
            self._service.close()
            self._service = None

    @property
    def address(self) -> str:
        """Of the server: HOST:PORT or unix:/PATH."""
        return self._channel.address

    # Where the server is, and calibctl.

    def _open(self, address: str) -> Channel:
        if problem := problem_of_address(address):
            raise errors.BadInput(problem)
        token, own = self._token, False
        if self._state is not None and token is None and self._tls is None and (self._state / "token").exists():
            token, own = self._state / "token", not is_socket(address)
        return Channel(address, lambda: find_access(address, self._tls, token, own=own))

    def _serve_or_join(self, state: Path) -> Channel:
        with contextlib.suppress(errors.Unreachable):
            if (address := announced_address(state)) is not None:
                return self._open(address)
        try:
            self._service = Service(state, self._programs)
        except errors.Conflict:
            address = announced_address(state)  # somebody was quicker
            if address is None:
                raise
            return self._open(address)
        try:
            return self._open(self._service.address)
        except BaseException:
            self._service.close()
            raise

    def _place(self) -> list[str | os.PathLike[str]]:
        place: list[str | os.PathLike[str]] = ["--server", self.address] if self._state is None else ["--state", self._state]
        if self._tls is not None:
            place += ["--tls", self._tls]
        if self._token is not None:
            place += ["--token", self._token]
        return place

    def _calibctl(self, *arguments: str | os.PathLike[str]) -> Any:
        return ask_calibctl(find_program("calibctl", self._programs), [*arguments, *self._place()])

    def _about(self, verb: str, campaign: str, *arguments: str | os.PathLike[str], runs: bool = False) -> Document:
        """A verb of calibctl about a campaign, which is there. runs: it has something to be run."""
        self.status(campaign)
        if runs:
            self._need_workers()
        return Document(self._calibctl(verb, campaign, *arguments))

    def _need_workers(self) -> None:
        if self._service is not None and self._service.workers == 0:
            self._service.start_workers(self._workers if self._workers is not None else os.cpu_count() or 1)

    # Campaigns.

    def validate(self, file: PathLike) -> Document:
        """Everything that `submit()` checks, without a campaign: `warnings`, `notes`. BadInput with its problems."""
        return Document(self._calibctl("validate", file))

    def simulate(self, file: PathLike, values: Mapping[str, str | float]) -> pd.DataFrame:
        """One model evaluation of each experiment of a campaign file, on this machine and without the server.

        values: of every calibrated parameter, as text with a unit ("0.2 GPa") or as a number in SI.
        Returns a row per experiment and load step with every observable of its test, SI, units in
        `attrs["units"]`. RequestFailed: the model diverged.
        """
        words = [word for name, value in values.items() for word in ("--set", f"{name}={value}")]
        document = ask_calibctl(find_program("calibctl", self._programs), ["simulate", file, *words])
        frame = pd.DataFrame(document["states"]).set_index(["experiment", "load_step"])
        units = self._observable_units()
        frame.attrs["units"] = {name: units[name] for name in frame.columns if name in units}
        return frame

    def submit(self, file: PathLike, *, seed: int | None = None) -> str:
        """Submits a campaign file and returns the id of its campaign.

        The same file with the same files again is the same campaign. seed: replaces the file's.
        BadInput: the file is refused; `problems` has file, line, key and sentence of each.
        """
        arguments: list[str | os.PathLike[str]] = ["submit", file]
        if seed is not None:
            arguments += ["--seed", str(seed)]
        status = self._calibctl(*arguments)
        self._need_workers()
        return str(status["campaign"])

    def campaigns(self) -> pd.DataFrame:
        """All campaigns, one row each, indexed by id; columns are the fields of Status."""
        reply = self._channel.ask("List", campaign_pb2.ListRequest(), campaign_pb2.ListReply)
        columns = [name for name in Status.__annotations__ if name != "campaign"]
        rows = [status_of(one) for one in reply.campaigns]
        index = pd.Index([row["campaign"] for row in rows], name="campaign", dtype="object")
        return pd.DataFrame([{name: row.get(name) for name in columns} for row in rows], index=index, columns=columns)

    def status(self, campaign: str) -> Status:
        """How far a campaign is."""
        request = campaign_pb2.CampaignRequest(campaign=campaign)
        return status_of(self._channel.ask("Show", request, campaign_pb2.CampaignStatus))

    def watch(self, campaign: str) -> Iterator[Status]:
        """One status at once, then one whenever something changed (at most two a second), until the campaign has ended.

        Breaking off the loop ends the watching, not the campaign.
        """
        self.status(campaign)
        self._need_workers()
        request = campaign_pb2.CampaignRequest(campaign=campaign)
        for message in self._channel.follow("Watch", request, campaign_pb2.CampaignStatus):
            yield status_of(message)

    def wait(self, campaign: str) -> Status:
        """The status of a campaign once it has ended. RequestFailed, with the reason: it has not finished."""
        last = self.status(campaign)
        for last in self.watch(campaign):
            pass
        if last["state"] != "finished":
            raise errors.RequestFailed(f"{campaign} is {last['state']}" + (f": {last['reason']}" if last["reason"] else ""))
        return last

    def _control(self, method: str, campaign: str) -> Status:
        request = campaign_pb2.ControlRequest(campaign=campaign, request_id=uuid.uuid4().hex)
        return status_of(self._channel.ask(method, request, campaign_pb2.CampaignStatus))

    def pause(self, campaign: str) -> Status:
        """Starts nothing more; what runs is finished. NotNow: it is over, or paused."""
        return self._control("Pause", campaign)

    def resume(self, campaign: str) -> Status:
        """Goes on with a paused or failed campaign. NotNow: it is neither."""
        status = self._control("Resume", campaign)
        self._need_workers()
        return status

    def cancel(self, campaign: str) -> Status:
        """Ends a campaign for good; what was computed stays. NotNow: it is over."""
        return self._control("Cancel", campaign)

    def set_priority(self, campaign: str, priority: int) -> Status:
        """Of an owner's campaigns the highest is run first, -100 to 100; 0 is that of every new one."""
        if not -100 <= priority <= 100:
            raise errors.BadInput(f"priority {priority}: allowed is -100 to 100")
        request = campaign_pb2.PriorityRequest(campaign=campaign, request_id=uuid.uuid4().hex, priority=priority)
        return status_of(self._channel.ask("SetPriority", request, campaign_pb2.CampaignStatus))

    def shares(self) -> pd.DataFrame:
        """Who has campaigns that are not over, holds slots or has a quota: slots (the quota), held, campaigns, by owner."""
        rows = self._calibctl("quota")
        index = pd.Index([row["owner"] for row in rows], name="owner", dtype="object")
        return pd.DataFrame(rows, index=index, columns=["slots", "held", "campaigns"])

    def set_quota(self, owner: str, slots: int | None) -> Document:
        """slots: that the owner's runs hold at most, 0 none at all, None no bound. Takes the role of an operator."""
        return Document(self._calibctl("quota", owner, "--slots", "none" if slots is None else str(slots)))

    def delete(self, campaign: str) -> Document:
        """Removes a campaign that is over, with all that was derived from it: `deleted`, `campaigns`."""
        return self._about("delete", campaign)

    # What is known of a campaign.

    def posterior(self, campaign: str, *, iteration: int | None = None) -> Posterior:
        """The identified parameters. iteration: as known after that one, from 0 [the last]. NotNow: none is complete."""
        request = campaign_pb2.PosteriorRequest(campaign=campaign)
        if iteration is not None:
            if iteration < 0:
                raise errors.BadInput(f"iteration {iteration}: iterations are counted from 0")
            request.iteration = iteration
        return posterior_of(self._channel.ask("GetPosterior", request, campaign_pb2.Posterior))

    def samples(self, campaign: str) -> Samples:
        """The ensemble with weights and status."""
        return samples_of(self._about("samples", campaign))

    def states(self, campaign: str, sample: int | None = None) -> pd.DataFrame:
        """The state histories of one sample, or of all.

        Rows by (experiment, sample, load_step), a column per observable, SI, units in
        `attrs["units"]`. NotFound: no such sample.
        """
        request = campaign_pb2.StatesRequest(campaign=campaign)
        if sample is not None:
            if sample < 0:
                raise errors.BadInput(f"sample {sample}: samples are counted from 0")
            request.sample = sample
        messages = self._channel.collect("GetStates", request, campaign_pb2.SampleStates)
        return states_of(messages, self._observable_units())

    def _observable_units(self) -> dict[str, str]:
        if self._units_of_observables is None:
            tests = self._calibctl("tests")
            self._units_of_observables = {o["name"]: o["unit"] for test in tests for o in test["observable_details"]}
        return self._units_of_observables

    def measurements(self, campaign: str) -> Document:
        """The readings as they are compared: SI, logarithmic strains, standard deviations.

        `experiments`: `experiment, test, role, control, control_values, observables` (`name, values, sd`).
        """
        self.status(campaign)
        with tempfile.TemporaryDirectory(prefix="calib-") as folder:
            self._calibctl("export", campaign, "-o", folder)
            return Document(json.loads((Path(folder) / "data.json").read_text(encoding="utf-8")))

    def workers(self) -> pd.DataFrame:
        """Workers that the server knows, indexed by name: slots, busy, contact_updates_per_second, connected, ..."""
        rows = self._calibctl("workers")
        return pd.DataFrame(rows, index=pd.Index([row["name"] for row in rows], name="name", dtype="object"))

    def source(self, campaign: str) -> tuple[str, dict[str, bytes]]:
        """What was submitted: the text of the campaign file, and the files by the paths that it names them by."""
        request = campaign_pb2.CampaignRequest(campaign=campaign)
        source = self._channel.ask("GetSource", request, campaign_pb2.CampaignSource)
        return source.campaign_file, {path: self._blob(digest) for path, digest in source.files.items()}

    def _blob(self, digest: str) -> bytes:
        chunks = self._channel.collect("GetBlob", campaign_pb2.BlobByDigest(digest=digest), common_pb2.BlobChunk)
        content = b"".join(chunk.data for chunk in chunks)
        if hashlib.sha256(content).hexdigest() != digest:
            raise errors.Damaged(f"what the server has sent for {digest} is something else")
        return content

    # Where it fails, why, and what then.

    def compare(self, campaign: str) -> Document:
        """Model against measurements: `rms_error`, `p_value`, `by_observable`, `by_segment`, `parameter_drift`, ..."""
        return self._about("compare", campaign)

    def models(self, *campaigns: str) -> pd.DataFrame:
        """Campaigns on the same data by evidence: log_evidence, probability, bayes_factor, ... indexed by campaign."""
        for campaign in campaigns:
            self.status(campaign)
        frame = Document(self._calibctl("models", *campaigns)).frame("models")
        return frame.set_index("campaign")

    def sensitivity(self, campaign: str) -> Document:
        """Sobol indices and correlations of each quantity with each parameter: `quantities`."""
        return self._about("sensitivity", campaign)

    def diagnose(self, campaign: str, *, gate: bool = False, without: Sequence[str] = (), plan: bool = True,
                 then: PathLike | None = None) -> Document:
        """Which physical effect is missing: `verdict`, `probabilities`, `candidates`, `next_experiment`, ...

        Returns when the runs that it needs are done; asked again it goes on from them. gate: only
        whether the model is adequate, without a run. without: effects that are not to be thought
        of. plan: propose the next experiment, which takes runs of its own. then: a file with the
        proposed measurement. NotNow or RequestFailed: the campaign is not a finished calibration.
        """
        arguments: list[str | os.PathLike[str]] = []
        for effect in without:
            arguments += ["--without", effect]
        if gate:
            arguments.append("--gate")
        if not plan:
            arguments.append("--no-plan")
        if then is not None:
            arguments += ["--then", then]
        return self._about("diagnose", campaign, *arguments, runs=not gate)

    def extend(self, campaign: str, *effects: str) -> Document:
        """A new campaign, this one joined by effects and started from its posterior; returns its posterior when it is done."""
        if not effects:
            raise errors.BadInput("extend needs an effect, as `calibctl effects` names them")
        return self._about("extend", campaign, *(word for effect in effects for word in ("--effect", effect)), runs=True)

    def improve(self, campaign: str, *, max_effects: int = 3, without: Sequence[str] = ()) -> Document:
        """Compare, diagnose, extend until the misfit is explained or nothing helps: `steps`, `verdict`, `final_campaign`."""
        arguments = ["--max-effects", str(max_effects)]
        for effect in without:
            arguments += ["--without", effect]
        return self._about("improve", campaign, *arguments, runs=True)

    def predict(self, campaign: str, test: PathLike, *, draws: int = 20, exceed: Sequence[str] = ()) -> Document:
        """The posterior propagated to the tests of a YAML file: `predictions` with mean, band and parts at each point.

        draws: runs from the posterior, 2 to 400. exceed: levels as "stress_ratio=3.5", with a unit
        where the observable has one. `prediction_frame()` makes rows of the answer.
        """
        arguments: list[str | os.PathLike[str]] = ["--test", test, "--draws", str(draws)]
        for level in exceed:
            arguments += ["--exceed", level]
        return self._about("predict", campaign, *arguments, runs=True)

    def report(self, campaign: str, file: PathLike) -> Path:
        """Writes one self-contained HTML file with plots."""
        self._about("report", campaign, "-o", file)
        return Path(file)

    # For other programs.

    def vtk(self, campaign: str, sample: int, folder: PathLike, *, load_step: int | None = None) -> Document:
        """Writes grains, contacts and cell of a sample for ParaView, its runs made again on this machine: `written`."""
        arguments: list[str | os.PathLike[str]] = [str(sample), "-o", folder]
        if load_step is not None:
            arguments += ["--load-step", str(load_step)]
        return self._about("vtk", campaign, *arguments)

    def to_inference_data(self, campaign: str, *, draws: int = 2000, seed: int = 1) -> InferenceData:
        """The campaign in ArviZ's InferenceData layout; see `calib.inference_data`.

        draws, seed: of the systematic resampling that makes unweighted draws of weighted samples.
        NotNow: no iteration is complete yet, or the posterior has no draws.
        """
        posterior = self.posterior(campaign)
        return build_inference_data(
            status=self.status(campaign), posterior=posterior, samples=self.samples(campaign), states=self.states(campaign),
            measurements=self.measurements(campaign), observable_units=self._observable_units(), draws=draws, seed=seed)

