"""Random programs are revised, and judged by LinuxCNC's interpreter in eight states of the controller.

Run with ``python benchmarks/nc_sweep.py --programs 2000 --seed 1``. Each seed gives one program, which is revised by
both methods, for Z alone or for X, Y and Z. The judge (`tests/compensation/nc/state_judge.py`) knows nothing of what
the revision wanted. Printed are the counts, and why programs were refused; a wrong one is written with what is wrong
into the folder of ``--wrong``. An interrupted sweep goes on with another ``--seed``.
"""

import argparse
import sys
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1] / "tests"
sys.path[:0] = [str(TESTS), str(TESTS / "compensation" / "nc")]

from sweeping import Counts, Outcome, sweep  # noqa: E402

#: refused programs of the valid ones, at most
GOAL = 0.10


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--programs", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1, help="of the first program")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--wrong", type=Path, default=Path("sweep-wrong"), help="folder for wrong programs")
    options = parser.parse_args()
    outcomes: list[Outcome] = []
    for outcome in sweep(range(options.seed, options.seed + options.programs), options.processes):
        if outcome.kind in ("wrong", "report"):
            outcome.write(options.wrong)
            print(f"seed {outcome.seed} {outcome.way} {outcome.axes}: {outcome.reasons[0]}", flush=True)
        if not outcomes or outcome.seed != outcomes[-1].seed:
            print(f"\rseed {outcome.seed}", end="", file=sys.stderr, flush=True)
        outcomes.append(outcome)
    counts = Counts(outcomes)
    print(f"\n{counts}")
    wrong = any(counts.of(way, kind) for way in ("coordinates", "offset") for kind in ("wrong", "report"))
    return int(wrong or counts.refused("coordinates") > GOAL)


if __name__ == "__main__":
    sys.exit(main())
