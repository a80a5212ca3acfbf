"""Terminal output of results, as a sequence of lines and tables."""

from collections.abc import Iterator, Sequence
from statistics import median

from thermocomp.core.starting import describe_offsets
from thermocomp.judging import coverage
from thermocomp.judging.assessing import Judged
from thermocomp.judging.choice import Choice, Table
from thermocomp.judging.faultlog import find_faults
from thermocomp.judging.judgedunits import JudgedUnit
from thermocomp.judging.results import Assessment, Comparison
from thermocomp.judging.robustness import Robustness
from thermocomp.judging.study import Fitted
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.starts import Start
from thermocomp.report import declared, records
from thermocomp.report.bands import describe_bands
from thermocomp.report.declared import measured
from thermocomp.report.faults import describe_faults, describe_held
from thermocomp.report.layout import Column, Item, Layout, PrintedLine, Toned, laid_out, verdict
from thermocomp.report.losses import describe_losses
from thermocomp.report.probings import describe_gains, describe_probings
from thermocomp.report.running import describe_running
from thermocomp.report.summary import cautions, describe_choice, describe_unlike

#: of more unseen cycles than this only the worst are listed
_MOST_CYCLES, _WORST = 25, 12
BUT, NOTE = Toned("but", "doubtful"), Toned("note", "soft")


def comparison(found: Comparison, recordings: Sequence[Recording] = ()) -> Iterator[Item]:
    """Yield the lines and tables about a comparison of methods on unseen blocks."""
    yield from _declared(recordings)
    yield from _starts(found.starts)
    yield PrintedLine(f"Judged on: {found.judging.name}")
    yield _assessment_table(found.assessments)
    yield _cycle_table(found.assessments)
    shown = [found.best(mine[0].target) or mine[0] for mine in _by_target(found.assessments)]
    yield from filter(None, map(declared.budget, shown))
    for a in found.overall():
        if not a.accepted:
            yield PrintedLine(f" {a.model} for {a.target}: {a.reason}", verdict(a.word), whole=True)
    for target in dict.fromkeys(a.target for a in found.assessments):
        best = found.best(target)
        if best is None:
            yield PrintedLine("", Toned(f"{target}: no model may run yet", "grave"))
            yield PrintedLine(f" {describe_choice(found, target)}")
        else:
            yield PrintedLine(
                f", {measured(best, 'rms')} um RMS instead of {measured(best, 'rms', none=True)} um "
                f"({best.metric('reduction'):.0f} % less): {best.reason}",
                Toned(f"{target}: {best.model}", "chosen"),
                whole=True,
            )
            yield PrintedLine(f" {describe_choice(found, target)}")
    yield from (PrintedLine(f" {caution}", BUT) for caution in cautions(found))
    yield from map(PrintedLine, describe_running(found.overall()))
    if found.left:
        text = f" {found.left} combinations of method and target were not judged"
        yield PrintedLine(text, Toned("stopped:", "grave"))


def choices(found: Sequence[Choice]) -> Iterator[Item]:
    """Yield the lines and tables about sensor selections."""
    for c in found:
        for t in c.tables:
            yield from _titled(f"{c.target}: {t.title}", t)
        yield from (PrintedLine(f" {note}", NOTE) for note in c.notes)
        chosen = f"{c.target}: {', '.join(c.sensors) or 'no sensor'}"
        yield PrintedLine(f": {c.reason}", Toned(chosen, "bad" if c.failure else "chosen"))


def fit(fitted: Fitted) -> Iterator[Item]:
    """Yield the lines and tables about fitted models."""
    overall = fitted.comparison.overall()
    models = [records.model(m, r2, a) for m, r2, a in zip(fitted.models, fitted.r_squared, overall, strict=True)]
    yield from _starts(fitted.comparison.starts)
    yield PrintedLine(f"Judged on: {fitted.comparison.judging.name}")
    columns = (
        Column("target", "target"),
        Column("sensors", lambda m: len(m["sensors"]), ">"),
        Column("R2 of the fit", "r_squared", ".4f"),
        Column("unseen RMS", "unseen_rms_um", ".2f", "um"),
        Column("none RMS", "none_rms_um", ".2f", "um"),
        Column("verdict", lambda m: verdict(m["verdict"])),
    )
    yield Layout(columns, models)
    for a in overall:
        if a.verdict.tried > 1:
            told = describe_choice(fitted.comparison, a.target)
            yield PrintedLine(f" {told}", Toned(f"{a.target}: {a.model},", "chosen"))
    for m in fitted.models:
        if m.honest_error is not None:
            yield PrintedLine(f" {m.target}: {m.honest_error.why}", verdict(m.honest_error.word), whole=True)
    bands = describe_bands(fitted.models, overall)
    yield from map(PrintedLine, [*describe_running(overall), *bands, *describe_losses(fitted.models)])


