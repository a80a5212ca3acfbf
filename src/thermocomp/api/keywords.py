"""Keywords that several verbs share: settings and progress."""

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from thermocomp.core.exceptions import InputError

_Settings = TypeVar("_Settings")


def settings_of(kind: type[_Settings], given: Mapping[str, Any], verb: str) -> _Settings:
    """Return the settings given to a verb as keywords.

    Parameters
    ----------
    kind : type
        Dataclass of the settings.
    given : mapping
        Keywords given.
    verb : str
        Name of the verb, for the error message.

    Raises
    ------
    InputError
        Setting unknown.
    """
    try:
        return kind(**given)
    except TypeError as e:
        known = ", ".join(getattr(kind, "__dataclass_fields__", ()))
        raise InputError(f"{verb}: {str(e).partition(') ')[2]}; the settings are {known}") from e


class Listener:
    """Receiver of progress: a verb's ``progress`` with its optional methods.

    Parameters
    ----------
    progress : callable
        Called with a line of text after each task; may have ``begin``, called with the number of tasks, and ``warn``,
        called with the data-quality problems before the work.
    """

    def __init__(self, progress: Callable[..., object]) -> None:
        self.tell = progress
        self.warn: Callable[[list[str]], object] = getattr(progress, "warn", lambda _: None)

    def begin(self, pieces: Callable[[], int]) -> None:
        """Report the number of tasks; they are counted only if the receiver has ``begin``."""
        if (begin := getattr(self.tell, "begin", None)) is not None:
            begin(pieces())


def silent(_: str, steps: int = 1) -> None:
    """Report nothing."""


#: ignores progress
SILENT = Listener(silent)
