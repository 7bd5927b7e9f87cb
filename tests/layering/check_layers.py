#!/usr/bin/env python3
"""Holds the tree against table.py: who includes whom, cycles of folders, files a folder, and what a README is.
usage: check_layers.py ROOT. One line per offence; exit 1 if there is any.
"""
import collections
import fnmatch
import os
import re
import sys

import table as house

PARTS = ('dem', 'inference', 'proto', 'server', 'worker')
SOURCES = ('.h', '.cc', '.proto', '.sql')
INCLUDE = re.compile(r'\s*#\s*include\s*["<]([^">]+)[">]')


class Tree:
    """The files of a checkout: their folders and texts."""

    def __init__(self, root):
        self.root = root
        self.folders = collections.defaultdict(list)  # folder -> names
        for path, folders, names in os.walk(root):
            folders[:] = sorted(f for f in folders if not f.startswith(('.', 'build')) and f not in ('__pycache__', 'node_modules'))
            self.folders[os.path.relpath(path, root)] = sorted(names)

    def lines(self, path):
        with open(os.path.join(self.root, path), encoding='utf-8') as file:
            return file.read().splitlines()

    def sources(self, *endings):
        for folder, names in self.folders.items():
            if folder.split('/')[0] in PARTS:
                for name in names:
                    if name.endswith(endings):
                        yield f'{folder}/{name}'

    def markdown(self):
        for folder, names in self.folders.items():
            for name in names:
                if name.endswith('.md'):
                    yield os.path.normpath(f'{folder}/{name}')


def includes_of(tree):
    """(file, line number, header), the headers of messages by the place of their .proto."""
    for path in tree.sources('.h', '.cc'):
        for number, line in enumerate(tree.lines(path), 1):
            found = INCLUDE.match(line)
            if found:
                header = found[1]
                yield path, number, f'proto/{header}' if header.startswith('calib/v1/') else header


def places(order):
    """folder -> (part, rank) of the lines of ORDER."""
    result, part, rank, together = {}, None, 0, False
    for line in order.strip('\n').split('\n'):
        words = line.split()
        if not line[0].isspace():
            part, rank, words = words[0], 0, words[1:]
        for word in words:
            if word == '{' or word == '}':
                together = word == '{'
                rank += 0 if together else 1
            elif word == '<':
                rank += 1
            else:
                folder = part if word == '.' else f'{part}/{word}'
                result[folder] = (part, rank)
                rank += 0 if together else 1
    return result


def within(path, prefix):
    return path == prefix or path.startswith(prefix + '/')


def rows(knows):
    """folder or file without its ending -> (prefixes of headers, libraries)."""
    result = {}
    for line in knows.strip().split('\n'):
        folder, own, libraries = (cell.strip() for cell in line.split('|'))
        result[folder] = (own.split(), libraries.split())
    return result


def unknown_folders(tree, rules):
    known = places(rules.ORDER)
    for folder, names in tree.folders.items():
        if folder.split('/')[0] in PARTS and any(name.endswith(('.h', '.cc', '.proto')) for name in names):
            if folder not in known:
                yield f'{folder}: a folder that tests/layering/table.py does not know'


def wrong_arrows(tree, rules):
    known, table, watched = places(rules.ORDER), rows(rules.KNOWS), rules.WATCHED.split()
    for path, number, header in includes_of(tree):
        folder, target = os.path.dirname(path), os.path.dirname(header)
        fits = [row for row in table if within(path, row) or os.path.splitext(path)[0] == row]
        if not fits:
            continue
        best = max(fits, key=len)
        own, libraries = table[best]
        if header.split('/')[0] in PARTS:
            part = folder.split('/')[0]
            if target in known and folder in known and folder != target and known[target][0] == part:
                if known[target][1] >= known[folder][1]:
                    yield f'{path}:{number}: {folder} may not include {header}, whose folder is not below it (ORDER)'
                    continue
            inside = best if best in tree.folders else os.path.dirname(best)
            allowed = own if inside in own else own + [inside]
            if not any(within(header, prefix) for prefix in allowed):
                yield f'{path}:{number}: {best} may not include {header} (allowed: {" ".join(allowed)})'
        else:
            library = re.split(r'[/.]', header)[0]
            if library in watched and library not in libraries:
                yield f'{path}:{number}: {best} may not include <{header}>'


