"""Replay: judged predictions are computed by `ErrorModel.step` and the compensator, as in live operation."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.arrays import BoolArray, FloatArray
from thermocomp.core.correction import Limits
from thermocomp.core.model import ErrorModel
from thermocomp.core.zero import Zeroing, first_rows, mean_over_time
from thermocomp.judging.probing import Probed, Probings
from thermocomp.judging.watched import believe
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack
from thermocomp.recordings.starts import Start
from thermocomp.runtime import batch

#: converts readings (n_some, n_inputs) to batches of disturbed readings (n_some, n_variants, n_inputs); its other
#: arguments are the numbers of the rows (n_some,) and the reference of the test (n_inputs,)
Disturb = Callable[[NDArray[np.intp], FloatArray, FloatArray], FloatArray]
#: disturbed readings of this many rows are held at once
BLOCK = 64


@dataclass(frozen=True, eq=False)
class Replayed:
    """Outputs of the models in the judged rows, as they would have run.

    Parameters
    ----------
    deviation : ndarray of shape (n_wanted,)
        Output of the model alone, without limits and without a gate except for missing values [its unit].
    compensated : ndarray of shape (n_wanted,)
        Minus the correction that the compensator had in force: gate, model, limits [its unit].
    outside : ndarray of bool of shape (n_wanted,)
        An input was outside the trained range.
    rejected : ndarray of bool of shape (n_wanted,)
        The gate rejected the reading although it was complete.
    why : str
        Description of the first rejected reading; empty if there was none.
    limits : Limits or None
        None: not applied, because the model does not predict micrometres.
    half_width : ndarray of shape (n_wanted,)
        Half-width of the band about `deviation` [its unit]; nan where there is none.
    probed : Probed or None
        Effect of probings; None: without probings.
    """

    deviation: FloatArray
    compensated: FloatArray
    outside: BoolArray
    rejected: BoolArray
    why: str
    limits: Limits | None
    half_width: FloatArray
    probed: Probed | None = None


def replay_compensated(
    model: ErrorModel,
    samples: Samples,
    rows: BoolArray,
    limits: Limits = Limits(),
    probings: Probings | None = None,
    widening: FloatArray | None = None,
) -> Replayed:
    """Replay a model and a compensator with it over the tests that contain `rows`, from the start of each test.

    A live compensator receives readings at least every `Limits.reading_age`, however slowly a test was recorded: rows
    further apart count as several readings in time, so the rate limit applies to the whole time between them.

    Parameters
    ----------
    rows : ndarray of bool of shape (n_rows,)
        Judged rows.
    limits : Limits
        Limits of the corrections [um]; a model in another unit runs with the gate but without limits.
    widening : ndarray of shape (n_rows,), optional
        Band widening that belongs to samples already passed by a watch: see `thermocomp.judging.watched.believe`.
        Default: the samples are first passed through the model's own watch.
    """
    columns, within = _columns(model, samples), limits if model.unit == "um" else None
    if widening is None:
        samples, widening = believe(model, samples, rows)
    n, why = len(samples), ""
    deviation, compensated, half_width = np.zeros(n), np.zeros(n), np.full(n, np.nan)
    outside, rejected = np.zeros(n, dtype=np.bool_), np.zeros(n, dtype=np.bool_)
    deviations = samples.deviations[:, [c.name for c in samples.targets].index(model.target)] if probings else None
    at, shift, without, refused = np.zeros(n, dtype=np.bool_), np.zeros(n), np.zeros(n), list[str]()
    for test in np.unique(samples.test[rows]):
        mine = rows_until(samples, rows, test, model.zeroing, columns)
        time, anew = samples.time[mine], samples.anew(test)
        step = float(np.median(np.diff(time))) if len(mine) > 1 else 0.0
        probed = None
        if probings is not None and deviations is not None:
            made = probings.find_rows(time, rows[mine] & np.isfinite(deviations[mine]))
            probed, at[mine[made]] = np.full(len(mine), np.nan), True
            probed[made] = deviations[mine[made]]
        found = batch.run(
            model,
            within and replace(within, reading_age=max(within.reading_age, step)),
            time,
            samples.values[mine][:, columns],
            reference=samples.given_zero(test, columns),
            resting=samples.stands[mine],
            anew=None if anew is None else int(np.flatnonzero(mine == anew)[0]),
            undriven=np.isinf(widening[mine]),
            probed=probed,
            repeatability=probings.repeatability if probings else 0.0,
        )
        shift[mine], without[mine] = found.shift, found.without
        refused += [f"{samples.test_names[test]}: {why}" for why in found.refused]
        deviation[mine], compensated[mine] = found.deviation, found.compensated
        outside[mine], rejected[mine] = found.outside, found.rejected
        # the error was never judged where the model must not run: no band
        half_width[mine] = found.half_width * np.where(np.isinf(widening[mine]), np.nan, widening[mine])
        if found.why and not why:
            why = f"{samples.test_names[test]}: {found.why}"
    seen = (
        Probed(plan=probings, at=at[rows], shift=shift[rows], without=without[rows], refused=tuple(refused))
        if probings
        else None
    )
    return Replayed(
        deviation=deviation[rows],
        compensated=compensated[rows],
        outside=outside[rows],
        rejected=rejected[rows],
        why=why,
        limits=within,
        half_width=half_width[rows],
        probed=seen,
    )


def replay(model: ErrorModel, samples: Samples, rows: BoolArray) -> tuple[FloatArray, BoolArray]:
    """Replay a model over the tests that contain `rows`, from the start of each test.

    Parameters
    ----------
    rows : ndarray of bool of shape (n_rows,)
        Rows whose prediction is requested.

    Returns
    -------
    deviation : ndarray of shape (n_wanted,)
        Predicted deviation at the requested rows.
    outside : ndarray of bool of shape (n_wanted,)
        An input was outside the trained range.
    """
    walked = list(walk(model, samples, rows))
    none = np.empty((0, len(model.inputs)), dtype=np.bool_)
    beyond = np.concatenate([none, *(w.outside for w in walked)])
    return np.concatenate([np.empty(0), *(w.deviation for w in walked)]), np.asarray(beyond.any(axis=1))


class Walked(NamedTuple):
    """Outputs of a model in some of the requested rows."""

    rows: NDArray[np.intp]  #: (n_some,)
    deviation: FloatArray  #: (n_some,) or (n_some, n_variants); (n_some, 1) before the first reading [unit]
    outside: BoolArray  #: (n_some, n_inputs) or (n_some, n_variants, n_inputs)


def walk(model: ErrorModel, samples: Samples, rows: BoolArray, disturb: Disturb | None = None) -> Iterator[Walked]:
    """Run a model through the tests that contain `rows`; yield its outputs at the requested rows, in their order.

    The model runs continuously from the start of a test, or of the files that it continues from, as at the machine; its
    only inputs are those of `samples`, never a displacement. A row with a missing input is rejected by the gate, as
    live: the last deviation is held. In a re-zeroed test, the output at the new zero is subtracted.

    Parameters
    ----------
    rows : ndarray of bool of shape (n_rows,)
        Requested rows.
    """
    columns = _columns(model, samples)
    usable = np.asarray(np.isfinite(samples.values[:, columns]).all(axis=1))
    for test in np.unique(samples.test[rows]):
        mine = rows_until(samples, rows, test, model.zeroing, columns)
        own = mine[mine >= anew] if (anew := samples.anew(test)) is not None else mine[:0]
        window = _window(model, samples, own[usable[own]])
        wanted = rows.copy()
        wanted[window] = True
        waiting, there = list[Walked](), list[FloatArray]()
        shift: FloatArray | float | None = None if window.size else 0.0
        for some in _walk_test(model, samples, mine, wanted, usable, disturb):
            waiting.append(some)
            if shift is None:
                there += list(some.deviation[np.isin(some.rows, window)])
                shift = mean_over_time(samples.time[window], there) if some.rows[-1] >= window[-1] else None
            if shift is not None:
                for done in waiting:
                    asked = rows[done.rows]
                    yield Walked(done.rows[asked], done.deviation[asked] - shift, done.outside[asked])
                waiting.clear()


def _walk_test(
    model: ErrorModel,
    samples: Samples,
    mine: NDArray[np.intp],
    wanted: BoolArray,
    usable: BoolArray,
    disturb: Disturb | None,
) -> Iterator[Walked]:
    """Yield the outputs of a model at the wanted rows of a test, block by block."""
    columns, test = _columns(model, samples), samples.test[mine[0]]
    reference = samples.reference()[test, columns]

    def read(at: NDArray[np.intp]) -> FloatArray:
        values = samples.values[at][:, columns]
        return values if disturb is None else disturb(at, values, reference)

    state = model.init(samples.given_zero(test, columns))
    head, mean = mine[:0], np.zeros(len(columns))
    if np.isnan(state.reference).any():
        head = _window(model, samples, mine[usable[mine]])
    if head.size:
        mean = mean_over_time(samples.time[head], read(head))
        state = state._replace(reference=np.where(np.isnan(state.reference), mean, state.reference))
    stepped = mine[_needed(model, usable[mine], wanted[mine])]
    asked = mine[wanted[mine]]
    before = np.searchsorted(stepped, asked, side="right")  # readings up to each wanted row
    steps = np.diff(samples.time[stepped], prepend=samples.time[mine[0]])
    blank = asked[before == 0]  # held since the start
    if blank.size:
        shape = blank.shape if disturb is None else (len(blank), 1)
        yield Walked(blank, np.zeros(shape), np.zeros((*shape, len(columns)), dtype=np.bool_))
    size = len(stepped) if disturb is None else BLOCK
    for k in range(0, len(stepped), max(size, 1)):
        at = stepped[k : k + size]
        later = read(at[~np.isin(at, head)])
        values = np.concatenate([np.broadcast_to(mean, (len(at) - len(later), *later.shape[1:])), later])
        ran = model.run(state, values, steps[k : k + size])
        state, there = ran.state, (before > k) & (before <= k + size)
        if there.any():
            yield Walked(asked[there], ran.deviation[before[there] - 1 - k], ran.outside[before[there] - 1 - k])


def are_absolute(models: Sequence[ErrorModel]) -> bool:
    """Return whether models use absolute temperatures, so that the zero of a recording does not affect them."""
    heat = [i for m in models for i in m.inputs if i.quantity == "temperature"]
    return bool(heat) and not any(i.rezero for i in heat)


def stack_for(model: ErrorModel, recordings: Sequence[Recording], starts: Start | Sequence[Start] | None) -> Samples:
    """Return the samples of a model: its inputs and its target, stacked as in its training."""
    return stack(
        recordings,
        [model.target],
        [i.name for i in model.inputs],
        rezero=any(i.rezero for i in model.inputs),
        zeroing=model.zeroing,
        starts=starts,
    )


def _window(model: ErrorModel, samples: Samples, readings: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the first readings of a test, which are averaged for its zero."""
    return readings[: first_rows(model.zeroing, samples.time[readings], samples.stands[readings])[0]]


