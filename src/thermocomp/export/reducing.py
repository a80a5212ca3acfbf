"""Export to a controller that supports reduced models only: choice of models and axes, and loss of accuracy."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple, TypeVar

from thermocomp.core.correction import Limits
from thermocomp.core.exceptions import InputError
from thermocomp.core.model import ErrorModel
from thermocomp.core.position import PositionModel
from thermocomp.export.facts import Facts
from thermocomp.export.reduction.options import ReductionOptions
from thermocomp.export.reduction.reduced import Reduced, Shape, as_it_is, find_axis, fits, mark
from thermocomp.export.target import Target

if TYPE_CHECKING:
    from thermocomp.api.inputs import Starts
    from thermocomp.api.keywords import Listener
    from thermocomp.export.reduction.judging import Reduction
    from thermocomp.recordings.recording import Recording

_Model = TypeVar("_Model", bound=ErrorModel | PositionModel)


@dataclass(frozen=True, kw_only=True)
class ExportOrder:
    """Settings of an export to be written.

    Parameters
    ----------
    to : str
        Name of the target.
    name : str
        Name of the files.
    """

    to: str
    target: Target
    limits: Limits
    name: str
    facts: Facts
    options: ReductionOptions


class Outcome(NamedTuple):
    """Result of an export: its files, and the targets that are not exported."""

    files: dict[str, bytes]  #: by file name
    refused: dict[str, str]  #: targets that must not be exported, with the reason
    elsewhere: dict[str, str]  #: targets that the controller does not correct, with the reason


def export_reduced(
    order: ExportOrder,
    models: Sequence[ErrorModel],
    recordings: "Sequence[Recording]",
    starts: "Starts",
    accept_unproven: str | None,
    listener: "Listener",
) -> Outcome:
    """Create the files of an export to a controller that supports reduced models only."""
    to, shape, options = order.to, order.target.shape, order.options
    assert shape is not None
    wanted, axes, elsewhere = along_axes(models, options, to, shape.axes)
    more = [m for m in wanted if not fits(m, shape) or not _has(options, m)]
    if more and not recordings:
        held = f"{to} supports only {_told(shape.sensors)}{', of --sensors' if options.sensors else ''}"
        raise InputError(
            f"{held}, and the model of {', '.join(m.target for m in more)} is more complex: name recordings "
            f"for its reduction, such as: thermocomp export {order.facts.source} drift.csv --to {to}"
        )
    reductions = _reduce(more, axes, recordings, options, starts, shape, listener) if more else {}
    refused, found = dict[str, str](), list[Reduced]()
    for m in wanted:
        r = reductions[m.target].reduced if m.target in reductions else as_it_is(m, axes[m.target])
        r = replace(r, model=r.model.taken(accept_unproven))
        if why := r.why_not(options.most_loss):
            refused[m.target] = why
        else:
            found.append(r)
            if order.target.limited:
                _check_limit(r, order.limits, to)
    if not found:
        return Outcome({}, refused, elsewhere)
    name = f"tc_{mark(order.name)}"
    drawn = [reductions[r.model.target] for r in found if r.model.target in reductions]
    figure = f"{name}_reduced.svg" if drawn else ""
    more_settings = {"program": options.program} if order.target.program else {}
    texts = order.target.write(found, order.limits, name, order.facts, figure=figure, **more_settings)
    return Outcome((_figure(figure, drawn) if drawn else {}) | texts, refused, elsewhere)


def along_axes(
    models: Sequence[_Model], options: ReductionOptions, to: str, corrected: str
) -> tuple[list[_Model], dict[str, str], dict[str, str]]:
    """Return the models supported by a controller, their axes by target, and the reason for each omitted model."""
    axes = _find_axes(models, options)
    elsewhere = {m.target: why for m in models if (why := _why_elsewhere(m, axes[m.target], to, corrected))}
    wanted = [m for m in models if m.target not in elsewhere]
    if not wanted:
        raise InputError(f"nothing to write: {'; '.join(f'{t}: {why}' for t, why in elsewhere.items())}")
    _refuse_twice([(m.target, axes[m.target]) for m in wanted])
    return wanted, axes, elsewhere


def _why_elsewhere(model: ErrorModel | PositionModel, axis: str, to: str, corrected: str) -> str:
    if model.unit != "um":
        return f"it predicts {model.unit}, but a correction is in um"
    if not axis:
        return f"its axis is not known: give it with --axes {model.target}=X, =Y or =Z"
    if isinstance(model, PositionModel) and axis != model.axis:
        return f"its axis is {model.axis}, but --axes specifies {axis}"
    return "" if axis in corrected else f"its axis is {axis}, but {to} corrects {corrected} only"


def _has(options: ReductionOptions, model: ErrorModel) -> bool:
    """Return whether the controller has all temperatures of a model."""
    return options.sensors is None or {i.name for i in model.inputs} <= set(options.sensors)


def _refuse_twice(wanted: Sequence[tuple[str, str]]) -> None:
    along = {axis: [t for t, other in wanted if other == axis] for _, axis in wanted}
    twice = {axis: targets for axis, targets in along.items() if len(targets) > 1}
    if twice:
        found = "; ".join(f"{', '.join(targets)} are all for axis {axis}" for axis, targets in twice.items())
        one = " ".join(f"{targets[0]}={axis}" for axis, targets in along.items())
        raise InputError(f"{found}: name one target for each axis, such as --axes {one}")


def _check_limit(r: Reduced, limits: Limits, to: str) -> None:
    """Reject a limit that the reduced model, which was judged without limits, would reach."""
    if r.most > limits.magnitude:
        raise InputError(
            f"{r.model.target}: the reduced model corrects by up to {r.most:.0f} um in these recordings, and was "
            f"judged without a limit; {to} would stop at {limits.magnitude:g} um: give --magnitude "
            f"{1.2 * r.most:.0f} if such a large correction is permitted"
        )


def _find_axes(models: Sequence[ErrorModel | PositionModel], options: ReductionOptions) -> dict[str, str]:
    """Return the axis of each target; empty if unknown, or if only other targets are named."""
    named, targets = options.named(), [m.target for m in models]
    if unknown := [t for t in named if t not in targets]:
        raise InputError(f"--axes {', '.join(unknown)}: no such target; there are {', '.join(targets)}")
    known = named or {m.target: m.axis for m in models if isinstance(m, PositionModel)}
    return {t: find_axis(t, known) if not named or t in named else "" for t in targets}


def _reduce(
    models: Sequence[ErrorModel],
    axes: dict[str, str],
    tests: "Sequence[Recording]",
    options: ReductionOptions,
    starts: "Starts",
    shape: Shape,
    listener: "Listener",
) -> "dict[str, Reduction]":
    from thermocomp.export.reduction.judging import reduce_model
    from thermocomp.judging.results import Rules

    listener.begin(lambda: len(models))
    found = {}
    for m in models:
        found[m.target] = reduce_model(
            m, axes[m.target], tests, shape,
            sensors=options.sensors, starts=starts, rules=Rules(options.harm_margin), jobs=options.jobs,
        )  # fmt: skip
        listener.tell(f"{m.target} reduced")
    return found


def _figure(name: str, reductions: "Sequence[Reduction]") -> dict[str, bytes]:
    from thermocomp.export.reduction.figures import residuals

    return {name: residuals(reductions).encode()}


def _told(sensors: int) -> str:
    return "one coefficient of one temperature" if sensors == 1 else f"a linear formula of up to {sensors} temperatures"
