"""Best subsets by adding columns, compiled: all sets up to a size, the last two columns entering in closed form.

Each column that enters is swept out of the cross products. This loses digits for nearly dependent columns, so the
method only screens: candidates that may be good enough, or cannot be assessed reliably, are computed by QR.
"""

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.models.kernels.subsets import ByteArray, IntArray, Lists, compiled, exact, householder, offer

State = tuple[FloatArray, FloatArray, FloatArray, FloatArray, IntArray, IntArray]

#: smallest share of a column's square that may remain after the sweeps; below it, QR decides
LEFT = 1e-8
#: relative error allowed for in screening
SCREEN = 1e-6
#: rounding error of a product of two columns of norm 1
DIGITS = 1e-14


@compiled
def try_exactly(
    columns: FloatArray, least: FloatArray, lists: Lists, inside: ByteArray, chosen: IntArray, n: int
) -> None:
    """Add the set of the first `n` columns of `chosen` to the list of good sets if its QR value is good enough."""
    value = exact(columns, least, chosen, n)
    if value < lists[3][n]:
        inside[:] = 0
        for i in range(n):
            inside[chosen[i]] = 1
        offer(lists, n, value, inside, -1, -1)


@compiled
def left_by(
    columns: FloatArray, least: FloatArray, chosen: IntArray, n: int, G: FloatArray, D: FloatArray, h: FloatArray
) -> None:
    """Recompute the products of all columns after projecting out the first `n` of `chosen`, scaled to norm 1.

    A column without a remainder gets products that prevent its selection.
    """
    p = columns.shape[0] - 1
    some = np.empty((n + p + 1, columns.shape[1]))
    for i in range(n):
        some[i] = columns[chosen[i]]
    some[n:] = columns
    householder(some, n)
    rest = some[n:, n:].copy()
    for i in range(p):
        norm = np.sqrt(np.sum(rest[i] * rest[i]))
        rest[i] *= 1 / norm if norm > least[i] else 0.0
    D[:] = 1.0
    for i in range(p):
        h[i] = np.sum(rest[i] * rest[p])
        for k in range(i + 1, p):
            G[i, k] = np.sum(rest[i] * rest[k])


@compiled
def add(  # noqa: PLR0912, PLR0915 - a single function is four times as fast
    columns: FloatArray, least: FloatArray, state: State, lists: Lists, inside: ByteArray, size: int, budget: int
) -> int:
    """Continue the enumeration of all sets up to `size` until it is complete or `budget` sets were examined.

    Level d has d columns in the set; ``numbers[1, d]`` is the next column to enter and ``numbers[2, d]`` the last; the
    enumeration is complete when level 0 has no more columns. ``sums[:, d]``: residual sum of squares; its value when
    the products were last computed; error of the first value. Return the number of sets.
    """
    G, D, h, sums, chosen, numbers = state
    limit = lists[3]
    p = columns.shape[0] - 1
    d = numbers[0, 0]
    v = np.empty(p)
    looked = 0
    while looked < budget:
        c = numbers[1, d]
        if c > numbers[2, d]:
            if d == 0:
                break
            d -= 1
            continue
        numbers[1, d] = c + 1
        chosen[d] = c
        n = d + 1
        looked += 1
        here, y, diagonal = D[d, c], h[d, c], D[d]
        before, fresh, error = sums[:, d]
        doubt = error + SCREEN * before + 1e-10 * np.sqrt(before * fresh)
        gain = y * y / here
        value = before - gain
        error += DIGITS * (gain / here + 2 * np.sqrt(gain * fresh / here))
        bare = not (here > LEFT and value > 1e3 * error)
        if bare:  # too few digits, or the column depends on those in the set
            value = exact(columns, least, chosen, n)
            if value == np.inf:
                continue
            fresh, error = value, 0.0
        if bare or value < limit[n] + doubt:
            try_exactly(columns, least, lists, inside, chosen, n)
        if n < size - 1:  # sweep the column out of the others
            if bare:
                left_by(columns, least, chosen, n, G[n], D[n], h[n])
            else:
                g = 1 / np.sqrt(here)
                for i in range(c + 1, p):
                    v[i] = G[d, c, i] * g
                for i in range(c + 1, p):
                    a, old, new = v[i], G[d, i], G[n, i]
                    for k in range(i + 1, p):
                        new[k] = old[k] - a * v[k]
                    D[n, i] = diagonal[i] - a * a
                    h[n, i] = h[d, i] - a * y * g
            sums[0, n], sums[1, n], sums[2, n] = value, fresh, error
            numbers[1, n], numbers[2, n] = c + 1, p - 1
            d = n
        elif n == size - 1:  # all columns that may enter together with this one
            looked += p - c - 1
            row, others = G[d, c], h[d]
            least_gain = before - limit[size] - doubt
            hits = 0
            for k in range(c + 1, p):
                g = row[k]
                det = here * diagonal[k] - g * g
                both = y * y * diagonal[k] - 2 * y * others[k] * g + others[k] * others[k] * here
                hits += (both > least_gain * det) | (det <= LEFT * (abs(here) + abs(diagonal[k])))
            if hits == 0:
                continue
            for k in range(c + 1, p):
                g = row[k]
                det = here * diagonal[k] - g * g
                both = y * y * diagonal[k] - 2 * y * others[k] * g + others[k] * others[k] * here
                if both > (before - limit[size] - doubt) * det or det <= LEFT * (abs(here) + abs(diagonal[k])):
                    chosen[n] = k
                    try_exactly(columns, least, lists, inside, chosen, size)
    numbers[0, 0] = d
    return looked
