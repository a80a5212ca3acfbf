"""All files of an export to C99: the code, its test, and the instructions."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from thermocomp.core.bounds import round_single
from thermocomp.core.exceptions import SettingError
from thermocomp.export.c99.c99 import identifier, translate
from thermocomp.export.c99.ctest import add_check, write_test
from thermocomp.export.facts import Facts
from thermocomp.export.pages import describe, explain
from thermocomp.export.recorded import find_readings
from thermocomp.export.target import Target
from thermocomp.export.vectors import Answers, FloatArray, Readings, find_tolerance, replay, round_all
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.program.tables import Tables, gather

_README = """{facts}

# {name}: thermal compensation in C99

`{name}.h` and `{name}.c` need only `math.h`: no memory allocation, no global variables. `{name}_test.c` calls them
{calls} times, with sensor faults among the inputs{recorded}, and compares the results with those of thermocomp; it also
adds up all tables and limits.

## Verify it

    cc -std=c99 {name}.c {name}_test.c -lm -o {name}_test && ./{name}_test

It prints the number of wrong calls (expected: 0), the largest difference, and the size of the state in bytes; its exit
code is 0 if all results agree. With `-g -fsanitize=address,undefined -fno-sanitize-recover` (gcc, clang) it also ends
at an index beyond an array. {single}. Compile all files of your program in the
same precision, otherwise they do not link. Never compile with `-ffast-math`.

## Run it

Call it cyclically, every ten seconds, with the time since the previous call, measured or fixed.
{each_call}

    #include "{name}.h"
    #include <math.h>                          /* NAN */

    static {name}_state state;                 /* zero at power-on */
    static {name}_saved saved;                 /* read it from non-volatile memory; zero: nothing was retained */
    static tc_real value[{inputs}];

    int main(void)
    {{
        double off = 0.0;                      /* seconds without power; 0: unknown */
        double age = 0.0, dt = 10.0;           /* seconds since the values were measured, since the previous call */

        {name}_power_up(&state, &saved, off);  /* on a machine that is cold for certain: {name}_cold(&state) */
        for (;;) {{                             /* every dt seconds */
            value[0] = NAN;                    /* fill value[] as below; NAN for a sensor without a reading */
            {name}_step(&state, value, age, dt);
            /* or, with readings that are numbered: {name}_step_counted(&state, value, age, dt, reading) */
            /* send state.correction[0] to the controller [um] */
            {name}_save(&state, &saved);       /* and write its bytes, every ten seconds or when the power fails */
        }}
    }}

{stopped}

| value | meaning | unit |
|---|---|---|
{values}

| correction | target | {line} |
|---|---|---|
{corrections}

{geometry}{zero} {status}{sensors}

## At power-up

{power}

`{name}_save` fills a struct without pointers: write its bytes to non-volatile memory, with the time.
`{name}_power_up` takes it back with the seconds since then, and returns 0 if it continues, 1 if the machine is cold by
that time, 2 if the reference is unknown. A damaged struct (CRC-32) or one of other models counts as none, as does NULL.
`{name}_cold(&state)` tells it cold; `{name}_rezero(&state, k, remaining)` re-zeroes a correction [um].

## Test the sign

{sign}

## Switch it off

