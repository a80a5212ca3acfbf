"""Exception hierarchy: every error raised deliberately by thermocomp is a `ThermocompError`."""

from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from typing import Any

#: suggested fix of an input: part of a mapping file, as parsed TOML
Remedy = Mapping[str, Any]


class ThermocompError(Exception):
    """Base of all errors raised deliberately by thermocomp; the text states what was found and what to do."""


class InputError(ThermocompError):
    """Unusable input: a file, a column, an option, a channel name.

    Parameters
    ----------
    message : str
    remedies : sequence of Remedy
        Suggested fixes, most likely first; several if the input is ambiguous.
    """

    def __init__(self, message: str = "", remedies: Iterable[Remedy] = ()) -> None:
        super().__init__(message)
        self.remedies = tuple(remedies)


class SettingError(InputError, ValueError):
    """Invalid value of a setting.

    Also a `ValueError`, so that pydantic, which reads settings from files, reports the location of the value.

    Parameters
    ----------
    message : str
    path : tuple of str or int
        Keys and indices that lead to the value from the object that rejects it.
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
    """Return text that lists the known names similar to an unknown one, or all known names if none is similar."""
    known = list(known)
    near = get_close_matches(name, known, n=3, cutoff=cutoff)
    return f"the nearest are {', '.join(near)}" if near else f"there are {', '.join(known)}"


class RecordingError(InputError):
    """A recording or its source file cannot be used."""


class TwoReadingsError(RecordingError):
    """The times of a recording can be interpreted in several ways with different durations; the user must choose."""


class UnitError(InputError):
    """A unit is unknown, or does not belong to its quantity."""


class ModelFileError(InputError):
    """A model file is damaged, of an unknown version, or not a model file."""


class ProgramError(InputError):
    """An NC program cannot be read or revised safely; nothing is written.

    Parameters
    ----------
    line : int
        Line number, from 1.
    reason : str
        Value found, why it is invalid, and what to do.
    """

    def __init__(self, line: int, reason: str) -> None:
        super().__init__(f"line {line}: {reason}")
        self.line = line
        self.reason = reason


class Unprovable(InputError):  # noqa: N818 - not an error, but an inconclusive result
    """A revised program cannot be verified: no interpreter, or one that does not run the original program."""


class FitError(ThermocompError):
    """A model cannot be fitted to this data."""


class ReadingError(ThermocompError):
    """A live reading cannot be used; the correction is held at its present value."""


class MissingExtraError(ThermocompError):
    """A command needs an optional dependency that is not installed.

    Parameters
    ----------
    extra : str
        Name of the extra, such as ``"study"``.
    missing : str
        Module that could not be imported.
    """

    def __init__(self, extra: str, missing: str) -> None:
        super().__init__(
            f"this needs the extra '{extra}' (module '{missing}' is not installed); "
            f"install it with: pip install 'thermocomp[{extra}]' (in a clone: pip install '.[{extra}]')"
        )
        self.extra = extra
        self.missing = missing
