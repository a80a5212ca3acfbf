"""A linear formula of current temperatures for Heidenhain controls: MP7530 / TEMPCOMP, and the words of a TNC 360."""

import math
from collections.abc import Sequence

from thermocomp.core.correction import Limits
from thermocomp.export.checkscript import HEIDENHAIN, write_script
from thermocomp.export.facts import Facts
from thermocomp.export.reduction.reduced import SHAPES, Reduced, head, in_mm, in_um, mark, to_ascii, vectors
from thermocomp.export.reduction.reducedpage import name_table, write_page
from thermocomp.export.target import Target

SIGN = (
    "Sign: a formula gives the actual dimension: present dimension <L> plus the deviation (actual minus commanded) in "
    "mm; a TNC 360 word is the correction in um, which is minus the deviation"
)
UNITS = "Units: formula in mm, TNC 360 word in whole um, W<...> in degC"
#: unconfirmed assumptions, stated at the top and repeated in the file
UNCONFIRMED = (
    "UNCONFIRMED: the sign of a dimension in your kinematics table; the wrong sign doubles the error: test it as "
    "described in the page",
    "UNCONFIRMED: which PLC word contains which temperature, and in which unit; replace W<...> by it",
    "UNCONFIRMED: which of the words W576 to W582 of a TNC 360 belongs to which axis",
    "UNCONFIRMED: whether your software version accepts as many digits and brackets as the formula has",
)
#: largest value of a TNC 360 word [um]
_WORD = 32_767

_ABOUT = """\
A TNC 426/430 computes a dimension in its kinematics table by a formula (MP7530, TEMPCOMP), such as
`300+3.45e-3*(W486-20)`: 300 mm, plus 3.45e-3 mm per degC of a PLC word. `{name}.txt` contains one formula per axis.
A TNC 360 reads words from the PLC, W576 to W582, of up to +-32,767 um, and follows them at 1 um/s; the position
display does not show this. The iTNC 530 (KinematicsComp, .COM tables) is not supported.

The zero (reference temperatures) is fixed: the temperatures written in the formula, those at the start of the
recording. Set datums with the formula in force: they then include its present value, and only later changes have an
effect."""

_INSTALL = """\
1. Ask the machine builder which dimension of the kinematics table lies along the axis, and which PLC words contain
   the temperatures (table below): this is **UNCONFIRMED**. The words must be in degC; if a word is in tenths of a degC,
   `W<...>` is that word divided by 10. A resolution of 1 degC is too coarse: {step} um per degC.
2. Make a note of the old line. Replace `<L>` by its dimension and `W<...>` by the words, and enter the formula.
3. The sign of the dimension is **UNCONFIRMED**; to test it takes two minutes: with a dial indicator at the tool, add
   0.1 mm to the dimension only, and move the axis to the same position again. If the tool is 0.1 mm further in the
   **minus** direction of the axis, the formula is correct; if in the plus direction, reverse every sign after `<L>`.
4. Set the datums again.

{sensors}

TNC 360: the PLC computes `word` of `{name}.txt`, rounds it to whole um, limits it to +-{most:g} um, and writes it
every few seconds. Test the sign with +100 um: the axis must move by 0.1 mm in its plus direction."""

_CHECK = """\
`{name}_vectors.csv` contains temperatures [degC], the growth that the formula must give in addition to `<L>` [mm],
the resulting correction [um], and its tolerance, also beyond the trained range. `python3 {name}_check.py` (needs only
Python) evaluates the formulas of `{name}.txt` and compares: exit code 0 if all agree. At the control: have the PLC
write the temperatures of a row to the words, and read the dimension or the movement of the axis."""

_OFF = """\
Move the axes clear, replace the formula by the old dimension (TNC 360: let the PLC write 0, which the axis follows at
1 um/s), and set the datums again. A changed dimension moves the tool immediately."""


