"""Verdicts against the truth and the requirements: one record per finished case, counts, shares and 95 % intervals [Wilson 1927].

Records are lines of a CSV, so that cases finished on several machines by the same rules can be counted together.
"""
import csv, dataclasses, math

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


@dataclasses.dataclass
class Record:
    case: str
    rows: list          # of the table
    truth: list         # hidden effects
    strength: str       # lambda there and its standard error, or empty
    verdict: str
    named: list         # effects named, alone or in a group of at most three
    p: float            # of adequacy
    p_first: float      # of the first candidate; nan without
    evaluations: str    # run + screen + refits
    found: list         # effects that improve ended with
    before: float       # rms error on the measurement held out, of the model without the effect; nan: not kept
    heldout: float      # the same after improve; nan without
    inside: int         # base parameters within their 90 % interval, of
    of: int             # those of the cases that improve named correctly


LISTS = ('rows', 'truth', 'named', 'found')


def names(diagnosis):
    if diagnosis['verdict'] not in ('missing_effect', 'ambiguous'):
        return []
    first = diagnosis['candidates'][0]
    return sorted({first['effect'], *(first['confusable_with'] if diagnosis['verdict'] == 'ambiguous' else [])})


def record(case, verdict, truth, visible):
    diagnosis, steps = verdict['diagnose'], verdict.get('improve', {}).get('steps') or []
    found = sorted(steps[-1]['effects']) if steps else []
    heldout = steps[-1].get('heldout_rms_error') if steps else None
    inside, of = 0, 0
    if steps and set(found) == set(truth['effects']):
        for name in ('young_modulus', 'friction_coefficient'):
            q = verdict.get('final', {}).get('parameters', {}).get(name, {})
            if q.get('q05') is not None:
                of += 1
                inside += q['q05'] <= truth['parameters'][name] <= q['q95']
    candidates = diagnosis['candidates']
    return Record(case.name, list(case.rows), list(truth['effects']), '' if visible is None else f'{visible[0]:.0f} ± {visible[1]:.0f}',
                  diagnosis['verdict'], names(diagnosis), diagnosis['adequacy']['p_value'],
                  candidates[0]['p_value'] if candidates else math.nan,
                  f"{verdict['run']['model_evaluations']} + {diagnosis['model_evaluations']} + {diagnosis['warm_fit_evaluations']}",
                  found, verdict.get('compare', {}).get('heldout_rms_error', math.nan), math.nan if heldout is None else heldout, inside, of)


def write(records, path):
    with open(path, 'w', newline='') as out:
        table = csv.writer(out, lineterminator='\n')
        table.writerow(field.name for field in dataclasses.fields(Record))
        for one in sorted(records, key=lambda one: one.case):
            values = dataclasses.asdict(one)
            table.writerow('; '.join(v) if k in LISTS else f'{v:.3g}' if isinstance(v, float) else v for k, v in values.items())


def read(path):
    records = []
    for row in csv.DictReader(open(path, newline='')):
        lists = {k: row[k].split('; ') if row[k] else [] for k in LISTS}
        numbers = {k: float(row[k]) for k in ('p', 'p_first', 'before', 'heldout')}
        records.append(Record(**{**row, **lists, **numbers, 'inside': int(row['inside']), 'of': int(row['of'])}))
    return records


def good(one, row):
    truth, named = set(one.truth), set(one.named)
    if not truth:
        return one.verdict == 'adequate'
    if row == 'lambda = 10':
        return one.verdict != 'missing_effect' or named <= truth
    if row == 'true effect removed':
        return one.verdict in ('unexplained', 'ambiguous')
    if row == 'two effects at once':
        return truth <= set(one.found)
    if row == 'measurement-side effect':  # a group of grain effects alone is a mistake too
        return not named or bool(named & MEASUREMENT_SIDE)
    return bool(truth & named)


def confident_and_wrong(one):
    """One name with p < 0.01 that is not what is hidden."""
    return one.verdict == 'missing_effect' and not set(one.named) <= set(one.truth) and one.p_first < 0.01


def line(row, hits, n, what, required):
    low, high = wilson(hits, n)
    share = '–' if required is None else f'{100 * required:.0f} %'
    return f'| {row} | {what} | {hits}/{n} | {100 * low:.0f}–{100 * high:.0f} % | {share} |'


def table(records):
    lines = [f'{len(records)} cases finished.', '',
             '| case | what counts | hits | 95 % interval | required |', '|---|---|---|---|---|']
    for row, (what, required) in REQUIRED.items():
        own = [one for one in records if row in one.rows]
        if row == 'two effects at once':
            own = [one for one in own if one.found]
        if own:
            lines.append(line(row, sum(good(one, row) for one in own), len(own), what, required))
            if row == 'no hidden effect':  # what a model that lacks nothing reaches
                before = [one.before for one in own if not math.isnan(one.before)]
                lines.append(line(row, sum(b <= 1.3 for b in before), len(before), 'held-out rms ≤ 1.3', None))
            if row == 'true effect removed':
                lines.append(line(row, sum(not confident_and_wrong(one) for one in own), len(own), 'no wrong name with p < 0.01', 0.95))
    held = [one.heldout for one in records if not math.isnan(one.heldout)]
    if held:
        lines.append(line('after improve', sum(h <= 1.3 for h in held), len(held), 'held-out rms ≤ 1.3', 0.90))
    total = sum(one.of for one in records)
    if total:
        lines.append(line('after improve, named correctly', sum(one.inside for one in records), total, 'base parameter inside its 90 % interval', 0.80))
    lines += ['', '| case | truth | lambda | verdict | named | p | evaluations | held-out rms, after improve |', '|---|---|---|---|---|---|---|---|']
    for one in sorted(records, key=lambda one: one.case):
        after = '' if math.isnan(one.before) else f'{one.before:.2f}'
        if not math.isnan(one.heldout):
            after += f" → {one.heldout:.2f} ({' + '.join(one.found) or 'nothing added'})"
        lines.append(f"| {one.case} | {' + '.join(one.truth) or 'none'} | {one.strength or '–'} | {one.verdict} | "
                     f"{', '.join(one.named) or '–'} | {one.p:.2g} | {one.evaluations} | {after} |")
    return '\n'.join(lines)
