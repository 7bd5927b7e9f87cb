"""Makes the measurements, runs the campaigns and keeps what came out; knows calibctl and files only."""
import csv, hashlib, json, math, os, random, subprocess, sys, threading

YOUNG, FRICTION = (0.6e9, 1.2e9), (0.3, 0.6)     # where the truth is drawn from, well inside the priors
NOISE = {'q_over_p': (0.015, 0.01), 'volumetric_strain': (0.0, 3e-4)}   # relative, absolute
READINGS, STRAIN = 24, 0.08
PRESSURES = {'low': ('0.1 MPa', 'calibrate'), 'high': ('0.4 MPa', 'calibrate'), 'held': ('0.2 MPa', 'validate')}
PACKINGS = 16                                      # of a campaign; what diagnose recommends
DRAWS = 5                                          # of base parameters, until the hidden effect can be as strong as wanted
STAGING = {'rate': 0.1, 'step': 0.004, 'damping': 0.3, 'grains': 300}


class Failed(Exception):
    pass


def digest(text):
    return hashlib.sha256(text.encode()).hexdigest()


def axial_strains():
    """Loading with one unloading and reloading half-way."""
    up = [STRAIN * i / READINGS for i in range(READINGS + 1)]
    half = len(up) // 2
    return up[:half + 1] + [up[half] - 0.004, up[half] - 0.008, up[half] - 0.004] + up[half + 1:]


