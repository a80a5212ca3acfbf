"""Stacking of recordings into samples, with the zero of each recording."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from thermocomp.core.arrays import BoolArray, FloatArray, IntArray
from thermocomp.core.exceptions import InputError, RecordingError
from thermocomp.core.machine import Channel
from thermocomp.core.zero import Zeroing
from thermocomp.recordings.compensated import refuse_compensated
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.starts import Start, bridge_files, find_resting_rows, find_starts, level

#: quantities that cannot be inputs, and the reason
NO_INPUTS = {
    "displacement": "a machine in production has no displacement probe",
    "angle": "a machine in production has no probe for angles",
    "position": "use thermocomp position for errors that depend on it",
    "residual": "a machine in production has no displacement probe",
    "correction": "it is the output of a model, not an input",
}
#: upper bound of any temperature, speed or displacement of a machine, in any unit
ABSURD = 1e9


def stack(
    recordings: Sequence[Recording],
    targets: Sequence[str],
    inputs: Sequence[str] | None = None,
    *,
    rezero: bool = True,
    zeroing: Zeroing | None = None,
    starts: Start | Sequence[Start] | None = None,
) -> Samples:
    """Stack recordings of one machine.

    Parameters
    ----------
    inputs : sequence of str, optional
        Channels that models may use. Default: all temperatures and the first spindle speed.
    zeroing : Zeroing, optional
        Averaging time at the start. Default: that of `Zeroing`, with the spindle speed of the first recording.
    starts : Start or sequence of Start, optional
        Initial state of each recording, or of all of them. Default: determined from the recordings.
    """
    if not recordings:
        raise InputError("no recording given: give at least one")
    refuse_compensated(recordings, targets)
    target_channels, input_channels = _chosen_channels(recordings, targets, inputs)
    first = recordings[0]
    names = [r.name for r in recordings]
    if len(set(names)) != len(names):
        names = [f"{n}#{k}" for k, n in enumerate(names, start=1)]
    speed = first.speed
    zeroing = Zeroing(speed=speed.name if speed is not None else "") if zeroing is None else zeroing
    if starts is None:
        starts = find_starts(recordings, target_channels, zeroing=zeroing, absolute=not rezero)
    starts = [starts] * len(recordings) if isinstance(starts, Start) else starts
    parts = [_part(r, s, input_channels, target_channels, zeroing) for r, s in zip(recordings, starts, strict=True)]
    cycle_names = [
        c.name if len(recordings) == 1 else f"{n}: {c.name}"
        for n, r in zip(names, recordings, strict=True)
        for c in r.cycles
    ]
    first_cycle = np.cumsum([0, *(len(r.cycles) for r in recordings)])
    return Samples(
        inputs=input_channels,
        targets=target_channels,
        values=np.concatenate([p.values for p in parts]),
        deviations=np.concatenate([p.deviations for p in parts]),
        time=np.concatenate([p.time for p in parts]),
        test=np.repeat(np.arange(len(parts)), [len(p.time) for p in parts]),
        cycle=np.concatenate(
            [np.where(p.cycle < 0, -1, p.cycle + n) for p, n in zip(parts, first_cycle[:-1], strict=True)]
        ),
        row=np.concatenate([p.row for p in parts]),
        test_names=tuple(names),
        cycle_names=tuple(cycle_names),
        hashes=tuple(r.fingerprint for r in recordings),
        rezero=rezero,
        zero=_known(starts, input_channels, rezero),
        zeroing=zeroing,
        resting=np.concatenate([p.resting for p in parts]),
        starts=tuple(p.start for p in parts),
        clocks=tuple(r.clocks for r in recordings),
        stamps=tuple((*p.start.earlier, r)[0].start for p, r in zip(parts, recordings, strict=True)),
    )


def _chosen_channels(
    recordings: Sequence[Recording], targets: Sequence[str], inputs: Sequence[str] | None
) -> tuple[tuple[Channel, ...], tuple[Channel, ...]]:
    """Return targets and inputs, or raise `InputError` if a model cannot use them."""
    first = recordings[0]
    target_channels = tuple(first.channel(name) for name in dict.fromkeys(targets))
    if not target_channels:
        raise InputError("no target given: name at least one displacement channel")
    for c in target_channels:
        if c.quantity not in ("displacement", "angle"):
            raise InputError(
                f"target {c.name} measures {c.quantity}: a target must be a displacement or an angle; if it is one, "
                f"name its column drift_{c.unit} or map it"
            )
    if inputs is None:
        speed = first.speed
        input_channels = first.temperatures + ((speed,) if speed is not None else ())
    else:
        input_channels = tuple(first.channel(name) for name in dict.fromkeys(inputs))
    for c in input_channels:
        if c.quantity in NO_INPUTS:
            raise InputError(f"input {c.name} is a {c.quantity}: {NO_INPUTS[c.quantity]}")
    if not input_channels:
        raise InputError(f"{first.name}: no temperature and no spindle speed to predict from")
    _refuse_twins(recordings)
    if inputs is None:
        _refuse_different_inputs(recordings, input_channels)
    return target_channels, input_channels


class _Part(NamedTuple):
    """The rows of one test, after those of the files that it continues."""

    start: Start
    values: FloatArray
    deviations: FloatArray
    time: FloatArray
    cycle: IntArray
    row: IntArray
    resting: BoolArray


def _part(
    recording: Recording, start: Start, inputs: Sequence[Channel], targets: Sequence[Channel], zeroing: Zeroing
) -> _Part:
    start, begins = bridge_files(start, recording)
    _refuse_the_absurd(recording, [*inputs, *targets])
    deviations = recording.values([recording.channel(c.name) for c in targets])
    if start.word == "rezeroed":
        deviations = deviations - [level(recording, c.name, zeroing) for c in targets]
    before = sum(len(r) for r in start.earlier)
    for r in start.earlier:
        _refuse_the_absurd(r, inputs)
    every = (*start.earlier, recording)
    return _Part(
        start=start,
        values=np.concatenate([r.values([r.channel(c.name) for c in inputs]) for r in every]),
        deviations=np.concatenate([np.full((before, len(targets)), np.nan), deviations]),
        time=np.concatenate([begin + r.time for begin, r in zip(begins, every, strict=True)]),
        cycle=np.array(
            [-1] * before + [k for k, c in enumerate(recording.cycles) for _ in range(len(c))], dtype=np.intp
        ),
        row=np.array([-1] * before + list(range(len(recording))), dtype=np.intp),
        resting=np.concatenate([find_resting_rows(r, zeroing) for r in every]),
    )


def _known(starts: Sequence[Start], inputs: Sequence[Channel], rezero: bool) -> FloatArray | None:
    """Return the specified zeros, (n_tests, n_inputs); NaN for tests with a separate zero."""
    if not rezero or not any(s.word == "known" for s in starts):
        return None
    zero = np.full((len(starts), len(inputs)), np.nan)
    for k, start in enumerate(starts):
        if start.word == "known":
            missing = [c.name for c in inputs if c.quantity == "temperature" and c.name not in start.zero]
            if missing:
                raise InputError(f"the known zero has no value for {', '.join(missing)}: give every temperature used")
            zero[k] = [start.zero[c.name] if c.quantity == "temperature" else 0.0 for c in inputs]
    return zero


def _refuse_twins(recordings: Sequence[Recording]) -> None:
    """Reject a duplicate test, which would be used for training and judging at the same time."""
    seen: dict[str, Recording] = {}
    for r in recordings:
        twin = seen.setdefault(r.fingerprint, r)
        if twin is not r:
            raise InputError(f"{r.source or r.name} contains the same test as {twin.source or twin.name}: give it once")


def _refuse_different_inputs(recordings: Sequence[Recording], inputs: Sequence[Channel]) -> None:
    """Reject sensors that only some tests have: the user must exclude them explicitly."""
    first = {c.name for c in inputs}
    for r in recordings[1:]:
        speed = r.speed
        mine = {c.name for c in r.temperatures} | ({speed.name} if speed is not None else set())
        if mine != first:
            only = ", ".join(sorted(mine ^ first))
            raise InputError(
                f"{r.source or r.name} and {recordings[0].source or recordings[0].name} do not have the same sensors: "
                f"only one of them has {only}. Name the inputs of the model with --inputs"
            )


def _refuse_the_absurd(recording: Recording, channels: Sequence[Channel]) -> None:
    """Reject implausible numbers that would overflow in sums of squares."""
    values = recording.values([recording.channel(c.name) for c in channels])
    for row, k in np.argwhere(np.abs(values) > ABSURD)[:1]:
        raise RecordingError(
            f"{recording.source or recording.name}: {channels[k].name} is {values[row, k]:g} {channels[k].unit} in row "
            f"{row}: correct it, or mark it as missing by a mapping"
        )
