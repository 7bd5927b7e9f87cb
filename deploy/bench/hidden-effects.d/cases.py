"""Rows that are judged, sets of cases that are made for them, and the seed of each case. Nothing here runs or reads an answer.

The seed of a case follows from the name of a commit, so that nobody can have seen the case when that commit was made: the file
FROZEN holds its 40 digits, and run.py judges only while what answers is the same as there.
"""
import dataclasses, hashlib, os, random, subprocess

HERE = os.path.dirname(os.path.abspath(__file__))
# What must not have changed since the commit in FROZEN: what answers, and what makes the cases.
JUDGED = ('inference', 'server/diagnosis', 'server/campaign/model')
# Of server/diagnosis what comes after an answer: cases of the shared way do not depend on it.
AFTER = ('control_way', 'diagnosis_text', 'extended_calibration', 'improve', 'next_', 'plan_', 'proposed_', 'setting_plans', 'test_plans',
         'then_answer', 'CMakeLists.txt', 'README.md', 'DECISIONS.md')
OWN = ('deploy/bench/hidden-effects.d/cases.py', 'deploy/bench/hidden-effects.d/strengths.py')
MEASUREMENT_SIDE = {'apparatus_compliance', 'strain_offset', 'membrane_stiffness', 'load_cell_error'}
STAGINGS = ('rate', 'step', 'damping', 'grains')
DESIGNS = 3               # of the shared way
# Of one family: no pair of hidden effects. Kin by what they do, not by what a diagnosis makes of them.
KIN = ({'adhesion_dmt', 'adhesion_jkr', 'capillary_bridges', 'linear_cohesion'}, {'nonspherical_shape', 'rolling_resistance', 'twisting_resistance'},
       {'apparatus_compliance', 'strain_offset'}, {'nonspherical_shape', 'particle_crushing'})


@dataclasses.dataclass(frozen=True)
class Set:
    way: str                     # shared: against a design made once | whole: the whole program for each case
    cases: int
    lambdas: tuple = ()          # of the hidden effects, in turn; none: nothing is hidden
    hidden: int = 1              # effects at once, each tuned alone
    removed: bool = False        # the library lacks the hidden effect
    shape: bool = False          # shape parameters are drawn
    staging: bool = False        # the measurement is made with another rate, step, damping or number of grains, in turn
    same_as: str = ''            # measurements of that set, judged once more the shared way


SETS = {
    'lambda60': Set('shared', 60, (60,)),
    'lambda400': Set('shared', 30, (400,)),
    'none': Set('shared', 40),
    'staging': Set('shared', 20, staging=True),
    'removed': Set('shared', 40, (60, 60, 400, 60, 400), removed=True),
    'shape': Set('shared', 20, (60, 400), shape=True),
    'pairs': Set('shared', 20, (400,), hidden=2),
    'whole60': Set('whole', 10, (60,)),
    'whole400': Set('whole', 5, (400,)),
    'whole-none': Set('whole', 5),
    'whole-removed': Set('whole', 5, (60,), removed=True),
    'whole-pairs': Set('whole', 5, (400,), hidden=2),
    'again60': Set('shared', 5, (60,), same_as='whole60'),
    'again400': Set('shared', 2, (400,), same_as='whole400'),
    'again-none': Set('shared', 2, same_as='whole-none'),
    'again-removed': Set('shared', 1, (60,), removed=True, same_as='whole-removed'),
    'again-pairs': Set('shared', 2, (400,), hidden=2, same_as='whole-pairs'),
}
WHOLE = tuple(name for name, of in SETS.items() if of.way == 'whole')
AGAIN = tuple(name for name, of in SETS.items() if of.same_as)
ONCE = tuple(name for name in SETS if name not in AGAIN)       # every measurement once
WITH_TRUTH = tuple(name for name in ONCE if not SETS[name].removed)


@dataclasses.dataclass(frozen=True)
class Row:
    what: str
    counted: str                 # how: a name of judge.COUNTS, which says it in full
    sets: tuple
    cases: int                   # fewer are not judged
    least: float = None          # a rate, held within one binomial standard error; a mean or a count, held as it is
    most: float = None


