"""Error of the tool point over time and over the work volume, before and after possible corrections."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.core.components import COMPONENTS
from thermocomp.core.exceptions import InputError
from thermocomp.core.inputs import Input
from thermocomp.core.machine import Machine, Source, Vector
from thermocomp.core.model import ErrorModel
from thermocomp.core.position import PositionModel
from thermocomp.core.size import Size
from thermocomp.recordings.recording import Recording
from thermocomp.runtime.geometry.field import ErrorField
from thermocomp.runtime.geometry.kinematics import Kinematics
from thermocomp.runtime.geometry.straight import StraightLines, find_remaining_error, straight_lines
from thermocomp.runtime.geometry.volumetric import ThermalStates, VolumetricModel
from thermocomp.volumetric import notes

#: maximum number of grid points along each axis; more need memory without adding information
FINEST = 50
#: maximum number of rows in which the largest error is searched
_LOOKED_AT = 2000
_START, _LARGEST, _END = "start", "largest", "end"
_PICKED = (_START, _LARGEST, _END, f"{_START} = {_LARGEST}", f"{_END} = {_LARGEST}")


@dataclass(frozen=True, eq=False)
class PointCourse:
    """Course of the errors at one point while a recording is replayed.

    Parameters
    ----------
    point : tuple of float
        Positions of the axes [mm].
    tool : tuple of float
        Vector from the gauge point to the tip [mm].
    time : ndarray of shape (n_rows,)
        Time since the first row of the recording [s].
    values : ndarray of shape (n_rows, 32)
        Components at the point [um, urad].
    error : ndarray of shape (n_rows, 3)
        Error of the tool tip, actual minus commanded [um].
    tilt : ndarray of shape (n_rows, 3)
        Tilt of the tool [urad].
    sensitivity : ndarray of shape (32, 3)
        Effect of one um or urad of each component at the tip [um].
    """

    point: Vector
    tool: Vector
    time: FloatArray
    values: FloatArray
    error: FloatArray
    tilt: FloatArray
    sensitivity: FloatArray

    @property
    def largest(self) -> int:
        """Index of the row with the largest error of the tool tip."""
        return int(np.argmax(np.linalg.norm(self.error, axis=-1)))

    def contributions(self, row: int) -> FloatArray:
        """Return the contribution of each component to the error in one row, of shape (32, 3) [um]."""
        return self.values[row, :, None] * self.sensitivity


@dataclass(frozen=True, eq=False)
class Moment:
    """The work volume in one thermal state.

    Parameters
    ----------
    label : str
        Reason for the choice: ``start``, ``largest``, ``end``, ``reference state``, or the requested time.
    row : int
        Row of the course.
    time : float
        Time since the first row of the recording [s].
    straight : StraightLines
        Best straight line of each axis through the point of the course, as accepted by controllers.
    tool : tuple of float
        Vector from the gauge point to the tip [mm].
    grid : ndarray of shape (..., 3)
        Points at which the errors are evaluated [mm].
    """

    label: str
    row: int
    time: float
    field: ErrorField
    straight: StraightLines
    tool: Vector
    grid: FloatArray

    @property
    def name(self) -> str:
        """Label of the state, with its time unless the label is a time."""
        picked = self.label in _PICKED
        return f"{self.label}, {self.time / 3600:.2f} h" if picked else self.label

    def error(self, points: FloatArray) -> FloatArray:
        """Return the error without correction, by exact transforms, of shape (..., 3) [um]."""
        return self.field.error(points, self.tool, exact=True)

    def after_lines(self, points: FloatArray) -> FloatArray:
        """Return the residual after the straight lines of the axes, of shape (..., 3) [um]."""
        lines = {line.axis: line.correction for line in self.straight.lines}
        return find_remaining_error(self.field, points, lines, self.tool, exact=True)

    def after_all(self, points: FloatArray) -> FloatArray:
        """Return the residual after the complete correction, a vector at each point, of shape (..., 3) [um]."""
        correction = self.field.correction(points, self.tool)
        return self.error(points + 1e-3 * correction) + correction

    @cached_property
    def sizes(self) -> dict[str, Size]:
        """Length of the error vector on the grid, by extent of the correction."""
        everything = self.after_all(self.grid.reshape(-1, 3))
        return {
            "nothing": self.straight.before,
            "straight lines": self.straight.after,
            "everything": Size.of(np.linalg.norm(everything, axis=-1)),
        }

    @cached_property
    def shares(self) -> FloatArray:
        """Contribution of each component to the error on the grid: RMS of the vector length, of shape (32,) [um]."""
        points = self.grid.reshape(-1, 3)
        values, shares = self.field.components(points), np.zeros(len(COMPONENTS))
        for k in np.flatnonzero(values.any(axis=0)):
            alone = np.zeros_like(values)
            alone[:, k] = values[:, k]
            error, _ = self.field.kinematics.synthesize(alone, points, self.tool)
            shares[k] = np.sqrt(np.mean(np.sum(error**2, axis=-1)))
        return shares


@dataclass(frozen=True, eq=False)
class Volumetric:
    """A machine's volumetric error in its thermal states.

    Parameters
    ----------
    recording : Recording or None
        Replayed recording; None: the reference state.
    missing : int
        Number of rows with a missing input: the previous state is held there, as in live operation.
    """

    machine: Machine
    recording: Recording | None
    course: PointCourse
    moments: tuple[Moment, ...]
    missing: int = 0

    @cached_property
    def notes(self) -> tuple[str, ...]:
        """Notes on the machine: see `thermocomp.volumetric.notes`."""
        return notes.notes(replace(self.machine, tool=self.course.tool))

    @property
    def worst(self) -> Moment:
        """The evaluated state with the largest error on the grid."""
        return max(self.moments, key=lambda m: m.straight.before.largest)


#: called with a line of text and the number of rows processed
Progress = Callable[[str, int], object]


def study(
    machine: Machine,
    recording: Recording | None = None,
    *,
    at: Vector | None = None,
    grid: int = 5,
    tool: Vector | None = None,
    hours: Sequence[float] = (),
    progress: Progress | None = None,
) -> Volumetric:
    """Replay a recording through the models of a machine and evaluate its errors.

    Parameters
    ----------
    recording : Recording, optional
        Recording to replay. Default: none, the machine is in its reference state: constants and profiles.
    at : tuple of float, optional
        Point followed over time [mm]. Default: the middle of the travels; the search for the largest error then
        includes the corners.
    tool : tuple of float, optional
        Vector from the gauge point to the tip [mm]. Default: the tool of the machine.
    hours : sequence of float, optional
        Times to evaluate [h]. Default: start, largest error and end.
    """
    tip = machine.tool if tool is None else tool
    if grid > FINEST:
        raise InputError(f"a grid of {grid} points along each axis: at most {FINEST} are supported")
    if grid < 2:
        raise InputError(f"a grid of {grid} points along an axis has no extent: expected at least 2")
    if recording is None and hours:
        raise InputError("the times refer to a recording, but none is given: name a recording, or omit the times")
    time, table, missing = _inputs(machine, recording) if recording is not None else (np.zeros(1), {}, 0)
    replayed = machine if recording is not None else in_reference_state(machine)
    point = middle(machine) if at is None else _inside(machine, at)
    states = VolumetricModel(replayed).replay(time, table)
    values = np.empty((len(time), len(COMPONENTS)))
    for k, field in enumerate(states):
        values[k] = field.components(point)
        if progress is not None and k % 100 == 0:
            progress("replaying", 100)
    levers = Kinematics(machine)
    error, tilt = levers.synthesize(values, np.asarray(point), tip)
    course = PointCourse(
        point=point,
        tool=tip,
        time=time,
        values=values,
        error=error,
        tilt=tilt,
        sensitivity=levers.sensitivity(point, tip),
    )
    points, moments = lay_grid(machine, grid), []
    for label, row in _rows(time, course.largest if at is not None else _largest(states, tip), hours):
        lines = straight_lines(states[row], point, tip, grid=grid, exact=True)
        moments.append(
            Moment(
                label=label, row=row, time=float(time[row]), field=states[row], straight=lines, tool=tip, grid=points
            )
        )
    return Volumetric(machine=machine, recording=recording, course=course, moments=tuple(moments), missing=missing)


def in_reference_state(machine: Machine) -> Machine:
    """Return a machine whose time-dependent models are zero: only constants and profiles."""
    kept: dict[str, Source] = {}
    for code, source in machine.components.items():
        if isinstance(source, PositionModel):
            kept[code] = replace(source, offset=None, slopes=())
        elif not isinstance(source, ErrorModel):
            kept[code] = source
    return replace(machine, components=kept)


def inputs_of(machine: Machine) -> dict[str, Input]:
    """Return the inputs that the machine's models need, by name."""
    return {i.name: i for source in machine.components.values() for m in models_of(source) for i in m.inputs}


