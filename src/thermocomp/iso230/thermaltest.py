"""Result of a thermal test according to ISO 230-3: curves and their characteristic values.

See `thermocomp.iso230.part3` for the names that are from the standard and those specific to this package.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.core.exceptions import InputError
from thermocomp.core.machine import Channel
from thermocomp.judging.settling.averaging import AveragedCurve, K
from thermocomp.judging.settling.settling import Settling
from thermocomp.recordings.recording import Recording

Kind = Literal["etve", "spindle", "axis"]
#: titles of the tests
TITLES: dict[Kind, str] = {
    "etve": "Environmental temperature variation error (ETVE)",
    "spindle": "Thermal distortion caused by the rotating spindle",
    "axis": "Thermal distortion caused by the moving linear axis",
}
HOUR = 3600.0


@dataclass(frozen=True)
class Pair:
    """Two parallel probes along the test bar, whose difference is a tilt of the spindle.

    Signs according to ISO 841, as in the whole package: ``A = (y1 - y2) / L`` and ``B = (x2 - x1) / L`` with 1 at the
    tip of the test bar and 2 towards the spindle, which points to -Z.

    Parameters
    ----------
    tip, spindle : str
        Channels of the probe at the tip (X1 or Y1) and of the one nearer to the spindle (X2 or Y2).
    distance : float
        Distance L between the probes [mm].

    Raises
    ------
    InputError
        The distance is not positive, or the names do not begin with the same letter, x or y.
    """

    tip: str
    spindle: str
    distance: float

    def __post_init__(self) -> None:
        if not 0 < self.distance < float("inf"):
            raise InputError(f"probes {self.tip} and {self.spindle}: distance {self.distance:g} mm must be positive")
        if self.axis not in ("x", "y") or self.spindle[:1].lower() != self.axis or self.tip == self.spindle:
            raise InputError(
                f"probes {self.tip} and {self.spindle}: a tilt needs two different probes along X, or along Y, "
                "whose names begin with that letter, such as x1 and x2"
            )

    @property
    def axis(self) -> str:
        """Letter of the measuring direction of both probes."""
        return self.tip[:1].lower()

    @property
    def tilt(self) -> Literal["A", "B"]:
        """A, about X, from probes along Y; B, about Y, from probes along X."""
        return "A" if self.axis == "y" else "B"

    def angle(self, tip: FloatArray, spindle: FloatArray) -> FloatArray:
        """Return the tilt from two displacements [um], in urad, which equals um/m."""
        difference = tip - spindle if self.tilt == "A" else spindle - tip
        return np.asarray(1e3 * difference / self.distance)


@dataclass(frozen=True)
class Figures:
    """Characteristic values of one curve, relative to the start of the test, in the unit of the curve.

    Parameters
    ----------
    range_60 : float
        Largest minus smallest averaged value over the first 60 min; nan if the period is shorter.
    range_run : float
        The same over the running time of the drives; for an ETVE test over all of it.
    range_all : float
        The same over the whole recording of this test, including cool-down. For an ETVE test: its ETVE.
    at_60, at_end : float
        Value at 60 min (interpolated linearly), and at the stop of the drives: the drift of the warm-up.
    largest : float
        Value farthest from that at the start, with its sign, while the drives run.
    cool_down : float
        Last value minus the value at the stop of the drives; nan without a cool-down.
    range_last : float
        Largest minus smallest value over the last 60 min of running; nan if the drives run for less than 2 h.
    range_rows : float
        `range_all` of the rows without averaging, including their noise.
    U_60, U_end, U_cool_down : float
        Expanded uncertainties (k = 2) of `at_60`, `at_end` and `cool_down` due to noise, including that of the zero;
        nan if unknown.
    """

    range_60: float = float("nan")
    range_run: float = float("nan")
    range_all: float = float("nan")
    at_60: float = float("nan")
    at_end: float = float("nan")
    largest: float = float("nan")
    cool_down: float = float("nan")
    range_last: float = float("nan")
    range_rows: float = float("nan")
    U_60: float = float("nan")
    U_end: float = float("nan")
    U_cool_down: float = float("nan")


@dataclass(frozen=True, eq=False)
class ThermalCurve:
    """A displacement, a tilt or a change of length over the time of a test.

    Parameters
    ----------
    name : str
        Channel; for a tilt its letter, for a length its end points.
    place : str
        Location as text.
    values : ndarray of shape (n_rows,)
        Change since the start of the test, for each row; nan where missing.
    course : AveragedCurve
        Averaged curve, from which `figures` are taken.
    settling : Settling or None
        Settling after the start of the drives; None if they never start.
    after : ndarray of shape (n_rows,) or None
        Residual with a model; None without a model.
    """

    name: str
    unit: str
    place: str
    values: FloatArray
    course: AveragedCurve
    figures: Figures
    settling: Settling | None
    after: FloatArray | None = None
    after_course: AveragedCurve | None = None
    after_figures: Figures | None = None


@dataclass(frozen=True, eq=False)
class Targets:
    """Positioning of a linear axis at several targets, over the time of a test.

    Parameters
    ----------
    name : str
        Prefix of the channels' names, such as ``x_laser``.
    positions : ndarray of shape (n_targets,)
        Target positions, increasing [mm].
    curves : tuple of ThermalCurve
        Error at each target, in order of position.
    length : ThermalCurve
        Change of the distance between the first and the last target: error at the last minus error at the first [um].
    """

    name: str
    axis: str
    positions: FloatArray
    curves: tuple[ThermalCurve, ...]
    length: ThermalCurve

    @property
    def distance(self) -> float:
        """Distance between the first and the last target [mm]."""
        return float(self.positions[-1] - self.positions[0])


@dataclass(frozen=True, eq=False)
class ThermalTest:
    """An evaluated thermal test.

    Parameters
    ----------
    recording : Recording
        Recording that contains the test.
    start, stop, end : int
        First row, to which all values are relative; row in which the drives stop (`end` if they do not); last row.
    load : str
        Load of the spindle or the axis, as text.
    curves : tuple of ThermalCurve
        Curves of all displacements and angles that are not targets.
    tilts : tuple of ThermalCurve
        Tilts from paired probes [urad].
    targets : tuple of Targets
        Linear axis only.
    ambient : Channel or None
        Channel of the ambient temperature.
    ambient_range : tuple of float
        Lowest and highest ambient temperature during the test [degC]; nan if not measured.
    notes : tuple of str
        Cautions on the characteristic values.
    """

    kind: Kind
    name: str
    recording: Recording
    start: int
    stop: int
    end: int
    load: str
    curves: tuple[ThermalCurve, ...]
    tilts: tuple[ThermalCurve, ...]
    pairs: tuple[Pair, ...]
    targets: tuple[Targets, ...]
    ambient: Channel | None
    ambient_range: tuple[float, float]
    notes: tuple[str, ...]

    @property
    def time(self) -> FloatArray:
        """Time since the start of the test, (n_rows,) [s]."""
        time = self.recording.time
        return np.asarray(time[self.start : self.end + 1] - time[self.start])

    @property
    def running(self) -> float:
        """Running time of the drives [s]; for an ETVE test, its duration."""
        return float(self.time[self.stop - self.start])

    @property
    def described(self) -> str:
        """Test conditions in one line: load, ambient temperature, distance between the probes."""
        parts = [self.load]
        hours = [self.running / HOUR, (self.time[-1] - self.running) / HOUR]
        parts.append(f"{hours[0]:.3g} h" if self.kind == "etve" else f"{hours[0]:.3g} h, cool-down {hours[1]:.3g} h")
        if self.ambient is not None:
            low, high = self.ambient_range
            parts.append(f"surroundings ({self.ambient.name}) {low:.2f} to {high:.2f} degC, range {high - low:.2f} K")
        parts += [f"{p.tip} and {p.spindle} {p.distance:g} mm apart" for p in self.pairs]
        return "; ".join(parts)

    @property
    def all_curves(self) -> tuple[ThermalCurve, ...]:
        """All evaluated curves: displacements, tilts, targets, lengths."""
        at_targets = (c for t in self.targets for c in (*t.curves, t.length))
        return (*self.curves, *self.tilts, *at_targets)


def evaluate_averaged_curve(time: FloatArray, course: AveragedCurve, rows: FloatArray, stop: int) -> Figures:
    """Return the characteristic values of an averaged curve, with their uncertainty.

    Parameters
    ----------
    time : ndarray of shape (n_rows,)
        Time since the start of the test [s].
    rows : ndarray of shape (n_rows,)
        The curve before averaging; nan where missing.
    """
    told = evaluate_curve(time, course.values, stop)
    known = np.flatnonzero(np.isfinite(course.values))
    run, after = known[known <= stop], known[known > stop]
    if not run.size:
        return told
    at_end, zero = course.u[run[-1]], course.zero.u
    at_60 = float(np.interp(HOUR, time[known], course.u[known])) if np.isfinite(told.at_60) else float("nan")
    return replace(
        told,
        range_rows=float(np.ptp(rows[known])),
        U_60=float(K * np.hypot(at_60, zero)),
        U_end=float(K * np.hypot(at_end, zero)),
        U_cool_down=float(K * np.hypot(course.u[after[-1]], at_end)) if after.size else float("nan"),
    )


def evaluate_curve(time: FloatArray, values: FloatArray, stop: int) -> Figures:
    """Return the characteristic values of a curve from its rows, without averaging.

    Parameters
    ----------
    time : ndarray of shape (n_rows,)
        Time since the start of the test [s].
    values : ndarray of shape (n_rows,)
        Change since the start of the test; nan where missing.

    Returns
    -------
    Figures
        All nan if there is no value.
    """
    nan = float("nan")
    there = np.isfinite(values)
    run = there & (np.arange(len(values)) <= stop)
    if not run.any():
        return Figures()
    first = there & (time <= HOUR)
    at_60 = float(np.interp(HOUR, time[there], values[there]))
    hour = time[run][-1] >= HOUR
    # the value at 60 min belongs to the first 60 min, even if no row has exactly that time
    range_60 = float(np.ptp([*values[first], at_60])) if hour else nan
    v, at_end = values[run], float(values[run][-1])
    ends = float(time[run][-1])
    # the value one hour before the end belongs to the last hour, even if no row has exactly that time
    an_hour_before = float(np.interp(ends - HOUR, time[there], values[there]))
    last = float(np.ptp([*v[time[run] >= ends - HOUR], an_hour_before])) if ends >= 2.0 * HOUR else nan
    after = values[there & (np.arange(len(values)) > stop)]
    return Figures(
        range_60=range_60,
        range_run=float(np.ptp(v)),
        range_all=float(np.ptp(values[there])),
        at_60=at_60 if hour else nan,
        at_end=at_end,
        largest=float(v[np.argmax(np.abs(v))]),
        cool_down=float(after[-1] - at_end) if after.size else nan,
        range_last=last,
    )
