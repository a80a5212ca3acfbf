"""A user macro for Fanuc, Haas and Okuma controls that writes a linear formula to work offsets."""

import math
import re
import textwrap
from collections.abc import Iterator, Sequence
from decimal import Decimal
from functools import partial

from thermocomp.core.correction import Limits
from thermocomp.core.exceptions import InputError
from thermocomp.export.checkscript import MACRO, write_script
from thermocomp.export.facts import Facts
from thermocomp.export.heidenhain.package import find_marks
from thermocomp.export.macros.controls import FANUC, HAAS, OKUMA, Control
from thermocomp.export.reduction.reduced import SHAPES, Reduced, head, in_mm, in_um, shorten, to_ascii, vectors
from thermocomp.export.reduction.reducedpage import name_table, write_page
from thermocomp.export.target import Target

UNITS = "Units: offsets in mm, temperatures in degC"
#: places of the common variables after the one that switches on: first temperature, corrections in force
_FIRST, _FORCE = 1, {"X": 21, "Y": 22, "Z": 23}
#: number of variables available for sensors
_ROOM = _FORCE["X"] - _FIRST
#: longest time between two calls [s]: the rate times this is the largest change per call
INTERVAL = 60.0

_ABOUT = """\
The macro evaluates a formula of the temperatures in common variables and moves the {offset} towards the
result: the correction is limited to {most:g} um, and its change to {step:g} um per call, that is {rate:g} um/s with a
call every {interval:g} s. If a temperature is {bad}, the axis keeps its present correction.

The zero (reference temperatures) is fixed: the temperatures written in the macro, those at the start of the recording.
Set datums with the correction in force: they then include its present value, and only later changes have an effect.
Nothing else may write to that offset while the macro is in use{kept}.

{known}"""

_INSTALL = """\
All of this is **UNCONFIRMED** on a control: have the machine builder check it.

1. Choose free common variables that are retained at power-off, and replace {on} to {last} in the macro by them.
2. {source} a value of 0 within the plausible range is taken as a temperature:

{sensors}

3. {load} every {interval:g} s, at points where the axes are clear and no cutter compensation is active, such as the
   start of each part. With less frequent calls the correction lags; with more frequent calls it changes faster than the
   rate above. The number of the program is that of `--program`.
4. Test the sign, which takes two minutes, with {on} = 0: add 0.1 mm to the offset of an axis by hand, and move to the
   same position again: the tool must be 0.1 mm further in the plus direction. Restore the offset.
5. `{on} = 1` switches the correction on. Set the datums again once it has reached its value.

"""

_CHECK = """\
`{name}_vectors.csv` contains temperatures [degC], the deviation by the formula ("growth") [mm], the correction that
the offset must reach [um], and its tolerance (the macro rounds to 1 um). It includes rows beyond the trained range
and the limit, and rows with an implausible temperature, where the correction must not change. `python3
{name}_check.py` (needs only Python) runs the lines of the macro until the correction no longer changes, and compares:
exit code 0 if all rows agree. On the control: write the temperatures of a row to the variables by MDI, set {on} = 1,
call the macro until the correction no longer changes, and read the offset. Then restore the variables."""

_OFF = """\
Set `{on} = 0` and continue to call the macro: it removes its correction by at most {step:g} um per call. When {forces}
are 0, it is removed, and the calls can be removed too. Never clear the offset by hand while the macro is in use."""