def assess(judged: Judged, recordings: Sequence[Recording]) -> Iterator[Item]:
    """Yield the lines and tables about models judged on recordings."""
    logs = find_faults(judged, recordings)
    yield from _declared(recordings)
    yield from _starts(judged.starts)
    yield from (
        PrintedLine(f" {name}: {describe_offsets(off)}", BUT, whole=True) for name, off in judged.offsets.items()
    )
    for line in describe_faults(logs, recordings):
        yield PrintedLine(f" {line}", Toned("sensor failed", "doubtful"), whole=True)
    yield from (PrintedLine(f" {line}", BUT, whole=True) for line in describe_held(judged, logs))
    yield _assessment_table(judged.assessments)
    yield _cycle_table(judged.assessments)
    yield from filter(None, map(declared.budget, judged.overall()))
    yield _robustness(judged.overall())
    for a in judged.overall():
        if a.target in judged.stated and not a.failure:
            stated = f"{judged.stated[a.target]:.2f} um stated in the model file"
            yield PrintedLine(f"{a.target}: {a.metric('rms'):.2f} um RMS here, {stated}")
        yield PrintedLine(f" {a.target}: {a.reason}", verdict(a.word), whole=True)
        if a.robustness is not None:
            yield from _disturbed(a.target, a.robustness)
    bands = describe_bands(judged.models, judged.overall())
    yield from map(PrintedLine, [*describe_running(judged.overall()), *bands, *describe_probings(judged.overall())])
    yield from map(PrintedLine, describe_gains(judged))
    fitted = {"when fitted": judged.models[0].validity, "these recordings": judged.validity}
    if known := {name: v for name, v in fitted.items() if v is not None}:
        covered = coverage.table(known)
        yield from _titled(covered.title, covered)
    for m in judged.models:
        if m.honest_error is not None and not m.accepted:
            word = verdict(f"{m.honest_error.word} when it was fitted")
            yield PrintedLine(f" {m.target}: {m.honest_error.why}", word, whole=True)


def _disturbed(target: str, found: Robustness) -> Iterator[PrintedLine]:
    if found.harm:
        yield PrintedLine(f" {target}: {found.harm}", Toned("harmful with disturbed readings", "bad"))
    if found.outside > 0.1:
        yield PrintedLine(f" {100 * found.outside:.0f} % of the rows are outside the trained range of {target}", BUT)
    if found.unlike > 0.1:
        yield PrintedLine(f" {target}: {describe_unlike(found)}", BUT)


def _titled(title: str, t: Table) -> Iterator[Item]:
    yield PrintedLine("")
    yield PrintedLine("", Toned(title, "strong"))
    yield laid_out(t)


def _starts(begins: Sequence[tuple[str, Start]]) -> Iterator[PrintedLine]:
    return (PrintedLine(f"Initial state of {start.told(name)}") for name, start in begins)


def _declared(recordings: Sequence[Recording]) -> Iterator[PrintedLine]:
    yield from map(PrintedLine, declared.header_lines(recordings))
    pieces = (declared.recording(r).get("workpiece") for r in recordings)
    yield from (PrintedLine(w["text"]) for w in pieces if w is not None)


def _robustness(assessments: Sequence[Assessment]) -> Layout:
    columns = (
        Column("target", "target"),
        Column("undisturbed", "clean", ".2f"),
        Column("uniform noise", "uniform", ".2f"),
        Column("normal noise", "normal", ".2f"),
        Column("worst lost sensor", "lost", ">"),
        Column("worst sensor off", "off", ">"),
        Column("rows outside range", "outside", ">"),
    )
    rows = [
        {
            "target": a.target,
            "clean": a.undisturbed,
            **{law: mean for law, (mean, _) in a.robustness.noise_rms.items()},
            "lost": "{1:.2f} ({0})".format(*a.robustness.worst_lost),
            "off": "{1:.2f} ({0})".format(*a.robustness.worst_off) if a.robustness.deviating else "",
            "outside": f"{100 * a.robustness.outside:.1f} %",
        }
        for a in assessments
        if a.robustness is not None
    ]
    probed = any(a.probed is not None for a in assessments)
    without = "gate, limits and probings" if probed else "gate and limits"
    return Layout(columns, rows, f"Robustness of the models alone, without {without}: RMS in um")