def cycles(tree, rules):
    """Circles of folders, seen at each depth: folders below a depth count as the one they are in."""
    del rules
    arrows = set()
    for path, _, header in includes_of(tree):
        if header.split('/')[0] in PARTS:
            arrows.add((os.path.dirname(path), os.path.dirname(header)))
    told = set()
    for depth in range(1, 2 + max((folder.count('/') for arrow in arrows for folder in arrow), default=0)):
        graph = collections.defaultdict(set)
        for one, other in arrows:
            a, b = ('/'.join(folder.split('/')[:depth]) for folder in (one, other))
            if a != b:
                graph[a].add(b)
        for circle in circles(graph):
            if circle not in told:
                told.add(circle)
                yield f'cycle of folders: {" ".join(sorted(circle))}'


def circles(graph):
    """Sets of two or more nodes of which each reaches each."""
    reach = {}
    for start in graph:
        seen, open_ends = set(), [start]
        while open_ends:
            for following in graph.get(open_ends.pop(), ()):
                if following not in seen:
                    seen.add(following)
                    open_ends.append(following)
        reach[start] = seen
    return {frozenset(b for b in reach[a] if a in reach.get(b, ())) for a in reach if a in reach[a]}


def named_methods(tree, rules):
    rooms = [os.path.basename(folder) for folder in tree.folders if os.path.dirname(folder) == rules.ROOMS]
    names = [name for name in rooms if name not in rules.COMMON_WORDS.split()]
    if not names:
        return
    named = re.compile(rf'\b({"|".join(sorted(names))})\b')
    for path in tree.sources('.h', '.cc'):
        if path.startswith('server/') and not within(path, rules.ROOMS) and path not in rules.MAY_NAME_THEM.split():
            for number, line in enumerate(tree.lines(path), 1):
                if found := named.search(line):
                    yield f'{path}:{number}: names {found[1]}; what a method is like is asked of campaign::Method ({rules.ROOMS})'


def full_folders(tree, rules):
    for folder, names in tree.folders.items():
        if folder.split('/')[0] in PARTS + ('tests',) and folder not in rules.MAY_HOLD_MORE.split():
            count = len({os.path.splitext(name)[0] for name in names if name.endswith(SOURCES)})
            if count > rules.MOST_FILES:
                yield f'{folder}: {count} files (.h and .cc of one name count one), at most {rules.MOST_FILES}'


def impure_libraries(tree, rules):
    """No environment, no clock and no terminal in dem and inference."""
    del rules
    for path in tree.sources('.h', '.cc'):
        if path.startswith(('dem/', 'inference/')):
            for number, line in enumerate(tree.lines(path), 1):
                if re.search(r'\b(getenv|cout|cerr|clock_gettime|gettimeofday)\b', line):
                    yield f'{path}:{number}: dem and inference know no environment, no clock and no terminal'


LIBM = ('exp|exp2|expm1|log|log2|log10|log1p|pow|cbrt|hypot|sin|cos|tan|asin|acos|atan|atan2|sinh|cosh|tanh|asinh|acosh|atanh|erf|'
        'erfc|tgamma|lgamma|beta|fma')
CALLS_LIBM = re.compile(rf'\bstd::({LIBM})[fl]?\b|(^|[^_.>:\w])({LIBM})[fl]? *\(')


