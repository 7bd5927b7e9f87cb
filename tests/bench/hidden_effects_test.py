#!/usr/bin/env python3
"""What deploy/bench/hidden-effects counts, and that it judges nothing unless the rules are frozen. usage: hidden_effects_test.py ROOT"""
import collections
import contextlib
import hashlib
import importlib.util
import io
import math
import os
import random
import re
import shutil
import stat
import subprocess
import sys
import tempfile
import threading
import time
import unittest

ROOT = os.path.abspath(sys.argv.pop(1) if len(sys.argv) > 1 else '.')
BENCH = os.path.join(ROOT, 'deploy/bench/hidden-effects.d')
sys.path.insert(0, BENCH)

import cases  # noqa: E402
import judge  # noqa: E402
import laboratory  # noqa: E402
import layouts  # noqa: E402
import programs  # noqa: E402
import records  # noqa: E402
import run  # noqa: E402
import strengths  # noqa: E402
import two_ways  # noqa: E402

COMMIT = 'c0ffee' + '0' * 34
REACHED = {f'effect{k:02d}': 400 if k < 11 else 60 for k in range(16)}
EXCLUDES = {'effect03': ['effect04']}
SHAPED = {'effect01', 'effect05', 'effect13'}


def made(row, commit=COMMIT):
    return cases.cases_of(commit, row, REACHED, EXCLUDES, SHAPED)


def record(row='lambda60', index=0, effects=('rolling_resistance',), removed=False, verdict='ambiguous', named=(), models=None,
           none=0.0, credible=None, families=(), runs=None, **more):
    """Of a case; models: [(effects, probability)]."""
    models = [(list(effects), 0.9)] if models is None else models
    diagnose = {'verdict': verdict, 'effect': named[0] if named else None, 'effects': list(named), 'none_of_these': none,
                'probabilities': [{'effects': list(m), 'probability': p} for m, p in models],
                'credible_set': [list(m) for m, _ in models] if credible is None else credible,
                'families': [{'effects': list(f), 'probability': p} for f, p in families],
                'candidates': [], 'model_evaluations': 300, 'design': {'runs': runs or {'scout': 37, 'main': 91}}}
    return {'case': f'{row}-{index}', 'set': row, 'index': index, 'removed': list(effects) if removed else [], 'strength': 60,
            'truth': {'effects': list(effects), 'base': {'young_modulus': 1e9, 'friction_coefficient': 0.4}}, 'diagnose': diagnose, **more}


def row_of(text):
    return next(row for row in cases.ROWS if text in row.what)


class Seeds(unittest.TestCase):

    def test_a_seed_is_the_head_of_a_digest_of_commit_row_and_index(self):
        wanted = int(hashlib.sha256(f'{COMMIT} lambda60 7'.encode()).hexdigest()[:16], 16)
        self.assertEqual(cases.seed_of(COMMIT, 'lambda60', 7), wanted)
        self.assertEqual(made('lambda60')[7].seed, wanted)

    def test_no_two_measurements_have_one_seed(self):
        seeds = [case.seed for row in cases.ONCE for case in made(row)]
        self.assertEqual(len(seeds), len(set(seeds)))
        self.assertFalse(set(seeds) & {case.seed for row in cases.ONCE for case in made(row, 'tune 1')})

    def test_both_ways_are_asked_of_the_very_same_measurement(self):
        again = [case for row in cases.AGAIN for case in made(row)]
        self.assertEqual(len(again), 12)
        for case in again:
            one = made(cases.SETS[case.set].same_as)[case.index]
            self.assertEqual((case.seed, case.effects, case.turns, case.strength, case.removed),
                             (one.seed, one.effects, one.turns, one.strength, one.removed))


