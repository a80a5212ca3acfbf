"""`Target`: an export target, with the function that writes its files and its options."""

from collections.abc import Callable
from dataclasses import dataclass
from difflib import get_close_matches

from thermocomp.core.bounds import RANGE
from thermocomp.core.exceptions import InputError
from thermocomp.core.plugins import find_plugins, load_plugin
from thermocomp.export.reduction.reduced import Shape


@dataclass(frozen=True, kw_only=True)
class Target:
    """A kind of controller for which models are written; defined by an entry point of ``thermocomp.exporters``.

    Parameters
    ----------
    write : callable
        Returns the files by name, the page of instructions last. Called with a compensator, a name and `Facts`; with
        `shape`, called with reduced models, limits, a name, `Facts` and ``figure``.
    shape : Shape or None
        Form supported by the controller if it cannot hold a full model: the best reduced model is fitted to recordings.
    axes : bool
        `write` accepts ``axes``, letters by target.
    corrected : str
        Axes that the controller corrects; empty: any.
    dialects : tuple of str
        `write` accepts ``dialect``, one of these.
    magnitude : float
        Largest correction that the controller can represent [um].
    program : bool
        `write` accepts ``program``, a program number.
    vectors : bool
        `write` accepts ``recording``, of which it makes test vectors, too.
    limited : bool
        The controller limits the correction to the magnitude of `Limits`.
    """

    write: Callable[..., dict[str, bytes]]
    shape: Shape | None = None
    axes: bool = False
    corrected: str = ""
    dialects: tuple[str, ...] = ()
    magnitude: float = RANGE
    program: bool = False
    vectors: bool = False
    limited: bool = True


def find_target(name: str) -> Target:
    """Return the target with a given name.

    Raises
    ------
    InputError
        The target is unknown, or its plug-in cannot be loaded.
    """
    known = find_plugins("exporters")
    if name not in known:
        near = get_close_matches(name, known, n=1, cutoff=0.4)
        hint = f"; did you mean {near[0]}?" if near else "."
        raise InputError(f"--to {name!r}: no such target{hint} Known are {', '.join(known)}")
    found = load_plugin(known[name])
    if not isinstance(found, Target):
        raise InputError(f"--to {name}: {known[name].value} is not a thermocomp.export.target.Target")
    return found
