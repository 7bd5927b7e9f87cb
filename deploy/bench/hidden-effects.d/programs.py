"""Programs that are run, ended by their own process id: at the end of the piece, or when this program is told to end."""
import json, os, subprocess, threading, time

PATIENCE = 30             # seconds between asking a program to end and ending it


class Failed(Exception):
    """code: the exit status of the program, where it was one that failed."""

    def __init__(self, message, code=None):
        super().__init__(message)
        self.code = code


class OutOfTime(Exception):
    """The piece is over; what was run is found again in the case's folder."""


def write(path, text):
    """All of it or nothing."""
    with open(path + '.new', 'w', encoding='utf-8') as out:
        out.write(text)
        out.flush()
        os.fsync(out.fileno())
    os.replace(path + '.new', path)


class Programs:
    """Any number of threads may call."""

    def __init__(self, calibctl, end=float('inf')):
        """end: of the piece, on the clock of time.monotonic()."""
        self.calibctl, self.end = calibctl, end
        self._running, self._lock, self._stopped = set(), threading.Lock(), False

    def call(self, *arguments, program=None):
        """What it printed."""
        with self._lock:
            if self._stopped or time.monotonic() >= self.end:
                raise OutOfTime
            child = subprocess.Popen([program or self.calibctl, *arguments], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                                     stderr=subprocess.PIPE, text=True)
            self._running.add(child)
        try:
            rest = None if self.end == float('inf') else max(0.0, self.end - time.monotonic())
            try:
                out, err = child.communicate(timeout=rest)
            except subprocess.TimeoutExpired:
                end_by_pid(child)
                child.stdout.close()
                child.stderr.close()
                raise OutOfTime from None
        finally:
            with self._lock:
                self._running.discard(child)
        if self._stopped:
            raise OutOfTime
        if child.returncode != 0:
            raise Failed(f'{arguments[0]} ended with {child.returncode}: {err.strip()[-300:]}', child.returncode)
        return out

    def answer(self, verb, *arguments, state, workers=1):
        """The JSON of a verb on a state folder."""
        return json.loads(self.call(verb, *arguments, '--state', state, '--workers', str(workers), '--json'))

    def stop(self):
        """Ends what runs; no call begins after it."""
        with self._lock:
            self._stopped = True
            running = list(self._running)
        for child in running:
            child.terminate()
        for child in running:
            end_by_pid(child)


def end_by_pid(child):
    child.terminate()
    try:
        child.wait(PATIENCE)
    except subprocess.TimeoutExpired:
        child.kill()
        child.wait()
