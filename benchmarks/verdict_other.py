"""Generated recordings for `bench_verdict.py` that the two sets do not contain: judged by file or by rows; collinear.

`KINDS` has all of them by name, `JUDGED` the validation scheme of those that are not judged by leaving one cycle out.
The number at the end of a name is that of the files.
"""

from collections.abc import Callable

import numpy as np

from thermocomp.judging import splits
from thermocomp.recordings.samples import Samples
from verdict_case import FRESH, Case, File, FloatArray, Make, times

#: rows of a cycle, sensors
ROWS, SENSORS = 60, 4
#: [s]
INTERVAL = 60.0
#: spread of the logarithm of the error ratio between cycles
SPREAD = 0.3


def file(temperatures: FloatArray, drift: FloatArray, cycles: int = 1, *, continues: bool = False) -> File:
    rows = len(drift) // cycles
    bounds = [(k * rows, (k + 1) * rows) for k in range(cycles)]
    return File(times(len(drift), INTERVAL), temperatures, None, drift, bounds, continues=continues)


def noise(rng: np.random.Generator, kind: str, rows: int) -> FloatArray:
    """Return unrelated random walks from 0 or white noise; the last column is the drift."""
    white = rng.normal(size=(rows, SENSORS + 1))
    walk = np.cumsum(white, axis=0)
    return np.asarray(walk - walk[0]) if kind == "walk" else white


def independent(kind: str, files: int, cycles: int) -> Make:
    """Return files of several cycles each, with noise of their own."""

    def make(rng: np.random.Generator) -> Case:
        found = [noise(rng, kind, cycles * ROWS) for _ in range(files)]
        return Case([file(20 + x[:, :-1], x[:, -1], cycles) for x in found], null=True)

    return make


def continued(kind: str, files: int) -> Make:
    """Return one series of noise, cut into files that continue each other."""

    def make(rng: np.random.Generator) -> Case:
        parts = np.split(noise(rng, kind, files * ROWS), files)
        return Case([file(20 + x[:, :-1], x[:, -1], continues=k > 0) for k, x in enumerate(parts)], null=True)

    return make


def collinear(left: float, cycles: int, *, harm: float = 0.0) -> Make:
    """Return cold starts whose drift the sensors determine up to a share `left`, which differs between cycles.

    All sensors measure the same apart from noise, which is nearly true on a real machine. With `harm` [um], the machine
    hardly drifts in the last cycle although the sensors indicate that it does, so every model does harm. Without it,
    the part of the drift that the sensors do not determine is nowhere larger than the largest drift, so the best
    possible model does none.
    """

    def make(rng: np.random.Generator) -> Case:
        found = []
        for k in range(cycles + (0 if harm else FRESH)):
            size = rng.uniform(15, 40)  # RMS of the drift [um]
            told, unknown = parts(rng, left)
            while not harm and np.abs(unknown).max() > np.abs(told + unknown).max():
                told, unknown = parts(rng, left)
            drift = size * (told + unknown)
            if harm and k == cycles - 1:
                drift = 0.02 * size * told
                told = told * harm / size
            x = 20 + 0.3 * size * told[:, None] + 0.05 * rng.normal(size=(ROWS, SENSORS))
            found.append(file(x, drift + 0.2 * rng.normal(size=ROWS)))
        return Case(found[:cycles], null=harm > 0, fresh=found[cycles:])

    return make


def parts(rng: np.random.Generator, left: float) -> tuple[FloatArray, FloatArray]:
    """Return the part of a drift of RMS 1 that the sensors determine, and the rest, which is independent of them."""
    heat, other = smooth(rng), smooth(rng)
    other -= heat * (other @ heat) / (heat @ heat)
    share = min(left * np.exp(SPREAD * rng.normal()), 0.95)
    return heat / rms(heat) * np.sqrt(1 - share**2), other / rms(other) * share


def smooth(rng: np.random.Generator) -> FloatArray:
    """Return a temperature that drifts from 0, up or down, as slowly as that of a machine."""
    x = np.cumsum(np.cumsum(rng.normal(size=ROWS)) * 0.1 + rng.normal(size=ROWS))
    found: FloatArray = x - x[0]
    return found


def rms(x: FloatArray) -> float:
    return float(np.sqrt(np.mean(x**2)))


def by_rows(samples: Samples) -> splits.Judging:
    return splits.by_rows(samples, 0.75, 0.25)


_BY_FILE: dict[str, Make] = {
    **{f"{kind}_by_file_{n}": independent(kind, n, 2) for kind in ("walk", "white") for n in (3, 5, 10)},
    **{f"{kind}_continued_by_file_{n}": continued(kind, n) for kind in ("walk", "white") for n in (4, 8)},
}
_SPLIT: dict[str, Make] = {f"{kind}_split": independent(kind, 1, 6) for kind in ("walk", "white")}
KINDS: dict[str, Make] = {
    **_BY_FILE,
    **_SPLIT,
    "harmful_in_one_of_six": collinear(0.5, 6, harm=5.0),
    "true_collinear_six_half": collinear(0.5, 6),
    "true_collinear_four_fifth": collinear(0.2, 4),
}
JUDGED: dict[str, Callable[[Samples], splits.Judging]] = {
    **dict.fromkeys(_BY_FILE, splits.leave_one_file_out),
    **dict.fromkeys(_SPLIT, by_rows),
}