def models_of(source: Source | None) -> tuple[ErrorModel, ...]:
    """Return the time-dependent models in the source of a component."""
    if isinstance(source, PositionModel):
        return source.models
    return (source,) if isinstance(source, ErrorModel) else ()


def describe_source(source: Source | None) -> str:
    """Return a short description of the source of a component's value."""
    if source is None:
        return "nothing"
    if isinstance(source, PositionModel):
        terms = (["profile"] if source.profile is not None else []) + [f"k{p}" for p in source.powers]
        return f"model: {' + '.join(terms)}" if source.models else "profile"
    return f"model: {source.family}" if isinstance(source, ErrorModel) else "constant"


def middle(machine: Machine) -> Vector:
    """Return the middle of the travels; 0 for an axis that does not exist [mm]."""
    x, y, z = (0.5 * sum(machine.axis(a).travel) if a in machine.structure.axes else 0.0 for a in "XYZ")
    return (x, y, z)


def lay_grid(machine: Machine, n: int) -> FloatArray:
    """Return a grid over the work volume, of shape (n_x, n_y, n_z, 3) [mm]; one point along a missing axis."""
    along = [np.linspace(*machine.axis(a).travel, n) if a in machine.structure.axes else np.zeros(1) for a in "XYZ"]
    return np.stack(np.meshgrid(*along, indexing="ij"), axis=-1)