def _assessment_table(assessments: Sequence[Assessment]) -> Layout:
    """Return a table with a section per target and a row per model."""
    metrics = {"MAE": "mae", "RMS": "rms", "max": "max_abs"}
    rows: list[tuple[str | float, ...]] = []
    sections = []
    banded = any(a.band for a in assessments)
    for mine in _by_target(assessments):
        sections.append(len(rows))
        none = (measured(mine[0], m, none=True) for m in metrics.values())
        rows.append((Toned(f"{mine[0].target}, none", "strong"), *none, *[""] * (5 if banded else 3)))
        for a in mine:
            figures = (measured(a, m) for m in metrics.values())
            less = "" if a.failure else f"{a.metric('reduction'):.0f} %"
            held = (f"{100 * a.coverage:.0f} %" if a.band else "", a.half_width) if banded else ()
            sensors = "-".join(map(str, dict.fromkeys(a.n_sensors)))
            rows.append((a.model, *figures, less, *held, sensors, verdict(a.word)))
    band = (("held", ">"), ("+-", ".2f")) if banded else ()
    headings = (*((h, ".2f") for h in metrics), ("less", ">"), *band, ("sensors", ">"), ("verdict", ""))
    columns = (Column("", 0), *(Column(h, k, form, whole=True) for k, (h, form) in enumerate(headings, start=1)))
    return Layout(
        columns,
        rows,
        caption="residual in um on the judged rows; less: reduction of the RMS" + _band_words(assessments),
        tones=dict.fromkeys(sections, "none"),
        sections=frozenset(sections),
    )


def _band_words(assessments: Sequence[Assessment]) -> str:
    """Return the explanation of the band columns, if there is a band."""
    names = dict.fromkeys(name for a in assessments if a.overall and a.band for name in a.band.split("; "))
    listed = "; ".join(names)
    return f"; held, +-: share of the rows inside the band, and its mean half-width ({listed})" if names else ""


def _cycle_table(assessments: Sequence[Assessment]) -> Layout:
    """Return the RMS in each unseen cycle, a section per target; rows are models or cycles, whichever are more.

    Of many cycles only the worst are listed, and the median of all.
    """
    models = ["none", *dict.fromkeys(a.model for a in assessments)]
    cycles = list(dict.fromkeys(c.name for a in assessments for c in a.verdict.units))
    down, across = (models, cycles) if len(models) > len(cycles) + 1 else (cycles, models)
    space = " " if down is models else ""  # in place of the mark of other cells
    rows: list[tuple[str, ...]] = []
    sections = set()
    for mine in _by_target(assessments):
        cells = {(a.model, c.name): _passed(c) for a in mine for c in a.verdict.units}
        cells |= {("none", c.name): f"{c.none_rms:.2f}{space}" for a in mine for c in a.verdict.units}
        sections.add(len(rows))
        rows.append((Toned(mine[0].target, "strong"), *([""] * len(across))))
        units = [c for a in mine for c in a.verdict.units]
        many = down is cycles and len({c.name for c in units}) > _MOST_CYCLES
        for name in _worst(units) if many else down:
            keys = [(name, other) if down is models else (other, name) for other in across]
            if any(k in cells for k in keys):
                rows.append((f"  {name}", *(cells.get(k, "") for k in keys)))
        if many:
            by_model = {"none": [c.none_rms for c in mine[0].verdict.units]}
            by_model |= {a.model: [c.rms for c in a.verdict.units] for a in mine}
            told = (f"{median(by_model[m]):.2f} " if m in by_model else "" for m in models)
            rows.append((f"  median of all {len(mine[0].verdict.units)}", *told))
    columns = (Column(h, k, ">", whole=across is models) for k, h in enumerate(across, start=1))
    caption = "RMS in um in each judged cycle, or in the judged part of it; ! = harmful"
    return Layout((Column("", 0, whole=True), *columns), rows, caption=caption, sections=frozenset(sections))


def _worst(units: Sequence[JudgedUnit]) -> list[str]:
    """Return the names of the cycles that are harmful or have the largest RMS of any model, in chronological order."""
    worst: dict[str, tuple[bool, float]] = {}
    for c in units:
        worst[c.name] = max(worst.get(c.name, (False, 0.0)), (c.harmful, c.rms))
    least = sorted(worst.values())[-_WORST]
    return [name for name, value in worst.items() if value >= least]


def _passed(cycle: JudgedUnit) -> str:
    return Toned(f"{cycle.rms:.2f}!", "bad") if cycle.harmful else f"{cycle.rms:.2f} "


def _by_target(assessments: Sequence[Assessment]) -> list[list[Assessment]]:
    overall = [a for a in assessments if a.overall]
    return [[a for a in overall if a.target == t] for t in dict.fromkeys(a.target for a in overall)]
