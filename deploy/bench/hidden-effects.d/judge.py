"""Finished cases against the rows of cases.py: what is counted, and in which words it is said. Reads nothing but records.

A rate holds if what was observed is within one binomial standard error of the figure; its interval is Wilson's, of 95 %. Means,
medians and counts hold as they are.
"""
import collections, math, os, statistics

import cases

FITTED_TESTS = 2          # of the standard layout: evaluations of one run
LEAST_STATED = 1e-3       # models below it are not listed
ALIKE = 0.2               # probabilities of the truth by both ways that differ by no more are called alike
NONE, MARK = ['none_of_these'], '<!-- written by run.py: -->\n'


def wilson(hits, n, z=1.96):
    if n == 0:
        return 0.0, 1.0
    p, square = hits / n, z * z / n
    center = (p + square / 2) / (1 + square)
    half = z / (1 + square) * math.sqrt(p * (1 - p) / n + square / (4 * n))
    return max(0.0, center - half), min(1.0, center + half)


# ---- one record -------------------------------------------------------------------------------------------------------------
def truth_model(record):
    """The model that is right: of an effect that the library lacks, none of these."""
    return NONE if record['removed'] else sorted(record['truth']['effects'])


def credible(answer):
    return [sorted(model) for model in answer['credible_set']]


def distinct(answer):
    """Effects in the credible set; the base model and none of these count one each."""
    return len({effect for model in credible(answer) for effect in model or ['']})


def named(answer):
    if answer['verdict'] != 'missing_effect':
        return []
    return sorted(answer.get('effects') or [answer['effect']])


def alone(answer):
    """Every effect that is called so, one of a model whose others are not among them."""
    return set(named(answer)) | {c['effect'] for c in answer['candidates'] if c.get('alone')}


def families(answer):
    """Sets of effects that are said at 0.95: families, and an effect of its own."""
    told = [set(f['effects']) for f in answer['families'] if f['probability'] >= 0.95]
    return told + [{c['effect']} for c in answer['candidates'] if c.get('probability', 0) >= 0.95]


def probability(answer, model):
    """As stated; LEAST_STATED where it is not listed."""
    if model == NONE:
        return max(answer['none_of_these'], LEAST_STATED)
    return max([LEAST_STATED, *(one['probability'] for one in answer['probabilities'] if sorted(one['effects']) == model)])


def statements(answer):
    """[(model, probability)] of what is listed."""
    listed = [(sorted(one['effects']), one['probability']) for one in answer['probabilities'] if one['effects'] != ['other']]
    return [*listed, (NONE, answer['none_of_these'])]


def runs_of(answer):
    """Parameter sets through all fitted tests."""
    by_stage = (answer.get('design') or {}).get('runs')
    return sum(by_stage.values()) if by_stage else answer['model_evaluations'] / FITTED_TESTS


def last_step(record):
    return record['improve']['steps'][-1]


def family_right(record):
    return any(set(record['truth']['effects']) & family for family in families(record['diagnose']))


def family_wrong(record):
    return any(not set(record['truth']['effects']) & family for family in families(record['diagnose']))


def alone_wrong(record):
    return bool(alone(record['diagnose']) - set(record['truth']['effects']))


def alone_right(record):
    return named(record['diagnose']) == truth_model(record)


def inside(record):
    """[whether each base parameter's truth is inside]; none unless improve added what is hidden and nothing else."""
    truth = record['truth']
    if not truth['effects'] or sorted(last_step(record)['effects']) != sorted(truth['effects']):
        return []
    ends = [(value, *record['intervals'].get(name, (None, None))) for name, value in truth['base'].items()]
    return [low is not None and low <= value <= high for value, low, high in ends]


