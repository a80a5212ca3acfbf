"""Answer of a command, independent of its output: what to use, how good it is, what to do next."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from thermocomp.core.explained import Explanation
from thermocomp.core.model import ErrorModel
from thermocomp.report.layout import Layout, PrintedLine

#: number of names listed before the others are only counted
FEW = 3


@dataclass(frozen=True, kw_only=True)
class CommandAnswer:
    """What a command prints without ``--details``.

    Parameters
    ----------
    head : str
        What to use, or what was found.
    lines : sequence of PrintedLine
        Below the table.
    warnings : sequence of str
        The worst first: only this one is printed, and the number of the others.
    files : sequence
        Paths of the files written.
    following : sequence of str
        Words of the next command; empty if there is none.
    """

    head: str = ""
    table: Layout | None = None
    lines: Sequence[PrintedLine] = ()
    warnings: Sequence[str] = ()
    files: Sequence[object] = ()
    following: Sequence[str] = ()


def few(names: Sequence[str]) -> str:
    """Return the first names, and the number of the others, as text."""
    more = f" and {len(names) - FEW} more" if len(names) > FEW else ""
    return ", ".join(names[:FEW]) + more


def spares(wanted: Mapping[str, str]) -> list[PrintedLine]:
    """Return a line about the sensors for which a spare is recommended, with the first reason."""
    named = "" if len(wanted) == 1 else "{}: "
    first = next((f" ({named.format(name)}{why})" for name, why in wanted.items()), "none")
    return [PrintedLine(f"Spare sensor recommended for: {few(list(wanted))}{first}.")]


def spares_of(models: Sequence[Explanation]) -> list[PrintedLine]:
    """Return a line about the sensors of models for which a spare is recommended."""
    if not any(s.watched for e in models for s in e.sensors):
        return [PrintedLine("Sensors are not monitored: a wrong value is not detected.")]
    return spares({s.name: f"{e.target}, {s.spare}" for e in models for s in e.sensors if s.spare})


def noisy(models: Iterable[ErrorModel]) -> list[str]:
    """Return warnings about models that may run and whose correction is noisy, the noisiest first."""
    known = [
        (h.scatter / (h.none_rms or 1.0), m.target, h.noisy) for m in models if m.accepted and (h := m.honest_error)
    ]
    return [f"{target}: {text}" for _, target, text in sorted(known, reverse=True) if text]


def split_units(units: Iterable[str]) -> tuple[str, Callable[[str, str], str]]:
    """Return the unit for the headings of a table, and a function of a target and its unit that names the target.

    If the numbers have several units, the headings have none, and each target is named with its own.
    """
    several = len(found := {*units}) > 1
    return "" if several else found.pop(), lambda target, unit: f"{target} [{unit}]" if several else target
