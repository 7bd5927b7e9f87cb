"""LIGGGHTS as the model: pours and lifts once per repetition, answers with the heap that stays."""
import json
import signal
import subprocess
import sys

from repose import repose


def prime(number):
    """The least prime that is not below number; LIGGGHTS takes no other seeds."""
    while any(number % divisor == 0 for divisor in range(2, int(number ** 0.5) + 1)):
        number += 1
    return number


# An exit, unlike a signal, also ends the LIGGGHTS that is running.
signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
request = json.load(sys.stdin)
for step, repetition in enumerate(request["control"]["values"]):
    seed = prime(10007 + (request["seed"] + 7919 * int(repetition)) % 10 ** 8)
    run = subprocess.run(["liggghts", "-in", "in.liggghts", "-var", "seed", str(seed)],
                         stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    if run.returncode != 0:
        print(*open("log.liggghts").readlines()[-1:], file=sys.stderr)
        sys.exit(1)  # failed, not diverged
    try:
        angle, height = repose("heap.dump")
    except ValueError:  # LIGGGHTS loses its grains without an error
        print("no grain is left in the box", file=sys.stderr)
        sys.exit(3)
    print(json.dumps({"load_step": step, "angle_of_repose": angle, "heap_height": height}),
          flush=True)