# ---- how a row is counted: what of each record, and what becomes of it ----------------------------------------------------
Count = collections.namedtuple('Count', 'of kind')   # of: record -> value, list of values or None (not counted)
COUNTS = {
    'in_set': Count(lambda r: truth_model(r) in credible(r['diagnose']), 'rate'),
    'set_size': Count(lambda r: distinct(r['diagnose']), 'mean'),
    'alone_right': Count(alone_right, 'rate'),
    'alone_right_grains': Count(lambda r: None if set(r['truth']['effects']) & cases.MEASUREMENT_SIDE else alone_right(r), 'rate'),
    'alone_wrong': Count(alone_wrong, 'rate'),
    'alone_wrong_count': Count(alone_wrong, 'count'),
    'alone': Count(lambda r: bool(alone(r['diagnose'])), 'rate'),
    'family_right': Count(family_right, 'rate'),
    'family_wrong_count': Count(family_wrong, 'count'),
    'adequate': Count(lambda r: r['diagnose']['verdict'] == 'adequate', 'rate'),
    'both_found': Count(lambda r: set(r['truth']['effects']) <= set(last_step(r)['effects']), 'rate'),
    'heldout': Count(lambda r: (last_step(r)['heldout_rms_error'] or math.inf) <= 1.3, 'rate'),
    'inside': Count(inside, 'rate'),
    'then_in_set': Count(lambda r: r['told'] and truth_model(r) in credible(r['told']['then']), 'rate'),
    'then_smaller': Count(lambda r: r['told'] and distinct(r['told']['then']) - distinct(r['told']['repeat']), 'mean below'),
    'diagnose_runs': Count(lambda r: runs_of(r['diagnose']), 'median'),
    'improve_runs': Count(lambda r: r['improve'].get('runs') or r['improve']['model_evaluations'] / FITTED_TESTS, 'median'),
}


def counted(row, records):
    """(values, records that the row looks at): one value of each case that counts, several where several parameters do."""
    own = [r for r in records if r['set'] in row.sets and 'skipped' not in r]
    values = []
    for record in own:
        found = COUNTS[row.counted].of(record)
        values += found if isinstance(found, list) else [] if found is None else [found]
    return values, own


def holds(row, values, looked_at):
    """True, False, or None where too few cases are finished."""
    kind = COUNTS[row.counted].kind
    if looked_at < row.cases or not values or (len(values) < row.cases and row.counted != 'inside'):
        return None
    if kind == 'rate':
        figure = row.most if row.least is None else row.least
        error = math.sqrt(figure * (1 - figure) / len(values))
        share = sum(values) / len(values)
        return share >= figure - error - 1e-12 if row.least is not None else share <= figure + error + 1e-12
    if kind == 'mean below':
        return statistics.mean(values) < row.most
    return {'mean': statistics.mean, 'median': statistics.median, 'count': sum}[kind](values) <= row.most


def observed(row, values):
    """(what was observed, its interval, what is required), in words."""
    kind, n = COUNTS[row.counted].kind, len(values)
    figure = row.most if row.least is None else row.least
    asked = ('≥ ' if row.least is not None else '< ' if kind == 'mean below' else '≤ ') + (f'{100 * figure:g} %' if kind == 'rate' else f'{figure:g}')
    if not n:
        return '–', '–', asked
    if kind == 'rate':
        low, high = wilson(sum(values), n)
        return f'{sum(values)}/{n} = {100 * sum(values) / n:.0f} %', f'{100 * low:.0f}–{100 * high:.0f} %', asked
    if kind == 'count':
        return f'{sum(values)} of {n}', '–', asked
    if kind == 'median':
        return f'{statistics.median(values):.0f} (n = {n})', f'{min(values):.0f}–{max(values):.0f} (all)', asked
    error = statistics.stdev(values) / math.sqrt(n) if n > 1 else math.inf
    mean = statistics.mean(values)
    return f'{mean:.2f} (n = {n})', f'{mean - 1.96 * error:.2f}–{mean + 1.96 * error:.2f}', asked


WORDS = {True: 'yes', False: '**no**', None: 'too few cases'}


