"""Distance of inputs from the training data of a model, as scalars and loops: see `thermocomp.core.joint`."""

import math

from thermocomp.export.block.names import Names
from thermocomp.export.block.numbers import larger, smaller


def find_distances(s: Names, w: Names, t: Names, k: int) -> None:
    """Compute `excess`, the largest of all single inputs, and `distance`, of all inputs together.

    Parameters
    ----------
    s, w, t : Names
        State kept between calls, work variables, and constants.
    k : int
        Index of the support.
    """
    w.excess = 0.0
    for m in range(t.member_begin[k], t.member_begin[k + 1]):
        change = w.input[t.channel[t.member_range[m]]] - s.zero[t.member_range[m]]
        beyond = larger(0.0, larger(t.member_low[m] - change, change - t.member_high[m]))
        if beyond > 0.0:
            beyond = 1.0 if beyond >= t.member_span[m] else beyond / t.member_span[m]
        w.excess = larger(w.excess, beyond)
    w.distance = 0.0
    columns = t.column_begin[k + 1] - t.column_begin[k]
    if columns > 0:
        find_nearest(s, w, t, k, columns)
    for j in range(t.speeds_begin[k], t.speeds_begin[k + 1]):
        change = w.input[t.channel[t.speed_range[j]]] - s.zero[t.speed_range[j]]
        least = abs(change - t.level[t.level_begin[j]])
        for m in range(t.level_begin[j] + 1, t.level_begin[j + 1]):
            least = smaller(least, abs(change - t.level[m]))
        w.distance = larger(w.distance, least / t.tolerance[j])
    # identical on every processor
    w.distance = math.floor(smaller(w.distance, 1000.0) * 1000000.0 + 0.5) / 1000000.0


def find_nearest(s: Names, w: Names, t: Names, k: int, columns: int) -> None:
    """Compute in `distance` the distance to the nearest training state; 1 is the limit.

    Parameters
    ----------
    s, w, t : Names
        State kept between calls, work variables, and constants.
    k : int
        Index of the support.
    columns : int
        Number of inputs used.
    """
    nearest = 0.0
    for p in range(t.points[k]):
        square = 0.0
        for j in range(columns):
            r = t.column_range[t.column_begin[k] + j]
            scaled = (w.input[t.channel[r]] - s.zero[r]) * t.column_weight[t.column_begin[k] + j]
            apart = scaled - t.point[t.point_begin[k] + p * columns + j]
            square = square + apart * apart
        nearest = square if p == 0 else smaller(nearest, square)
    w.distance = math.sqrt(nearest)
