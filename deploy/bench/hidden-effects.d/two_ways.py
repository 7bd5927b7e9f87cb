"""How a case is asked: against a design that was made once (shared), or by the whole program from the campaign file on (whole).

Each step's answer is kept in the case's folder, so that a case goes on where it was stopped; a folder is removed once its case is
a line of the records.
"""
import json, os, random, shutil

import cases, laboratory, programs

# Of an answer what is judged; the rest is large.
OF_DIAGNOSIS = ('verdict', 'effect', 'effects', 'probabilities', 'none_of_these', 'credible_set', 'families', 'specimens',
                'model_evaluations', 'design', 'adequacy', 'not_excitable', 'sentence', 'warnings')
OF_CANDIDATE = ('effect', 'probability', 'alone', 'p_value', 'explained_fraction', 'amplitude', 'predicted_rms_error')
OF_PLAN = ('test', 'settings', 'expected_power', 'told_apart_bits', 'model_evaluations', 'in_words')
NEEDED = ('probabilities', 'none_of_these', 'credible_set', 'families', 'candidates', 'model_evaluations')
FIRST_FITTED = 'low'


def must_have(document, names, verb='diagnose'):
    """A slip of the program, told as one: nothing of it is recorded."""
    lacking = [name for name in names if name not in document]
    if lacking:
        raise programs.Failed(f'the JSON of {verb} lacks {", ".join(lacking)}: no build that answers by probabilities', 1)


def brief(diagnosis):
    kept = {key: diagnosis[key] for key in OF_DIAGNOSIS if key in diagnosis}
    kept['candidates'] = [{key: c[key] for key in OF_CANDIDATE if key in c} for c in diagnosis['candidates']]
    plan = diagnosis.get('next_experiment')
    kept['next_experiment'] = plan and {key: plan[key] for key in OF_PLAN if key in plan}
    return kept


class Steps:
    """Answers of one case, in its folder."""

    def __init__(self, lab, folder, workers):
        self.lab, self.folder, self.workers = lab, folder, workers

    def path(self, *names):
        return os.path.join(self.folder, *names)

    def answer(self, name, verb, *arguments, state='state', needed=()):
        """The JSON of a verb, from the last time or now; one that lacks what is needed is not kept."""
        path = self.path(name + '.json')
        if not os.path.exists(path):
            found = self.lab.run.answer(verb, *arguments, state=self.path(state), workers=self.workers)
            must_have(found, (*needed, *(NEEDED if verb == 'diagnose' else ())), verb)
            programs.write(path, json.dumps(found))
        with open(path, encoding='utf-8') as file:
            return json.load(file)

    def copy_state(self, target):
        """A copy made anew of the state as it is: what is asked of the copy leaves no trace in the other."""
        shutil.rmtree(self.path(target), ignore_errors=True)
        shutil.copytree(self.path('state'), self.path(target))


def record_of(case, truth, **answers):
    return {'case': case.name, 'set': case.set, 'index': case.index, 'seed': case.seed, 'strength': case.strength,
            'removed': list(case.removed), 'staging': case.staging, 'design': case.design, 'truth': truth, **answers}


# ---- shared -----------------------------------------------------------------------------------------------------------------
class Designs:
    """Each made once, by a measurement without a hidden effect that is no case; then only read."""

    def __init__(self, lab, commit, workers, strengths):
        self.lab, self.commit, self.workers, self.strengths = lab, commit, workers, strengths

    def folder(self, number):
        return os.path.join(self.lab.folder, 'designs', str(number))

    def make(self, number):
        """Id of the campaign of its runs."""
        steps = Steps(self.lab, self.folder(number), self.workers)
        control = cases.Case(f'design-{number}', 'design', number, cases.seed_of(self.commit, 'design', number))
        self.lab.measure(control, steps.folder, laboratory.STANDARD, self.strengths)
        file = self.lab.file(steps.folder, laboratory.STANDARD, 'shared', number)
        campaign = steps.answer('run', 'run', file)['campaign']
        return steps.answer('diagnose', 'diagnose', campaign, '--no-plan', needed=('design',))['design']['campaign']


