"""Commands made from Python verbs: the same options, defaults and texts, with additions for the terminal."""

import inspect
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, get_args

from cyclopts import Parameter
from docstring_parser import DocstringStyle, parse

import thermocomp
from thermocomp.cli import loudness
from thermocomp.cli.answers import BEFORE, LINES, print_answer
from thermocomp.cli.beginning import Beginning
from thermocomp.cli.exits import STDIN
from thermocomp.cli.jsonoutput import print_json
from thermocomp.cli.options import CompensatorOptions, LeaveOneOut
from thermocomp.cli.progress import Steps, show_progress
from thermocomp.cli.reading import RecordingReader, print_trouble, read_recordings
from thermocomp.cli.terminal import console
from thermocomp.core.exceptions import InputError
from thermocomp.core.outputs import refuse_existing
from thermocomp.core.plugins import find_plugins
from thermocomp.report.answer import CommandAnswer

#: types of parameters on the command line, where Python accepts more types than a command line can express; a group of
#: options has a method `value`, which returns the argument of the verb
ON_A_LINE: dict[str, Any] = {
    "recordings": list[Path],
    "models": list[str],
    "model": str,
    "targets": Annotated[list[str] | None, Parameter(name="--target")],
    "inputs": list[str] | None,
    "tilt": list[str] | None,
    "probing": str | None,
    "mapping": Path | None,
    "leave_one": LeaveOneOut,
    "starts": Beginning,
    "limits": CompensatorOptions,
}
#: lines before and after the answer of a command that another command calls
OTHERS = 6
#: parameters without an option, because the command itself displays their content
SHOWN = ("progress",)
#: function that returns the files written for an output and given options
Writes = Callable[[Path, Mapping[str, Any]], list[Path]]
#: a page can be printed, too
PAGES = (".html", ".pdf")


@dataclass(frozen=True, kw_only=True)
class CommandFace:
    """Options of the command line that the Python verbs do not have.

    Parameters
    ----------
    output : Path or None
        Output file (--output), if given.
    overwrite : bool
        Overwrite an existing file.
    json : bool
        Print results as JSON.
    quiet : bool
        Print nothing; for commands that call another command.
    part : bool
        Print neither files nor the next command; for commands that call another command.
    trouble : list of str
        Data-quality problems of the recordings.
    given : mapping
        Values of the command line by parameter of the verb.
    """

    output: Path | None = None
    overwrite: bool = False
    json: bool = False
    quiet: bool = False
    part: bool = False
    trouble: list[str] = field(default_factory=list)
    given: Mapping[str, Any] = field(default_factory=dict)

    def warn(self, lines: list[str]) -> None:
        """Print the data-quality problems of recordings on stderr, before the work."""
        self.trouble.extend(print_trouble(lines))

    def refuse_existing(self, writes: str | Writes, given: Mapping[str, Any]) -> None:
        """Check, before any work, that the output can be written."""
        if self.output is not None:
            files = [self.output] if isinstance(writes, str) else writes(self.output, given)
            inputs = [v for v in _flat(given.values()) if isinstance(v, Path)]
            endings = () if callable(writes) else PAGES if writes == ".html" else (writes,)
            refuse_existing(files, self.overwrite, inputs, *endings)

    def write(self, writer: Callable[..., object]) -> None:
        """Write the result to the output file, if one is given."""
        if self.output is not None:
            writer(self.output, overwrite=self.overwrite)

    def show(self, content: Callable[[], dict[str, Any]], printer: Callable[[], None]) -> None:
        """Print a result as JSON or as text."""
        if self.quiet:
            return
        if self.json:
            print_json(content())
        else:
            printer()

    def answer(
        self, content: Callable[[], dict[str, Any]], made: Callable[[], CommandAnswer], details: Callable[[], object]
    ) -> None:
        """Print a result as JSON, or its answer, with ``--details`` followed by all results."""

        def show() -> None:
            told = replace(made(), files=(), following=()) if self.part else made()
            short, room = not loudness.details, LINES - (OTHERS if self.part else BEFORE)
            print_answer(told, console, hint=short and not self.part, count=short and self.part, room=room)
            if loudness.details:
                console.print()
                details()

        self.show(content, show)

    @property
    def files(self) -> list[Path]:
        """The output file, if one is given."""
        return [] if self.output is None else [self.output]

    def following(self, name: str, **more: Any) -> tuple[str, ...]:
        """Return the words of another command for the same recordings and options; none for standard input.

        Parameters
        ----------
        name : str
            Name of a command made from a verb.
        **more
            Further options of that command, or others instead of those given.
        """
        command = find_plugins("commands")[name].load()
        found = ["thermocomp", name]
        for option, p in inspect.signature(command).parameters.items():
            value = {**self.given, **more}.get(option, p.default)
            if is_group(p.annotation):
                for f in fields(p.annotation):
                    usual = getattr(p.annotation(), f.name)  # this command may have fewer of the options
                    if is_group(type(value)) and (own := getattr(value, f.name, usual)) != usual:
                        found += _typed(_name_of(f.name, None), own)
            elif p.kind is p.POSITIONAL_ONLY:
                found += map(str, value if isinstance(value, list) else [] if value is None else [value])
            elif value != p.default:
                found += _typed(_name_of(option, p.annotation), value)
        return () if str(STDIN) in found else tuple(found)


