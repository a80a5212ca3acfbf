"""``thermocomp position``: a position-dependent error from profiles in several thermal states."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from thermocomp.cli.extras import needs
from thermocomp.cli.options import (
    Flag,
    Json,
    OptionalNames,
    OptionalOutput,
    Recordings,
    Study,
    refuse_existing,
    tell_trouble,
)
from thermocomp.core.exceptions import InputError

if TYPE_CHECKING:
    from thermocomp.assessment.position import CycleErrors, PositionStudy
    from thermocomp.recording.profiles import Profiles

States = Annotated[list[int] | None, Parameter(consume_multiple=True, negative=())]

_console = Console(highlight=False)


def position(
    recordings: Recordings,
    /,
    *,
    component: str,
    columns: str = "",
    positions: Path | None = None,
    layout: Literal["wide", "long"] | None = None,
    mapping: Path | None = None,
    model: str = "mra",
    inputs: OptionalNames = None,
    slopes: int = 1,
    offset: Flag = False,
    profile: Literal["polynomial", "spline"] = "polynomial",
    order: int | None = None,
    reference: States = None,
    reference_position: float | None = None,
    split: str | None = None,
    leave_one_file_out: Flag = False,
    output: OptionalOutput = None,
    overwrite: Flag = False,
    json: Json = False,
) -> int:
    """Fit a position-dependent error: cold profile and thermal slopes, judged on unseen thermal cycles.

    Parameters
    ----------
    recordings : list of Path
        CSV, XLSX or Parquet files with profiles in several thermal states; each is one test.
    component : str
        Code of the error, such as EYY, EXX or EAZ: it says along which axis and in which unit.
    columns : str
        Names of the columns, * standing for the position in mm, such as 'y_laser_*'; of a long table the column of the
        error. Without it, the columns that end in a position and the unit, such as y_laser_250_um.
    positions : Path
        TOML file that says where each column was measured, for columns that have no position in their name.
    layout : str
        wide: a row per thermal state, a column per position; long: a row per position. Found out if not given.
    mapping : Path
        TOML file that says what the columns are.
    model : str
        Method for the slopes, as in ``thermocomp compare``, all but gp.
    inputs : list of str
        Channels to predict the slopes from; all temperatures and the spindle speed if not given.
    slopes : int
        Highest power of the position.
    offset : bool
        Model a shift of the whole profile too.
    profile : str
        polynomial or spline, for the cold profile.
    order : int
        Of the polynomial, or number of knots of the spline; chosen by points left out if not given.
    reference : list of int
        States of each test that count as cold, from 0: their mean is the cold profile. The first if not given.
    reference_position : float
        Where the slopes turn [mm]; the axis' zero if not given.
    split : str
        Judge by time: shares of the states such as 0.6/0.4, or hours such as 10h/6h.
    leave_one_file_out : bool
        Judge on each recording in turn; without it on each thermal cycle.
    output : Path
        File to write the model to (.json).
    overwrite : bool
        Write over an existing file.
    json : bool
        Print results for a machine instead of tables.

    Returns
    -------
    int
        0 done, 1 the model was refused, 2 unusable input.
    """
    if not recordings:
        raise InputError("no recording given: name at least one CSV, XLSX or Parquet file")
    if output is not None:
        refuse_existing([output], overwrite, recordings)
    with needs("study"):
        from thermocomp.assessment import position as assessing
        from thermocomp.files import mapping as mappings
        from thermocomp.files import positionfile
        from thermocomp.files import profiles as tables
        from thermocomp.models.methods import method
        from thermocomp.models.position import PositionOptions
    if not method(model).kind.freezable:
        raise InputError(f"{model} cannot be frozen to plain numbers: choose another method")
    given = mappings.read_mapping(mapping) if mapping is not None else None
    places = tables.read_places(positions) if positions is not None else None
    options = tables.ProfileOptions(target=component, columns=columns, places=places)
    tests = [tables.read(path, options, given, layout=layout) for path in recordings]
    trouble = tell_trouble([test.states for test in tests])
    how = PositionOptions(
        method=model,
        inputs=inputs,
        slopes=slopes,
        offset=offset,
        profile=profile,
        order="auto" if order is None else order,
        reference=reference or 0,
        reference_position=reference_position,
    )
    asked = Study(target=[component], split=split, leave_one_file_out=leave_one_file_out)
    found = assessing.study(tests, how, judging=asked.judging)
    if output is not None:
        positionfile.write([found.fit.model], output, overwrite=overwrite)
    if json:
        with needs("study"):
            from thermocomp.cli.output import print_json
        print_json({"trouble": trouble, **_content(found, output)}, _console)
    else:
        _show(found, tests, output)
    return 0 if found.assessment.accepted else 1


def _show(found: "PositionStudy", tests: "list[Profiles]", output: Path | None) -> None:
    fit, judged = found.fit, found.assessment
    model, unit = fit.model, fit.model.unit
    states = sum(len(t) for t in tests)
    low, high = model.travel
    _console.print(
        f"[bold]{escape(model.target)}[/]: {states} profiles of {len(tests[0].points)} points along {model.axis}, "
        f"{low:g} to {high:g} mm"
    )
    if fit.profile.tried:
        table = Table(title="Cold profile: error at points left out", caption="! = chosen")
        for heading in ("order", "terms", f"left out, {unit}"):
            table.add_column(heading, justify="right")
        for t in fit.profile.tried:
            mark = "!" if t.order == fit.profile.order else " "
            table.add_row(f"{_order(t.order)}{mark}", str(t.n_terms), f"{t.left_out:.3f}")
        _console.print(table)
    _console.print(f"Cold profile: {model.profile and model.profile.kind} of order {_order(fit.profile.order)}")
    for factor, errors, power in zip(model.models, fit.coefficient_errors, model.powers, strict=True):
        _console.print(f"k{power} [{factor.unit}] = {factor.formula()}", markup=False)
        if errors:
            told = ", ".join(f"{name} {error:.2g}" for name, error in errors.items())
            _console.print(f"  standard errors: {told}", markup=False)
    rest = ", ".join(f"m = {m}: {r:.2f}" for m, r in fit.remainders.items() if math.isfinite(r))
    _console.print(f"Beside the cold profile {fit.thermal_rms:.2f} {unit} RMS; beside powers up to {rest} {unit}")
    if fit.enough > max(model.powers):
        _console.print(f"[yellow]but[/] higher powers tell more: try --slopes {fit.enough}")
    if fit.shifts:
        _console.print(
            f"[yellow]but[/] the profiles do not turn about {model.reference_position:g} mm: with an offset "
            f"{fit.offset_remainder:.2f} {unit} are left; try --offset, or another --reference-position"
        )
    _console.print(f"Judged on: {judged.protocol}")
    table = Table(caption=f"RMS over all points in {unit}; max: largest error")
    table.add_column("unseen cycle")
    for heading in ("profiles", "none", "cold profile", "model", "none max", "model max"):
        table.add_column(heading, justify="right")
    for c in (*judged.cycles, judged.overall):
        numbers = (c.none, c.geometric, c.model, c.none_max, c.model_max)
        table.add_row(escape(c.cycle), str(c.n_states), *(f"{v:.2f}" for v in numbers))
    _console.print(table)
    word = "[green]accepted[/]" if judged.accepted else "[red]refused[/]"
    _console.print(f"{word} {escape(model.target)}: {escape(judged.reason)}")
    if output is not None:
        _console.print(f"Model file: {output}")


def _content(found: "PositionStudy", output: Path | None) -> dict[str, Any]:
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
        "verdict": "accepted" if judged.accepted else "refused",
        "reason": judged.reason,
        "file": None if output is None else str(output),
    }


def _cycle(c: "CycleErrors") -> dict[str, Any]:
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
