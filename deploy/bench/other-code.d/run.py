"""Runs of another code as measurements: what does a model miss that lacks their physics? Knows calibctl and files only."""
import argparse, csv, json, os, random, subprocess, sys

# name: data, contact law of the model, its fixed parameter, range of the modulus [Pa], what should be named
CASES = {
    'base': ('base', 'hertz_mindlin', 0.2, (3e8, 3e9), None),
    'rolling': ('rolling', 'hertz_mindlin', 0.2, (3e8, 3e9), 'rolling_resistance'),
    'hertz_on_linear': ('linear', 'hertz_mindlin', 0.2, (3e8, 3e9), 'hertz_nonlinearity'),
    'linear_on_base': ('base', 'linear', 0.6, (3e7, 1e9), 'hertz_nonlinearity'),
}
PRESSURES = {'0.2': 'calibrate', '0.5': 'validate', '1.0': 'calibrate'}   # MPa: role
COLUMNS = ('axial_strain', 'volumetric_strain', 'q_over_p')
NOISE = {'q_over_p': 0.01}   # relative, added; the runs' own chance is of the same size


def measurement(source, pressure, target):
    rnd = random.Random(5)
    with open(source) as file, open(target, 'w') as out:
        print(*COLUMNS, sep=',', file=out)
        for row in csv.DictReader(file):
            if row['stage'] != 'iso':
                draws = {name: rnd.gauss(0, 1) for name in COLUMNS}
                print(*(repr(float(row[name]) * (1 + NOISE.get(name, 0) * draws[name])) for name in COLUMNS), sep=',', file=out)


def campaign(name, data):
    case, contact, ratio, modulus, _ = CASES[name]
    text = f"""name: {name}
model: {{contact: {contact}, effects: [], density: 2650000 kg/m^3, fixed: {{poisson_ratio: {ratio}}}}}
parameters:
  young_modulus: {{prior: log_uniform, min: {modulus[0]:g} Pa, max: {modulus[1]:g} Pa}}
  friction_coefficient: {{prior: uniform, min: 0.1, max: 1.0}}
experiments:
"""
    for pressure, role in PRESSURES.items():
        text += f"""  - name: tx_{pressure.replace('.', '_')}
    test: triaxial_drained
    confining_pressure: {pressure} MPa
    packing: {{file: {data}/toyoura_triaxial/packing_1000.txt}}
    data: {{file: {case}_{pressure}.csv, strain: logarithmic}}
    control: axial_strain
    staging: {{rate: 0.1 1/s, step: 0.002, damping: [0.2, 0.9], unbalanced: 5e-4}}
    observables: {{q_over_p: {{noise: {{relative: 0.015, floor: 0.01}}}}, volumetric_strain: {{noise: {{absolute: 6e-4}}}}}}
    role: {role}
"""
    return text + 'inference: {method: iterative_bayesian_filter, samples: 30, max_iterations: 3}\nseed: 7\n'


def step(options, folder, verb, *arguments):
    """the verb's JSON, from the last time or now"""
    path = os.path.join(folder, verb + '.json')
    if not os.path.exists(path):
        print(f'{os.path.basename(folder)}: {verb}', file=sys.stderr, flush=True)
        state = os.path.join(folder, 'state')
        r = subprocess.run([options.calibctl, verb, *arguments, '--state', state, '--workers', str(options.workers), '--json'],
                           capture_output=True, text=True, stdin=subprocess.DEVNULL)
        if r.returncode != 0:
            raise RuntimeError(f'{verb} ended with {r.returncode}: {r.stderr.strip()[-300:]}')
        with open(path + '.new', 'w') as out:
            out.write(r.stdout)
        os.replace(path + '.new', path)
    with open(path) as file:
        return json.load(file)


def run(options, name, data):
    folder = os.path.join(options.state, name)
    os.makedirs(folder, exist_ok=True)
    case = CASES[name][0]
    for pressure in PRESSURES:
        measurement(f'{data}/yade_cases/{case}/triaxial_{pressure}MPa.csv', pressure, os.path.join(folder, f'{case}_{pressure}.csv'))
    file = os.path.join(folder, 'campaign.yaml')
    with open(file, 'w') as out:
        out.write(campaign(name, data))
    c = step(options, folder, 'run', file)['campaign']
    found = step(options, folder, 'diagnose', c)
    if found['verdict'] != 'adequate':
        step(options, folder, 'improve', c, '--max-effects', '2')


def table(options):
    print('| case | should be named | verdict | named | explains | error fitted | error held out | evaluations: run + screen + refits |')
    print('|---|---|---|---|---|---|---|---|')
    for name, (*_, wanted) in CASES.items():
        folder = os.path.join(options.state, name)
        if not os.path.exists(os.path.join(folder, 'diagnose.json')):
            continue
        ran, found = step(options, folder, 'run'), step(options, folder, 'diagnose')
        first = found['candidates'][0]
        group = [found['effect']] if found['effect'] else [first['effect'], *first['confusable_with']]
        named = '–' if found['verdict'] == 'adequate' else ', '.join(group) if found['verdict'] != 'unexplained' else \
            f"(best partial: {found.get('best_partial') or 'none'})"
        errors = ['–', '–']
        if os.path.exists(os.path.join(folder, 'improve.json')):
            steps = step(options, folder, 'improve')['steps']
            for k, key in enumerate(('rms_error', 'heldout_rms_error')):
                errors[k] = ' -> '.join(f'{s[key]:.2f}' if s[key] is not None else '?' for s in steps)
            errors[0] += ' (' + ', then '.join(s['effects'][-1] for s in steps[1:]) + ')' if len(steps) > 1 else ''
        print(f"| {name} | {wanted or 'nothing'} | {found['verdict']} | {named} | {100 * first['explained_fraction']:.0f} % | {errors[0]} | {errors[1]} | "
              f"{ran['model_evaluations']} + {found['model_evaluations']} + {found['warm_fit_evaluations']} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--calibctl', required=True)
    parser.add_argument('--state', default='build/other-code', help='folder of what is finished')
    parser.add_argument('--only', default=','.join(CASES), help='cases, by commas')
    parser.add_argument('--workers', type=int, default=os.cpu_count())
    parser.add_argument('--table', action='store_true', help='print what is finished, run nothing')
    options = parser.parse_args()
    data = os.path.abspath(os.environ.get('CALIB_DATA', '../shared/data'))
    if not options.table:
        if not os.path.isdir(f'{data}/yade_cases'):
            sys.exit(f'{data}/yade_cases: not there; CALIB_DATA names the folder')
        for name in options.only.split(','):
            if name not in CASES:
                sys.exit(f'--only {name}: known are {", ".join(CASES)}')
            run(options, name, data)
    table(options)


main()