class Verb:
    """A function of the Python interface as a command.

    Parameters
    ----------
    place : str
        Location of the function, such as ``thermocomp.api.verbs:compare``.
    forms, words, reads
        As for `command`.
    """

    def __init__(
        self, place: str, forms: Mapping[str, Any], words: Sequence[str] = (), reads: Mapping[str, RecordingReader] = {}
    ) -> None:
        self.forms = ON_A_LINE | dict(forms)
        self.reads = reads
        module, _, name = place.partition(":")
        self.function: Callable[..., Any] = getattr(import_module(module), name)
        needed = (n for n, p in self.parameters.items() if p.default is p.empty and p.kind is not p.VAR_KEYWORD)
        self.words = words or list(needed)

    @cached_property
    def parameters(self) -> dict[str, inspect.Parameter]:
        """Parameters of the function by name, without those in `SHOWN`."""
        return {n: p for n, p in inspect.signature(self.function).parameters.items() if n not in SHOWN}

    @cached_property
    def help(self) -> str:
        """Description of the function, without its parameters."""
        return plain("\n\n".join(_paragraphs(inspect.getdoc(self.function) or "")))

    def help_of(self, parameter: str) -> str:
        """Return the description of a parameter, from another verb if the text refers to it.

        Raises
        ------
        LookupError
            The parameter is not described.
        """
        text = _described(self.function)[parameter]
        if other := re.match(r"As for `(\w+)`\.?", text):
            text = _described(getattr(thermocomp, other[1]))[parameter] + text[other.end() :]
        return plain(text)

    def call(self, given: Mapping[str, Any], progress: Steps, tell_changes: bool) -> Any:
        """Call the function: recordings are read first, and groups of options converted to objects.

        Parameters
        ----------
        given : mapping
            Values of the command line by parameter; those of other verbs are ignored.
        progress : Steps
        tell_changes : bool
        """
        made = {name: value for name, value in given.items() if name in self.parameters}
        mapping = made.get("mapping")
        for name, read in self.reads.items():
            if name in made and (made[name] or self.parameters[name].default is inspect.Parameter.empty):
                made[name] = read(made[name], mapping, tell=tell_changes)
                made.pop("mapping", None)
        for name, value in list(made.items()):
            if isinstance(value, Beginning):
                made[name] = value.of(made["recordings"] or [], mapping)
            elif self.parameters[name].kind is inspect.Parameter.VAR_KEYWORD:
                made |= vars(made.pop(name))
            elif is_group(self.forms.get(name)):
                made[name] = value.value()
        if "progress" in inspect.signature(self.function).parameters:
            made["progress"] = progress
        return self.function(**made)

    def options(self) -> list[inspect.Parameter]:
        """Return the parameters of the function as options of a command."""
        found = []
        for name, p in self.parameters.items():
            form = self.forms.get(name, p.annotation)
            if is_group(form):
                default: Any = form()
            else:
                default = list(p.default) if isinstance(p.default, tuple) else p.default
                more: dict[str, Any] = {"negative": f"--no-{name.replace('_', '-')}"} if default is True else {}
                form = Annotated[form, Parameter(help=self.help_of(name), **more)]
            kind = inspect.Parameter.POSITIONAL_ONLY if name in self.words else inspect.Parameter.KEYWORD_ONLY
            found.append(inspect.Parameter(name, kind, default=default, annotation=form))
        return sorted(found, key=lambda p: p.kind)


