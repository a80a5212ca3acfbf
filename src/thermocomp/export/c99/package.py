"""All files of an export to C99: the code, its test, and the instructions."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from thermocomp.core.bounds import round_single
from thermocomp.core.exceptions import SettingError
from thermocomp.export.c99.c99 import translate
from thermocomp.export.c99.ctest import write_test
from thermocomp.export.facts import Facts
from thermocomp.export.pages import describe
from thermocomp.export.target import Target
from thermocomp.export.vectors import Answers, FloatArray, Readings, find_tolerance, make_readings, replay, round_all
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.program.tables import Tables, gather

_README = """{facts}

# {name}: thermal compensation in C99

`{name}.h` and `{name}.c` need nothing but `math.h`: no allocation, no globals. `{name}_test.c` runs them over {calls}
calls, faults among them, and compares with what thermocomp says.

## Prove it

    cc -std=c99 {name}.c {name}_test.c -lm -o {name}_test && ./{name}_test

It prints how many calls are wrong (none), the largest difference, and how many bytes the state takes; its exit code is
0 if all is well. {single}. Compile all files of your program in the same precision:
otherwise it does not link. Never compile with `-ffast-math`.

## Run it

Call it in a cycle, every ten seconds, with the time since the call before, measured or fixed.

    #include "{name}.h"
    #include <math.h>                          /* NAN */

    static {name}_state state;                 /* zero at power-on */
    static tc_real value[{inputs}];

    {name}_start(&state);                      /* once */
    for (;;) {{                                 /* every dt seconds */
        /* fill value[] as below; NAN for a sensor that says nothing */
        {name}_step(&state, value, age, dt);   /* age: seconds since the values were measured */
        /* give state.correction[0] to the controller [um] */
    }}

| value | what it is | unit |
|---|---|---|
{values}

| correction | of | {line} |
|---|---|---|
{corrections}

{geometry}{zero} {status}{sensors}

## Try the sign

{sign}

## Switch it off

Do not set the correction to zero at once: the axis would jump. Call `{name}_step` with an age of 1e9: it stays where
it is for {hold:g} s and then goes to zero, slowly. To begin again: `{name}_start`, once the correction is zero. The
controller must not compensate for temperature itself at the same time.
"""


#: last digits by which the difference of two readings may be wrong
_DIGITS = 2.0
#: largest error of single precision as a fraction of the correction; above it, single precision is rejected
_COARSE = 1.0


def write_package(compensator: Compensator, name: str, facts: Facts) -> dict[str, bytes]:
    """Return all files by name."""
    tables, said = gather(compensator), facts.lines(compensator)
    readings = make_readings(tables)
    answers = replay(compensator, tables, readings)
    single = _single(compensator, tables, readings, answers)
    sources = translate(tables, name, said, double_only=not single)
    name = sources.name
    texts = {
        f"{name}.h": sources.header,
        f"{name}.c": sources.source,
        f"{name}_test.c": write_test(
            name, tables, readings, answers, _double(compensator, tables, readings, answers), single
        ),
        f"{name}.md": _README.format(
            facts="  \n".join(said),
            name=name,
            calls=len(readings.age),
            single="For single precision add `-DTC_FLOAT`"
            if single
            else "Single precision (`-DTC_FLOAT`) is too coarse for this model, and does not compile",
            **describe(compensator, tables, "state."),
        ),
    }
    return {file: text.encode() for file, text in texts.items()}


def _double(compensator: Compensator, tables: Tables, readings: Readings, answers: Answers) -> float:
    """Return the tolerance for double precision: large coefficients amplify the last digit of a reading."""
    rows = [readings._replace(values=_shifted(readings.values, way)) for way in (1, -1)]
    return max(find_tolerance(tables), *(4.0 * _apart(answers, replay(compensator, tables, r)) for r in rows))


def _single(compensator: Compensator, tables: Tables, readings: Readings, answers: Answers) -> float:
    """Return the tolerance for single precision: ten times the effect of rounding all numbers; 0 if too large.

    Where a curve has steps, a reading close to a step may end up on its other side: therefore readings are also shifted
    to either side, by the effect of rounding on the difference of two readings.
    """
    try:
        coarse = replace(compensator, models=round_all(compensator.models, round_single))
    except SettingError:  # a recurrence that is stable in double precision only
        return 0.0

    def moved(way: int, rounded: Callable[[FloatArray], FloatArray] | None = None) -> float:
        rows = readings._replace(values=_shifted(round_single(readings.values), way, np.float32))
        said = replay(coarse, tables, rows, rounded=rounded)
        if any((a != b).any() for a, b in ((answers.status, said.status), (answers.fault, said.fault))):
            return math.inf
        return _apart(answers, said)

    found = max(1e-5, 10.0 * moved(0, round_single), 2.0 * moved(1), 2.0 * moved(-1))
    return found if found <= _COARSE else 0.0


def _apart(one: Answers, other: Answers) -> float:
    """Return the largest difference of corrections, as a fraction of the correction, or in um below 1 um."""
    pairs = (one.correction, other.correction), (one.slope, other.slope)
    return max(float((np.abs(a - b) / np.maximum(1.0, np.abs(a))).max(initial=0.0)) for a, b in pairs)


def _shifted(values: FloatArray, way: int, kind: type[np.floating[Any]] = np.float64) -> FloatArray:
    """Return readings shifted by their last digits in a precision: odd up, even down, equal readings alike."""
    with np.errstate(invalid="ignore"):
        last = np.where(np.isfinite(values), np.spacing(values.astype(kind)).astype(np.float64), 0.0)
        odd = np.where(last != 0.0, values / np.where(last == 0.0, 1.0, last), 0.0) % 2.0 >= 1.0
    return values + way * _DIGITS * np.where(odd, last, -last)


TARGET = Target(write=write_package)
