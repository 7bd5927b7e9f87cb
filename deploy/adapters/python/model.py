"""Force on a rubber block: a spring beside a spring and dashpot in series, under a slow wave."""
import json, math, sys

request = json.load(sys.stdin)
p, s = request["parameters"], request["settings"]
stiffness, relaxing_stiffness = p["stiffness"], p["relaxing_stiffness"]
relaxation_time = p["relaxation_time"]
hardening = p.get("hardening.stiffness", 0.0)  # sent while the effect is on
amplitude, frequency = s["amplitude"], s["frequency"]  # m, Hz
times = request["control"]["values"]  # s

omega = 2 * math.pi * frequency


def rate(time, relaxing):
    velocity = amplitude * omega * math.cos(omega * time)
    return relaxing_stiffness * velocity - relaxing / relaxation_time


time = relaxing = 0.0
for step, target in enumerate(times):
    steps = max(1, math.ceil((target - time) / 1e-3))
    h = (target - time) / steps
    for _ in range(steps):  # midpoint rule
        relaxing += h * rate(time + h / 2, relaxing + h / 2 * rate(time, relaxing))
        time += h
    x = amplitude * math.sin(omega * target)
    force = stiffness * x + hardening * x * x * x + relaxing
    if not math.isfinite(force):
        print("the integration blew up at", target, "s", file=sys.stderr)
        sys.exit(3)
    print(json.dumps({"load_step": step, "displacement": x, "force": force}), flush=True)
