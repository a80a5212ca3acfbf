"""Does a verdict depend on a single thermal cycle? The six cycles of the demo, and each five of them.

Run with ``python benchmarks/bench_stable.py [--seed 0]``. The machine runs through all six cycles each time; the
displacements of the left-out cycle are removed, so it is used neither for training nor for validation. Goal: a model
accepted with six cycles stays accepted with at least five of the six sets of five, and is refused with none.
"""

import argparse
import sys
from dataclasses import replace

import numpy as np

import thermocomp as tc
from thermocomp.judging import splits
from thermocomp.judging.compare import compare
from thermocomp.judging.results import Comparison
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack

METHODS = ("ols", "partial-f", "mra", "dynamic")
#: number of sets of five with which an accepted model must stay accepted
LEAST = 5


def judged(samples: Samples, without: int | None, jobs: int) -> Comparison:
    """Compare with the displacements of one cycle removed."""
    deviations = samples.deviations.copy()
    if without is not None:
        deviations[samples.cycle == without] = np.nan
    mine = replace(samples, deviations=deviations)
    judging = splits.leave_one_cycle_out(mine)
    kept = tuple(s for s in judging.splits if np.isfinite(deviations[s.judge]).any())
    return compare(mine, METHODS, replace(judging, splits=kept), jobs=jobs)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=-1)
    options = parser.parse_args()
    (recording,) = tc.simulate("demo", seed=options.seed)
    samples = stack([recording], [c.name for c in recording.displacements])
    sets = [None, *range(len(samples.cycle_names))]
    words = [{(a.target, a.model): a.word for a in judged(samples, k, options.jobs).overall()} for k in sets]
    missed = 0
    for key, word in words[0].items():
        fives = [w[key] for w in words[1:]]
        stays = fives.count(word)
        ok = word != "accepted" or (stays >= LEAST and "refused" not in fives)
        missed += not ok
        print(
            f"{key[0]:6} {key[1]:10} {word:9} stays so with {stays} of {len(fives)}  {'' if ok else f'MISSED {fives}'}"
        )
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
