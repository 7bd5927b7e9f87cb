#!/usr/bin/env python3
"""Each rule of check_layers.py can fail: a small tree that keeps all of them, and one change that breaks each."""
import os
import tempfile
import types
import unittest

import check_layers
import table as house

RULES = types.SimpleNamespace(
    ORDER="""
dem        ground < { left right } < top < top/deep
proto      calib/v1 < rpc
server     campaign < ways/quick < store < client
""",
    KNOWS="""
dem                   |                              |
server/campaign       | dem/ground                   | yaml-cpp
server/store          | server/campaign              | SQLiteCpp
server/ways           | server/campaign              |
server/client         | server/campaign proto        | grpcpp
server/client/session | server/campaign server/store | grpcpp
""",
    ROOMS='server/ways', COMMON_WORDS='slow', MAY_NAME_THEM='server/store/k.h',
    WATCHED='grpcpp SQLiteCpp yaml-cpp',
    MOST_FILES=3,
    MAY_HOLD_MORE='dem/right',
    DOORS='. dem dem/*',
    MOST_README_LINES=6,
    MOST_README_LINES_AT_ROOT=8,
    MOST_COLUMNS=100,
    MOST_COLUMNS_OF_A_ROW=160,
    MOST_WORDS=60)

GOOD = {
    'README.md': '# house\n' + '| ' + 'c' * 150 + ' |\n' + f'- [{"t" * 60}]({"u" * 70})\n',
    'dem/README.md': '# dem\nA packing of 1000000 grains, 1e10000, deadbeef, sha defaced.\n',
    'dem/ground/README.md': '# ground\n', 'dem/left/README.md': '# l\n', 'dem/right/README.md': '# r\n', 'dem/top/README.md': '# t\n',
    'dem/ground/a.h': '#include <cmath>\ndouble Root(double x) { return std::sqrt(x); }  // exp(x) is not called\n',
    'dem/left/b.h': '#include "dem/ground/a.h"\n',
    'dem/right/c.h': '#include "dem/ground/a.h"\n', 'dem/right/c.cc': '#include "dem/right/c.h"\n',
    'dem/right/d.h': '', 'dem/right/e.h': '', 'dem/right/f.h': '',
    'dem/top/g.h': '#include "dem/left/b.h"\n#include "dem/right/c.h"\n',
    'dem/top/deep/h.cc': '#include "dem/top/g.h"\n',
    'server/campaign/i.h': '#include "dem/ground/a.h"\n#include <yaml-cpp/yaml.h>\n',
    'server/client/session.cc': '#include "server/store/k.h"\n#include "server/client/l.h"\n',
    'server/client/l.h': '#include "calib/v1/m.pb.h"\n',
    'server/store/k.h': '#include "server/campaign/i.h"\nconst char* way = "quick";\n',
    'server/ways/quick/w.cc': 'const char* name = "quick";\n',
    'proto/calib/v1/m.proto': '',
    'build/left/README.md': 'not looked at ' * 100,
}


def found(changes):
    """What is said of GOOD with these files changed; None removes one."""
    with tempfile.TemporaryDirectory() as root:
        for path, text in {**GOOD, **changes}.items():
            if text is not None:
                os.makedirs(os.path.join(root, os.path.dirname(path)), exist_ok=True)
                with open(os.path.join(root, path), 'w', encoding='utf-8') as file:
                    file.write(text)
        return check_layers.offences(root, RULES)


