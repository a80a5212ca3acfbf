"""Selection by sensor budget: the smallest sufficient set, the gain of each further sensor, and virtual sensors."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from thermocomp.core.exceptions import FitError
from thermocomp.judging.budget import SHARE, WORTH, Budget, budget
from thermocomp.judging.candidates import Candidates
from thermocomp.judging.choice import Cell, Choice, Progress, Settings, Table
from thermocomp.judging.sensorsets import PERCENT
from thermocomp.judging.splits import Judging
from thermocomp.recordings.samples import Samples

#: sensors that contribute a smaller fraction to a virtual temperature are not named
PART = 0.2


def choose(samples: Samples, judging: Judging, settings: Settings, *, jobs: int, progress: Progress) -> Choice:
    """Select sensors for all targets together by the error on unseen blocks as a function of their number.

    Notes
    -----
    If no set is better than no compensation, no sensors are selected, and `Choice.failure` states the reason.
    """
    candidates = [Candidates.of(samples, t) for t in range(len(samples.targets))]
    most = settings.most("pareto")
    found = budget(samples, judging, settings.models, max_sensors=most, jobs=jobs, progress=progress)
    targets = ", ".join(found.targets)
    if found.margin() is None:
        raise FitError(f"{targets}: none of the models could be judged in every block: {_failed(found)}")
    recommended = found.recommended()
    m, best = np.unravel_index(int(np.nanargmin(found.mean())), found.mean().shape)
    model, place = recommended or (found.models[int(m)], int(best))
    sensors, (error, none) = found.sensors[place], found.stated(model, place)
    told = f"{model} with {len(sensors)} of {len(found.candidates)} temperatures leaves {error:.2f} {_rms(found)} on "
    told += f"unseen cycles{_mean(found)}, instead of {none:.2f} {found.unit}"
    tables = [
        _errors(found, judging, model, place if recommended else None),
        _by_target(found, model, place),
    ]
    notes, failure = _notes(found, judging), ""
    if recommended is None:
        sensors = ()
        reason = failure = f"no set of temperatures is clearly better than no compensation; the smallest error: {told}"
    else:
        reason = f"{told}; {trade_off(found, model, place)}"
        notes[1:1] = _advice(found, model, place)
        tables += [
            *([_next(found, model, place)] if len(found.sensors) > 1 else []),
            _frequency(found, place),
            *([_stand_ins(found, place)] if len(found.candidates) > 1 else []),
            _repeats(candidates, sensors),
        ]
    return Choice(
        method="pareto",
        target=targets,
        sensors=sensors,
        reason=reason,
        tables=tuple(tables),
        notes=tuple(notes),
        details=found,
        failure=failure,
    )


def _notes(found: Budget, judging: Judging) -> list[str]:
    """Return the reason for the number of sensors, and the cases that could not be judged."""
    notes = [_rule(found)]
    if found.failures:
        notes.append(f"Some numbers of sensors could not be judged: {_failed(found)}")
    if len(found.blocks) < len(judging.splits):
        several = "one of the targets" if len(found.targets) > 1 else "the target"
        notes.append(f"{len(judging.splits) - len(found.blocks)} block(s) without a value of {several} were left out.")
    return notes


def _advice(found: Budget, model: str, place: int) -> list[str]:
    """Return the advantages and drawbacks of the recommended sensors."""
    left = found.of_targets()[found.models.index(model), place]
    idle = [t for t, e, none in zip(found.targets, left, found.none_of_targets(), strict=True) if e >= none]
    none_better = f"These sensors are no better than no compensation for {', '.join(idle)}: select for it separately."
    return [
        *([none_better] if idle else []),
        next_to_buy(found, model, place),
        "Each set contains the sensors from which the others can be predicted with the smallest change of the output "
        "of `averaged`; the sets are the same for all displacements and models. The number of sensors was chosen by "
        "the errors shown, so these are slightly optimistic.",
    ]


def _failed(found: Budget) -> str:
    return "; ".join(f"{model}: {why}" for model, why in found.failures.items())


def _rms(found: Budget) -> str:
    """Return the name of the error over all unseen rows."""
    return "% of the RMS without compensation" if found.unit == PERCENT else f"{found.unit} RMS"


def _mean(found: Budget) -> str:
    return f" (mean of {len(found.targets)} displacements)" if len(found.targets) > 1 else ""


def _errors(found: Budget, judging: Judging, model: str, place: int | None) -> Table:
    mean, gains = found.mean(), [*found.gains(model)[0].tolist(), None]
    rows = tuple(
        (size, *(float(v) for v in mean[:, k]), gains[k], float(found.condition[k]), " ".join(found.sensors[k]))
        for k, size in enumerate(found.sizes)
    )
    headings = [f"{m} mean RMS [{found.unit}]" for m in found.models]
    return Table(
        title=f"Error on unseen blocks: {judging.name}",
        columns=(
            "sensors",
            *headings,
            f"gain of the next row [{found.unit}]",
            "condition number",
            "selected on all rows",
        ),
        rows=rows,
        marked=place,
        caption=f"RMS on each unseen block, mean over the blocks{_mean(found)}, to compare sets; without compensation "
        f"{found.none_mean():.2f} {found.unit}. Gain of the next row: reduction of the error of {model} by the "
        "additional sensors of the next row. Sufficient number of sensors: "
        + ", ".join(f"{found.enough(m) or 'none'} for {m}" for m in found.models)
        + ".",
    )


def _by_target(found: Budget, model: str, place: int) -> Table:
    errors = found.of_targets()[found.models.index(model)]
    rows = (
        (0, *found.none_of_targets().tolist()),
        *((n, *e) for n, e in zip(found.sizes, errors.tolist(), strict=True)),
    )
    more = (errors[place] - errors[-1]) / found.scales
    worst = int(np.argmax(more))
    return Table(
        title=f"Error on unseen blocks for each displacement: {model}",
        columns=("sensors", *(f"{t} RMS" for t in found.targets)),
        rows=rows,
        marked=1 + place,
        caption="Over all unseen rows, as in `compare` and `fit`, each in the unit of the displacement; 0 sensors: "
        "without compensation."
        + (
            f" {found.targets[worst]} is affected most: {more[worst]:.2f} {found.unit} more than with all sensors."
            if place + 1 < len(errors)
            else ""
        ),
    )


def _next(found: Budget, model: str, place: int) -> Table:
    """Return the gain of the next sensor after each number of sensors, and its consistency over the blocks."""
    gains, blocks = found.gains(model)
    unit = found.unit
    return Table(
        title="Next sensor to buy",
        columns=("sensors", "next", f"gain [{unit}]", f"in the worst block [{unit}]", f"in the best block [{unit}]"),
        rows=tuple(
            (found.sizes[k], _joins(found, k), float(gains[k]), float(blocks[k].min()), float(blocks[k].max()))
            for k in range(len(gains))
        ),
        marked=place if place < len(gains) else None,
        caption=f"Gain: reduction of the error of {model}; if negative, the error is larger with the sensor than "
        "without it. For each block, the sensors were selected with this block excluded.",
    )


def _joins(found: Budget, place: int) -> str:
    """Return the name of the sensor added next; for the step from the largest set to all, the number added."""
    new = [s for s in found.sensors[place + 1] if s not in found.sensors[place]]
    return new[0] if len(new) == 1 else f"all {len(new)} others"


def next_to_buy(found: Budget, model: str, place: int) -> str:
    """Return a recommendation for the next sensor, and whether it is worth its cost."""
    margins = found.margin()
    assert margins is not None
    margin, _, least = margins
    if place == len(found.sensors) - 1:
        return "Next to buy: all temperatures are in use; the gain of others is unknown."
    gains, blocks = found.gains(model)
    own, unit = blocks[place], found.unit
    spread = f" ({own.min():.2f} to {own.max():.2f} {unit} from block to block)" if len(own) > 1 else ""
    would = f"{_joins(found, place)} would gain {gains[place]:.2f} {unit}{spread}"
    none = f"{would}; a further sensor must gain at least {least:.2f} {unit}."
    # if a single sensor gains too little, several may gain enough
    for k, gain in enumerate(np.cumsum(gains[place:]).tolist(), start=place + 1):
        new = [s for s in found.sensors[k] if s not in found.sensors[place]]
        if gain > len(new) * least:
            surely = (
                "."
                if gain > margin
                else ", less than the differences between the blocks: more thermal cycles would decide."
            )
            if k == place + 1:
                return f"Next to buy: {would}{surely}"
            both = " and ".join(new) if len(new) == 2 else f"{len(new)} ({', '.join(new)})"
            return (
                f"Next to buy: no single one is worth it. {none} {both} together would gain {gain:.2f} {unit}{surely}"
            )
    return f"Next to buy: none is worth it. {none}"


def _frequency(found: Budget, place: int) -> Table:
    order = np.argsort(-found.frequency[place], kind="stable")
    return Table(
        title=f"Selection frequency: sensor among the best {len(found.sensors[place])}",
        columns=("sensor", "share of the blocks [%]"),
        rows=tuple(
            (found.candidates[j], float(100 * found.frequency[place, j]))
            for j in order
            if found.frequency[place, j] > 0
        ),
        caption="Selection repeated with each block excluded in turn: a sensor far below 100 % was selected by chance.",
    )


def _stand_ins(found: Budget, place: int) -> Table:
    """Return a table of the virtual sensor of each temperature, and the loss of accuracy with it."""
    names, kept = found.candidates, [found.candidates.index(s) for s in found.sensors[place]]
    made = found.answer.stand_ins(kept)
    own = np.sqrt(np.diag(found.answer.temperatures))

    def parts(j: int) -> str:
        shares = np.abs(made.weights[:, j]) * own
        named = [k for k in np.argsort(-shares, kind="stable").tolist() if shares[k] > PART * own[j]]
        return ", ".join(f"{made.weights[k, j]:.2f} {names[k]}" for k in named) or "none"

    rows: tuple[tuple[Cell, ...], ...] = tuple(
        (
            name,
            names[made.single[j]],
            float(made.single_residual[j]),
            parts(j),
            float(made.residual[j]),
            float(made.loss[j].mean()),
        )
        for j, name in enumerate(names)
    )
    return Table(
        title="Virtual sensors",
        columns=(
            "sensor",
            "best other sensor",
            "error with it [degC]",
            "from the selected sensors",
            "error with them [degC]",
            f"loss [{found.unit}]",
        ),
        rows=rows,
        caption="Each temperature is predicted from the single other one that predicts it best, and from the selected "
        "sensors (a selected one from the other selected ones, as if it had failed), with sensor noise of "
        f"{found.answer.noise:g} degC in use. Error: RMS of the prediction error. Loss: change of the output of "
        f"`averaged` with all temperatures if only this one is predicted from the selected sensors{_mean(found)}. "
        f"Sensors with a share below {100 * PART:g} % are not named.",
    )


def _repeats(candidates: Sequence[Candidates], sensors: Sequence[str]) -> Table:
    """Return the collinearity of the chosen sensors, with the correlation to each target."""
    tables = [c.repeats(sensors) for c in candidates]
    if len(tables) == 1:
        return tables[0]
    rows = zip(*(t.rows for t in tables), strict=True)
    return replace(
        tables[0],
        columns=("sensor", *(f"correlation with {c.target}" for c in candidates), "VIF"),
        rows=tuple((row[0][0], *(cells[1] for cells in row), row[0][2]) for row in rows),
    )


def trade_off(found: Budget, model: str, place: int) -> str:
    """Return the loss of accuracy with fewer sensors, compared with the best set and with all sensors."""
    mean = found.mean()
    m, n = found.models.index(model), found.sizes[place]
    best = np.unravel_index(int(np.nanargmin(mean)), mean.shape)
    others = {(int(best[0]), int(best[1])): ", the best of the table"}
    others.setdefault((m, len(found.sizes) - 1), "")
    said = []
    for (k, j), what in others.items():
        cost = float(mean[m, place] - mean[k, j])
        if (k, j) != (m, place):
            by = f" by {found.models[k]}" if k != m else ""
            other = f"{found.sizes[j]}{by}" if j != place else f"as many{by}"
            said.append(f"{abs(cost):.2g} {found.unit} {'more' if cost >= 0 else 'less'} than {other}{what}")
    if not said:
        return (
            "with fewer sensors the error exceeds the margin of the rule"
            if n > 1
            else "there is no other set to choose from"
        )
    return f"{n} sensor{'s' if n > 1 else ''} cost{'s' if n == 1 else ''} {' and '.join(said)} (means over the blocks)"


def _rule(found: Budget) -> str:
    """Return the rule by which the number of sensors was selected, with its numbers, as text."""
    margins = found.margin()
    assert margins is not None
    margin, error, least = margins
    what = "the minimum gain of a further sensor"
    if found.unit == PERCENT or least < WORTH:
        what = f"{100 * SHARE:g} % of the error without compensation, {what}"
    unit = found.unit
    return (
        "Rule: the fewest sensors that are better than no compensation and whose mean RMS over the unseen blocks "
        f"(see the table) is within {margin:.2f} {unit} of the smallest: the larger of one standard error between the "
        f"blocks (Breiman 1984), {error:.2f} {unit}, and of {least:.2f} {unit}, {what}."
    )
