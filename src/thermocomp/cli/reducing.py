"""What `thermocomp export` writes for controllers that hold less than a model."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from cyclopts import Parameter

from thermocomp.cli.beginning import Beginning
from thermocomp.cli.options import read_recordings, tell_trouble
from thermocomp.core.correction import Limits
from thermocomp.core.exceptions import InputError
from thermocomp.core.model import ErrorModel
from thermocomp.exporters.facts import Facts
from thermocomp.exporters.fanuc import write_fanuc
from thermocomp.exporters.heidenhain import write_heidenhain
from thermocomp.exporters.klipper import write_klipper
from thermocomp.exporters.reduced import SHAPES, Reduced, as_it_is, find_axis, fits, mark

if TYPE_CHECKING:
    from thermocomp.assessment.reduction import Reduction

WRITERS: dict[str, Callable[..., dict[str, bytes]]] = {
    "klipper": write_klipper,
    "heidenhain": write_heidenhain,
    "fanuc": write_fanuc,
}


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class ReductionOptions:
    """How a model is reduced to what klipper, heidenhain and fanuc hold.

    Parameters
    ----------
    most_loss : float
        Largest loss that is let pass: RMS on unseen cycles over that of the full model.
    axes : list of str
        Which targets are written and along which axes they go, such as ch5_um=Z; by their names if not given: z_um is Z.
    sensors : list of str
        Temperatures that the controller has, to choose from; all of the recordings if not given.
    mapping : Path
        TOML file that says what the columns of the recordings are.
    harm_margin : float
        Harm in a single cycle that is let pass [um]; as in ``thermocomp fit`` if not given.
    """

    most_loss: float = 2.0
    axes: list[str] | None = None
    sensors: list[str] | None = None
    mapping: Path | None = None
    harm_margin: float | None = None

    def named(self) -> dict[str, str]:
        """Return the axes by target."""
        found = {}
        for text in self.axes or ():
            target, _, axis = text.rpartition("=")
            if not target or axis.upper() not in ("X", "Y", "Z"):
                raise InputError(f"--axes {text}: want a target and X, Y or Z, such as z_um=Z")
            found[target] = axis.upper()
        return found


def export_reduced(
    to: str,
    models: Sequence[ErrorModel],
    recordings: list[Path],
    options: ReductionOptions,
    beginning: Beginning,
    limits: Limits,
    name: str,
    facts: Facts,
    accept_unproven: str | None,
) -> tuple[dict[str, bytes], dict[str, str]]:
    """Return the files of an export by their names, and why targets are left out.

    Parameters
    ----------
    to : str
        A key of `WRITERS`.
    models : sequence of ErrorModel
    recordings : list of Path
        That they are reduced on.
    options : ReductionOptions
    beginning : Beginning
        How the recordings begin.
    limits : Limits
    name : str
        Of the files.
    facts : Facts
    accept_unproven : str or None
        Who takes an unproven model, and why.

    Raises
    ------
    InputError
        A model has to be reduced, and there is no recording; or the correction would run into its limit.
    """
    shape, axes, left = SHAPES[to], _find_axes(models, options), dict[str, str]()
    wanted = []
    for m in models:
        axis = axes[m.target]
        if m.unit != "um":
            left[m.target] = f"it predicts {m.unit}, and a correction is in um"
        elif not axis:
            left[m.target] = f"its name says no axis, or --axes does not name it: --axes {m.target}=Z says Z"
        elif axis not in shape.axes:
            left[m.target] = f"it is of {axis}, and {to} corrects {shape.axes} alone"
        else:
            wanted.append(m)
    letters = [axes[m.target] for m in wanted]
    if twice := {a for a in letters if letters.count(a) > 1}:
        of = ", ".join(m.target for m in wanted if axes[m.target] in twice)
        raise InputError(f"{of} are of the same axis: name those that are meant with --axes, such as --axes {of[:12]}")
    whole = [m for m in wanted if not fits(m, shape)]
    if whole and not recordings:
        raise InputError(
            f"{to} holds {_told(shape.sensors)}, and the model of {', '.join(m.target for m in whole)} is more than that: "
            f"name recordings to reduce it on, such as: thermocomp export {facts.source} drift.csv --to {to}"
        )
    reductions = _reduce(whole, axes, recordings, options, beginning, to) if whole else {}
    found: list[Reduced] = []
    for m in wanted:
        r = reductions[m.target].reduced if m.target in reductions else as_it_is(m, axes[m.target])
        r = replace(r, model=r.model.taken(accept_unproven))
        if why := r.why_not(options.most_loss):
            left[m.target] = why
        else:
            found.append(r)
    for r in found if to != "heidenhain" else ():
        if r.most > limits.magnitude:
            raise InputError(
                f"{r.model.target}: the reduced model corrects by up to {r.most:.0f} um in these recordings, and was judged "
                f"so; give --magnitude {1.2 * r.most:.0f}, for {to} would stop at {limits.magnitude:g} um"
            )
    if not found:
        return {}, left
    name = f"tc_{mark(name)}"
    drawn = [reductions[r.model.target] for r in found if r.model.target in reductions]
    figure = f"{name}_reduced.svg" if drawn else ""
    texts = WRITERS[to](found, limits, name, facts, figure=figure)
    return (_figure(figure, drawn) if drawn else {}) | texts, left


def _find_axes(models: Sequence[ErrorModel], options: ReductionOptions) -> dict[str, str]:
    """Return the axis of each target; empty where none is known, or others are named."""
    named, targets = options.named(), [m.target for m in models]
    if unknown := [t for t in named if t not in targets]:
        raise InputError(f"--axes {', '.join(unknown)}: no such target; there are {', '.join(targets)}")
    return {t: find_axis(t, named) if not named or t in named else "" for t in targets}


def _reduce(
    models: Sequence[ErrorModel],
    axes: dict[str, str],
    paths: list[Path],
    options: ReductionOptions,
    beginning: Beginning,
    to: str,
) -> "dict[str, Reduction]":
    tests = read_recordings(paths, options.mapping)
    tell_trouble(tests)
    from thermocomp.assessment.reduction import reduce_model
    from thermocomp.assessment.results import Rules

    starts = beginning.of(tests, options.mapping)
    return {
        m.target: reduce_model(
            m, axes[m.target], tests, SHAPES[to],
            sensors=options.sensors, starts=starts, rules=Rules(options.harm_margin), jobs=-1,
        )
        for m in models
    }  # fmt: skip


def _figure(name: str, reductions: "Sequence[Reduction]") -> dict[str, bytes]:
    from thermocomp.report.reduction import residuals

    return {name: residuals(reductions).encode()}


def _told(sensors: int) -> str:
    return "one coefficient of one temperature" if sensors == 1 else f"a linear formula of up to {sensors} temperatures"
