"""Makes measurements whose truth is known, and the campaign files that do not know it; knows calibctl and files only."""
import csv, dataclasses, hashlib, json, math, os, random, shutil

import programs

PACKINGS = 16                                      # of a campaign; what diagnose recommends
GRAINS, MORE = 300, 1.27                           # of the model; a measured specimen has up to so many times as many, drawn
DRAWS = 5                                          # of base parameters, until the hidden effects can be as strong as wanted
STAGING = {'rate': 0.1, 'step': 0.004, 'damping': 0.3}
OTHERWISE = {'rate': {'rate': 0.2}, 'step': {'step': 0.002}, 'damping': {'damping': 0.6}, 'grains': {}, 'base': {}}
MANY_GRAINS = 600                                  # of the specimen where the case says 'grains'
STRAINS_AND_RATIO = {'q_over_p': (0.015, 0.01), 'volumetric_strain': (0.0, 3e-4)}   # relative, absolute


def up_and_down(last, readings, back):
    """A path to `last` with one unloading by `back` half-way, and reloading."""
    up = [last * i / readings for i in range(readings + 1)]
    half = len(up) // 2
    return tuple(up[:half + 1] + [up[half] - back / 2, up[half] - back, up[half] - back / 2] + up[half + 1:])


@dataclasses.dataclass(frozen=True)
class Test:
    test: str
    settings: dict                                 # name: YAML
    path: tuple = up_and_down(0.08, 24, 0.008)
    noise: dict = dataclasses.field(default_factory=lambda: dict(STRAINS_AND_RATIO))   # observable: (relative, absolute)
    control: str = 'axial_strain'
    role: str = 'calibrate'
    kind: str = 'cell'                             # poured: no porosity, no staging; collision: no packing either


@dataclasses.dataclass(frozen=True)
class Layout:
    tests: dict                                    # name: Test
    priors: dict = dataclasses.field(default_factory=lambda: {
        'young_modulus': ('log_uniform', 0.4e9, 1.8e9), 'friction_coefficient': ('uniform', 0.2, 0.8)})
    truth: dict = dataclasses.field(default_factory=lambda: {     # where it is drawn from, well inside the priors
        'young_modulus': (0.6e9, 1.2e9), 'friction_coefficient': (0.3, 0.6)})
    reference: dict = dataclasses.field(default_factory=lambda: {'pressure': 0.2e6, 'diameter': 3e-3, 'modulus': 0.6e9})
    density: str = '2650000 kg/m^3'                # a thousandfold: the tests are quasi-static
    fixed: dict = dataclasses.field(default_factory=lambda: {'poisson_ratio': 0.2})
    effects: tuple = ()                            # of the model that is calibrated
    grains: int = GRAINS
    packings: int = PACKINGS
    radii: str = '{mean: 1.5 mm, spread: 0.3}'

    def fitted(self):
        return [name for name, of in self.tests.items() if of.role == 'calibrate']


def triaxial(pressure, role='calibrate'):
    return Test('triaxial_drained', {'confining_pressure': f'{pressure} MPa'}, role=role)


STANDARD = Layout({'low': triaxial(0.1), 'high': triaxial(0.4), 'held': triaxial(0.2, 'validate')})
INFERENCE = {'whole': '{method: iterative_bayesian_filter, samples: 24, max_iterations: 3}', 'shared': '{method: sqmc, samples: 96}'}


def digest(text):
    return hashlib.sha256(text.encode()).hexdigest()


def campaign(layout, tests, packing, grains, realizations, effects=(), values=None, staging=None, inference='whole', seed=7):
    """Text of a campaign file. values: parameters of effects that are fixed, SI; packing: seed of the recipe."""
    fixed = {**layout.fixed, **(values or {})}
    names = sorted({*layout.effects, *effects})
    text = f"name: hidden\nmodel: {{contact: hertz_mindlin, density: {layout.density}, effects: [{', '.join(names)}], fixed: {{"
    text += ', '.join(f'{name}: {value!r}' for name, value in sorted(fixed.items())) + '}}\nparameters:\n'
    for name, (kind, low, high) in layout.priors.items():
        text += f'  {name}: {{prior: {kind}, min: {low!r}, max: {high!r}}}\n'
    text += 'experiments:\n'
    own = {**STAGING, **(staging or {})}
    for name in tests:
        test = layout.tests[name]
        settings = dict(test.settings)
        text += f'  - name: {name}\n    test: {test.test}\n'
        porosity = f"porosity: {settings.pop('porosity', 0.40)}, " if test.kind == 'cell' else ''
        text += ''.join(f'    {key}: {value}\n' for key, value in settings.items())
        if test.kind != 'collision':
            text += f'    packing: {{generate: {{particles: {grains}, {porosity}radii: {layout.radii}, seed: {packing}}}}}\n'
            text += f'    realizations: {realizations}\n'
        if test.kind == 'cell':
            text += f'    data: {{file: {name}.csv, strain: logarithmic}}\n    control: {{column: {test.control}, noise: 1e-5}}\n'
            text += (f"    staging: {{rate: {own['rate']} 1/s, step: {own['step']}, damping: [{own['damping']}, 0.9], "
                     f"unbalanced: 1e-3}}\n")
        else:
            text += f'    data: {{file: {name}.csv}}\n    control: {test.control}\n'
        text += '    observables:\n'
        for observable, (relative, absolute) in test.noise.items():
            law = f'relative: {relative!r}, floor: {absolute!r}' if relative else f'absolute: {absolute!r}'
            text += f'      {observable}: {{noise: {{{law}}}}}\n'
        text += f'    role: {test.role}\n'
    return text + f'inference: {INFERENCE[inference]}\nseed: {seed}\n'


