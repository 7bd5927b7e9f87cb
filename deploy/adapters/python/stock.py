"""Force on a rubber block: a spring beside a spring and dashpot in series, under a slow wave."""
import math

stiffness, relaxing_stiffness, relaxation_time = 2000.0, 1500.0, 0.3  # N/m, N/m, s
hardening = 0.0  # N/m^3, of the spring that does not relax
amplitude, frequency = 0.01, 0.5  # m, Hz
times = [k / 10 for k in range(1, 41)]  # s

omega = 2 * math.pi * frequency


def rate(time, relaxing):
    velocity = amplitude * omega * math.cos(omega * time)
    return relaxing_stiffness * velocity - relaxing / relaxation_time


print("time displacement force")
time = relaxing = 0.0
for target in times:
    steps = max(1, math.ceil((target - time) / 1e-3))
    h = (target - time) / steps
    for _ in range(steps):  # midpoint rule
        relaxing += h * rate(time + h / 2, relaxing + h / 2 * rate(time, relaxing))
        time += h
    x = amplitude * math.sin(omega * target)
    force = stiffness * x + hardening * x * x * x + relaxing
    print(target, x, force)