def write_heidenhain(
    reductions: Sequence[Reduced], limits: Limits, name: str, facts: Facts, *, figure: str = ""
) -> dict[str, bytes]:
    """Return all files of the export to Heidenhain controls by name, the page of instructions last."""
    first = [*head(reductions, facts, SIGN, UNITS), *UNCONFIRMED]
    marks = find_marks(reductions)
    most = min(math.floor(limits.magnitude), _WORD)  # in whole um
    lines = [f"; {line}" for line in first]
    for r in reductions:
        lines += [
            "",
            f"; {r.model.target}: {', '.join(f'W<{marks[i.name]}> is {i.name} [degC]' for i, _ in r.terms)}",
            "; UNCONFIRMED: sign of the dimension; <L> is the dimension in the table now [mm]",
            f"{r.axis} formula: <L>{formula(r, marks)}",
            f"; UNCONFIRMED: word of a TNC 360; correction [um], rounded, within +-{most:g}",
            f"{r.axis} word: {formula(r, marks, word=True)}",
        ]
    page = write_page(
        name,
        first,
        reductions,
        what="a formula of a Heidenhain control",
        about=_ABOUT.format(name=name),
        limits="the formula limits neither magnitude nor rate. A TNC 360 follows at 1 um/s.",
        failed="the formula uses any value of a word: a failed sensor that reads 0 degC moves the axis by the whole "
        "term. Let the PLC keep the last valid value.",
        install=_INSTALL.format(
            name=name,
            sensors=name_table("word", {f"`W<{m}>`": (m, name) for name, m in marks.items()}),
            step=f"{max(abs(f) for r in reductions for _, f in r.terms):.1f}",
            most=most,
        ),
        check=_CHECK.format(name=name),
        off=_OFF,
        figure=figure,
    )
    texts = {
        f"{name}.txt": to_ascii("\n".join(lines)) + "\n",
        f"{name}_vectors.csv": write_vectors(reductions, marks),
        f"{name}_check.py": write_script(HEIDENHAIN, name, "txt"),
        f"{name}.md": page,
    }
    return {file: text.encode() for file, text in texts.items()}


def find_marks(reductions: Sequence[Reduced]) -> dict[str, str]:
    """Return the symbols of the temperatures in all formulas, by name."""
    found: dict[str, str] = {}
    for r in reductions:
        for i, _ in r.terms:
            found.setdefault(i.name, mark(i.name, list(found.values())))
    return found


def formula(r: Reduced, marks: dict[str, str], *, word: bool = False) -> str:
    """Return a formula as text: in mm, to be appended to a dimension of the machine, or in um for a TNC 360 `word`."""
    sign, number = (-1, in_um) if word else (1, in_mm)
    text = _signed(number(sign * r.model.intercept)) if r.model.intercept else ""
    for (i, factor), zero in zip(r.terms, r.zeros, strict=True):
        counted = f"(W<{marks[i.name]}>{_signed(in_um(-zero))})" if zero else f"W<{marks[i.name]}>"
        text += f"{_signed(number(sign * factor))}*{counted}"
    return text


def write_vectors(reductions: Sequence[Reduced], marks: dict[str, str], tolerance: float = 0.01) -> str:
    """Return test vectors as CSV.

    Parameters
    ----------
    tolerance : float
        [um]
    """
    rows = [",".join(["axis", *(f"{m}_degC" for m in marks.values()), "growth_mm", "correction_um", "tolerance_um"])]
    for r in reductions:
        names = [i.name for i, _ in r.terms]
        for temperatures in vectors(r):
            said, known = r.deviation(temperatures), dict(zip(names, temperatures, strict=True))
            values = [f"{known[n]:g}" if n in known else "" for n in marks]
            rows.append(",".join([r.axis, *values, f"{said / 1e3:.7f}", f"{0.0 - said:.4f}", f"{tolerance:g}"]))
    return "\n".join(rows) + "\n"


def _signed(text: str) -> str:
    return text if text.startswith("-") else f"+{text}"


TARGET = Target(write=write_heidenhain, shape=SHAPES["heidenhain"], limited=False)
