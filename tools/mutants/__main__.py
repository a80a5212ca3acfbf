"""Command line: ``python -m mutants [ids ...]``; without ids, those whose code or tests have changed."""

import argparse
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from itertools import islice
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from mutants.draw import draw
from mutants.run import KILLED, RAISED, SURVIVED, Copy
from mutants.table import Project

#: killed mutants per requirement, and mutants tried for them at most
WANTED, TRIED = 2, 16


def examine(project: Project, copy: Copy, key: str, seed: int) -> dict[str, Any]:
    """Draw mutants of a requirement until enough are killed; return its entry of the table."""
    entry = project.state(key) | {"seed": seed, "raised": 0, "mutants": []}
    outcomes = copy.run(project.tests[key])
    failed = sorted({t for outcome, t in outcomes if outcome in (KILLED, RAISED)})
    missing = [t for t in project.tests[key] if not any(n.startswith(f"tests/{t}") for o, n in outcomes if o == "passed")]
    if failed or len(missing) == len(project.tests[key]):
        raise SystemExit(f"{key}: without a mutant these do not pass: {', '.join(failed or missing)}")
    for m in islice(draw(project.package, project.code[key], seed, key), TRIED):
        said = {"piece": m.piece, "before": m.before, "after": m.after}
        if reason := project.equivalent(m.piece, m.before, m.after):
            entry["mutants"].append(said | {"verdict": "equivalent", "reason": reason})
            continue
        begin = time.perf_counter()
        verdict, test = copy.judge(m.piece.partition("::")[0], m.text, project.tests[key])
        print(f"{key} {verdict:8} {time.perf_counter() - begin:5.1f} s  {m.piece.partition('::')[0]}:{m.line} {test}")
        if verdict == RAISED:
            entry["raised"] += 1
            continue
        if verdict == SURVIVED:
            print(f"    - {m.before}\n    + {m.after}")
        entry["mutants"].append(said | {"verdict": verdict} | ({"by": test} if test else {}))
        sys.stdout.flush()
        if sum(x["verdict"] != "equivalent" for x in entry["mutants"]) == WANTED:
            break
    return entry


def main() -> int:
    parser = argparse.ArgumentParser(prog="make mutants", description=__doc__)
    parser.add_argument("ids", nargs="*", help="of requirements, or how they begin; default: those that have changed")
    parser.add_argument("--all", action="store_true", help="all requirements")
    parser.add_argument("--seed", type=int, default=1996, help="of the draws (default: %(default)s)")
    parser.add_argument("--jobs", type=int, default=2, help="requirements at a time (default: %(default)s)")
    asked = parser.parse_args()
    project = Project(Path(__file__).resolve().parents[2])
    keys = [k for k in project.tests if asked.all or any(k.startswith(i) for i in asked.ids)]
    keys = keys if asked.all or asked.ids else project.stale()
    with tempfile.TemporaryDirectory(prefix="mutants-") as name:
        copies: SimpleQueue[Copy] = SimpleQueue()
        for k in range(min(asked.jobs, len(keys))):
            copies.put(Copy(project.root, Path(name) / str(k)))

        def work(key: str) -> dict[str, Any]:
            copy = copies.get()
            try:
                return examine(project, copy, key, asked.seed)
            finally:
                copies.put(copy)

        with ThreadPoolExecutor(asked.jobs) as pool:
            for key, entry in zip(keys, pool.map(work, keys), strict=True):
                project.table[key] = entry
                project.save()
    verdicts = [m["verdict"] for k in keys for m in project.table[k]["mutants"]]
    raised = sum(project.table[k]["raised"] for k in keys)
    counts = ", ".join(f"{verdicts.count(v)} {v}" for v in (KILLED, SURVIVED, "equivalent"))
    print(f"{len(keys)} requirements: {counts}; {raised} only raised and do not count")
    return int(any(project.gaps(k) for k in keys))


if __name__ == "__main__":
    sys.exit(main())