def write_macro(
    control: Control,
    reductions: Sequence[Reduced],
    limits: Limits,
    name: str,
    facts: Facts,
    *,
    figure: str = "",
    program: int = 7701,
) -> dict[str, bytes]:
    """Return all files of the export to a control with macros by name, the page of instructions last."""
    marks = find_marks(reductions)
    if len(marks) > _ROOM:
        raise InputError(f"{len(marks)} temperatures, but the macro has room for {_ROOM}: choose fewer with --sensors")
    place = {sensor: control.variable(_FIRST + k) for k, sensor in enumerate(marks)}
    most, step = (_cap(limits, option, times) for option, times in (("magnitude", 1.0), ("rate", INTERVAL)))
    sign = f"Sign: the correction, minus the deviation (actual minus commanded), is added to the {control.offset}"
    first = [*head(reductions, facts, sign, UNITS), *(f"UNCONFIRMED: {words}" for words in control.unconfirmed)]
    told = [f"({part})" for line in first for part in textwrap.wrap(_comment(line), 110)]
    number, on = control.program.format(program), control.variable(0)
    lines = [f"{number} {told[0]}", *told[1:], f"({on}: 1 IS ON. ANY OTHER VALUE REMOVES THE CORRECTION)"]
    lines += [f"({place[s]}: {m.upper()} IN DEGC. UNCONFIRMED: WHO WRITES IT)" for s, m in marks.items()]
    for r in reductions:
        lines += _axis(r, control, marks, place, (most, step))
    file = f"{name}.{control.ending}"
    page = write_page(
        name,
        first,
        reductions,
        what=f"a macro of {control.name}",
        about=_ABOUT.format(
            offset=control.offset,
            most=most,
            step=step,
            rate=limits.rate,
            interval=INTERVAL,
            bad="vacant or implausible" if control.vacant else "implausible",
            kept="; a value that was there before is kept, because the\nmacro adds to it"
            if control.adds
            else ", programs with a G52\nneither, because the macro writes its correction there",
            known=control.known,
        ),
        limits=f"the macro limits the correction to {most:g} um and its change to {step:g} um per call, and rounds it "
        "to whole um; the errors above are those of the formula without these limits and without rounding.",
        failed="if a temperature is missing or implausible, its axes keep their correction; a wrong value within the "
        "plausible range is not detected and moves them.",
        install=_INSTALL.format(
            on=on,
            last=control.variable(_FORCE["Z"]),
            source=control.source,
            sensors=name_table("variable", {place[s]: (m.upper(), s) for s, m in marks.items()}),
            load=control.load.format(file=file, program=program),
            interval=INTERVAL,
        ).strip(),
        check=_CHECK.format(name=name, on=on),
        off=_OFF.format(on=on, step=step, forces=", ".join(control.variable(_FORCE[r.axis]) for r in reductions)),
        figure=figure,
    )
    texts = {
        file: control.before + "\n".join(lines) + f"\n{control.after}",
        f"{name}_vectors.csv": _vectors(reductions, marks, most, vacant=control.vacant),
        f"{name}_check.py": write_script(MACRO, name, control.ending),
        f"{name}.md": page,
    }
    return {file: text.encode() for file, text in texts.items()}


def _axis(
    r: Reduced, control: Control, marks: dict[str, str], place: dict[str, str], limits: tuple[float, float]
) -> Iterator[str]:
    """Yield the lines of the macro that correct one axis."""
    label, force, jump = 10 * (1 + "XYZ".index(r.axis)), control.variable(_FORCE[r.axis]), control.jump.format
    wanted, change = control.local
    yield f"({_comment(r.model.target)})"
    yield f"({force}: CORRECTION OF {r.axis} IN FORCE IN MM. RETAINED AT POWER-OFF)"
    if control.vacant:
        yield jump(f"{force} NE #0", label + 1)
        yield f"{force}=0.0"
    yield f"N{label + 1} {wanted}=0.0"
    yield f"{jump(f'{control.variable(0)} NE 1', label + 2)} (OFF: REMOVED)"
    for (i, _), (low, high) in zip(r.terms, _plausible(r), strict=True):
        if control.vacant:
            yield f"{jump(f'{place[i.name]} EQ #0', label + 3)} ({marks[i.name].upper()}: VACANT. NO CHANGE)"
        yield f"{jump(f'{place[i.name]} LT {_real(low)}', label + 3)} ({marks[i.name].upper()}: IMPLAUSIBLE)"
        yield jump(f"{place[i.name]} GT {_real(high)}", label + 3)
    yield f"{wanted}={_real(in_um(0.0 - r.model.intercept))} (TARGET IN UM: A CONTROL ACCEPTS EIGHT DIGITS)"
    for (i, factor), zero in zip(r.terms, r.zeros, strict=True):
        yield f"{wanted}={wanted}-[{_real(in_um(factor))}*[{place[i.name]}-[{_real(zero)}]]]"
    yield f"{wanted}=ROUND[{wanted}] (WHOLE UM: WHAT AN OFFSET ROUNDS AWAY WOULD ADD UP)"
    yield f"{wanted}={wanted}/1000.0 (IN MM)"
    yield from _within(wanted, limits[0], control, label + 4)
    yield f"N{label + 2} {change}={wanted}-{force}"
    yield from _within(change, limits[1], control, label + 6)
    yield f"{force}={force}+{change}"
    for offset in control.moved(r.axis):
        written = f"{offset}+{change}" if control.adds else force
        yield f"{offset}={written} (UNCONFIRMED: OFFSET OF {r.axis} IN MM)"
    yield f"N{label + 3}"


