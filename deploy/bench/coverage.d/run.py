"""Campaigns at parameters drawn from the prior: how often 90 % intervals hold them. Knows calibctl and files only."""
import argparse, csv, json, math, os, random, subprocess, sys, threading, time

PRIOR = {'young_modulus': (0.2e9, 4e9, 'log_uniform'), 'friction_coefficient': (0.1, 1.0, 'uniform')}
NOISE = {'stress_ratio': (0.01, 0.0), 'volumetric_strain': (0.0, 3e-4)}   # relative, absolute: about 1 % of a curve
STRAINS = [0.003 * i for i in range(21)]
KINDS = {'same': 'measured on the packing of the model', 'other': 'measured on another packing of the same recipe'}


def draw(rnd):
    truth = {}
    for name, (low, high, kind) in PRIOR.items():
        truth[name] = math.exp(rnd.uniform(math.log(low), math.log(high))) if kind == 'log_uniform' else rnd.uniform(low, high)
    return truth


def campaign(kind, grains, packing, batches, seed, realizations):
    names = '\n'.join(f'  {n}: {{prior: {k}, min: {low!r}{u}, max: {high!r}{u}}}'
                      for n, (low, high, k) in PRIOR.items() for u in [' Pa' if n == 'young_modulus' else ''])
    errors = '\n'.join(f'      {n}: {{noise: {{relative: {r}, floor: 0.005}}}}' if r else
                       f'      {n}: {{noise: {{absolute: {a}}}}}' for n, (r, a) in NOISE.items())
    return f"""name: coverage-{kind}
model: {{contact: hertz_mindlin, density: 2650000 kg/m^3, fixed: {{poisson_ratio: 0.2}}}}
parameters:
{names}
experiments:
  - name: tx
    test: triaxial_drained
    confining_pressure: 0.2 MPa
    packing: {{generate: {{particles: {grains}, porosity: 0.40, radii: {{mean: 1.5 mm, spread: 0.3}}, seed: {packing}}}}}
    realizations: {realizations}
    data: {{file: tx.csv, strain: logarithmic}}
    control: axial_strain
    staging: {{rate: 0.1 1/s, step: 0.003, damping: [0.3, 0.9], unbalanced: 1e-3}}
    observables:
{errors}
inference: {{method: iterative_bayesian_filter, samples: {batches[0]}, max_iterations: {batches[1]}}}
seed: {seed}
"""


class Study:
    def __init__(self, options):
        self.options = options

    def path(self, name, *more):
        return os.path.join(self.options.state, name, *more)

    def call(self, *arguments):
        r = subprocess.run([self.options.calibctl, *arguments], capture_output=True, text=True, stdin=subprocess.DEVNULL)
        if r.returncode != 0:
            raise RuntimeError(f'{arguments[0]} ended with {r.returncode}: {r.stderr.strip()[-300:]}')
        return r.stdout

    def write(self, path, text):
        with open(path + '.new', 'w') as out:
            out.write(text)
        os.replace(path + '.new', path)

    def run(self, kind, repeat):
        name = f'{kind}-{repeat}'
        if os.path.exists(self.path(name, 'posterior.json')):
            return
        work = self.path(name, 'making')
        os.makedirs(work, exist_ok=True)
        rnd = random.Random(f'{kind} {repeat}')
        truth = draw(rnd)
        packing = 1000 + 10 * repeat
        realizations = 1 if kind == 'same' else self.options.realizations
        # The measurement: one run at the truth, noise added.
        header = 'axial_strain,' + ','.join(NOISE) + '\n'
        self.write(os.path.join(work, 'tx.csv'), header + ''.join(f'{e!r}' + ',1' * len(NOISE) + '\n' for e in STRAINS))
        made_on = packing if kind == 'same' else packing + 500000
        self.write(os.path.join(work, 'campaign.yaml'), campaign(kind, self.options.grains, made_on, (4, 1), repeat, 1))
        given = [a for k, v in truth.items() for a in ('--set', f'{k}={v!r}')]
        states = os.path.join(work, 'states.csv')
        self.call('simulate', os.path.join(work, 'campaign.yaml'), *given, '-o', states)
        rows = ''
        for strain, row in zip(STRAINS, csv.DictReader(open(states))):
            noisy = [float(row[o]) + rnd.gauss(0, 1) * math.hypot(max(r * float(row[o]), 0.005 if r else 0), a)
                     for o, (r, a) in NOISE.items()]
            rows += f'{strain!r},' + ','.join(f'{v:.7g}' for v in noisy) + '\n'
        self.write(self.path(name, 'tx.csv'), header + rows)
        text = campaign(kind, self.options.grains, packing, (self.options.samples, self.options.iterations), repeat, realizations)
        self.write(self.path(name, 'campaign.yaml'), text)
        out = self.call('run', self.path(name, 'campaign.yaml'), '--workers', '1', '--state', self.path(name, 'state'), '--json')
        self.write(self.path(name, 'posterior.json'), json.dumps({'truth': truth, 'posterior': json.loads(out)}, indent=1))