class Cases(unittest.TestCase):

    def test_every_effect_is_hidden_equally_often(self):
        for row in cases.SETS:
            if cases.SETS[row].lambdas and not cases.SETS[row].same_as:
                uses = collections.Counter(effect for case in made(row) for effect in case.effects)
                able = [e for e in REACHED if any(REACHED[e] >= s for s in cases.SETS[row].lambdas) and (e in SHAPED or not cases.SETS[row].shape)]
                if len(set(cases.SETS[row].lambdas)) == 1:
                    self.assertLessEqual(max(uses.values()) - min(uses[e] for e in able), 1, row)

    def test_sizes_are_those_of_the_rows(self):
        for row, of in cases.SETS.items():
            self.assertEqual(len(made(row)), of.cases, row)
        for row in cases.ROWS:
            self.assertIn(row.counted, judge.COUNTS)
            self.assertGreaterEqual(sum(cases.SETS[name].cases for name in row.sets), row.cases, row.what)
            self.assertEqual((row.least is None) + (row.most is None), 1, row.what)
        self.assertEqual(sum(cases.SETS[row].cases for row in cases.WHOLE), 30)

    def test_an_effect_is_hidden_only_as_strong_as_it_can_be(self):
        for row in cases.ONCE:
            for case in made(row):
                self.assertTrue(all(REACHED[effect] >= case.strength for effect in case.effects))
                self.assertTrue(not case.shape or case.effects[0] in SHAPED)

    def test_a_pair_is_of_two_that_go_together_and_are_no_kin(self):
        for case in made('pairs') + made('whole-pairs'):
            self.assertEqual(len(set(case.effects)), 2)
            self.assertNotEqual(set(case.effects), {'effect03', 'effect04'})
        self.assertFalse(cases.may_join('adhesion_jkr', 'capillary_bridges', {}))
        self.assertFalse(cases.may_join('a', 'b', {'b': ['a']}))
        self.assertTrue(cases.may_join('adhesion_jkr', 'load_cell_error', {}))

    def test_what_is_removed_is_what_is_hidden_and_stagings_take_turns(self):
        self.assertTrue(all(case.removed == case.effects for case in made('removed')))
        self.assertEqual(set(collections.Counter(case.staging for case in made('staging')).values()), {5})
        self.assertEqual(collections.Counter(case.design for case in made('none')), {0: 14, 1: 13, 2: 13})

    def test_rays_are_those_of_the_catalogue(self):
        folder = os.path.join(ROOT, 'dem/effects')
        names = {name[:-3] for name in os.listdir(folder) if name.endswith('.cc') and not name.endswith('_test.cc')}
        with open(os.path.join(folder, 'shared/moment_stiffness.cc'), encoding='utf-8') as file:
            shared = file.read()
        effects = set()
        for name in names:
            with open(os.path.join(folder, name + '.cc'), encoding='utf-8') as file:
                text = file.read()
            if '.rays' not in text:
                continue
            effects.add(name)
            text = re.sub(r'\s+', ' ', text + (shared if 'MomentRays' in text else ''))
            for ray in layouts.RAYS[name] if name in strengths.NOT_HERE else strengths.RAYS[name]:
                found = re.search(r'\.parameter = "%s", \.steps = \{([^}]*)\}' % ray.parameter, text)
                self.assertIsNotNone(found, f'{name}: no ray of {ray.parameter}')
                if name != 'viscous_damping':    # in collisions much less shows
                    self.assertEqual(tuple(map(float, found[1].split(','))), tuple(map(float, ray.steps)), name)
        self.assertEqual(effects, set(strengths.RAYS) | set(strengths.NOT_HERE))


class Strengths(unittest.TestCase):
    ENTRY = {'parameters': [
        {'name': 'work', 'null_value': 0.0, 'default_prior': {'min': 1e-3, 'max': 10}, 'scaled_default_prior': {'min': 0.01, 'max': 10},
         'reference_scale': {'factor': 1, 'pressure': 1, 'diameter': 1, 'modulus': 0}},
        {'name': 'exponent', 'null_value': 1.0, 'null_by_contact': {'hertz_mindlin': 1.5}, 'default_prior': {'min': 0.75, 'max': 3},
         'scaled_default_prior': None, 'reference_scale': {'factor': 1, 'pressure': 0, 'diameter': 0, 'modulus': 0}}]}
    REFERENCE = {'pressure': 2e5, 'diameter': 3e-3, 'modulus': 6e8}

    def test_a_step_is_in_units_of_the_scale_and_ends_with_the_prior(self):
        at = lambda ray, step: strengths.values_on('e', ray, step, self.ENTRY, self.REFERENCE)
        self.assertEqual(at(strengths.Ray('work', (0.1, 0.4)), 0.1), {'e.work': 60.0})
        self.assertEqual(at(strengths.Ray('work', (0.1, 0.4)), 100), {'e.work': 6000.0})
        self.assertEqual(at(strengths.Ray('exponent', (0.2, 0.4)), -0.2), {'e.exponent': 1.3})
        self.assertEqual(at(strengths.Ray('exponent', (0.2, 0.4), {'work': 0.5}), -9), {'e.work': 300.0, 'e.exponent': 0.75})
        shaped = strengths.values_on('e', strengths.Ray('exponent', (0.2, 0.4), {'work': 0.5}), 0.2, self.ENTRY, self.REFERENCE, {'work': 2})
        self.assertEqual(shaped, {'e.work': 1200.0, 'e.exponent': 1.7})

    def test_strengths_between_measured_ones(self):
        measured = {1: (10, 1), 2: (40, 1), 4: (160, 1), 8: (3, 5)}
        self.assertAlmostEqual(strengths.interpolate(measured, 80), 2 ** 1.5)
        self.assertIsNone(strengths.interpolate(measured, 400))
        self.assertEqual(strengths.reach(measured), 160)
        self.assertAlmostEqual(strengths.next_step(1, 15, 60, 1), 2)
        self.assertAlmostEqual(strengths.next_step(1, 60, 480, 3), 8 ** (1 / 6))


