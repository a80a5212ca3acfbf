"""Rows of a journal: fixed types, checked when written and when read."""

import json
import math
from collections.abc import Callable, Mapping
from types import UnionType
from typing import Any, Literal, NamedTuple, get_args, get_origin, get_type_hints

import numpy as np

from thermocomp.core.correction import Correction, Deviation, uncompensated
from thermocomp.core.exceptions import InputError
from thermocomp.core.machine import Channel
from thermocomp.files.typed import decode, encode, want
from thermocomp.runtime.state import Word

#: whether the controller has its own temperature compensation in addition to thermocomp
Own = Literal["on", "off", "unknown"]
#: type of a measurement at the machine
Kind = Literal["probing", "work_offset", "tool_length"]

#: maximum magnitude of a number and maximum length of a text; longer texts are cut
LARGEST, LONGEST = 1e15, 2000
#: maximum number of channels and targets of a service
_MOST = 10_000


class TargetRow(NamedTuple):
    """A compensated target or axis."""

    name: str
    quantity: str = "displacement"  #: or ``angle``
    unit: str = "um"
    position: float = 0.0  #: axis position at which its displacement channel measures [mm]


class StartRow(NamedTuple):
    """Start of a run of the service: defines how the following rows are read."""

    time: float  #: [s] since 1970
    targets: tuple[TargetRow, ...]
    channels: tuple[Channel, ...]  #: channels of the readings; one named as a target measures its residual
    own_compensation: Own = "unknown"
    confirm_within: float = 10.0  #: validity of a confirmed correction after its confirmation [s]


class ReadingRow(NamedTuple):
    """A reading; values that are not finite or belong to no channel are omitted."""

    time: float
    values: Mapping[str, float]


class DemandRow(NamedTuple):
    """The correction that the compensator demands for a target, when it changes."""

    time: float
    target: str
    correction: Correction


class ConfirmationRow(NamedTuple):
    """Correction in force, as reported by the controller."""

    time: float
    target: str
    correction: Correction


class StateRow(NamedTuple):
    """Status of a target, valid from the time of this row until the next one."""

    time: float
    target: str
    word: Word
    reason: str


class ReferenceRow(NamedTuple):
    """New zero of a target, and the reason for it."""

    time: float
    target: str
    why: str
    shift: Deviation


class MeasurementRow(NamedTuple):
    """A measurement at the machine, with the correction in force at that time.

    `value` is the expected position minus the one reported by the controller: the apparent deviation of the tool point.
    With a correction in force, `value` depends on whether the report includes the correction, see `measured_by`.
    """

    time: float
    target: str
    value: float  #: [um]
    kind: Kind
    includes_offset: bool  #: whether the reported position includes the correction (LinuxCNC's #5063), or not (#<_z>)
    position: float = 0.0  #: axis position [mm]
    in_force: Correction | None = None  #: confirmed by the controller; zero: none in force; None: unknown

    @property
    def compensated(self) -> bool | None:
        """Whether a correction was in force; None if unknown."""
        return None if self.in_force is None else self.in_force.at(self.position) != 0.0


class AlarmRow(NamedTuple):
    """An alarm that needs attention."""

    time: float
    kind: str
    text: str


class UpdateRow(NamedTuple):
    """Change of a model by a probing."""

    time: float
    target: str
    measured: float  #: uncompensated deviation [um]
    before: float  #: prediction before the probing [um]
    after: float  #: prediction after the probing [um]
    refused: str  #: reason why the probing was not used; empty if it was


Row = (
    ReadingRow
    | DemandRow
    | ConfirmationRow
    | StateRow
    | ReferenceRow
    | MeasurementRow
    | AlarmRow
    | UpdateRow
    | StartRow
)
KINDS: dict[str, type[Any]] = {
    "start": StartRow,
    "reading": ReadingRow,
    "demand": DemandRow,
    "confirmation": ConfirmationRow,
    "state": StateRow,
    "reference": ReferenceRow,
    "measurement": MeasurementRow,
    "alarm": AlarmRow,
    "update": UpdateRow,
}
_NAMES = {kind: name for name, kind in KINDS.items()}


def measured_by(row: MeasurementRow, start: StartRow, in_force: Correction | None = None) -> float | None:
    """Return the uncompensated deviation from a measurement [um].

    At the probed position the tool point is on its nominal position: the motor positions differ from their nominal
    values by minus the deviation. A reported position that includes the correction therefore gives the full deviation;
    one without it gives the residual under the correction. So the correction is subtracted once in the second case, and
    never in the first.

    Returns
    -------
    float or None
        None if it cannot be determined: the controller has its own compensation, or the correction in force is unknown.
    """
    known = row.in_force if row.in_force is not None else in_force
    if start.own_compensation != "off":
        return None
    if row.includes_offset:
        return row.value
    return None if known is None else uncompensated(row.value, known.at(row.position))