def calls_of_libm(tree, rules):
    """libm chooses its code by the processor and gives other bits on another; sqrt, rounding and remainders are exact everywhere."""
    del rules
    for path in tree.sources('.h', '.cc'):
        if path.startswith('dem/'):
            for number, line in enumerate(tree.lines(path), 1):
                code = re.sub(r'"([^"\\]|\\.)*"', '', line)
                if CALLS_LIBM.search(re.sub(r'//.*', '', code)):
                    yield f'{path}:{number}: dem may not call libm: another processor would give other bits (dem/elementary)'


def waits_by_the_wall_clock(tree, rules):
    """Timed waits of Abseil's locks go by the wall clock, and last as much longer as that is set back: naps beside a steady clock."""
    del rules
    for path in tree.sources('.h', '.cc'):
        if path.startswith(('proto/', 'server/', 'worker/')):
            for number, line in enumerate(tree.lines(path), 1):
                if re.search(r'\b(Await|Wait|WaitForNotification|LockWhen)With(Timeout|Deadline)\b', line):
                    yield f'{path}:{number}: waits by the wall clock, which may be set back'


def is_row(line):
    return line.lstrip().startswith('|') or re.fullmatch(r'\s*([-*] )?(!?\[[^]]*\]\([^)]*\)|\[[^]]*\]: *\S+|<?https?://\S+)[.,;]?\s*', line)


COMMIT = re.compile(r'(?<![\w-])(?=[0-9a-f]*[a-f])(?=[0-9a-f]*[0-9])(?!\d+e\d+\b)[0-9a-f]{7,40}(?![\w-])')


def readmes(tree, rules):
    for path in tree.markdown():
        if os.path.basename(path) != 'README.md':
            continue
        lines = tree.lines(path)
        most = rules.MOST_README_LINES if os.path.dirname(path) else rules.MOST_README_LINES_AT_ROOT
        if len(lines) > most:
            yield f'{path}: {len(lines)} lines, at most {most}'
        for number, line in enumerate(lines, 1):
            wide = rules.MOST_COLUMNS_OF_A_ROW if is_row(line) else rules.MOST_COLUMNS
            if len(line) > wide:
                yield f'{path}:{number}: {len(line)} columns, at most {wide}'
            date = re.search(r'\b20\d\d-\d\d-\d\d\b', line)
            if date:
                yield f'{path}:{number}: a date ({date[0]}); measurements stand in RESULTS.md, history in git'
            commit = COMMIT.search(line)
            if commit:
                yield f'{path}:{number}: the name of a commit ({commit[0]}); history belongs to git'


def missing_doors(tree, rules):
    for pattern in rules.DOORS.split():
        for folder, names in tree.folders.items():
            if folder.count('/') == pattern.count('/') and fnmatch.fnmatchcase(folder, pattern) and 'README.md' not in names:
                yield f'{folder}: has no README.md'


def words_of(lines):
    if any('generated by' in line.lower() for line in lines[:5]):
        return 0
    count, fenced = 0, False
    for line in lines:
        if line.lstrip().startswith('```'):
            fenced = not fenced
        elif not fenced and not line.startswith('|'):
            count += len(line.split())
    return count


def too_many_words(tree, rules):
    counts = sorted(((words_of(tree.lines(path)), path) for path in tree.markdown()), reverse=True)
    total = sum(count for count, _ in counts)
    if total > rules.MOST_WORDS:
        longest = ', '.join(f'{path} {count}' for count, path in counts[:5])
        yield f'{total} words of Markdown, at most {rules.MOST_WORDS} (longest: {longest})'


RULES = (unknown_folders, wrong_arrows, cycles, named_methods, full_folders, impure_libraries, calls_of_libm, waits_by_the_wall_clock, readmes, missing_doors, too_many_words)


def offences(root, rules=house):
    tree = Tree(root)
    return [offence for rule in RULES for offence in rule(tree, rules)]


if __name__ == '__main__':
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    found = offences(sys.argv[1])
    print('\n'.join(found))
    sys.exit(1 if found else 0)