def _inside(machine: Machine, point: Vector) -> Vector:
    for name, position in zip("XYZ", point, strict=True):
        if name in machine.structure.axes:
            low, high = machine.axis(name).travel
            if not low <= position <= high:
                raise InputError(f"{name} {position:g} mm: outside the travel of {name}, {low:g} to {high:g} mm")
    return point


def _inputs(machine: Machine, recording: Recording) -> tuple[FloatArray, dict[str, FloatArray], int]:
    """Return times, inputs, and the number of rows with a missing input."""
    wanted, table = inputs_of(machine), {}
    for name, model_input in wanted.items():
        channel = recording.channel(name)
        if channel.quantity != model_input.quantity:
            raise InputError(
                f"{recording.source or recording.name}: channel {name!r} is a {channel.quantity}; the models of "
                f"{machine.name} need a {model_input.quantity}"
            )
        table[name] = recording.table[channel.name].to_numpy(dtype=np.float64)
    missing = np.zeros(len(recording), dtype=np.bool_)
    for values in table.values():
        missing |= ~np.isfinite(values)
    if missing.all():
        raise InputError(
            f"{recording.source or recording.name}: every row lacks a value of at least one input of the models "
            f"({', '.join(table)})"
        )
    return recording.time, table, int(missing.sum())


def _largest(states: ThermalStates, tool: Vector) -> int:
    """Return the row with the largest error at the corners of the volume; of a long recording every n-th is checked."""
    corners = lay_grid(states.model.machine, 2)
    rows = range(0, len(states), 1 + len(states) // _LOOKED_AT)
    return max(rows, key=lambda k: float(np.linalg.norm(states[k].error(corners, tool), axis=-1).max()))


def _rows(time: FloatArray, largest: int, hours: Sequence[float]) -> Iterator[tuple[str, int]]:
    """Yield the labels and rows of the states to be evaluated, each row once."""
    if len(time) == 1:
        yield "reference state", 0
        return
    if not hours:
        last = len(time) - 1
        found = {0: _START, last: _END}
        found[largest] = f"{found[largest]} = {_LARGEST}" if largest in found else _LARGEST
        for row in sorted(found):
            yield found[row], row
        return
    for hour in sorted(set(hours)):
        if not 0 <= hour * 3600 <= time[-1] + 1e-6:
            raise InputError(f"{hour:g} h: outside the recording, 0 to {time[-1] / 3600:.2f} h")
        row = int(np.argmin(np.abs(time - hour * 3600)))
        yield f"{time[row] / 3600:.2f} h", row
