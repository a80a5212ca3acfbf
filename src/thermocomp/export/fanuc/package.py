"""A custom macro for Fanuc controls that writes a linear formula to the external workpiece zero offset."""

import re
from collections.abc import Iterator, Sequence
from decimal import Decimal

from thermocomp.core.correction import Limits
from thermocomp.core.exceptions import InputError
from thermocomp.export.checkscript import FANUC, write_script
from thermocomp.export.facts import Facts
from thermocomp.export.heidenhain.package import find_marks
from thermocomp.export.reduction.reduced import SHAPES, Reduced, head, in_mm, in_um, shorten, vectors
from thermocomp.export.reduction.reducedpage import write_page
from thermocomp.export.target import Target

SIGN = (
    "Sign: the correction, minus the deviation (actual minus commanded), is added to the external workpiece zero offset"
)
UNITS = "Units: offsets in mm, temperatures in degC"
#: unconfirmed assumptions, stated at the top and repeated in the code
UNCONFIRMED = (
    "UNCONFIRMED: no line of this was tested on a Fanuc control or checked against its manuals",
    "UNCONFIRMED: #5201, #5202, #5203 as external workpiece zero offset of X, Y, Z in mm, which a program may write",
    "UNCONFIRMED: how the PMC writes temperatures in degC to #501 and following; replace these numbers by yours",
    "UNCONFIRMED: that your control supports IF...THEN, and applies a new offset before the next move",
)
_OFFSETS = {"X": 5201, "Y": 5202, "Z": 5203}
#: common variables, retained at power-off: enable, first temperature, corrections in force
_ON, _FIRST, _FORCE = 500, 501, {"X": 521, "Y": 522, "Z": 523}
#: number of variables available for sensors
_ROOM = _FORCE["X"] - _FIRST
#: longest time between two calls [s]: the rate times this is the largest change per call
INTERVAL = 60.0

_ABOUT = """\
The macro evaluates a formula of the temperatures in common variables and moves the external workpiece zero offset
towards the result: the correction is limited to {most:g} um, and its change to {step:g} um per call, that is {rate:g}
um/s with a call every {interval:g} s. If a temperature is vacant or implausible, the axis keeps its present correction.

The zero (reference temperatures) is fixed: the temperatures written in the macro, those at the start of the recording.
Set datums with the correction in force: they then include its present value, and only later changes have an effect.
Nothing else may write to that offset while the macro is in use; a value that was there before is kept, because the
macro adds to it."""

_INSTALL = """\
All of this is **UNCONFIRMED** on a control: have the machine builder check it.

1. Choose free common variables that are retained at power-off, and replace #500 to #{last} in the macro by them.
2. Have the PMC write the temperatures in degC: {sensors}. If a sensor fails, it must write vacant or leave the
   value unchanged; a value of 0 within the plausible range is taken as a temperature.
3. Load `{name}.nc` under a free program number instead of O7701; programs from O8000 on are usually protected.
4. Call it (`G65 P7701`, so that it has its own local variables) every {interval:g} s, at points where the axes are
   clear and no cutter compensation is active, such as the start of each part. With less frequent calls the
   correction lags; with more frequent calls it changes faster than the rate above.
5. Test the sign, which takes two minutes, with #500 = 0: add 0.1 mm to the external offset of an axis by hand, and
   move to the same position again: the tool must be 0.1 mm further in the plus direction. Restore the offset.
6. `#500 = 1` switches the correction on. Set the datums again once it has reached its value.

"""

_CHECK = """\
`{name}_vectors.csv` contains temperatures [degC], the deviation by the formula ("growth") [mm], the correction that
the offset must reach [um], and its tolerance (the control rounds to 1 um). It includes rows beyond the trained range
and the limit, and rows with an implausible temperature, where the correction must not change. `python3
{name}_check.py` (needs only Python) runs the lines of the macro until the correction no longer changes, and compares:
exit code 0 if all rows agree. On the control: write the temperatures of a row to the variables by MDI, set #500 = 1,
call the macro until the correction no longer changes, and read the external offset. Then restore the variables."""

_OFF = """\
Set `#500 = 0` and continue to call the macro: it removes its correction by at most {step:g} um per call. When {forces}
are 0, it is removed, and the calls can be removed too. Never clear the external offset by hand while the macro is in
use."""


def write_fanuc(
    reductions: Sequence[Reduced], limits: Limits, name: str, facts: Facts, *, figure: str = ""
) -> dict[str, bytes]:
    """Return all files of the export to Fanuc controls by name, the page of instructions last."""
    marks = find_marks(reductions)
    if len(marks) > _ROOM:
        raise InputError(f"{len(marks)} temperatures, but the macro has room for {_ROOM}: choose fewer with --sensors")
    place = {sensor: _FIRST + k for k, sensor in enumerate(marks)}
    most, step = (_cap(limits, option, times) for option, times in (("magnitude", 1.0), ("rate", INTERVAL)))
    first = [*head(reductions, facts, SIGN, UNITS), *UNCONFIRMED]
    told = [f"({line})" for line in map(_comment, first)]
    lines = ["%", f"O7701 {told[0]}", *told[1:]]
    lines += [f"(#{_ON}: 1 IS ON. ANY OTHER VALUE REMOVES THE CORRECTION)"]
    lines += [f"(#{place[s]}: {m.upper()} IN DEGC. UNCONFIRMED: FROM THE PMC)" for s, m in marks.items()]
    for r in reductions:
        lines += _axis(r, place, most, step)
    page = write_page(
        name,
        first,
        reductions,
        what="a custom macro of a Fanuc control",
        about=_ABOUT.format(most=most, step=step, rate=limits.rate, interval=INTERVAL),
        limits=f"the macro limits the correction to {most:g} um and its change to {step:g} um per call; the errors "
        "above are those of the formula without these limits.",
        failed="if a temperature is vacant or implausible, its axes keep their correction; a wrong value within the "
        "plausible range is not detected and moves them.",
        install=_INSTALL.format(
            name=name,
            last=_FORCE["Z"],
            sensors=", ".join(f"{s} in #{p}" for s, p in place.items()),
            interval=INTERVAL,
        ).strip(),
        check=_CHECK.format(name=name),
        off=_OFF.format(step=step, forces=", ".join(f"#{_FORCE[r.axis]}" for r in reductions)),
        figure=figure,
    )
    texts = {
        f"{name}.nc": "\n".join([*lines, "M99", "%"]) + "\n",
        f"{name}_vectors.csv": _vectors(reductions, marks, most),
        f"{name}_check.py": write_script(FANUC, name),
        f"{name}.md": page,
    }
    return {file: text.encode() for file, text in texts.items()}


