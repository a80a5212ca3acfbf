"""Tables of ISO 230 tests and time constants, for terminal, page and JSON."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from thermocomp.iso230.part2 import UNCERTAINTY, PositioningResult
from thermocomp.iso230.thermaltest import Figures, Targets, ThermalCurve, ThermalTest
from thermocomp.judging.choice import Cell, Table
from thermocomp.judging.settling.settling import Settling

_CAPTION_60 = "Relative to the start of the test; rows averaged over {minutes:.3g} min."
_CAPTION_U = (
    " ±: expanded uncertainty (k = 2) due to noise, including the serial correlation of the noise within that time."
)
_WORDS = {
    ">": "; >: the curve has not settled, t90 is later",
    "still": "; still: the averaged curve does not change by more than its noise",
    "faint": "; faint: the change is too close to the noise to determine a time",
    "returns": "; returns: the curve ends closer to its start than to its extreme",
    "peaks": "; peaks: the curve overshoots, then settles back to its last value",
}
#: label of the residual of a curve with a model
WITH = "with model"


def thermal_tables(test: ThermalTest) -> tuple[Table, ...]:
    """Return the results of a thermal test: displacements, tilts, targets and lengths, each in a separate table."""
    groups: list[tuple[str, Sequence[ThermalCurve]]] = []
    for unit, title in (("um", "Displacements [um]"), ("urad", "Angles [urad]")):
        groups.append((title, [c for c in test.curves if c.unit == unit]))
    groups.append(("Tilts [urad, the same in um/m]", test.tilts))
    for t in test.targets:
        groups.append((f"Axis {t.axis}: error at the targets of {t.name} [um]", t.curves))
        groups.append((f"Axis {t.axis}: change of the length over {t.distance:g} mm [um]", (t.length,)))
    found = [_curves(test, title, curves) for title, curves in groups if curves]
    return (*found, *(_slopes(test, t) for t in test.targets))


def _curves(test: ThermalTest, title: str, curves: Sequence[ThermalCurve]) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for c in curves:
        rows.append((c.name, *_figures(test, c.figures), *_settled(test, c)))
        if c.after_figures is not None:
            rows.append((f"{c.name}, {WITH}", *_figures(test, c.after_figures), *([None] * len(_settled(test, c)))))
    about = _CAPTION_60.format(minutes=max(c.course.noise.window for c in curves) / 60) + _CAPTION_U
    if test.kind == "etve":
        columns: tuple[str, ...] = ("", "range, 60 min", "range, all", "largest", "at the end")
        return Table(
            title=title,
            columns=columns,
            rows=tuple(rows),
            caption="The range over the whole test (all) is the ETVE. " + about,
        )
    hours = f"{test.running / 3600:.3g} h"
    columns = ("", "range, 60 min", f"range, {hours}", "range, all", "at 60 min", f"at {hours}", "largest", "cool-down")
    ends = "The drives stop" if test.stop < test.end else "The recording ends"
    caption = f"{about} {ends} at {hours}. t90: time to 90 % of the change up to then"
    told = {cell.split()[0] for c in curves for cell in _settled(test, c) if cell}
    caption += "".join(text for word, text in _WORDS.items() if word in told) + "."
    return Table(title=title, columns=(*columns, "t90 [min]"), rows=tuple(rows), caption=caption)


def _figures(test: ThermalTest, f: Figures) -> tuple[Cell, ...]:
    """Return the cells of a curve; hundredths are below the noise of any probe."""
    run = () if test.kind == "etve" else (f.range_run,)
    ranges = tuple(round(v, 2) for v in (f.range_60, *run, f.range_all))
    at_end = with_uncertainty(f.at_end, f.U_end)
    if test.kind == "etve":
        return (*ranges, round(f.largest, 2), at_end)
    return (
        *ranges,
        with_uncertainty(f.at_60, f.U_60),
        at_end,
        round(f.largest, 2),
        with_uncertainty(f.cool_down, f.U_cool_down),
    )


def with_uncertainty(value: float, expanded: float) -> str:
    """Return a value and its expanded uncertainty as text, such as ``10.2 ± 0.7``; empty if there is no value."""
    if not np.isfinite(value):
        return ""
    if not np.isfinite(expanded):
        return f"{value:.4g}"
    # at least one digit of the uncertainty, but not finer than any probe
    digits = min(2, max(1, -int(np.floor(np.log10(expanded))))) if expanded > 0 else 2
    return f"{value:.{digits}f} ± {max(expanded, 0.5 * 10.0**-digits):.{digits}f}"


def _settled(test: ThermalTest, curve: ThermalCurve) -> tuple[str, ...]:
    if test.kind == "etve" or curve.settling is None:
        return ()
    return (_minutes(curve.settling, curve.settling.t90),)


def _minutes(s: Settling, seconds: float) -> str:
    if not s.moves or s.returns:
        return "still" if not s.moves else "returns"
    if not s.clear:
        return "faint"
    if s.overshoots:
        return "peaks"
    if not np.isfinite(seconds):
        return ""
    return f"{'' if s.settled else '> '}{seconds / 60:.0f}"


def _slopes(test: ThermalTest, targets: Targets) -> Table:
    """Return the slope of an axis at several times: change of length per metre."""
    length = targets.length
    metres = targets.distance / 1e3
    rows: list[tuple[Cell, ...]] = []
    for text, values in (("measured", length.values), (WITH, length.after)):
        if values is not None:
            f = length.figures if values is length.values else length.after_figures
            assert f is not None
            end = f.at_end + (f.cool_down if np.isfinite(f.cool_down) else 0.0)
            rows.append((text, *(round(v / metres, 2) for v in (f.at_60, f.at_end, end))))
    title = f"Axis {targets.axis}: expansion [um/m]"
    hours = (f"at {test.running / 3600:.3g} h", f"at the end, {test.time[-1] / 3600:.3g} h")
    return Table(
        title=title,
        columns=("", "at 60 min", *hours),
        rows=tuple(rows),
        caption="Change of length per metre.",
    )


def time_constant_tables(settlings: Sequence[Settling]) -> tuple[Table, ...]:
    """Return the time constants of all channels, one table per phase."""
    tables = []
    for phase in dict.fromkeys(s.phase for s in settlings):
        mine = [s for s in settlings if s.phase == phase]
        several = sum(p.kind == phase.kind for p in dict.fromkeys(s.phase for s in settlings)) > 1
        rows = tuple(_time_constants(s) for s in mine)
        title = f"Time constants: {phase.kind}{f' {phase.number}' if several else ''} [min]"
        columns = ("", "change", "t63", "t90", "tau", "R2", "fast", "slow", "R2 of two")
        caption = (
            "change, t63, t90: read from the averaged curve; ±: expanded uncertainty (k = 2) due to noise; >: the "
            "curve has not settled at the end; still: the averaged curve does not change by more than its noise; "
            "faint: the change is too close to the noise to determine a time; returns: the curve ends closer to its "
            "start than to its extreme; peaks: the curve overshoots, then settles back to its last value. tau: time "
            "constant of a single exponential; fast, slow: of a sum of two exponentials, if two are justified; with "
            "standard errors, in brackets if the time constant is longer than the phase or its standard error exceeds "
            "half the value."
        )
        tables.append(Table(title=title, columns=columns, rows=rows, caption=caption))
    return tuple(tables)


def _time_constants(s: Settling) -> tuple[Cell, ...]:
    one = _taus(s, 1)
    return (
        s.channel,
        with_uncertainty(s.change, s.uncertainty),
        _minutes(s, s.t63),
        _minutes(s, s.t90),
        *one,
        s.one.r_squared if s.one is not None else None,
        *_taus(s, 2),
        s.two.r_squared if s.two is not None else None,
    )


def _taus(s: Settling, n: int) -> list[str]:
    fit = s.one if n == 1 else s.two
    if fit is None:
        return [""] * n
    texts = []
    for e in fit.terms:
        longer = e.tau > fit.duration
        text = f"> {fit.duration / 60:.0f}" if longer else f"{e.tau / 60:.1f} ± {e.tau_error / 60:.1f}"
        sure = not longer and e.tau_error <= 0.5 * e.tau
        texts.append(text if sure else f"({text})")
    return texts


def positioning_tables(results: Sequence[PositioningResult]) -> tuple[Table, ...]:
    """Return the values of each axis, all states next to each other, and the values at each target."""
    tables = []
    for key in dict.fromkeys((r.test.axis, r.test.unit, r.test.source) for r in results):
        mine = [r for r in results if (r.test.axis, r.test.unit, r.test.source) == key]
        symbols = list(dict.fromkeys(s for r in mine for s in r.axis_values))
        axis_rows = tuple((s, *(r.axis_values.get(s) for r in mine)) for s in symbols)
        named = f"Axis {key[0]}" if key[0] else "Axis"
        columns = ("", *(r.test.state or "value" for r in mine))
        title = f"{named}: accuracy, repeatability, reversal [{key[1]}]"
        tables.append(Table(title=title, columns=columns, rows=axis_rows, caption=UNCERTAINTY))
        tables += [_at_targets(r, named) for r in mine]
    return tuple(tables)


def _at_targets(r: PositioningResult, axis: str) -> Table:
    columns: list[str] = ["target [mm]"]
    data: list[Any] = [r.test.positions]
    for name, arrow in (("+", "↑"), ("-", "↓")):
        if name in r.directions:
            mean, s = r.directions[name].mean, r.directions[name].s
            several = bool(np.isfinite(s).all())
            columns += [f"mean {arrow}", f"s {arrow}"] if several else [f"mean {arrow}"]
            data += [mean, s] if several else [mean]
    for symbol, values in (("mean", r.mean), ("B", r.reversal), ("R", r.repeatability)):
        if values is not None:
            columns.append(symbol)
            data.append(values)
    rows = tuple(tuple(float(v) for v in row) for row in zip(*data, strict=True))
    state = f", {r.test.state}" if r.test.state else ""
    return Table(f"{axis}{state}: at the targets [{r.test.unit}]", tuple(columns), rows)


def thermal_content(test: ThermalTest) -> dict[str, Any]:
    """Return the JSON content of a thermal test; units are in the names, times in s."""
    positions = {c.name: float(p) for t in test.targets for c, p in zip(t.curves, t.positions, strict=True)}
    return {
        "name": test.name,
        "test": test.kind,
        "load": test.load,
        "start_s": float(test.recording.time[test.start]),
        "running_s": test.running,
        "duration_s": float(test.time[-1]),
        "ambient": None
        if test.ambient is None
        else {
            "channel": test.ambient.name,
            "low_degC": test.ambient_range[0],
            "high_degC": test.ambient_range[1],
        },
        "pairs": [asdict(p) | {"tilt": p.tilt} for p in test.pairs],
        "curves": [
            {
                "name": c.name,
                "unit": c.unit,
                "position_mm": positions.get(c.name),
                **asdict(c.figures),
                "moves": c.course.noise.moves,
                "averaged_over_s": c.course.noise.window,
                "t63_s": c.settling.t63 if c.settling else None,
                "t90_s": c.settling.t90 if c.settling else None,
                "settled": c.settling.settled if c.settling else None,
                WITH.replace(" ", "_"): asdict(c.after_figures) if c.after_figures is not None else None,
            }
            for c in test.all_curves
        ],
        "notes": list(test.notes),
    }


def positioning_content(r: PositioningResult) -> dict[str, Any]:
    """Return the JSON content of a positioning test, in the unit of its deviations."""
    return {
        "source": r.test.source,
        "axis": r.test.axis,
        "state": r.test.state,
        "unit": r.test.unit,
        "runs": {name: len(d) for name, d in r.test.directions.items()},
        "values": r.axis_values,
        "positions_mm": r.test.positions.tolist(),
        "mean": {name: d.mean.tolist() for name, d in r.directions.items()},
        "s": {name: d.s.tolist() if np.isfinite(d.s).all() else None for name, d in r.directions.items()},
        "B": r.reversal.tolist() if r.reversal is not None else None,
        "R": r.repeatability.tolist() if r.repeatability is not None else None,
        "uncertainty": None,
        "notes": [*r.notes, UNCERTAINTY],
    }


def settling_content(s: Settling) -> dict[str, Any]:
    """Return the JSON content of the time constants of one channel, in s."""
    return {
        "channel": s.channel,
        "unit": s.unit,
        "phase": s.phase.kind,
        "number": s.phase.number,
        "change": s.change,
        "U_change": s.uncertainty,
        "noise": s.noise,
        "told": s.words or "settled",
        "t63_s": s.t63,
        "t90_s": s.t90,
        **{
            name: None
            if f is None
            else {"terms": [asdict(e) for e in f.terms], "r_squared": f.r_squared, "rms": f.rms, "reliable": f.reliable}
            for name, f in (("one_exponential", s.one), ("two_exponentials", s.two))
        },
    }