def wilson(hits, n, z=1.96):
    if n == 0:
        return 0.0, 1.0
    p = hits / n
    middle, half = p + z * z / (2 * n), z * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    return (middle - half) / (1 + z * z / n), (middle + half) / (1 + z * z / n)


def table(study):
    print('| measurement | campaigns | refused | parameter | intervals that hold the truth | 95 % interval | rms of (mean - truth) / sd |')
    print('|---|---|---|---|---|---|---|')
    for kind in study.options.kinds.split(','):
        words = KINDS[kind]
        done = []
        for repeat in range(study.options.repeats):
            try:
                done.append(json.load(open(study.path(f'{kind}-{repeat}', 'posterior.json'))))
            except FileNotFoundError:
                pass
        held = [d for d in done if all(p['q05'] is not None for p in d['posterior']['parameters'].values())]
        everything = [0, 0]
        for name in PRIOR:
            pairs = [(d['truth'][name], d['posterior']['parameters'][name]) for d in held]
            hits = sum(p['q05'] <= t <= p['q95'] for t, p in pairs)
            everything[0] += hits
            everything[1] += len(pairs)
            low, high = wilson(hits, len(pairs))
            rms = math.sqrt(sum(((p['mean'] - t) / p['sd']) ** 2 for t, p in pairs) / max(1, len(pairs)))
            print(f'| {words} | {len(done)} | {len(done) - len(held)} | {name} | {hits}/{len(pairs)} | '
                  f'{100 * low:.0f}–{100 * high:.0f} % | {rms:.2f} |')
        print(f'| {words} | {len(done)} | {len(done) - len(held)} | together | {everything[0]}/{everything[1]} | | |')


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--calibctl', required=True)
    parser.add_argument('--state', default='build/coverage', help='folder of what is finished')
    parser.add_argument('--repeats', type=int, default=40, help='campaigns of each kind')
    parser.add_argument('--kinds', default=','.join(KINDS))
    parser.add_argument('--grains', type=int, default=120)
    parser.add_argument('--samples', type=int, default=50, help='of an iteration')
    parser.add_argument('--iterations', type=int, default=2, help='at most')
    parser.add_argument('--realizations', type=int, default=4, help='packings of a campaign measured on another one')
    parser.add_argument('--parallel', type=int, default=os.cpu_count())
    parser.add_argument('--minutes', type=float, default=1e9, help='no campaign is begun later than this')
    study = Study(parser.parse_args())
    kinds = study.options.kinds.split(',')
    queue = [(kind, repeat) for repeat in range(study.options.repeats) for kind in kinds]
    end, lock, failed = time.monotonic() + 60 * study.options.minutes, threading.Lock(), []

    def work():
        while time.monotonic() < end:
            with lock:
                if not queue:
                    return
                kind, repeat = queue.pop(0)
            try:
                study.run(kind, repeat)
            except RuntimeError as error:
                failed.append(f'{kind}-{repeat}: {error}')
                print(failed[-1], file=sys.stderr)

    threads = [threading.Thread(target=work) for _ in range(study.options.parallel)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    table(study)
    return 1 if failed else 0


sys.exit(main())
