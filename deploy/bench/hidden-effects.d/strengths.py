"""Strengths of hidden effects by what is visible of them: simulated, not taken from the diagnosis under test.

lambda(strength) is the squared distance, in standard deviations of a measurement on one packing, between the model with
the effect and the nearest that the model without it can do. Both are means over packings. Pairs of runs decorrelate within
a percent of strain, so the square of a mean difference is mostly chance: products of the differences of different packings
are taken, whose mean is lambda without bias.

Packings scatter more where friction is high, and more along smooth directions than neighbouring readings tell. So the
covariance is that of the nearest imitation's friction, and lambda is divided by the variance of a measurement along the
visible difference as the packings themselves show it: the square of a signal over its noise.
"""
import csv, concurrent.futures, dataclasses, itertools, json, math, os, statistics, subprocess, sys

import laboratory

CENTER = {'young_modulus': 0.85e9, 'friction_coefficient': 0.45}
REFERENCE = {'pressure': 0.2e6, 'diameter': 3e-3, 'modulus': 0.6e9}  # of the fitted tests; the softest grains of laboratory.YOUNG
RANGE = {'young_modulus': 4 / 0.85, 'friction_coefficient': 1 / 0.45}  # factors either way, to the ends of the priors
PAIRS, SCATTER = 4, 16                                           # packings of the differences, of a covariance
FRICTIONS = (0.2, 0.45, 0.65, 1.0)                               # at which covariances are measured
UPWARDS, DOWNWARDS = (1, 2, 4, 8), (0.5, 0.25, 0.125, 1 / 16, 1 / 32)   # times what the diagnosis calls detectable
CORRECTIONS, NEAR = 3, 0.2                                       # of an interpolated strength, until lambda is this near
FITTED = [name for name, (_, role) in laboratory.PRESSURES.items() if role == 'calibrate']


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
    """numpy arrays of T readings, in the order of `simulate`'s rows and NOISE's observables."""

    def __init__(self, lab, jobs):
        import numpy
        self.np, self.lab, self.jobs = numpy, lab, jobs
        self.work = os.path.join(lab.folder, 'strengths')
        os.makedirs(self.work, exist_ok=True)

    # ---- runs ---------------------------------------------------------------------------------------------------------
    def history(self, packing, parameters, effects=(), values=()):
        """One run on one packing; kept in a file. None where it diverges."""
        given = json.dumps([packing, sorted(parameters.items()), effects, sorted(values)])
        name = os.path.join(self.work, laboratory.digest(given))
        if not os.path.exists(name + '.csv'):
            text = self.lab.campaign(60000 + packing, 340, {**laboratory.STAGING, 'grains': 340}, effects, sorted(values), 1, FITTED)
            self.lab.write(name + '.yaml', text)
            sets = [a for k, v in parameters.items() for a in ('--set', f'{k}={v!r}')]
            r = subprocess.run([self.lab.calibctl, 'simulate', name + '.yaml', *sets, '-o', name + '.csv.new'],
                               capture_output=True, text=True, stdin=subprocess.DEVNULL)
            os.remove(name + '.yaml')
            if r.returncode != 0:
                return None
            os.replace(name + '.csv.new', name + '.csv')
        rows = list(csv.DictReader(open(name + '.csv')))
        return self.np.array([float(row[o]) for test in FITTED for o in laboratory.NOISE for row in rows
                              if row['experiment'] == test])

    def histories(self, jobs):
        with concurrent.futures.ThreadPoolExecutor(self.jobs) as pool:
            return list(pool.map(lambda job: self.history(*job), jobs))

    # ---- the model without the effect ---------------------------------------------------------------------------------
    def prepare(self):
        np = self.np
        for test in laboratory.PRESSURES:
            rows = ''.join(f'{strain!r},1,1\n' for strain in laboratory.axial_strains())
            self.lab.write(os.path.join(self.work, test + '.csv'), 'axial_strain,q_over_p,volumetric_strain\n' + rows)
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
              f'{statistics.median(missed):.0f}, largest {max(missed):.0f}', file=sys.stderr, flush=True)
        fine = np.linspace(-1, 1, 81)
        self.points = np.array(list(itertools.product(fine, fine)))
        self.imitations = self.terms(self.points) @ self.response

    def scatter(self, friction):
        """Of a measurement at a friction: noise, and what packings differ by, from SCATTER of them."""
        np = self.np
        runs = np.array(self.histories([(PAIRS + k, {**CENTER, 'friction_coefficient': friction}) for k in range(SCATTER)]))
        mean = runs.mean(axis=0)
        steps = len(laboratory.axial_strains())
        noise = np.concatenate([np.hypot(relative * mean[block], absolute) for block, (relative, absolute) in
                                zip(np.split(np.arange(len(mean)), len(FITTED) * len(laboratory.NOISE)),
                                    list(laboratory.NOISE.values()) * len(FITTED))])
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

    def angle(self, a, b, two_sided):
        """Between two signatures (readings' units) in the errors at CENTER, degrees."""
        a, b = (x @ self.near(CENTER['friction_coefficient']).whiten.T for x in (a, b))
        lengths = [self.product(x, x)[0] for x in (a, b)]
        if min(lengths) <= 0:
            return None
        cosine = max(-1.0, min(1.0, self.product(a, b)[0] / math.sqrt(lengths[0] * lengths[1])))
        return math.degrees(math.acos(abs(cosine) if two_sided else cosine))

    def of(self, effect, detectable, infos, wanted):
        """{lambda: (values, lambda found there, its standard error, variance)} and what was measured on the way: strengths by
        interpolation in logarithms, measured there and corrected; a lambda that no strength within the effect's default
        prior reaches is left out."""
        def at(multiple):
            return values_at(multiple, detectable, infos)
        measured = {}
        def measure(multiple):
            found = self.visible((effect,), at(multiple))
            if found is not None:
                measured[multiple] = found
            return found
        unseen = 0
        for multiple in UPWARDS:
            found = measure(multiple)
            unseen = unseen + 1 if found is not None and found[0] <= 2 * found[1] else 0
            if found is None or found[0] > max(wanted) or unseen == 2:
                break
        for multiple in DOWNWARDS:
            least = min(value for value, *_ in measured.values())
            if unseen == 2 or least < min(wanted):
                break
            found = measure(multiple)
            if found is None or found[0] > least + 2 * found[1]:  # an effect that does not vanish towards its null
                measured.pop(multiple, None)
                break
        strengths = {}
        for strength in wanted:
            for _ in range(CORRECTIONS):
                multiple = interpolate(measured, strength)
                if multiple is None:
                    break
                found = measured.get(multiple) or measure(multiple)
                if found is None:
                    break
                strengths[strength] = (at(multiple), *found)
                if abs(found[0] / strength - 1) < NEAR:
                    break
        return strengths, sorted((multiple, *found) for multiple, found in measured.items())


    def tuned(self, effect, detectable, infos, known, wanted, base):
        """(values, (lambda, its standard error, variance)) where lambda at these base parameters is the one wanted, within NEAR;
        None where none was found: the end of the effect's default prior is reached before, or runs diverge. known: rows of what
        of() measured at CENTER."""
        measured, tried = {}, None
        multiple = min((row for row in known if row[1] > 0), key=lambda row: abs(math.log(row[1] / wanted)))[0]
        for _ in range(1 + 2 * CORRECTIONS):
            values = values_at(multiple, detectable, infos)
            if values == tried:  # the end of the prior
                return None
            tried, found = values, self.visible((effect,), values, base)
            if found is None:
                return None
            if abs(found[0] / wanted - 1) < NEAR:
                return values, found
            measured[multiple] = found
            between = interpolate(measured, wanted)
            # A squared distance: it grows with the square of the strength, or about so.
            multiple = between or multiple * min(max(math.sqrt(wanted / max(found[0], 1)), 0.4), 2.5)
        return None


