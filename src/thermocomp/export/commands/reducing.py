"""What `thermocomp export` writes for controllers that hold less than a model."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, TypeVar

from cyclopts import Parameter

from thermocomp.cli.beginning import Beginning
from thermocomp.cli.progress import show_steps
from thermocomp.cli.reading import read_recordings, tell_trouble
from thermocomp.core.correction import Limits
from thermocomp.core.exceptions import InputError
from thermocomp.core.model import ErrorModel
from thermocomp.core.position import PositionModel
from thermocomp.export.facts import Facts
from thermocomp.export.reduction.reduced import Reduced, Shape, as_it_is, find_axis, fits, mark
from thermocomp.export.target import Target

if TYPE_CHECKING:
    from thermocomp.export.reduction.judging import Reduction

_Model = TypeVar("_Model", bound=ErrorModel | PositionModel)


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class ReductionOptions:
    """How a model is reduced to what klipper, heidenhain and fanuc hold.

    Parameters
    ----------
    most_loss : float
        Largest loss that is let pass: RMS on unseen cycles over that of the full model.
    axes : list of str
        Which targets are written and along which axes they go, such as ch5_um=Z; by their names if not given: z_um is
        Z.
    sensors : list of str
        Temperatures that the controller has, to choose from; all of the recordings if not given.
    mapping : Path
        TOML file that says what the columns of the recordings are.
    harm_margin : float
        Tolerated degradation in a single cycle [um]; as in ``thermocomp fit`` if not given.
    jobs : int
        Processes to share the work among; -1 takes all cores.
    """

    most_loss: float = 2.0
    axes: list[str] | None = None
    sensors: list[str] | None = None
    mapping: Path | None = None
    harm_margin: float | None = None
    jobs: int = -1

    def named(self) -> dict[str, str]:
        """Return the axes by target."""
        found = {}
        for text in self.axes or ():
            target, _, axis = text.rpartition("=")
            if not target or axis.upper() not in ("X", "Y", "Z"):
                raise InputError(f"--axes {text}: want a target and X, Y or Z, such as z_um=Z")
            found[target] = axis.upper()
        return found


class Outcome(NamedTuple):
    """What comes of an export."""

    texts: dict[str, bytes]  #: files by their names
    refused: dict[str, str]  #: targets that may not be written, and why
    elsewhere: dict[str, str]  #: targets that the controller does not correct, and why


def export_reduced(
    to: str,
    target: Target,
    models: Sequence[ErrorModel],
    recordings: list[Path],
    options: ReductionOptions,
    beginning: Beginning,
    limits: Limits,
    name: str,
    facts: Facts,
    accept_unproven: str | None,
    *,
    hidden: bool,
) -> Outcome:
    """Make the files of an export.

    Parameters
    ----------
    to : str
        Name of the target.
    target : Target
        With a shape.
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
    hidden : bool
        Show no progress.

    Raises
    ------
    InputError
        None goes along an axis that the controller corrects, or two along one; a model has to be reduced, and there is
        no recording; or the correction would run into its limit.
    """
    assert target.shape is not None
    shape = target.shape
    wanted, axes, elsewhere = along_axes(models, options, to, shape.axes)
    more = [m for m in wanted if not fits(m, shape) or not _has(options, m)]
    if more and not recordings:
        held = f"{to} holds {_told(shape.sensors)}{', of --sensors' if options.sensors else ''}"
        raise InputError(
            f"{held}, and the model of {', '.join(m.target for m in more)} is more than that: name recordings to "
            f"reduce it on, such as: thermocomp export {facts.source} drift.csv --to {to}"
        )
    reductions = _reduce(more, axes, recordings, options, beginning, shape, hidden=hidden) if more else {}
    refused, found = dict[str, str](), list[Reduced]()
    for m in wanted:
        r = reductions[m.target].reduced if m.target in reductions else as_it_is(m, axes[m.target])
        r = replace(r, model=r.model.taken(accept_unproven))
        if why := r.why_not(options.most_loss):
            refused[m.target] = why
        else:
            found.append(r)
            if target.limited:
                _check_limit(r, limits, to)
    if not found:
        return Outcome({}, refused, elsewhere)
    name = f"tc_{mark(name)}"
    drawn = [reductions[r.model.target] for r in found if r.model.target in reductions]
    figure = f"{name}_reduced.svg" if drawn else ""
    texts = target.write(found, limits, name, facts, figure=figure)
    return Outcome((_figure(figure, drawn) if drawn else {}) | texts, refused, elsewhere)


def along_axes(
    models: Sequence[_Model], options: ReductionOptions, to: str, corrected: str
) -> tuple[list[_Model], dict[str, str], dict[str, str]]:
    """Return the models that a controller takes, the axes by target, and why others are left out.

    Parameters
    ----------
    models : sequence of ErrorModel or PositionModel
    options : ReductionOptions
    to : str
        The controller.
    corrected : str
        Letters of the axes that it corrects.

    Raises
    ------
    InputError
        None goes along one of these, or two along one.
    """
    axes = _find_axes(models, options)
    elsewhere = {m.target: why for m in models if (why := _why_elsewhere(m, axes[m.target], to, corrected))}
    wanted = [m for m in models if m.target not in elsewhere]
    if not wanted:
        raise InputError(f"nothing to write: {'; '.join(f'{t}: {why}' for t, why in elsewhere.items())}")
    _refuse_twice([(m.target, axes[m.target]) for m in wanted])
    return wanted, axes, elsewhere


def _why_elsewhere(model: ErrorModel | PositionModel, axis: str, to: str, corrected: str) -> str:
    if model.unit != "um":
        return f"it predicts {model.unit}, and a correction is in um"
    if not axis:
        return f"its axis is not known: --axes {model.target}=X, =Y or =Z names it"
    if isinstance(model, PositionModel) and axis != model.axis:
        return f"it runs along {model.axis}, and --axes says {axis}"
    return "" if axis in corrected else f"it is of {axis}, and {to} corrects {corrected} alone"


def _has(options: ReductionOptions, model: ErrorModel) -> bool:
    """Return whether the controller has the temperatures of a model."""
    return options.sensors is None or {i.name for i in model.inputs} <= set(options.sensors)


def _refuse_twice(wanted: Sequence[tuple[str, str]]) -> None:
    along = {axis: [t for t, other in wanted if other == axis] for _, axis in wanted}
    twice = {axis: targets for axis, targets in along.items() if len(targets) > 1}
    if twice:
        found = "; ".join(f"{', '.join(targets)} are all of {axis}" for axis, targets in twice.items())
        one = " ".join(f"{targets[0]}={axis}" for axis, targets in along.items())
        raise InputError(f"{found}: name one of each axis, such as --axes {one}")


def _check_limit(r: Reduced, limits: Limits, to: str) -> None:
    """Refuse a limit that the reduced model, which was judged without one, would run into."""
    if r.most > limits.magnitude:
        raise InputError(
            f"{r.model.target}: the reduced model corrects by up to {r.most:.0f} um in these recordings, and was "
            f"judged so; {to} would stop at {limits.magnitude:g} um: give --magnitude {1.2 * r.most:.0f}, if it may"
        )


def _find_axes(models: Sequence[ErrorModel | PositionModel], options: ReductionOptions) -> dict[str, str]:
    """Return the axis of each target; empty where none is known, or others are named."""
    named, targets = options.named(), [m.target for m in models]
    if unknown := [t for t in named if t not in targets]:
        raise InputError(f"--axes {', '.join(unknown)}: no such target; there are {', '.join(targets)}")
    known = named or {m.target: m.axis for m in models if isinstance(m, PositionModel)}
    return {t: find_axis(t, known) if not named or t in named else "" for t in targets}


def _reduce(
    models: Sequence[ErrorModel],
    axes: dict[str, str],
    paths: list[Path],
    options: ReductionOptions,
    beginning: Beginning,
    shape: Shape,
    *,
    hidden: bool,
) -> "dict[str, Reduction]":
    tests = read_recordings(paths, options.mapping)
    tell_trouble(tests)
    from thermocomp.export.reduction.judging import reduce_model
    from thermocomp.judging.results import Rules

    starts = beginning.of(tests, options.mapping)
    found = {}
    with show_steps(len(models), hidden=hidden) as progress:
        for m in models:
            found[m.target] = reduce_model(
                m, axes[m.target], tests, shape,
                sensors=options.sensors, starts=starts, rules=Rules(options.harm_margin), jobs=options.jobs,
            )  # fmt: skip
            progress(f"{m.target} reduced")
    return found


def _figure(name: str, reductions: "Sequence[Reduction]") -> dict[str, bytes]:
    from thermocomp.export.reduction.figures import residuals

    return {name: residuals(reductions).encode()}


def _told(sensors: int) -> str:
    return "one coefficient of one temperature" if sensors == 1 else f"a linear formula of up to {sensors} temperatures"
