"""Outcomes against the requirements: counts, shares and 95 % intervals [Wilson 1927]."""
import math

REQUIRED = {
    'no hidden effect': ('adequate', 0.95), 'no hidden effect, other staging': ('adequate', 0.90),
    'lambda = 10': ('no confident wrong name', 0.98), 'lambda = 60': ('named or in the group', 0.90),
    'lambda = 60, a rival nearby': ('named or in the group', None), 'lambda = 400': ('named or in the group', 0.90), 'measurement-side effect': ('not mistaken for grain physics', 0.90),
    'true effect removed': ('unexplained or ambiguous', 0.80), 'two effects at once': ('both found', 0.75),
}
MEASUREMENT_SIDE = {'apparatus_compliance', 'strain_offset', 'membrane_stiffness', 'load_cell_error'}


def wilson(hits, n, z=1.96):
    if n == 0:
        return 0.0, 1.0
    p, square = hits / n, z * z / n
    center = (p + square / 2) / (1 + square)
    half = z / (1 + square) * math.sqrt(p * (1 - p) / n + square / (4 * n))
    return max(0.0, center - half), min(1.0, center + half)


def names(diagnosis):
    """Effects named, alone or in a group of at most three."""
    if diagnosis['verdict'] not in ('missing_effect', 'ambiguous'):
        return set()
    first = diagnosis['candidates'][0]
    return {first['effect'], *(first['confusable_with'] if diagnosis['verdict'] == 'ambiguous' else [])}


def good(outcome, row):
    case, diagnosis, truth = outcome['case'], outcome['verdict']['diagnose'], set(outcome['truth']['effects'])
    named = names(diagnosis)
    if not truth:
        return diagnosis['verdict'] == 'adequate'
    if row == 'lambda = 10':
        return diagnosis['verdict'] != 'missing_effect' or diagnosis['effect'] in truth
    if row == 'true effect removed':
        return diagnosis['verdict'] in ('unexplained', 'ambiguous')
    if row == 'two effects at once':
        return truth <= set(outcome['verdict']['improve']['steps'][-1]['effects'])
    if row == 'measurement-side effect':  # a group of grain effects alone is a mistake too
        return not named or bool(named & MEASUREMENT_SIDE)
    return bool(truth & named)


def confident_and_wrong(outcome):
    """One name with p < 0.01 that is not what is hidden."""
    diagnosis = outcome['verdict']['diagnose']
    return (diagnosis['verdict'] == 'missing_effect' and diagnosis['effect'] not in outcome['truth']['effects']
            and diagnosis['candidates'][0]['p_value'] < 0.01)


def line(row, hits, n, what, required):
    low, high = wilson(hits, n)
    share = '–' if required is None else f'{100 * required:.0f} %'
    return f'| {row} | {what} | {hits}/{n} | {100 * low:.0f}–{100 * high:.0f} % | {share} |'


def visible(outcome):
    found = outcome.get('lambda')
    return '–' if found is None else f'{found[0]:.0f} ± {found[1]:.0f}'


def table(outcomes, planned):
    lines = [f'{len(outcomes)} of {planned} cases finished.', '',
             '| case | what counts | hits | 95 % interval | required |', '|---|---|---|---|---|']
    for row, (what, required) in REQUIRED.items():
        own = [o for o in outcomes if row in o['case'].rows]
        if own:
            lines.append(line(row, sum(good(o, row) for o in own), len(own), what, required))
            if row == 'true effect removed':
                lines.append(line(row, sum(not confident_and_wrong(o) for o in own), len(own), 'no wrong name with p < 0.01', 0.95))
    improved = [o for o in outcomes if o['verdict'].get('improve', {}).get('steps')]
    held = [o['verdict']['improve']['steps'][-1].get('heldout_rms_error') for o in improved]
    held = [h for h in held if h is not None]
    if held:
        lines.append(line('after improve', sum(h <= 1.3 for h in held), len(held), 'held-out rms ≤ 1.3', 0.90))
    inside, total = 0, 0
    for o in improved:
        if set(o['verdict']['improve']['steps'][-1]['effects']) != set(o['truth']['effects']):
            continue
        for name in ('young_modulus', 'friction_coefficient'):
            q = o['verdict'].get('final', {}).get('parameters', {}).get(name, {})
            if q.get('q05') is not None:
                total += 1
                inside += q['q05'] <= o['truth']['parameters'][name] <= q['q95']
    if total:
        lines.append(line('after improve, named correctly', inside, total, "base parameter inside its 90 % interval", 0.80))
    lines += ['', '| case | truth | lambda | verdict | named | p | evaluations |', '|---|---|---|---|---|---|---|']
    for o in sorted(outcomes, key=lambda o: o['case'].name):
        d = o['verdict']['diagnose']
        lines.append(f"| {o['case'].name} | {' + '.join(o['truth']['effects']) or 'none'} | {visible(o)} | {d['verdict']} | "
                     f"{', '.join(sorted(names(d))) or '–'} | {d['adequacy']['p_value']:.2g} | "
                     f"{o['verdict']['run']['model_evaluations']} + {d['model_evaluations']} + {d['warm_fit_evaluations']} |")
    return '\n'.join(lines)