class CheckLayers(unittest.TestCase):

    def says(self, changes, *texts):
        said = found(changes)
        self.assertEqual(len(said), len(texts), said)
        for offence, text in zip(said, texts):
            self.assertIn(text, offence)

    def test_a_tree_that_keeps_all_rules_is_good(self):
        self.assertEqual(found({}), [])

    def test_a_folder_that_the_table_does_not_know(self):
        self.says({'dem/new/a.h': '', 'dem/new/README.md': ''}, 'dem/new: a folder that')

    def test_an_include_against_the_order(self):
        self.assertIn('dem/ground/n.h:1: dem/ground may not include dem/top/deep/h.h, whose folder is not below it (ORDER)',
                      found({'dem/ground/n.h': '#include "dem/top/deep/h.h"\n'}))

    def test_neighbours_do_not_know_each_other(self):
        self.says({'dem/left/n.h': '#include "dem/right/c.h"\n'}, 'dem/left may not include dem/right/c.h')

    def test_a_part_that_may_not_be_known(self):
        self.says({'server/campaign/n.h': '#include "dem/top/g.h"\n'}, 'server/campaign may not include dem/top/g.h')

    def test_a_row_of_one_file_is_not_one_of_its_folder(self):
        self.says({'server/client/l.h': '#include "server/store/k.h"\n'}, 'server/client may not include server/store/k.h')

    def test_messages_are_a_part_too(self):
        self.says({'server/campaign/n.h': '#include "calib/v1/m.pb.h"\n'}, 'may not include proto/calib/v1/m.pb.h')

    def test_a_library_that_may_not_be_known(self):
        self.says({'server/campaign/n.h': '#  include <grpcpp/channel.h>\n'}, 'may not include <grpcpp/channel.h>')

    def test_a_method_that_is_named_outside_of_its_room(self):
        self.says({'server/client/n.h': 'bool Quick() { return name() == "quick"; }  // quickly\n'}, 'server/client/n.h:1: names quick')

    def test_a_cycle_of_two_folders(self):
        self.assertIn('cycle of folders: dem/ground dem/left', found({'dem/ground/n.h': '#include "dem/left/b.h"\n'}))

    def test_a_cycle_with_a_folder_inside(self):
        self.assertIn('cycle of folders: dem/top dem/top/deep', found({'dem/top/n.h': '#include "dem/top/deep/h.h"\n'}))

    def test_a_cycle_of_parts(self):
        self.assertIn('cycle of folders: dem server', found({'dem/ground/n.h': '#include "server/campaign/i.h"\n'}))

    def test_a_cycle_that_only_the_folders_above_show(self):
        # top/deep -> left and left/low -> top: no two folders reach each other, top and left do.
        said = found({'dem/top/deep/n.h': '#include "dem/left/b.h"\n', 'dem/left/low/n.h': '#include "dem/top/g.h"\n'})
        self.assertIn('cycle of folders: dem/left dem/top', said)

    def test_too_many_files(self):
        self.says({f'dem/left/n{i}.cc': '' for i in range(3)}, 'dem/left: 4 files')
        self.says({f'tests/n{i}.cc': '' for i in range(4)}, 'tests: 4 files')

    def test_header_and_source_count_one(self):
        self.assertEqual(found({'dem/left/b.cc': '', 'dem/left/n.cc': '', 'dem/left/n.h': ''}), [])

    def test_no_environment_in_dem(self):
        self.says({'dem/ground/n.h': 'auto* x = std::getenv("X");\n'}, 'dem/ground/n.h:1: dem and inference know no environment')

    def test_no_libm_in_dem(self):
        self.says({'dem/ground/n.h': 'double F(double x) { return 1 + std::exp(x); }\n'}, 'dem/ground/n.h:1: dem may not call libm')
        self.says({'dem/ground/n.h': 'double F(double x) { return 1 + pow(x, 3); }\n'}, 'dem may not call libm')

    def test_no_wait_by_the_wall_clock(self):
        self.says({'server/client/l.h': 'bool w = mutex.AwaitWithTimeout(c, t);\n'}, 'server/client/l.h:1: waits by the wall clock')

    def test_a_readme_that_is_too_long(self):
        self.says({'dem/left/README.md': 'x\n' * 7}, 'dem/left/README.md: 7 lines, at most 6')
        self.says({'README.md': 'x\n' * 9}, 'README.md: 9 lines, at most 8')

    def test_a_readme_that_is_too_wide(self):
        self.says({'dem/left/README.md': '```\n' + 'x' * 101 + '\n```\n'}, 'dem/left/README.md:2: 101 columns, at most 100')
        self.says({'dem/left/README.md': '|' + 'x' * 160 + '\n'}, '161 columns, at most 160')
        self.says({'dem/left/README.md': f'see [{"x" * 60}]({"u" * 60})\n'}, '128 columns, at most 100')

    def test_a_date_in_a_readme(self):
        self.says({'dem/left/README.md': 'since 2024-02-29\n'}, 'dem/left/README.md:1: a date (2024-02-29)')

    def test_a_commit_in_a_readme(self):
        self.says({'dem/left/README.md': 'with 901cef7.\n'}, 'dem/left/README.md:1: the name of a commit (901cef7)')

    def test_dates_may_stand_elsewhere(self):
        self.assertEqual(found({'dem/left/RESULTS.md': 'measured on 2024-02-29 with 901cef7\n'}), [])

    def test_a_door_that_is_missing(self):
        self.says({'dem/left/README.md': None}, 'dem/left: has no README.md')
        self.says({'README.md': None}, '.: has no README.md')

    def test_too_many_words(self):
        self.says({'dem/left/RESULTS.md': 'word ' * 60}, 'words of Markdown, at most 60 (longest: dem/left/RESULTS.md 60')

    def test_rows_code_and_what_is_generated_count_no_words(self):
        self.assertEqual(found({'dem/left/RESULTS.md': '| word ' * 60 + '\n```\n' + 'word ' * 60 + '\n```\n',
                                'dem/left/KEYS.md': '# Keys\nGenerated by calibctl.\n' + 'word ' * 60}), [])

    def test_each_folder_of_the_house_has_a_row_that_counts(self):
        """A slip in table.py, such as a prefix that names no folder, would let anything pass."""
        known = check_layers.places(house.ORDER)
        rows = check_layers.rows(house.KNOWS)
        for folder in known:
            self.assertTrue(any(check_layers.within(folder, row) for row in rows), folder)
        for row, (prefixes, libraries) in rows.items():
            for prefix in prefixes + [os.path.dirname(row) if row == 'server/client/session' else row]:
                place = os.path.dirname(prefix) if prefix.endswith('.h') else prefix
                self.assertTrue(any(check_layers.within(folder, place) for folder in known), f'{row}: {prefix}')
            self.assertLessEqual(set(libraries), set(house.WATCHED.split()), row)


if __name__ == '__main__':
    unittest.main()
