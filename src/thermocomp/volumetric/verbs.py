"""Python functions for the errors along the axes and in the work volume."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd

from thermocomp.api.base import Paged
from thermocomp.api.inputs import judging_of, recordings_of, trouble_of
from thermocomp.api.keywords import Listener, settings_of, silent
from thermocomp.core.exceptions import InputError
from thermocomp.core.machine import Machine
from thermocomp.core.position import PositionModel
from thermocomp.files import positionfile
from thermocomp.files.machines import read_machine
from thermocomp.models.methods import find_method
from thermocomp.recordings.profiles import ProfileOptions, Profiles
from thermocomp.recordings.readers import mapping as mappings
from thermocomp.recordings.readers import profiles as tables
from thermocomp.recordings.readers.mapping import Mapping
from thermocomp.recordings.recording import Recording
from thermocomp.volumetric.judging import position as assessing
from thermocomp.volumetric.judging.position import PositionStudy
from thermocomp.volumetric.judging.volumetric import Volumetric, study
from thermocomp.volumetric.models.position import PositionOptions
from thermocomp.volumetric.models.positionoptions import Setting
from thermocomp.volumetric.positionsettings import PositionSettings
from thermocomp.volumetric.report import records, volumetric_tables

#: denotes all components with separate columns
ALL = "all"
#: default number of points along each axis
GRID = 5


@dataclass(frozen=True, eq=False)
class Positioned:
    """Fitted and judged error components of a machine.

    Parameters
    ----------
    found : sequence of PositionStudy
    tests : list of tuple of Profiles
        Profiles of each component.
    left_open : tuple of str
        Settings determined from the profiles.
    several : bool
        Whether several components, or all, were requested.
    trouble : tuple of str
        Data-quality problems of the recordings.
    accept_unproven : str, optional
        Person who approves the use of unproven models, and the reason.
    """

    found: Sequence[PositionStudy]
    tests: list[tuple[Profiles, ...]]
    left_open: tuple[Setting, ...]
    several: bool
    trouble: tuple[str, ...] = ()
    accept_unproven: str | None = None

    @property
    def models(self) -> tuple[PositionModel, ...]:
        """Position models, one per fitted component."""
        return tuple(f.fit.model.taken(self.accept_unproven) for f in self.found)

    def to_dict(self) -> dict[str, Any]:
        """Return all results as a dict, as printed by ``--json``; several components are in a list."""
        entries = [records.position(f, self.left_open) for f in self.found]
        return {
            "trouble": self.trouble,
            "judging": self.found[0].assessment.protocol,
            **({"components": entries} if self.several else entries[0]),
        }

    def save(self, path: str | Path, *, overwrite: bool = False) -> Path:
        """Write the models to a file; return its path."""
        positionfile.write(self.models, Path(path), overwrite=overwrite)
        return Path(path)


def position(
    recordings: str | Path | Sequence[str | Path],
    component: str | Sequence[str],
    *,
    accept_unproven: str | None = None,
    progress: Callable[..., None] = silent,
    **settings: Any,
) -> Positioned:
    """Fit position-dependent errors: cold profiles and thermal slopes, judged on unseen data.

    Settings that are not given are determined from the profiles, and again in each fold without the left-out data: the
    useful number of slopes, whether the profile shifts as a whole, and the position about which it tilts.

    Parameters
    ----------
    recordings : path, or sequence of them
        CSV, XLSX or Parquet files with profiles in several thermal states; each one is a separate test.
    component : str or sequence of str
        Codes of the error components, such as EYY, EXX or EAZ, or "all" for those that have separate columns. A code
        defines axis and unit. The models of all components are saved in one file.
    accept_unproven : str, optional
        As for `fit`.
    progress : callable
        Called with a line of text after each task.
    **settings
        Settings of the fit, see `thermocomp.volumetric.positionsettings.PositionSettings`: ``model="ols"``,
        ``slopes=1``.

    Returns
    -------
    Positioned

    Raises
    ------
    InputError
        A file, component or setting is invalid, the method cannot be frozen, or settings exclude each other.

    Examples
    --------
    >>> import numpy as np
    >>> import pandas as pd
    >>> import thermocomp as tc
    >>> heat = np.tile([0.0, 2.0, 4.0, 6.0], 4)  # four days, each from the cold machine
    >>> table = pd.DataFrame({"time_s": 3600.0 * np.arange(16), "cycle": np.arange(16) // 4, "t1_C": 20 + heat})
    >>> for place in range(0, 600, 100):  # a ball screw that grows by 12 um/m per degC
    ...     table[f"EXX_{place}_um"] = 12e-3 * heat * place
    >>> table.to_csv("laser.csv", index=False)
    >>> found = tc.position("laser.csv", "EXX", model="ols", inputs=["t1_C"], jobs=1)
    >>> (slope,) = found.models[0].slopes
    >>> slope.formula()  # um/m
    '12 t1_C'
    >>> found.save("screw.json").name
    'screw.json'
    """
    s = settings_of(PositionSettings, settings, "position")
    files = [Path(p) for p in ([recordings] if isinstance(recordings, str | Path) else recordings)]
    if not files:
        raise InputError("no recording given: name at least one CSV, XLSX or Parquet file")
    if s.jobs == 0:
        raise InputError("--jobs 0: give a number of processes, or -1 for all cores")
    if not find_method(s.model).kind.freezable:
        raise InputError(f"{s.model} cannot be stored as coefficients: choose another method")
    components = [component] if isinstance(component, str) else list(component)
    tests = _read(files, components, s)
    options = PositionOptions(
        method=s.model,
        inputs=s.inputs,
        slopes=1 if s.slopes is None else s.slopes,
        offset=bool(s.offset),
        profile=s.profile,
        order="auto" if s.order is None else s.order,
        reference=s.reference or 0,
        reference_position=s.reference_position,
        rezero=not s.absolute,
    )
    given: dict[Setting, object] = {
        "slopes": s.slopes,
        "offset": s.offset,
        "reference_position": s.reference_position,
    }
    left_open = tuple(name for name, value in given.items() if value is None)
    judging = partial(judging_of, split=s.split, leave_one=s.left_out(len(files)))
    states = [test.states for test in tests[0]]
    for r in states:
        progress(f"read {r.source or r.name}: {len(r)} rows, {len(r.table.columns)} columns", 0)
    listener, trouble = Listener(progress), trouble_of(states)
    listener.warn(trouble)
    listener.begin(lambda: assessing.n_pieces(tests, options, judging))
    found = assessing.study_all(tests, options, left_open=left_open, judging=judging, jobs=s.jobs, progress=progress)
    return Positioned(
        found=found,
        tests=tests,
        left_open=left_open,
        several=_several(components),
        trouble=tuple(trouble),
        accept_unproven=accept_unproven,
    )


@dataclass(frozen=True, eq=False)
class VolumetricErrors(Paged):
    """Errors of a machine in its work volume.

    Parameters
    ----------
    study : Volumetric
    point, volume : bool
        Whether the errors at a point, and in the volume, were requested.
    trouble : tuple of str
        Data-quality problems of the recording.
    """

    study: Volumetric
    point: bool
    volume: bool
    trouble: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return all results as a dict, as printed by ``--json``."""
        return {"trouble": self.trouble, **volumetric_tables.content(self.study)}

    def page(self) -> str:
        """Return the page that ``thermocomp volumetric -o`` writes."""
        from thermocomp.volumetric.report import volumetric as pages

        return pages.render(self.study)


def volumetric(
    machine: Machine | str | Path,
    *,
    recording: Recording | str | Path | pd.DataFrame | None = None,
    mapping: str | Path | Mapping | None = None,
    at: tuple[float, float, float] | None = None,
    grid: int | None = None,
    tool_length: float | None = None,
    time: Sequence[float] | None = None,
    progress: Callable[..., None] = silent,
) -> VolumetricErrors:
    r"""Compute the error of the tool tip at a point and in the work volume, before and after correction.

    With neither a point nor a grid, both are evaluated: at mid-travel and on 5 points along each axis.

    Parameters
    ----------
    machine : Machine, str or Path
        Machine file (.toml): axes, and the known error components (of 32).
    recording : Recording, path or DataFrame, optional
        CSV, XLSX or Parquet file to replay through the models of the machine. Default: the machine in its reference
        state, with its constants and profiles only.
    mapping : str, Path or Mapping, optional
        TOML mapping file: role and unit of each column of the recording.
    at : tuple of float, optional
        Axis positions X Y Z of the point [mm] at which error, tilt and contributions are computed. The straight lines
        by which a controller corrects pass through this point.
    grid : int, optional
        Number of grid points along each axis at which the errors in the volume are computed, before and after
        correction.
    tool_length : float, optional
        Tool length from the gauge point to the tip, along -Z [mm]. Default: the tool of the machine file.
    time : sequence of float, optional
        Times to evaluate [h]. Default: start, largest error and end of the recording.
    progress : callable
        Called with a line of text and the number of rows replayed.

    Returns
    -------
    VolumetricErrors

    Raises
    ------
    InputError
        A file, a point or a time is invalid.

    Examples
    --------
    >>> from pathlib import Path
    >>> import thermocomp as tc
    >>> lines = ['name = "Mill"', 'structure = "w X\' b Z Y t"', "[components]", 'C0Y = "10 urad"']
    >>> for axis, travel in (("X", 600), ("Y", 400), ("Z", 500)):
    ...     lines.insert(2, f'[axes.{axis}]\ntravel = ["0 mm", "{travel} mm"]\nreference_position = "0 mm"')
    >>> _ = Path("mill.toml").write_text("\n".join(lines))
    >>> found = tc.volumetric("mill.toml", at=(0, 100, 0))
    >>> found.to_dict()["states"][0]["error_um"]  # 10 urad over 100 mm
    [-1.0, 0.0, 0.0]
    """
    if tool_length is not None and not tool_length >= 0:
        raise InputError(f"--tool-length {tool_length:g}: must not be negative")
    if recording is None and mapping is not None:
        raise InputError("--mapping applies to a recording: name one with --recording")
    if not isinstance(machine, Machine):
        source, machine = machine, read_machine(machine)
        progress(f"read {source}: {len(machine.axes)} axes, {len(machine.components)} components", 0)
    tests = recordings_of(recording, mapping) if recording is not None else []
    listener, trouble = Listener(progress), trouble_of(tests)
    listener.warn(trouble)
    listener.begin(lambda: len(tests[0]) if tests else 1)
    found = study(
        machine,
        tests[0] if tests else None,
        at=at,
        grid=GRID if grid is None else grid,
        tool=None if tool_length is None else (0.0, 0.0, -tool_length),
        hours=time or (),
        progress=progress,
    )
    return VolumetricErrors(
        found, point=at is not None or grid is None, volume=grid is not None or at is None, trouble=tuple(trouble)
    )


def _several(component: Sequence[str]) -> bool:
    return len(component) > 1 or ALL in component


def _read(paths: Sequence[Path], components: Sequence[str], s: PositionSettings) -> list[tuple[Profiles, ...]]:
    """Read the profile of one component from columns of any name, or of several from columns named after them."""
    given = mappings.read_mapping(s.mapping) if s.mapping is not None else None
    if _several(components):
        if s.columns or s.positions is not None or s.layout == "long":
            raise InputError(
                "--columns, --positions and long tables are for one component: name a single one, or name the columns "
                "after their components, such as EXX_250_um"
            )
        wanted = [] if ALL in components else list(dict.fromkeys(components))
        return list(tables.read_components(paths, wanted, given).values())
    places = tables.read_places(s.positions) if s.positions is not None else None
    options = ProfileOptions(target=components[0], columns=s.columns, places=places)
    return [tuple(tables.read(path, options, given, layout=s.layout) for path in paths)]
