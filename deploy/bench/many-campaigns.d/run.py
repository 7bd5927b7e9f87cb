"""A server whose file holds many campaigns: time to be ready, to list, to show, to delete beside running ones; prints Markdown.

One small campaign is calibrated; finished ones are copies of its rows under other numbers, live ones are submitted and given its states.
"""

import argparse
import contextlib
import http.client
import json
import pathlib
import re
import sqlite3
import statistics
import subprocess
import tempfile
import time

EXAMPLE = pathlib.Path(__file__).resolve().parents[2] / "examples" / "triaxial"
SAMPLES = 8  # of a finished campaign
LEFT = 100  # runs of a live campaign that wait
TIMES = 9  # a command is timed


class Server:
    def __init__(self, programs, state):
        self.programs, self.state = programs, state
        self.process = None

    def __enter__(self):
        told = self.state / "server.json"
        told.unlink(missing_ok=True)
        begun = time.monotonic()
        self.process = subprocess.Popen([self.programs / "calibd", "--state", self.state, "--listen", "127.0.0.1:0", "--http", "127.0.0.1:0",
                                         "--log-file", self.state / "log", "--max-predictions", "1000000000"],
                                        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        while self.process.poll() is None:
            if told.exists() and (address := json.loads(told.read_text() or "{}").get("address")):
                self.address = address
                if self.run("list", "--limit", "1", check=False).returncode == 0:
                    self.ready = time.monotonic() - begun
                    page = next(line for line in self.process.stderr if line.startswith("page: "))
                    self.page = http.client.HTTPConnection(re.search(r"//([^/]+)/", page)[1])
                    self.token = {"Authorization": f"Bearer {(self.state / 'token').read_text().strip()}"}
                    if not until(lambda: "\ncalib_campaigns_being_read 0\n" in self.get("/metrics"), 300):
                        raise SystemExit("calibd does not read its campaigns")
                    self.takes_work = time.monotonic() - begun
                    return self
            time.sleep(0.02)
        raise SystemExit(f"calibd ended: {self.process.stderr.read()}")

    def __exit__(self, *_):
        self.process.terminate()
        self.process.wait(60)

    def run(self, *words, check=True):
        done = subprocess.run([self.programs / "calibctl", "--server", self.address, "--json", *words], capture_output=True, text=True)
        if check and done.returncode != 0:
            raise SystemExit(f"calibctl {' '.join(map(str, words))}: {done.stderr}")
        return done

    def took(self, *words):
        """Median and longest of several calls, the program's start in it [ms]."""
        took = []
        for _ in range(TIMES):
            begun = time.monotonic()
            self.run(*words)
            took.append(1e3 * (time.monotonic() - begun))
        return f"{statistics.median(took):.0f}, {max(took):.0f} ms"

    def get(self, target):
        self.page.request("GET", target, headers=self.token)
        answer = self.page.getresponse()
        text = answer.read().decode()
        if answer.status != 200:
            raise SystemExit(f"{target}: {answer.status} {text}")
        return text

    def answered(self, targets):
        """Median and longest of these questions over one connection, of which the page has kept no answer [ms]."""
        took = []
        for target in targets:
            begun = time.monotonic()
            self.get(target)
            took.append(1e3 * (time.monotonic() - begun))
        return f"{statistics.median(took):.1f}, {max(took):.1f} ms"

    def resident(self):
        status = pathlib.Path(f"/proc/{self.process.pid}/status").read_text()
        return int(status.split("VmRSS:")[1].split()[0]) / 1024  # MiB


def campaign(folder, name, samples):
    """The example's first test alone, by one iteration of so many samples."""
    text = (EXAMPLE / "campaign.yaml").read_text()
    head, held_out = text.split("  - name: tx400")
    tail = held_out[held_out.index("noise: given"):]
    tail = tail.replace("{method: iterative_bayesian_filter, samples: 40, max_iterations: 4}", f"{{method: sqmc, samples: {samples}}}")
    (folder / name).write_text(head + tail)
    (folder / "tx200.csv").write_text((EXAMPLE / "tx200.csv").read_text())
    return folder / name


def until(what, seconds):
    end = time.monotonic() + seconds
    while not what():
        if time.monotonic() > end:
            return False
        time.sleep(0.2)
    return True


def columns(db, table):
    return [row[1] for row in db.execute(f"PRAGMA table_info({table})")]


def copy_finished(db, count):
    """Rows of campaign 1 under `count` further numbers; digests of runs are others."""
    last = db.execute("SELECT max(id) FROM campaign").fetchone()[0]
    for table in ("campaign", "campaign_file", "iteration", "sample", "evaluation", "attempt", "state", "event"):
        names = [name for name in columns(db, table) if not (table in ("attempt", "event") and name == "id")]
        own = "id" if table == "campaign" else "campaign"
        taken = ["new.n" if name == own else "lower(hex(randomblob(32)))" if (table, name) == ("evaluation", "digest") else f"old.{name}" for name in names]
        db.execute(f"WITH RECURSIVE new(n) AS (SELECT {last + 1} UNION ALL SELECT n + 1 FROM new WHERE n < {last + count}) "
                   f"INSERT INTO {table} ({', '.join(names)}) SELECT {', '.join(taken)} FROM new, {table} AS old WHERE old.{own} = 1")
    db.commit()


def give_states(db, number):
    """All runs of a live campaign but the last ones have the states of one run of campaign 1. How many states that makes."""
    last = db.execute("SELECT max(sample) FROM sample WHERE campaign = ?", (number,)).fetchone()[0] - LEFT
    key = (number, last)
    db.execute("UPDATE evaluation SET status = 'finished' WHERE campaign = ? AND sample <= ?", key)
    names = [name for name in columns(db, "attempt") if name not in ("id", "campaign", "sample", "experiment")]
    db.execute(f"INSERT INTO attempt (campaign, sample, experiment, {', '.join(names)}) "
               f"SELECT new.campaign, new.sample, 0, {', '.join('old.' + name for name in names)} FROM evaluation AS new, attempt AS old "
               "WHERE old.id = (SELECT min(id) FROM attempt WHERE campaign = 1 AND outcome = 'completed') AND new.campaign = ? AND new.sample <= ?", key)
    made = db.execute("INSERT INTO state (campaign, sample, experiment, load_step, observables, others) "
                      "SELECT new.campaign, new.sample, 0, old.load_step, old.observables, old.others FROM evaluation AS new, state AS old "
                      "WHERE old.campaign = 1 AND old.sample = 0 AND old.experiment = 0 AND new.campaign = ? AND new.sample <= ?", key).rowcount
    db.commit()
    return made


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bin", required=True, type=pathlib.Path)
    parser.add_argument("--finished", default=10000, type=int)
    parser.add_argument("--live", default=10, type=int)
    parser.add_argument("--states", default=1000000, type=int, help="of each live campaign")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        state = folder / "state"
        with Server(options.bin, state) as server:
            worker = subprocess.Popen([options.bin / "calib-worker", "--server", server.address], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            server.run("submit", campaign(folder, "finished.yaml", SAMPLES))
            finished = until(lambda: json.loads(server.run("show", "c1").stdout)["state"] == "finished", 300)
            worker.terminate()
            worker.wait(30)
            if not finished:
                raise SystemExit("the first campaign does not end")
        file = state / "calib.db"
        with contextlib.closing(sqlite3.connect(file)) as db:
            steps = db.execute("SELECT count(*) FROM state WHERE campaign = 1 AND sample = 0").fetchone()[0]
            copy_finished(db, options.finished - 1)
        live = [f"c{options.finished + k}" for k in range(1, options.live + 1)]
        with Server(options.bin, state) as server:
            samples = -(-options.states // steps) + LEFT
            for seed, number in enumerate(live, 1001):  # not the first one's, whose runs would be taken over
                told = json.loads(server.run("submit", campaign(folder, "live.yaml", samples), "--seed", str(seed)).stdout)
                if told["campaign"] != number:
                    raise SystemExit(f"submitted as {told}, not {number}")
            with contextlib.closing(sqlite3.connect(f"file:{file}?mode=ro", uri=True)) as db:
                planned = "SELECT count(DISTINCT campaign) FROM sample WHERE campaign > ?"
                if not until(lambda: db.execute(planned, (options.finished,)).fetchone()[0] == options.live, 300):
                    raise SystemExit("the live campaigns are not planned")
        with contextlib.closing(sqlite3.connect(file)) as db:
            made = sum(give_states(db, int(number[1:])) for number in live)
            of_all = db.execute("SELECT count(*) FROM state").fetchone()[0]
        size = file.stat().st_size / 2**20
        print(f"{options.finished} finished campaigns, {options.live} live ones; states of live ones {made}, of all {of_all}; file {size:.0f} MiB\n\n"
              "| what | taken |\n|---|---|", flush=True)
        with Server(options.bin, state) as server:
            print(f"| ready, from the start of calibd to the first answer | {server.ready:.2f} s |")
            print(f"| campaigns read and workers let in, from the start of calibd | {server.takes_work:.2f} s |")
            print(f"| resident then | {server.resident():.0f} MiB |")
            pages = [f"/api/v1/campaigns?limit={limit}" for limit in range(100, 100 - TIMES, -1)]
            print(f"| first page of `list` (92 to 100 campaigns) over an open connection: median, longest of {TIMES} | {server.answered(pages)} |")
            shown = [f"/api/v1/campaigns/{number}" for number in live]
            print(f"| `show` over an open connection, of each live campaign: median, longest of {len(shown)} | {server.answered(shown)} |")
            print(f"| `calibctl --version`, for comparison: median, longest of {TIMES} | {server.took('--version')} |")
            print(f"| `list --limit 100` | {server.took('list', '--limit', '100')} |")
            print(f"| `list`, all | {server.took('list')} |")
            print(f"| `show` of a live campaign | {server.took('show', live[0])} |")
            print(f"| `show` of a finished campaign | {server.took('show', 'c1')} |")
            print(f"| resident then | {server.resident():.0f} MiB |", flush=True)
            for number in live:
                server.run("cancel", number)
            load = subprocess.Popen([options.bin / "load", "--server", server.address, "--token", state / "token", "--workers", "100", "--slots", "4", "--rate",
                                     "4000", "--warm-up", "8", "--seconds", "60", "--pid", str(server.process.pid)], stdout=subprocess.PIPE, text=True)
            time.sleep(8)
            begun = time.monotonic()
            for number in live:
                server.run("delete", number)
            print(f"| `delete` of all that were live answered, beside `load` of 100 x 4 at 4000 states/s | {time.monotonic() - begun:.1f} s |")
            with contextlib.closing(sqlite3.connect(f"file:{file}?mode=ro", uri=True)) as db:
                gone = until(lambda: db.execute("SELECT count(*) FROM leaving").fetchone()[0] == 0, 900)
            print(f"| all of it gone, from the first `delete` | {f'{time.monotonic() - begun:.0f} s' if gone else 'not within 15 min'} |", flush=True)
            told = json.loads(load.communicate(timeout=300)[0])
            waits = ", ".join(f"{told[name]:.0f}" for name in ("p50_ms", "p99_ms", "largest_ms"))
            print(f"| acknowledgement in the minute from the first `delete` on: p50, p99, longest | {waits} ms |")
            print(f"| states/s; leases lost | {told['states_per_second']:.0f}; {told['leases_lost']} |", flush=True)
            shrunk = until(lambda: file.stat().st_size / 2**20 < 0.8 * size, 300)
            print(f"| file | {file.stat().st_size / 2**20:.0f} MiB{'' if shrunk else ': it has not shrunk'} |")


if __name__ == "__main__":
    main()
