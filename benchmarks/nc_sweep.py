"""Revise random programs, and check them with LinuxCNC's interpreter in eight states of the controller.

Run with ``python benchmarks/nc_sweep.py --programs 2000 --seed 1``. Each seed gives one program, which is revised by
both methods, for Z alone or for X, Y and Z. The check (`tests/helpers/state_judge.py`) is independent of the revision.
The counts and the reasons for refusals are printed. The results, and the original and revised program of every fault,
are written to the folder of ``--found``; a sweep that was interrupted continues from there.
"""

import argparse
import json
import sys
from dataclasses import asdict, replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "helpers"))

from sweeping import Counts, Outcome, sweep

#: maximum share of valid programs that are refused
GOAL = 0.10


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--programs", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1, help="of the first program")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--found", type=Path, default=Path("sweep-found"), help="folder for what is found")
    parser.add_argument("--no-proof", action="store_true", help="the judge alone, in half the time")
    options = parser.parse_args()
    options.found.mkdir(parents=True, exist_ok=True)
    log = options.found / "outcomes.jsonl"
    wanted = range(options.seed, options.seed + options.programs)
    outcomes = [o for o in _read(log) if o.seed in wanted]
    done = {o.seed for o in outcomes}
    with log.open("a", encoding="utf-8") as out:
        for outcome in sweep([seed for seed in wanted if seed not in done], options.processes, not options.no_proof):
            if outcome.kind in ("wrong", "report"):
                outcome.write(options.found)
                print(f"seed {outcome.seed} {outcome.way} {outcome.axes}: {outcome.reasons[0]}", flush=True)
            outcomes.append(replace(outcome, original="", revised="", reasons=outcome.reasons[:20]))
            print(json.dumps(asdict(outcomes[-1])), file=out, flush=True)
            print(f"\rseed {outcome.seed}", end="", file=sys.stderr, flush=True)
    counts = Counts(outcomes)
    print(f"\n{counts}")
    wrong = any(counts.of(way, kind) for way in ("coordinates", "offset") for kind in ("wrong", "report"))
    return int(wrong or counts.refused("coordinates") > GOAL)


def _read(log: Path) -> list[Outcome]:
    """Return the earlier results, without a program that was interrupted between its two methods."""
    if not log.exists():
        return []
    found = [Outcome(**json.loads(row)) for row in log.read_text(encoding="utf-8").splitlines() if row.endswith("}")]
    return [o for o in found if o.way == "" or sum(p.seed == o.seed for p in found) >= 2]


if __name__ == "__main__":
    sys.exit(main())
