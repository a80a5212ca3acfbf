"""Test vectors: readings, including faulty ones, and the compensator's response to each."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import fields, is_dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.autoregressive import Autoregressive, find_largest_root
from thermocomp.core.band import Band
from thermocomp.core.bounds import GAP
from thermocomp.core.expression import Recurrence
from thermocomp.core.model import ErrorModel
from thermocomp.core.provenance import HonestError, Provenance
from thermocomp.core.reading import Reading
from thermocomp.core.validity import Validity
from thermocomp.core.zero import Zeroing
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.powerup import machine_seems_warm, power_up, rezero_measured, take_at_once
from thermocomp.runtime.program.tables import Tables
from thermocomp.runtime.program.variables import Kept
from thermocomp.runtime.state import NO_ZERO, CompensatorState
from thermocomp.runtime.watchstate import WORDS

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

#: values of `thermocomp.runtime.state.Status`, in the order of the block's status numbers
STATUS = ("restarting", "active", "holding", "fading", "shadow", NO_ZERO)
#: what happens before a call: a power-up with the state retained at the call before, the same with a damaged one, an
#: order that the machine is cold, an order to re-zero a target (the first one, the second one, ...)
NOTHING, RETAINED, DAMAGED, TOLD_COLD, REZERO = range(5)


class Readings(NamedTuple):
    """Readings of the test vectors, with their age and time steps."""

    values: FloatArray  #: (n_calls, n_channels), in the order of `Tables.channels`
    age: FloatArray  #: (n_calls,), age of the values [s]
    dt: FloatArray  #: (n_calls,), time since the previous call [s]
    counter: FloatArray | None = None  #: (n_calls,), number of the reading; None: readings are not numbered
    event: IntArray | None = None  #: (n_calls,), from `NOTHING` to `REZERO`; None: told cold before the first call
    amount: FloatArray | None = None  #: (n_calls,), time without power [s], or measured deviation [um]

    @property
    def columns(self) -> FloatArray:
        """Return values, age, time step, number of the reading, event and its amount, (n_calls, n_channels + 5)."""
        none = np.zeros(len(self.age))
        counter, amount = (none if a is None else a for a in (self.counter, self.amount))
        event = np.where(np.arange(len(none)) == 0, TOLD_COLD, NOTHING) if self.event is None else self.event
        return np.column_stack([self.values, self.age, self.dt, counter, event, amount])

    def shifted(self, way: int, kind: type[np.floating[Any]] = np.float64) -> "Readings":
        """Return readings shifted by their last digits in a precision: odd up, even down, equal readings alike.

        By two units, the largest error of the difference of two readings. Whole numbers stay: they may be at a limit.
        """
        values = self.values
        with np.errstate(invalid="ignore"):
            moves = np.isfinite(values) & (values != np.rint(values))
            last = np.where(moves, np.spacing(values.astype(kind)).astype(np.float64), 0.0)
            odd = np.where(last != 0.0, values / np.where(last == 0.0, 1.0, last), 0.0) % 2.0 >= 1.0
        return self._replace(values=values + way * 2.0 * np.where(odd, last, -last))


class Answers(NamedTuple):
    """Outputs of a compensator for the readings of the test vectors."""

    correction: FloatArray  #: (n_calls, n_targets), at the reference position [um]
    slope: FloatArray  #: (n_calls, n_targets) [um/m]
    status: IntArray  #: (n_calls, n_targets), index into `STATUS`
    deviation: FloatArray  #: (n_calls, n_models)
    fault: IntArray  #: (n_calls, n_sensors), index into `thermocomp.runtime.watchstate.WORDS`
    passed: NDArray[np.bool_]  #: (n_calls,), whether the reading was used
    warm: NDArray[np.bool_]  #: (n_calls,), whether the machine seemed warm at its start
    why: IntArray = np.zeros(0, dtype=int)  #: (n_calls,), why the reading was not used: the block's ``rejected``
    outside: IntArray = np.zeros(0, dtype=int)  #: (n_calls,), number of inputs beyond the trained range
    inner: FloatArray = np.zeros(0)  #: (n_calls,), check value of the state of the monitoring, see `INNER`

    def certain(self, shifted: Iterable["Answers"]) -> "Answers":
        """Return these answers without the check values that the last digit of a reading changes: nan."""
        inner, limit = self.inner.copy(), 1e-10 * (1.0 + np.abs(self.inner))  # a tenth of what the tests allow
        for other in shifted:
            inner[np.abs(other.inner - self.inner) > limit] = np.nan
        return self._replace(inner=inner)


def replay(
    compensator: Compensator,
    tables: Tables,
    readings: Readings,
    *,
    rounded: Callable[[FloatArray], FloatArray] | None = None,
) -> Answers:
    """Replay readings through a compensator from its power-up without a state, and return its outputs."""
    names, targets = [c.name for c in tables.channels], tables.targets
    state, clock, begun, rows = power_up(compensator, None, math.nan), 0.0, False, []
    warm, waiting, resumed, outside = False, dict[str, float](), set[str](), 0
    for *values, age, dt, counter, event, amount in readings.columns.tolist():
        if REZERO <= event < REZERO + len(targets) and abs(amount) <= 1e30:
            waiting[targets[int(event) - REZERO]] = amount
        elif NOTHING < event < REZERO:
            state = _begin(compensator, state, int(event), amount)
            clock, begun = state.clock or 0.0, state.clock is not None
            waiting, warm, outside = (waiting, warm, outside) if begun else ({}, False, 0)
            resumed = set(targets) if begun and amount > compensator.limits.hold else resumed if begun else set()
        good = 0.0 <= dt <= GAP
        clock, begun = clock + dt if good and begun else clock, begun or good
        tick = clock if good else math.nan  # an invalid clock advances nothing
        reading = Reading(tick - age, dict(zip(names, values, strict=True)), counter=counter)
        starting = any(np.isnan(m.reference).any() for m in state.models)
        before = state
        state, said = compensator.step(state, reading, tick)
        state, said = take_at_once(compensator, before, state, said, resumed)
        waits = {t for t, idle in state.idle.items() if idle <= compensator.limits.reading_age}
        resumed = {t for t in resumed & waits if said.states[t].word == "holding"}
        if not said.rejected:
            outside = count_outside(tables, state)
            warm = machine_seems_warm(compensator, state) if starting else warm
        for target in [t for t in waiting if t in state.raw]:
            state = rezero_measured(compensator, state, target, clock, waiting.pop(target))
        if rounded is not None:
            corrections = {t: round_all(c, rounded) for t, c in state.corrections.items()}
            state = state._replace(models=round_all(state.models, rounded), corrections=corrections)
        rows.append(
            (
                [said.corrections[t].offset for t in targets],
                [said.corrections[t].slope for t in targets],
                [STATUS.index(said.states[t].word) for t in targets],
                [float(s.deviation) for s in state.models],
                [WORDS.index(said.failed.get(s, WORDS[0])) for s in tables.sensors],
                not said.rejected,
                warm,
                reason_code(said.rejected),
                outside,
                _check_inner(state),
            )
        )

    def table(k: int) -> FloatArray:
        return np.array([r[k] for r in rows], dtype=np.float64).reshape(len(rows), -1)

    passed, seemed = (np.array([r[k] for r in rows], dtype=np.bool_) for k in (5, 6))
    return Answers(
        correction=table(0),
        slope=table(1),
        status=table(2).astype(int),
        deviation=table(3),
        fault=table(4).astype(int),
        passed=passed,
        warm=seemed,
        why=table(7)[:, 0].astype(int),
        outside=table(8)[:, 0].astype(int),
        inner=table(9)[:, 0],
    )


def reason_code(why: str) -> int:
    """Return the block's number of a reason: 1 its time, 2 a value, 3 not a valid start, 4 the source has stopped."""
    if not why:
        return 0
    if why.endswith("the source has stopped"):
        return 4
    if "plausible as a start" in why:
        return 3
    return 2 if why.endswith((" is missing", " is not plausible")) else 1


