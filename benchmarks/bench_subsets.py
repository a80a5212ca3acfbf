"""Exact best subsets compared with R's leaps, on simulated networks of collinear temperatures.

Run with ``OMP_NUM_THREADS=1 python benchmarks/bench_subsets.py [--quick]``; ``--quick`` omits the tasks that take leaps
most of a minute. leaps is timed inside R, without the start of R. Both must find the same set of every size, with the
same sum of squares to six digits (leaps loses half of its digits on these data). Ours is timed twice: the search,
including the factorisation of the data, and the search with the certificate, for which each set is fitted again.
"""

import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bench_stepwise import network
from thermocomp.models.numerics.leastsquares import join_columns, triangle
from thermocomp.models.selection.subsetrun import run
from thermocomp.models.selection.subsets import Subsets, best_subsets
from thermocomp.models.selection.subsetsearch import Problem

FloatArray = NDArray[np.float64]

N_ROWS = 1000
RSCRIPT = shutil.which("Rscript")
SCRIPT = """
suppressMessages(library(leaps))
args <- commandArgs(TRUE)
d <- as.matrix(read.csv(args[1], header = FALSE)); p <- ncol(d) - 1
seconds <- c()
for (i in seq_len(as.integer(args[2])))
  seconds <- c(seconds, system.time(found <- regsubsets(d[, 1:p], d[, p + 1], nvmax = p, method = "exhaustive",
                                                        really.big = TRUE))[["elapsed"]])
cat(median(seconds), "\\n")
s <- summary(found)
for (k in seq_len(p)) cat(sprintf("%.15g", s$rss[k]), which(s$which[k, -1]) - 1, "\\n")
"""


def leaps(X: FloatArray, y: FloatArray, repeats: int) -> tuple[float, list[tuple[float, tuple[int, ...]]]]:
    """Return the median time [s] and, for each size, the residual sum of squares and the columns."""
    with tempfile.TemporaryDirectory() as folder:
        data, script = Path(folder, "data.csv"), Path(folder, "leaps.R")
        np.savetxt(data, np.column_stack([X, y]), delimiter=",", fmt="%.17g")
        script.write_text(SCRIPT)
        lines = subprocess.run(
            [str(RSCRIPT), str(script), str(data), str(repeats)], check=True, capture_output=True, text=True
        ).stdout.splitlines()
    rows = [line.split() for line in lines[1:]]
    return float(lines[0]), [(float(r[0]), tuple(int(c) for c in r[1:])) for r in rows]


def timed(job: Callable[[], object], repeats: int) -> float:
    """Return the median time [s]."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        job()
        times.append(time.perf_counter() - start)
    return float(np.median(times))


def same(found: Subsets, theirs: list[tuple[float, tuple[int, ...]]]) -> bool:
    """Whether the sets of all sizes are the same, and their sums of squares."""
    return all(
        s.columns == columns and abs(s.rss - rss) <= 1e-6 * rss
        for s, (rss, columns) in zip(found.best, theirs, strict=True)
    )


def compare(p: int, seed: int, repeats: tuple[int, int], goal: float, ratio: float) -> bool:
    """Time all sizes of `p` temperatures; return whether ours takes at most `goal` [s] and is `ratio` faster."""
    X, y = network(N_ROWS, p, seed, bending=0.0)

    def search() -> None:
        run(Problem.of(triangle(join_columns(X, y), intercept=True), range(p)), "dropping", p, 1, 1, None, None, None)

    found = best_subsets(X, y)
    ours, whole = timed(search, repeats[0]), timed(lambda: best_subsets(X, y), max(repeats[0] // 5, 1))
    if RSCRIPT is None:
        print(f"p={p} seed={seed}: {ours * 1e3:9.2f} ms search {whole * 1e3:9.2f} ms in all   peer not installed")
        return ours <= goal
    seconds, theirs = leaps(X, y, repeats[1])
    ours = float(np.median([ours, timed(search, repeats[0])]))  # before and after
    if not same(found, theirs):
        raise SystemExit(f"p={p} seed={seed}: not the same sets\n{found.best}\n{theirs}")
    scaled = (X - X.mean(axis=0)) / X.std(axis=0)
    print(
        f"all sizes, p={p:<3} seed {seed} {np.linalg.cond(scaled):>8.0f} {found.nodes:>10,} {ours * 1e3:>10.2f}"
        f" {whole * 1e3:>10.2f} {seconds * 1e3:>11.1f} {seconds / ours:>7.0f}x"
        f"   {goal * 1e3:.0f} ms, {ratio:.0f}x {'all proven' if found.proven else 'NOT ALL PROVEN'}"
    )
    return ours <= goal and seconds / ours >= ratio


def many(seed: int) -> bool:
    """Time all sets of up to 5 of 100 temperatures; no peer finishes."""
    X, y = network(N_ROWS, 100, seed, bending=0.0)
    found = best_subsets(X, y, max_size=5)
    ours = timed(lambda: best_subsets(X, y, max_size=5), 5)
    two = timed(lambda: best_subsets(X, y, max_size=5, jobs=2), 5)
    scaled = (X - X.mean(axis=0)) / X.std(axis=0)
    print(
        f"size <= 5, p=100 seed {seed} {np.linalg.cond(scaled):>8.0f} {found.nodes:>10,} {'':>10} {ours * 1e3:>10.2f}"
        f" {'-':>11} {'-':>8}   500 ms {'all proven' if found.proven else 'NOT ALL PROVEN'};"
        f" two threads {two * 1e3:.0f} ms"
    )
    return ours <= 0.5 and found.proven


def main() -> int:
    print(f"n = {N_ROWS}, one thread")
    print(f"{'job':<25} {'cond':>7} {'sets':>10} {'search':>10} {'in all':>10} {'leaps [ms]':>11} {'ratio':>8}   goal")
    reached = [compare(24, seed, (25, 9), 3e-3, 1) for seed in (20, 21, 22, 23, 24)]
    reached += [many(seed) for seed in (20, 21)]
    if "--quick" not in sys.argv:
        reached += [compare(40, seed, (9, 1), 0.150, 150) for seed in (20, 21)]
    print(f"{sum(reached)} of {len(reached)} goals reached")
    return 0 if all(reached) else 1


if __name__ == "__main__":
    sys.exit(main())
