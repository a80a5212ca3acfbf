"""Temperatures that share the noise of a displacement, which no heat transmits: computed from it, or on its wire."""

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.stats import rankdata

from thermocomp.core.arrays import BoolArray, FloatArray
from thermocomp.core.messages import Message
from thermocomp.recordings.checks.findings import Finding, Signal, column

#: numbers of rows averaged before they are compared: the noise of a computed temperature may be on other scales
BLOCKS = (1, 2, 4)
#: smallest rank correlation of third differences, and its smallest product with the root of their number
LEAST, CERTAIN = 0.25, 9.0
#: largest correlation of a difference with the next one: -0.75 for white noise, above 0 for a smooth curve
NOISE = -0.2
#: numbers of rows after which the correlation of noise has ended, and smallest share of it that is left in a process
LATER, LASTING = range(12, 42), 0.5
#: largest difference of the correlations one row earlier and later, relative to that of the same row: neither lags
LAGS = 0.35
#: numbers of rows by which a computed temperature may be late, and its smallest correlation then
LATE, FOLLOWS = range(13), 0.5
#: correlations of third differences of an instrument's noise: largest with the next, and with those after four rows
WHITE, MOST = -0.58, 0.15
#: minimum number of differences
_ENOUGH = 30


def leaks(temperatures: Sequence[Signal], displacements: Sequence[Signal], moved: BoolArray) -> Iterator[Finding]:
    """Yield findings on temperatures whose third differences follow those of a displacement.

    Third differences of recorded rows contain the noise of the instruments, and hardly any heat; those within three
    rows of a change of the spindle speed are left out. Their rank correlation, times the root of their number, is at
    most 7.6 (243,000 pairs of a temperature and a displacement of virtual machines; 6.1 of real ones), and 10 to 90 if
    the temperature is computed from the displacement, also if it is rounded, noisy or mixed with another. Curves
    without noise are not examined. If a displacement has the noise of two temperatures that do not have that of each
    other, it was computed from them, as in a simulation. Noise that more than half of the temperatures share with a
    displacement is interference, which is only a warning.

    Parameters
    ----------
    moved : ndarray of bool of shape (n_rows - 1,)
        Row-to-row steps with a change of spindle speed.
    """
    still = np.ones(len(moved) + 1, dtype=np.bool_)
    for row in np.flatnonzero(moved).tolist():
        still[max(row - 2, 0) : row + 4] = False
    found: dict[str, tuple[float, str]] = {}
    for block in BLOCKS:
        heat = {s.channel.name: x for s in temperatures if (x := _noise(s, still, block)) is not None}
        for probe in displacements if heat else ():
            if (y := _noise(probe, still, block)) is None:
                continue
            certain = {name: c for name, x in heat.items() if (c := _certainty(x, y)) >= CERTAIN}
            for name, c in certain.items():
                own = all(_certainty(heat[name], heat[other]) >= CERTAIN for other in certain if other != name)
                if own and c > found.get(name, (0.0, ""))[0]:
                    found[name] = c, probe.channel.name
    if len(found) > max(1, len(temperatures) // 2):
        text = Message(
            "{names} have the noise of the displacements: interference on all wires; check shields and earth",
            names=", ".join(found),
        )
        yield Finding("warning", "", "interference", text)
        return
    for name, (_, probe_name) in found.items():
        text = Message(
            "has the noise of {probe}, in the same rows or some rows late: it seems to be computed from the "
            "displacement, or to share its wiring. A model that uses it predicts the displacement from itself; leave "
            "it out. If something switches every few rows, as a chiller may, record more often",
            probe=probe_name,
        )
        yield Finding("trouble", name, "leak", text, remedy=column(name, role="ignore"))


def _noise(signal: Signal, still: BoolArray, block: int) -> FloatArray | None:
    """Return the centred ranks of the third differences of a signal, 0 where there is none; None if it is smooth."""
    n = len(still) // block
    good: BoolArray = np.asarray((signal.good & still)[: n * block].reshape(n, block).all(axis=1))
    x = np.where(signal.good, signal.values, 0.0)[: n * block].reshape(n, block).mean(axis=1)
    difference = x[3:] - 3 * x[2:-1] + 3 * x[1:-2] - x[:-3] if n > 3 else np.empty(0)
    there = good[3:] & good[2:-1] & good[1:-2] & good[:-3] if n > 3 else np.empty(0, dtype=np.bool_)
    own = difference[there]
    if len(own) < _ENOUGH or not own.any():
        return None
    if own[1:] @ own[:-1] > NOISE * (own @ own):
        return None
    ranks = np.zeros(len(difference))
    ranks[there] = rankdata(own) - (len(own) + 1) / 2
    return ranks


def _certainty(x: FloatArray, y: FloatArray) -> float:
    """Return the correlation of ranks times the root of their number; 0 if it is small, lags, or goes on for many rows.

    What is computed follows at once, and its noise ends after a few rows; a process such as a chiller that is switched
    on and off reaches two places with different lags, and goes on. Noise of an instrument may be followed late: by what
    was delayed, averaged, or filtered.
    """
    both = np.flatnonzero(x * y)
    size, common = float(np.sqrt((x[both] @ x[both]) * (y[both] @ y[both]))), abs(float(x @ y))
    count = float(np.sqrt(both.size))
    if not size:
        return 0.0
    late = max(abs(float(x[k:] @ y[: len(y) - k])) for k in LATE if k < len(x))
    if late >= FOLLOWS * size and _is_white(y):
        return late / size * count
    if common < LEAST * size:
        return 0.0
    later = [abs(float(a[k:] @ b[:-k])) for k in LATER if k < len(x) for a, b in ((x, y), (y, x))]
    lags = abs(float(x[1:] @ y[:-1]) - float(y[1:] @ x[:-1]))
    if lags > LAGS * common or max(later, default=0.0) > LASTING * common:
        return 0.0
    return common / size * count


def _is_white(y: FloatArray) -> bool:
    """Return whether third differences are those of an instrument's noise, which no process has.

    Those of white noise have correlations of -0.75, 0.3 and -0.05 with the next three, and none with those after.
    """
    own = [float(y[k:] @ y[:-k]) for k in (1, *range(4, 13)) if k < len(y)]
    return own[0] <= WHITE * float(y @ y) and max(map(abs, own[1:]), default=0.0) <= MOST * float(y @ y)
