#!/usr/bin/env python3
"""The units of deploy/systemd: what systemd-analyze says of them, and that what they start tells it is ready and stopping.
usage: systemd_test.py ROOT PROGRAMS"""
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import unittest

ROOT, PROGRAMS = (os.path.abspath(sys.argv.pop(1)) for _ in range(2))
UNITS = os.path.join(ROOT, 'deploy/systemd')
NAMES = sorted(name for name in os.listdir(UNITS) if name.endswith('.service'))
MOST_EXPOSED = 15  # tenths of `systemd-analyze security`'s scale to 100: below it a unit counts as hardened; both have 14
SECONDS = 30
ANALYZE = shutil.which('systemd-analyze')


def command_of(unit, folder):
    """What the unit starts, of this build, on a folder and a free port, as an argument list without variables."""
    with open(os.path.join(UNITS, unit), encoding='utf-8') as file:
        line = re.search(r'^ExecStart=(.*)$', file.read(), re.MULTILINE)[1]
    words = line.replace('/usr/bin', PROGRAMS).replace('/var/lib/calib', folder).split()
    return [word for word in words if not word.startswith('$')]


class Units(unittest.TestCase):

    def setUp(self):
        self.folder = tempfile.mkdtemp(prefix='calib-systemd-')
        self.addCleanup(shutil.rmtree, self.folder)

    @unittest.skipUnless(ANALYZE, 'left out: systemd-analyze is not installed')
    def test_are_understood_by_systemd(self):
        for name in NAMES:  # the programs of this build stand for the installed ones
            with open(os.path.join(UNITS, name), encoding='utf-8') as file:
                text = file.read()
            with open(os.path.join(self.folder, name), 'w', encoding='utf-8') as file:
                file.write(text.replace('/usr/bin/', PROGRAMS + '/'))
        answer = subprocess.run([ANALYZE, 'verify', '--man=no', '--recursive-errors=no'] + [os.path.join(self.folder, name) for name in NAMES],
                                capture_output=True, text=True, timeout=SECONDS, check=False)
        self.assertEqual((answer.returncode, answer.stderr), (0, ''))

    @unittest.skipUnless(ANALYZE, 'left out: systemd-analyze is not installed')
    def test_are_hardened(self):
        for name in NAMES:
            answer = subprocess.run([ANALYZE, 'security', '--offline=yes', f'--threshold={MOST_EXPOSED}', os.path.join(UNITS, name)],
                                    capture_output=True, text=True, timeout=SECONDS, check=False)
            self.assertEqual(answer.returncode, 0, answer.stdout)

    def test_start_programs_that_say_when_they_are_ready_and_that_they_stop(self):
        more = {'calibd.service': ['--listen', '127.0.0.1:0'],
                'calib-worker.service': ['--server', 'unix:' + self.folder + '/nobody', '--checkpoints', self.folder + '/rest']}
        self.assertEqual(sorted(more), NAMES)
        for name in NAMES:
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager, \
                    open(os.path.join(self.folder, 'log'), 'w+', encoding='utf-8') as log:
                manager.settimeout(SECONDS)
                path = os.path.join(self.folder, name + '.notify')
                manager.bind(path)
                with subprocess.Popen(command_of(name, self.folder) + more[name], stderr=log,
                                      env={**os.environ, 'NOTIFY_SOCKET': path}) as program:
                    try:
                        self.assertEqual(manager.recv(100), b'READY=1', name)
                        program.send_signal(signal.SIGTERM)
                        self.assertEqual(manager.recv(100), b'STOPPING=1', name)
                        self.assertEqual(program.wait(SECONDS), 0, name)
                    finally:
                        program.kill()


if __name__ == '__main__':
    unittest.main()
