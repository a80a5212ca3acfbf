"""Configuration of the service: a TOML file, read strictly, with all its errors reported at once."""

from collections import Counter
from collections.abc import Iterator, Sequence
from copy import deepcopy
from dataclasses import dataclass, field, is_dataclass, make_dataclass
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_type_hints

from pydantic import Discriminator, Field, TypeAdapter, ValidationError
from pydantic_core import ErrorDetails

from thermocomp.core.correction import Limits
from thermocomp.core.exceptions import InputError, SettingError
from thermocomp.core.plugins import describe_plugin, find_plugins, load_plugin
from thermocomp.core.shown import explain_unfit
from thermocomp.core.units import HOUSE_UNITS
from thermocomp.files.plaintext import strict_adapter
from thermocomp.files.tomlfile import as_json, read_toml
from thermocomp.live.adapters.network import MqttIn, MqttOut, MqttProbing, OnBroker, explain_host_name
from thermocomp.live.adapters.sections import (
    LinuxCncOut,
    Names,
    ReplayIn,
    SimulatedIn,
    SimulatedProbing,
    SinkSection,
    SourceSection,
)


@dataclass(frozen=True, kw_only=True)
class Page:
    """Configuration of the web page of the service.

    Parameters
    ----------
    host, port : str, int
        Address of the page. Default: loopback.
    hosts : tuple of str
        Host names of the page in addition to `host`, ``localhost`` and the addresses of this computer.
    token_file : str
        File with the token required by buttons; without one the page is read-only.
    settled : float
        A drift below this in ten minutes counts as settled [um].
    pages : tuple of str
        Additional pages of other packages, by their entry points of ``thermocomp.pages``.
    """

    host: str = "127.0.0.1"
    port: int = 8731
    hosts: tuple[str, ...] = ()
    token_file: str = ""
    settled: float = 1.0
    pages: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        bare = self.host[1:-1] if self.host.startswith("[") and self.host.endswith("]") else self.host
        for key, host in (("host", bare), *(("hosts", host) for host in self.hosts)):
            if why := explain_host_name(host):
                raise SettingError(f"{key} = {host[:200]!r}: {why}")
        if not self.settled > 0.0:
            raise SettingError(f"settled = {self.settled:g}: expected more than 0 um in ten minutes")
        if not 0 <= self.port <= 65535:
            raise SettingError(f"port = {self.port}: expected a port from 0 (any free port) to 65535")
        known = find_plugins("pages") if self.pages else {}
        for name in self.pages:
            if name not in known:
                raise SettingError(f"pages: {name!r} is not installed; there are {', '.join(known)}")


@dataclass(frozen=True, kw_only=True)
class MachineOf:
    """Machine file used instead of models: offset and slope of each axis along straight lines through one point.

    Parameters
    ----------
    at : tuple of 3 float
        Positions of the stationary axes while one axis moves [mm].
    tool : tuple of 3 float or None
        Vector from the gauge point to the tip [mm]. Default: the tool of the machine file.
    """

    file: str
    at: tuple[float, float, float]
    tool: tuple[float, float, float] | None = None


@dataclass(frozen=True, kw_only=True)
class JournalOut:
    """Configuration of the journal.

    Parameters
    ----------
    file : str
        Path of the journal; its files are numbered: ``live.db`` becomes ``live.000001.db`` and so on.
    size_mb : float
        Size above which a new file is started [MB].
    files : int
        Maximum number of files; the oldest is removed.
    channels : dict of str to str
        Quantity of channels recorded in addition to the models' inputs, such as ``{t9_C = "temperature"}``. A
        displacement with the name of a target measures the residual under its correction.
    """

    file: str
    size_mb: float = 64.0
    files: int = 8
    channels: Names = field(default_factory=dict)

    def __post_init__(self) -> None:
        if unknown := set(self.channels.values()) - HOUSE_UNITS.keys():
            raise SettingError(f"channels: {', '.join(sorted(unknown))}: expected one of {', '.join(HOUSE_UNITS)}")
        if not 0.1 <= self.size_mb <= 1e6 or not self.files >= 2:
            raise SettingError(
                f"size_mb = {self.size_mb:g}, files = {self.files}: expected at least 0.1 MB and at least 2 files"
            )


Probings = Annotated[MqttProbing | SimulatedProbing, Discriminator("kind")]