ROWS = (
    Row('lambda 60: exact truth in the 95 % set', 'in_set', ('lambda60',), 60, least=0.93),
    Row('lambda 60: distinct effects in it', 'set_size', ('lambda60',), 60, most=2.3),
    Row('lambda 60: named alone and right', 'alone_right', ('lambda60',), 60, least=0.30),
    Row('lambda 60: the same, of grain effects', 'alone_right_grains', ('lambda60',), 40, least=0.15),
    Row('lambda 400: named alone and right', 'alone_right', ('lambda400',), 30, least=0.50),
    Row('lambda 400: truth in the set', 'in_set', ('lambda400',), 30, least=0.95),
    Row('lambda 400: distinct effects in it', 'set_size', ('lambda400',), 30, most=1.7),
    Row('truth in the library, or nothing hidden: named alone and wrong', 'alone_wrong', WITH_TRUTH, 180, most=0.02),
    Row('family at 0.95: right', 'family_right', ('lambda60', 'lambda400'), 90, least=0.70),
    Row('family at 0.95: wrong', 'family_wrong_count', ('lambda60', 'lambda400'), 90, most=2),
    Row('no effect: adequate', 'adequate', ('none',), 40, least=0.95),
    Row('no effect, other staging, step, damping, grain number: adequate', 'adequate', ('staging',), 20, least=0.90),
    Row('truth left out of the library: named alone', 'alone', ('removed',), 40, most=0.05),
    Row('other shape parameters: alone and wrong', 'alone_wrong_count', ('shape',), 20, most=1),
    Row('two effects: the pair in the 95 % set', 'in_set', ('pairs',), 20, least=0.80),
    Row('two effects: both found by improve', 'both_found', ('whole-pairs',), 5, least=0.70),
    Row('after improve: held-out error at most 1.3', 'heldout', ('whole60', 'whole400', 'whole-none', 'whole-pairs'), 25, least=0.90),
    Row('after improve, right effects added: base parameters inside their 90 % intervals', 'inside',
        ('whole60', 'whole400', 'whole-none', 'whole-pairs'), 25, least=0.80),
    Row('proposed experiment made and told: truth in the set', 'then_in_set', ('whole60', 'whole400', 'whole-pairs'), 12, least=0.90),
    Row('its distinct effects less those by a repeat of the same test', 'then_smaller', ('whole60', 'whole400', 'whole-pairs'), 12,
        most=0),
    Row('runs beyond the base campaign: diagnose, median', 'diagnose_runs', WHOLE, 30, most=160),
    Row('runs beyond the base campaign: with improve, median', 'improve_runs', WHOLE, 30, most=220),
)
# Held against Wilson's interval of what was observed, in bins of the stated probability.
RELIABILITY = ((0.5, 0.8), (0.8, 0.95), (0.95, 1.0))


@dataclasses.dataclass(frozen=True)
class Case:
    """What is to be hidden and how; base parameters, strengths and noise follow from the seed (laboratory.py)."""
    name: str
    set: str
    index: int
    seed: int
    effects: tuple = ()          # hidden
    turns: tuple = ()            # how often each of them had its turn in the set: the ways of turning it up go in turn
    strength: int = 0            # lambda of each, alone; 0: nothing is hidden
    removed: tuple = ()
    staging: str = 'base'
    shape: bool = False
    design: int = 0


def seed_of(commit, row, index):
    """64 bits."""
    return int.from_bytes(hashlib.sha256(f'{commit} {row} {index}'.encode()).digest()[:8], 'big')


def turn(commit, row, effects):
    """The order in which effects come: each once before any comes again, nobody knows it before the commit."""
    order = sorted(effects)
    random.Random(seed_of(commit, row, 'turn')).shuffle(order)
    return order


def may_join(a, b, excludes):
    """Whether two effects may be hidden together and are of different families."""
    return a != b and b not in excludes.get(a, ()) and a not in excludes.get(b, ()) and not any({a, b} <= kin for kin in KIN)


