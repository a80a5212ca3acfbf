"""What the commands print: a table for people, JSON for machines."""

import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Column, Table

from thermocomp.assessment import coverage
from thermocomp.assessment.choice import Choice, written
from thermocomp.assessment.choice import Table as ChoiceTable
from thermocomp.assessment.do_no_harm import Unit
from thermocomp.assessment.results import Assessment, Comparison
from thermocomp.assessment.study import Fitted, Judged
from thermocomp.cli.checked import recording_content
from thermocomp.cli.exits import mark
from thermocomp.cli.jsonoutput import print_json
from thermocomp.core.model import ErrorModel
from thermocomp.recording.recording import Recording
from thermocomp.recording.starts import Start
from thermocomp.report.running import told
from thermocomp.report.summary import cautions, unlike
from thermocomp.simulation.protocol import Experiment


def show_comparison(
    comparison: Comparison,
    report: Path | None,
    trouble: Sequence[str],
    console: Console,
    *,
    as_json: bool,
) -> None:
    """Print a comparison of methods on unseen blocks."""
    if as_json:
        content = {
            "judging": comparison.judging.name,
            "starts": _starts(comparison.starts),
            "condition_number": comparison.collinearity.condition_number,
            "vif": dict(zip(comparison.collinearity.names, comparison.collinearity.vif, strict=True)),
            "trouble": trouble,
            "not_judged": comparison.left,
            "cautions": cautions(comparison),
            "recommended": [
                {
                    "target": r.target,
                    "model": r.method,
                    "chosen_per_unit": r.chosen,
                    "verdict": r.verdict.word,
                    "reason": r.verdict.told,
                }
                for r in comparison.recommended
            ],
            "results": [_result(a) for a in comparison.assessments],
        }
        print_json(content, console)
        return
    _tell_starts(comparison.starts, console)
    console.print(f"Judged on: {comparison.judging.name}")
    console.print(_assessment_table(comparison.assessments))
    console.print(_cycle_table(comparison.assessments))
    for a in comparison.overall():
        if not a.accepted:
            console.print(f"{mark(a.word)} {a.model} for {escape(a.target)}: {escape(a.reason)}", soft_wrap=True)
    for target in dict.fromkeys(a.target for a in comparison.assessments):
        best = comparison.best(target)
        if best is None:
            console.print(f"[bold red]{escape(target)}: no model may run yet[/]")
        else:
            console.print(
                f"[bold green]{escape(target)}: {best.model}[/], {best.metric('rms'):.2f} um RMS "
                f"instead of {best.none_metric('rms'):.2f} um ({best.metric('reduction'):.0f} % less): "
                f"{escape(best.reason)}",
                soft_wrap=True,
            )
    for caution in cautions(comparison):
        console.print(f"[yellow]but[/] {escape(caution)}")
    for line in told(comparison.overall()):
        console.print(escape(line))
    if comparison.left:
        console.print(f"[bold red]stopped:[/] {comparison.left} pairs of method and target were not judged")
    if report is not None:
        console.print(f"Report: {report}")


def show_choices(
    choices: Sequence[Choice], page: Path | None, trouble: Sequence[str], console: Console, *, as_json: bool
) -> None:
    """Print selections of sensors."""
    if as_json:
        content = {
            "trouble": trouble,
            "choices": [
                {
                    "method": c.method,
                    "target": c.target,
                    "sensors": c.sensors,
                    "reason": c.reason,
                    "notes": c.notes,
                    "tables": {t.title: [dict(zip(t.columns, row, strict=True)) for row in t.rows] for t in c.tables},
                }
                for c in choices
            ],
        }
        print_json(content, console)
        return
    for c in choices:
        for t in c.tables:
            console.print(f"\n[bold]{escape(c.target)}: {escape(t.title)}[/]")
            print_table(t, console)
        for note in c.notes:
            console.print(f"[dim]note[/] {escape(note)}")
        console.print(
            f"[bold green]{escape(c.target)}: {escape(', '.join(c.sensors)) or 'no sensor'}[/]: {escape(c.reason)}"
        )
    if page is not None:
        console.print(f"Page: {page}", soft_wrap=True)