def _axis(r: Reduced, place: dict[str, int], most: float, step: float) -> Iterator[str]:
    """Yield the lines of the macro that correct one axis."""
    force, label = _FORCE[r.axis], 10 * (1 + "XYZ".index(r.axis))
    yield f"({_comment(r.model.target)})"
    yield f"(#{force}: CORRECTION OF {r.axis} IN FORCE IN MM. RETAINED AT POWER-OFF)"
    yield f"IF[#{force}NE#0]GOTO{label + 1}"
    yield f"#{force}=0.0"
    yield f"N{label + 1}#1=0.0"
    yield f"IF[#{_ON}NE1]GOTO{label + 2} (OFF: REMOVED)"
    for (i, _), (low, high) in zip(r.terms, _plausible(r), strict=True):
        yield f"IF[#{place[i.name]}EQ#0]GOTO{label + 3} ({_comment(i.name)}: VACANT. NO CHANGE)"
        yield f"IF[#{place[i.name]}LT{_real(low)}]GOTO{label + 3} (IMPLAUSIBLE)"
        yield f"IF[#{place[i.name]}GT{_real(high)}]GOTO{label + 3}"
    yield f"#1={_real(in_um(0.0 - r.model.intercept))} (TARGET IN UM: A CONTROL ACCEPTS EIGHT DIGITS)"
    for (i, factor), zero in zip(r.terms, r.zeros, strict=True):
        yield f"#1=#1-[{_real(in_um(factor))}*[#{place[i.name]}-[{_real(zero)}]]]"
    yield "#1=#1/1000.0 (IN MM)"
    yield from _within("#1", most)
    yield f"N{label + 2}#2=#1-#{force}"
    yield from _within("#2", step)
    yield f"#{force}=#{force}+#2"
    yield f"#{_OFFSETS[r.axis]}=#{_OFFSETS[r.axis]}+#2 (UNCONFIRMED: EXTERNAL OFFSET OF {r.axis} IN MM)"
    yield f"N{label + 3}"


def _within(variable: str, most: float) -> Iterator[str]:
    limit = _real(in_mm(most))
    yield f"IF[{variable}GT{limit}]THEN{variable}={limit} (UNCONFIRMED: IF...THEN)"
    yield f"IF[{variable}LT-{limit}]THEN{variable}=-{limit}"


def _cap(limits: Limits, option: str, times: float) -> float:
    """Return a limit [um] in the digits of a control, times a factor: not larger than requested."""
    asked: float = getattr(limits, option)
    # exact decimal product: 0.1 um/s is 6 um per minute, without a rounding error of double precision
    taken = float(Decimal(shorten(in_mm(float(Decimal(repr(asked)) * Decimal(times))), cap=True)).scaleb(3))
    if not taken:
        raise InputError(
            f"--{option} {asked:g}: a Fanuc control accepts eight digits, in which this value is 0: give at least "
            f"--{option} {1e-4 / times:.2g}"
        )
    return taken


def _plausible(r: Reduced) -> list[tuple[float, float]]:
    """Return the plausible range of each temperature, including changes of the zero from day to day."""
    least, most = (fixed := r.model.thresholds).plausible["temperature"]
    found = []
    for (i, _), zero in zip(r.terms, r.zeros, strict=True):
        room = max(i.high - i.low, fixed.least_margin) + fixed.zero_change
        found.append((round(max(least, zero + i.low - room), 1), round(min(most, zero + i.high + room), 1)))
    return found


def _vectors(reductions: Sequence[Reduced], marks: dict[str, str], most: float) -> str:
    """Return test vectors as CSV; a vacant temperature variable is an empty field."""
    rows = [",".join(["axis", *(f"{m}_degC" for m in marks.values()), "growth_mm", "correction_um", "tolerance_um"])]
    for r in reductions:
        names, ranges = [i.name for i, _ in r.terms], _plausible(r)
        tried: list[tuple[float | None, ...]] = [*vectors(r)]
        for k, (low, high) in enumerate(ranges):
            warm: list[float | None] = [z + 0.5 * i.high for (i, _), z in zip(r.terms, r.zeros, strict=True)]
            tried += [(*warm[:k], bad, *warm[k + 1 :]) for bad in (None, low - 0.1, high + 0.1, 850.0)]
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
    plain = text.upper().encode("ascii", "replace").decode()
    return re.sub(r"[^-+#*/=:,. 0-9A-Z_]", ".", plain.replace("(", " ").replace(")", " "))


TARGET = Target(write=write_fanuc, shape=SHAPES["fanuc"])
