"""Projects: a folder with ``project.toml``, its recordings and mappings, and the results of each run."""

import inspect
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, fields, make_dataclass
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, TypeAdapter, ValidationError

from thermocomp import __version__
from thermocomp.api.plan import EVERY, plan
from thermocomp.api.select import SelectionMethod, SelectionSettings
from thermocomp.api.testprogram import Dialect
from thermocomp.api.verbs import compare
from thermocomp.app.runfolder import LEARNED
from thermocomp.app.store import NAME, find_inside
from thermocomp.core.correction import Limits
from thermocomp.core.exceptions import InputError
from thermocomp.export.reduction.options import ReductionOptions
from thermocomp.files.plaintext import find_keys, list_errors, strict_adapter
from thermocomp.files.tomlfile import as_json, read_toml

#: parameters that a project gives elsewhere, and those that other commands take from the table ``[compare]``
_ELSEWHERE = ("recordings", "mapping", "starts", "limits", "scheduler", "progress")
COMMON = ("targets", "inputs", "split", "leave_one", "absolute", "zero_over", "jobs")
#: part of a whole
Fraction = Annotated[float, Field(ge=0.0, le=1.0)]


@dataclass(frozen=True, kw_only=True)
class ProjectRecording:
    """A recording of a project.

    Parameters
    ----------
    file, mapping : str
        Paths relative to the project's folder; the mapping may be empty.
    """

    file: str
    mapping: str = ""


@dataclass(frozen=True, kw_only=True)
class JoinOptions:
    """Table ``[join]``: the recordings are those of several loggers in the same hours, see `thermocomp.join`.

    Parameters
    ----------
    offset : tuple of float
        Seconds by which the clock of each recording after the first is ahead; empty: as estimated.
    """

    offset: tuple[float, ...] = ()


@dataclass(frozen=True, kw_only=True)
class FitOptions:
    """Table ``[fit]``: see `thermocomp.api.results.Compared.fit`.

    Parameters
    ----------
    model : mapping of str to str
        Methods written instead of the recommended ones, by target.
    accept_unproven : str
        Person who approves the use of unproven models, and the reason.
    """

    model: Mapping[str, str] = field(default_factory=dict)
    accept_unproven: str = ""


@dataclass(frozen=True, kw_only=True)
class ExportOptions(ReductionOptions):
    """Table ``[export]``: see `thermocomp.export`.

    Parameters
    ----------
    to : str
        Output format.
    name, dialect : str
        Name of the files; dialect of structured text.
    """

    to: str
    name: str = "thermal"
    dialect: str = ""


@dataclass(frozen=True, kw_only=True)
class MachineSketch:
    """Table ``[sketch]``: where the sensors are, on a sketch of the machine; results do not depend on it.

    Parameters
    ----------
    machine : {'mill', 'lathe', 'five-axis', 'printer'}
    places : mapping of str to tuple of float
        Place of each sensor, from the left and from the top, as fractions of the sketch.
    """

    machine: Literal["mill", "lathe", "five-axis", "printer"] = "mill"
    places: Mapping[str, tuple[Fraction, Fraction]] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class SelectOptions(SelectionSettings):
    """Table ``[select]``: see `thermocomp.select`.

    Parameters
    ----------
    method : str
        Selection method.
    """

    method: SelectionMethod = "pareto"


def _options_of(verb: Callable[..., object], leave: Collection[str], **more: tuple[Any, Any]) -> type:
    """Return the type of a table: the keywords of a command without some, and `more`, with their defaults."""
    parameters = inspect.signature(verb).parameters
    taken = {n: (p.annotation, p.default) for n, p in parameters.items() if n not in leave} | more
    types = [(n, kind, field(default=default)) for n, (kind, default) in taken.items()]
    return make_dataclass(f"{verb.__name__.title()}Options", types, frozen=True, kw_only=True)


CompareOptions: Any = _options_of(compare, _ELSEWHERE)
PlanOptions: Any = _options_of(plan, {*_ELSEWHERE, *COMMON}, dialect=(Dialect, "linuxcnc"), probe_every=(float, EVERY))


