"""The matrix: what is hidden in each measurement, how strongly, and how the measurement was made.

Strengths are set by what is visible: lambda is the squared distance, in standard deviations of a measurement, between the
model with the effect and what the model without it can imitate, as simulated (see strengths.py). Where an effect does not
reach a lambda within its range there is no such case.
"""
import dataclasses, random

MEASUREMENT_SIDE = {'apparatus_compliance', 'strain_offset', 'membrane_stiffness', 'load_cell_error'}
LAMBDAS = (10, 60, 400)
# Pairs of the row "two effects at once": one between the grains, one that acts elsewhere or otherwise.
PAIRS = [('rolling_resistance', 'apparatus_compliance'), ('rolling_resistance', 'pressure_dependent_friction'),
         ('contact_plasticity', 'membrane_stiffness')]


@dataclasses.dataclass(frozen=True)
class Case:
    name: str
    rows: tuple                 # of the table
    seed: int                   # of packing, parameters and noise
    effects: tuple = ()         # hidden
    parameters: tuple = ()      # (dotted name, SI value) of the hidden effects
    staging: str = 'base'       # how the measurement was made: base | rate | step | damping | grains
    verb: str = 'diagnose'      # or improve
    removed: str = ''           # effect that the diagnosis may not know
    strength: int = 0           # lambda of a single hidden effect


DISTINCT = 25             # degrees to the nearest rival's signature: nearer ones are in a row of their own


def matrix(measured, repeats, controls):
    """measured: what the laboratory found of the strengths (laboratory.py)."""
    strengths = {effect: {int(k): values for k, (values, *_) in of['strengths'].items()} for effect, of in measured.items()}
    cases = [Case(f'control-r{r + 1}', ('no hidden effect',), 1000 + r) for r in range(controls)]
    for staging in ('rate', 'step', 'damping', 'grains'):
        cases += [Case(f'control-{staging}-r{r + 1}', ('no hidden effect, other staging',), 2000 + 100 * len(staging) + r,
                       staging=staging) for r in range(max(1, repeats))]
    for number, (effect, by_lambda) in enumerate(sorted(strengths.items())):
        for strength in sorted(by_lambda):
            rival = measured[effect].get('rival')
            alike = strength == 60 and rival is not None and rival[0] <= DISTINCT
            rows = (f'lambda = {strength}' + (', a rival nearby' if alike else ''),)
            if effect in MEASUREMENT_SIDE and strength > 10:  # to be named, not merely not mistaken
                rows += ('measurement-side effect',)
            cases += [Case(f'{effect}-l{strength}-r{r + 1}', rows, 10000 + 1000 * number + strength + r, (effect,),
                           tuple(sorted(by_lambda[strength].items())),
                           verb='improve' if strength == 60 else 'diagnose', strength=strength) for r in range(repeats)]
        if 60 in by_lambda:
            cases.append(Case(f'removed-{effect}-r1', ('true effect removed',), 10000 + 1000 * number + 500, (effect,),
                              tuple(sorted(by_lambda[60].items())), removed=effect, strength=60))
    for number, pair in enumerate(PAIRS):
        if not all(60 in strengths.get(effect, {}) for effect in pair):
            continue
        values = {k: v for effect in pair for k, v in strengths[effect][max(strengths[effect])].items()}
        cases += [Case(f'{pair[0]}+{pair[1]}-r{r + 1}', ('two effects at once',), 40000 + 100 * number + r, pair,
                       tuple(sorted(values.items())), verb='improve') for r in range(repeats)]
    # Interrupted runs are then a fair sample of the rows rather than the first few of them.
    random.Random(1).shuffle(cases)
    return cases