class Synthetic:
    """In the place of the engine: curves that move with modulus and friction, packings that scatter, and two effects: `own` leaves
    what the parameters can imitate, `alike` is a stiffer modulus."""
    TWO_SIDED = {'own': False, 'alike': False}
    INFO = {'name': 'work', 'null_value': 0.0, 'default_prior': {'min': 0.0, 'max': 8.0}, 'scaled_default_prior': None,
            'reference_scale': {'factor': 1, 'pressure': 0, 'diameter': 0, 'modulus': 0}}

    def __init__(self):
        self.asked = 0

    def catalogue(self):
        return {name: {'two_sided': two, 'excludes': [], 'parameters': [self.INFO]} for name, two in self.TWO_SIDED.items()}

    def simulate(self, work, layout, tests, base, packing, grains, effects=(), values=None):
        self.asked += 1
        if (values or {}).get('own.work', 0) > 6:
            raise programs.Failed('simulate ended with 1: the specimen came apart', 1)
        rnd = random.Random(f'{packing} {sorted(base.items())} {sorted((values or {}).items())}')
        own, modulus = random.Random(packing), math.log(base['young_modulus'] / 1e9)
        rows = {}
        for test in tests:
            path, a, b = layout.tests[test].path, own.gauss(0, 0.01), own.gauss(0, 2e-4)
            rows[test] = []
            for k, x in enumerate(path):
                x /= path[-1]
                stiff = modulus + (values or {}).get('alike.work', 0) * 0.05
                q = 1 + 0.1 * stiff * x + 0.5 * base['friction_coefficient'] * x * x + a * math.sin(3 * x) + rnd.gauss(0, 2e-3)
                q += (values or {}).get('own.work', 0) * 0.02 * math.sin(12 * x)
                v = 0.01 * x - 0.002 * stiff * x + b * x + rnd.gauss(0, 3e-5)
                rows[test].append({'q_over_p': q, 'volumetric_strain': v})
        return rows


