"""What all verbs do with some of their keywords: settings of a part, and who hears how far the work is."""

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from thermocomp.core.exceptions import InputError

_Settings = TypeVar("_Settings")


def settings_of(kind: type[_Settings], given: Mapping[str, Any], verb: str) -> _Settings:
    """Return the settings that were given to a verb.

    Parameters
    ----------
    kind : type
        A dataclass.
    given : mapping
        Keywords.
    verb : str
        Its name, for the error.

    Raises
    ------
    InputError
        There is no such setting.
    """
    try:
        return kind(**given)
    except TypeError as e:
        known = ", ".join(getattr(kind, "__dataclass_fields__", ()))
        raise InputError(f"{verb}: {str(e).partition(') ')[2]}; the settings are {known}") from e


class Listener:
    """What hears how far the work is: a verb's ``progress``, whatever of this it has.

    Parameters
    ----------
    progress : callable
        Called with a line of text after each piece of work; may have ``begin``, called with the number of pieces, and
        ``warn``, called with lines of trouble before the work.
    """

    def __init__(self, progress: Callable[..., object]) -> None:
        self.tell = progress
        self.warn: Callable[[list[str]], object] = getattr(progress, "warn", lambda _: None)

    def begin(self, pieces: Callable[[], int]) -> None:
        """Say how many pieces of work there are; they are counted only for who wants to know."""
        if (begin := getattr(self.tell, "begin", None)) is not None:
            begin(pieces())


def silent(_: str, steps: int = 1) -> None:
    """Say nothing."""


#: hears nothing
SILENT = Listener(silent)
