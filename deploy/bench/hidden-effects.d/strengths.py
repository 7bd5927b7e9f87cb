"""Strengths of hidden effects by what is visible of them: by runs of the engine, never by what a diagnosis makes of its own.

lambda(strength) is the squared distance, in standard deviations of a measurement on one packing, between the model with
the effect and the nearest that the model without it can do. Both are means over packings. Pairs of runs decorrelate within
a percent of strain, so the square of a mean difference is mostly chance: products of the differences of different packings
are taken, whose mean is lambda without bias.

Packings scatter more where friction is high, and more along smooth directions than neighbouring readings tell. So the
covariance is that of the nearest imitation's friction, and lambda is divided by the variance of a measurement along the
visible difference as the packings themselves show it: the square of a signal over its noise.

Needs numpy, but for the table of rays.
"""
import collections, concurrent.futures, dataclasses, itertools, json, math, os, statistics, sys, threading

import laboratory, programs

LAYOUT = laboratory.STANDARD
CENTER = {'young_modulus': 0.85e9, 'friction_coefficient': 0.4}
RANGE = {'young_modulus': 1.8 / 0.85, 'friction_coefficient': 2}  # factors either way, to the ends of the priors
PAIRS, SCATTER, MEAN_GRAINS = 4, 16, 340                          # packings of the differences, of a covariance; their grains
FRICTIONS = (0.2, 0.4, 0.57, 0.8)                                 # at which covariances are measured
CORRECTIONS, NEAR = 3, 0.2                                        # of an interpolated strength, until lambda is this near
WANTED, FARTHEST = (60, 400), 6                                   # lambdas; doublings or halvings of a catalogue step


@dataclasses.dataclass(frozen=True)
class Ray:
    """A way to turn an effect up, as in dem/effects: a parameter leaves its null while others are held."""
    parameter: str
    steps: tuple                 # from the null, in units of the parameter's reference scale, the nearer first
    held: dict = dataclasses.field(default_factory=dict)     # other parameters over their scale
    order: float = 1             # lambda goes with the step to twice this power, about


RAYS = {
    'adhesion_dmt': (Ray('work_of_adhesion', (0.1, 0.4)),),
    'adhesion_jkr': (Ray('work_of_adhesion', (0.1, 0.4)),),
    'apparatus_compliance': (Ray('compliance', (0.1, 0.5)),),
    'capillary_bridges': (Ray('surface_tension', (0.05, 0.2), {'volume_ratio': 1e-3}),),
    'contact_plasticity': (Ray('stiffness_ratio', (0.5, 2)),),
    'hertz_nonlinearity': (Ray('exponent', (0.2, 0.4), {'reference_pressure': 1}),),
    'initial_density': (Ray('densification', (0.5, 1.5)),),
    'initial_fabric': (Ray('stress_anisotropy', (0.2, 0.5)),),
    'linear_cohesion': (Ray('energy_density', (1, 3)),),
    'load_cell_error': (Ray('gain', (0.05, 0.15)), Ray('offset', (0.03, 0.1))),
    'membrane_stiffness': (Ray('stiffness', (0.5, 2)),),
    'nonspherical_shape': (Ray('aspect', (0.1, 0.3)),),
    'particle_crushing': (Ray('weakness', (0.1, 0.12), {'reference_diameter': 1}, order=3),),
    'pressure_dependent_friction': (Ray('exponent', (0.1, 0.25), {'reference_pressure': 1}),),
    'rolling_resistance': (Ray('friction', (0.1, 0.3), {'stiffness_ratio': 1}), Ray('stiffness_ratio', (0.1, 0.5), {'friction': 0.3})),
    'strain_offset': (Ray('offset', (0.1, 0.4), {'stress': 0.3}),),
    'twisting_resistance': (Ray('friction', (0.1, 0.3), {'stiffness_ratio': 1}), Ray('stiffness_ratio', (0.1, 0.5), {'friction': 0.3})),
}
NOT_HERE = {'viscous_damping': 'shows where grains move', 'wall_friction': 'shows where there are walls'}
# Parameters that shape an effect, over their scale: drawn log-uniformly for the row of other shapes, on the first ray.
SHAPES = {
    'capillary_bridges': ('volume_ratio', 1e-4, 1e-2),
    'particle_crushing': ('weibull_modulus', 1.5, 6),
    'rolling_resistance': ('stiffness_ratio', 0.03, 0.5),
    'strain_offset': ('stress', 0.075, 1.2),
    'twisting_resistance': ('stiffness_ratio', 0.03, 0.5),
}


def scale_of(info, reference):
    scale = info['reference_scale']
    return scale['factor'] * math.prod(value ** scale[quantity] for quantity, value in reference.items())


