#!/usr/bin/env python3
"""The machinery of deploy/nightly on made-up pieces: what fails, goes on and is skipped. usage: nightly_test.py ROOT"""
import fnmatch
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

ROOT = sys.argv.pop(1) if len(sys.argv) > 1 else '.'
PROGRAM = os.path.abspath(os.path.join(ROOT, 'deploy/nightly.d/nightly.py'))

PIECES = '''
[[piece]]
name = "first"
what = "says that it ran"
depends = ["a"]
command = "echo first >>ran"

[[piece]]
name = "second"
what = "fails while there is no file mended"
depends = ["b"]
command = "echo second >>ran; test -e mended"

[[piece]]
name = "third"
what = "reads measurements"
depends = ["a", "b"]
data = true
command = "echo third >>ran"
'''


class Nightly(unittest.TestCase):

    def setUp(self):
        self.root = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, self.root)
        os.makedirs(f'{self.root}/deploy')
        self.write('deploy/common.sh', 'set -u\n')
        self.write('.gitignore', 'ran\nstamps\nmended\nRESULTS.md\npieces.toml\n')
        self.write('a/one', 'one')
        self.write('b/two', 'two')
        self.write('ran', '')
        self.write('pieces.toml', PIECES)
        subprocess.run(['git', 'init', '-q'], cwd=self.root, check=True)

    def write(self, path, text):
        os.makedirs(os.path.dirname(f'{self.root}/{path}'), exist_ok=True)
        with open(f'{self.root}/{path}', 'w', encoding='utf-8') as file:
            file.write(text)

    def read(self, path):
        with open(f'{self.root}/{path}', encoding='utf-8') as file:
            return file.read()

    def arguments(self, *more):
        return [sys.executable, '-B', PROGRAM, '--root', self.root, '--pieces', f'{self.root}/pieces.toml', '--stamps',
                f'{self.root}/stamps', '--results', f'{self.root}/RESULTS.md', *more]

    def nightly(self, *more, data=''):
        """(exit status, which pieces ran, what was printed)."""
        self.write('ran', '')
        done = subprocess.run(self.arguments(*more), capture_output=True, text=True, env={**os.environ, 'CALIB_DATA': data}, timeout=60)
        return done.returncode, self.read('ran').split(), done.stdout + done.stderr

    def row(self, name):
        return next(line for line in self.read('RESULTS.md').split('\n') if line.startswith(f'| {name} |')).split(' | ')

    def test_a_failure_is_told_and_the_others_run(self):
        status, ran, said = self.nightly(data=self.root)
        self.assertEqual((status, ran), (1, ['first', 'second', 'third']))
        self.assertIn('second: red', said)
        self.assertEqual([self.row(name)[2] for name in ('first', 'second', 'third')], ['green', 'red', 'green'])
        self.assertRegex(self.row('first')[3] + self.row('first')[4], r'^\d+\.\d20\d\d-\d\d-\d\d \|$')

    def test_a_second_call_repeats_what_failed_and_no_more(self):
        self.nightly(data=self.root)
        self.write('mended', '')
        self.assertEqual(self.nightly(data=self.root)[:2], (0, ['second']))
        status, ran, said = self.nightly(data=self.root)
        self.assertEqual((status, ran), (0, []))
        self.assertIn('first: green and unchanged', said)

    def test_what_changed_runs_again(self):
        self.write('mended', '')
        self.nightly(data=self.root)
        self.write('a/new', 'new')  # not even added to git
        self.assertEqual(self.nightly(data=self.root)[1], ['first', 'third'])
        self.write('b/two', 'other')
        self.assertIn('sources changed since', self.nightly('--list', data=self.root)[2])
        self.assertEqual(self.nightly(data=self.root)[1], ['second', 'third'])
        self.write('deploy/common.sh', 'set -eu\n')
        self.assertEqual(self.nightly(data=self.root)[1], ['first', 'second', 'third'])
        self.write('pieces.toml', PIECES.replace('echo first', 'echo  first'))
        self.assertEqual(self.nightly(data=self.root)[1], ['first'])
        self.write('a/README.md', 'words change nothing')
        self.assertEqual(self.nightly(data=self.root)[1], [])

    def test_pieces_by_name(self):
        self.assertEqual(self.nightly('first')[:2], (0, ['first']))
        self.assertEqual(self.row('second')[2], 'not run')
        status, ran, said = self.nightly('fourth')
        self.assertEqual((status, ran), (2, []))
        self.assertIn('no piece is named fourth; there are: first second third', said)

    def test_list_runs_nothing(self):
        status, ran, said = self.nightly('--list')
        self.assertEqual((status, ran), (0, []))
        self.assertRegex(said, r'first +not run +says that it ran')

    def test_without_measurements_what_reads_them_is_left_out(self):
        self.write('mended', '')
        status, ran, said = self.nightly()
        self.assertEqual((status, ran), (0, ['first', 'second']))
        self.assertIn('third: left out: no measurements here', said)
        self.assertEqual(self.nightly(data=self.root)[1], ['third'])

    def test_after_a_kill_it_goes_on_where_it_stopped(self):
        for kill in (signal.SIGTERM, signal.SIGKILL):
            shutil.rmtree(f'{self.root}/stamps', ignore_errors=True)
            self.write('pieces.toml', PIECES.replace('test -e mended', 'test -e mended || sleep 5'))
            self.write('ran', '')
            killed = subprocess.Popen(self.arguments(), stdout=subprocess.PIPE, text=True)
            for line in killed.stdout:  # until the second piece has begun
                if line.startswith('second:'):
                    break
            while 'second' not in self.read('ran'):  # and its command too, which outlives a SIGKILL
                time.sleep(0.01)
            killed.send_signal(kill)
            killed.stdout.close()
            self.assertNotEqual(killed.wait(10), 0)
            self.write('mended', '')
            self.assertEqual(self.nightly()[1], ['second'])
            os.remove(f'{self.root}/mended')

    def test_a_piece_that_takes_too_long_is_ended_with_what_it_started(self):
        self.write('pieces.toml', '[[piece]]\nname = "long"\nwhat = "x"\ndepends = ["a"]\nminutes = 0.01\n'
                   'command = "(sleep 3; echo late >>ran) & sleep 100"\n')
        started = time.monotonic()
        self.assertEqual(self.nightly()[0], 1)
        self.assertEqual(self.row('long')[2], 'over time')
        time.sleep(max(0, started + 4 - time.monotonic()))
        self.assertEqual(self.read('ran'), '')

    def test_a_list_with_a_slip_is_refused(self):
        for slip, text in (('depend = ["a"]\n', 'a key that is not known'), ('minutes = 61\n', 'at most 60 minutes')):
            self.write('pieces.toml', PIECES.replace('depends = ["a"]\n', 'depends = ["a"]\n' + slip, 1))
            status, ran, said = self.nightly()
            self.assertEqual((status, ran), (1, []))
            self.assertIn(text, said)
        self.write('pieces.toml', PIECES.replace('["b"]', '["c"]'))
        self.assertIn('second depends on c, which is not there', self.nightly()[2])
        self.write('pieces.toml', PIECES.replace('"third"', '"first"'))
        self.assertIn('two pieces are named first', self.nightly()[2])

    def test_the_real_list_is_read_and_depends_on_what_is_there(self):
        done = subprocess.run([sys.executable, '-B', PROGRAM, '--root', ROOT, '--pieces', f'{ROOT}/deploy/nightly.d/pieces.toml',
                               '--stamps', f'{self.root}/stamps', '--results', f'{self.root}/RESULTS.md', '--list'],
                              capture_output=True, text=True, timeout=60)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertRegex(done.stdout, r'(?m)^asan')

    def test_every_slow_test_is_in_a_piece(self):
        with open(f'{ROOT}/deploy/nightly.d/pieces.toml', encoding='utf-8') as file:
            run = re.findall(r"bin/(\w+) --gtest_filter='([^']+)'", file.read())
        slow = [name for name in slow_tests() if not any(
            name[0] == target and any(fnmatch.fnmatchcase(name[1], one) for one in pattern.split(':')) for target, pattern in run)]
        self.assertGreater(len(run), 3)
        self.assertEqual(slow, [], 'no piece of deploy/nightly.d/pieces.toml runs these')


def slow_tests():
    """(target, Suite.Test) of what deploy/test leaves out."""
    for folder, _, names in os.walk(f'{ROOT}/tests'):
        for name in names:
            if not name.endswith('.cc'):
                continue
            with open(os.path.join(folder, name), encoding='utf-8') as file:
                found = re.findall(r'(?m)^TEST(?:_F|_P)?\((\w*Slow), (\w+)\)', file.read())
            for suite, test in found:
                yield target_of(folder, name), f'{suite}.{test}'


def target_of(folder, name):
    """The calib_test that lists the file."""
    with open(os.path.join(folder, 'CMakeLists.txt'), encoding='utf-8') as file:
        before = re.split(rf'\b{re.escape(name)}\b', file.read())[0]
    return re.findall(r'calib_test\((\w+)', before)[-1]


if __name__ == '__main__':
    unittest.main()