def table(test, readings):
    """Text of a data file. readings: one {observable: value} for each value of the path."""
    text = ','.join([test.control, *test.noise]) + '\n'
    for at, row in zip(test.path, readings):
        text += ','.join([repr(at), *(f'{row[observable]:.7g}' for observable in test.noise)]) + '\n'
    return text


class Laboratory:
    """Thread-safe: each case has a folder of its own."""

    def __init__(self, run, folder):
        """run: programs.Programs."""
        self.run, self.folder = run, folder
        self._catalogue = None
        os.makedirs(folder, exist_ok=True)

    def catalogue(self):
        """{effect: its entry of `calibctl effects`}."""
        if self._catalogue is None:
            self._catalogue = {e['name']: e for e in json.loads(self.run.call('effects', '--json'))}
        return self._catalogue

    def simulate(self, work, layout, tests, base, **of_campaign):
        """{test: rows of `simulate`} of one run; work: a folder that is made and removed again."""
        shutil.rmtree(work, ignore_errors=True)
        os.makedirs(work)
        for name in tests:
            ones = [dict.fromkeys(layout.tests[name].noise, 1.0)] * len(layout.tests[name].path)
            programs.write(os.path.join(work, name + '.csv'), table(layout.tests[name], ones))
        file, states = os.path.join(work, 'campaign.yaml'), os.path.join(work, 'states.csv')
        programs.write(file, campaign(layout, tests, realizations=1, **of_campaign))
        given = [word for name, value in base.items() for word in ('--set', f'{name}={value!r}')]
        try:
            self.run.call('simulate', file, *given, '-o', states)
            rows = {name: [] for name in tests}
            with open(states, encoding='utf-8') as text:
                for row in csv.DictReader(text):
                    rows[row['experiment']].append(row)
        finally:
            shutil.rmtree(work, ignore_errors=True)
        for name in tests:
            if len(rows[name]) != len(layout.tests[name].path):
                raise programs.Failed(f'simulate: {len(rows[name])} states of {name} for {len(layout.tests[name].path)} readings')
        return rows

    # ---- measurements -----------------------------------------------------------------------------------------------------
    def draw(self, case, rnd, layout, strengths):
        """Base parameters, and strengths of what is hidden such that lambda of each alone is the case's at just these; parameters
        where no strength reaches it are drawn again."""
        for _ in range(DRAWS):
            base = {name: math.exp(rnd.uniform(math.log(low), math.log(high))) if layout.priors[name][0] == 'log_uniform'
                    else rnd.uniform(low, high) for name, (low, high) in layout.truth.items()}
            values, found = {}, {}
            for effect, turn in zip(case.effects, case.turns):
                shape = strengths.draw_shape(effect, rnd) if case.shape else {}
                tuned = strengths.tuned(effect, turn, case.strength, base, shape)
                if tuned is None:
                    break
                values.update(tuned[0])
                found[effect] = tuned[1]
            else:
                return base, values, found
        raise programs.Failed(f'no strength of {" and ".join(case.effects)} gives lambda {case.strength}, for {DRAWS} draws')

    def specimen(self, case, rnd, layout):
        """Another packing and number of grains, and another staging where the case says so."""
        grains = MANY_GRAINS if case.staging == 'grains' else rnd.randint(layout.grains, int(MORE * layout.grains))
        return {'packing': rnd.randrange(10**6, 2**31 - 1000), 'grains': grains, 'staging': OTHERWISE[case.staging]}

    def measure(self, case, folder, layout, strengths):
        """Data files in the folder and truth.json beside it, which the program that is asked never reads; complete once the truth
        is there. The same case gives the same measurement."""
        os.makedirs(folder, exist_ok=True)
        sealed = os.path.join(folder, 'truth.json')
        if not os.path.exists(sealed):
            rnd = random.Random(case.seed)
            base, values, found = self.draw(case, rnd, layout, strengths)
            truth = {'effects': list(case.effects), 'base': base, 'values': values, 'lambda': found, **self.specimen(case, rnd, layout)}
            self.read(truth, folder, layout, list(layout.tests), rnd)
            programs.write(sealed, json.dumps(truth, indent=1))
        with open(sealed, encoding='utf-8') as file:
            return json.load(file)

    def read(self, truth, folder, layout, tests, rnd, names=None):
        """One run at the truth, with noise, into NAME.csv of each test."""
        rows = self.simulate(os.path.join(folder, 'making'), layout, tests, truth['base'], packing=truth['packing'],
                             grains=truth['grains'], staging=truth['staging'], effects=truth['effects'], values=truth['values'])
        for name in tests:
            test, readings = layout.tests[name], []
            for row in rows[name]:
                readings.append({})
                for observable, (relative, absolute) in test.noise.items():
                    y = float(row[observable])
                    readings[-1][observable] = y + rnd.gauss(0, 1) * math.hypot(relative * y, absolute)
            programs.write(os.path.join(folder, (names or {}).get(name, name) + '.csv'), table(test, readings))

    def file(self, folder, layout, way, design=0):
        """The campaign file of a measurement. Design k has packings and samples of its own."""
        path = os.path.join(folder, 'campaign.yaml')
        tests = list(layout.tests) if way == 'whole' else layout.fitted()
        programs.write(path, campaign(layout, tests, 1 + 100 * design, layout.grains, layout.packings, inference=way, seed=7 + design))
        return path
