"""Runs adapters as a worker would and says whether their answers keep to the protocol.

    python3 check.py [--once] FOLDER...        exit code 0: all of them do

A folder has a campaign.yaml (of which model.command, files and templates are read, each on one
line), requests as request*.json and, if it can tell, one as diverged*.json that has to end with
exit code 3. Every request is run twice, which has to give the same bits; --once: run once.
What README.md shows as `diff -U0` has to be what diff says, and to change 15 lines at most.
"""
import json
import math
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import time


def read_model(folder):
    text = (folder / "campaign.yaml").read_text()
    lists = {}
    for key in ("command", "files", "templates"):
        found = re.search(rf"^  {key}: \[(.*)\]", text, re.MULTILINE)
        lists[key] = re.split(r",\s*", found.group(1)) if found else []
    return lists


def replace_names(text, values):
    """{NAME} by its value: exact names only, and never after $, where LIGGGHTS has its own."""
    names = "|".join(map(re.escape, values))
    return re.sub(rf"(?<!\$)\{{({names})\}}", lambda found: str(values[found.group(1)]), text)


def make_scratch(folder, model, request, scratch):
    """Fills the scratch folder and returns the command."""
    values = {**request["settings"], **request["parameters"], "scratch": scratch,
              "threads": request["threads"], "seed": request["seed"]}
    for name in model["files"] + model["templates"]:
        source = folder / os.path.expandvars(name)
        if not source.is_file():
            sys.exit(f"{folder}: {name} is not there; is CALIB_DATA set?")
        target = pathlib.Path(scratch, source.name)
        if name in model["templates"]:
            target.write_text(replace_names(source.read_text(), values))
        else:
            shutil.copy(source, target)
    return [replace_names(word, values) for word in model["command"]]


def run(folder, model, request):
    """(exit code, answer lines, other lines, last line of standard error, [s] per answer, [s])."""
    line = json.dumps(request)
    with tempfile.TemporaryDirectory() as scratch:
        command = make_scratch(folder, model, request, scratch)
        pathlib.Path(scratch, "request.json").write_text(line + "\n")
        environment = {**os.environ, "PYTHONUNBUFFERED": "1",
                       "OMP_NUM_THREADS": str(request["threads"])}
        begin = time.monotonic()
        with open(os.path.join(scratch, "stderr"), "w+") as errors:
            child = subprocess.Popen(command, cwd=scratch, env=environment, text=True,
                                     stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors)
            child.stdin.write(line + "\n")
            child.stdin.close()
            answers, others, times = [], [], []
            for text in child.stdout:
                if text.startswith("{"):
                    answers.append(text)
                    times.append(time.monotonic() - begin)
                else:
                    others.append(text)
            code = child.wait()
            errors.seek(0)
            reason = (errors.read().splitlines() or [""])[-1]
        return code, answers, others, reason, times, time.monotonic() - begin


def problems_of(answers, request):
    """What is wrong with the answers to a request that can be computed."""
    problems, states = [], {}
    last = 0
    for line in answers:
        loose = []  # numbers that are not written as they are read back

        def exact(token):
            if repr(float(token)) != token:
                loose.append(token)
            return float(token)

        try:
            answer = json.loads(line, parse_float=exact)
            step = answer["load_step"]
        except (ValueError, KeyError) as error:
            problems.append(f"is no answer ({error!r}): {line.strip()[:80]}")
            continue
        if not isinstance(step, int) or not last <= step < len(request["control"]["values"]):
            problems.append(f"load step {step} out of order or beyond the last")
            continue
        last = step
        states.setdefault(step, {}).update(answer)
        problems += [f"load step {step}: {token} is not round-trip exact" for token in loose]
    for step in range(len(request["control"]["values"])):
        for name in request["observables"]:
            value = states.get(step, {}).get(name)
            if not isinstance(value, (int, float)) or not math.isfinite(value):
                problems.append(f"load step {step}: {name} is {value}")
    return problems


def check_request(folder, model, path, twice):
    request = json.loads(path.read_text())
    code, answers, others, reason, times, wall = run(folder, model, request)
    if path.name.startswith("diverged"):
        problems = [] if code == 3 and reason else [f"exit code {code} instead of 3, or no reason"]
        summary = f"{len(answers)} states, then: {reason}"
    else:
        problems = problems_of(answers, request) + ([f"exit code {code}: {reason}"] if code else [])
        summary = f"{len(answers)} states" + (
            f", first after {times[0]:.1f} s, last after {times[-1]:.1f} s" if times else "")
    if twice and run(folder, model, request)[:2] != (code, answers):
        problems.append("a second run gave other bits")
    print(f"{path.parent.name}/{path.name}: {summary}; exit code {code}, {wall:.1f} s wall, "
          f"{len(others)} other lines ignored{', same bits twice' if twice else ''}"
          f"{': ' + '; '.join(problems[:5]) if problems else ': ok'}", flush=True)
    return not problems


def check_difference(folder):
    readme = folder / "README.md"
    shown = re.search(r"```diff\n\$ diff -U0 (\S+) (\S+)\n(.*?)```", readme.read_text(), re.DOTALL)
    stock, own, text = shown.groups()
    true = subprocess.run(["diff", "-U0", stock, own], cwd=folder, text=True,
                          stdout=subprocess.PIPE).stdout.split("\n", 2)[2]
    added = sum(line.startswith("+") for line in true.splitlines())
    ok = text == true and added <= 15
    print(f"{folder.name}/README.md: {added} lines added or changed from {stock} to {own}, "
          f"{'as shown: ok' if ok else 'NOT as shown, or too many'}")
    return ok


def main(arguments):
    twice = "--once" not in arguments
    ok = True
    for folder in map(pathlib.Path, [a for a in arguments if a != "--once"]):
        folder = folder.resolve()
        model = read_model(folder)
        ok &= check_difference(folder)
        for path in sorted([*folder.glob("diverged*.json"), *folder.glob("request*.json")]):
            ok &= check_request(folder, model, path, twice)
    return 0 if ok else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]) if sys.argv[1:] else __doc__)
