"""Correct digits on NIST's reference problems for linear regression (StRD), compared with other packages.

Run with ``python benchmarks/bench_nist.py [FOLDER]``; FOLDER holds Longley.dat and the other ten. Digits are the
smallest -log10 of the relative error over all parameters, at most 15. All sides get the same float64 columns.
"""

import re
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import statsmodels.api as sm
from numpy.typing import NDArray
from sklearn.linear_model import LinearRegression

from measured import find_measured
from thermocomp.models.numerics.leastsquares import lstsq

FloatArray = NDArray[np.float64]
Solver = Callable[[FloatArray, FloatArray, bool], FloatArray]

#: correct digits to reach
GOALS = {"Longley": 10.5, "Wampler1": 9.0, "Wampler2": 9.0, "Wampler3": 9.0, "Filip": 7.5}
PROBLEMS = ("Norris", "Pontius", "NoInt1", "NoInt2", "Longley", *(f"Wampler{k}" for k in range(1, 6)), "Filip")


def read(file: Path) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the certified parameters, the columns of X and y."""
    text = file.read_text()
    first, last = (int(k) for k in re.findall(r"Data\s+\(lines (\d+) to (\d+)\)", text)[0])
    certified = np.array([float(v) for v in re.findall(r"^\s+B\d+\s+(\S+)\s+\S+\s*$", text, re.MULTILINE)])
    data = np.array([[float(v) for v in line.split()] for line in text.splitlines()[first - 1 : last]])
    y, x = data[:, 0], data[:, 1:]
    degree = len(certified) - 1
    return certified, x ** np.arange(1, degree + 1) if x.shape[1] == 1 and degree else x, y


def ours(X: FloatArray, y: FloatArray, intercept: bool) -> FloatArray:
    found = lstsq(X, y, intercept=intercept)
    return np.append([found.intercept] * intercept, found.coefficients)


def by_numpy(X: FloatArray, y: FloatArray, intercept: bool) -> FloatArray:
    design = np.column_stack([np.ones(len(y)), X]) if intercept else X
    return np.asarray(np.linalg.lstsq(design, y, rcond=None)[0])


def by_sklearn(X: FloatArray, y: FloatArray, intercept: bool) -> FloatArray:
    model = LinearRegression(fit_intercept=intercept).fit(X, y)
    return np.append([model.intercept_] * intercept, model.coef_)


def by_statsmodels(X: FloatArray, y: FloatArray, intercept: bool) -> FloatArray:
    return np.asarray(sm.OLS(y, sm.add_constant(X) if intercept else X).fit(method="qr").params)


SOLVERS: dict[str, Solver] = {
    "thermocomp": ours,
    "numpy": by_numpy,
    "sklearn": by_sklearn,
    "statsmodels qr": by_statsmodels,
}


def digits(found: FloatArray, certified: FloatArray) -> float:
    error = np.abs(found - certified) / np.abs(certified)
    return float(-np.log10(max(error.max(), 1e-15)))


def main() -> int:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else find_measured("nist_strd")
    if folder is None:
        return 0
    print(f"{'problem':<10}" + "".join(f"{name:>16}" for name in SOLVERS) + f"{'goal':>8}")
    missed = 0
    for name in PROBLEMS:
        certified, X, y = read(folder / f"{name}.dat")
        intercept = X.shape[1] < len(certified)
        row = [digits(solver(X, y, intercept), certified) for solver in SOLVERS.values()]
        goal = GOALS.get(name)
        missed += goal is not None and row[0] < goal
        print(f"{name:<10}" + "".join(f"{d:>16.1f}" for d in row) + (f"{goal:>8.0f}" if goal else ""))
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
