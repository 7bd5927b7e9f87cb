"""Finished cases: one line of JSON each, in one file. A line that was cut short by a kill counts for nothing."""
import fcntl, gzip, json, os, threading


def read(path):
    """[record], in the order in which they were finished; the first of a case counts."""
    if not os.path.exists(path):
        return []
    with open(path, encoding='utf-8') as file:
        text = file.read()
    found = {}
    for line in text.split('\n')[:-1]:   # what follows the last end of line was cut short
        if not line:
            continue
        record = json.loads(line)
        found.setdefault((record['commit'], record['case']), record)
    return list(found.values())


def keep(path, kept):
    """Finished cases as a file of the repository: the same records give the same bytes."""
    text = ''.join(json.dumps(record, sort_keys=True) + '\n' for record in sorted(kept, key=lambda r: r['case']))
    with open(path, 'wb') as file:
        file.write(gzip.compress(text.encode(), mtime=0))


def bring(path, kept, commit):
    """Puts cases of the commit that the repository keeps where there are none yet."""
    if os.path.exists(path) or not os.path.exists(kept):
        return
    with gzip.open(kept, 'rt', encoding='utf-8') as file:
        text = file.read()
    if all(json.loads(line)['commit'] == commit for line in text.splitlines()):
        with open(path, 'w', encoding='utf-8') as out:
            out.write(text)


class Records:
    """Any number of threads may add; one process at a time may hold a file."""

    def __init__(self, path, commit):
        self.path, self.commit, self._lock = path, commit, threading.Lock()
        self._held = open(path + '.lock', 'w', encoding='utf-8')
        try:
            fcntl.flock(self._held, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self.close()
            raise ValueError(f'{path} is held by another process') from None
        self.all = read(path)
        others = {record['commit'] for record in self.all} - {commit}
        if others:
            self.close()
            raise ValueError(f'{path} holds cases of {", ".join(sorted(others))}, not of {commit}')
        self.done = {record['case'] for record in self.all}
        if os.path.exists(path):
            with open(path, 'rb+') as file:    # so that the next line begins on its own
                file.truncate(file.read().rfind(b'\n') + 1)

    def close(self):
        self._held.close()

    def add(self, record):
        record = {'commit': self.commit, **record}
        line = json.dumps(record, sort_keys=True) + '\n'
        with self._lock:
            if record['case'] in self.done:
                return
            with open(self.path, 'a', encoding='utf-8') as file:
                file.write(line)
                file.flush()
                os.fsync(file.fileno())
            self.done.add(record['case'])
            self.all.append(record)
