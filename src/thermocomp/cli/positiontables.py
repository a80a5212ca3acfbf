"""What ``thermocomp position`` found, as tables for people and as plain numbers for programs."""

import math
from collections.abc import Sequence
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from thermocomp.assessment.position import CycleErrors, PositionStudy
from thermocomp.cli.exits import mark
from thermocomp.files.profiles import NOT_TAKEN
from thermocomp.models.positionoptions import Setting
from thermocomp.recording.profiles import Profiles

#: cycles that are told one by one; of more, the `WORST`
FEW, WORST = 12, 5
#: characters of a formula that are told; --json has all
FORMULA = 300


def show(found: PositionStudy, tests: Sequence[Profiles], left_open: Sequence[Setting], console: Console) -> None:
    """Print all about one component."""
    fit, judged = found.fit, found.assessment
    model, unit = fit.model, fit.model.unit
    low, high = model.travel
    _show_notes([tests], console)
    console.print(
        f"[bold]{escape(model.target)}[/]: {sum(len(t) for t in tests)} profiles of {len(tests[0].points)} points "
        f"along {model.axis}, {low:g} to {high:g} mm"
    )
    if fit.profile.tried:
        table = Table(title="Cold profile: error at points left out", caption="! = chosen")
        for heading in ("order", "terms", f"left out, {unit}"):
            table.add_column(heading, justify="right")
        for t in fit.profile.tried:
            name = "spline" if t.through else _order(t.order)
            mark = "!" if (t.order, t.through) == (fit.profile.order, fit.profile.through) else " "
            table.add_row(f"{name}{mark}", str(t.n_terms), f"{t.left_out:.3f}")
        console.print(table)
    kind = f"{model.profile and model.profile.kind} of order {_order(fit.profile.order)}"
    console.print(f"Cold profile: {'natural spline through all points' if fit.profile.through else kind}")
    if fit.profile.words:
        console.print(f"[yellow]but[/] it {fit.profile.words}")
    if left_open:
        console.print(f"Chosen by the profiles: {_chosen(found, left_open)}")
    for factor, errors, power in zip(model.models, fit.coefficient_errors, model.powers, strict=True):
        formula = factor.formula()
        console.print(f"k{power} [{factor.unit}] = {_shortened(formula)}", markup=False)
        if errors and len(formula) <= FORMULA:
            told = ", ".join(f"{name} {error:.2g}" for name, error in errors.items())
            console.print(f"  standard errors: {told}", markup=False)
    rest = ", ".join(f"m = {m}: {r:.2f}" for m, r in fit.remainders.items() if math.isfinite(r))
    console.print(f"Beside the cold profile {fit.thermal_rms:.2f} {unit} RMS; beside powers up to {rest} {unit}")
    if model.powers and "slopes" not in left_open and fit.enough > max(model.powers):
        console.print(f"[yellow]but[/] higher powers tell more: try --slopes {fit.enough}")
    if model.slopes and "offset" not in left_open and fit.shifts:
        console.print(
            f"[yellow]but[/] the profiles do not turn about {model.reference_position:g} mm: with an offset "
            f"{fit.offset_remainder:.2f} {unit} are left; try --offset, or another --reference-position"
        )
    _show_judging(found, left_open, console)
    console.print(_cycle_table(found))
    console.print(f"{_verdict(found)} {escape(model.target)}: {escape(judged.reason)}")
    if found.dropped:
        console.print(f"[yellow]but[/] the cold profile alone; its thermal part is left out: {escape(found.dropped)}")


def show_all(
    found: Sequence[PositionStudy],
    tests: Sequence[Sequence[Profiles]],
    left_open: Sequence[Setting],
    console: Console,
) -> None:
    """Print several components, a line each."""
    _show_notes(tests, console)
    states = sum(len(t) for t in tests[0])
    console.print(f"{len(found)} components, {states} profiles of each in {len(tests[0])} recording(s)")
    table = Table(
        caption="order: of the cold profile; factors: k0 shift, k1 slope, k2 ..., of positions counted from 'at'; "
        "RMS over all points of unseen profiles, um or urad: without compensation, less the cold profile, less the "
        "model; profile: the cold profile alone is taken"
    )
    for heading in ("", "order", "factors", "at", "none", "cold", "model", "verdict"):
        left = heading in ("", "factors", "verdict")
        table.add_column(heading, justify="left" if left else "right", no_wrap=heading != "factors")
    for f in found:
        model, overall = f.fit.model, f.assessment.overall
        turn = f"{model.reference_position:g}" if model.slopes else ""
        errors = (f"{v:.2f}" for v in (overall.none, overall.geometric, overall.model))
        table.add_row(
            f"{model.target}, {model.unit}",
            "spline" if f.fit.profile.through else "+".join(str(o) for o in f.fit.profile.order if o) or "0",
            " ".join(f"k{k}" for k in model.powers) or "-",
            turn,
            *errors,
            _verdict(f).replace("cold profile", "profile"),
        )
    console.print(table)
    _show_judging(found[0], left_open, console)
    for f in found:
        if not f.assessment.accepted:
            console.print(
                f"{mark(f.assessment.verdict.word)} {f.fit.model.target}: {escape(f.assessment.reason)}", soft_wrap=True
            )
        elif f.dropped:
            console.print(f"[yellow]cold profile alone[/] {f.fit.model.target}: thermal part: {escape(f.dropped)}")


