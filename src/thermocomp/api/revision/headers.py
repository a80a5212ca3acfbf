"""What the header of a revised program says of its run."""

import math
from collections.abc import Sequence

from thermocomp.adapters.linuxcnc.verification.verify import Proof
from thermocomp.nc.interpreter.block import Setup, system_name
from thermocomp.nc.rewrite.course import Bound
from thermocomp.nc.rewrite.elsewhere import AWAY, Elsewhere
from thermocomp.nc.rewrite.header import wrap_text

UNPROVED = "UNPROVED: NO INTERPRETER HAS JUDGED IT"
#: most lines for the models, for the place, and for the proof
_MODELS, _PLACE, _PROOF = 2, 3, 4
#: lines for all else: that it has been revised, when, which program, start, zero, method, bound
_ALWAYS = 7


def count_lines(models: Sequence[str], taken: Sequence[str], *, by_position: bool, unproved: bool) -> int:
    """Return how many lines a header has, before it is known what they say.

    Parameters
    ----------
    models, taken : sequence of str
        What is told of models, and of those who take unproven ones.
    by_position : bool
        The drift depends on the place.
    unproved : bool

    Returns
    -------
    int
    """
    told = min(len(models), _MODELS) + len(told_taken(taken))
    return _ALWAYS + told + _PLACE * by_position + (1 if unproved else _PROOF)


def describe_models(models: Sequence[str]) -> list[str]:
    """Return the lines about the models, the last ones on one line."""
    said = [f"model {m}" for m in models]
    return said if len(said) <= _MODELS else [*said[: _MODELS - 1], ", ".join(said[_MODELS - 1 :])]


def told_taken(taken: Sequence[str]) -> list[str]:
    """Return the line about unproven models: who takes them."""
    return [f"unproven, taken by {'; '.join(taken)}"] if taken else []


def describe_bound(bounds: Sequence[Bound]) -> str:
    """Return how far the tool may be off in the cuts."""
    return "bound " + ", ".join(
        f"{b.axis} {b.most:.1f} um" if math.isfinite(b.most) else f"{b.axis} not known" for b in bounds
    )


def describe_proof(proof: Proof | None) -> list[str]:
    """Return in which states of the controller it was proved."""
    return [UNPROVED] if proof is None else wrap_text(f"proved {proof.sentence}", _PROOF)


def describe_place(setup: Setup, elsewhere: Elsewhere, axes: Sequence[str]) -> list[str]:
    """Return for which origins and tools it was made, and what others would cost."""
    return [*wrap_text(f"made for {describe_origins(setup)}", _PLACE - 1), cost(elsewhere, axes)]


def describe_origins(setup: Setup) -> str:
    """Return the origins and lengths of tools that a drift along the axes was computed for."""
    origins = [
        f"{system_name(system)} " + " ".join(f"{a}{v:g}" for a, v in zip("XYZ", place, strict=True))
        for system, place in setup.offsets.items()
    ]
    tools = [f"T{tool} {length:g}" for tool, length in setup.tools.items()]
    return f"{', '.join(origins + tools)} mm" if origins or tools else "the origins that the program sets"


def cost(elsewhere: Elsewhere, axes: Sequence[str]) -> str:
    """Return what another work offset or tool length would cost."""
    costs = ", ".join(f"{axis} {elsewhere.most['XYZ'.index(axis)]:.1f} um" for axis in axes)
    return f"{AWAY:g} mm of another offset cost up to {costs}"
