#!/usr/bin/env python3
"""Runs pieces one after the other, skips those that are green and unchanged, and writes the table of all (deploy/nightly).

A piece of the file --pieces (TOML): name; what (one line); depends (files and folders, from the root); command (bash, run in the
root with deploy/common.sh sourced); data = true where it reads measurements; minutes, at most 60.
Exit status 0 when every piece that was asked for is green, 1 when one is not, 2 on a wrong call.
"""
import argparse
import datetime
import hashlib
import json
import os
import signal
import subprocess
import sys
import time
import tomllib

# What every piece depends on.
ALWAYS = ['CMakeLists.txt', 'CMakePresets.json', 'deploy/cmake', 'deploy/common.sh', 'deploy/packages.txt', 'deploy/packages-test.txt']
MOST_MINUTES = 60
GREEN, RED, OVERTIME, LEFT_OUT = 'green', 'red', 'over time', 'left out: no measurements here'


def pieces_of(path):
    with open(path, 'rb') as file:
        pieces = tomllib.load(file).get('piece', [])
    names = [piece['name'] for piece in pieces]
    for piece in pieces:
        if set(piece) - {'name', 'what', 'depends', 'command', 'data', 'minutes'}:
            sys.exit(f'{path}: {piece["name"]} has a key that is not known: {" ".join(piece)}')
        if not 0 < piece.setdefault('minutes', MOST_MINUTES) <= MOST_MINUTES:
            sys.exit(f'{path}: {piece["name"]} may take at most {MOST_MINUTES} minutes')
        if names.count(piece['name']) > 1:
            sys.exit(f'{path}: two pieces are named {piece["name"]}')
    return pieces


def digest_of(root, piece):
    """Of the command, the compiler, and the files it depends on: tracked and new ones, ignored ones and Markdown aside."""
    listed = subprocess.run(['git', 'ls-files', '-z', '-co', '--exclude-standard', '--', *piece['depends'], *ALWAYS],
                            cwd=root, check=True, capture_output=True).stdout
    compiler = subprocess.run(['g++', '--version'], capture_output=True).stdout
    total = hashlib.sha256(piece['command'].encode() + b'\0' + compiler)
    for name in sorted(set(listed.split(b'\0'))):
        path = os.path.join(os.fsencode(root), name)
        if name and not name.endswith(b'.md') and os.path.isfile(path):
            with open(path, 'rb') as file:
                total.update(name + b'\0' + hashlib.sha256(file.read()).digest())
    return total.hexdigest()


class Stamps:
    """What is known of each piece: digest, result, minutes and date of its last run that came to an end."""

    def __init__(self, folder, logs):
        self.folder, self.logs = folder, logs
        for made in (folder, logs):
            os.makedirs(made, exist_ok=True)

    def log(self, piece):
        return os.path.join(self.logs, piece['name'] + '.log')

    def read(self, piece):
        try:
            with open(os.path.join(self.folder, piece['name'] + '.json'), encoding='utf-8') as file:
                return json.load(file)
        except FileNotFoundError:
            return None

    def write(self, piece, stamp):
        path = os.path.join(self.folder, piece['name'] + '.json')
        with open(path + '.new', 'w', encoding='utf-8') as file:
            file.write(json.dumps(stamp, indent=1) + '\n')
        os.replace(path + '.new', path)  # whole or not at all


def run(root, piece, log_path):
    """(result, minutes)."""
    if piece.get('data') and not os.path.isdir(os.environ.get('CALIB_DATA') or '/nowhere'):
        return LEFT_OUT, 0
    started = time.monotonic()
    with open(log_path, 'w', encoding='utf-8') as log:
        process = subprocess.Popen(['bash', '-ec', 'source deploy/common.sh\n' + piece['command']], cwd=root, stdin=subprocess.DEVNULL,
                                   stdout=log, stderr=subprocess.STDOUT, start_new_session=True)
        try:
            result = GREEN if process.wait(60 * piece['minutes']) == 0 else RED
        except subprocess.TimeoutExpired:
            result = OVERTIME
        finally:
            try:
                os.killpg(process.pid, signal.SIGKILL)  # what it started goes with it, also when this program is interrupted
            except ProcessLookupError:
                pass
            process.wait()
    return result, (time.monotonic() - started) / 60