def rows_table(records):
    lines = ['| row | cases | observed | 95 % interval | required | holds |', '|---|---|---|---|---|---|']
    for row in cases.ROWS:
        values, own = counted(row, records)
        lines.append(f"| {row.what} | {len(own)} of {row.cases} | {' | '.join(observed(row, values))} | {WORDS[holds(row, values, len(own))]} |")
    return lines


def reliability(records):
    """[(bin, n, mean stated, hits, holds)] of models stated within each bin: holds if the stated mean is inside Wilson's interval."""
    found = []
    for low, high in cases.RELIABILITY:
        told = [(p, model == truth_model(r)) for r in records for model, p in statements(r['diagnose'])
                if low <= p < high or p == high == 1]
        hits, n = sum(hit for _, hit in told), len(told)
        stated = statistics.mean(p for p, _ in told) if told else math.nan
        ends = wilson(hits, n)
        found.append(((low, high), n, stated, hits, ends[0] <= stated <= ends[1] if n else None))
    return found


def mean_log(records):
    """(mean log p(truth), how many truths are below what is listed)"""
    stated = [probability(r['diagnose'], truth_model(r)) for r in records]
    return statistics.mean(map(math.log, stated)), sum(p <= LEAST_STATED for p in stated)


def reliability_table(records):
    once = [r for r in records if r['set'] in cases.ONCE and 'skipped' not in r]
    lines = ['| cases | stated | models | mean stated | right | 95 % interval | inside |', '|---|---|---|---|---|---|---|']
    logs = []
    for words, own in (('all', once), ('truth in the library', [r for r in once if not r['removed']])):
        for (low, high), n, stated, hits, inside_ in reliability(own):
            ends = ['–'] * 3
            if n:
                share = [100 * x for x in wilson(hits, n)]
                ends = [f'{stated:.2f}', f'{hits}/{n} = {hits / n:.2f}', f'{share[0]:.0f}–{share[1]:.0f} %']
            lines.append(f"| {words} | {low:g}–{high:g} | {n} | {' | '.join(ends)} | {WORDS[inside_] if n else 'no case'} |")
        if own:
            mean, unlisted = mean_log(own)
            logs.append(f'| {words} | {len(own)} | {mean:.2f} | {unlisted} |')
    return lines, ['| cases | n | mean log p(truth) | truth not listed (taken as 0.001) |', '|---|---|---|---|', *logs]


def stages_table(records):
    """Median runs of each stage, and evaluations, of the whole program."""
    own = [r for r in records if r['set'] in cases.WHOLE and 'skipped' not in r]
    by_stage = collections.defaultdict(list)
    for record in own:
        for stage, runs in ((record['diagnose'].get('design') or {}).get('runs') or {}).items():
            by_stage[stage].append(runs)
    lines = ['| stage | cases | runs, median | least | most |', '|---|---|---|---|---|']
    told = [(f'{stage}, runs', of) for stage, of in by_stage.items()]
    told += [('diagnose, evaluations', [r['diagnose']['model_evaluations'] for r in own]),
             ('with improve, evaluations', [r['improve']['model_evaluations'] for r in own]),
             ('proposed experiment, evaluations', [r['diagnose']['next_experiment']['model_evaluations'] for r in own
                                                   if 'model_evaluations' in (r['diagnose'].get('next_experiment') or {})])]
    return lines + [f'| {what} | {len(of)} | {statistics.median(of):.0f} | {min(of):.0f} | {max(of):.0f} |' for what, of in told if of]


def in_words(answer):
    models = [' + '.join(model) or 'base' for model in credible(answer)]
    return f"{answer['verdict']}{' **' + ' + '.join(named(answer)) + '**' if named(answer) else ''} | {', '.join(models)}"


def truth_in_words(record):
    words = ' + '.join(record['truth']['effects']) or 'nothing'
    return words + (' (left out)' if record['removed'] else '') + (f", lambda {record['strength']}" if record['strength'] else '')


