"""The one exception tree: whatever thermocomp raises on purpose is a `ThermocompError`."""

from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from typing import Any

#: what would mend an input: a part of a mapping file, as its TOML is read
Remedy = Mapping[str, Any]


class ThermocompError(Exception):
    """Base of all errors thermocomp raises on purpose; its text states what was found and what to do."""


class InputError(ThermocompError):
    """Something handed in cannot be used: a file, a column, an option, a channel name.

    Parameters
    ----------
    message : str
    remedies : sequence of Remedy
        What could mend it, the likeliest first; several where it can be read in several ways.
    """

    def __init__(self, message: str = "", remedies: Iterable[Remedy] = ()) -> None:
        super().__init__(message)
        self.remedies = tuple(remedies)


class SettingError(InputError, ValueError):
    """A value of a setting cannot be used.

    It is a `ValueError` too, so that pydantic, which reads settings from files, reports the location of the value.

    Parameters
    ----------
    message : str
    path : tuple of str or int
        Keys and positions that lead to the value from the object that refuses it.
    """

    def __init__(self, message: str, path: tuple[str | int, ...] = ()) -> None:
        super().__init__(message)
        self.path = path


def explain_unknown(what: str, name: str, known: Iterable[str], path: tuple[str | int, ...] = ()) -> SettingError:
    """Return the error for an unknown name, with the most similar known names.

    Parameters
    ----------
    what : str
        Kind of the requested item.
    name : str
        Name found.
    known : iterable of str
        Valid names.
    path : tuple of str or int
        Location, see `SettingError`.
    """
    return SettingError(f"there is no {what} {name!r}; {tell_nearest(name, known)}", path)


def tell_nearest(name: str, known: Iterable[str], cutoff: float = 0.4) -> str:
    """Return in words the known names that are similar to an unknown one, or else all known names."""
    known = list(known)
    near = get_close_matches(name, known, n=3, cutoff=cutoff)
    return f"the nearest are {', '.join(near)}" if near else f"there are {', '.join(known)}"


class RecordingError(InputError):
    """A recording, or the file it comes from, cannot be used."""


class TwoReadingsError(RecordingError):
    """The times of a recording can be read in several ways with different durations: the program must not guess."""


class UnitError(InputError):
    """A unit is unknown, or does not belong to its quantity."""


class ModelFileError(InputError):
    """A model file is damaged, of an unknown version, or not a model file."""


class ProgramError(InputError):
    """An NC program cannot be read or revised safely; nothing is written.

    Parameters
    ----------
    line : int
        Number of the line, from 1.
    reason : str
        Value found, why it is invalid, and what to do.
    """

    def __init__(self, line: int, reason: str) -> None:
        super().__init__(f"line {line}: {reason}")
        self.line = line
        self.reason = reason


class Unprovable(InputError):  # noqa: N818 - it is no error of anybody: nothing can be said
    """Nothing can be proved of a revised program: no interpreter, or one that does not run the original."""


class FitError(ThermocompError):
    """A model cannot be fitted to this data."""


class ReadingError(ThermocompError):
    """A live reading cannot be used; the correction is held, never moved."""


class MissingExtraError(ThermocompError):
    """A command needs an optional dependency that is not installed.

    Parameters
    ----------
    extra : str
        Name of the extra, such as ``"study"``.
    missing : str
        The module that could not be imported.
    """

    def __init__(self, extra: str, missing: str) -> None:
        super().__init__(
            f"this command needs the extra '{extra}' (module '{missing}' is not installed); "
            f"install it with: pip install 'thermocomp[{extra}]' (in a clone: pip install '.[{extra}]')"
        )
        self.extra = extra
        self.missing = missing