@dataclass(frozen=True, kw_only=True)
class Config:
    """Configuration of the service.

    Parameters
    ----------
    sources, sinks : tuple
        Sources of readings, receivers of corrections.
    models : tuple of str
        Model files, one target each; or none if a machine is given.
    probes : tuple
        Sources of measurements of the tool point.
    state : str
        File of the saved state; without one every start is a cold start.
    shadow : bool
        Apply no corrections: the models are only observed.
    speed : float
        Machine time per unit of real time: for the virtual machine and recordings only.
    own_compensation : {'on', 'off', 'unknown'}
        Whether the controller compensates for temperature by itself.
    at_stop : {'hold', 'fade'}
        Corrections after a stop: unchanged, or faded to zero first, within the limits.
    first_start, at_unknown : {'order', 'zero'}
        If the correction in force is unknown at the first start, without a state file, or at a later one: wait for the
        order ``start``, or start from zero.
    """

    sources: tuple[SourceSection, ...]
    sinks: tuple[SinkSection, ...] = ()
    models: tuple[str, ...] = ()
    machine: MachineOf | None = None
    probes: tuple[Probings, ...] = ()
    state: str = ""
    limits: Limits = Limits()
    shadow: bool = False
    speed: Annotated[float, Field(gt=0, le=10_000)] = 1.0
    page: Page | None = None
    journal: JournalOut | None = None
    own_compensation: Literal["on", "off", "unknown"] = "unknown"
    at_stop: Literal["hold", "fade"] = "hold"
    first_start: Literal["order", "zero"] = "order"
    at_unknown: Literal["order", "zero"] = "order"

    def __post_init__(self) -> None:
        if found := list(self._wrong()):
            raise SettingError("\n".join(found))

    def _wrong(self) -> Iterator[str]:
        """Yield an error for each setting that is missing, or excludes another one."""
        if bool(self.models) == bool(self.machine):
            yield (
                f"models = {list(self.models)}: name at least one model file written by 'thermocomp fit', or a "
                "[machine], but not both"
            )
        if not self.sources:
            yield 'no source: add a table [[sources]] with kind = "mqtt", "simulated" or "replay"'
        if self.own_compensation == "on" and not self.shadow:
            yield (
                'own_compensation = "on": the same error would be corrected twice; switch off the compensation of the '
                "controller, or let the models run in shadow (shadow = true)"
            )
        controlled = any(isinstance(s, LinuxCncOut) for s in self.sinks)
        if self.own_compensation == "unknown" and (self.journal or self.probes or controlled):
            yield (
                'own_compensation = "unknown": write "off" or "on"; measurements at the machine cannot be used '
                "unless it is known whether the controller compensates for temperature by itself"
            )
        for what, many in (("source", self.sources), ("sink", self.sinks), ("probe", self.probes)):
            for place, count in Counter(map(_place, many)).items():
                if count > 1:
                    yield f"{count} {what}s with the same {place}: keep only one of them"
        for sink in (s for s in self.sinks if isinstance(s, MqttOut)):
            for source in (*self.sources, *self.probes):
                if isinstance(source, MqttIn | MqttProbing) and source.hears(sink):
                    yield (
                        f"topic = {source.topic!r}: receives the corrections published to {sink.topic!r}; publish them "
                        "to a topic to which no source and no probe subscribes"
                    )
        machine = any(isinstance(s, SimulatedIn) for s in self.sources)
        if not machine and any(isinstance(p, SimulatedProbing) for p in self.probes):
            yield 'a probe of kind = "simulated" needs a source of kind = "simulated"'
        virtual = (SimulatedIn, ReplayIn)
        real = [s.kind for s in self.sources if not (isinstance(s, virtual) or getattr(s, "virtual", False))]
        if self.speed != 1.0 and real:
            yield (
                f"speed = {self.speed:g}: a machine that is read by kind = {real[0]!r} runs in real time: set "
                "speed = 1, or virtual = true if the machine is a virtual one"
            )


def _place(one: SourceSection | SinkSection | Probings) -> str:
    """Return the resource that a source or sink needs for itself, such as a topic, a file or a socket."""
    if isinstance(one, OnBroker):
        return f"topic = {one.topic!r} of {one.host}:{one.port}"
    if isinstance(one, SimulatedIn | SimulatedProbing):
        return f"kind = {one.kind!r}"
    found = {"file": getattr(one, "file", ""), "socket": getattr(one, "socket", "")}
    # a link of another package: its whole table
    return next((f"{key} = {name!r}" for key, name in found.items() if name), str(one))


class ServiceSettings(NamedTuple):
    """A configuration, and the folder against which its file names are resolved."""

    config: Config
    folder: Path


#: tables whose ``kind`` is the name of an entry point of ``thermocomp.sources`` or ``thermocomp.sinks``
_KINDS: tuple[Literal["sources", "sinks"], ...] = ("sources", "sinks")
_PLAIN = {
    "missing": "is missing",
    "unexpected_keyword_argument": "is not a known key",
    "extra_forbidden": "is not a known key",
    "dataclass_type": "must be a table, such as [limits]",
    "tuple_type": "must be a list: [...]",
    "dict_type": "must be a table",
    "union_tag_not_found": 'has no kind: write kind = "..."',
}


