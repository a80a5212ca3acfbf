"""Random programs are revised, and judged by LinuxCNC's interpreter in eight states of the controller.

Run with ``python benchmarks/nc_sweep.py --programs 2000 --seed 1``. Each seed gives one program, which is revised by
both methods, for Z alone or for X, Y and Z. The judge is `tests/compensation/nc/state_judge.py`, which knows nothing
of what the revision wanted. Printed are the counts, and why programs were refused; a wrong one is written with what is
wrong into the folder of ``--wrong``. Interrupted, it goes on at ``--seed``.
"""

import argparse
import sys
import tempfile
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1] / "tests"
sys.path[:0] = [str(TESTS), str(TESTS / "compensation" / "nc")]

from sweeping import Outcome, tried  # noqa: E402

#: programs that a process takes at a time
PIECE = 5


def piece(seeds: range) -> list[Outcome]:
    with tempfile.TemporaryDirectory(prefix="sweep-") as folder:
        return [outcome for seed in seeds for outcome in tried(seed, Path(folder))]


def report(outcomes: list[Outcome]) -> bool:
    """Print the counts; return whether all is well."""
    seeds = {o.seed for o in outcomes}
    invalid = {o.seed for o in outcomes if o.kind == "invalid"}
    print(f"programs {len(seeds)}, valid {len(seeds) - len(invalid)}")
    well = True
    for way in ("coordinates", "offset"):
        own = [o for o in outcomes if o.way == way]
        counts = Counter(o.kind for o in own)
        share = counts["refused"] / max(len(own), 1)
        compared = sum(o.moves for o in own)
        print(
            f"\n{way}: revised {counts['revised']}, refused {counts['refused']} ({share:.1%}), please report "
            f"{counts['report']}, wrong {counts['wrong']}; {compared:,} moves compared in all states"
        )
        well &= not counts["report"] and not counts["wrong"]
        for kind in ("refused", "report", "wrong"):
            for reason, number in Counter(g for o in own if o.kind == kind for g in o.groups).most_common():
                example = next(o.seed for o in own if o.kind == kind and reason in o.groups)
                print(f"  {kind:8} {number:4}  {reason}  [seed {example}]")
    return well


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--programs", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1, help="of the first program")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--wrong", type=Path, default=Path("sweep-wrong"), help="folder for wrong programs")
    options = parser.parse_args()
    end = options.seed + options.programs
    pieces = [range(k, min(k + PIECE, end)) for k in range(options.seed, end, PIECE)]
    outcomes: list[Outcome] = []
    with ProcessPoolExecutor(options.processes) as pool:
        for seeds, found in zip(pieces, pool.map(piece, pieces), strict=True):
            outcomes += found
            for outcome in found:
                if outcome.kind in ("wrong", "report"):
                    outcome.write(options.wrong)
                    print(f"\nseed {outcome.seed} {outcome.way} {outcome.axes}: {outcome.reasons[0]}", flush=True)
            print(f"\r{seeds.stop - options.seed} of {options.programs}", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    return 0 if report(outcomes) else 1


if __name__ == "__main__":
    sys.exit(main())