def print_table(t: ChoiceTable, console: Console) -> None:
    """Print a table; where it is too wide, its lists of names follow below it."""
    lists = [j for j in t.words if any(" " in str(row[j]) for row in t.rows)]
    for below in ([], lists):
        table = Table()
        columns = [j for j in range(len(t.columns)) if j not in below]
        for j in columns:
            table.add_column(escape(t.columns[j]), justify="left" if j in t.words else "right", overflow="fold")
        for k, row in enumerate(t.rows):
            cells = (escape(written(row[j])) for j in columns)
            table.add_row(*cells, style="bold green" if k == t.marked else None)
        if console.measure(table).maximum <= console.width:
            break
    console.print(table)
    for j in below:
        console.print(f"[dim]{escape(t.columns[j])}[/]")
        for k, row in enumerate(t.rows):
            style = "bold green" if k == t.marked else None
            console.print(f"  {escape(written(row[0]))}: {escape(written(row[j]))}", style=style)
    if t.caption:
        console.print(escape(t.caption), style="dim")


def show_fit(fitted: Fitted, path: Path, trouble: Sequence[str], console: Console, *, as_json: bool) -> None:
    """Print models that were fitted and written."""
    if as_json:
        models = [_model(m, r2) for m, r2 in zip(fitted.models, fitted.r_squared, strict=True)]
        content = {
            "judging": fitted.comparison.judging.name,
            "starts": _starts(fitted.comparison.starts),
            "file": str(path),
            "trouble": trouble,
            "models": models,
        }
        print_json(content, console)
        return
    _tell_starts(fitted.comparison.starts, console)
    console.print(f"Judged on: {fitted.comparison.judging.name}")
    table = Table()
    for heading in ("target", "sensors", "R2 of the fit", "unseen RMS, um", "none RMS, um", "verdict"):
        table.add_column(heading, justify="left" if heading in ("target", "verdict") else "right")
    for m, r2 in zip(fitted.models, fitted.r_squared, strict=True):
        honest = m.honest_error
        assert honest is not None
        table.add_row(
            escape(m.target),
            str(len(m.sensors)),
            f"{r2:.4f}",
            f"{honest.rms:.2f}",
            f"{honest.none_rms:.2f}",
            mark(honest.word),
        )
    console.print(table)
    for m in fitted.models:
        if m.honest_error is not None:
            console.print(
                f"{mark(m.honest_error.word)} {escape(m.target)}: {escape(m.honest_error.why)}", soft_wrap=True
            )
    for line in told(fitted.comparison.overall()):
        console.print(escape(line))
    console.print(f"Model file: {path}", soft_wrap=True)


def show_assess(judged: Judged, trouble: Sequence[str], console: Console, *, as_json: bool) -> None:
    """Print how models did on recordings."""
    if as_json:
        content = {
            "seen_in_training": judged.seen,
            "starts": _starts(judged.starts),
            "verdict_when_fitted": {m.target: m.honest_error.word for m in judged.models if m.honest_error},
            "trouble": trouble,
            "validity": asdict(judged.validity) if judged.validity is not None else None,
            "validity_when_fitted": {m.target: asdict(m.validity) for m in judged.models if m.validity is not None},
            "results": [_result(a) for a in judged.assessments],
        }
        print_json(content, console)
        return
    _tell_starts(judged.starts, console)
    console.print(_assessment_table(judged.assessments))
    console.print(_cycle_table(judged.assessments))
    table = Table(title="Robustness: RMS in um")
    for heading in ("target", "clean", "uniform noise", "normal noise", "worst lost sensor", "rows outside range"):
        table.add_column(heading, justify="left" if heading == "target" else "right")
    for a in judged.overall():
        if a.robustness is not None:
            name, lost = a.robustness.worst_lost
            table.add_row(
                escape(a.target),
                f"{a.metric('rms'):.2f}",
                *(f"{a.robustness.noise_rms[law][0]:.2f}" for law in ("uniform", "normal")),
                f"{lost:.2f} ({escape(name)})",
                f"{100 * a.robustness.outside:.1f} %",
            )
    console.print(table)
    for a in judged.overall():
        console.print(f"{mark(a.word)} {escape(a.target)}: {escape(a.reason)}", soft_wrap=True)
        if a.robustness is not None and a.robustness.harm:
            console.print(f"[red]harmful when disturbed[/] {escape(a.target)}: {escape(a.robustness.harm)}")
        if a.robustness is not None and a.robustness.outside > 0.1:
            share = f"{100 * a.robustness.outside:.0f} % of the rows"
            console.print(f"[yellow]but[/] {share} are outside the range {escape(a.target)} was trained in")
    for line in told(judged.overall()):
        console.print(escape(line))
        if a.robustness is not None and a.robustness.unlike > 0.1:
            console.print(f"[yellow]but[/] {escape(a.target)}: {unlike(a.robustness)}")
    fitted = {"when fitted": judged.models[0].validity, "these recordings": judged.validity}
    known = {name: v for name, v in fitted.items() if v is not None}
    if known:
        covered = coverage.table(known)
        console.print(f"\n[bold]{escape(covered.title)}[/]")
        print_table(covered, console)
    for m in judged.models:
        if m.honest_error is not None and not m.accepted:
            word = mark(f"{m.honest_error.word} when it was fitted")
            console.print(f"{word} {escape(m.target)}: {escape(m.honest_error.why)}", soft_wrap=True)


