"""Answers of the commands that judge models: compare, fit and assess."""

from collections.abc import Iterable, Mapping, Sequence

from thermocomp.core.explained import DEAR, explain_all
from thermocomp.core.starting import describe_offsets
from thermocomp.judging.assessing import Judged
from thermocomp.judging.budget import Budget
from thermocomp.judging.choice import Choice
from thermocomp.judging.faultlog import find_faults
from thermocomp.judging.results import Assessment, Comparison
from thermocomp.judging.study import Fitted
from thermocomp.recordings.recording import Recording
from thermocomp.report import declared, summary
from thermocomp.report.answer import CommandAnswer, noisy, spares, spares_of, split_units
from thermocomp.report.faults import describe_faults, describe_held
from thermocomp.report.layout import Column, Layout, PrintedLine, verdict
from thermocomp.report.running import describe_running
from thermocomp.report.summary import WORSE, describe_unlike


def comparison(told: Comparison, files: Sequence[object], following: Sequence[str]) -> CommandAnswer:
    """Return the answer of ``compare``: the recommended method of each target."""
    best = {a.target: told.best(a.target) for a in told.overall()}
    rows = [a or _nearest(told, target) for target, a in best.items()]
    none = [a for a, (_, use) in zip(rows, best.items(), strict=True) if use is None]
    stopped = [f"stopped: {told.left} combinations of method and target were not judged"] if told.left else []
    return CommandAnswer(
        head=summary.verdict(told),
        table=_results(rows, choosing=True),
        lines=[
            *declared.answer(rows),
            *_worst_cycle(rows),
            *_dear([a for a in best.values() if a is not None]),
        ],
        warnings=[
            *stopped,
            *(f"{a.target}: no model may run yet; {a.model}: {a.reason}" for a in none),
            *_cautions(told),
        ],
        files=files,
        following=following,
    )


def fit(fitted: Fitted, files: Sequence[object], following: Sequence[str]) -> CommandAnswer:
    """Return the answer of ``fit``: the models, and their errors on unseen data."""
    told, models = fitted.comparison, fitted.models
    rows = told.overall()
    may = sum(m.accepted for m in models)
    return CommandAnswer(
        head=f"{_list(dict.fromkeys(a.model for a in rows))}, fitted to all data: {may} of {len(models)} models may "
        f"run. The errors are those of models fitted without the judged data: {told.judging.name}.",
        table=_results(rows),
        lines=[*_worst_cycle(rows), *spares_of(explain_all(models).models)],
        warnings=[
            *(
                f"{m.target}: {m.honest_error.word}, {m.honest_error.why}"
                for m in models
                if m.honest_error is not None and not m.honest_error.word.startswith("accepted")
            ),
            *noisy(models),
            *_cautions(told),
        ],
        files=files,
        following=following,
    )


def assess(
    judged: Judged, recordings: Sequence[Recording], files: Sequence[object], following: Sequence[str]
) -> CommandAnswer:
    """Return the answer of ``assess``: the errors here, beside those on unseen data when the models were fitted."""
    rows = judged.overall()
    words: dict[str, list[str]] = {}
    for a in rows:
        words.setdefault(a.word, []).append(a.target)
    logs = find_faults(judged, recordings)
    fitted = {m.target: m.honest_error for m in judged.models if m.honest_error is not None}
    robust = [(a, a.robustness) for a in rows if a.robustness is not None]
    return CommandAnswer(
        head=f"On these recordings: {'; '.join(f'{word} for {_list(t)}' for word, t in words.items())}. "
        "RMS here, and on unseen data when fitted.",
        table=_results(rows, {target: h.rms for target, h in fitted.items()}),
        lines=[*declared.answer(rows), *_worst_cycle(rows), *_dear(rows)],
        warnings=[
            *(
                f"{a.target}: {a.word}, {a.reason}"
                for a in sorted(rows, key=lambda a: a.word != "refused")
                if not a.accepted
            ),
            *(f"{t}: {h.word} when it was fitted, {h.why}" for t, h in fitted.items() if "accepted" not in h.word),
            *describe_faults(logs, recordings),
            *describe_held(judged, logs),
            *(f"{name}: {describe_offsets(off)}" for name, off in judged.offsets.items()),
            *(f"{a.target}: {r.harm}" for a, r in robust if r.harm),
            *(
                f"{a.target}: {100 * r.outside:.0f} % of the rows are outside the trained range"
                for a, r in robust
                if r.outside > 0.1
            ),
            *(
                f"{a.target}: {describe_unlike(r)}"
                for a, r in robust
                if r.unlike > 0.1 and r.unlike_rms > WORSE * a.metric("rms")
            ),
            *_rejected(rows),
        ],
        files=files,
        following=following,
    )


