"""Assignment of models to the drift of axes, and their positions (P-04)."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import groupby

from thermocomp.core.exceptions import InputError, explain_unknown
from thermocomp.core.model import ErrorModel
from thermocomp.core.units import read_with_unit

AXES = "XYZ"
_NUMBER = r"-?\d+(?:\.\d+)?"
#: target names such as x_um, z, z_at_200, x_at_z-50_um
_NAME = re.compile(rf"([xyz])(?:_at_([xyz]?)({_NUMBER})(?:mm)?)?(?:_um)?", re.IGNORECASE)
#: axis letter at the beginning of a name: y1_um, but not yaw
_BEGINS = re.compile(r"[xyz](?![a-z])", re.IGNORECASE)
#: axes given by the user: Z, X at Z 200 mm
_PLACE = re.compile(rf"([xyz])(?:\s+at\s+([xyz])\s*=?\s*({_NUMBER}\s*[a-z]*))?", re.IGNORECASE)


@dataclass(frozen=True)
class Station:
    """Model of the drift of one axis: the only one, or one of several along an axis.

    Parameters
    ----------
    axis : {'X', 'Y', 'Z'}
        Axis along which the tool point deviates.
    model : ErrorModel
        Model with an output in um.
    along : {'X', 'Y', 'Z'} or None
        Axis on whose position the drift depends; None: the model is valid everywhere.
    at : float
        Position along it at which the model is valid, machine coordinate [mm].
    shadow : bool
        True: the drift is only computed, for example in a study, and not used to run a machine; the model may be one
        that was never judged.

    Raises
    ------
    InputError
        The model is not in um, or may not run; or the axis does not exist.
    """

    axis: str
    model: ErrorModel
    along: str | None = None
    at: float = 0.0
    shadow: bool = field(default=False, kw_only=True)

    def __post_init__(self) -> None:
        if self.axis not in tuple(AXES) or self.along not in (None, *AXES):
            raise InputError(f"model of {self.model.target}: axes are X, Y and Z, found {self.axis} and {self.along}")
        if self.model.unit != "um":
            raise InputError(
                f"model of {self.model.target} predicts {self.model.unit}; a program is corrected with models in um"
            )
        if not abs(self.at) < float("inf"):
            raise InputError(f"model of {self.model.target}: position {self.at} mm must be finite")
        if not self.shadow:
            self.model.check_may_run()

    def __str__(self) -> str:
        return self.axis if self.along is None else f"{self.axis} at {self.along} {self.at:g} mm"


def stations(models: Sequence[ErrorModel], texts: Sequence[str] = ()) -> list[Station]:
    """Return the stations of the models, with their axes.

    Parameters
    ----------
    texts : sequence of str
        Assignments by the user: ``ch3=Z``, ``zz=X at Z 200 mm``, or only a target whose name specifies the axis. Models
        without a text are ignored. Without any text all are used, and the names of their targets must specify the axis:
        ``x``, ``y_um``, ``z_at_200``, ``x_at_z200`` (positions in mm).
    """
    targets = [m.target for m in models]
    if len(set(targets)) != len(targets):
        raise InputError(f"two models for the same target among {', '.join(targets)}; give one model per target")
    known = dict(zip(targets, models, strict=True))
    found, named = [], set()
    for text in texts or targets:
        target, says, place = (part.strip() for part in text.partition("="))
        model = known.get(target) or known.get(f"{target}_um")
        if model is None:
            raise explain_unknown("model of", target, targets)
        if model.target in named:
            raise InputError(f"{text!r}: {model.target} was given before; a model belongs to one axis at one position")
        named.add(model.target)
        found.append(_stated(text, place, model) if says else _by_name(model, targets))
    return check_stations(found)


def check_stations(found: Sequence[Station]) -> list[Station]:
    """Return stations ordered by axis and position."""
    if not found:
        raise InputError("no model was given for the correction of the program; give at least one")
    ordered = sorted(found, key=lambda s: (s.axis, s.at))
    for axis, group in groupby(ordered, key=lambda s: s.axis):
        mine = list(group)
        names = ", ".join(s.model.target for s in mine)
        along = {s.along for s in mine}
        if len(mine) == 1 and along != {None}:
            raise InputError(
                f"{axis} has one model at a position ({names}): one position does not show how the drift varies along "
                f"{mine[0].along}; give another model, or --axis {mine[0].model.target}={axis}"
            )
        if len(mine) > 1 and (len(along) > 1 or None in along):
            raise InputError(
                f"{axis} has several models, {names}: expected one, or one per position along a single axis"
            )
        if len({s.at for s in mine}) < len(mine):
            raise InputError(f"{axis} has two models at the same position among {', '.join(map(str, mine))}: {names}")
    return ordered


def _by_name(model: ErrorModel, targets: Sequence[str]) -> Station:
    match = _NAME.fullmatch(model.target)
    if match is not None:
        axis, along, at = (part and part.upper() for part in match.groups())
        if at is None:
            return Station(axis, model)
        if along or axis == "Z":  # x_at_200 could be a position along X or Z
            return Station(axis, model, along or axis, float(at))
    begins = _BEGINS.match(model.target)
    meant = begins[0].upper() if begins else "Z"
    raise InputError(
        f"the name of the target {model.target!r} does not state which axis it is; give --axis "
        f'{model.target}={meant}, or --axis "{model.target}={meant} at Z 200 mm"; targets are {", ".join(targets)}'
    )


def _stated(text: str, place: str, model: ErrorModel) -> Station:
    match = _PLACE.fullmatch(place)
    if match is None:
        raise InputError(f'{text!r}: expected an axis, such as {model.target}=Z or "{model.target}=X at Z 200 mm"')
    axis, along, at = match.groups()
    if along is None:
        return Station(axis.upper(), model)
    position = read_with_unit(at, "position")
    if position is None:
        raise InputError(f"{text!r}: the position {at} has no unit; write {at} mm")
    return Station(axis.upper(), model, along.upper(), position)
