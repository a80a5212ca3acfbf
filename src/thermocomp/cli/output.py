"""What the commands print: a table for people, JSON for machines."""

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from thermocomp.cli.terminal import mark, print_table, words
from thermocomp.judging import coverage
from thermocomp.judging.choice import Choice
from thermocomp.judging.do_no_harm import JudgedUnit
from thermocomp.judging.faultlog import find_faults
from thermocomp.judging.results import Assessment, Comparison
from thermocomp.judging.study import Fitted, Judged
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.starts import Start
from thermocomp.report import records
from thermocomp.report.bands import describe_bands
from thermocomp.report.faults import describe_faults, describe_held
from thermocomp.report.layout import Column, Layout, Toned, laid_out, verdict
from thermocomp.report.losses import describe_losses
from thermocomp.report.probings import describe_probings
from thermocomp.report.running import describe_running
from thermocomp.report.summary import cautions, describe_unlike


def show_comparison(
    comparison: Comparison,
    report: Path | None,
    console: Console,
) -> None:
    """Print a comparison of methods on unseen blocks."""
    _tell_starts(comparison.starts, console)
    console.print(f"Judged on: {words(comparison.judging.name)}")
    print_table(_assessment_table(comparison.assessments), console)
    print_table(_cycle_table(comparison.assessments), console)
    for a in comparison.overall():
        if not a.accepted:
            console.print(f"{mark(a.word)} {words(a.model)} for {words(a.target)}: {words(a.reason)}", soft_wrap=True)
    for target in dict.fromkeys(a.target for a in comparison.assessments):
        best = comparison.best(target)
        if best is None:
            console.print(f"[bold red]{words(target)}: no model may run yet[/]")
        else:
            console.print(
                f"[bold green]{words(target)}: {words(best.model)}[/], {best.metric('rms'):.2f} um RMS "
                f"instead of {best.none_metric('rms'):.2f} um ({best.metric('reduction'):.0f} % less): "
                f"{words(best.reason)}",
                soft_wrap=True,
            )
    for caution in cautions(comparison):
        console.print(f"[yellow]but[/] {words(caution)}")
    for line in describe_running(comparison.overall()):
        console.print(words(line))
    if comparison.left:
        console.print(f"[bold red]stopped:[/] {comparison.left} pairs of method and target were not judged")
    if report is not None:
        console.print(f"Report: {words(report)}")


def show_choices(choices: Sequence[Choice], page: Path | None, console: Console) -> None:
    """Print selections of sensors."""
    for c in choices:
        for t in c.tables:
            console.print(f"\n[bold]{words(c.target)}: {words(t.title)}[/]")
            print_table(laid_out(t), console)
        for note in c.notes:
            console.print(f"[dim]note[/] {words(note)}")
        console.print(
            f"[{'red' if c.failure else 'bold green'}]{words(c.target)}: "
            f"{words(', '.join(c.sensors) or 'no sensor')}[/]: {words(c.reason)}"
        )
    if page is not None:
        console.print(f"Page: {words(page)}", soft_wrap=True)


def show_fit(fitted: Fitted, path: Path | None, console: Console) -> None:
    """Print models that were fitted and written."""
    overall = fitted.comparison.overall()
    models = [records.model(m, r2, a) for m, r2, a in zip(fitted.models, fitted.r_squared, overall, strict=True)]
    _tell_starts(fitted.comparison.starts, console)
    console.print(f"Judged on: {words(fitted.comparison.judging.name)}")
    columns = (
        Column("target", "target"),
        Column("sensors", lambda m: len(m["sensors"]), ">"),
        Column("R2 of the fit", "r_squared", ".4f"),
        Column("unseen RMS", "unseen_rms_um", ".2f", "um"),
        Column("none RMS", "none_rms_um", ".2f", "um"),
        Column("verdict", lambda m: verdict(m["verdict"])),
    )
    print_table(Layout(columns, models), console)
    for m in fitted.models:
        if m.honest_error is not None:
            console.print(f"{mark(m.honest_error.word)} {words(m.target)}: {words(m.honest_error.why)}", soft_wrap=True)
    for line in [
        *describe_running(overall),
        *describe_bands(fitted.models, overall),
        *describe_losses(fitted.models),
    ]:
        console.print(words(line))
    if path is not None:
        console.print(f"Model file: {words(path)}", soft_wrap=True)


def show_assess(
    judged: Judged,
    recordings: Sequence[Recording],
    report: Path | None,
    console: Console,
) -> None:
    """Print how models did on recordings."""
    logs = find_faults(judged, recordings)
    _tell_starts(judged.starts, console)
    for line in describe_faults(logs, recordings):
        console.print(f"[yellow]sensor failed[/] {words(line)}", soft_wrap=True)
    for line in describe_held(judged, logs):
        console.print(f"[yellow]but[/] {words(line)}", soft_wrap=True)
    print_table(_assessment_table(judged.assessments), console)
    print_table(_cycle_table(judged.assessments), console)
    print_table(_robustness(judged.overall()), console)
    for a in judged.overall():
        console.print(f"{mark(a.word)} {words(a.target)}: {words(a.reason)}", soft_wrap=True)
        if a.robustness is not None and a.robustness.harm:
            console.print(f"[red]harmful when disturbed[/] {words(a.target)}: {words(a.robustness.harm)}")
        if a.robustness is not None and a.robustness.outside > 0.1:
            share = f"{100 * a.robustness.outside:.0f} % of the rows"
            console.print(f"[yellow]but[/] {share} are outside the range {words(a.target)} was trained in")
        if a.robustness is not None and a.robustness.unlike > 0.1:
            console.print(f"[yellow]but[/] {words(a.target)}: {words(describe_unlike(a.robustness))}")
    for line in [
        *describe_running(judged.overall()),
        *describe_bands(judged.models, judged.overall()),
        *describe_probings(judged.overall()),
    ]:
        console.print(words(line))
    fitted = {"when fitted": judged.models[0].validity, "these recordings": judged.validity}
    known = {name: v for name, v in fitted.items() if v is not None}
    if known:
        covered = coverage.table(known)
        console.print(f"\n[bold]{words(covered.title)}[/]")
        print_table(laid_out(covered), console)
    for m in judged.models:
        if m.honest_error is not None and not m.accepted:
            word = mark(f"{m.honest_error.word} when it was fitted")
            console.print(f"{word} {words(m.target)}: {words(m.honest_error.why)}", soft_wrap=True)
    if report is not None:
        console.print(f"Report: {words(report)}", soft_wrap=True)


