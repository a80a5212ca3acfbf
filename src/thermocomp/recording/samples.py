"""`Samples`: several tests stacked into the arrays that models are fitted to and replayed on."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from thermocomp.core.exceptions import InputError, RecordingError
from thermocomp.core.learned import Learned, probe_noise
from thermocomp.core.machine import Channel
from thermocomp.core.model import Input
from thermocomp.recording.recording import Recording

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]
BoolArray = NDArray[np.bool_]

#: quantities nothing is predicted from, and why
NO_INPUTS = {
    "displacement": "a machine in production has no displacement probe",
    "angle": "a machine in production has no probe for angles",
    "position": "thermocomp position fits errors that depend on it",
}
#: no temperature, speed or displacement of a machine reaches this, whatever its unit
ABSURD = 1e9


@dataclass(frozen=True, eq=False)
class Samples:
    """Rows of one or several tests.

    Parameters
    ----------
    inputs : tuple of Channel
        What models may use; never a displacement.
    targets : tuple of Channel
        What they shall predict.
    values : ndarray of shape (n_rows, n_inputs)
        Inputs as recorded, in house units.
    deviations : ndarray of shape (n_rows, n_targets)
        Targets, in house units.
    time : ndarray of shape (n_rows,)
        Seconds since the start of the row's test [s].
    test, cycle, row : ndarray of int of shape (n_rows,)
        Index into `test_names`, index into `cycle_names`, row in the file's table.
    test_names, cycle_names : tuple of str
    hashes : tuple of str
        Fingerprint of each test: SHA-256 of its times and values.
    rezero : bool
        Temperatures are counted from the first row of each test, or from `zero`.
    zero : ndarray of shape (n_tests, n_inputs), optional
        What they are counted from, if it is not the first complete row of each test; without `rezero` it is the same
        for all tests, and holds live too.
    """

    inputs: tuple[Channel, ...]
    targets: tuple[Channel, ...]
    values: FloatArray
    deviations: FloatArray
    time: FloatArray
    test: IntArray
    cycle: IntArray
    row: IntArray
    test_names: tuple[str, ...]
    cycle_names: tuple[str, ...]
    hashes: tuple[str, ...]
    rezero: bool = True
    zero: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.time)

    @property
    def valid(self) -> BoolArray:
        """Rows in which every input is a finite number."""
        return np.asarray(np.isfinite(self.values).all(axis=1))

    @property
    def rezeroed(self) -> BoolArray:
        """Inputs that are counted from the start of their test."""
        return np.array([self.rezero and c.quantity == "temperature" for c in self.inputs], dtype=np.bool_)

    def reference(self) -> FloatArray:
        """Return what counts as zero, (n_tests, n_inputs): each test's first complete row, or 0 for absolute inputs."""
        if self.zero is not None:
            return np.where([c.quantity == "temperature" for c in self.inputs], self.zero, 0.0)
        zero = np.zeros((len(self.test_names), len(self.inputs)))
        for k in range(len(self.test_names)):
            rows = np.flatnonzero((self.test == k) & self.valid)
            if rows.size == 0:
                names = ", ".join(c.name for c in self.inputs)
                raise RecordingError(f"{self.test_names[k]}: no row has a number in all of the inputs {names}")
            zero[k] = np.where(self.rezeroed, self.values[rows[0]], 0.0)
        return zero

    def change(self) -> FloatArray:
        """Return inputs minus their reference, (n_rows, n_inputs)."""
        return self.values - self.reference()[self.test]

    def dt(self) -> FloatArray:
        """Return the time since the previous row of the same test [s]; inf in each test's first row."""
        steps = np.diff(self.time, prepend=np.inf)
        steps[np.flatnonzero(np.diff(self.test, prepend=-1))] = np.inf
        return steps

    def learned(self, target: int, rows: BoolArray, before: int | None = None) -> Learned:
        """Return what some rows show of a target.

        Parameters
        ----------
        target : int
            Index into `targets`.
        rows : ndarray of bool of shape (n_rows,)
            Learned from; those without a number are passed over.
        before : int, optional
            The last value is that of the last row before this one in its test, 0 without any; without it, that of the
            last row of all.

        Returns
        -------
        Learned
        """
        y = self.deviations[:, target]
        known = rows & np.isfinite(y)
        if not known.any():
            return Learned(0.0, 0.0, 0.0, 0.0)
        noise = [probe_noise(y[known & (self.test == k)]) for k in np.unique(self.test[known])]
        candidates = np.flatnonzero(known)
        if before is not None:
            candidates = candidates[(candidates < before) & (self.test[candidates] == self.test[before])]
        last = float(y[candidates[-1]]) if candidates.size else 0.0
        return Learned(float(y[known].mean()), last, float(np.median(noise)), float(np.abs(y[known]).max()))

    def take(self, rows: BoolArray | IntArray) -> "Samples":
        """Return some of the rows, in their order."""
        return Samples(
            self.inputs,
            self.targets,
            self.values[rows],
            self.deviations[rows],
            self.time[rows],
            self.test[rows],
            self.cycle[rows],
            self.row[rows],
            self.test_names,
            self.cycle_names,
            self.hashes,
            self.rezero,
            self.zero,
        )

    def only(self, names: Sequence[str]) -> "Samples":
        """Return the same rows with some of the inputs, in the order they had."""
        kept = [j for j, c in enumerate(self.inputs) if c.name in names]
        zero = None if self.zero is None else self.zero[:, kept]
        return replace(self, inputs=tuple(self.inputs[j] for j in kept), values=self.values[:, kept], zero=zero)

    def model_inputs(self, columns: Sequence[int], rows: BoolArray | IntArray) -> tuple[Input, ...]:
        """Describe inputs for a model fitted to `rows`: reference and trained range of each."""
        change = self.change()[rows]
        zero = self.reference()[int(self.test[rows][0])]
        return tuple(
            Input(
                name=self.inputs[j].name,
                quantity=self.inputs[j].quantity,
                unit=self.inputs[j].unit,
                reference=float(zero[j]),
                rezero=bool(self.rezeroed[j]),
                low=float(np.nanmin(change[:, j])),
                high=float(np.nanmax(change[:, j])),
            )
            for j in columns
        )

    def frame(self) -> pd.DataFrame:
        """Return inputs minus reference as a table with the inputs' names."""
        return pd.DataFrame(self.change(), columns=[c.name for c in self.inputs])


