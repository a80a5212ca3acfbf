"""Selection by sensor budget: the smallest sufficient set, the gain of each further sensor, and virtual sensors."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from thermocomp.core.exceptions import FitError
from thermocomp.core.messages import Message, join
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
    told = Message(
        "{model} with {n} of {of} temperatures leaves {error:.2f} {rms} on unseen cycles{mean}, instead of {none:.2f} "
        "{unit}",
        model=model,
        n=len(sensors),
        of=len(found.candidates),
        error=error,
        rms=_rms(found),
        mean=_mean(found),
        none=none,
        unit=found.unit,
    )
    tables = [
        _errors(found, judging, model, place if recommended else None),
        _by_target(found, model, place),
    ]
    notes, failure, reason = _notes(found, judging), "", join([told, trade_off(found, model, place)], "; ")
    if recommended is None:
        sensors = ()
        none_better = "no set of temperatures is clearly better than no compensation; the smallest error: {error}"
        reason = failure = Message(none_better, error=told)
    else:
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
        notes.append(Message("Some numbers of sensors could not be judged: {why}", why=_failed(found)))
    if len(found.blocks) < len(judging.splits):
        n, what = (
            len(judging.splits) - len(found.blocks),
            "one of the targets" if len(found.targets) > 1 else "the target",
        )
        notes.append(Message("{n} block(s) without a value of {what} were left out.", n=n, what=Message(what)))
    return notes


def _advice(found: Budget, model: str, place: int) -> list[str]:
    """Return the advantages and drawbacks of the recommended sensors."""
    left = found.of_targets()[found.models.index(model), place]
    idle = [t for t, e, none in zip(found.targets, left, found.none_of_targets(), strict=True) if e >= none]
    none_better = Message(
        "These sensors are no better than no compensation for {targets}: select for it separately.",
        targets=", ".join(idle),
    )
    return [
        *([none_better] if idle else []),
        next_to_buy(found, model, place),
        Message(
            "Each set contains the sensors from which the others can be predicted with the smallest change of the "
            "output of `averaged`; the sets are the same for all displacements and models. The number of sensors was "
            "chosen by the errors shown, so these are slightly optimistic."
        ),
    ]


def _failed(found: Budget) -> str:
    return "; ".join(f"{model}: {why}" for model, why in found.failures.items())


def _rms(found: Budget) -> str:
    """Return the name of the error over all unseen rows."""
    if found.unit == PERCENT:
        return Message("% of the RMS without compensation")
    return Message("{unit} RMS", unit=found.unit)


def _mean(found: Budget) -> str:
    return Message(" (mean of {n} displacements)", n=len(found.targets)) if len(found.targets) > 1 else ""


def _errors(found: Budget, judging: Judging, model: str, place: int | None) -> Table:
    mean, gains = found.mean(), [*found.gains(model)[0].tolist(), None]
    rows = tuple(
        (size, *(float(v) for v in mean[:, k]), gains[k], float(found.condition[k]), " ".join(found.sensors[k]))
        for k, size in enumerate(found.sizes)
    )
    headings = [Message("{model} mean RMS [{unit}]", model=m, unit=found.unit) for m in found.models]
    enough = [Message("{n} for {model}", n=found.enough(m) or Message("none"), model=m) for m in found.models]
    return Table(
        title=Message("Error on unseen blocks: {judging}", judging=judging.name),
        columns=(
            Message("sensors"),
            *headings,
            Message("gain of the next row [{unit}]", unit=found.unit),
            Message("condition number"),
            Message("selected on all rows"),
        ),
        rows=rows,
        marked=place,
        caption=Message(
            "RMS on each unseen block, mean over the blocks{mean}, to compare sets; without compensation {none:.2f} "
            "{unit}. Gain of the next row: reduction of the error of {model} by the additional sensors of the next "
            "row. Sufficient number of sensors: {enough}.",
            mean=_mean(found),
            none=found.none_mean(),
            unit=found.unit,
            model=model,
            enough=join(enough, ", "),
        ),
    )


def _by_target(found: Budget, model: str, place: int) -> Table:
    errors = found.of_targets()[found.models.index(model)]
    rows = (
        (0, *found.none_of_targets().tolist()),
        *((n, *e) for n, e in zip(found.sizes, errors.tolist(), strict=True)),
    )
    more = (errors[place] - errors[-1]) / found.scales
    worst = int(np.argmax(more))
    most = Message(
        " {target} is affected most: {more:.2f} {unit} more than with all sensors.",
        target=found.targets[worst],
        more=float(more[worst]),
        unit=found.unit,
    )
    return Table(
        title=Message("Error on unseen blocks for each displacement: {model}", model=model),
        columns=(Message("sensors"), *(f"{t} RMS" for t in found.targets)),
        rows=rows,
        marked=1 + place,
        caption=Message(
            "Over all unseen rows, as in `compare` and `fit`, each in the unit of the displacement; 0 sensors: without "
            "compensation.{most}",
            most=most if place + 1 < len(errors) else "",
        ),
    )


def _next(found: Budget, model: str, place: int) -> Table:
    """Return the gain of the next sensor after each number of sensors, and its consistency over the blocks."""
    gains, blocks = found.gains(model)
    unit = found.unit
    return Table(
        title=Message("Next sensor to buy"),
        columns=(
            Message("sensors"),
            Message("next"),
            Message("gain [{unit}]", unit=unit),
            Message("in the worst block [{unit}]", unit=unit),
            Message("in the best block [{unit}]", unit=unit),
        ),
        rows=tuple(
            (found.sizes[k], _joins(found, k), float(gains[k]), float(blocks[k].min()), float(blocks[k].max()))
            for k in range(len(gains))
        ),
        marked=place if place < len(gains) else None,
        caption=Message(
            "Gain: reduction of the error of {model}; if negative, the error is larger with the sensor than without "
            "it. For each block, the sensors were selected with this block excluded.",
            model=model,
        ),
    )


def _joins(found: Budget, place: int) -> str:
    """Return the name of the sensor added next; for the step from the largest set to all, the number added."""
    new = [s for s in found.sensors[place + 1] if s not in found.sensors[place]]
    return new[0] if len(new) == 1 else Message("all {n} others", n=len(new))


def next_to_buy(found: Budget, model: str, place: int) -> str:
    """Return a recommendation for the next sensor, and whether it is worth its cost."""
    margins = found.margin()
    assert margins is not None
    margin, _, least = margins
    if place == len(found.sensors) - 1:
        return Message("Next to buy: all temperatures are in use; the gain of others is unknown.")
    gains, blocks = found.gains(model)
    own, unit = blocks[place], found.unit
    spread = Message(
        " ({low:.2f} to {high:.2f} {unit} from block to block)", low=float(own.min()), high=float(own.max()), unit=unit
    )
    would = Message(
        "{sensor} would gain {gain:.2f} {unit}{spread}",
        sensor=_joins(found, place),
        gain=float(gains[place]),
        unit=unit,
        spread=spread if len(own) > 1 else "",
    )
    none = Message(
        "{would}; a further sensor must gain at least {least:.2f} {unit}.", would=would, least=least, unit=unit
    )
    # if a single sensor gains too little, several may gain enough
    for k, gain in enumerate(np.cumsum(gains[place:]).tolist(), start=place + 1):
        new = [s for s in found.sensors[k] if s not in found.sensors[place]]
        if gain > len(new) * least:
            unsure = Message(", less than the differences between the blocks: more thermal cycles would decide.")
            surely = "." if gain > margin else unsure
            if k == place + 1:
                return Message("Next to buy: {would}{surely}", would=would, surely=surely)
            both = join(new, Message(" and ")) if len(new) == 2 else f"{len(new)} ({', '.join(new)})"
            return Message(
                "Next to buy: no single one is worth it. {none} {both} together would gain {gain:.2f} {unit}{surely}",
                none=none,
                both=both,
                gain=gain,
                unit=unit,
                surely=surely,
            )
    return Message("Next to buy: none is worth it. {none}", none=none)


def _frequency(found: Budget, place: int) -> Table:
    order = np.argsort(-found.frequency[place], kind="stable")
    return Table(
        title=Message("Selection frequency: sensor among the best {n}", n=len(found.sensors[place])),
        columns=(Message("sensor"), Message("share of the blocks [%]")),
        rows=tuple(
            (found.candidates[j], float(100 * found.frequency[place, j]))
            for j in order
            if found.frequency[place, j] > 0
        ),
        caption=Message(
            "Selection repeated with each block excluded in turn: a sensor far below 100 % was selected by chance."
        ),
    )


def _stand_ins(found: Budget, place: int) -> Table:
    """Return a table of the virtual sensor of each temperature, and the loss of accuracy with it."""
    names, kept = found.candidates, [found.candidates.index(s) for s in found.sensors[place]]
    made = found.answer.stand_ins(kept)
    own = np.sqrt(np.diag(found.answer.temperatures))

    def parts(j: int) -> str:
        shares = np.abs(made.weights[:, j]) * own
        named = [k for k in np.argsort(-shares, kind="stable").tolist() if shares[k] > PART * own[j]]
        told = [Message("{weight:.2f} {name}", weight=float(made.weights[k, j]), name=names[k]) for k in named]
        return join(told or [Message("none")], ", ")

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
        title=Message("Virtual sensors"),
        columns=(
            Message("sensor"),
            Message("best other sensor"),
            Message("error with it [degC]"),
            Message("from the selected sensors"),
            Message("error with them [degC]"),
            Message("loss [{unit}]", unit=found.unit),
        ),
        rows=rows,
        caption=Message(
            "Each temperature is predicted from the single other one that predicts it best, and from the selected "
            "sensors (a selected one from the other selected ones, as if it had failed), with sensor noise of "
            "{noise:g} degC in use. Error: RMS of the prediction error. Loss: change of the output of `averaged` with "
            "all temperatures if only this one is predicted from the selected sensors{mean}. Sensors with a share "
            "below {part:g} % are not named.",
            noise=float(found.answer.noise),
            mean=_mean(found),
            part=100 * PART,
        ),
    )


def _repeats(candidates: Sequence[Candidates], sensors: Sequence[str]) -> Table:
    """Return the collinearity of the chosen sensors, with the correlation to each target."""
    tables = [c.repeats(sensors) for c in candidates]
    if len(tables) == 1:
        return tables[0]
    rows = zip(*(t.rows for t in tables), strict=True)
    return replace(
        tables[0],
        columns=(
            Message("sensor"),
            *(Message("correlation with {target}", target=c.target) for c in candidates),
            "VIF",
        ),
        rows=tuple((row[0][0], *(cells[1] for cells in row), row[0][2]) for row in rows),
    )


def trade_off(found: Budget, model: str, place: int) -> str:
    """Return the loss of accuracy with fewer sensors, compared with the best set and with all sensors."""
    mean = found.mean()
    m, n = found.models.index(model), found.sizes[place]
    best = np.unravel_index(int(np.nanargmin(mean)), mean.shape)
    others: dict[tuple[int, int], str] = {(int(best[0]), int(best[1])): Message(", the best of the table")}
    others.setdefault((m, len(found.sizes) - 1), "")
    said = []
    for (k, j), what in others.items():
        cost = float(mean[m, place] - mean[k, j])
        if (k, j) != (m, place):
            said.append(
                Message(
                    "{cost:.2g} {unit} more than {other}{by}{what}"
                    if cost >= 0
                    else "{cost:.2g} {unit} less than {other}{by}{what}",
                    cost=abs(cost),
                    unit=found.unit,
                    other=found.sizes[j] if j != place else Message("as many"),
                    by=Message(" by {model}", model=found.models[k]) if k != m else "",
                    what=what,
                )
            )
    if not said:
        fewer = n > 1
        return Message(
            "with fewer sensors the error exceeds the margin of the rule"
            if fewer
            else "there is no other set to choose from"
        )
    costs = (
        "{n} sensors cost {what} (means over the blocks)"
        if n > 1
        else "{n} sensor costs {what} (means over the blocks)"
    )
    return Message(costs, n=n, what=join(said, Message(" and ")))


def _rule(found: Budget) -> str:
    """Return the rule by which the number of sensors was selected, with its numbers, as text."""
    margins = found.margin()
    assert margins is not None
    margin, error, least = margins
    what = Message("the minimum gain of a further sensor")
    if found.unit == PERCENT or least < WORTH:
        what = Message("{share:g} % of the error without compensation, {what}", share=100 * SHARE, what=what)
    return Message(
        "Rule: the fewest sensors that are better than no compensation and whose mean RMS over the unseen blocks "
        "(see the table) is within {margin:.2f} {unit} of the smallest: the larger of one standard error between the "
        "blocks (Breiman 1984), {error:.2f} {unit}, and of {least:.2f} {unit}, {what}.",
        margin=margin,
        unit=found.unit,
        error=error,
        least=least,
        what=what,
    )