@unittest.skipUnless(importlib.util.find_spec('numpy'), 'without numpy')
class Lambda(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.folder, cls.rays, cls.log = tempfile.mkdtemp(), strengths.RAYS, io.StringIO()
        strengths.RAYS = {name: (strengths.Ray('work', (0.25, 0.5)),) for name in ('own', 'alike')}
        cls.lab = Synthetic()
        cls.of = strengths.Strengths(cls.lab, cls.folder, 1, cls.log)
        cls.of.prepare()

    @classmethod
    def tearDownClass(cls):
        strengths.RAYS = cls.rays
        shutil.rmtree(cls.folder)

    def test_what_the_parameters_imitate_is_invisible_and_the_rest_is_not(self):
        self.assertEqual(self.of.reached(), {'own': 400})
        self.assertIn('own, work +1: lambda', self.log.getvalue())
        value, error, _ = self.of.visible(('own',), {'own.work': 0.0})
        self.assertLess(abs(value), 3 * error + 1)

    def test_lambda_goes_with_the_square_and_is_tuned_at_the_parameters_of_the_case(self):
        one, two = (self.of.visible(('own',), {'own.work': work})[0] for work in (1.0, 2.0))
        self.assertAlmostEqual(two / one, 4, delta=0.4)
        # Noise of the ratio is 1.5 % of it, hence 0.02 sin(12 x) seen at 2 x 27 readings with an sd of about 0.02.
        self.assertGreater(one, 15)
        self.assertLess(one, 60)
        values, (found, error, _) = self.of.tuned('own', 0, 60, {'young_modulus': 1.1e9, 'friction_coefficient': 0.5})
        self.assertLess(abs(found / 60 - 1), strengths.NEAR)
        self.assertAlmostEqual(values['own.work'], math.sqrt(60 / one), delta=0.3)

    def test_nothing_is_run_twice(self):
        self.of.measured()
        asked = self.lab.asked
        again = strengths.Strengths(self.lab, self.folder, 1, self.log)
        again.prepare()
        self.assertTrue(again.known())
        self.assertEqual(again.reached(), self.of.reached())
        self.assertEqual(self.lab.asked, asked)

    def test_a_model_that_cannot_go_on_has_no_lambda_but_a_slip_is_told(self):
        self.assertIsNone(self.of.visible(('own',), {'own.work': 7.0}))
        simulate = self.lab.simulate

        def slip(*_, **__):
            raise programs.Failed('simulate ended with 2: no such key', 2)
        self.lab.simulate = slip
        self.addCleanup(setattr, self.lab, 'simulate', simulate)
        with self.assertRaises(programs.Failed):
            self.of.visible(('own',), {'own.work': 0.123})


class Judge(unittest.TestCase):

    def test_wilson(self):
        self.assertAlmostEqual(judge.wilson(8, 10)[0], 0.4902, 4)
        self.assertAlmostEqual(judge.wilson(8, 10)[1], 0.9433, 4)
        self.assertEqual(judge.wilson(0, 0), (0, 1))

    def test_a_rate_holds_within_one_binomial_standard_error(self):
        row = row_of('lambda 60: exact truth')           # 93 % of 60: 0.93 - 0.0329 = 0.897
        told = lambda hits: judge.holds(row, [True] * hits + [False] * (60 - hits), 60)
        self.assertTrue(told(54))
        self.assertFalse(told(53))
        row = row_of('left out')                         # 5 % of 40: 0.05 + 0.0345
        told = lambda hits: judge.holds(row, [True] * hits + [False] * (40 - hits), 40)
        self.assertTrue(told(3))
        self.assertFalse(told(4))

    def test_means_medians_and_counts_hold_as_they_are(self):
        self.assertTrue(judge.holds(row_of('lambda 60: distinct'), [2.3] * 60, 60))
        self.assertFalse(judge.holds(row_of('lambda 60: distinct'), [2.3] * 59 + [2.4], 60))
        self.assertFalse(judge.holds(row_of('family at 0.95: wrong'), [1, 1, 1] + [0] * 87, 90))
        self.assertTrue(judge.holds(row_of('diagnose, median'), [100] * 15 + [160] + [500] * 14, 30))
        self.assertFalse(judge.holds(row_of('repeat of the same'), [0] * 12, 12))
        self.assertTrue(judge.holds(row_of('repeat of the same'), [-1] + [0] * 11, 12))

    def test_too_few_cases_are_not_judged(self):
        self.assertIsNone(judge.holds(row_of('lambda 60: exact truth'), [True] * 59, 59))
        self.assertIsNone(judge.holds(row_of('truth in the set'), [], 60))
        few = row_of('right effects added')      # of parameters, not of cases
        self.assertIsNone(judge.holds(few, [True] * 40, 24))
        self.assertTrue(judge.holds(few, [True] * 10, 25))

    def test_the_set(self):
        of = judge.COUNTS['in_set'].of
        self.assertTrue(of(record(credible=[['a'], ['rolling_resistance']])))
        self.assertFalse(of(record(credible=[['a', 'rolling_resistance']])))
        self.assertTrue(of(record(effects=('b', 'a'), credible=[['a', 'b']])))
        self.assertTrue(of(record(effects=(), credible=[[]])))
        self.assertTrue(of(record(removed=True, credible=[['none_of_these']])))
        self.assertFalse(of(record(removed=True, credible=[['rolling_resistance']])))
        self.assertEqual(judge.distinct(record(credible=[['a'], ['a', 'b'], [], ['none_of_these']])['diagnose']), 4)

    def test_names(self):
        right = record(verdict='missing_effect', named=['rolling_resistance'])
        wrong = record(verdict='missing_effect', named=['a'])
        control = record('none', effects=(), verdict='missing_effect', named=['a'])
        half = record('pairs', effects=('a', 'b'), verdict='missing_effect', named=['a'])
        also = record(verdict='missing_effect', named=['a', 'rolling_resistance'])
        group = record(verdict='ambiguous')
        self.assertEqual([judge.alone_right(r) for r in (right, wrong, half, also, group)], [True, False, False, False, False])
        self.assertEqual([judge.alone_wrong(r) for r in (right, wrong, control, half, also, group)], [False, True, True, False, True, False])
        self.assertTrue(judge.COUNTS['alone'].of(record(removed=True, verdict='missing_effect', named=['a'])))
        # One of a pair is called so, and the answer names nothing.
        of_pair = record()
        of_pair['diagnose']['candidates'] = [{'effect': 'adhesion_dmt', 'probability': 0.97, 'alone': True}]
        self.assertTrue(judge.alone_wrong(of_pair))
        self.assertFalse(judge.alone_right(of_pair))
        grains = judge.COUNTS['alone_right_grains'].of
        self.assertIsNone(grains(record(effects=('load_cell_error',))))
        self.assertTrue(grains(right))

    def test_families(self):
        told = record(families=[(['a', 'rolling_resistance'], 0.96), (['c', 'd'], 0.94)])
        self.assertTrue(judge.family_right(told))
        self.assertFalse(judge.family_wrong(told))
        self.assertTrue(judge.family_wrong(record(families=[(['a', 'b'], 0.95)])))
        alone = record()
        alone['diagnose']['candidates'] = [{'effect': 'rolling_resistance', 'probability': 0.97}]
        self.assertTrue(judge.family_right(alone))

    def test_improve(self):
        step = lambda effects, error: {'steps': [{'effects': [], 'heldout_rms_error': 3.0, 'verdict': ''},
                                                 {'effects': effects, 'heldout_rms_error': error, 'verdict': 'adequate'}],
                                       'model_evaluations': 400}
        intervals = {'young_modulus': [0.9e9, 1.1e9], 'friction_coefficient': [0.41, 0.5]}
        one = record('whole60', improve=step(['rolling_resistance'], 1.3), intervals=intervals, told=None)
        other = record('whole60', 1, improve=step(['a'], None), intervals=intervals, told=None)
        of = {name: [judge.COUNTS[name].of(r) for r in (one, other)] for name in ('heldout', 'inside', 'both_found', 'then_in_set', 'improve_runs')}
        self.assertEqual(of, {'heldout': [True, False], 'inside': [[True, False], []], 'both_found': [True, False],
                              'then_in_set': [None, None], 'improve_runs': [200, 200]})
        self.assertEqual(judge.counted(row_of('right effects added'), [one, other]), ([True, False], [one, other]))
        self.assertEqual(judge.runs_of(one['diagnose']), 128)

    def test_the_experiment_against_a_repeat(self):
        after = {'then': record(credible=[['rolling_resistance']])['diagnose'],
                 'repeat': record(credible=[['rolling_resistance'], ['a']])['diagnose']}
        self.assertEqual(judge.COUNTS['then_smaller'].of(record('whole60', told=after)), -1)
        self.assertTrue(judge.COUNTS['then_in_set'].of(record('whole60', told=after)))

    def test_reliability(self):
        right = [record(index=k, models=[(['rolling_resistance'], 0.9), (['a'], 0.1)]) for k in range(9)]
        wrong = [record(index=9, models=[(['a'], 0.9)])]
        (_, n, stated, hits, inside), = [one for one in judge.reliability(right + wrong) if one[1]]
        self.assertEqual((n, hits, inside), (10, 9, True))
        self.assertAlmostEqual(stated, 0.9)
        (_, n, _, hits, inside), = [one for one in judge.reliability(wrong * 10) if one[1]]
        self.assertEqual((n, hits, inside), (10, 0, False))
        modest = [record(models=[(['rolling_resistance'], 0.6)])] * 40
        (_, _, _, hits, inside), = [one for one in judge.reliability(modest) if one[1]]
        self.assertEqual((hits, inside), (40, False))
        mean, unlisted = judge.mean_log(right + wrong)
        self.assertAlmostEqual(mean, (9 * math.log(0.9) + math.log(1e-3)) / 10)
        self.assertEqual(unlisted, 1)
        self.assertAlmostEqual(judge.probability(record(removed=True, none=0.7)['diagnose'], ['none_of_these']), 0.7)

    def test_the_report_says_what_is_bad(self):
        bad = [record(index=k, verdict='missing_effect', named=['a'], models=[(['a'], 0.99)]) for k in range(60)]
        text = judge.report(bad)
        self.assertIn('| lambda 60: exact truth in the 95 % set | 60 of 60 | 0/60 = 0 % | 0–6 % | ≥ 93 % | **no** |', text)
        self.assertIn('| lambda 400: truth in the set | 0 of 30 | – | – | ≥ 95 % | too few cases |', text)
        self.assertIn('| all | 0.95–1 | 60 | 0.99 | 0/60 = 0.00 | 0–6 % | **no** |', text)

    def test_a_case_without_a_measurement_is_told_and_counts_for_nothing(self):
        text = judge.report([{'case': 'lambda60-3', 'set': 'lambda60', 'index': 3, 'skipped': 'no strength'}])
        self.assertIn('- lambda60-3: no strength', text)
        self.assertIn('| 0 of 60 |', text)

    def test_agreement_joins_the_two_ways(self):
        step = {'steps': [{'effects': [], 'heldout_rms_error': 1.0, 'verdict': 'adequate'}], 'model_evaluations': 0}
        pair = [record('whole60', 2, improve=step, told=None), record('again60', 2), record('again60', 3)]
        self.assertEqual([(a['case'], b['case']) for a, b in judge.agreement(pair)], [('whole60-2', 'again60-2')])
        self.assertIn('| whole60-2 | rolling_resistance, lambda 60 | 0.9, 0.9 |', judge.report(pair))
        self.assertEqual(judge.counted(row_of('lambda 60: exact truth'), pair), ([], []))

    def test_results_change_below_the_mark_only(self):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, 'RESULTS.md')
            with open(path, 'w', encoding='utf-8') as file:
                file.write('# Head\n\n' + judge.MARK + '\nold\n')
            judge.write_results(path, 'new\n')
            with open(path, encoding='utf-8') as file:
                self.assertEqual(file.read(), '# Head\n\n' + judge.MARK + '\nnew\n')
        with open(os.path.join(BENCH, 'RESULTS.md'), encoding='utf-8') as file:
            self.assertEqual(file.read().count(judge.MARK), 1)