def _tell_starts(begins: Sequence[tuple[str, Start]], console: Console) -> None:
    for name, start in begins:
        console.print(f"Start of {escape(start.told(name))}")


def _starts(begins: Sequence[tuple[str, Start]]) -> list[dict[str, object]]:
    return [start.content(name) for name, start in begins]


def show_simulated(tests: Sequence[Recording], paths: Sequence[Path], console: Console, *, as_json: bool) -> None:
    """Print what was recorded on the virtual machine."""
    if as_json:
        content = [{"file": str(p), **recording_content(r, ())} for r, p in zip(tests, paths, strict=True)]
        print_json({"recordings": content}, console)
        return
    for r, p in zip(tests, paths, strict=True):
        hours = (r.time[-1] - r.time[0]) / 3600
        console.print(
            f"{p}: {len(r)} rows, {hours:.1f} h, {len(r.temperatures)} temperatures, "
            f"{len(r.displacements)} displacements, {len(r.cycles)} thermal cycle(s)"
        )


def show_experiments(experiments: Sequence[Experiment], console: Console, *, as_json: bool) -> None:
    """Print what can be recorded on the virtual machines."""
    if as_json:
        content = [{"name": e.name, "description": e.description, "tests": len(e.tests)} for e in experiments]
        print_json({"experiments": content}, console)
        return
    table = Table("experiment", Column("tests", justify="right"), "what it is", box=None)
    for e in experiments:
        table.add_row(e.name, str(len(e.tests)), escape(e.description))
    console.print(table)


