"""Curves on many packings for tests/verification/inference/few_packings_test.cc, and that test on them. See ../few-packings."""
import argparse, concurrent.futures, csv, math, os, pathlib, subprocess, sys, tempfile

EXAMPLE = pathlib.Path(__file__).resolve().parents[2] / 'examples/hidden_effect'
FITTED = ('tx100', 'tx400')
OBSERVABLES = ('stress_ratio', 'volumetric_strain')
MODULUS, FRICTION = 8e8, 0.42


def curve(options, seed):
    """Rows of both fitted experiments on one packing, as floats; run once, then read from options.keep."""
    done = options.keep / f'{options.particles}-{seed}.csv'
    if not done.exists():
        text = (EXAMPLE / 'campaign.yaml').read_text()
        for old, new in [('particles: 200', f'particles: {options.particles}'), ('seed: 1}', f'seed: {seed}}}'),
                         *((f'file: {name}.csv', f'file: {EXAMPLE / name}.csv') for name in ('tx100', 'tx200', 'tx400'))]:
            assert old in text, old
            text = text.replace(old, new)
        with tempfile.TemporaryDirectory() as folder:
            campaign, states = pathlib.Path(folder, 'campaign.yaml'), pathlib.Path(folder, 'states.csv')
            campaign.write_text(text)
            subprocess.run([options.bin / 'calibctl', 'simulate', campaign, '--set', f'young_modulus={MODULUS}', '--set',
                            f'friction_coefficient={FRICTION}', '-o', states], check=True, stdout=subprocess.DEVNULL)
            part = done.with_suffix('.part')
            part.write_text(states.read_text())
            part.rename(done)
    with open(done) as file:
        return [row for row in csv.DictReader(file) if row['experiment'] in FITTED]


def values(rows):
    return [float(row[name]) for name in OBSERVABLES for row in rows]


def mean(curves):
    return [sum(column) / len(curves) for column in zip(*curves)]


def difference(a, b):
    return [x - y for x, y in zip(a, b)]


def path_lengths(rows):
    """Since the start of each experiment, in axial strain; and the loading stage, which turns where the strain does."""
    lengths, stages = [], []
    for k, row in enumerate(rows):
        first = k == 0 or rows[k - 1]['experiment'] != row['experiment']
        step = 0 if first else float(row['axial_strain']) - float(rows[k - 1]['axial_strain'])
        if first:
            length, stage, forward = 0, 0, True
        elif (step > 0) != forward:
            stage, forward = stage + 1, not forward
        length += abs(step)
        lengths.append(length)
        stages.append(stage)
    return lengths, stages


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--bin', type=pathlib.Path, required=True)
    parser.add_argument('--packings', type=int, default=160)
    parser.add_argument('--particles', type=int, default=200)
    parser.add_argument('--measurements', type=int, default=300)
    parser.add_argument('--jobs', type=int, default=2)
    parser.add_argument('--keep', type=pathlib.Path, default=pathlib.Path(tempfile.gettempdir(), 'calib-few-packings'))
    parser.add_argument('--check', action='store_true', help='options only: nothing is run')
    options = parser.parse_args()
    if options.packings < 20:
        parser.error('--packings: at least 20, so that sixteen and a measurement can be drawn from them')
    if options.check:
        return 0
    options.keep.mkdir(parents=True, exist_ok=True)
    seeds = range(1001, 1001 + options.packings)
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        runs = list(pool.map(lambda seed: values(curve(options, seed)), seeds))
    rows = curve(options, seeds[0])
    centre = mean(runs)
    # Noise as in the campaign file: 1.5 % with a floor of 0.015, 0.06 % of strain.
    sd = [math.hypot(0.015 * value, 0.015) if k < len(rows) else 6e-4 for k, value in enumerate(centre)]
    in_sd = lambda curves: [[value / unit for value, unit in zip(curve, sd)] for curve in curves]
    lengths, stages = path_lengths(rows)
    group = [2 * OBSERVABLES.index(name) + FITTED.index(row['experiment']) for name in OBSERVABLES for row in rows]
    runs = in_sd([difference(run, centre) for run in runs])
    scatter = math.sqrt(sum(value * value for run in runs for value in run) / (len(runs) * len(sd)))
    print(f'{len(runs)} packings of {options.particles} grains, {len(sd)} readings; packings differ by {scatter:.2f} sd of the noise')
    table = options.keep / 'packings.txt'
    with open(table, 'w') as file:
        for matrix in (runs, [group, stages * 2, lengths * 2]):
            print(len(matrix), len(matrix[0]), file=file)
            for row in matrix:
                print(*(f'{value:.10g}' for value in row), file=file)
    test = [options.bin / 'inference_few_packings_test', '--gtest_filter=*AsRareAsItsPValueSays']
    environment = {**os.environ, 'CALIB_PACKINGS': str(table), 'CALIB_MEASUREMENTS': str(options.measurements)}
    return subprocess.run(test, env=environment).returncode


if __name__ == '__main__':
    sys.exit(main())