class InAFolder(unittest.TestCase):

    def setUp(self):
        self.folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, self.folder)

    def path(self, *names):
        return os.path.join(self.folder, *names)

    def write(self, name, text):
        os.makedirs(os.path.dirname(self.path(name)), exist_ok=True)
        with open(self.path(name), 'w', encoding='utf-8') as file:
            file.write(text)


class Records(InAFolder):

    def test_finished_cases_are_found_again_and_one_that_was_cut_short_is_not(self):
        kept = records.Records(self.path('cases.jsonl'), COMMIT)
        for name in ('a', 'b', 'a'):
            kept.add({'case': name, 'value': 1})
        kept.close()
        with open(self.path('cases.jsonl'), 'a', encoding='utf-8') as file:
            file.write('{"case": "c", "comm')
        kept = records.Records(self.path('cases.jsonl'), COMMIT)
        self.assertEqual(kept.done, {'a', 'b'})
        kept.add({'case': 'c'})
        kept.close()
        self.assertEqual([one['case'] for one in records.read(self.path('cases.jsonl'))], ['a', 'b', 'c'])

    def test_cases_of_another_commit_are_refused(self):
        kept = records.Records(self.path('cases.jsonl'), 'tune 1')
        kept.add({'case': 'a'})
        kept.close()
        with self.assertRaisesRegex(ValueError, 'holds cases of tune 1'):
            records.Records(self.path('cases.jsonl'), COMMIT)

    def test_one_process_at_a_time(self):
        kept = records.Records(self.path('cases.jsonl'), COMMIT)
        with self.assertRaisesRegex(ValueError, 'held by another'):
            records.Records(self.path('cases.jsonl'), COMMIT)
        kept.close()


    def test_cases_that_the_repository_keeps_are_not_made_again(self):
        own, kept = self.path('cases.jsonl'), self.path('judged.jsonl.gz')
        first = records.Records(own, COMMIT)
        for name in ('b', 'a'):
            first.add({'case': name})
        first.close()
        records.keep(kept, first.all)
        with open(kept, 'rb') as file:
            once = file.read()
        records.keep(kept, first.all[::-1])
        with open(kept, 'rb') as file:
            self.assertEqual(file.read(), once)
        os.remove(own)
        records.bring(own, kept, 'f' * 40)
        self.assertFalse(os.path.exists(own), 'cases of other rules')
        records.bring(own, kept, COMMIT)
        again = records.Records(own, COMMIT)
        self.assertEqual(again.done, {'a', 'b'})
        again.add({'case': 'c'})
        again.close()
        records.bring(own, kept, COMMIT)
        self.assertEqual(len(records.read(own)), 3, 'what is there stays')