def state_of(piece, stamp, digest):
    if stamp is None:
        return 'not run'
    return stamp['result'] if stamp['digest'] == digest else f'{stamp["result"]}, sources changed since'


def write_table(path, pieces, stamps, digests):
    lines = ['# What deploy/test leaves out', '',
             'Written by `deploy/nightly`: newest result of each piece, on two cores. What a piece runs stands in',
             '[pieces.toml](../deploy/nightly.d/pieces.toml).', '', '| piece | what | result | minutes | date |', '|---|---|---|---|---|']
    for piece in pieces:
        stamp = stamps.read(piece)
        minutes, date = ('', '') if stamp is None else (f'{stamp["minutes"]:.1f}', stamp['date'])
        lines.append(f'| {piece["name"]} | {piece["what"]} | {state_of(piece, stamp, digests[piece["name"]])} | {minutes} | {date} |')
    with open(path + '.new', 'w', encoding='utf-8') as file:
        file.write('\n'.join(lines) + '\n')
    os.replace(path + '.new', path)


def main():
    parser = argparse.ArgumentParser(description='pieces of deploy/nightly')
    for option in ('--root', '--pieces', '--stamps', '--results'):
        parser.add_argument(option, required=True, help=argparse.SUPPRESS)
    parser.add_argument('--logs', help=argparse.SUPPRESS)
    parser.add_argument('--list', action='store_true', help='what there is and how it stands; runs nothing')
    parser.add_argument('names', nargs='*', metavar='PIECE', help='all when none is named')
    arguments = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # through the finally of run()

    pieces = pieces_of(arguments.pieces)
    stamps = Stamps(arguments.stamps, arguments.logs or arguments.stamps)
    unknown = set(arguments.names) - {piece['name'] for piece in pieces}
    if unknown:
        parser.error(f'no piece is named {" ".join(sorted(unknown))}; there are: {" ".join(piece["name"] for piece in pieces)}')
    for piece in pieces:
        for path in piece['depends']:
            if not os.path.exists(os.path.join(arguments.root, path)):
                sys.exit(f'{arguments.pieces}: {piece["name"]} depends on {path}, which is not there')
    digests = {piece['name']: digest_of(arguments.root, piece) for piece in pieces}
    asked = [piece for piece in pieces if not arguments.names or piece['name'] in arguments.names]
    if arguments.list:
        for piece in asked:
            print(f'{piece["name"]:24} {state_of(piece, stamps.read(piece), digests[piece["name"]]):32} {piece["what"]}')
        return 0

    good = True
    for piece in asked:
        name = piece['name']
        stamp = stamps.read(piece)
        if state_of(piece, stamp, digests[name]) == GREEN:
            print(f'{name}: green and unchanged since {stamp["date"]}, skipped', flush=True)
            continue
        print(f'{name}: {piece["what"]} (log: {stamps.log(piece)})', flush=True)
        result, minutes = run(arguments.root, piece, stamps.log(piece))
        print(f'{name}: {result} after {minutes:.1f} minutes', flush=True)
        if result != LEFT_OUT:
            date = datetime.date.today().isoformat()
            stamps.write(piece, {'digest': digests[name], 'result': result, 'minutes': minutes, 'date': date})
        good = good and result in (GREEN, LEFT_OUT)
        write_table(arguments.results, pieces, stamps, digests)
    write_table(arguments.results, pieces, stamps, digests)
    with open(arguments.results, encoding='utf-8') as file:
        print('\n' + file.read(), end='')
    return 0 if good else 1


if __name__ == '__main__':
    sys.exit(main())