def count_outside(tables: Tables, state: CompensatorState) -> int:
    """Return the number of inputs beyond the range of a model."""
    pairs = zip(tables.models, state.models, strict=True)
    return len({i for m, own in pairs for i, out in zip(m.inputs, own.outside.tolist(), strict=True) if out})


#: variables of the monitoring, part of a check value of the state: `add_up`
INNER = (
    *("memory", "traces", "used", "predicted", "usual", "step", "has_jumped", "is_off", "is_moving", "is_back"),
    *("cleared", "evidence", "heat", "stored", "estimate", "estimated", "is_wrong", "is_doubtful", "does_agree"),
)


def find_inner(tables: Tables) -> dict[str, int]:
    """Return the variables of `INNER` that a compensator has, and their sizes."""
    sizes = {n: math.prod(tables.sizes.get(d, 0) for d in Kept.variables()[n].dims) for n in INNER}
    unused = () if tables.sizes["supervised"] else ("estimated", "does_agree")
    return {n: size for n, size in sizes.items() if size and n not in unused}


def _check_inner(state: CompensatorState) -> float:
    """Return the check value of the state of the monitoring; evidence counts for pairs that are not cleared."""
    if not state.watches or math.isnan(state.watches[0].time):
        return 0.0
    (s,) = state.watches
    cleared, began = (
        np.isneginf(s.evidence),
        [s.jumped, s.off, s.moving, s.back, s.heat.since, s.heat.doubt, s.heat.back],
    )
    jumped, off, moving, back, wrong, doubtful, agree = (~np.isnan(a) for a in began)
    heat = (s.heat.heat, s.heat.stored, s.heat.estimate, s.heat.states)
    kept = (s.memory, s.traces, s.used, s.predicted, s.usual, s.step, jumped, off, moving, back, cleared)
    return add_up([*kept, np.where(cleared, 0.0, s.evidence), *heat, wrong, doubtful, agree])