@dataclass(frozen=True, kw_only=True)
class ProjectSettings:
    """Content of ``project.toml``.

    Parameters
    ----------
    name : str
        Name of the project, for its page.
    language : {'en', 'de'}
        Language of the page and the reports. Default: that of the browser, and of the environment.
    recordings : tuple of ProjectRecording
        Recordings to learn from.
    compare : CompareOptions
        Keywords of `thermocomp.compare`.
    limits : Limits
        Limits of the corrections, applied while the models are judged, and of the exported code.
    select : SelectOptions, optional
        Default: sensors are not selected.
    plan : PlanOptions, optional
        Keywords of `thermocomp.plan`, and of its NC program. Default: no test is planned.
    sketch : MachineSketch, optional
        Places of the sensors.
    export : ExportOptions, optional
        Default: nothing is exported.
    assess : tuple of ProjectRecording
        Recordings on which the fitted model is assessed.
    """

    name: str = ""
    language: Literal["", "en", "de"] = ""
    recordings: tuple[ProjectRecording, ...] = ()
    join: JoinOptions | None = None
    compare: CompareOptions = field(default_factory=CompareOptions)
    limits: Limits = Limits()
    fit: FitOptions = FitOptions()
    select: SelectOptions | None = None
    plan: PlanOptions | None = None
    sketch: MachineSketch | None = None
    export: ExportOptions | None = None
    assess: tuple[ProjectRecording, ...] = ()


@cache
def _adapter() -> TypeAdapter[ProjectSettings]:
    return strict_adapter(ProjectSettings)


def settings_of(content: Mapping[str, Any], source: str | Path) -> ProjectSettings:
    """Return validated settings.

    Parameters
    ----------
    content : mapping
        Content of a TOML file.
    source : str or Path
        Name of the file, for messages.

    Raises
    ------
    InputError
        A key is unknown or a value has the wrong type; all errors are listed.
    """
    try:
        return _adapter().validate_json(as_json(dict(content)))
    except ValidationError as e:
        told = []
        for error in e.errors(include_url=False):
            last = error["loc"][-1] if error["loc"] else ""  # a text with half a character has no place
            keys = ".".join(map(str, find_keys(error["loc"], content)))
            match error["type"]:
                case "unexpected_keyword_argument" | "extra_forbidden":
                    told.append(f"{keys}: this key does not exist")
                case "missing" | "missing_argument":
                    told.append(f"{f'{keys}.' if keys else ''}{last}: this key is missing")
                case _:
                    told.append(f"{keys} = {error['input']!r:.60}: {error['msg']}")
        raise InputError(list_errors(source, told)) from e


class Project:
    """A project: its folder and its settings.

    Parameters
    ----------
    path : Path
        The folder, or its ``project.toml``.

    Raises
    ------
    InputError
        The settings cannot be read.
    """

    def __init__(self, path: str | Path) -> None:
        given = Path(path)
        self.file = given / NAME if given.is_dir() else given
        self.folder = self.file.parent
        self.content = read_toml(self.file, "project file")
        self.settings = settings_of(self.content, self.file)

    def path(self, name: str) -> Path:
        """Return the path of a file named in the settings.

        Raises
        ------
        InputError
            The file is not in the project's folder: a project that is copied must stay whole.
        """
        try:
            return find_inside(self.folder, name)
        except InputError as e:
            raise InputError(f"{self.file}: {e}") from e

    def key_of(self, tables: Sequence[str], recordings: Sequence[ProjectRecording]) -> str:
        """Return the SHA-256 of what determines a result: version, tables of the settings, recordings, mappings."""
        parts = {name: self.content.get(name) for name in tables}
        whole = sha256(f"{__version__}\n{as_json(parts)}".encode())
        for path in (self.path(name) for r in recordings for name in (r.file, r.mapping) if name):
            try:
                with path.open("rb") as file:
                    while part := file.read(1 << 20):
                        whole.update(part)
            except OSError as e:
                raise InputError(f"{self.file}: {path.name}: the file cannot be read: {e.strerror}") from e
        return whole.hexdigest()

    def as_learned(self, copy: Path) -> "Project":
        """Return the project with those settings of a run that determine its models, from the copy in its folder."""
        learned = read_toml(copy, "project file")
        found = Project.__new__(Project)
        found.file, found.folder = self.file, self.folder
        found.content = {name: t for name, t in self.content.items() if name not in LEARNED} | {
            name: t for name, t in learned.items() if name in LEARNED
        }
        found.settings = settings_of(found.content, copy)
        return found

    def fingerprint(self) -> str:
        """Return the key of the comparison and the fitted models."""
        return self.key_of(LEARNED, self.settings.recordings)


def given(options: Any, leave: tuple[str, ...] = ()) -> dict[str, Any]:
    """Return the values of a table as keywords, without some and without empty texts."""
    values = {f.name: getattr(options, f.name) for f in fields(options) if f.name not in leave}
    return {name: value for name, value in values.items() if value != ""}
