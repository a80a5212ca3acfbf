"""Position-dependent errors in Python: profiles in several thermal states become models, judged on unseen ones."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from thermocomp.api.inputs import judging_of
from thermocomp.core.exceptions import InputError
from thermocomp.files import positionfile
from thermocomp.judging.splits import Judging
from thermocomp.models.methods import find_method
from thermocomp.recordings.profiles import Profiles
from thermocomp.recordings.readers import mapping as mappings
from thermocomp.recordings.readers import profiles as tables
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples
from thermocomp.volumetric.judging import position as assessing
from thermocomp.volumetric.judging.position import PositionStudy
from thermocomp.volumetric.models.position import PositionOptions
from thermocomp.volumetric.models.positionoptions import Setting
from thermocomp.volumetric.positionsettings import PositionSettings
from thermocomp.volumetric.report import records

#: stands for every component that has columns of its own
ALL = "all"


@dataclass(frozen=True, eq=False)
class Positioned:
    """Components of a machine, fitted and judged.

    Parameters
    ----------
    found : sequence of PositionStudy
    tests : list of tuple of Profiles
        Of each component.
    left_open : tuple of str
        Settings that were found out from the profiles.
    several : bool
        Several components were asked for, or all that there are.
    """

    found: Sequence[PositionStudy]
    tests: list[tuple[Profiles, ...]]
    left_open: tuple[Setting, ...]
    several: bool

    def content(self) -> dict[str, Any]:
        """Return all of it as plain numbers and words; several components stand in a list."""
        entries = [records.position(f, self.left_open) for f in self.found]
        return {
            "judging": self.found[0].assessment.protocol,
            **({"components": entries} if self.several else entries[0]),
        }

    def save(self, path: str | Path, *, accept_unproven: str | None = None, overwrite: bool = False) -> Path:
        """Write the models to a file; return its path.

        Parameters
        ----------
        path : str or Path
        accept_unproven : str, optional
            Who takes unproven models all the same, and why.
        overwrite : bool
        """
        positionfile.write([f.fit.model.taken(accept_unproven) for f in self.found], Path(path), overwrite=overwrite)
        return Path(path)


@dataclass(frozen=True, eq=False)
class PositionJob:
    """All that fitting begins with.

    Parameters
    ----------
    tests : list of tuple of Profiles
        Of each component.
    options : PositionOptions
    left_open : tuple of str
    several : bool
    judging : callable
        Samples become what is learned from and what is judged.
    jobs : int
    """

    tests: list[tuple[Profiles, ...]]
    options: PositionOptions
    left_open: tuple[Setting, ...]
    several: bool
    judging: Callable[[Samples], Judging]
    jobs: int

    @property
    def recordings(self) -> list[Recording]:
        """What was read, profiles and all."""
        return [test.states for test in self.tests[0]]

    @property
    def n_pieces(self) -> int:
        """Steps that `run` tells of."""
        return assessing.n_pieces(self.tests, self.options, self.judging)

    def run(self, progress: Callable[[str], None] = lambda _: None) -> Positioned:
        """Fit and judge all components."""
        found = assessing.study_all(
            self.tests,
            self.options,
            left_open=self.left_open,
            judging=self.judging,
            jobs=self.jobs,
            progress=progress,
        )
        return Positioned(found, self.tests, self.left_open, self.several)


def prepare(
    recordings: Sequence[Path], component: Sequence[str], settings: PositionSettings | None = None
) -> PositionJob:
    """Read profiles, and return what is to be fitted to them: ``prepare(...).run()``.

    Parameters
    ----------
    recordings : sequence of Path
        Files with profiles in several thermal states; each is one test.
    component : sequence of str
        Codes of the errors, such as EYY, or all.
    settings : PositionSettings, optional

    Returns
    -------
    PositionJob

    Raises
    ------
    InputError
        The method cannot be frozen, or settings do not go together.
    """
    s = settings or PositionSettings()
    if not find_method(s.model).kind.freezable:
        raise InputError(f"{s.model} cannot be frozen to plain numbers: choose another method")
    tests = _read(recordings, component, s)
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
    judging = partial(judging_of, split=s.split, leave_one=s.left_out(len(recordings)))
    return PositionJob(
        tests=tests, options=options, left_open=left_open, several=_several(component), judging=judging, jobs=s.jobs
    )


def _several(component: Sequence[str]) -> bool:
    return len(component) > 1 or ALL in component


def _read(paths: Sequence[Path], components: Sequence[str], s: PositionSettings) -> list[tuple[Profiles, ...]]:
    """Read one component, however its columns are called, or several by columns that are called after them."""
    given = mappings.read_mapping(s.mapping) if s.mapping is not None else None
    if _several(components):
        if s.columns or s.positions is not None or s.layout == "long":
            raise InputError(
                "--columns, --positions and long tables are for one component: name a single one, or call the columns "
                "after their components, such as EXX_250_um"
            )
        wanted = [] if ALL in components else list(dict.fromkeys(components))
        return list(tables.read_components(paths, wanted, given).values())
    places = tables.read_places(s.positions) if s.positions is not None else None
    options = tables.ProfileOptions(target=components[0], columns=s.columns, places=places)
    return [tuple(tables.read(path, options, given, layout=s.layout) for path in paths)]