def cases_of(commit, row, reached, excludes, shaped):
    """Cases of a set. reached: {effect: largest lambda that it reaches}; excludes: {effect: names it does not go with}; shaped:
    effects with a shape parameter. Where too few effects reach a lambda, as many as reach it take turns."""
    own = SETS[row]
    if own.same_as:
        return [dataclasses.replace(case, name=f'{row}-{case.index}', set=row, design=0)
                for case in cases_of(commit, own.same_as, reached, excludes, shaped)[:own.cases]]
    made, uses, order = [], {}, turn(commit, row, [e for e in reached if not own.shape or e in shaped])

    def next_of(strength, beside=None):
        """Who had the fewest turns of those that reach it; None where nothing is that strong."""
        able = [e for e in order if reached[e] >= strength and (beside is None or may_join(beside, e, excludes))]
        return min(able, key=lambda e: (uses.get(e, 0), beside and seed_of(commit, f'{row} {index}', e)), default=None)

    for index in range(own.cases):
        case = dict(name=f'{row}-{index}', set=row, index=index, seed=seed_of(commit, row, index), design=index % DESIGNS)
        if own.staging:
            case['staging'] = STAGINGS[index % len(STAGINGS)]
        if own.lambdas:
            strength = own.lambdas[index % len(own.lambdas)]
            effects = [next_of(strength)]
            if own.hidden == 2 and effects[0]:
                effects.append(next_of(strength, beside=effects[0]))
            if None in effects:
                continue
            first = sorted(reached).index(effects[0])
            case.update(effects=tuple(effects), turns=tuple(uses.get(e, 0) for e in effects), strength=strength, shape=own.shape,
                        removed=tuple(effects) if own.removed else (), design=(first + uses.get(effects[0], 0)) % DESIGNS)
            for effect in effects:
                uses[effect] = uses.get(effect, 0) + 1
        made.append(Case(**case))
    return made


def all_cases(commit, reached, excludes, shaped, way):
    """Of a way, in an order in which an interrupted run is a fair sample of the rows rather than the first few of them."""
    made = [case for row in SETS if SETS[row].way == way for case in cases_of(commit, row, reached, excludes, shaped)]
    random.Random(seed_of(commit, 'order', way)).shuffle(made)
    return made


# ---- what is frozen ---------------------------------------------------------------------------------------------------------
class NotFrozen(Exception):
    pass


def git(root, *arguments):
    done = subprocess.run(['git', '-C', root, *arguments], capture_output=True, text=True, stdin=subprocess.DEVNULL)
    if done.returncode != 0:
        raise NotFrozen(f'git {" ".join(arguments)}: {done.stderr.strip()}')
    return done.stdout.strip()


def is_judged(path, way):
    """Whether cases of a way depend on a file that git lists."""
    folder, name = os.path.split(path)
    return not (way == 'shared' and folder == 'server/diagnosis' and name.startswith(AFTER))


def judged_at(root, commit, path, way):
    """{file: digest of its content} below a path, of what cases of a way depend on."""
    lines = git(root, 'ls-tree', '-r', commit, '--', path).splitlines()
    return {name: of.split()[2] for of, name in (line.split('\t') for line in lines) if is_judged(name, way)}


def frozen_commit(root, file=os.path.join(HERE, 'FROZEN'), way='whole'):
    """The commit whose rules are judged; NotFrozen with a sentence where there is none or the sources are not as they were."""
    if not os.path.exists(file):
        raise NotFrozen('no rules are frozen (deploy/bench/hidden-effects.d/FROZEN is not there): only --tune SEED runs')
    with open(file, encoding='utf-8') as text:
        commit = text.read().strip()
    if len(commit) != 40 or any(c not in '0123456789abcdef' for c in commit):
        raise NotFrozen(f'{file}: holds the 40 digits of a commit and nothing else')
    for path in JUDGED + OWN:
        if judged_at(root, commit, path, way) != judged_at(root, 'HEAD', path, way):
            raise NotFrozen(f'{path} is not what it was when the rules were frozen ({commit[:12]}): freeze anew, which draws new cases')
    named = [line.split()[-1] for line in git(root, 'status', '--porcelain', '--', *JUDGED, *OWN).splitlines()]
    changed = [name for name in named if is_judged(name, way)]
    if changed:
        raise NotFrozen('not committed, so nobody knows what would be judged: ' + ' '.join(changed))
    return commit