def shared(case, lab, designs, strengths, workers):
    """Record of a case; its base runs are those of the design, found by their digests."""
    folder = os.path.join(lab.folder, 'cases', case.name)
    steps = Steps(lab, folder, workers)
    design = designs.make(case.design)
    truth = lab.measure(case, folder, laboratory.STANDARD, strengths)
    if not os.path.exists(steps.path('state.whole')):     # else a copy was cut short
        shutil.rmtree(steps.path('state'), ignore_errors=True)
        shutil.copytree(os.path.join(designs.folder(case.design), 'state'), steps.path('state'))
        programs.write(steps.path('state.whole'), '')
    file = lab.file(folder, laboratory.STANDARD, 'shared', case.design)
    ran = steps.answer('run', 'run', file)
    without = [word for effect in case.removed for word in ('--without', effect)]
    found = steps.answer('diagnose', 'diagnose', ran['campaign'], '--design', design, '--no-plan', *without)
    return record_of(case, truth, way='shared', diagnose=brief(found))


# ---- the whole program ------------------------------------------------------------------------------------------------------
def path_of(plan):
    """Values of the control of a proposal: as told, else from its ends with one unloading to half of where it turns."""
    if plan.get('path'):
        return tuple(plan['path'])
    start, end = plan['control_from'], plan['control_to']
    way = [start + (end - start) * i / 24 for i in range(25)]
    turn = plan.get('unloading_at')
    if turn is None:
        return tuple(way)
    back = start + (turn - start) / 2
    return (*(x for x in way if x < turn), turn, (turn + back) / 2, back, (turn + back) / 2, turn, *(x for x in way if x > turn))


def planned_test(plan, pattern):
    """The test of a proposal; pattern: the fitted test whose observables it reads. Its snippet says which of them."""
    if plan.get('repeat_of'):
        return laboratory.STANDARD.tests[plan['repeat_of']]
    noise = {name: law for name, law in pattern.noise.items() if name in plan.get('snippet', name)}
    return laboratory.Test(plan['test'], dict(plan['settings']), path=path_of(plan), noise=noise, control=plan['control'])


def told(case, steps, truth, campaign, found):
    """Answers once the proposed test, and once a repeat of the fitted test that the program ranks first, has been made on another
    specimen and told; None where nothing was proposed. Each on a copy of the state."""
    plan = found.get('next_experiment')
    if not plan:
        return None
    repeats = [k for k, one in enumerate(plan['considered']) if one['repeat_of']]
    answers = {}
    for name in ('then', 'repeat'):
        if name == 'repeat' and not repeats:
            raise programs.Failed('no repeat of a test among what was considered', 1)
        if not os.path.exists(steps.path(name + '.json')):
            rnd = random.Random(f'{case.seed} {name}')
            if name == 'then':
                test, choice = planned_test(plan, laboratory.STANDARD.tests[FIRST_FITTED]), ()
            else:
                test, choice = planned_test(plan['considered'][repeats[0]], None), ('--plan', str(repeats[0]))
            specimen = {**truth, 'packing': rnd.randrange(10**6, 2**31 - 1000)}
            steps.lab.read(specimen, steps.folder, laboratory.Layout({name: test}), [name], rnd)
            steps.copy_state('state-' + name)
            steps.answer(name, 'diagnose', campaign, '--then', steps.path(name + '.csv'), *choice, state='state-' + name)
            shutil.rmtree(steps.path('state-' + name))
        answers[name] = brief(steps.answer(name, 'diagnose'))
    return answers


def whole(case, lab, strengths, workers, layout=laboratory.STANDARD):
    """Record of a case."""
    folder = os.path.join(lab.folder, 'cases', case.name)
    steps = Steps(lab, folder, workers)
    truth = lab.measure(case, folder, layout, strengths)
    campaign = steps.answer('run', 'run', lab.file(folder, layout, 'whole'))['campaign']
    without = [word for effect in case.removed for word in ('--without', effect)]
    found = steps.answer('diagnose', 'diagnose', campaign, *without)
    after = told(case, steps, truth, campaign, found) if case.effects and not case.removed else None
    improved = steps.answer('improve', 'improve', campaign, *without)
    final = steps.answer('final', 'posterior', improved['final_campaign'])
    intervals = {name: [of['q05'], of['q95']] for name, of in final['parameters'].items()}
    kept = {key: improved[key] for key in ('steps', 'verdict', 'model_evaluations', 'runs') if key in improved}
    return record_of(case, truth, way='whole', diagnose=brief(found), told=after, improve=kept, intervals=intervals)
