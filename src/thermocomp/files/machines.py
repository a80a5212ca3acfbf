"""Machine files: axes, lengths and what is known of the 32 components, written as TOML; see :doc:`/machine_file`."""

import json
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

from thermocomp.core.components import BY_CODE, ErrorComponent
from thermocomp.core.exceptions import InputError, SettingError, UnitError, explain_unknown
from thermocomp.core.machine import Axis, Machine, Source
from thermocomp.core.model import ErrorModel
from thermocomp.core.position import PositionModel
from thermocomp.core.profile import SplineProfile
from thermocomp.core.structure import Structure
from thermocomp.core.units import read_with_unit
from thermocomp.files import jsonfile, modelfile, positionfile
from thermocomp.files.tomlfile import read_toml

Keys = tuple[str | int, ...]
#: turns what stands under a key into house units; gets the key's path for its error
Convert = Callable[[Any, Keys], Any]

#: what a value with a unit is called, and an example of it
_SAID = {
    "position": ("length", "600 mm"),
    "displacement": ("length", "12 um"),
    "angle": ("angle", "12 urad"),
    "temperature": ("temperature", "20 degC"),
    "feed": ("speed", "30 m/min"),
    "acceleration": ("acceleration", "3 m/s2"),
}
_QUANTITY = {"um": "displacement", "urad": "angle"}


def read_machine(path: str | Path) -> Machine:
    """Read a machine TOML.

    Every value with a dimension is a text with its unit: a bare number is refused. Model files are looked for beside
    the machine file. A model that was refused when it was judged is refused here too, as it is everywhere else.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    Machine

    Raises
    ------
    InputError
        No such file, not TOML, a key or value that is not understood, an axis or component that is not there, or a
        model file that cannot be used; the message names the file and the key's path.

    Examples
    --------
    A bed-type mill whose Y axis was measured by a laser, and whose spindle drift has a model::

        structure = "w X' b Z Y (C1) t"
        tool = ["0 mm", "0 mm", "-150 mm"]

        [axes.X]
        travel = ["0 mm", "600 mm"]
        [axes.Y]
        travel = ["0 mm", "400 mm"]
        [axes.Z]
        travel = ["0 mm", "500 mm"]

        [components]
        C0Y = "12 urad"
        EYY = {model = "eyy.json"}
        EXX = {profile = [["0 mm", "0 um"], ["300 mm", "1.5 um"], ["600 mm", "2 um"]]}
        Z0C = {model = "drift.json", target = "z"}
    """
    source = Path(path)
    content = read_toml(source, "machine file")
    try:
        return _machine(content, source)
    except SettingError as e:
        keys = ".".join(str(key) for key in e.path)
        raise InputError(": ".join(part for part in (str(source), keys, str(e)) if part)) from e


def _machine(content: dict[str, Any], source: Path) -> Machine:
    given = _table(content, _MACHINE, ())
    given.setdefault("name", source.stem)
    if "structure" not in given:
        raise SettingError('is missing: write the axes from the workpiece to the tool, such as "XFZY"', ("structure",))
    structure: Structure = given["structure"]
    tables = given.pop("axes", {})
    for name in tables:
        if name in structure.rotary:
            raise SettingError(f"{name} is a rotary axis: it has no table, the structure tells all", ("axes", name))
        if name not in structure.axes:
            raise SettingError(f"there is no axis {name!r} in the structure {structure.code!r}", ("axes", name))
    for name in structure.axes:
        if name not in tables:
            raise SettingError(
                f"is missing: the structure {structure.code!r} has an axis {name}; write a table [axes.{name}] "
                "with its travel",
                ("axes", name),
            )
    axes = tuple(_axis(name, tables[name]) for name in structure.axes)
    for axis in axes:
        if "measured_at" in tables[axis.name]:
            _check_measured_at(axis, axes)
    spindle, components = given.pop("spindle", {}), given.pop("components", {})
    reader = _Sources(source.parent, {a.name: a for a in axes})
    machine = Machine(
        **given,
        axes=axes,
        spindle_tool=spindle.get("measured_tool", (0.0, 0.0, 0.0)),
        components={code: reader.read(code, value) for code, value in components.items()},
    )
    for code in machine.components:
        _check_counted(BY_CODE[code], tables, spindle)
    return machine


def _axis(name: str, table: Mapping[str, Any]) -> Axis:
    where: Keys = ("axes", name)
    if "travel" not in table:
        raise SettingError('is missing: write from where to where it goes, such as ["0 mm", "600 mm"]', where + _TRAVEL)
    try:
        return Axis(name, **table)
    except SettingError as e:
        raise SettingError(str(e), where + e.path) from e