def read_config(path: str | Path) -> ServiceSettings:
    """Read the configuration file of the service."""
    content = read_toml(path, "configuration of the service")
    if unfit := list(_unfit(content)):
        raise InputError(_list(path, unfit))
    adapter = _adapter(content)
    try:
        config = adapter.validate_json(as_json(content))
    except ValidationError as e:
        errors = e.errors(include_url=False)
        lines = [
            line for error in [*errors, *_behind(adapter, content, errors)] for line in _tell(dict(error)).splitlines()
        ]
        raise InputError(_list(path, lines)) from e
    return ServiceSettings(config, Path(path).resolve().parent)


def _list(path: str | Path, errors: Sequence[str]) -> str:
    """Return the errors of a configuration as text, one per line."""
    found = f"{len(errors)} error{'' if len(errors) == 1 else 's'} to correct"
    return "\n".join([f"{path}: {found}:", *(f"  {line}" for line in errors)])


def _adapter(content: dict[str, Any]) -> TypeAdapter[Config]:
    """Return the validator of a configuration: sections of this package, and of the plug-ins that it names."""
    fields = [(group, tuple[_section_of(group, content.get(group)), ...], ()) for group in _KINDS]  # type: ignore[misc]
    made = make_dataclass("Config", [fields[0][:2], fields[1]], bases=(Config,), frozen=True, kw_only=True)
    return strict_adapter(made)


def _section_of(group: Literal["sources", "sinks"], tables: Any) -> Any:
    found_kinds = (t.get("kind") for t in tables if isinstance(t, dict)) if isinstance(tables, list) else ()
    named = {kind for kind in found_kinds if isinstance(kind, str)}
    known = find_plugins(group)
    found = [_load_section(e) for name, e in known.items() if e.value.startswith("thermocomp.") or name in named]
    return Annotated[Union[tuple(found)], Discriminator("kind")]  # noqa: UP007 - built from a list


def _load_section(entry: EntryPoint) -> type:
    section = load_plugin(entry)
    if not (isinstance(section, type) and is_dataclass(section) and callable(getattr(section, "open", None))):
        raise InputError(f"{describe_plugin(entry)}: {entry.value} is not a dataclass with a method open")
    if get_args(get_type_hints(section).get("kind")) != (entry.name,):
        raise InputError(f"{describe_plugin(entry)}: {entry.value} needs a field kind: Literal[{entry.name!r}]")
    return section


def _unfit(value: Any, place: str = "") -> Iterator[str]:
    """Yield errors for keys and texts that are not printable or exceed the length limit."""
    if isinstance(value, str) and (why := explain_unfit(value, 65_535)):
        yield f"{place}: {why}"
    pairs = value.items() if isinstance(value, dict) else enumerate(value, 1) if isinstance(value, list) else ()
    for key, inner in pairs:
        if why := explain_unfit(str(key)):
            yield f"{place or 'file'}: {why}"
        else:
            yield from _unfit(inner, f"{place}.{key}" if place else str(key))


def _behind(
    adapter: TypeAdapter[Config], content: dict[str, Any], errors: Sequence[ErrorDetails]
) -> list[ErrorDetails]:
    """Return further errors in tables that have a value of a wrong type: such tables are not fully validated."""
    content = deepcopy(content)
    tables = set[tuple[int | str, ...]]()
    for error in errors:
        keys = _keys(error["loc"])
        if len(keys) > 1 and error["type"] not in ("value_error", "missing"):
            table: Any = content
            for k in keys[:-1]:
                table = table[k]
            if isinstance(table, dict) and table.pop(keys[-1], None) is not None:
                tables.add(keys[:-1])
    try:
        adapter.validate_json(as_json(content))
    except ValidationError as e:
        return [x for x in e.errors(include_url=False) if x["type"] == "value_error" and _keys(x["loc"]) in tables]
    return []


def _keys(loc: tuple[int | str, ...]) -> tuple[int | str, ...]:
    """Return keys and list indices of an error location, without the kind of an entry after its list index."""
    kinds = {"mqtt", "simulated", *find_plugins("sources"), *find_plugins("sinks")}
    pairs = zip((None, *loc), loc, strict=False)
    return tuple(k for before, k in pairs if not (k in kinds and isinstance(before, int)))


def _tell(error: dict[str, Any]) -> str:
    place = ".".join(f"{k + 1}" if isinstance(k, int) else k for k in _keys(error["loc"])) or "file"
    context = error.get("ctx", {})
    if error["type"] == "value_error":
        return str(context["error"]) if place == "file" else f"{place}: {context['error']}"
    if error["type"] == "union_tag_invalid":
        known = next((", ".join(map(repr, find_plugins(g))) for g in _KINDS if place.startswith(g)), "")
        return f"{place}: kind = {context['tag']!r} is not one of {known or context['expected_tags']}"
    message = _PLAIN.get(error["type"])
    return f"{place} {message}" if message else f"{place}: {error['msg']}, found {error['input']!r:.60}"