def agreement(records):
    """[(record of the whole program, record of the shared way)] of one measurement each."""
    whole = {(r['set'], r['index']): r for r in records if 'skipped' not in r}
    return [(whole[cases.SETS[r['set']].same_as, r['index']], r) for r in records
            if r['set'] in cases.AGAIN and 'skipped' not in r and (cases.SETS[r['set']].same_as, r['index']) in whole]


def agreement_table(records):
    pairs = sorted(agreement(records), key=lambda pair: pair[0]['case'])
    lines = ['| case | hidden | p(truth), whole and shared | verdict and set, whole | | verdict and set, shared | | agree |', '|---|---|---|---|---|---|---|---|']
    for one, other in pairs:
        p = [probability(r['diagnose'], truth_model(one)) for r in (one, other)]
        same = one['diagnose']['verdict'] == other['diagnose']['verdict'] and named(one['diagnose']) == named(other['diagnose'])
        alike = same and abs(p[0] - p[1]) <= ALIKE
        lines.append(f"| {one['case']} | {truth_in_words(one)} | {p[0]:.2g}, {p[1]:.2g} | {in_words(one['diagnose'])} | "
                     f"{in_words(other['diagnose'])} | {'yes' if alike else '**no**'} |")
    return lines


def whole_table(records):
    lines = ['| case | hidden | verdict | credible set | p(truth) | after the proposal: set | after a repeat: set | improve ends with | error held out | runs |',
             '|---|---|---|---|---|---|---|---|---|---|']
    for r in sorted((r for r in records if r['set'] in cases.WHOLE and 'skipped' not in r), key=lambda r: r['case']):
        after = [str(distinct(r['told'][k])) + ('' if truth_model(r) in credible(r['told'][k]) else ', without the truth')
                 if r['told'] else '–' for k in ('then', 'repeat')]
        steps = r['improve']['steps']
        errors = ' -> '.join('?' if s['heldout_rms_error'] is None else f"{s['heldout_rms_error']:.2f}" for s in (steps[0], steps[-1]))
        lines.append(f"| {r['case']} | {truth_in_words(r)} | {in_words(r['diagnose'])} | {probability(r['diagnose'], truth_model(r)):.2g} | "
                     f"{' | '.join(after)} | {' + '.join(steps[-1]['effects']) or 'base'}, {steps[-1]['verdict']} | {errors} | {runs_of(r['diagnose']):.0f} |")
    return lines


def layouts_table(records):
    lines = ['| layout | hidden | verdict | credible set | p(truth) | evaluations |', '|---|---|---|---|---|---|']
    for r in records:
        if r['set'].startswith('layout') and 'skipped' not in r:
            lines.append(f"| {r['layout']} | {truth_in_words(r)} | {in_words(r['diagnose'])} | "
                         f"{probability(r['diagnose'], truth_model(r)):.2g} | {r['diagnose']['model_evaluations']} |")
    return lines


def report(records):
    """Markdown of everything, good or bad."""
    rates, logs = reliability_table(records)
    left = [f"- {r['case']}: {r['skipped']}" for r in records if 'skipped' in r]
    parts = [('Rows', rows_table(records)), ('Reliability', rates + [''] + logs), ('Runs of the whole program', stages_table(records)),
             ('The two ways on one measurement', agreement_table(records)), ('The whole program, case by case', whole_table(records)),
             ('Other layouts, without a rate', layouts_table(records)), ('No measurement could be made', left)]
    return '\n'.join(f'## {title}\n\n' + '\n'.join(lines) + '\n' for title, lines in parts
                     if len(lines) > (0 if lines is left else 2))   # no table of a head alone


def write_results(path, text):
    """Replaces what stands below the mark."""
    with open(path, encoding='utf-8') as file:
        head, mark, _ = file.read().partition(MARK)
    if not mark:
        raise ValueError(f'{path} has no line {MARK.strip()}')
    with open(path + '.new', 'w', encoding='utf-8') as file:
        file.write(head + MARK + '\n' + text)
    os.replace(path + '.new', path)