def _check_measured_at(axis: Axis, axes: Sequence[Axis]) -> None:
    """Raise an error if one of the axes cannot have stood where it is said to."""
    for other in axes:
        if other is axis and axis.measured_on == "tool":
            continue
        (low, high), stood = other.travel, axis.measured_at["XYZ".index(other.name)]
        if not low <= stood <= high:
            raise SettingError(
                f"{other.name} {stood:g} mm: outside the travel of {other.name}, {low:g} to {high:g} mm",
                ("axes", axis.name, "measured_at"),
            )


def _check_counted(
    component: ErrorComponent, axes: Mapping[str, Mapping[str, Any]], spindle: Mapping[str, Any]
) -> None:
    """Raise an error if a component in urad is given, but not the place from which its lever counts."""
    if component.unit != "urad":
        return
    where: Keys = ("axes", component.axes[0]) if component.axes else ("spindle",)
    table = axes[component.axes[0]] if component.axes else spindle
    for key in _COUNTED_FROM[component.group]:
        if key not in table:
            told = f"{component.code} ({component.description}) is given"
            raise SettingError(f"is missing: {told}, so write {_PLACES[key]}", (*where, key))


class _Sources:
    """Reads what tells the values of components.

    Parameters
    ----------
    folder : Path
        Where the files of models are.
    axes : mapping of str to Axis
    """

    def __init__(self, folder: Path, axes: Mapping[str, Axis]) -> None:
        self.folder, self.axes = folder, axes
        self._files: dict[Path, Sequence[ErrorModel | PositionModel]] = {}

    def read(self, code: str, value: Any) -> Source:
        """Return what stands under ``components.CODE``."""
        where: Keys = ("components", code)
        if code not in BY_CODE:
            raise explain_unknown("component", code, BY_CODE, where)
        component = BY_CODE[code]
        for name in component.axes:
            if name not in self.axes:
                raise SettingError(f"{component.description}: the machine has no axis {name}", where)
        if not isinstance(value, dict):
            return float(_measure(_QUANTITY[component.unit])(value, where))
        table = _table(value, _COMPONENT, where)
        if ("model" in table) == ("profile" in table):
            raise SettingError('write either {model = "file.json"} or {profile = [["0 mm", "0 um"], ...]}', where)
        if "profile" in table:
            if "target" in table:
                raise SettingError("belongs to a model file, not to a profile", (*where, "target"))
            return self._profile(component, table["profile"], (*where, "profile"))
        return self._model(component, table["model"], table.get("target"), where)

    def _profile(self, component: ErrorComponent, rows: Sequence[Any], where: Keys) -> PositionModel:
        if component.depends_on is None:
            raise SettingError(f"{component.description} does not depend on a position: write one value", where)
        axis = self.axes[component.depends_on]
        length, error = _measure("position"), _measure(_QUANTITY[component.unit])
        points = []
        for row in rows:
            if not isinstance(row, list) or len(row) != 2:
                raise SettingError(
                    f'{row!r}: want position and error, such as ["300 mm", "1.5 {component.unit}"]', where
                )
            points.append((length(row[0], where), error(row[1], where)))
        if len(points) < 2:
            raise SettingError(f"has {len(points)} points: want at least two", where)
        for (before, _), (p, _) in pairwise(points):
            if not p > before:
                raise SettingError(f"{p:g} mm stands behind {before:g} mm: positions must rise", where)
        pieces = tuple((a, b - a, 0.0, 0.0) for (_, a), (_, b) in pairwise(points))
        return PositionModel(
            target=component.code,
            unit=component.unit,
            axis=axis.name,
            travel=axis.travel,
            reference_position=axis.reference_position,
            profile=SplineProfile(axis=axis.name, knots=tuple(p for p, _ in points), pieces=pieces),
        )

    def _model(self, component: ErrorComponent, name: str, target: str | None, where: Keys) -> Source:
        here = (*where, "model")
        path = self.folder / name
        if path not in self._files:
            try:
                self._files[path] = _open(path)
            except InputError as e:
                raise SettingError(str(e), here) from e
        models = {m.target: m for m in self._files[path]}
        if target is not None and target not in models:
            raise explain_unknown(f"model in {path} of", target, models, (*where, "target"))
        wanted = target or (component.code if component.code in models else None)
        if wanted is None and len(models) > 1:
            raise SettingError(f"{path} holds models of {', '.join(models)}: say which by target", where)
        model = models[wanted] if wanted is not None else next(iter(models.values()))
        if target is None and model.target in BY_CODE and model.target != component.code:
            raise SettingError(f"{path} holds a model of {model.target}, not of {component.code}", here)
        for part in model.models if isinstance(model, PositionModel) else (model,):
            try:
                if part.honest_error is not None:  # what was never judged is shown as such, and runs nowhere
                    part.check_may_run()
            except InputError as e:
                raise SettingError(f"{path}: {e}; fit a better one, or leave {component.code} out", here) from e
        return model


