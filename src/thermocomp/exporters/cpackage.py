"""All files of an export to C99: the code, its test, and how to use it."""

import numpy as np

from thermocomp.exporters.block.tables import Tables, gather
from thermocomp.exporters.c99 import translate
from thermocomp.exporters.ctest import write_test
from thermocomp.exporters.facts import Facts
from thermocomp.exporters.vectors import Answers, Readings, make_readings, replay
from thermocomp.runtime.compensator import Compensator

_README = """{facts}

# {name}: thermal compensation in C99

`{name}.h` and `{name}.c` need nothing but `math.h`: no allocation, no globals. `{name}_test.c` runs them over {calls}
calls, faults among them, and compares with what thermocomp says.

## Prove it

    cc -std=c99 {name}.c {name}_test.c -lm -o {name}_test && ./{name}_test

It prints how many calls are wrong (none), the largest difference, and how many bytes the state takes; its exit code is
0 if all is well. For single precision add `-DTC_FLOAT`; for less memory `-DTC_ZERO_READINGS=60` (at least 2; the zero
may be known earlier then, and the test does not fit). Never compile with `-ffast-math`.

## Run it

Call it in a cycle, every second or ten, with the time since the call before, measured or fixed:

    #include "{name}.h"

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

{zero} `state.status[k]` says how a correction is: 0 starts, 1 active, 2 holding, 3 fading, 4 shadow; `state.rejected`
why a reading was not used: 0 it was, 1 its time, 2 a value missing or not plausible, 3 no start of a machine;
`state.outside` how many inputs are beyond the trained range.{sensors}

## Switch it off

Do not set the correction to zero at once: the axis would jump. Call `{name}_step` with an age of 1e9: it stays where
it is for {hold:g} s and then goes to zero, slowly. To begin anew: `{name}_start`, once the correction is zero. The
controller must not compensate for temperature itself at the same time.
"""


def write_package(compensator: Compensator, name: str, facts: Facts) -> dict[str, bytes]:
    """Return all files by their names.

    Parameters
    ----------
    compensator : Compensator
        Made by `Compensator.of`.
    name : str
    facts : Facts

    Raises
    ------
    InputError
        A model has no formula, or the models do not go together.
    """
    tables, said = gather(compensator), facts.lines(compensator)
    sources = translate(tables, name, said)
    readings = make_readings(tables)
    answers = replay(compensator, tables, readings)
    name = sources.name
    texts = {
        f"{name}.h": sources.header,
        f"{name}.c": sources.source,
        f"{name}_test.c": write_test(name, tables, readings, answers, _single(compensator, tables, readings, answers)),
        f"{name}.md": _readme(compensator, tables, name, said, len(readings.age)),
    }
    return {file: text.encode() for file, text in texts.items()}


def _single(compensator: Compensator, tables: Tables, readings: Readings, answers: Answers) -> float:
    """Return how far single precision may be off: a model whose terms cancel makes much of a rounded temperature."""
    with np.errstate(over="ignore"):  # what is that large is no reading
        rounded = readings._replace(values=readings.values.astype(np.float32).astype(np.float64))
    moved = np.abs(replay(compensator, tables, rounded).correction - answers.correction)
    return max(1e-5, 10.0 * float((moved / np.maximum(1.0, np.abs(answers.correction))).max(initial=0.0)))


def _readme(compensator: Compensator, tables: Tables, name: str, facts: list[str], calls: int) -> str:
    slopes = any(tables.values["to_slope"])
    zeroing = compensator.models[0].zeroing
    zero = (
        f"Temperatures count from the mean over the first {zeroing.otherwise:g} s, or over {zeroing.at_rest:g} s while "
        "the spindle stands; until then the correction stays where it is."
        if tables.sizes["has_zero"]
        else "Nothing counts from the start."
    )
    sensors = (
        "\n\nThe temperatures are watched: what is missing, stuck, off, stepped or swapped is replaced by what the "
        "others say, if the model was judged without it; otherwise the correction holds and fades. `state.fault[k]`, "
        f"of {', '.join(tables.sensors)}: 0 good, 1 missing, 2 stepped, 3 stuck, 4 off, 5 swapped."
        if tables.sensors
        else "\n\nThe temperatures are not watched: one that is not plausible stops the correction, a wrong one not."
    )
    positions = zip(tables.targets, tables.values["position"], strict=True)
    line = "add `slope[k]` [um/m] by the distance from" if slopes else "the same at every position"
    return _README.format(
        facts="  \n".join(facts),
        name=name,
        calls=calls,
        inputs=len(tables.channels),
        values="\n".join(f"| `value[{k}]` | {c.name} | {c.unit} |" for k, c in enumerate(tables.channels)),
        line=line,
        corrections="\n".join(
            f"| `correction[{k}]` [um] | {t} | {f'{p:g} mm' if slopes else ''} |" for k, (t, p) in enumerate(positions)
        ),
        zero=zero,
        sensors=sensors,
        hold=compensator.limits.hold,
    )
