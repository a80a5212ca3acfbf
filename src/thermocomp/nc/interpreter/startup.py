"""Startup codes: in force when a program starts, whether or not it contains them, and not reset by its end."""

from typing import Final

from thermocomp.core.exceptions import InputError
from thermocomp.nc.interpreter.block import Modal, Setup
from thermocomp.nc.parser.line import Controller, Word
from thermocomp.nc.parser.tokens import read_line

_PATHS: Final = {61.0: "G61", 61.1: "G61.1", 64.0: "G64"}
_RETRACTS: Final = {98.0: "G98", 99.0: "G99"}


def tidy(text: str, controller: Controller) -> str:
    """Return startup codes as in a `Setup`, such as ``G64 P0.01 G98``."""
    line = read_line(text, 1, controller)
    rest = line.assignments or line.comment or line.label or line.flow or line.demarcation or line.optional
    if line.error or rest or any(w.number is None for w in line.words):
        raise InputError(f"{text!r}: {line.error or 'expected codes and plain numbers only'}")
    path, retract = _of(line.words, _PATHS), _of(line.words, _RETRACTS)
    lengths = {w.letter: w.value for w in line.words if w.letter in "PQ"}
    if len(path) + len(retract) + len(lengths) < len(line.words) or not line.words:
        raise InputError(
            f"{text!r}: startup codes may only be G61, G61.1 or G64, and G98 or G99; put all other codes in the program"
        )
    if len(path) > 1 or len(retract) > 1:
        raise InputError(f"{text!r}: {' and '.join(path if len(path) > 1 else retract)} exclude each other")
    if lengths and (path != ["G64"] or controller == "fanuc" or "P" not in lengths or "-" in "".join(lengths.values())):
        raise InputError(f"{text!r}: P and Q are tolerances of LinuxCNC's G64 [mm]: P alone or P and Q, not negative")
    return " ".join((*path, *(letter + value.replace(" ", "") for letter, value in sorted(lengths.items())), *retract))


def modal(setup: Setup) -> Modal:
    """Return the modal state at the start of a program; default of an unspecified path: ``G64`` without tolerance."""
    words = read_line(setup.startup, 1, setup.controller).words
    path, retract = _of(words, _PATHS), _of(words, _RETRACTS)
    lengths = {w.letter: w.number or 0.0 for w in words if w.letter in "PQ"}
    blend = lengths.get("P", 0.0)
    return Modal(
        inch=bool(setup.inch),
        # defaults: LinuxCNC's interpreter starts with G99, Fanuc with G98
        retract=int(retract[0][1:]) if retract else 98 if setup.controller == "fanuc" else 99,
        retract_stated=bool(retract),
        blend=None if path and path != ["G64"] else blend,
        naive=lengths.get("Q", blend) if blend else 0.0,
        exact_stop=path == ["G61.1"],
    )


def complete_codes(setup: Setup) -> str:
    """Return the startup codes for an interpreter, including the defaults of `modal`."""
    words = read_line(setup.startup, 1, setup.controller).words
    path = "" if _of(words, _PATHS) else "G64"
    retract = "" if _of(words, _RETRACTS) else f"G{modal(setup).retract}"
    return " ".join(filter(None, (path, setup.startup, retract)))


def _of(words: list[Word], group: dict[float, str]) -> list[str]:
    return [group[w.number] for w in words if w.letter == "G" and w.number in group]