def prior_of(info, reference):
    """Ends of the prior that the effect gets in these campaigns: the default one, or that of value over scale."""
    scaled = info['scaled_default_prior']
    return {end: scaled[end] * scale_of(info, reference) for end in ('min', 'max')} if scaled else info['default_prior']


def values_on(effect, ray, step, entry, reference, shape=None, contact='hertz_mindlin'):
    """SI values of the parameters of an effect at a signed step along a ray, within the prior. entry: of the catalogue; shape:
    {parameter: value over scale} instead of what the ray holds."""
    infos, values = {p['name']: p for p in entry['parameters']}, {}
    for name, scaled in {**ray.held, **(shape or {})}.items():
        values[f'{effect}.{name}'] = scaled * scale_of(infos[name], reference)
    info = infos[ray.parameter]
    null = (info.get('null_by_contact') or {}).get(contact, info['null_value'])
    limits = prior_of(info, reference)
    values[f'{effect}.{ray.parameter}'] = min(max(null + step * scale_of(info, reference), limits['min']), limits['max'])
    return values


def interpolate(measured, strength):
    """The step at which lambda has the strength, in logarithms between points that rise beyond chance; None outside. measured:
    {step: (lambda, its standard error, ...)}."""
    rising, highest = [], 1
    for step, (value, error, *_) in sorted(measured.items()):
        if value > 2 * error and value > highest:
            rising.append((math.log(step), math.log(value)))
            highest = value
    y = math.log(strength)
    for (x0, y0), (x1, y1) in zip(rising, rising[1:]):
        if y0 <= y <= y1:
            return math.exp(x0 + (x1 - x0) * (y - y0) / (y1 - y0))
    return None


def next_step(step, found, wanted, order):
    """A squared distance: it grows with the square of what goes with a power of the step."""
    return step * min(max((wanted / max(found, 1)) ** (1 / (2 * order)), 0.4), 2.5)


def reach(measured):
    """Largest lambda beyond chance of {step: (lambda, its standard error, ...)}."""
    return max((value for value, error, *_ in measured.values() if value > 2 * error), default=0)


@dataclasses.dataclass
class Scatter:
    whiten: object       # T x T, to unit covariance by the closed form
    departures: object   # SCATTER x T, of the packings from their mean, whitened
    noise: object        # T x T: whitened readings of independent unit errors

    def variance(self, direction):
        """Of a measurement along a whitened direction, T: 1 where the closed form is right."""
        squares = float(((self.departures @ direction) ** 2).sum()) / (len(self.departures) - 1)
        return (squares + float(((direction @ self.noise) ** 2).sum())) / float(direction @ direction)


