"""Machine files: axes, lengths and the known error components, as TOML; see :doc:`/machine_file`."""

import re
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

from thermocomp.core.components import BY_CODE, ErrorComponent
from thermocomp.core.exceptions import InputError, SettingError, explain_unknown
from thermocomp.core.machine import Axis, Machine, Source
from thermocomp.core.model import ErrorModel
from thermocomp.core.position import PositionModel
from thermocomp.core.profile import SplineProfile
from thermocomp.core.shown import replace_unprintable
from thermocomp.core.structure import Structure
from thermocomp.files import jsonfile, modelfile, positionfile
from thermocomp.files.machinekeys import (
    COMPONENT,
    COUNTED_FROM,
    MACHINE,
    PLACES,
    QUANTITY,
    TRAVEL,
    Keys,
    ManyError,
    each,
    kept,
    measure,
    read_table,
)
from thermocomp.files.plaintext import list_errors
from thermocomp.files.tomlfile import read_toml


def read_machine(path: str | Path) -> Machine:
    """Read a machine file (TOML).

    Every value with a dimension is text with a unit; a bare number is rejected. Model files are looked up next to the
    machine file. A model that was refused when it was judged is also rejected here.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    Machine

    Raises
    ------
    InputError
        The file does not exist, is not TOML, has an invalid key or value, or refers to an axis or component that does
        not exist, or to an unusable model file; the message names the file and the key path of every fault.

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
        told = []
        for error in e.errors if isinstance(e, ManyError) else [e]:
            keys = ".".join(replace_unprintable(key) for key in error.path)
            told.append(": ".join(part for part in (keys, str(error)) if part))
        raise InputError(list_errors(source, told)) from e


def _machine(content: dict[str, Any], source: Path) -> Machine:
    errors: list[SettingError] = []
    try:
        given = read_table(content, MACHINE, ())
    except ManyError as e:
        given, errors = e.found, e.errors
    if "structure" not in given:
        if "structure" not in content:
            missing = 'is missing: write the axes from the workpiece to the tool, such as "XFZY"'
            errors.append(SettingError(missing, ("structure",)))
        raise ManyError(errors, given)
    structure: Structure = given["structure"]
    tables = given.pop("axes", {})
    wrong = {e.path[1] for e in errors if len(e.path) > 1 and e.path[0] == "axes"}
    axes: list[Axis] = []
    for name in [*structure.axes, *(n for n in tables if n not in structure.axes)]:
        if name not in wrong:
            with kept(errors):
                axes.append(_axis(str(name), tables, structure))
    for axis in axes:
        if "measured_at" in tables[axis.name]:
            with kept(errors):
                _check_measured_at(axis, axes)
    spindle, given_components = given.pop("spindle", {}), given.pop("components", {})
    reader = _Sources(source.parent, structure, {a.name: a for a in axes})
    components: dict[str, Source] = {}
    with kept(errors):
        components = each(given_components, reader.read)
    if errors:
        raise ManyError(errors, given)
    with kept(errors):
        given.setdefault("name", source.stem)
        tool = spindle.get("measured_tool", (0.0, 0.0, 0.0))
        machine = Machine(**given, axes=tuple(axes), spindle_tool=tool, components=components)
    for code in components:
        with kept(errors):
            _check_counted(BY_CODE[code], tables, spindle)
    if errors:
        raise ManyError(errors, given)
    return machine


def _axis(name: str, tables: Mapping[str, Any], structure: Structure) -> Axis:
    where: Keys = ("axes", name)
    if name in structure.rotary:
        raise SettingError(f"{name} is a rotary axis, which the structure defines completely: remove its table", where)
    if name not in structure.axes:
        raise SettingError(f"there is no axis {name!r} in the structure {structure.code!r}", where)
    if name not in tables:
        raise SettingError(
            f"is missing: the structure {structure.code!r} has an axis {name}; write a table [axes.{name}] "
            "with its travel",
            where,
        )
    table = tables[name]
    if "travel" not in table:
        raise SettingError('is missing: write its lower and upper limit, such as ["0 mm", "600 mm"]', where + TRAVEL)
    try:
        return Axis(name, **table)
    except SettingError as e:
        raise SettingError(str(e), where + e.path) from e


def _check_measured_at(axis: Axis, axes: Sequence[Axis]) -> None:
    """Raise an error if one of the axes cannot have been at its specified position."""
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
    """Raise an error if a component in urad is given, but not the point from which its lever is measured."""
    if component.unit != "urad":
        return
    where: Keys = ("axes", component.axes[0]) if component.axes else ("spindle",)
    table = axes[component.axes[0]] if component.axes else spindle
    for key in COUNTED_FROM[component.group]:
        if key not in table:
            told = f"{component.code} ({component.description}) is given"
            raise SettingError(f"is missing: {told}, so write {PLACES[key]}", (*where, key))


class _Sources:
    """Reader of the sources of the components' values.

    Parameters
    ----------
    folder : Path
        Folder of the model files.
    axes : mapping of str to Axis
        Axes of the structure that could be read.
    """

    def __init__(self, folder: Path, structure: Structure, axes: Mapping[str, Axis]) -> None:
        self.folder, self.structure, self.axes = folder, structure, axes
        self._files: dict[Path, Sequence[ErrorModel | PositionModel]] = {}

    def read(self, code: str, value: Any) -> Source:
        """Return the source specified by ``components.CODE``."""
        where: Keys = ("components", code)
        if code not in BY_CODE:
            raise explain_unknown("component", code, BY_CODE, where)
        component = BY_CODE[code]
        for name in component.axes:
            if name not in self.structure.axes:
                raise SettingError(f"{component.description}: the machine has no axis {name}", where)
        if not isinstance(value, dict):
            return float(measure(QUANTITY[component.unit])(value, where))
        table = read_table(value, COMPONENT, where)
        if ("model" in table) == ("profile" in table):
            raise SettingError('write either {model = "file.json"} or {profile = [["0 mm", "0 um"], ...]}', where)
        if "profile" in table:
            if "target" in table:
                raise SettingError("belongs to a model file, not to a profile", (*where, "target"))
            return self._profile(component, table["profile"], (*where, "profile"))
        return self._model(component, table["model"], table.get("target"), where)

    def _profile(self, component: ErrorComponent, rows: Sequence[Any], where: Keys) -> Source:
        if component.depends_on is None:
            raise SettingError(f"{component.description} does not depend on a position: write one value", where)
        axis = self.axes.get(component.depends_on)
        length, error = measure("position"), measure(QUANTITY[component.unit])
        points = []
        for row in rows:
            if not isinstance(row, list) or len(row) != 2:
                raise SettingError(
                    f'{row!r}: expected position and error, such as ["300 mm", "1.5 {component.unit}"]', where
                )
            points.append((length(row[0], where), error(row[1], where)))
        if len(points) < 2:
            raise SettingError(f"has {len(points)} points: expected at least two", where)
        for (before, _), (p, _) in pairwise(points):
            if not p > before:
                raise SettingError(f"{p:g} mm follows {before:g} mm: positions must increase", where)
        pieces = tuple((a, b - a, 0.0, 0.0) for (_, a), (_, b) in pairwise(points))
        if axis is None:
            return 0.0  # the fault of the axis is reported separately
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
                self._files[path] = read_models(path)
            except InputError as e:
                raise SettingError(str(e), here) from e
        models = {m.target: m for m in self._files[path]}
        if target is not None and target not in models:
            raise explain_unknown(f"model in {path} of", target, models, (*where, "target"))
        wanted = target or (component.code if component.code in models else None)
        if wanted is None and len(models) > 1:
            raise SettingError(f"{path} holds models of {', '.join(models)}: select one with target", where)
        model = models[wanted] if wanted is not None else next(iter(models.values()))
        if target is None and model.target in BY_CODE and model.target != component.code:
            raise SettingError(f"{path} holds a model of {model.target}, not of {component.code}", here)
        for part in model.models if isinstance(model, PositionModel) else (model,):
            try:
                if part.honest_error is not None:  # a model that was never judged is shown as such and never runs
                    part.check_may_run()
            except InputError as e:
                raise SettingError(f"{path}: {e}; fit a better model, or leave {component.code} out", here) from e
        return model


def read_models(path: Path) -> Sequence[ErrorModel | PositionModel]:
    """Read models of time, or of time and position.

    Parameters
    ----------
    path : Path

    Raises
    ------
    ModelFileError
        The file contains neither.
    """
    text, source = jsonfile.read(jsonfile.MODELS, path)
    if re.search(rf'"format"\s*:\s*"{jsonfile.POSITION_MODELS.name}"', text):
        return positionfile.loads(text, source)
    return modelfile.loads(text, source)