def command(
    place: str,
    *,
    writes: str | Writes = "",
    needs_output: bool = False,
    forms: Mapping[str, Any] = {},
    words: Sequence[str] = (),
    reads: Mapping[str, RecordingReader] = {"recordings": read_recordings},
    instead: Mapping[str, str] = {},
    tell_changes: bool = True,
) -> Callable[[Callable[..., int]], Callable[..., int]]:
    """Create a command from a verb and a function that shows its result.

    The arguments of the function are the result, a `CommandFace`, and additional options of the command that the verb
    does not have; it returns the exit code. Its docstring describes ``--output`` and the additional options, and lists
    the exit codes.

    Parameters
    ----------
    place : str
        Location of the verb, such as ``thermocomp.api.verbs:compare``.
    writes : str or callable
        Extension of the file named by ``--output`` (``.html`` permits ``.pdf``), or a function that returns all files
        written for it and for the options given. Default: the command has no ``--output``.
    needs_output : bool
        Whether ``--output`` is required.
    forms : mapping
        Types of parameters of this verb on the command line, in addition to `ON_A_LINE`.
    words : sequence of str
        Positional parameters. Default: those without a default value.
    reads : mapping
        Readers of the files given for a parameter, where Python accepts recordings; they get the verb's ``mapping``.
    instead : mapping
        Alternative verbs, by the option that selects them; they write nothing.
    tell_changes : bool
        Report on stderr what a mapping changes in the values; False: the result reports it.
    """

    def made_of(show: Callable[..., int]) -> Callable[..., int]:
        verb = Verb(place, forms, words, reads)
        options = verb.options()
        defaults = {p.name: p.default for p in options if p.default is not p.empty}
        own = [p for n, p in inspect.signature(show).parameters.items() if n not in ("found", "face")]
        described = _described(show)

        def run(*positional: Any, **named: Any) -> int:
            given = defaults | dict(zip(verb.words, positional, strict=False)) | named
            extra = {p.name: given.pop(p.name, p.default) for p in own}
            alone = {f: given.pop(f) for f in ("output", "overwrite", "json", "quiet", "part") if f in given}
            face = CommandFace(**alone, given=given)
            asked = next((option for option in instead if extra[option]), "")
            if asked and face.output is not None:
                raise InputError(f"{face.output}: --{asked.strip('_')} writes no file; omit -o")
            if needs_output and not asked and face.output is None:
                ways = ", or ".join(f"--{option.strip('_')}" for option in instead)
                raise InputError(f"no output file given: name one with -o, or give {ways}")
            face.refuse_existing(writes, given)
            chosen = Verb(instead[asked], forms, reads=reads) if asked else verb
            with show_progress(hidden=face.json or face.quiet, warn=face.warn) as progress:
                found = chosen.call(given, progress, tell_changes)
            return show(found, face, **extra)

        required = needs_output and not instead
        output: Any = Path if required else Path | None
        none: Any = inspect.Parameter.empty if required else None
        written = [
            _option("output", output, none, described.get("output", ""), ["--output", "-o"]),
            _option("overwrite", bool, False, "Overwrite an existing file."),
        ]
        mine = [_option(p.name, p.annotation, p.default, described[p.name]) for p in own]
        json = _option("json", bool, False, "Print results as JSON instead of tables.")
        parameters = [*options, *mine, *(written if writes else []), json]
        run.__name__ = run.__qualname__ = show.__name__
        run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        run.__annotations__ = {p.name: p.annotation for p in parameters}
        run.__doc__ = verb.help
        run.verb, run.own, run.show = verb, [p.name for p in own], show  # type: ignore[attr-defined]
        return run

    return made_of


def is_group(form: Any) -> bool:
    """Return whether a type of the command line is a group of options."""
    return isinstance(form, type) and getattr(form, "__dataclass_fields__", None) is not None


def plain(text: str) -> str:
    """Return the text of a docstring without markup."""
    text = re.sub(r":\w+:`/?([^`]*)`", r"\1", text)
    return re.sub(r"``?([^`]*)``?", r"\1", text)


def _option(name: str, form: Any, default: Any, text: str, words: Sequence[str] | None = None) -> inspect.Parameter:
    annotation = Annotated[form, Parameter(help=text, name=words)]
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)


def _paragraphs(doc: str) -> list[str]:
    """Return the paragraphs before the first heading."""
    return re.split(r"\n\s*\n(?=[A-Z][a-z]+\n-{3,})", doc, maxsplit=1)[0].split("\n\n")


def _described(function: Callable[..., Any]) -> dict[str, str]:
    """Return the description of each parameter in a docstring."""
    found = {}
    for p in parse(inspect.getdoc(function) or "", style=DocstringStyle.NUMPYDOC).params:
        for name in p.arg_name.split(","):
            # a second paragraph is for Python alone
            found[name.strip().lstrip("*")] = " ".join((p.description or "").split("\n\n")[0].split())
    return found


def _name_of(option: str, annotation: Any) -> str:
    """Return the name of an option on the command line: the last of those given, such as ``-o``."""
    names = [m.name for m in get_args(annotation)[1:] if isinstance(m, Parameter) and m.name]
    return str([*names[0]][-1]) if names else "--" + option.strip("_").replace("_", "-")


def _typed(name: str, value: Any) -> list[str]:
    """Return an option with its value as words of a command line."""
    if isinstance(value, bool):
        return [name if value else f"--no-{name.removeprefix('--')}"]
    return [name, *map(str, value if isinstance(value, list | tuple) else [value])]


def _flat(values: Any) -> list[Any]:
    return [v for value in values for v in (value if isinstance(value, list) else [value])]