def choices(found: Sequence[Choice], files: Sequence[object], following: Sequence[str]) -> CommandAnswer:
    """Return the answer of ``select``: the sensors to use, and the errors with them."""
    chosen = [c for c in found if c.sensors and not c.failure]
    heads = dict[tuple[str, ...], list[str]]()
    for c in chosen:
        heads.setdefault(c.sensors, []).append(c.target)
    # the first note on a budget is its rule
    notes = list(dict.fromkeys(note for c in found for note in c.notes[isinstance(c.details, Budget) :]))
    said = [f"Use {', '.join(sensors)} ({len(sensors)}) for {', '.join(of)}" for sensors, of in heads.items()]
    return CommandAnswer(
        head="; ".join(said or [f"No set of sensors for {', '.join(c.target for c in found)}"]) + ".",
        table=_selected(found),
        lines=[*(PrintedLine(f"Why: {c.reason}") for c in chosen[:1]), *map(PrintedLine, notes[:1])],
        warnings=[f"{c.target}: {c.reason}" for c in found if c.failure],
        files=files,
        following=following if chosen else (),
    )


def _nearest(found: Comparison, target: str) -> Assessment:
    """Return the method with the smallest error of those that may not run."""
    return min((a for a in found.overall() if a.target == target), key=lambda a: (bool(a.failure), a.metric("rms")))


def _results(
    rows: Sequence[Assessment], fitted: Mapping[str, float] | None = None, *, choosing: bool = False
) -> Layout:
    """Return the table of one model for each target; with `fitted` also the error when it was fitted."""
    unit, name = split_units(a.verdict.unit for a in rows)
    columns = (
        Column("target", lambda a: name(a.target, a.verdict.unit)),
        Column("method", lambda a: f"none yet ({a.model})" if choosing and not a.accepted else a.model),
        Column("inputs", lambda a: "-".join(map(str, dict.fromkeys(a.n_sensors))), ">"),
        Column("RMS", lambda a: a.metric("rms"), ".2f", unit),
        *([] if fitted is None else [Column("when fitted", lambda a: fitted.get(a.target), ".2f", unit)]),
        Column("instead of", lambda a: a.none_metric("rms"), ".2f", unit),
        Column("largest", lambda a: a.metric("max_abs"), ".2f", unit),
        Column("verdict", lambda a: verdict(a.word)),
    )
    return Layout(columns, rows)


def _worst_cycle(rows: Sequence[Assessment]) -> list[PrintedLine]:
    """Return a line about the cycle with the largest harm, or with the largest error if none is harmful."""
    units = [(a, u) for a in rows for u in a.verdict.units]
    if not units:
        return []
    a, u = max(units, key=lambda found: (found[1].harmful, found[1].harm if found[1].harmful else found[1].rms))
    harm = ", harmful" if u.harmful else ""
    return [
        PrintedLine(
            f"Worst cycle: {u.name} for {a.target}, {u.rms:.2f} {a.verdict.unit} RMS instead of {u.none_rms:.2f}{harm}."
        )
    ]


def _dear(rows: Sequence[Assessment]) -> list[PrintedLine]:
    """Return a line about the sensors without which the error of a model is much larger."""
    known = [(a, a.robustness) for a in rows if a.robustness is not None]
    lost = [(n, rms, a) for a, r in known for n, rms in r.lost_rms.items() if rms > DEAR * a.undisturbed]
    return spares({n: f"{a.target} {rms:.2f} {a.verdict.unit} without it" for n, rms, a in lost}) if known else []


def _cautions(found: Comparison) -> list[str]:
    return [*summary.cautions(found), *_rejected(found.overall())]


def _rejected(rows: Sequence[Assessment]) -> list[str]:
    return [line for line in describe_running(rows) if line.startswith("The gate rejected")]


def _list(names: Iterable[str]) -> str:
    *most, last = map(str, names)
    return f"{', '.join(most)} and {last}" if most else last


def _selected(choices: Sequence[Choice]) -> Layout:
    """Return the error of each target with the selected sensors and with all, or the sensors of each target."""
    budget = choices[0].details
    if not isinstance(budget, Budget) or (best := budget.recommended()) is None:
        columns = (Column("target", lambda c: c.target), Column("sensors", lambda c: ", ".join(c.sensors)))
        return Layout(columns, choices)
    model, errors = budget.models.index(best[0]), budget.of_targets()
    found = (errors[model, best[1]], errors[model, -1], budget.none_of_targets())
    rows = [(target, *map(float, mine), best[0]) for target, *mine in zip(budget.targets, *found, strict=True)]
    headings = (f"RMS with {budget.sizes[best[1]]}", f"with all {budget.sizes[-1]}", "instead of")
    numbers = (Column(heading, k, ".2f", "um") for k, heading in enumerate(headings, start=1))
    return Layout((Column("target", 0), *numbers, Column("method", 4)), rows)