# -- conversion to and from text ---------------------------------------------------------------------------------------


def kind_of(row: Row) -> str:
    """Return the name of the kind of a journal row."""
    found = _NAMES.get(type(row))
    if found is None:
        raise ValueError(f"{type(row).__name__} is not a row of a journal")
    return found


def dumps(row: Row, start: StartRow) -> str:
    """Return a journal row, without its time, as ASCII text."""
    name = kind_of(row)
    to_number(row.time)
    if isinstance(row, StartRow):
        text = _plain(encode(row))
        _checked(json.loads(text))
        return text
    if isinstance(row, ReadingRow):
        return _plain([_number_or_none(row.values.get(c.name)) for c in start.channels])
    return _plain([write(value) for (write, _), value in zip(_CODECS[name], row[1:], strict=True)])


def loads(kind: str, time: float, text: str, start: StartRow | None) -> Row:
    """Return the journal row from text written by `dumps`."""
    value = json.loads(text)
    want(kind in KINDS, kind, "kind", f"one of {', '.join(KINDS)}")
    if kind == "start":
        return _checked(value)
    want(start is not None, None, kind, "a start row before it")
    assert start is not None
    if kind == "reading":
        names = [c.name for c in start.channels]
        want(isinstance(value, list) and len(value) == len(names), None, kind, f"{len(names)} values")
        return ReadingRow(
            to_number(time), {n: to_number(v) for n, v in zip(names, value, strict=True) if v is not None}
        )
    codecs = _CODECS[kind]
    want(isinstance(value, list) and len(value) == len(codecs), None, kind, f"{len(codecs)} values")
    row: Row = KINDS[kind](to_number(time), *(read(v) for (_, read), v in zip(codecs, value, strict=True)))
    return row


def to_number(value: Any) -> float:
    """Return a finite number within the limits, or raise `ValueError`."""
    number = isinstance(value, float | int | np.floating | np.integer) and not isinstance(value, bool)
    want(number and abs(value) <= LARGEST, value, "number", "a finite number")
    return float(value)


def _checked(value: Any) -> StartRow:
    try:
        start: StartRow = decode(StartRow, value, "start")
    except InputError as e:  # a unit that does not fit the quantity
        raise ValueError(str(e)) from e
    for number in (start.time, *(t.position for t in start.targets)):
        to_number(number)
    want(0.0 < start.confirm_within < math.inf, start.confirm_within, "confirm_within", "a positive number")
    for names in ([t.name for t in start.targets], [c.name for c in start.channels]):
        want(
            len(set(names)) == len(names) <= _MOST and all(names),
            None,
            "start",
            "at most 10,000 names, each of them once",
        )
    known = {c.name: (c.quantity, c.unit) for c in start.channels}
    for t in start.targets:
        want(known.get(t.name, t[1:3]) == t[1:3], None, t.name, f"a channel of {t.quantity} in {t.unit}, as the target")
    return start


def _plain(value: Any) -> str:
    return json.dumps(value, separators=(",", ":"), allow_nan=False, default=lambda v: v.item())


def _number_or_none(value: Any) -> float | None:
    try:
        return to_number(value)
    except (ValueError, OverflowError, TypeError):
        return None


def _text(value: Any) -> str:
    want(isinstance(value, str), value, "text", "text")
    return str(value) if len(value) <= LONGEST else f"{value[: LONGEST - 4]} ..."


def _flag(value: Any) -> bool:
    want(isinstance(value, bool | np.bool_), value, "flag", "true or false")
    return bool(value)


_Codec = tuple[Callable[[Any], Any], Callable[[Any], Any]]


def _codec(hint: Any) -> _Codec:
    if get_origin(hint) is UnionType:
        write, read = _codec(get_args(hint)[0])
        return lambda v: None if v is None else write(v), lambda v: None if v is None else read(v)
    if get_origin(hint) is Literal:

        def word(value: Any) -> Any:
            want(isinstance(value, str) and value in get_args(hint), value, "word", f"one of {get_args(hint)}")
            return value

        return word, word
    if hint in (Correction, Deviation):

        def written(value: Any) -> list[float]:
            want(isinstance(value, hint), value, hint.__name__, f"a {hint.__name__}")
            return [to_number(v) for v in (value.offset, value.slope, value.reference_position)]

        def back(value: Any) -> Any:
            want(isinstance(value, list) and len(value) == 3, None, hint.__name__, "three numbers")
            return hint(*(to_number(v) for v in value))

        return written, back
    plain: Callable[[Any], Any] = {float: to_number, str: _text, bool: _flag}[hint]
    return plain, plain


#: functions that write and read each field after the time, by kind
_CODECS = {
    name: tuple(_codec(get_type_hints(kind)[field]) for field in kind._fields[1:])
    for name, kind in KINDS.items()
    if kind not in (StartRow, ReadingRow)
}