class Laboratory:
    def __init__(self, calibctl, folder):
        self.calibctl, self.folder = calibctl, folder
        self._lock, self._visibility = threading.Lock(), None
        os.makedirs(os.path.join(folder, 'sealed'), exist_ok=True)

    # ---- one case -----------------------------------------------------------------------------------------------------
    def path(self, case, *names):
        return os.path.join(self.folder, case.name, *names)

    def sealed(self, case, ending):
        return os.path.join(self.folder, 'sealed', case.name + ending)

    def finished(self, case, improve=False):
        """improve: with the answer of improve, where the case asks for one."""
        if not os.path.exists(self.path(case, 'verdict.json')):
            return False
        if not improve or case.verb != 'improve':
            return True
        with open(self.path(case, 'verdict.json')) as document:
            return 'improve' in json.load(document)

    def run(self, case, improve=True):
        """What has been run is found again in the case's state: a verdict without improve gets one."""
        if self.finished(case, improve):
            return
        os.makedirs(self.path(case), exist_ok=True)
        if not os.path.exists(self.path(case, 'campaign.yaml')):
            self.measure(case)
        campaign = self.call(case, 'run', self.path(case, 'campaign.yaml'), '--workers', '1')
        options = ['--without', case.removed] if case.removed else []
        verdict = self.call(case, 'diagnose', campaign['campaign'], '--workers', '1', *options)
        document = {'run': campaign, 'diagnose': verdict, 'compare': self.call(case, 'compare', campaign['campaign'])}
        if case.verb == 'improve' and improve:
            document['improve'] = self.call(case, 'improve', campaign['campaign'], '--workers', '1')
            final = document['improve']['final_campaign']
            document['final'] = self.call(case, 'posterior', final)
        self.write(self.path(case, 'verdict.json'), json.dumps(document, indent=1))

    def call(self, case, *arguments):
        state = [] if arguments[0] in ('simulate', 'effects') else ['--state', self.path(case, 'state')]
        r = subprocess.run([self.calibctl, *arguments, *state, '--json'], capture_output=True, text=True,
                           stdin=subprocess.DEVNULL)
        if r.returncode != 0:
            raise Failed(f'{arguments[0]} ended with {r.returncode}: {r.stderr.strip()[-200:]}')
        return json.loads(r.stdout)

    def write(self, path, text):
        with open(path + '.new', 'w') as out:
            out.write(text)
        os.replace(path + '.new', path)

    # ---- measurements -------------------------------------------------------------------------------------------------
    def campaign(self, seed, particles, staging, effects, parameters, realizations, tests=tuple(PRESSURES)):
        fixed = ''.join(f', {name}: {value!r}' for name, value in parameters)
        text = f"""name: hidden
model: {{contact: hertz_mindlin, effects: [{', '.join(effects)}], density: 2650000 kg/m^3, fixed: {{poisson_ratio: 0.2{fixed}}}}}
parameters:
  young_modulus: {{prior: log_uniform, min: 0.2 GPa, max: 4 GPa}}
  friction_coefficient: {{prior: uniform, min: 0.1, max: 1.0}}
"""
        text += 'experiments:\n'
        for name in tests:
            pressure, role = PRESSURES[name]
            text += f"""  - name: {name}
    test: triaxial_drained
    confining_pressure: {pressure}
    packing: {{generate: {{particles: {particles}, porosity: 0.40, radii: {{mean: 1.5 mm, spread: 0.3}}, seed: {seed}}}}}
    realizations: {realizations}
    data: {{file: {name}.csv, strain: logarithmic}}
    control: {{column: axial_strain, noise: 1e-5}}
    staging: {{rate: {staging['rate']} 1/s, step: {staging['step']}, damping: [{staging['damping']}, 0.9], unbalanced: 1e-3}}
    observables:
      q_over_p: {{noise: {{relative: {NOISE['q_over_p'][0]}, floor: {NOISE['q_over_p'][1]}}}}}
      volumetric_strain: {{noise: {{absolute: {NOISE['volumetric_strain'][1]}}}}}
    role: {role}
"""
        return text + 'inference: {method: iterative_bayesian_filter, samples: 24, max_iterations: 3}\nseed: 7\n'

    def draw_truth(self, case, rnd):
        """Base parameters, and strengths of what is hidden: of a single effect such that lambda is the case's at just these base
        parameters. It differs by a factor of two over the priors; parameters where no strength reaches it are drawn again."""
        for _ in range(DRAWS):
            truth = {'young_modulus': math.exp(rnd.uniform(*map(math.log, YOUNG))), 'friction_coefficient': rnd.uniform(*FRICTION)}
            if not case.strength:
                return truth, case.parameters
            effect, = case.effects
            own = self.strengths()[effect]
            tuned = self.visibility(1).tuned(effect, self.detectable()[effect], self.parameters_of(effect), own['measured'],
                                             case.strength, truth)
            if tuned is not None:
                values, found = tuned
                self.write(self.sealed(case, '.lambda.json'), json.dumps(found))
                return truth, tuple(sorted(values.items()))
        raise Failed(f'no strength of {effect} was found at which lambda is {case.strength}, for {DRAWS} draws of the base parameters')

    def measure(self, case):
        """Another packing (seed), 340 grains instead of 300, another rate, step or number of grains where the case says so."""
        rnd = random.Random(case.seed)
        truth, parameters = self.draw_truth(case, rnd)
        staging = {**STAGING, 'grains': 340}
        staging.update({'rate': {'rate': 0.2}, 'step': {'step': 0.002}, 'damping': {'damping': 0.6}, 'grains': {'grains': 600}}.get(case.staging, {}))
        work = self.path(case, 'making')
        os.makedirs(work, exist_ok=True)
        path = axial_strains()
        for name in PRESSURES:
            rows = ''.join(f'{strain!r},1,1\n' for strain in path)
            self.write(os.path.join(work, name + '.csv'), 'axial_strain,q_over_p,volumetric_strain\n' + rows)
        self.write(os.path.join(work, 'campaign.yaml'),
                   self.campaign(case.seed + 50000, staging['grains'], staging, case.effects, parameters, 1))
        states = os.path.join(work, 'states.csv')
        given = [a for k, v in truth.items() for a in ('--set', f'{k}={v!r}')]
        r = subprocess.run([self.calibctl, 'simulate', os.path.join(work, 'campaign.yaml'), *given, '-o', states],
                           capture_output=True, text=True, stdin=subprocess.DEVNULL)
        if r.returncode != 0:
            raise Failed(f'simulate ended with {r.returncode}: {r.stderr.strip()[-200:]}')
        by_test = {name: [] for name in PRESSURES}
        for row in csv.DictReader(open(states)):
            by_test[row['experiment']].append(row)
        for name, rows in by_test.items():
            text = '# made by deploy/bench/hidden-effects\naxial_strain,q_over_p,volumetric_strain\n'
            for strain, row in zip(path, rows):
                values_ = []
                for observable, (relative, absolute) in NOISE.items():
                    y = float(row[observable])
                    values_.append(y + rnd.gauss(0, 1) * math.hypot(relative * y, absolute))
                text += f'{strain!r},{values_[0]:.6g},{values_[1]:.6g}\n'
            self.write(self.path(case, name + '.csv'), text)
        sealed = json.dumps({'effects': case.effects, 'parameters': {**truth, **dict(parameters)}, 'staging': case.staging}, indent=1)
        self.write(self.sealed(case, '.json'), sealed)
        self.write(self.path(case, 'truth.sha256'), digest(sealed) + '\n')
        for entry in os.listdir(work):
            os.remove(os.path.join(work, entry))
        os.rmdir(work)
        # Last: a folder with a campaign is a complete measurement.
        self.write(self.path(case, 'campaign.yaml'), self.campaign(1, STAGING['grains'], STAGING, (), (), PACKINGS))

    def verdict(self, case):
        return json.load(open(self.path(case, 'verdict.json')))

    def truth(self, case):
        """Of a case that has its verdict; the digest must be the one written down when the measurement was made."""
        if not self.finished(case):
            raise Failed(f'{case.name}: sealed until there is a verdict')
        sealed = open(self.sealed(case, '.json')).read()
        if digest(sealed) != open(self.path(case, 'truth.sha256')).read().strip():
            raise Failed(f'{case.name}: the sealed truth has been changed')
        return json.loads(sealed)

    # ---- strengths ----------------------------------------------------------------------------------------------------
    def catalogue(self):
        if not hasattr(self, '_catalogue'):
            r = subprocess.run([self.calibctl, 'effects', '--json'], capture_output=True, text=True, check=True)
            self._catalogue = {e['name']: e for e in json.loads(r.stdout)}
        return self._catalogue

    def parameters_of(self, effect):
        return {f"{effect}.{p['name']}": p for p in self.catalogue()[effect]['parameters']}

    def detectable(self):
        return json.load(open(os.path.join(self.folder, 'detectable.json')))['detectable']

    def measure_detectability(self):
        import cases
        path = os.path.join(self.folder, 'detectable.json')
        if os.path.exists(path):
            return
        for seed in range(1, 6):  # a control that is judged adequate says what could have been seen
            case = cases.Case(f'scale-{seed}', ('scale',), seed)
            self.run(case)
            verdict = json.load(open(self.path(case, 'verdict.json')))['diagnose']
            if verdict['verdict'] == 'adequate':
                self.write(path, json.dumps({'detectable': verdict['detectable'],
                                             'candidates': len(verdict['candidates'])}, indent=1))
                return
        raise Failed('none of five measurements without a hidden effect was judged adequate')

    def visibility(self, jobs):
        import strengths
        with self._lock:  # cases are measured side by side
            if self._visibility is None:
                self._visibility = strengths.Strengths(self, jobs)
                self._visibility.prepare()
            self._visibility.jobs = jobs
        return self._visibility

    def strengths(self, jobs=0):
        """{effect: {'strengths': {lambda: [values, lambda found, its se, variance]}, 'measured': ..., 'rival': [degrees, effect]}};
        measured once, with jobs > 0, and kept."""
        import cases
        path = os.path.join(self.folder, 'strengths.json')
        if not os.path.exists(path):
            if jobs == 0:
                return {}
            found, visible = self.detectable(), self.visibility(jobs)
            document, signatures = {}, {}
            for effect, values in sorted(found.items()):
                of_effect, measured = visible.of(effect, values, self.parameters_of(effect), cases.LAMBDAS)
                document[effect] = {'strengths': of_effect, 'measured': measured}
                print(f'{effect}: lambda ' + ', '.join(f'{value:.0f} +- {error:.0f} at {multiple:.3g}x (variance {variance:.1f})' for multiple, value, error, variance in measured),
                      file=sys.stderr, flush=True)
                if of_effect:  # at 60, or the nearest that there is
                    near = min(of_effect, key=lambda strength: abs(math.log(strength / 60)))
                    signatures[effect], _ = visible.signature((effect,), of_effect[near][0])
            for effect, own in signatures.items():
                angles = []
                for other, its in signatures.items():
                    two_sided = any(self.catalogue()[e]['two_sided'] for e in (effect, other))
                    degrees = visible.angle(own, its, two_sided) if other != effect else None
                    if degrees is not None:
                        angles.append((degrees, other))
                document[effect]['rival'] = min(angles, default=None)
            self.write(path, json.dumps(document, indent=1))
        return json.load(open(path))

    def visible_at_truth(self, case, jobs=0):
        """lambda of what is hidden in a case at that case's own parameters, its standard error and the variance along it;
        kept beside the sealed truth, which a finished verdict opens."""
        path = self.sealed(case, '.lambda.json')
        if not os.path.exists(path):
            if jobs == 0:
                return None
            truth = self.truth(case)
            base = {name: truth['parameters'][name] for name in ('young_modulus', 'friction_coefficient')}
            values = {name: value for name, value in truth['parameters'].items() if name not in base}
            self.write(path, json.dumps(self.visibility(jobs).visible(tuple(truth['effects']), values, base)))
        return json.load(open(path))