def prior_of(info):
    """Ends of the prior that the effect gets in these campaigns: the default one, or that of value over scale."""
    scaled, scale = info['scaled_default_prior'], info['reference_scale']
    if not scaled:
        return info['default_prior']
    unit = scale['factor']
    for quantity, value in REFERENCE.items():
        unit *= value ** scale[quantity]
    return {end: scaled[end] * unit for end in ('min', 'max')}


def values_at(multiple, detectable, infos):
    """Parameters of an effect at a multiple of what is called detectable, within its default prior."""
    own = {}
    for name, value in detectable.items():
        null = infos[name]['null_value']
        null = infos[name].get('null_by_contact', {}).get('hertz_mindlin', null)
        if null is None:  # what only shapes the effect is held
            own[name] = value
            continue
        limits = prior_of(infos[name])
        own[name] = min(max(null + (value - null) * multiple, limits['min']), limits['max'])
    return own


def interpolate(measured, strength):
    """The multiple at which lambda has the strength, in logarithms between points that rise beyond chance; None outside."""
    rising, highest = [], 1
    for multiple, (value, error, _) in sorted(measured.items()):
        if value > 2 * error and value > highest:
            rising.append((math.log(multiple), math.log(value)))
            highest = value
    y = math.log(strength)
    for (x0, y0), (x1, y1) in zip(rising, rising[1:]):
        if y0 <= y <= y1:
            return math.exp(x0 + (x1 - x0) * (y - y0) / (y1 - y0))
    return None