class Frozen(InAFolder):

    def git(self, *arguments):
        name = ['-c', 'user.name=a', '-c', 'user.email=a@b']
        return subprocess.run(['git', '-C', self.folder, *name, *arguments], check=True, capture_output=True, text=True).stdout.strip()

    def test_judged_only_while_what_answers_is_as_it_was(self):
        for folder in cases.JUDGED:
            self.write(f'{folder}/one', 'one')
        for file in cases.OWN:
            self.write(file, 'one')
        self.git('init', '-q')
        self.git('add', '-A')
        self.git('commit', '-qm', 'rules')
        commit, file = self.git('rev-parse', 'HEAD'), self.path('FROZEN')
        with self.assertRaisesRegex(cases.NotFrozen, 'only --tune'):
            cases.frozen_commit(self.folder, file)
        self.write('FROZEN', commit + '\n')
        self.write('dem/other', 'what is not judged may change')
        self.git('add', '-A')
        self.git('commit', '-qm', 'frozen')
        self.assertEqual(cases.frozen_commit(self.folder, file), commit)
        self.write('server/diagnosis/one', 'two')
        with self.assertRaisesRegex(cases.NotFrozen, 'not committed.*server/diagnosis/one'):
            cases.frozen_commit(self.folder, file)
        self.git('commit', '-qam', 'changed')
        with self.assertRaisesRegex(cases.NotFrozen, 'server/diagnosis is not what it was'):
            cases.frozen_commit(self.folder, file)
        self.git('revert', '-n', 'HEAD')
        self.write('server/diagnosis/proposed_test.cc', 'what comes after an answer')
        self.git('add', '-A')
        self.git('commit', '-qm', 'after')
        self.assertEqual(cases.frozen_commit(self.folder, file, 'shared'), commit)
        with self.assertRaisesRegex(cases.NotFrozen, 'server/diagnosis is not what it was'):
            cases.frozen_commit(self.folder, file, 'whole')
        self.write('FROZEN', commit[:12])
        with self.assertRaisesRegex(cases.NotFrozen, '40 digits'):
            cases.frozen_commit(self.folder, file)

    def bench(self, *arguments):
        command = [sys.executable, '-B', os.path.join(BENCH, 'run.py'), '--calibctl', '/bin/false', '--state', self.path('state'), *arguments]
        return subprocess.run(command, capture_output=True, text=True, timeout=60)

    @unittest.skipIf(os.path.exists(os.path.join(BENCH, 'FROZEN')), 'rules are frozen')
    def test_without_frozen_rules_nothing_runs_but_tuning(self):
        refused = self.bench()
        self.assertEqual((refused.returncode, refused.stdout), (2, ''))
        self.assertIn('no rules are frozen', refused.stderr)
        self.assertFalse(os.path.exists(self.path('state')))
        tuned = self.bench('--tune', '1', '--table')
        self.assertEqual(tuned.returncode, 0, tuned.stderr)
        self.assertIn('for tuning, not judged', tuned.stdout)
        self.assertTrue(os.path.exists(self.path('state/tune_1/cases.jsonl.lock')))

    def test_tuning_never_enters_the_results(self):
        refused = self.bench('--tune', '1', '--results')
        self.assertEqual(refused.returncode, 2)
        self.assertIn('not judged', refused.stderr)