def _within(variable: str, most: float, control: Control, label: int) -> Iterator[str]:
    """Yield the lines that limit a variable; only jumps, as not every control has IF...THEN."""
    limit = _real(in_mm(most))
    yield control.jump.format(f"{variable} LE {limit}", label)
    yield f"{variable}={limit}"
    yield f"N{label} {control.jump.format(f'{variable} GE -{limit}', label + 1)}"
    yield f"{variable}=-{limit}"
    yield f"N{label + 1}"


def _cap(limits: Limits, option: str, times: float) -> float:
    """Return a limit times a factor in whole um, in the digits of a control: not larger than requested."""
    asked: float = getattr(limits, option)
    # exact decimal product: 0.1 um/s is 6 um per minute, without a rounding error of double precision
    whole = int(Decimal(repr(asked)) * Decimal(times))
    if not whole:
        raise InputError(
            f"--{option} {asked:g}: a macro moves offsets in whole um: give at least --{option} "
            f"{math.ceil(1e4 / times) / 1e4:g}"
        )
    return float(Decimal(shorten(in_mm(float(whole)), cap=True)).scaleb(3))


def _plausible(r: Reduced) -> list[tuple[float, float]]:
    """Return the plausible range of each temperature, including changes of the zero from day to day."""
    least, most = (fixed := r.model.thresholds).plausible["temperature"]
    found = []
    for (i, _), zero in zip(r.terms, r.zeros, strict=True):
        room = max(i.high - i.low, fixed.least_margin) + fixed.zero_change
        found.append((round(max(least, zero + i.low - room), 1), round(min(most, zero + i.high + room), 1)))
    return found


def _vectors(reductions: Sequence[Reduced], marks: dict[str, str], most: float, *, vacant: bool) -> str:
    """Return test vectors as CSV; a temperature that is not there is an empty field."""
    rows = [",".join(["axis", *(f"{m}_degC" for m in marks.values()), "growth_mm", "correction_um", "tolerance_um"])]
    for r in reductions:
        names, ranges = [i.name for i, _ in r.terms], _plausible(r)
        tried: list[tuple[float | None, ...]] = [*vectors(r)]
        for k, (low, high) in enumerate(ranges):
            warm: list[float | None] = [z + 0.5 * i.high for (i, _), z in zip(r.terms, r.zeros, strict=True)]
            tried += [(*warm[:k], bad, *warm[k + 1 :]) for bad in (*[None] * vacant, low - 0.1, high + 0.1, 850.0)]
        for row in tried:
            good = [t for t, (low, high) in zip(row, ranges, strict=True) if t is not None and low <= t <= high]
            said = r.deviation(good) if len(good) == len(row) else 0.0
            known = dict(zip(names, row, strict=True))
            values = ["" if known.get(n) is None else f"{known[n]:g}" for n in marks]
            wanted = min(max(0.0 - said, -most), most)
            rows.append(",".join([r.axis, *values, f"{said / 1e3:.7f}", f"{wanted:.4f}", "1"]))
    return "\n".join(rows) + "\n"


def _real(number: float | str) -> str:
    """Return a number of eight digits with a decimal point: without a point a control may assume other units."""
    text = shorten(number if isinstance(number, str) else in_um(number))
    return text if "." in text else f"{text}.0"


def _comment(text: str) -> str:
    """Return text that is valid in a comment: no brackets, no lower-case letters, ASCII only."""
    plain = to_ascii(text).upper().replace("(", " ").replace(")", " ")
    return re.sub(r"[^-+#*/=:,. 0-9A-Z_]", ".", plain)


FANUC_TARGET, HAAS_TARGET, OKUMA_TARGET = (
    Target(write=partial(write_macro, control), shape=SHAPES["macro"], program=True) for control in (FANUC, HAAS, OKUMA)
)
