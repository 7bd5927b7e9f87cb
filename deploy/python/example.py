"""A model that lacks an effect, from measurements to what is probably missing: `python example.py [FOLDER]`.

Spheres of 5 mm hit a wall at several angles. Their contacts lose a little energy to a dashpot,
which the calibrated model does not know. Everything is written into FOLDER (a temporary one).
Cells begin with `# %%`, as notebooks and editors know them.
"""

# %% What the laboratory would give: here readings of a truth that we choose, with an error of 2 %.
import sys
import tempfile
from pathlib import Path

import numpy as np

import calib

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="calib-example-"))
observables = ["normal_restitution", "tangential_restitution", "contact_duration"]  # 1, 1, s


def campaign_text(effects: str, fixed: str) -> str:
    return f"""
name: impacts
model: {{contact: hertz_mindlin, effects: [{effects}], density: 2500 kg/m^3, fixed: {{poisson_ratio: 0.25{fixed}}}}}
parameters:
  young_modulus: {{prior: log_uniform, min: 0.02 GPa, max: 1 GPa}}
  friction_coefficient: {{prior: uniform, min: 0.05, max: 1}}
experiments:
  - name: wall
    test: collision
    radius: 5 mm
    impact_speed: 1 m/s
    data: {{file: wall.csv}}
    control: impact_angle
    observables:
      normal_restitution: {{noise: {{absolute: 0.02}}}}
      tangential_restitution: {{noise: {{absolute: 0.02}}}}
      contact_duration: {{noise: {{relative: 0.02}}}}
inference: {{method: iterative_bayesian_filter, max_iterations: 3, samples: 24}}
seed: 5
"""


(folder / "truth.yaml").write_text(campaign_text("viscous_damping", ", viscous_damping.ratio: 0.05"))
(folder / "model.yaml").write_text(campaign_text("", ""))
angles = np.linspace(0, 1.2, 7)  # rad from the normal
(folder / "wall.csv").write_text(",".join(["impact_angle", *observables]) + "\n"
                                 + "".join(f"{angle:.3f},1,1,1\n" for angle in angles))  # not measured yet

with calib.connect(state=folder / "state") as c:
    truth = c.simulate(folder / "truth.yaml", {"young_modulus": "0.2 GPa", "friction_coefficient": 0.3})
    noise = np.random.default_rng(1).normal(size=(len(angles), 3))
    measured = truth[observables] + 0.02 * noise * [1.0, 1.0, truth["contact_duration"].mean()]
    measured.insert(0, "impact_angle", angles.round(3))
    measured.to_csv(folder / "wall.csv", index=False)

    # %% Calibrate the model that knows nothing of the dashpot.
    base = c.submit(folder / "model.yaml")
    for status in c.watch(base):
        print(f"iteration {status['iteration'] + 1}: {status['samples_done']} of {status['samples']} samples")
    posterior = c.posterior(base)
    print(posterior.frame[["mean", "sd", "unit"]])

    # %% Where does it fail?
    comparison = c.compare(base)
    print(f"error {comparison['rms_error']:.2f} sd, p = {comparison['p_value']:.2g}")
    print(comparison.frame("by_observable")[["observable", "rms_error", "z"]])

    # %% Why?
    diagnosis = c.diagnose(base, plan=False)
    print(diagnosis["sentence"])
    print(diagnosis.frame("probabilities"))

    # %% The likeliest model, and the error that is left. Where the verdict is no `missing_effect` this is a guess to look at.
    extended = c.extend(base, *diagnosis["probabilities"][0]["effects"])["campaign"]
    print(c.posterior(extended).frame[["mean", "sd", "unit"]])
    print(f"error {c.compare(extended)['rms_error']:.2f} sd")

    # %% For ArviZ: `arviz.from_netcdf(FILE)` opens it.
    data = c.to_inference_data(extended, seed=1)
    print(data.posterior)
    print("written:", data.to_netcdf(folder / "impacts.nc"))
