#!/usr/bin/env python3
"""deploy/kubernetes: every key, type and required field by the types that Kubernetes publishes for Python (API 1.22, Debian's
python3-kubernetes); names, labels, ports and volumes that speak of each other; options that the programs know; the preStop of a
worker on a worker of this build. What a cluster would do with it is not tried.   usage: kubernetes_test.py ROOT PROGRAMS"""
import os
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import time
import unittest

import kubernetes.client as types
import yaml

ROOT, PROGRAMS = (os.path.abspath(sys.argv.pop(1)) for _ in range(2))
FILE = os.path.join(ROOT, 'deploy/kubernetes/calib.yaml')
PLAIN = {'str': str, 'int': int, 'bool': bool, 'float': (int, float), 'object': object, 'datetime': str}
SECONDS = 30


def documents():
    with open(FILE, encoding='utf-8') as file:
        return list(yaml.safe_load_all(file))


def check(value, kind, path):
    """ValueError: the value is not of this published type; path tells where."""
    found = re.fullmatch(r'list\[(.*)\]', kind)
    if found:
        if not isinstance(value, list):
            raise ValueError(f'{path} is no list')
        return [check(item, found[1], f'{path}[{number}]') for number, item in enumerate(value)]
    found = re.fullmatch(r'dict\(str, (.*)\)', kind)
    if found:
        if not isinstance(value, dict):
            raise ValueError(f'{path} is no mapping')
        return {key: check(item, found[1], f'{path}.{key}') for key, item in value.items()}
    if kind in PLAIN:
        if not isinstance(value, PLAIN[kind]) or (kind == 'int' and isinstance(value, bool)):
            raise ValueError(f'{path} is {value!r}, not of type {kind}')
        return value
    of = getattr(types, kind)
    names = {key: name for name, key in of.attribute_map.items()}
    if not isinstance(value, dict):
        raise ValueError(f'{path} is no {kind}')
    for key in value:
        if key not in names:
            raise ValueError(f'{path}.{key}: {kind} has no such field')
    try:  # which refuses where a required field is missing
        return of(**{names[key]: check(item, of.openapi_types[names[key]], f'{path}.{key}') for key, item in value.items()})
    except ValueError as problem:
        raise ValueError(problem if path in str(problem) else f'{path}: {problem}') from problem


def pods():
    return {item['metadata']['name']: item for item in documents() if 'template' in item['spec']}


def container_of(item):
    return item['spec']['template']['spec']['containers'][0]


class Manifest(unittest.TestCase):

    def test_is_of_the_published_types(self):
        kinds = []
        for item in documents():
            check(item, 'V1' + item['kind'], item['kind'])
            kinds.append((item['apiVersion'], item['kind']))
        self.assertEqual(kinds, [('v1', 'Service'), ('apps/v1', 'StatefulSet'), ('apps/v1', 'Deployment')])

    def test_another_type_is_seen(self):
        for path, value in ((('spec', 'replicas'), 'two'), (('spec', 'replica'), 2), (('spec', 'selector'), None)):
            item = pods()['calib-worker']
            item[path[0]][path[1]] = value
            with self.assertRaises(ValueError):
                check(item, 'V1Deployment', 'Deployment')

    def test_what_speaks_of_each_other_agrees(self):
        service = documents()[0]
        for name, item in pods().items():
            pod = item['spec']['template']
            self.assertEqual(item['spec']['selector']['matchLabels'], pod['metadata']['labels'])
            made = {volume['name'] for volume in pod['spec']['volumes'] + [
                {'name': claim['metadata']['name']} for claim in item['spec'].get('volumeClaimTemplates', [])]}
            self.assertEqual({mount['name'] for mount in container_of(item)['volumeMounts']}, made, name)
        server = pods()['calibd']
        self.assertEqual(service['spec']['selector'], server['spec']['template']['metadata']['labels'])
        self.assertEqual(service['metadata']['name'], server['spec']['serviceName'])
        ports = {port['name']: port['containerPort'] for port in container_of(server)['ports']}
        self.assertEqual({port['targetPort']: port['port'] for port in service['spec']['ports']}, ports)
        command = container_of(server)['command']
        self.assertEqual(command[command.index('--listen') + 1], f'0.0.0.0:{ports["grpc"]}')
        self.assertEqual(command[command.index('--http') + 1], f'0.0.0.0:{ports["page"]}')
        worker = container_of(pods()['calib-worker'])['command']
        self.assertEqual(worker[worker.index('--server') + 1], f'calibd:{ports["grpc"]}')
        self.assertLess(int(worker[worker.index('--drain-within') + 1]),
                        pods()['calib-worker']['spec']['template']['spec']['terminationGracePeriodSeconds'] - SECONDS)

    def test_programs_know_their_options(self):
        for item in pods().values():
            program, *words = container_of(item)['command']
            answer = subprocess.run([os.path.join(PROGRAMS, program), '--help'], capture_output=True, text=True, timeout=SECONDS, check=True)
            for option in (word for word in words if word.startswith('--')):
                self.assertRegex(answer.stdout, rf'(?m)^  {option} ', program)

    def test_pre_stop_ends_when_the_worker_has_left(self):
        hook = container_of(pods()['calib-worker'])['lifecycle']['preStop']['exec']['command']
        with tempfile.TemporaryDirectory() as folder, open(os.path.join(folder, 'log'), 'w', encoding='utf-8') as log, subprocess.Popen(
                [os.path.join(PROGRAMS, 'calib-worker'), '--server', f'unix:{folder}/nobody', '--drain-within', '540',
                 '--checkpoints', folder + '/rest'], stderr=log) as worker:
            try:
                end = time.monotonic() + SECONDS
                while 'disconnected' not in pathlib.Path(log.name).read_text('utf-8'):  # it hears signals by then
                    self.assertLess(time.monotonic(), end)
                    time.sleep(0.05)
                for_it = [re.sub(r'(kill -\S+) 1;', rf'\1 {worker.pid};', word) for word in hook]  # process 1 of its container
                with subprocess.Popen(for_it, stderr=subprocess.DEVNULL) as stop:
                    try:
                        self.assertEqual(worker.wait(SECONDS), 0)
                        stop.wait(SECONDS)
                    finally:
                        stop.kill()
            finally:
                worker.send_signal(signal.SIGKILL)


if __name__ == '__main__':
    unittest.main()
