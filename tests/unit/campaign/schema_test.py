#!/usr/bin/env python3
"""The JSON Schema of the campaign file and the reference of its keys, which both come from the table that the reader uses.
usage: schema_test.py CALIBCTL ROOT
"""
import copy
import json
import re
import subprocess
import sys
import unittest
from pathlib import Path

import jsonschema
import yaml

CALIBCTL, ROOT = sys.argv[1], Path(sys.argv[2])


def printed(*arguments):
    return subprocess.run([CALIBCTL, 'schema', *arguments], check=True, capture_output=True, text=True, timeout=60).stdout


SCHEMA = json.loads(printed())
CHECKER = jsonschema.Draft7Validator(SCHEMA)


class Loader(yaml.SafeLoader):
    """Numbers as YAML 1.2 has them, which editors follow: 1e8 is one."""


Loader.add_implicit_resolver('tag:yaml.org,2002:float',
                             re.compile(r'^[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?$'), list('-+0123456789.'))


def with_text_keys(value):
    """`null:` is a key of that name, as for the reader and for editors."""
    if isinstance(value, dict):
        return {'null' if key is None else str(key): with_text_keys(one) for key, one in value.items()}
    return [with_text_keys(one) for one in value] if isinstance(value, list) else value


def wrong_with(document):
    document = with_text_keys(document)
    return [f"{'/'.join(map(str, error.absolute_path))}: {error.message}" for error in CHECKER.iter_errors(document)]


def campaigns():
    """Every whole campaign that is shipped or shown."""
    for path in sorted((ROOT / 'deploy').rglob('*.yaml')):
        if 'kubernetes' in path.parts: continue  # no campaigns
        yield path.name, path.read_text(encoding='utf-8')
    text = (ROOT / 'server/campaign/CAMPAIGN_FILE.md').read_text(encoding='utf-8')
    for number, block in enumerate(re.findall(r'```yaml\n(.*?)```', text, re.S)):
        if block.startswith('name:'):
            yield f'CAMPAIGN_FILE.md, example {number + 1}', block


class Schema(unittest.TestCase):
    GOOD = yaml.load(next(text for name, text in campaigns() if 'example 1' in name), Loader)

    def test_is_a_schema(self):
        jsonschema.Draft7Validator.check_schema(SCHEMA)

    def test_every_shipped_campaign_follows_it(self):
        seen = 0
        for name, text in campaigns():
            seen += 1
            self.assertEqual(wrong_with(yaml.load(text, Loader)), [], name)
        self.assertGreater(seen, 10)

    def spoiled(self, spoil):
        document = copy.deepcopy(self.GOOD)
        spoil(document)
        return ' '.join(wrong_with(document))

    def test_what_it_finds(self):
        first = lambda document: document['experiments'][0]
        for spoil, found in (
                (lambda d: d.pop('parameters'), "'parameters' is a required property"),
                (lambda d: d.update(budgett={}), "'budgett' was unexpected"),
                (lambda d: d['model'].update(contact='hertz'), "'hertz' is not one of"),
                (lambda d: d['inference'].update(samples=1), '1 is less than the minimum of 2'),
                (lambda d: d['inference'].update(tolerance=1), 'inference/tolerance: 1'),
                (lambda d: d['model'].update(density='heavy'), "'heavy' does not match"),
                (lambda d: first(d).update(opening='10 mm'), 'experiments/0'),  # a setting of another test
                (lambda d: first(d).update(confining_presure='1 MPa'), 'experiments/0'),
                (lambda d: first(d)['data'].update(strain='true'), "'true' is not one of"),
                (lambda d: d['parameters']['young_modulus'].update(prior='flat'), 'parameters/young_modulus')):
            self.assertIn(found, self.spoiled(spoil))

    def test_units_and_words_are_texts_or_numbers(self):
        self.assertEqual(self.spoiled(lambda d: d['model'].update(density='2.65 g/cm^3')), '')
        self.assertEqual(self.spoiled(lambda d: d.update(early_stopping=False)), '')  # off, as editors read it
        self.assertEqual(self.spoiled(lambda d: d['parameters'].update({'rubber.young_modulus': 'default'})), '')

    def test_names_of_the_catalogue_are_offered(self):
        offered = SCHEMA['definitions']['parameters']['properties']
        for kind, of in (('contacts', ''), ('effects', '.')):
            entries = json.loads(subprocess.run([CALIBCTL, kind, '--json'], check=True, capture_output=True, text=True).stdout)
            self.assertTrue(entries)
            for entry in entries:
                for parameter in entry['parameters']:
                    name = parameter['name']
                    self.assertIn(name if not of or of in name else f"{entry['name']}.{name}", offered)

    def test_every_section_is_there_and_reached(self):
        named = set(re.findall(r'#/definitions/(\w+)', json.dumps(SCHEMA)))
        self.assertEqual(named, set(SCHEMA['definitions']))


class Table(unittest.TestCase):

    def test_every_key_is_read(self):
        """The reader refuses what is not in the table; what is only in the table it would not know."""
        sources = ''.join(path.read_text(encoding='utf-8') for part in ('server/campaign/file', 'server/methods')
                          for path in (ROOT / part).rglob('*.cc'))
        for section in [SCHEMA, *SCHEMA['definitions'].values()]:
            open_names = section.get('additionalProperties') is not False
            for key in section['properties']:
                of_catalogue = open_names or 'setting of' in section['properties'][key].get('description', '')
                if not of_catalogue:
                    self.assertIn(f'"{key}"', sources, key)

    def test_the_reference_is_the_table(self):
        written = (ROOT / 'server/campaign/KEYS.md').read_text(encoding='utf-8')
        self.assertEqual(written, printed('--reference'), 'calibctl schema --reference > server/campaign/KEYS.md')


if __name__ == '__main__':
    unittest.main(argv=sys.argv[:1])
