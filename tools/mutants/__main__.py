"""Command line: ``python -m mutants [ids ...]``; without ids, those whose code or tests have changed."""

import argparse
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing
from itertools import islice
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from mutants.draw import draw
from mutants.run import KILLED, RAISED, SURVIVED, Copy
from mutants.table import WANTED, Project

#: changes tried for a requirement at most
TRIED = 16


def examine(project: Project, copy: Copy, key: str, seed: int) -> dict[str, Any]:
    """Draw changes of a requirement's code until enough of them are judged; return its entry of the table."""
    found: list[dict[str, Any]] = []
    raised = 0
    for m in islice(draw(copy.package, project.code[key], seed, key), TRIED):
        told = {"piece": m.piece, "before": m.before, "after": m.after}
        if reason := project.reason(told):
            found.append(told | {"verdict": "equivalent", "reason": reason})
            continue
        begin, file = time.perf_counter(), m.piece.partition("::")[0]
        verdict, test = copy.judge(file, m.text, project.tests[key])
        line = f"{key} {verdict:8} {time.perf_counter() - begin:5.1f} s  {file}:{m.line} {test}"
        print(line + (f"\n    - {m.before}\n    + {m.after}" if verdict == SURVIVED else ""), flush=True)
        if verdict == RAISED:
            raised += 1
            continue
        found.append(told | {"verdict": verdict} | ({"by": test} if test else {}))
        if sum(x["verdict"] != "equivalent" for x in found) == WANTED:
            break
    return project.state(key, copy.folder) | {"seed": seed, "raised": raised, "mutants": found}


def check(project: Project, copy: Copy, keys: list[str]) -> list[str]:
    """Run the tests of requirements without a change; return those that fail, and those that are skipped or missing."""
    tests = sorted({t for k in keys for t in project.tests[k]})
    outcomes = copy.run(tests)
    failed = [t for outcome, t in outcomes if outcome in (KILLED, RAISED)]
    passed = {t.partition("[")[0] for outcome, t in outcomes if outcome == "passed"}
    return failed or [t for k in keys if passed.isdisjoint(project.tests[k]) for t in project.tests[k]]


def main() -> int:
    """Run the mutants of some requirements; return 1 if a mutant survives."""
    parser = argparse.ArgumentParser(prog="make mutants", description=__doc__)
    parser.add_argument("ids", nargs="*", help="of requirements, or how they begin; default: those that have changed")
    parser.add_argument("--all", action="store_true", help="all requirements")
    parser.add_argument("--seed", type=int, default=1996, help="of the draws (default: %(default)s)")
    parser.add_argument("--jobs", type=int, default=2, help="requirements at a time (default: %(default)s)")
    asked = parser.parse_args()
    project = Project(Path(__file__).resolve().parents[2])
    keys = [k for k in project.tests if asked.all or any(k.startswith(i) for i in asked.ids)]
    if not (asked.all or asked.ids):
        keys = [k for k in project.tests if project.gaps(k)]
    with tempfile.TemporaryDirectory(prefix="mutants-") as name, ExitStack() as stack:
        copies: SimpleQueue[Copy] = SimpleQueue()
        for k in range(asked.jobs):
            copies.put(stack.enter_context(closing(Copy(project.root, Path(name) / str(k)))))

        def work(key: str) -> dict[str, Any]:
            copy = copies.get()
            try:
                return examine(project, copy, key, asked.seed)
            finally:
                copies.put(copy)

        copies.put(copy := copies.get())
        if keys and (wrong := check(project, copy, keys)):
            print("without a change these tests do not pass:", *wrong, sep="\n    ", file=sys.stderr)
            return 2
        with ThreadPoolExecutor(asked.jobs) as pool:
            for key, entry in zip(keys, pool.map(work, keys), strict=True):
                project.table[key] = entry
                project.save()
    verdicts = [m["verdict"] for k in keys for m in project.table[k]["mutants"]]
    counts = ", ".join(f"{verdicts.count(v)} {v}" for v in (KILLED, SURVIVED, "equivalent"))
    raised = sum(project.table[k]["raised"] for k in keys)
    print(f"{len(keys)} requirements: {counts}; {raised} only raised an error, and do not count")
    return int(any(project.gaps(k) for k in keys))


if __name__ == "__main__":
    sys.exit(main())