class Strengths:
    """numpy arrays of T readings: of each fitted test and its observables, in order. Runs are kept in files; any number of threads."""

    def __init__(self, lab, folder, jobs=1, log=sys.stderr):
        self.lab, self.folder, self.jobs, self.log = lab, folder, jobs, log
        self.work = os.path.join(folder, 'runs')
        os.makedirs(self.work, exist_ok=True)
        self._lock, self._locks, self._prepared = threading.Lock(), collections.defaultdict(threading.Lock), False
        self.tests = LAYOUT.fitted()

    # ---- what cases ask ---------------------------------------------------------------------------------------------------
    def ways(self, effect):
        """[(ray, sign)]: they go in turn."""
        signs = (1, -1) if self.lab.catalogue()[effect]['two_sided'] else (1,)
        return [(ray, sign) for ray in RAYS[effect] for sign in signs]

    def excludes(self):
        return {name: entry['excludes'] for name, entry in self.lab.catalogue().items()}

    def known(self):
        """Whether measured() runs nothing."""
        return set(self.stored()) >= set(RAYS)

    def stored(self):
        path = os.path.join(self.folder, 'strengths.json')
        if not os.path.exists(path):
            return {}
        with open(path, encoding='utf-8') as file:
            return json.load(file)

    def measured(self):
        """{effect: [{step: (lambda, standard error, variance)} of each way]} at CENTER; measured once and kept, effect by effect."""
        document = self.stored()
        for effect in sorted(RAYS):
            if effect not in document:
                document[effect] = [sorted(self.along(effect, *way).items()) for way in self.ways(effect)]
                programs.write(os.path.join(self.folder, 'strengths.json'), json.dumps(document, indent=1))
        return {effect: [dict(of) for of in ways] for effect, ways in document.items()}

    def reached(self):
        """{effect: largest lambda of WANTED that it reaches within its prior at CENTER}, of those that reach any."""
        found = {}
        for effect, ways in self.measured().items():
            lambdas = [wanted for wanted in WANTED if max(map(reach, ways)) >= wanted]
            if lambdas:
                found[effect] = max(lambdas)
        return found

    def draw_shape(self, effect, rnd):
        name, low, high = SHAPES[effect]
        return {name: math.exp(rnd.uniform(math.log(low), math.log(high)))}

    def tuned(self, effect, turn, wanted, base, shape=None):
        """(values, (lambda, its standard error, variance)) where lambda at these base parameters is the one wanted, within NEAR;
        None where none was found: the end of the prior comes first, or runs diverge."""
        at_center = self.measured()[effect]
        able = [k for k, of in enumerate(at_center) if reach(of) >= wanted and not (shape and k)]
        if not able:
            return None
        k = able[turn % len(able)]
        ray, _ = self.ways(effect)[k]
        step = interpolate(at_center[k], wanted) or max(at_center[k])
        measured, tried = {}, None
        for _ in range(1 + 2 * CORRECTIONS):
            values = self.values(effect, k, step, shape)
            if values == tried:  # the end of the prior
                return None
            tried, found = values, self.visible((effect,), values, base)
            if found is None:
                return None
            if abs(found[0] / wanted - 1) < NEAR:
                return values, found
            measured[step] = found
            step = interpolate(measured, wanted) or next_step(step, found[0], wanted, ray.order)
        return None

    def values(self, effect, way, step, shape=None):
        ray, sign = self.ways(effect)[way]
        return values_on(effect, ray, sign * step, self.lab.catalogue()[effect], LAYOUT.reference, shape)

    def along(self, effect, ray, sign):
        """{step: (lambda, standard error, variance)} at CENTER, from the catalogue's steps on, until all of WANTED lie between."""
        measured, way = {}, self.ways(effect).index((ray, sign))

        def measure(step):
            values = self.values(effect, way, step)
            if any(self.values(effect, way, known) == values for known in measured):
                return False     # the end of the prior
            found = self.visible((effect,), values)
            if found is not None:
                measured[step] = found
            return found is not None
        far = measure(ray.steps[0]) and measure(ray.steps[1])
        for _ in range(FARTHEST):
            if not far or reach(measured) > 1.2 * max(WANTED):
                break
            far = measure(2 * max(measured))
        for _ in range(FARTHEST):
            if not measured or min(value for value, *_ in measured.values()) < 0.8 * min(WANTED) or not measure(min(measured) / 2):
                break
        print(f'{effect}, {ray.parameter} {sign:+d}: lambda ' + ', '.join(
            f'{value:.0f} +- {error:.0f} at {step:.3g} (variance {variance:.1f})' for step, (value, error, variance)
            in sorted(measured.items())), file=self.log, flush=True)
        return measured

    # ---- runs -------------------------------------------------------------------------------------------------------------
    def history(self, packing, parameters, effects=(), values=()):
        """One run on one packing; kept in a file. None where it diverges."""
        name = os.path.join(self.work, laboratory.digest(json.dumps([packing, sorted(parameters.items()), effects, sorted(values)])))
        with self._lock:
            own = self._locks[name]
        with own:
            if not os.path.exists(name):
                try:
                    rows = self.lab.simulate(name + '.making', LAYOUT, self.tests, parameters, packing=60000 + packing,
                                             grains=MEAN_GRAINS, effects=effects, values=dict(values))
                    curves = [float(row[o]) for test in self.tests for o in LAYOUT.tests[test].noise for row in rows[test]]
                except programs.Failed as failure:
                    if failure.code != 1:    # a slip of ours, no model that cannot go on
                        raise
                    curves = None
                programs.write(name, json.dumps(curves))
        with open(name, encoding='utf-8') as file:
            curves = json.load(file)
        return None if curves is None else self.np.array(curves)

    def histories(self, jobs):
        with concurrent.futures.ThreadPoolExecutor(self.jobs) as pool:
            return list(pool.map(lambda job: self.history(*job), jobs))

    # ---- the model without the effect -------------------------------------------------------------------------------------
    def prepare(self):
        """Once, before anything is measured."""
        with self._lock:
            if self._prepared:
                return
        import numpy
        self.np = np = numpy
        self.plain = np.array(self.histories([(k, CENTER) for k in range(PAIRS)]))
        self.scatters = {friction: self.scatter(friction) for friction in FRICTIONS}
        # What the parameters can imitate: a polynomial in their logarithms, cubic in each, through the means over the packings.
        grid = [dict(zip(CENTER, (CENTER[n] * RANGE[n] ** (a / 2) for n, a in zip(CENTER, axes))))
                for axes in itertools.product((-2, -1, 0, 1, 2), repeat=2)]
        runs = self.histories([(k, point) for point in grid for k in range(PAIRS)])
        means = np.array([np.mean(runs[i * PAIRS:(i + 1) * PAIRS], axis=0) for i in range(len(grid))])
        x = np.array([self.coordinates(point) for point in grid])
        self.response = np.linalg.lstsq(self.terms(x), means - self.plain.mean(axis=0), rcond=None)[0]
        missed = []
        for i, fit in enumerate(self.terms(x) @ self.response):
            rest = (np.array(runs[i * PAIRS:(i + 1) * PAIRS]) - self.plain - fit) @ self.near(grid[i]['friction_coefficient']).whiten.T
            missed.append(self.product(rest, rest)[0])
        print(f'imitation: squared distance of the polynomial from the means at its {len(grid)} points: median '
              f'{statistics.median(missed):.0f}, largest {max(missed):.0f}', file=self.log, flush=True)
        fine = np.linspace(-1, 1, 81)
        self.points = np.array(list(itertools.product(fine, fine)))
        self.imitations = self.terms(self.points) @ self.response
        self._prepared = True

    def scatter(self, friction):
        """Of a measurement at a friction: noise, and what packings differ by, from SCATTER of them."""
        np = self.np
        runs = np.array(self.histories([(PAIRS + k, {**CENTER, 'friction_coefficient': friction}) for k in range(SCATTER)]))
        mean = runs.mean(axis=0)
        laws = [law for test in self.tests for law in LAYOUT.tests[test].noise.values()]
        steps = len(mean) // len(laws)
        noise = np.concatenate([np.hypot(relative * mean[block], absolute) for block, (relative, absolute) in
                                zip(np.split(np.arange(len(mean)), len(laws)), laws)])
        covariance = np.diag(noise ** 2)
        # Scatter of one packing: its own sd, correlated exponentially along the path within a test and observable.
        for block in np.split(np.arange(len(mean)), len(mean) // steps):
            sd = runs[:, block].std(axis=0, ddof=1)
            z = (runs[:, block] - mean[block]) / np.maximum(sd, 1e-300)
            lag = float(np.mean(z[:, 1:-1] * z[:, 2:]) / np.mean(z[:, 1:] ** 2))
            k = np.arange(steps)
            correlation = min(max(lag, 0.01), 0.99) ** np.abs(k[:, None] - k[None, :])
            covariance[np.ix_(block, block)] += correlation * sd[:, None] * sd[None, :]
        whiten = np.linalg.inv(np.linalg.cholesky(covariance))
        return Scatter(whiten, (runs - mean) @ whiten.T, whiten * noise)

    def coordinates(self, point):
        return [math.log(point[n] / CENTER[n]) / math.log(RANGE[n]) for n in CENTER]

    def terms(self, x):
        a, b = x[:, 0], x[:, 1]
        return self.np.stack([a, b, a * a, a * b, b * b, a * a * a, a * a * b, a * b * b, b * b * b], axis=1)

    def near(self, friction):
        return self.scatters[min(FRICTIONS, key=lambda f: abs(math.log(f / friction)))]

    # ---- an effect ----------------------------------------------------------------------------------------------------
    def signature(self, effects, values, base=None):
        """What the effects change on each packing at base parameters (CENTER), less the nearest imitation, PAIRS x T in the
        readings' units, and the scatter of measurements there; None where runs diverge."""
        np, base = self.np, base or CENTER
        jobs = [(k, base, effects, tuple(sorted(values.items()))) for k in range(PAIRS)]
        if base is not CENTER:
            jobs += [(k, base) for k in range(PAIRS)]
        runs = self.histories(jobs)
        if any(run is None for run in runs):
            return None
        differences = np.array(runs[:PAIRS]) - (self.plain if base is CENTER else np.array(runs[PAIRS:]))
        imitations = self.imitations - self.terms(np.array([self.coordinates(base)])) @ self.response
        scatter = self.near(base['friction_coefficient'])
        for _ in range(2):  # the nearest in the errors of its own friction
            distances = (((imitations - differences.mean(axis=0)) @ scatter.whiten.T) ** 2).sum(axis=1)
            nearest = np.argmin(distances)
            scatter = self.near(CENTER['friction_coefficient'] * RANGE['friction_coefficient'] ** self.points[nearest, 1])
        return differences - imitations[nearest], scatter

    @staticmethod
    def product(a, b):
        """Mean of the products of whitened signatures of different packings, and its standard error (that of independent pairs)."""
        products = [float(a[i] @ b[j] + a[j] @ b[i]) / 2 for i, j in itertools.combinations(range(PAIRS), 2)]
        return statistics.mean(products), statistics.stdev(products) / math.sqrt(len(products))

    def visible(self, effects, values, base=None):
        """lambda, its standard error, and the variance along what is visible over that of the closed form; None where runs
        diverge."""
        found = self.signature(effects, values, base)
        if found is None:
            return None
        signature, scatter = found
        whitened = signature @ scatter.whiten.T
        visible = whitened.mean(axis=0)
        if not visible.any():  # too weak to do anything, as crushing is below a threshold
            return 0.0, 0.0, 1.0
        variance = scatter.variance(visible)
        return tuple(value / variance for value in self.product(whitened, whitened)) + (variance,)