def _open(path: Path) -> Sequence[ErrorModel | PositionModel]:
    """Read models of time, or of time and position."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        content = None  # the reader of model files tells what is wrong
    if isinstance(content, dict) and content.get("format") == jsonfile.POSITION_MODELS.name:
        return positionfile.read(path)
    return modelfile.read(path)


def _table(value: Any, known: Mapping[str, Convert], where: Keys) -> dict[str, Any]:
    """Return a table in house units."""
    if not isinstance(value, dict):
        raise SettingError(f"{value!r}: must be a table", where)
    found = {}
    for key, inner in value.items():
        if key not in known:
            raise explain_unknown("key", key, known, (*where, key))
        found[key] = known[key](inner, (*where, key))
    return found


def _measure(quantity: str) -> Convert:
    """Return what reads a text with a number and a unit."""
    what, example = _SAID[quantity]

    def convert(value: Any, where: Keys) -> float:
        try:
            number = read_with_unit(value, quantity)
        except UnitError as e:
            raise SettingError(f'"{value}": {e}', where) from e
        if number is None:
            shown = json.dumps(value) if isinstance(value, str | float | int) else repr(value)
            raise SettingError(
                f'{shown}: write a{"n" * (what[0] in "a")} {what} with its unit, such as "{example}"', where
            )
        return number

    return convert


def _several(convert: Convert, n: int, example: str) -> Convert:
    """Return what reads a list of n values."""

    def converted(value: Any, where: Keys) -> tuple[Any, ...]:
        if not isinstance(value, list) or len(value) != n:
            raise SettingError(f"{value!r}: write {n} values, such as {example}", where)
        return tuple(convert(v, where) for v in value)

    return converted


def _text(value: Any, where: Keys) -> str:
    if not isinstance(value, str) or not value:
        raise SettingError(f"{value!r}: must be a text in quotes", where)
    return value


def _structure(value: Any, where: Keys) -> Structure:
    try:
        return Structure.parse(_text(value, where))
    except SettingError as e:
        raise SettingError(str(e), where) from e


def _rows(value: Any, where: Keys) -> list[Any]:
    if not isinstance(value, list):
        raise SettingError('must be a list of points, such as [["0 mm", "0 um"], ["600 mm", "2 um"]]', where)
    return value


def _same(value: Any, where: Keys) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise SettingError(f"{value!r}: must be a table", where)
    return value


def _axes(value: Any, where: Keys) -> dict[str, Any]:
    return {name: _table(inner, _AXIS, (*where, name)) for name, inner in _same(value, where).items()}


_TRAVEL: Keys = ("travel",)
_LENGTH = _measure("position")
_VECTOR = _several(_LENGTH, 3, '["0 mm", "0 mm", "-150 mm"]')
_AXIS: dict[str, Convert] = {
    "travel": _several(_LENGTH, 2, '["0 mm", "600 mm"]'),
    "reference_position": _LENGTH,
    "measured_at": _VECTOR,
    "measured_tool": _VECTOR,
    "measured_on": _text,
    "rapid": _measure("feed"),
    "acceleration": _measure("acceleration"),
}
#: keys that say from where the lever of a component in urad counts
_COUNTED_FROM = {
    "axis": ("measured_at", "measured_tool"),
    "squareness": ("reference_position",),
    "spindle": ("measured_tool",),
}
_PLACES = {
    "measured_at": "where X, Y and Z stood while it was measured",
    "measured_tool": "the way from the gauge point to where the translations were measured",
    "reference_position": "the position at which it moves nothing",
}
_COMPONENT: dict[str, Convert] = {"model": _text, "target": _text, "profile": _rows}
_MACHINE: dict[str, Convert] = {
    "name": _text,
    "structure": _structure,
    "reference_temperature": _measure("temperature"),
    "tool": _VECTOR,
    "axes": _axes,
    "spindle": lambda value, where: _table(value, {"measured_tool": _VECTOR}, where),
    "components": _same,
}