def _assessment_table(assessments: Sequence[Assessment]) -> Table:
    """Return a table with a section per target and a row per model."""
    table = Table(caption="residual in um where it was judged")
    table.add_column("")
    for heading in ("MAE", "RMS", "max", "less", "sensors"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("verdict", no_wrap=True)
    for mine in _by_target(assessments):
        table.add_section()
        none = (_number(mine[0].none_metric(m)) for m in ("mae", "rms", "max_abs"))
        table.add_row(f"[bold]{escape(mine[0].target)}[/], none", *none, style="dim")
        for a in mine:
            figures = (_number(a.metric(m)) for m in ("mae", "rms", "max_abs"))
            less = "" if a.failure else f"{a.metric('reduction'):.0f} %"
            table.add_row(a.model, *figures, less, _span(a.n_sensors), mark(a.word))
    return table


def _cycle_table(assessments: Sequence[Assessment]) -> Table:
    """Return the RMS in every unseen cycle, a section per target; whatever there is more of goes down the page."""
    models = ["none", *dict.fromkeys(a.model for a in assessments)]
    cycles = list(dict.fromkeys(c.name for a in assessments for c in a.verdict.units))
    down, across = (models, cycles) if len(models) > len(cycles) + 1 else (cycles, models)
    space = " " if down is models else ""  # where others have their mark
    table = Table(caption="RMS in um in each cycle, or the part of it, that was judged; ! = harmful")
    table.add_column("", no_wrap=True)
    for heading in across:
        table.add_column(escape(heading), justify="right", no_wrap=across is models)
    for mine in _by_target(assessments):
        cells = {(a.model, c.name): _passed(c) for a in mine for c in a.verdict.units}
        cells |= {("none", c.name): f"{c.none_rms:.2f}{space}" for a in mine for c in a.verdict.units}
        table.add_section()
        table.add_row(f"[bold]{escape(mine[0].target)}[/]")
        for name in down:
            keys = [(name, other) if down is models else (other, name) for other in across]
            if any(k in cells for k in keys):
                table.add_row(f"  {escape(name)}", *(cells.get(k, "") for k in keys))
    return table


def _passed(cycle: Unit) -> str:
    return f"[red]{cycle.rms:.2f}![/]" if cycle.harmful else f"{cycle.rms:.2f} "


def _by_target(assessments: Sequence[Assessment]) -> list[list[Assessment]]:
    overall = [a for a in assessments if a.overall]
    return [[a for a in overall if a.target == t] for t in dict.fromkeys(a.target for a in overall)]


def _span(numbers: tuple[int, int]) -> str:
    return "-".join(str(n) for n in dict.fromkeys(numbers))


def _number(value: float) -> str:
    return f"{value:.2f}" if math.isfinite(value) else ""


def _result(a: Assessment) -> dict[str, Any]:
    content: dict[str, Any] = {
        "model": a.model,
        "target": a.target,
        "block": a.block,
        "mae_um": a.metric("mae"),
        "rms_um": a.metric("rms"),
        "max_um": a.metric("max_abs"),
        "alone_mae_um": a.alone_metric("mae"),
        "alone_rms_um": a.alone_metric("rms"),
        "alone_max_um": a.alone_metric("max_abs"),
        "peak_to_peak_um": a.metric("peak_to_peak"),
        "none_mae_um": a.none_metric("mae"),
        "none_rms_um": a.none_metric("rms"),
        "none_peak_to_peak_um": a.none_metric("peak_to_peak"),
        "reduction_pct": a.metric("reduction"),
        "verdict": a.word,
        "reason": a.reason,
        "p_value": a.verdict.p_value if a.verdict.units else None,
        "tried": a.verdict.tried,
        "units": [
            {
                "name": u.name,
                "rms_um": u.rms,
                "none_rms_um": u.none_rms,
                "baselines_rms_um": dict(zip(a.verdict.names, u.baselines, strict=False)),
                "margin_um": u.margin,
                "harmful": u.harmful,
            }
            for u in a.verdict.units
        ],
        "sensors": list(a.sensors),
        "n_sensors": a.n_sensors[1],
        "n_sensors_least": a.n_sensors[0],
        "fit_s": a.fit_s,
        "n_rows": len(a.measured),
        "n_rows_learned_from": a.learned,
        "n_effective": a.n_effective,
        "limits": a.limits and {k: v for k, v in asdict(a.limits).items() if k != "reading_age"},
        "readings_turned_away": a.rejected,
        "first_turned_away": a.turned_away,
    }
    if a.robustness is not None:
        r = a.robustness
        content["robustness"] = {
            "noise_degC": r.noise,
            "noise_rms_um": {law: {"mean": mean, "max": top} for law, (mean, top) in r.noise_rms.items()},
            "lost_sensor_rms_um": r.lost_rms,
            "worse_than_none": list(r.worse_than_none),
            "unlike_training_pct": 100 * r.unlike,
            "unlike_training_rms_um": r.unlike_rms,
            "outside_range_pct": 100 * r.outside,
            "outside_range_rms_um": r.outside_rms,
        }
    return content


def _model(m: ErrorModel, r_squared: float) -> dict[str, Any]:
    honest = m.honest_error
    return {
        "target": m.target,
        "unit": m.unit,
        "family": m.family,
        "formula": m.formula(),
        "coefficients": m.coefficients_by_name(),
        "intercept": m.intercept,
        "r_squared": r_squared,
        "sensors": list(m.sensors),
        "unseen_rms_um": honest.rms if honest else None,
        "none_rms_um": honest.none_rms if honest else None,
        "verdict": honest.word if honest else None,
        "reason": honest.why if honest else None,
    }