CALIBCTL = '''\
#!/usr/bin/env python3
"""Answers as calibctl does, at once; writes down what it was asked."""
import json, os, sys, time
verb, here = sys.argv[1], os.path.dirname(os.path.abspath(__file__))
with open(os.path.join(here, 'asked'), 'a') as file:
    print(' '.join(word if '/' not in word else os.path.basename(word) for word in sys.argv[1:]), file=file)
if os.path.exists(os.path.join(here, 'slow-' + verb)):
    time.sleep(60)
after = '--then' in sys.argv
plan = {'test': 'oedometric', 'settings': {'confining_pressure': 2e5}, 'control': 'axial_strain', 'control_from': 0, 'control_to': 0.04,
        'unloading_at': 0.02, 'snippet': 'observables: {q_over_p: ', 'repeat_of': None,
        'considered': [{'test': 'oedometric', 'repeat_of': None}, {'test': 'triaxial_drained', 'repeat_of': 'high'}]}
diagnosis = {'verdict': 'ambiguous', 'effect': None, 'effects': [], 'candidates': [], 'probabilities': [], 'none_of_these': 0.5,
             'credible_set': [['x']] if after else [['x'], ['y']], 'families': [], 'model_evaluations': 300,
             'design': {'campaign': 'c2', 'runs': {'scout': 30}}, 'next_experiment': None if after else plan}
if verb == 'simulate':
    file = sys.argv[2]
    text = open(file).read()
    with open(sys.argv[sys.argv.index('-o') + 1], 'w') as out:
        print('experiment,load_step,q_over_p,volumetric_strain', file=out)
        for line in text.splitlines():
            if line.startswith('  - name: '):
                name = line.split()[-1]
                for k, _ in enumerate(open(os.path.join(os.path.dirname(file), name + '.csv')).readlines()[1:]):
                    print(name, k, 1.0, 0.01, sep=',', file=out)
elif verb == 'run':
    os.makedirs(sys.argv[sys.argv.index('--state') + 1], exist_ok=True)
    print(json.dumps({'campaign': 'c1'}))
elif verb == 'diagnose':
    print(json.dumps(diagnosis))
elif verb == 'improve':
    print(json.dumps({'steps': [{'effects': ['x'], 'heldout_rms_error': 1, 'verdict': 'adequate'}], 'verdict': 'adequate',
                      'final_campaign': 'c9', 'model_evaluations': 500}))
elif verb == 'posterior':
    print(json.dumps({'parameters': {'young_modulus': {'q05': 1, 'q95': 2}}}))
'''


class Given:
    """In the place of measured strengths."""

    def tuned(self, effect, turn, wanted, base, shape=None):
        return {f'{effect}.work': 1.0}, (wanted, 1.0, 1.0)


