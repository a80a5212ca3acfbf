"""Projection pursuit regression compared with R's ``stats::ppr`` (Friedman's SMART): same number of terms and freedom.

Run with ``OMP_NUM_THREADS=1 python benchmarks/bench_ppr.py``. R fits once with its spline with the same degrees of
freedom, and once with its default smoother (supsmu). Agreement: the R2 on unseen rows is not more than 0.01 below that
of R's spline and, where the true function is known, within 0.01 of the maximum that the noise permits. The R2 on the
training rows is printed too.
"""

import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bench_stepwise import network
from thermocomp.models import ppr

FloatArray = NDArray[np.float64]

DEGREES = 6.0
TURNS, REPEATS = 3, 3
GOAL = 1.0  # times as fast as R's spline
TOLERANCE = 0.01

SCRIPT = """
arguments <- commandArgs(TRUE)
X <- as.matrix(read.csv(arguments[1], header = FALSE))
y <- X[, ncol(X)]
X <- X[, -ncol(X)]
learn <- seq_len(as.integer(arguments[2]))
terms <- as.integer(arguments[3])
r2 <- function(y, p) 1 - sum((y - p)^2) / sum((y - mean(y))^2)
for (smoother in c("spline", "supsmu")) {
  times <- c()
  for (k in seq_len(as.integer(arguments[4]))) {
    start <- proc.time()[[3]]
    fit <- ppr(X[learn, ], y[learn], nterms = terms, sm.method = smoother, df = as.numeric(arguments[5]))
    times <- c(times, proc.time()[[3]] - start)
  }
  cat(median(times), r2(y[learn], fitted(fit)), r2(y[-learn], predict(fit, X[-learn, ])), "\\n")
}
"""


def ridges() -> tuple[FloatArray, FloatArray, int, int]:
    """Two ridge functions of six inputs, and noise that leaves an R2 of 0.99."""
    rng = np.random.default_rng(0)
    X = rng.normal(size=(4000, 6))
    y = 3 * np.tanh(X @ np.array([3, -1, 0, 2, 0, 0]) / np.sqrt(14)) + (X @ np.array([0, 1, 1, 0, 0, 0])) ** 2 / 2
    return X, y + 0.1 * y.std() * rng.normal(size=len(y)), 2000, 2


def machine() -> tuple[FloatArray, FloatArray, int, int]:
    """Sixteen collinear temperatures and a nonlinear drift."""
    X, y = network(12_000, 16, seed=20, bending=0.05)
    return X, y, 9000, 5


def r_squared(y: FloatArray, predicted: FloatArray) -> float:
    return float(1 - np.sum((y - predicted) ** 2) / np.sum((y - y.mean()) ** 2))


def ours(X: FloatArray, y: FloatArray, learn: int, terms: int) -> tuple[float, float, float]:
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        model = ppr._path(X[:learn], y[:learn], terms, DEGREES)[-1]
        times.append(time.perf_counter() - start)
    fitted, unseen = (r_squared(y[rows], model.predict(X[rows])) for rows in (slice(learn), slice(learn, None)))
    return float(np.median(times)), fitted, unseen


def theirs(table: Path, script: Path, learn: int, terms: int) -> FloatArray:
    command = ["Rscript", str(script), str(table), *(str(n) for n in (learn, terms, REPEATS, DEGREES))]
    output = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    return np.array([[float(v) for v in line.split()] for line in output.splitlines()])


def main() -> int:
    if shutil.which("Rscript") is None:
        print("peer not installed: Rscript")
        return 0
    reached = True
    print(f"{'problem':<30} {'side':<16} {'time [ms]':>9} {'R2 fitted':>10} {'R2 unseen':>10} {'ratio':>7} {'goal':>6}")
    with tempfile.TemporaryDirectory() as folder:
        script, table = Path(folder, "ppr.R"), Path(folder, "table.csv")
        script.write_text(SCRIPT, encoding="utf-8")
        for title, make in (("two ridges", ridges), ("temperatures", machine)):
            X, y, learn, terms = make()
            np.savetxt(table, np.column_stack([X, y]), delimiter=",", fmt="%.17g")
            turns = [(ours(X, y, learn, terms), theirs(table, script, learn, terms)) for _ in range(TURNS)]
            mine = np.median([m for m, _ in turns], axis=0)
            spline, supsmu = np.median([t for _, t in turns], axis=0)
            name = f"{title}, n={learn} p={X.shape[1]} M={terms}"
            for side, row in (("ours", mine), ("R ppr, spline", spline), ("R ppr, supsmu", supsmu)):
                ratio = "" if side == "ours" else f"{row[0] / mine[0]:6.1f}x"
                goal = f"{GOAL:5.1f}x" if side == "R ppr, spline" else ""
                print(
                    f"{name:<30} {side:<16} {row[0] * 1e3:>9.0f} {row[1]:>10.5f} {row[2]:>10.5f} {ratio:>7} {goal:>6}"
                )
            if mine[2] < spline[2] - TOLERANCE or (title == "two ridges" and mine[2] < 0.99 - TOLERANCE):
                print(f"{title}: R2 of unseen rows is more than {TOLERANCE} below what is there")
                reached = False
            reached &= bool(spline[0] / mine[0] >= GOAL)
    start = time.perf_counter()
    X, y, learn, _ = machine()
    start = time.perf_counter()
    chosen = ppr.ProjectionPursuit().fit(X[:learn], y[:learn], cycle=np.arange(learn) * 6 // learn)
    seconds = time.perf_counter() - start
    print(f"whole fit, n={learn} p={X.shape[1]}, 6 cycles left out in turn: {seconds:.1f} s, {chosen.n_terms_} terms")
    return 0 if reached else 1


if __name__ == "__main__":
    sys.exit(main())