def stack(
    recordings: Sequence[Recording],
    targets: Sequence[str],
    inputs: Sequence[str] | None = None,
    *,
    rezero: bool = True,
) -> Samples:
    """Stack recordings of one machine.

    Parameters
    ----------
    recordings : sequence of Recording
        The tests; each keeps its own zero.
    targets : sequence of str
        Displacement channels to predict.
    inputs : sequence of str, optional
        Channels models may use; all temperatures and the spindle speed if not given.
    rezero : bool
        True: temperatures are counted from the start of each test (ISO 230-3); False: they are absolute.

    Returns
    -------
    Samples

    Raises
    ------
    InputError
        A channel is missing in one of the recordings, or a displacement is asked for as an input.
    """
    if not recordings:
        raise InputError("no recording given")
    first = recordings[0]
    target_channels = tuple(first.channel(name) for name in dict.fromkeys(targets))
    if not target_channels:
        raise InputError("no target given: name at least one displacement channel")
    for c in target_channels:
        if c.quantity not in ("displacement", "angle"):
            raise InputError(f"target {c.name} measures {c.quantity}: a target must be a displacement or an angle")
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
    names = [r.name for r in recordings]
    if len(set(names)) != len(names):
        names = [f"{n}#{k}" for k, n in enumerate(names, start=1)]
    for r in recordings:
        _refuse_the_absurd(r, [*input_channels, *target_channels])
    cycle_names = [
        c.name if len(recordings) == 1 else f"{n}: {c.name}"
        for n, r in zip(names, recordings, strict=True)
        for c in r.cycles
    ]
    cycle = [k for k, c in enumerate(c for r in recordings for c in r.cycles) for _ in range(len(c))]
    return Samples(
        inputs=input_channels,
        targets=target_channels,
        values=np.concatenate([r.values([r.channel(c.name) for c in input_channels]) for r in recordings]),
        deviations=np.concatenate([r.values([r.channel(c.name) for c in target_channels]) for r in recordings]),
        time=np.concatenate([r.time for r in recordings]),
        test=np.repeat(np.arange(len(recordings)), [len(r) for r in recordings]),
        cycle=np.array(cycle, dtype=np.intp),
        row=np.concatenate([np.arange(len(r)) for r in recordings]),
        test_names=tuple(names),
        cycle_names=tuple(cycle_names),
        hashes=tuple(r.fingerprint for r in recordings),
        rezero=rezero,
    )


def _refuse_twins(recordings: Sequence[Recording]) -> None:
    """Refuse a test that is given twice: it would be learned from and judged on at once."""
    seen: dict[str, Recording] = {}
    for r in recordings:
        twin = seen.setdefault(r.fingerprint, r)
        if twin is not r:
            raise InputError(f"{r.source or r.name} holds the same test as {twin.source or twin.name}: give it once")


def _refuse_different_inputs(recordings: Sequence[Recording], inputs: Sequence[Channel]) -> None:
    """Refuse sensors that only some tests have: the user leaves them out, not the order of the files."""
    first = {c.name for c in inputs}
    for r in recordings[1:]:
        speed = r.speed
        mine = {c.name for c in r.temperatures} | ({speed.name} if speed is not None else set())
        if mine != first:
            only = ", ".join(sorted(mine ^ first))
            raise InputError(
                f"{r.source or r.name} and {recordings[0].source or recordings[0].name} do not have the same sensors: "
                f"only one of them has {only}. Name what to predict from with --inputs"
            )


def _refuse_the_absurd(recording: Recording, channels: Sequence[Channel]) -> None:
    """Refuse numbers that no sensor means and that sums of squares cannot hold."""
    values = recording.values([recording.channel(c.name) for c in channels])
    for row, k in np.argwhere(np.abs(values) > ABSURD)[:1]:
        raise RecordingError(
            f"{recording.source or recording.name}: {channels[k].name} is {values[row, k]:g} {channels[k].unit} in row "
            f"{row}: correct it, or mark it as missing by a mapping"
        )