Do not set the correction to zero in one step: the axis would jump. Instead, call `{name}_step` with an age of 1e9: the
correction is held for {hold:g} s and then decays slowly to zero. Do not use the controller's own temperature
compensation at the same time.
"""


#: loss of single precision [um] above which it is stated, and above which single precision is rejected
_STATED, _COARSE = 0.05, 0.5
#: largest tolerance of a test in single precision, as a fraction of the correction
_TOLERANCE = 1.0


def write_package(compensator: Compensator, name: str, facts: Facts, recording: Any = None) -> dict[str, bytes]:
    """Return all files of the export to C99, by name."""
    tables, said = gather(compensator), facts.lines(compensator)
    readings = find_readings(tables, recording)
    answers = replay(compensator, tables, readings)
    shifted = [replay(compensator, tables, readings.shifted(way)) for way in (1, -1)]
    # large coefficients amplify the last digit of a reading
    double = max(find_tolerance(tables.models), *(4.0 * _apart(answers, other) for other in shifted))
    single, loss = _single(compensator, tables, readings, answers)
    if loss > _STATED or not single:
        said.append(
            f"Single precision (-DTC_FLOAT) changes corrections by up to {loss:.2g} um"
            if single
            else f"Single precision (-DTC_FLOAT) does not compile: it is too coarse for this model ({loss:.2g} um)"
        )
    own = identifier(name)
    told = explain(
        compensator,
        tables,
        kept=f"{own}_power_up with the state from {own}_save and the time",
        cold=f"{own}_cold",
        off=f"{own}_step with an age of 1e9",
    )
    sources, total = add_check(translate(tables, name, said, told, double_only=not single))
    name = sources.name
    texts = {
        f"{name}.h": sources.header,
        f"{name}.c": sources.source,
        f"{name}_test.c": write_test(name, tables, readings, answers.certain(shifted), double, single, total),
        f"{name}.md": _README.format(
            facts="  \n".join(said),
            name=name,
            calls=len(readings.age),
            recorded=f", and readings of {recording.name}" if recording else "",
            single="For single precision add `-DTC_FLOAT`"
            if single
            else "Single precision (`-DTC_FLOAT`) is too coarse for this model, and does not compile",
            **describe(compensator, tables, "state."),
        ),
    }
    return {file: text.encode() for file, text in texts.items()}


def _single(compensator: Compensator, tables: Tables, readings: Readings, answers: Answers) -> tuple[float, float]:
    """Return the tolerance for single precision, ten times the effect of rounding all numbers, and the loss [um].

    Where a curve has steps, a reading close to a step may end up on its other side: therefore readings are also shifted
    to either side, by the effect of rounding on the difference of two readings. The tolerance is 0 if it or the loss is
    too large.
    """
    try:
        coarse = replace(compensator, models=round_all(compensator.models, round_single))
    except SettingError:  # a recurrence that is stable in double precision only
        return 0.0, math.inf

    def moved(way: int, rounded: Callable[[FloatArray], FloatArray] | None = None) -> tuple[float, float]:
        rows = readings._replace(values=round_single(readings.values)).shifted(way, np.float32)
        said = replay(coarse, tables, rows, rounded=rounded)
        if any((a != b).any() for a, b in ((answers.status, said.status), (answers.fault, said.fault))):
            return math.inf, math.inf
        return _apart(answers, said), _loss(tables, answers, said)

    (rounding, *shifts), losses = zip(moved(0, round_single), moved(1), moved(-1), strict=True)
    loss = max(losses)
    found = max(1e-5, 10.0 * rounding, *(2.0 * s for s in shifts))
    return found if found <= _TOLERANCE and loss <= _COARSE else 0.0, loss


def _loss(tables: Tables, one: Answers, other: Answers) -> float:
    """Return the largest difference of corrections at any position of the travel [um]."""
    low, high, place = (np.array(tables.values[k]) for k in ("travel_low", "travel_high", "position"))
    reach = np.maximum(np.abs(high - place), np.abs(low - place)) / 1000.0
    apart = np.abs(one.correction - other.correction) + reach * np.abs(one.slope - other.slope)
    return float(apart.max(initial=0.0))


def _apart(one: Answers, other: Answers) -> float:
    """Return the largest difference of corrections, as a fraction of the correction, or in um below 1 um."""
    pairs = (one.correction, other.correction), (one.slope, other.slope)
    return max(float((np.abs(a - b) / np.maximum(1.0, np.abs(a))).max(initial=0.0)) for a, b in pairs)


TARGET = Target(write=write_package, vectors=True)