def content(found: PositionStudy, left_open: Sequence[Setting]) -> dict[str, Any]:
    """Return all about one component, as plain numbers."""
    fit, judged = found.fit, found.assessment
    model = fit.model
    factors = []
    for power, factor, errors in zip(model.powers, model.models, fit.coefficient_errors, strict=True):
        honest = factor.honest_error
        factors.append(
            {
                "power": power,
                "unit": factor.unit,
                "formula": factor.formula(),
                "coefficients": factor.coefficients_by_name(),
                "standard_errors": errors,
                "intercept": factor.intercept,
                "sensors": factor.sensors,
                "unseen_rms": honest.rms if honest else None,
                "none_rms": honest.none_rms if honest else None,
            }
        )
    return {
        "target": model.target,
        "unit": model.unit,
        "axis": model.axis,
        "travel_mm": model.travel,
        "reference_position_mm": model.reference_position,
        "chosen_by_profiles": list(left_open),
        "profile": {
            "kind": model.profile.kind if model.profile else None,
            "order": fit.profile.order,
            "tried": [
                {"order": t.order, "terms": t.n_terms, "left_out": t.left_out if math.isfinite(t.left_out) else None}
                for t in fit.profile.tried
            ],
        },
        "factors": factors,
        "thermal_rms": fit.thermal_rms,
        "remainders": {str(m): r for m, r in fit.remainders.items()},
        "enough": fit.enough,
        "offset_remainder": fit.offset_remainder,
        "shifts": fit.shifts,
        "judging": judged.protocol,
        "cycles": [_cycle(c) for c in judged.cycles],
        "overall": _cycle(judged.overall),
        "verdict": judged.verdict.word,
        "reason": judged.reason,
        "thermal_part_left_out": found.dropped or None,
    }


def _show_notes(tests: Sequence[Sequence[Profiles]], console: Console) -> None:
    notes = [note for mine in tests for t in mine for note in t.states.notes if note.startswith(NOT_TAKEN)]
    for note in dict.fromkeys(notes):
        console.print(f"[dim]note[/] {escape(note)}", soft_wrap=True)


def _show_judging(found: PositionStudy, left_open: Sequence[Setting], console: Console) -> None:
    anew = "; settings are chosen anew in each" if left_open else ""
    console.print(f"Judged on: {found.assessment.protocol}{anew}")


def _chosen(found: PositionStudy, left_open: Sequence[Setting]) -> str:
    model = found.fit.model
    told = {
        "slopes": f"--slopes {len(model.slopes)}",
        "offset": "--offset" if model.offset is not None else "--no-offset",
        "reference_position": f"--reference-position {model.reference_position:g}" if model.slopes else "",
    }
    return " ".join(told[name] for name in left_open if told[name])


def _cycle_table(found: PositionStudy) -> Table:
    judged = found.assessment
    told, which = judged.cycles, ""
    if len(told) > FEW:
        told = tuple(sorted(told, key=lambda c: c.none and -c.model / c.none)[:WORST])
        which = f"the {WORST} worst of {len(judged.cycles)}; "
    table = Table(caption=f"{which}RMS over all points in {judged.unit}; max: largest error")
    table.add_column("unseen")
    for column in ("profiles", "none", "cold profile", "model", "none max", "model max"):
        table.add_column(column, justify="right")
    for c in (*told, judged.overall):
        numbers = (c.none, c.geometric, c.model, c.none_max, c.model_max)
        table.add_row(escape(c.cycle), str(c.n_states), *(f"{v:.2f}" for v in numbers))
    return table


def _shortened(formula: str) -> str:
    """Return a formula of a few lines, cut between two terms."""
    if len(formula) <= FORMULA:
        return formula
    cut = max(formula.rfind(" + ", 0, FORMULA), formula.rfind(" - ", 0, FORMULA))
    more = formula[cut:].count(" + ") + formula[cut:].count(" - ")
    return f"{formula[:cut]} ... and {more} terms more (--json has them)"


def _verdict(found: PositionStudy) -> str:
    accepted = found.assessment.accepted
    return "[yellow]cold profile[/]" if accepted and found.dropped else mark(found.assessment.verdict.word)


def _cycle(c: CycleErrors) -> dict[str, Any]:
    return {
        "cycle": c.cycle,
        "profiles": c.n_states,
        "none_rms": c.none,
        "cold_profile_rms": c.geometric,
        "rms": c.model,
        "none_max": c.none_max,
        "max": c.model_max,
    }


def _order(order: tuple[int, int]) -> str:
    return str(order[0]) if not order[1] else f"{order[0]} ({order[1]} in the others)"
