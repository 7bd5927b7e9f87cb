"""Processor time of server and worker against that of the engines, over one iteration of short runs; prints Markdown."""

import argparse
import json
import os
import pathlib
import statistics
import subprocess
import tempfile
import time

EXAMPLE = pathlib.Path(__file__).resolve().parents[2] / "examples" / "triaxial"
BUSY = 0.98  # share of the engines' time up to which runs are under way; behind it the posterior is made
TICK = os.sysconf("SC_CLK_TCK")


def processor_time(pid):
    """Of one process with its threads, without its children [s]."""
    fields = pathlib.Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICK


def children(pid):
    found = []
    for task in pathlib.Path(f"/proc/{pid}/task").iterdir():
        try:
            found += [int(child) for child in (task / "children").read_text().split()]
        except FileNotFoundError:  # that thread has ended
            continue
    return found


def campaign(folder, runs, seed):
    """The example's first test alone, by one iteration of so many samples."""
    text = (EXAMPLE / "campaign.yaml").read_text()
    head, held_out = text.split("  - name: tx400")
    tail = held_out[held_out.index("noise: given"):]
    tail = tail.replace("{method: iterative_bayesian_filter, samples: 40, max_iterations: 4}", f"{{method: sqmc, samples: {runs}}}")
    (folder / "campaign.yaml").write_text(head + tail.replace("seed: 7", f"seed: {seed}"))
    (folder / "tx200.csv").write_text((EXAMPLE / "tx200.csv").read_text())


def measure(programs, runs, slots, seed):
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        campaign(folder, runs, seed)
        server = subprocess.Popen([programs / "calibd", "--state", folder / "state", "--listen", "127.0.0.1:0"], stderr=subprocess.DEVNULL,
                                  stdout=subprocess.DEVNULL)
        told = folder / "state" / "server.json"
        until = time.monotonic() + 30
        while not told.exists() and time.monotonic() < until:
            time.sleep(0.05)
        address = json.loads(told.read_text())["address"]
        ask = [programs / "calibctl", "--server", address, "--json"]
        worker = subprocess.Popen([programs / "calib-worker", "--server", address, "--slots", str(slots)], stderr=subprocess.DEVNULL,
                                  stdout=subprocess.DEVNULL)
        try:
            while "ready" not in subprocess.run([*ask[:-1], "workers"], check=True, capture_output=True, text=True).stdout:
                time.sleep(0.5)
            started = processor_time(worker.pid)  # its own measure of speed
            subprocess.run([*ask, "submit", folder / "campaign.yaml"], check=True, stdout=subprocess.DEVNULL)
            looks = []
            found = {"state": ""}
            while found["state"] not in ("finished", "failed", "paused", "cancelled"):
                time.sleep(1)
                looks.append({"calibd": processor_time(server.pid), "worker": processor_time(worker.pid) - started,
                              "engines": sum(processor_time(child) for child in children(worker.pid))})
                if len(looks) % 20 == 0:  # who asks costs too
                    found = json.loads(subprocess.run([*ask, "show", "c1"], check=True, capture_output=True).stdout)
            if found["state"] != "finished":
                raise SystemExit(f"the campaign is {found['state']}: {found['reason']}")
            busy = next(look for look in looks if look["engines"] >= BUSY * looks[-1]["engines"])
            return {"runs": found["model_evaluations"], "busy": busy, "end": looks[-1]}
        finally:
            for one in (worker, server):
                one.terminate()
                one.wait(30)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bin", required=True, type=pathlib.Path)
    parser.add_argument("--campaigns", default=5, type=int)
    parser.add_argument("--runs", default=1000, type=int)
    parser.add_argument("--slots", default=2, type=int)
    options = parser.parse_args()
    print("| seed | runs | engines [s], a run | calibd, worker while runs are made [s] | over engines | calibd with the posterior [s] |\n"
          "|---|---|---|---|---|---|", flush=True)
    shares = []
    for seed in range(1, options.campaigns + 1):
        one = measure(options.bin, options.runs, options.slots, seed)
        busy, end = one["busy"], one["end"]
        shares.append((busy["calibd"] + busy["worker"]) / busy["engines"])
        print(f"| {seed} | {one['runs']} | {end['engines']:.0f}, {end['engines'] / one['runs']:.2f} | {busy['calibd']:.2f}, "
              f"{busy['worker']:.2f} | {100 * shares[-1]:.2f} % | {end['calibd']:.2f} |", flush=True)
    print(f"| median | | | | {100 * statistics.median(shares):.2f} % | |")


if __name__ == "__main__":
    main()
