"""The programs of calib as child processes: `calibctl --json` for what the service does not answer itself, and a server
over a state folder."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import signal
import subprocess
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from calib import errors

BAD_INPUT = 2  # exit codes of calibctl [server/ctl/OUTPUT.md]
UNREACHABLE = 3
START = 20.0  # s until calibd has said where it listens
END = 15.0  # s for a program to end in order
BETWEEN_LOOKS = 0.02  # s


def find_program(name: str, folder: Path | None) -> str:
    """The path of calibctl, calibd or calib-worker: in the folder, else on the PATH. ProgramMissing."""
    found = shutil.which(name, path=str(folder) if folder is not None else None)
    if found is None:
        where = f"in {folder}" if folder is not None else "on the PATH"
        raise errors.ProgramMissing(f"{name} is not {where}; programs names the folder that holds it")
    return found


def end(process: subprocess.Popen[Any]) -> None:
    """Asks a child to end, and ends it when it does not."""
    if process.poll() is not None:
        return
    process.send_signal(signal.SIGTERM)
    try:
        process.wait(END)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _last_line(text: str) -> str:
    lines = [line for line in text.splitlines() if line.strip()]
    return lines[-1] if lines else ""


def _refused(answer: Any, said: str) -> errors.BadInput:
    problems: list[errors.Problem] = answer.get("problems", []) if isinstance(answer, dict) else []
    lines = [": ".join([f"{p['file']}:{p['line']}" if p["line"] else p["file"], *filter(None, [p["key"]]), p["message"]])
             for p in problems]
    return errors.BadInput("\n".join(lines) or said.removeprefix("calibctl: "), problems)


def ask_calibctl(program: str, arguments: Sequence[str | os.PathLike[str]]) -> Any:
    """The JSON document that calibctl prints. The environment and the working folder are this process's.

    Errors: BadInput (exit code 2), Unreachable (3), RequestFailed (1), with what it says. An
    interrupt of this process asks it to end in order: nothing that was computed is lost.
    """
    with subprocess.Popen([program, *arguments, "--json"], stdin=subprocess.DEVNULL,
                          stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, encoding="utf-8") as process:
        try:
            out, said = process.communicate()
        except BaseException:
            end(process)
            raise
    try:
        answer = json.loads(out) if out else None
    except json.JSONDecodeError:
        answer = None
    if process.returncode == 0 and answer is not None:
        return answer
    if process.returncode == BAD_INPUT:
        raise _refused(answer, said.strip())
    sentence = _last_line(said).removeprefix("calibctl: ") or f"calibctl ended with status {process.returncode}"
    raise (errors.Unreachable if process.returncode == UNREACHABLE else errors.RequestFailed)(sentence)


def announced_address(state: Path) -> str | None:
    """Where a server of the folder has said that it listens; it may have ended since."""
    try:
        announced = json.loads((state / "server.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    address = announced.get("address") if isinstance(announced, dict) else None
    return address if isinstance(address, str) and address else None


class Service:
    """calibd over a state folder, and its workers, as children of this process."""

    def __init__(self, state: Path, folder: Path | None) -> None:
        """Starts calibd on a socket that this account alone reaches. Conflict, with its sentence: another process serves the folder."""
        self._state = state
        self._folder = folder
        self._workers: list[subprocess.Popen[bytes]] = []
        program = find_program("calibd", folder)
        environment = {name: value for name, value in os.environ.items() if name != "CALIB_TLS"}
        self._server = subprocess.Popen(
            [program, "--state", state, "--listen", "unix:", "--log", state / "server.log", "--exit-with-parent",
             str(os.getpid())],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, env=environment)
        self.address = self._wait_for_address()

    def _wait_for_address(self) -> str:
        until = time.monotonic() + START
        while time.monotonic() < until:
            if self._server.poll() is not None:
                said = self._server.stderr.read().decode("utf-8", "replace") if self._server.stderr else ""
                raise errors.Conflict(_last_line(said).removeprefix("calibd: ") or "calibd ended at once")
            with contextlib.suppress(OSError, ValueError):
                announced = json.loads((self._state / "server.json").read_text(encoding="utf-8"))
                if announced.get("pid") == self._server.pid:
                    return str(announced["address"])
            time.sleep(BETWEEN_LOOKS)
        end(self._server)
        raise errors.TooLate(f"calibd has not said within {START:.0f} s where it listens; {self._state}/server.log may say why")

    @property
    def workers(self) -> int:
        """How many were started."""
        return len(self._workers)

    def start_workers(self, count: int) -> None:
        """Workers of one slot each, which log to worker-N.log in the state folder."""
        program = find_program("calib-worker", self._folder)
        for i in range(1, count + 1):
            with (self._state / f"worker-{i}.log").open("ab") as log:
                self._workers.append(subprocess.Popen(
                    [program, "--server", self.address, "--slots", "1", "--name", f"python-{os.getpid()}-{i}",
                     "--checkpoints", self._state / "checkpoints", "--exit-with-parent", str(os.getpid())],
                    stdin=subprocess.DEVNULL, stdout=log, stderr=log))

    def close(self) -> None:
        """Ends the workers, then the server, in order."""
        for worker in self._workers:
            if worker.poll() is None:
                worker.send_signal(signal.SIGTERM)
        for process in (*self._workers, self._server):
            end(process)
        if self._server.stderr is not None:
            self._server.stderr.close()
