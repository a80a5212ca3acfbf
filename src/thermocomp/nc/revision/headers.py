"""Information about the revision in the header of a revised program."""

import math
from collections.abc import Sequence

from thermocomp.nc.interpreter.block import system_name
from thermocomp.nc.linuxcnc.verification.verify import Proof
from thermocomp.nc.rewrite.conditions import Assumption
from thermocomp.nc.rewrite.course import Bound
from thermocomp.nc.rewrite.demand import AWAY, Elsewhere
from thermocomp.nc.rewrite.header import wrap_text
from thermocomp.nc.rewrite.revise import Revision

UNPROVED = "UNPROVED: NO INTERPRETER HAS VERIFIED IT"
#: maximum number of lines for the models, and for origins and tools
_MODELS, _PLACE = 2, 3
#: number of other lines: note of the revision, version and date, program, start, zero, method, bound
_ALWAYS = 7


def count_lines(
    models: Sequence[str], taken: Sequence[str], states: str, *, by_position: bool, conditions: int = 0
) -> int:
    """Return the number of lines of a header, before their content is known."""
    told = min(len(models), _MODELS) + len(told_taken(taken))
    # plus one line: the settings without which the original does not run are only known later
    proof = len(wrap_text(f"proved {states}")) + 1 if states else 1
    return _ALWAYS + conditions + told + _PLACE * by_position + proof


def describe_models(models: Sequence[str]) -> list[str]:
    """Return the lines about the models; the last line lists all models for which no line is left."""
    said = [f"model {m}" for m in models]
    return said if len(said) <= _MODELS else [*said[: _MODELS - 1], ", ".join(said[_MODELS - 1 :])]


def told_taken(taken: Sequence[str]) -> list[str]:
    """Return the line about unproven models, with the persons who approved them."""
    return [f"unproven, approved by {'; '.join(taken)}"] if taken else []


def describe_bound(bounds: Sequence[Bound]) -> str:
    """Return the line about the error bounds of the tool position in the cuts."""
    return "bound, as assumed: " + ", ".join(
        f"{b.axis} {b.most:.1f} um" if math.isfinite(b.most) else f"{b.axis} not known" for b in bounds
    )


def describe_conditions(revision: Revision, axes: Sequence[str]) -> list[str]:
    """Return a line for each assumption of the bound: what was assumed, and what its range would add."""
    return [_describe(condition, revision, axes) for condition in revision.conditions.every]


def _describe(condition: Assumption, revision: Revision, axes: Sequence[str]) -> str:
    counted = condition.kind in ("stop", "tool change")
    name = condition.kind + f" x{condition.count}" * counted
    if not condition.count:
        return f"{condition.kind}: none"
    said = f"{name} as {condition.taken}"
    if not condition.runs:
        return said
    added = condition.added(revision.left)
    worth = [f"{a} {added[k]:.{0 if added[k] >= 9.95 else 1}f}" for k, a in enumerate("XYZ") if a in axes]
    return f"{said}: {' to '.join(run.text for run in condition.runs)} adds {', '.join(worth)} um"


def describe_proof(proof: Proof | None, lines: int) -> list[str]:
    """Return the description of the verification, including the controller states, in a given number of lines."""
    return [UNPROVED] if proof is None else wrap_text(f"proved {proof.sentence}", lines)


def describe_place(revision: Revision, axes: Sequence[str]) -> list[str]:
    """Return the lines about the origins and tools of the revision, and the error with others."""
    return [*wrap_text(f"valid for {describe_origins(revision)}", _PLACE - 1), cost(revision.elsewhere, axes)]


def describe_origins(revision: Revision) -> str:
    """Return the origins and tool lengths for which the drift along the axes was computed."""
    setup = revision.setup
    origins = [
        f"{system_name(system)} " + " ".join(f"{a}{v:g}" for a, v in zip("XYZ", place, strict=True))
        for system, place in setup.offsets.items()
    ]
    tools = [f"T{tool} {length:g}" for tool, length in setup.tools.items()]
    said = f"{', '.join(origins + tools)} mm" if origins or tools else "the origins that the program sets"
    return said + ", G54 in force at the start" * revision.taken_system


def cost(elsewhere: Elsewhere, axes: Sequence[str]) -> str:
    """Return the error that another work offset or tool length would cause."""
    costs = ", ".join(f"{axis} {elsewhere.most['XYZ'.index(axis)]:.1f} um" for axis in axes)
    return f"{AWAY:g} mm offset change: error up to {costs}"