def _tell_starts(begins: Sequence[tuple[str, Start]], console: Console) -> None:
    for name, start in begins:
        console.print(f"Start of {words(start.told(name))}")


def _robustness(assessments: Sequence[Assessment]) -> Layout:
    columns = (
        Column("target", "target"),
        Column("clean", "clean", ".2f"),
        Column("uniform noise", "uniform", ".2f"),
        Column("normal noise", "normal", ".2f"),
        Column("worst lost sensor", "lost", ">"),
        Column("rows outside range", "outside", ">"),
    )
    rows = [
        {
            "target": a.target,
            "clean": a.undisturbed,
            **{law: mean for law, (mean, _) in a.robustness.noise_rms.items()},
            "lost": "{1:.2f} ({0})".format(*a.robustness.worst_lost),
            "outside": f"{100 * a.robustness.outside:.1f} %",
        }
        for a in assessments
        if a.robustness is not None
    ]
    probed = any(a.probed is not None for a in assessments)
    return Layout(columns, rows, f"Robustness of the models alone: RMS in um{', without probings' if probed else ''}")


def _assessment_table(assessments: Sequence[Assessment]) -> Layout:
    """Return a table with a section per target and a row per model."""
    metrics = {"MAE": "mae", "RMS": "rms", "max": "max_abs"}
    rows: list[tuple[str | float, ...]] = []
    sections = []
    banded = any(a.band for a in assessments)
    for mine in _by_target(assessments):
        sections.append(len(rows))
        none = (mine[0].none_metric(m) for m in metrics.values())
        rows.append((Toned(f"{mine[0].target}, none", "strong"), *none, *[""] * (5 if banded else 3)))
        for a in mine:
            figures = (a.metric(m) for m in metrics.values())
            less = "" if a.failure else f"{a.metric('reduction'):.0f} %"
            held = (f"{100 * a.coverage:.0f} %" if a.band else "", a.half_width) if banded else ()
            sensors = "-".join(map(str, dict.fromkeys(a.n_sensors)))
            name = f"{a.model}, in-sample" if a.caveat else a.model
            rows.append((name, *figures, less, *held, sensors, verdict(a.word)))
    band = (("held", ">"), ("+-", ".2f")) if banded else ()
    headings = (*((h, ".2f") for h in metrics), ("less", ">"), *band, ("sensors", ">"), ("verdict", ""))
    columns = (Column("", 0), *(Column(h, k, form, whole=True) for k, (h, form) in enumerate(headings, start=1)))
    return Layout(
        columns,
        rows,
        caption="residual in um where it was judged"
        + ("; in-sample: on the rows it has learned from" if any(a.caveat for a in assessments) else "")
        + _band_words(assessments),
        tones=dict.fromkeys(sections, "none"),
        sections=frozenset(sections),
    )


def _band_words(assessments: Sequence[Assessment]) -> str:
    """Return what the columns of the bands are, if there is a band."""
    names = dict.fromkeys(name for a in assessments if a.overall and a.band for name in a.band.split("; "))
    return f"; held, +-: rows within the band, its mean half-width ({'; '.join(names)})" if names else ""


def _cycle_table(assessments: Sequence[Assessment]) -> Layout:
    """Return the RMS in every unseen cycle, a section per target; whatever there is more of goes down the page."""
    models = ["none", *dict.fromkeys(a.model for a in assessments)]
    cycles = list(dict.fromkeys(c.name for a in assessments for c in a.verdict.units))
    down, across = (models, cycles) if len(models) > len(cycles) + 1 else (cycles, models)
    space = " " if down is models else ""  # where others have their mark
    rows: list[tuple[str, ...]] = []
    sections = set()
    for mine in _by_target(assessments):
        cells = {(a.model, c.name): _passed(c) for a in mine for c in a.verdict.units}
        cells |= {("none", c.name): f"{c.none_rms:.2f}{space}" for a in mine for c in a.verdict.units}
        sections.add(len(rows))
        rows.append((Toned(mine[0].target, "strong"), *([""] * len(across))))
        for name in down:
            keys = [(name, other) if down is models else (other, name) for other in across]
            if any(k in cells for k in keys):
                rows.append((f"  {name}", *(cells.get(k, "") for k in keys)))
    columns = (Column(h, k, ">", whole=across is models) for k, h in enumerate(across, start=1))
    caption = "RMS in um in each cycle, or the part of it, that was judged; ! = harmful"
    return Layout((Column("", 0, whole=True), *columns), rows, caption=caption, sections=frozenset(sections))


def _passed(cycle: JudgedUnit) -> str:
    return Toned(f"{cycle.rms:.2f}!", "bad") if cycle.harmful else f"{cycle.rms:.2f} "


def _by_target(assessments: Sequence[Assessment]) -> list[list[Assessment]]:
    overall = [a for a in assessments if a.overall]
    return [[a for a in overall if a.target == t] for t in dict.fromkeys(a.target for a in overall)]