def add_up(numbers: Iterable[Any]) -> float:
    """Return a check value of lists of numbers: the sum of the index from 1, times the logarithm of the size."""
    lists = [np.ravel(np.asarray(values, dtype=np.float64)) for values in numbers]
    x, index = (np.concatenate(a) if a else np.zeros(0) for a in (lists, [np.arange(1.0, len(v) + 1.0) for v in lists]))
    return float(np.sum(index * np.sign(x) * np.log1p(1e4 * np.minimum(np.abs(x), 1e13))))


def _begin(compensator: Compensator, state: CompensatorState, event: int, amount: float) -> CompensatorState:
    """Return the state after a power-up, or after an order that the machine is cold: corrections are kept then."""
    if event == TOLD_COLD:
        return compensator.start()._replace(corrections=state.corrections)
    return power_up(compensator, state if event == RETAINED else None, amount)


#: parts of a model that are not exported: the judging results decide what is permitted and must not be rounded
_UNWRITTEN = (Band, HonestError, Provenance, Validity, Zeroing)


def round_all(value: Any, rounded: Callable[[FloatArray], FloatArray]) -> Any:
    """Return a value with all numbers of the exported code rounded, except integers; arrays as a whole."""
    if isinstance(value, float):
        return float(rounded(np.array(value)))
    if isinstance(value, np.ndarray) and value.dtype == np.float64:
        return rounded(value)
    if type(value) is tuple and value and all(isinstance(v, float) for v in value):
        return tuple(rounded(np.array(value)).tolist())
    if isinstance(value, tuple):
        parts = [round_all(v, rounded) for v in value]
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
    if is_dataclass(value) and not isinstance(value, (type, *_UNWRITTEN)):
        return replace(value, **{f.name: round_all(getattr(value, f.name), rounded) for f in fields(value)})
    return value


def find_tolerance(models: Sequence[ErrorModel]) -> float:
    """Return the tolerance for exported code in double precision: feedback amplifies rounding errors.

    Returns
    -------
    float
        As a fraction of the correction, or in um for corrections below 1 um.
    """
    # effect of rounding in the last digit on a decaying sum, and on many ticks at once
    slow = [(1.0 - sum(m.a)) * (1.0 - find_largest_root(m.a)) for m in models if isinstance(m, Autoregressive)]
    most = 10.0 * float(np.finfo(np.float64).eps) / min(slow, default=1.0)
    clocks = any(isinstance(n, Recurrence) for m in models for n in m.remembered)
    return max(most, 1e-11 if clocks else 1e-12)