class Ways(InAFolder):

    def setUp(self):
        super().setUp()
        self.write('calibctl', CALIBCTL.replace('#!/usr/bin/env python3', '#!' + sys.executable))
        os.chmod(self.path('calibctl'), os.stat(self.path('calibctl')).st_mode | stat.S_IXUSR)
        self.write('asked', '')

    def lab(self, end=float('inf')):
        return laboratory.Laboratory(programs.Programs(self.path('calibctl'), end), self.path('state'))

    def asked(self):
        with open(self.path('asked'), encoding='utf-8') as file:
            return [line.split()[0] + (' then' if '--then' in line else '') for line in file]

    def test_the_whole_program_goes_on_where_it_was_stopped(self):
        case = cases.Case('whole60-0', 'whole60', 0, 5, ('x',), (0,), 60)
        self.write('slow-improve', '')
        lab = self.lab()

        def stop_in_improve():
            while 'improve' not in self.asked():
                time.sleep(0.02)
            lab.run.stop()
        threading.Thread(target=stop_in_improve, daemon=True).start()
        with self.assertRaises(programs.OutOfTime):
            two_ways.whole(case, lab, Given(), 1)
        self.assertEqual(self.asked(), ['simulate', 'run', 'diagnose', 'simulate', 'diagnose then', 'simulate', 'diagnose then', 'improve'])
        os.remove(self.path('slow-improve'))
        self.write('asked', '')
        found = two_ways.whole(case, self.lab(), Given(), 1)
        self.assertEqual(self.asked(), ['improve', 'posterior'])
        self.assertEqual((found['truth']['effects'], found['improve']['model_evaluations'], found['told']['then']['credible_set']),
                         (['x'], 500, [['x']]))
        judge.report([{**found, 'commit': COMMIT}])
        self.assertEqual(sorted(os.listdir(self.path('state/cases/whole60-0/state'))), [])

    def test_a_case_against_a_design_has_a_state_of_its_own_and_names_the_design(self):
        designs = two_ways.Designs(self.lab(), COMMIT, 1, Given())
        case = cases.Case('removed-0', 'removed', 0, 5, ('x',), (0,), 60, removed=('x',), design=1)
        found = two_ways.shared(case, self.lab(), designs, Given(), 1)
        self.assertEqual(found['design'], 1)
        with open(self.path('asked'), encoding='utf-8') as file:
            last = file.read().splitlines()[-1]
        self.assertTrue(last.startswith('diagnose c1 --design c2 --no-plan --without x '), last)
        self.assertEqual(sorted(os.listdir(self.path('state/designs'))), ['1'])
        with open(self.path('state/cases/removed-0/campaign.yaml'), encoding='utf-8') as file:
            one = file.read()
        with open(self.path('state/designs/1/campaign.yaml'), encoding='utf-8') as file:
            self.assertEqual(file.read(), one)
        self.assertNotIn('x.work', one)

    def test_an_answer_of_a_build_without_probabilities_is_told_and_not_kept(self):
        self.write('calibctl', CALIBCTL.replace('#!/usr/bin/env python3', '#!' + sys.executable).replace("'credible_set'", "'set'"))
        case = cases.Case('whole60-0', 'whole60', 0, 5, ('x',), (0,), 60)
        with self.assertRaisesRegex(programs.Failed, 'diagnose lacks credible_set'):
            two_ways.whole(case, self.lab(), Given(), 1)
        self.assertFalse(os.path.exists(self.path('state/cases/whole60-0/diagnose.json')))

    def test_a_piece_leaves_what_is_finished_and_keeps_no_failure(self):
        kept = records.Records(self.path('cases.jsonl'), COMMIT)
        self.addCleanup(kept.close)
        kept.add({'case': 'a'})
        piece, made = run.Piece(self.lab(), kept, 2), [cases.Case(name, 'lambda60', 0, 0) for name in 'abcd']

        def fail(code):
            raise programs.Failed('why', code)
        said = io.StringIO()
        with contextlib.redirect_stderr(said):
            piece.all(zip(made, (lambda: self.fail('asked again'), lambda: {'case': 'b'}, lambda: fail(None), lambda: fail(1))))
        self.assertEqual((kept.done, piece.failed), ({'a', 'b', 'c'}, 1))
        self.assertEqual([one.get('skipped') for one in kept.all if one['case'] == 'c'], ['why'])
        self.assertIn('d: why', said.getvalue())

    def test_the_same_case_is_the_same_measurement(self):
        texts = []
        for folder in ('one', 'two'):
            self.lab().measure(cases.Case('c', 'lambda60', 0, 9, ('x',), (0,), 60), self.path(folder), laboratory.STANDARD, Given())
            with open(self.path(folder, 'high.csv'), encoding='utf-8') as file:
                texts.append(file.read())
        self.assertEqual(texts[0], texts[1])
        self.assertEqual(len(texts[0].splitlines()), 29)

    def test_a_program_is_ended_by_its_own_pid_when_told_to_end(self):
        run = programs.Programs('/bin/sleep')
        threading.Timer(0.2, run.stop).start()
        began = time.monotonic()
        with self.assertRaises(programs.OutOfTime):
            run.call('60')
        self.assertLess(time.monotonic() - began, 10)
        with self.assertRaises(programs.OutOfTime):
            run.call('0')

    def test_a_program_that_outlasts_the_piece_is_ended(self):
        began = time.monotonic()
        with self.assertRaises(programs.OutOfTime):
            programs.Programs('/bin/sleep', began + 0.3).call('60')
        self.assertLess(time.monotonic() - began, 10)

    def test_what_fails_says_how(self):
        with self.assertRaises(programs.Failed) as failure:
            programs.Programs('/bin/sh').call('-c', 'echo no such option >&2; exit 2')
        self.assertEqual(failure.exception.code, 2)
        self.assertIn('no such option', str(failure.exception))


class Plans(unittest.TestCase):

    def test_the_path_of_a_proposal(self):
        self.assertEqual(two_ways.path_of({'path': [0, 1, 0.5]}), (0, 1, 0.5))
        path = two_ways.path_of({'control_from': 0, 'control_to': 0.08, 'unloading_at': 0.016})
        turns = [b for a, b, c in zip(path, path[1:], path[2:]) if (b - a) * (c - b) < 0]
        self.assertEqual((path[0], path[-1], turns), (0, 0.08, [0.016, 0.008]))


if __name__ == '__main__':
    unittest.main()
