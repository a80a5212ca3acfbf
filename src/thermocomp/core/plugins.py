"""Plug-ins found by entry points: those of this package and those of other packages."""

import re
import sys
from collections.abc import Callable
from functools import cache
from importlib.metadata import EntryPoint, EntryPoints, entry_points
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal

from thermocomp.core.exceptions import InputError

Group = Literal["commands", "methods", "exporters", "sources", "sinks", "pages"]


def find_plugins(group: Group, report: Callable[[str], object] = lambda _: None) -> dict[str, EntryPoint]:
    """Return the entry points of ``thermocomp.GROUP`` by name; nothing is imported.

    Parameters
    ----------
    group : {'commands', 'methods', 'exporters', 'sources', 'sinks', 'pages'}
    report : callable, optional
        Called with a line of text for each skipped plug-in: names of this package cannot be overridden.
    """
    found: dict[str, EntryPoint] = {}
    entries = _read_entries(group, tuple(sys.path))
    # entry points of this package first, so that others cannot override their names; installations define no order
    for entry in sorted(entries, key=lambda e: (not e.value.startswith("thermocomp."), e.name)):
        if (first := found.setdefault(entry.name, entry)).value != entry.value:
            report(f"{describe_plugin(entry)} is skipped: the name {entry.name} is already used by {first.value}")
    if not any(entry.value.startswith("thermocomp.") for entry in found.values()):
        report(
            f"no {group} of thermocomp itself are installed: the installation is older than the source files; "
            "reinstall thermocomp"
        )
    return found


@cache
def _read_entries(group: Group, _path: tuple[str, ...]) -> EntryPoints:
    """Return the entry points installed on a path; this reads a file of every package."""
    return entry_points(group=f"thermocomp.{group}")


def describe_plugin(entry: EntryPoint) -> str:
    """Return the name of a plug-in for messages."""
    package = f" of the package {entry.dist.name}" if entry.dist is not None else ""
    return f"plug-in {entry.name} ({entry.group}){package}"


def load_plugin(entry: EntryPoint) -> Any:
    """Import the object named by an entry point.

    Raises
    ------
    InputError
        The import failed; the message names the plug-in and the reason.
    """
    try:
        return entry.load()
    except Exception as e:
        raise InputError(
            f"{describe_plugin(entry)} cannot be loaded: {type(e).__name__}: {e}; update or remove its package"
        ) from e


def read_summary(entry: EntryPoint) -> str | None:
    """Return the first paragraph of a function's docstring, read from its file; nothing is imported.

    Returns
    -------
    str or None
        None if the module does not exist; empty if the function or its docstring is not found in the file.
    """
    try:
        spec = find_spec(entry.module)
    except Exception:  # noqa: BLE001 - a parent package cannot be imported
        return None
    if spec is None or spec.origin is None:
        return None
    text = Path(spec.origin).read_text(encoding="utf-8", errors="replace")
    # a command made from a verb uses the docstring of the verb
    if made := re.search(rf'^@command\(\s*"([\w.]+:\w+)"[^@]*?^def {entry.attr}\(', text, re.DOTALL | re.MULTILINE):
        return read_summary(EntryPoint(entry.name, made[1], entry.group))
    found = re.search(rf'^def {entry.attr}\(.*?"""(.*?)(?:\n\s*\n|""")', text, re.DOTALL | re.MULTILINE)
    return " ".join(found[1].split()) if found else ""
