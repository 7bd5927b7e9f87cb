"""Strengths of hidden effects by what is visible of them: simulated, not taken from the diagnosis under test.

lambda(strength) is the squared distance, in standard deviations of a measurement on one packing, between the model with
the effect and the nearest that the model without it can do. Both are means over packings. Pairs of runs decorrelate within
a percent of strain, so the square of a mean difference is mostly chance: products of the differences of different packings
are taken, whose mean is lambda without bias.
"""
import csv, concurrent.futures, itertools, json, math, os, statistics, subprocess

import laboratory

CENTER = {'young_modulus': 0.85e9, 'friction_coefficient': 0.45}
RANGE = {'young_modulus': 2.2, 'friction_coefficient': 1.8}      # factors either way that the imitation may use
PAIRS, SCATTER = 4, 16                                           # packings of the differences, of the covariance
MULTIPLES = (0.5, 1, 2, 4, 8)                                    # of the strength that the diagnosis calls detectable
FITTED = [name for name, (_, role) in laboratory.PRESSURES.items() if role == 'calibrate']


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
        runs = np.array(self.histories([(k, CENTER) for k in range(PAIRS + SCATTER)]))
        self.plain, others = runs[:PAIRS], runs[PAIRS:]
        mean = others.mean(axis=0)
        steps = len(laboratory.axial_strains())
        noise = np.concatenate([np.hypot(relative * mean[block], absolute) for block, (relative, absolute) in
                                zip(np.split(np.arange(len(mean)), len(FITTED) * len(laboratory.NOISE)),
                                    list(laboratory.NOISE.values()) * len(FITTED))])
        covariance = np.diag(noise ** 2)
        # Scatter of one packing: its own sd, correlated exponentially along the path within a test and observable.
        for block in np.split(np.arange(len(mean)), len(mean) // steps):
            sd = others[:, block].std(axis=0, ddof=1)
            z = (others[:, block] - mean[block]) / np.maximum(sd, 1e-300)
            lag = float(np.mean(z[:, 1:-1] * z[:, 2:]) / np.mean(z[:, 1:] ** 2))
            k = np.arange(steps)
            correlation = min(max(lag, 0.01), 0.99) ** np.abs(k[:, None] - k[None, :])
            covariance[np.ix_(block, block)] += correlation * sd[:, None] * sd[None, :]
        self.whiten = np.linalg.inv(np.linalg.cholesky(covariance))
        # What the parameters can imitate: a quadratic in their logarithms through the means over the packings.
        grid = [dict(zip(CENTER, (CENTER[n] * RANGE[n] ** (a / 2) for n, a in zip(CENTER, axes))))
                for axes in itertools.product((-2, -1, 0, 1, 2), repeat=2)]
        runs = self.histories([(k, point) for point in grid for k in range(PAIRS)])
        means = np.array([np.mean(runs[i * PAIRS:(i + 1) * PAIRS], axis=0) for i in range(len(grid))])
        x = np.array([self.coordinates(point) for point in grid])
        change = (means - self.plain.mean(axis=0)) @ self.whiten.T
        self.response = np.linalg.lstsq(self.terms(x), change, rcond=None)[0]
        fine = np.linspace(-1, 1, 81)
        self.imitations = self.terms(np.array(list(itertools.product(fine, fine)))) @ self.response

    def coordinates(self, point):
        return [math.log(point[n] / CENTER[n]) / math.log(RANGE[n]) for n in CENTER]

    def terms(self, x):
        a, b = x[:, 0], x[:, 1]
        return self.np.stack([a, b, a * a, a * b, b * b], axis=1)

    # ---- an effect ----------------------------------------------------------------------------------------------------
    def visible(self, effect, values):
        """lambda at given parameter values, and its standard error; None where runs diverge."""
        np = self.np
        runs = self.histories([(k, CENTER, (effect,), tuple(values.items())) for k in range(PAIRS)])
        if any(run is None for run in runs):
            return None
        differences = (np.array(runs) - self.plain) @ self.whiten.T
        mean = differences.mean(axis=0)
        nearest = self.imitations[np.argmin(((self.imitations - mean) ** 2).sum(axis=1))]
        rest = differences - nearest
        products = [float(rest[i] @ rest[j]) for i, j in itertools.combinations(range(PAIRS), 2)]
        return statistics.mean(products), statistics.stdev(products) / math.sqrt(len(products))

    def of(self, effect, detectable, infos, wanted):
        """{lambda: values} and what was measured: strengths by interpolation in logarithms; a lambda that no strength
        within the effect's default prior reaches is left out."""
        def at(multiple):
            own = {}
            for name, value in detectable.items():
                null = infos[name]['null_value']
                null = infos[name].get('null_by_contact', {}).get('hertz_mindlin', null)
                moved = value if null is None else null + (value - null) * multiple  # what only shapes the effect is held
                # Default priors of dimensionless parameters are taken as they are; others are scaled to the grains.
                limits = infos[name]['default_prior'] if infos[name]['unit'] == '1' else infos[name]
                low, high = limits.get('min'), limits.get('max')
                own[name] = min(max(moved, -math.inf if low is None else low), math.inf if high is None else high)
            return own
        measured = []
        for multiple in MULTIPLES:
            found = self.visible(effect, at(multiple))
            if found is None:
                break
            measured.append((multiple, *found))
            if found[0] > 2 * max(wanted) or multiple >= 1 and found[0] <= 2 * found[1]:
                break  # enough, or nothing to be seen
        strengths, highest = {}, 0
        rising = []
        for multiple, value, error in measured:  # beyond the chance of zero, and rising
            if value > 2 * error and value > max(highest, 1):
                rising.append((math.log(multiple), math.log(value)))
                highest = value
        for strength in wanted:
            y = math.log(strength)
            if not rising or y > rising[-1][1]:
                continue
            if y <= rising[0][1]:  # small strengths: the difference is as large as the strength
                x = rising[0][0] + (y - rising[0][1]) / 2
            else:
                (x0, y0), (x1, y1) = next((a, b) for a, b in zip(rising, rising[1:]) if a[1] < y <= b[1])
                x = x0 + (x1 - x0) * (y - y0) / (y1 - y0)
            strengths[strength] = at(math.exp(x))
        return strengths, measured
