"""Runs the cases of cases.py in pieces and judges what is finished: see ../hidden-effects and README.md."""
import argparse, concurrent.futures, fnmatch, functools, glob, os, re, shutil, signal, sys, threading, time

import cases, judge, laboratory, layouts, programs, records, strengths, two_ways

ROOT = os.path.abspath(os.path.join(cases.HERE, '..', '..', '..'))
RESULTS = os.path.join(cases.HERE, 'RESULTS.md')
KEPT = os.path.join(cases.HERE, 'judged.jsonl.gz')


def options_of(arguments):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--calibctl', required=True)
    parser.add_argument('--state', default='build/hidden-effects', help='folder of the cases; finished ones are kept')
    parser.add_argument('--shared', action='store_true', help='cases against designs that are made once')
    parser.add_argument('--whole', action='store_true', help='the whole program for each case')
    parser.add_argument('--layouts', action='store_true', help='other tests, told without a rate')
    parser.add_argument('--minutes', type=float, default=55, help='of this piece; what runs then is ended and goes on in the next one')
    parser.add_argument('--jobs', type=int, default=os.cpu_count(), help='cases at a time')
    parser.add_argument('--workers', type=int, default=1, help='of each case')
    parser.add_argument('--only', default='*', help="pattern of case names, e.g. 'lambda60-*'; several with commas")
    parser.add_argument('--tune', metavar='SEED', help='other cases, in a file of their own that is never judged')
    parser.add_argument('--list', action='store_true', help='names of the cases and whether they are finished; nothing is run')
    parser.add_argument('--table', action='store_true', help='table of what is finished; nothing is run')
    parser.add_argument('--results', action='store_true', help='writes the table into RESULTS.md and the cases into judged.jsonl.gz; not with --tune')
    options = parser.parse_args(arguments)
    if options.tune and options.results:
        parser.error('--results: cases of --tune are not judged')
    if not (options.shared or options.whole or options.layouts):
        options.shared = options.whole = True
    return options


def label(options):
    """What seeds follow from: the frozen commit, or a word that no commit can be."""
    return f'tune {options.tune}' if options.tune else cases.frozen_commit(ROOT, way='whole' if options.whole or options.layouts else 'shared')


def file_of(options, commit):
    """Where finished cases are lines: tuning and judging share no file."""
    word = re.sub(r'\W', '_', commit)
    return os.path.join(options.state, ('judged-' if commit == word else '') + word[:40], 'cases.jsonl')


def engine():
    """Version of the mechanics: strengths belong to it."""
    with open(os.path.join(ROOT, 'dem/model/engine_version.cc'), encoding='utf-8') as text:
        return re.search(r'return "(\w+)"', text.read())[1]


class Piece:
    """Cases side by side until the time is over."""

    def __init__(self, lab, kept, jobs):
        self.lab, self.kept, self.jobs = lab, kept, jobs
        self.failed = 0

    def one(self, case, ask):
        if case.name in self.kept.done:
            return
        began = time.monotonic()
        try:
            self.kept.add({**ask(), 'seconds': round(time.monotonic() - began)})
        except programs.OutOfTime:
            return
        except programs.Failed as failure:
            if failure.code is None:     # no such measurement: a result, not a slip
                self.kept.add({'case': case.name, 'set': case.set, 'index': case.index, 'skipped': str(failure)})
            else:
                self.failed += 1
            print(f'{case.name}: {failure}', file=sys.stderr, flush=True)
            return
        for folder in glob.glob(os.path.join(self.lab.folder, 'cases', case.name, 'state*')):
            shutil.rmtree(folder, ignore_errors=True)
        print(f'{case.name}: done in {time.monotonic() - began:.0f} s', file=sys.stderr, flush=True)

    def all(self, asked):
        """asked: [(case, function that gives its record)]"""
        with concurrent.futures.ThreadPoolExecutor(self.jobs) as pool:
            for done in [pool.submit(self.one, *one) for one in asked]:
                done.result()


def main(arguments=None):
    options = options_of(arguments)
    try:
        commit = label(options)
    except cases.NotFrozen as reason:
        print(f'hidden-effects: {reason}', file=sys.stderr)
        return 2
    file = file_of(options, commit)
    os.makedirs(os.path.dirname(file), exist_ok=True)
    try:
        if not options.tune:
            records.bring(file, KEPT, commit)
        kept = records.Records(file, commit)
    except ValueError as reason:
        print(f'hidden-effects: {reason}', file=sys.stderr)
        return 2
    run = programs.Programs(os.path.abspath(options.calibctl), time.monotonic() + 60 * options.minutes)
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: threading.Thread(target=run.stop).start())
    lab = laboratory.Laboratory(run, os.path.abspath(os.path.dirname(file)))
    failed = 0
    if not options.table:
        try:
            failed = work(options, commit, lab, kept)
        except programs.OutOfTime:
            print('hidden-effects: the time is over before the first case; the same command goes on', file=sys.stderr)
        except programs.Failed as failure:
            print(f'hidden-effects: {failure}', file=sys.stderr)
            failed = 1
    text = judge.report(kept.all)
    print((f'Cases of "{commit}" for tuning, not judged.\n\n' if options.tune else '') + text)
    if options.results:
        judge.write_results(RESULTS, f'Rules frozen at {commit[:12]}.\n\n{text}')
        records.keep(KEPT, kept.all)
    return 1 if failed else 0


def work(options, commit, lab, kept):
    """How many cases failed."""
    strong = strengths.Strengths(lab, os.path.abspath(os.path.join(options.state, 'strengths-engine' + engine())), options.jobs)
    asked, designs = [], two_ways.Designs(lab, commit, options.jobs, strong)
    if options.shared or options.whole:
        if not options.list:
            strong.prepare()
        elif not strong.known():
            print('which cases there are follows from strengths that are not measured yet: a run without --list begins with them')
            return 0
        of = (commit, strong.reached(), strong.excludes(), set(strengths.SHAPES))
        if options.shared:
            asked += [(case, functools.partial(two_ways.shared, case, lab, designs, strong, options.workers))
                      for case in cases.all_cases(*of, 'shared')]
        if options.whole:
            asked += [(case, functools.partial(two_ways.whole, case, lab, strong, options.workers))
                      for case in cases.all_cases(*of, 'whole')]
    if options.layouts:
        asked += [(case, functools.partial(layouts.run, case, name, lab, options.workers)) for case, name in layouts.all_cases(commit)]
    asked = [one for one in asked if any(fnmatch.fnmatch(one[0].name, pattern) for pattern in options.only.split(','))]
    if options.list:
        print('\n'.join(f"{case.name} {'finished' if case.name in kept.done else '-'}" for case, _ in asked))
        return 0
    for number in sorted({case.design for case, ask in asked if ask.func is two_ways.shared and case.name not in kept.done}):
        designs.make(number)
    piece = Piece(lab, kept, options.jobs)
    piece.all(asked)
    return piece.failed


if __name__ == '__main__':
    sys.exit(main())
