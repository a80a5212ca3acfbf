"""Terminal output of ``thermocomp position``."""

import math
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from thermocomp.cli.terminal import mark, marked, print_table, words
from thermocomp.recordings.profiles import Profiles
from thermocomp.recordings.readers.profiles import NOT_TAKEN
from thermocomp.report.answer import CommandAnswer
from thermocomp.report.layout import Column, Layout, PrintedLine, Toned, verdict
from thermocomp.volumetric.judging.position import PositionStudy
from thermocomp.volumetric.models.positionoptions import Setting
from thermocomp.volumetric.report import records
from thermocomp.volumetric.verbs import Positioned

#: largest number of cycles listed individually; of more cycles, the `WORST` are listed
FEW, WORST = 12, 5
#: maximum length of a printed formula [characters]; --json has the full formula
FORMULA = 300


def answer_positioned(result: Positioned, files: Sequence[Path], following: Sequence[str]) -> CommandAnswer:
    """Return the answer of ``position``: each component, on unseen profiles."""
    found = result.found
    accepted = [f.fit.model.target for f in found if f.assessment.accepted]
    worst = max(((f, c) for f in found for c in f.assessment.cycles), key=lambda x: x[1].model, default=None)
    line = []
    if worst is not None:
        f, c = worst
        told = f"{f.fit.model.target} in {c.cycle}, {c.model:.2f} {f.assessment.unit} RMS instead of {c.none:.2f}"
        line = [PrintedLine(f"Worst cycle: {told}.")]
    columns = (
        Column("component", lambda f: f"{f.fit.model.target} [{f.fit.model.unit}]"),
        Column("RMS", lambda f: f.assessment.overall.model, ".2f"),
        Column("cold profile alone", lambda f: f.assessment.overall.geometric, ".2f"),
        Column("instead of", lambda f: f.assessment.overall.none, ".2f"),
        Column("largest", lambda f: f.assessment.overall.model_max, ".2f"),
        Column("verdict", _verdict),
    )
    notes = [note for mine in result.tests for t in mine for note in t.states.notes if note.startswith(NOT_TAKEN)]
    return CommandAnswer(
        head=f"{len(accepted)} of {len(found)} component(s) may run. Errors over all points of unseen profiles, judged "
        f"on: {found[0].assessment.protocol}.",
        table=Layout(columns, found),
        lines=line,
        warnings=[
            *(
                f"{f.fit.model.target}: {f.assessment.verdict.word}, {f.assessment.reason}"
                for f in found
                if not f.assessment.accepted
            ),
            *(f"{f.fit.model.target}: the thermal part is omitted: {f.dropped}" for f in found if f.dropped),
            *dict.fromkeys(notes),
        ],
        files=files,
        following=following,
    )


def show_positioned(result: Positioned, console: Console) -> None:
    """Print the results of one or several components."""
    if result.several:
        show_all(result.found, result.tests, result.left_open, console)
    else:
        show(result.found[0], result.tests[0], result.left_open, console)


def show(found: PositionStudy, tests: Sequence[Profiles], left_open: Sequence[Setting], console: Console) -> None:
    """Print all results of one component."""
    fit, judged = found.fit, found.assessment
    model, unit = fit.model, fit.model.unit
    low, high = model.travel
    _show_notes([tests], console)
    console.print(
        f"[bold]{words(model.target)}[/]: {sum(len(t) for t in tests)} profiles of {len(tests[0].points)} points "
        f"along {words(model.axis)}, {low:g} to {high:g} mm"
    )
    if fit.profile.tried:
        chosen = (fit.profile.order, fit.profile.through)
        columns = (
            Column(
                "order",
                lambda t: (
                    ("spline" if t.through else _order(t.order)) + ("!" if (t.order, t.through) == chosen else " ")
                ),
                ">",
            ),
            Column("terms", lambda t: t.n_terms, ">"),
            Column("error", lambda t: f"{t.left_out:.3f}", ">", unit),
        )
        title = "Cold profile: cross-validation error at left-out points"
        print_table(Layout(columns, fit.profile.tried, title, caption="! = chosen"), console)
    kind = f"{model.profile and model.profile.kind} of order {_order(fit.profile.order)}"
    console.print(f"Cold profile: {words('natural spline through all points' if fit.profile.through else kind)}")
    if fit.profile.words:
        console.print(f"[yellow]but[/] the cold profile {words(fit.profile.words)}")
    if left_open:
        console.print(f"Determined from the profiles: {words(_chosen(found, left_open))}")
    for factor, errors, power in zip(model.models, fit.coefficient_errors, model.powers, strict=True):
        formula = factor.formula()
        console.print(words(f"k{power} [{factor.unit}] = {_shortened(formula)}"))
        if errors and len(formula) <= FORMULA:
            told = ", ".join(f"{name} {error:.2g}" for name, error in errors.items())
            console.print(words(f"  standard errors: {told}"))
    rest = ", ".join(f"m = {m}: {r:.2f}" for m, r in fit.remainders.items() if math.isfinite(r))
    console.print(
        f"Residual of the cold profile alone: {fit.thermal_rms:.2f} {unit} RMS; with powers of the position up to "
        f"{words(rest)} {unit}"
    )
    if model.powers and "slopes" not in left_open and fit.enough > max(model.powers):
        console.print(f"[yellow]but[/] higher powers leave a smaller residual: try --slopes {fit.enough}")
    if model.slopes and "offset" not in left_open and fit.shifts:
        console.print(
            f"[yellow]but[/] the profiles do not tilt about {model.reference_position:g} mm: with an offset the "
            f"residual is {fit.offset_remainder:.2f} {unit}; try --offset, or another --reference-position"
        )
    _show_judging(found, left_open, console)
    print_table(_cycle_table(found), console)
    console.print(f"{marked(_verdict(found))} {words(model.target)}: {words(judged.reason)}")
    if found.dropped:
        console.print(
            f"[yellow]but[/] only the cold profile is used; its thermal part is omitted: {words(found.dropped)}"
        )


