"""Distance of inputs from the training data of a model, with scalars and loops only: see `thermocomp.core.joint`."""

from thermocomp.runtime.program.constants import Constants
from thermocomp.runtime.program.language import choose, each, floor, let, procedure, sqrt, when
from thermocomp.runtime.program.numbers import larger, smaller
from thermocomp.runtime.program.values import Whole, real
from thermocomp.runtime.program.variables import Kept, Work


@procedure
def find_distances(s: Kept, w: Work, t: Constants, k: Whole) -> None:
    """Compute `excess`, the largest of all single inputs, and `distance`, of all inputs together."""
    w.excess = 0.0
    for m in each("m", t.member_begin[k], t.member_begin[k + 1]):
        change = let("change", w.input[t.channel[t.member_range[m]]] - s.zero[t.member_range[m]])
        beyond = let("beyond", larger(real(0.0), larger(t.member_low[m] - change, change - t.member_high[m])))
        with when(beyond > 0.0):
            beyond.set(choose(beyond >= t.member_span[m], 1.0, beyond / t.member_span[m]))
        w.excess = larger(w.excess, beyond)
    w.distance = 0.0
    columns = let("columns", t.column_begin[k + 1] - t.column_begin[k])
    with when(columns > 0):
        find_nearest(s, w, t, k, columns)
    for j in each("j", t.speeds_begin[k], t.speeds_begin[k + 1]):
        change.set(w.input[t.channel[t.speed_range[j]]] - s.zero[t.speed_range[j]])
        least = let("least", abs(change - t.level[t.level_begin[j]]))
        for m in each("m", t.level_begin[j] + 1, t.level_begin[j + 1]):
            least.set(smaller(least, abs(change - t.level[m])))
        w.distance = larger(w.distance, least / t.tolerance[j])
    # identical on every processor
    w.distance = floor(smaller(w.distance, real(1000.0)) * 1000000.0 + 0.5) / 1000000.0


@procedure
def find_nearest(s: Kept, w: Work, t: Constants, k: Whole, columns: Whole) -> None:
    """Compute in `distance` the distance to the nearest training state; 1 is the limit."""
    nearest = let("nearest", real(0.0))
    for p in each("p", t.points[k]):
        square = let("square", real(0.0))
        for j in each("j", columns):
            r = let("r", t.column_range[t.column_begin[k] + j])
            scaled = let("scaled", (w.input[t.channel[r]] - s.zero[r]) * t.column_weight[t.column_begin[k] + j])
            apart = let("apart", scaled - t.point[t.point_begin[k] + p * columns + j])
            square.set(square + apart * apart)
        nearest.set(choose(p.equals(0), square, smaller(nearest, square)))
    w.distance = sqrt(nearest)