def _columns(model: ErrorModel, samples: Samples) -> list[int]:
    names = [c.name for c in samples.inputs]
    return [names.index(i.name) for i in model.inputs]


def rows_until(
    samples: Samples, rows: BoolArray, test: int, zeroing: Zeroing, columns: Sequence[int]
) -> NDArray[np.intp]:
    """Return the rows of a test up to the last requested one, at least up to the one where its zero is known."""
    mine = np.flatnonzero(samples.test == test)
    stop = int(np.flatnonzero(rows[mine]).max()) + 1
    usable = np.flatnonzero(np.isfinite(samples.values[mine][:, columns]).all(axis=1))
    begins = [usable, usable[mine[usable] >= anew]] if (anew := samples.anew(test)) is not None else [usable]
    for own in begins:
        _, known = first_rows(zeroing, samples.time[mine[own]], samples.stands[mine[own]])
        stop = max(stop, int(own[min(known, len(own) - 1)]) + 1) if len(own) else stop
    return mine[:stop]


def _needed(model: ErrorModel, usable: BoolArray, wanted: BoolArray) -> BoolArray:
    """Return the rows of a test that must be stepped through to know the requested ones."""
    if model.remembers or model.support.policy == "hold" or not usable.any():
        return usable
    # A model without memory needs the requested readings; where one is unusable, the reading before.
    needed = usable & wanted
    before = np.maximum.accumulate(np.where(usable, np.arange(len(usable)), 0))
    needed[before[wanted]] = True
    return needed & usable