def show_all(
    found: Sequence[PositionStudy],
    tests: Sequence[Sequence[Profiles]],
    left_open: Sequence[Setting],
    console: Console,
) -> None:
    """Print several components, one line each."""
    _show_notes(tests, console)
    states = sum(len(t) for t in tests[0])
    console.print(f"{len(found)} components, {states} profiles of each in {len(tests[0])} recording(s)")
    caption = (
        "order: order of the cold profile; factors: k0 shift, k1 slope, k2 ..., for positions relative to 'at'; none, "
        "cold, model: RMS over all points of unseen profiles (um or urad) without compensation, with the cold "
        "profile, and with the model; verdict profile: only the cold profile is used"
    )
    columns = (
        Column("", lambda f: f"{f.fit.model.target}, {f.fit.model.unit}", whole=True),
        Column("order", _orders, ">", whole=True),
        Column("factors", lambda f: " ".join(f"k{k}" for k in f.fit.model.powers) or "-"),
        Column("at", lambda f: f.fit.model.reference_position if f.fit.model.slopes else "", "g", whole=True),
        Column("none", lambda f: f.assessment.overall.none, ".2f", whole=True),
        Column("cold", lambda f: f.assessment.overall.geometric, ".2f", whole=True),
        Column("model", lambda f: f.assessment.overall.model, ".2f", whole=True),
        Column("verdict", lambda f: _verdict(f, "profile"), whole=True),
    )
    print_table(Layout(columns, found, caption=caption), console)
    _show_judging(found[0], left_open, console)
    for f in found:
        if not f.assessment.accepted:
            console.print(
                f"{mark(f.assessment.verdict.word)} {words(f.fit.model.target)}: {words(f.assessment.reason)}",
                soft_wrap=True,
            )
        elif f.dropped:
            console.print(
                f"[yellow]cold profile only[/] {words(f.fit.model.target)}: the thermal part is omitted: "
                f"{words(f.dropped)}"
            )


def _show_notes(tests: Sequence[Sequence[Profiles]], console: Console) -> None:
    notes = [note for mine in tests for t in mine for note in t.states.notes if note.startswith(NOT_TAKEN)]
    for note in dict.fromkeys(notes):
        console.print(f"[dim]note[/] {words(note)}", soft_wrap=True)


def _show_judging(found: PositionStudy, left_open: Sequence[Setting], console: Console) -> None:
    again = "; settings are selected again in each fold" if left_open else ""
    console.print(f"Judged on: {words(found.assessment.protocol)}{again}")


def _chosen(found: PositionStudy, left_open: Sequence[Setting]) -> str:
    model = found.fit.model
    told = {
        "slopes": f"--slopes {len(model.slopes)}",
        "offset": "--offset" if model.offset is not None else "--no-offset",
        "reference_position": f"--reference-position {model.reference_position:g}" if model.slopes else "",
    }
    return " ".join(told[name] for name in left_open if told[name])


def _cycle_table(found: PositionStudy) -> Layout:
    judged = found.assessment
    told, which = judged.cycles, ""
    if len(told) > FEW:
        told = tuple(sorted(told, key=lambda c: c.none and -c.model / c.none)[:WORST])
        which = f"the {WORST} worst of {len(judged.cycles)}; "
    columns = (
        Column("unseen", "cycle"),
        Column("profiles", "profiles", ">"),
        Column("none", "none_rms", ".2f"),
        Column("cold profile", "cold_profile_rms", ".2f"),
        Column("model", "rms", ".2f"),
        Column("none max", "none_max", ".2f"),
        Column("model max", "max", ".2f"),
    )
    caption = f"{which}RMS over all points in {judged.unit}; max: largest error"
    return Layout(columns, [records.cycle(c) for c in (*told, judged.overall)], caption=caption)


def _orders(found: PositionStudy) -> str:
    profile = found.fit.profile
    return "spline" if profile.through else "+".join(str(o) for o in profile.order if o) or "0"


def _shortened(formula: str) -> str:
    """Return a formula shortened to a few lines, cut between two terms."""
    if len(formula) <= FORMULA:
        return formula
    cut = max(formula.rfind(" + ", 0, FORMULA), formula.rfind(" - ", 0, FORMULA))
    more = formula[cut:].count(" + ") + formula[cut:].count(" - ")
    return f"{formula[:cut]} ... and {more} more terms (see --json)"


def _verdict(found: PositionStudy, alone: str = "cold profile") -> Toned:
    accepted = found.assessment.accepted
    return Toned(alone, "doubtful") if accepted and found.dropped else verdict(found.assessment.verdict.word)


def _order(order: tuple[int, int]) -> str:
    return str(order[0]) if not order[1] else f"{order[0]} ({order[1]} in the others)"
