"""Runs the matrix of hidden effects: see ../hidden-effects and README.md."""
import argparse, concurrent.futures, fnmatch, math, os, sys, time

import cases, judge, laboratory

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument('--calibctl', required=True)
parser.add_argument('--state', default='build/hidden-effects', help='folder of the cases; finished ones are kept')
parser.add_argument('--only', default='*', help="pattern of case names, e.g. 'control*' or '*-l60-*'; several with commas")
parser.add_argument('--repeats', type=int, default=3, help='of each effect and strength')
parser.add_argument('--controls', type=int, default=100, help='measurements without a hidden effect')
parser.add_argument('--jobs', type=int, default=os.cpu_count(), help='cases at a time, one worker each')
parser.add_argument('--minutes', type=float, default=720, help='no case is begun after this time')
parser.add_argument('--no-improve', action='store_true', help='cases end with the diagnosis: nothing for the rows after improve')
parser.add_argument('--visible', action='store_true', help='measures the lambda of finished cases at their own parameters (needs numpy)')
parser.add_argument('--elsewhere', help='records of cases that are finished elsewhere: counted, and run here only for an improve that they lack')
parser.add_argument('--record', help='writes the records of all cases that the table counts')
parser.add_argument('--list', action='store_true', help='names of the cases, nothing is run')
parser.add_argument('--table', action='store_true', help='table of what has been finished, nothing is run')
arguments = parser.parse_args()

state = os.path.abspath(arguments.state)
lab = laboratory.Laboratory(os.path.abspath(arguments.calibctl), state)
end = time.time() + 60 * arguments.minutes


elsewhere = judge.read(arguments.elsewhere) if arguments.elsewhere else []
done = {one.case for one in elsewhere}
improved = {one.case for one in elsewhere if not math.isnan(one.heldout)}


def wanted(name):
    return any(fnmatch.fnmatch(name, pattern) for pattern in arguments.only.split(','))


def finished_elsewhere(case):
    return case.name in (done if arguments.no_improve or case.verb == 'diagnose' else improved)


def run(case):
    """True when the case is finished, now or earlier."""
    if time.time() > end:
        return False
    began = time.time()
    try:
        lab.run(case, improve=not arguments.no_improve)
    except laboratory.Failed as failure:
        print(f'{case.name}: {failure}', file=sys.stderr, flush=True)
        return False
    print(f'{case.name}: done in {time.time() - began:.0f} s', file=sys.stderr, flush=True)
    return True


still = arguments.table or arguments.list or arguments.visible
if not still:
    lab.measure_detectability()
matrix = [c for c in cases.matrix(lab.strengths(0 if still else arguments.jobs), arguments.repeats, arguments.controls) if wanted(c.name)]
if arguments.list:
    print('\n'.join(c.name for c in matrix))
    sys.exit(0)
if arguments.visible:
    for case in matrix:
        if lab.finished(case) and case.effects:
            lab.visible_at_truth(case, arguments.jobs)
elif not arguments.table:
    with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
        list(pool.map(run, [c for c in matrix if not finished_elsewhere(c)]))
records = [judge.record(c, lab.verdict(c), lab.truth(c), lab.visible_at_truth(c)) for c in matrix if lab.finished(c)]
here = {one.case for one in records}
records += [one for one in elsewhere if one.case not in here and wanted(one.case)]
if arguments.record:
    judge.write(records, arguments.record)
print(judge.table(records))
