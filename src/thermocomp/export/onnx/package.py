"""All files of an export to ONNX: the graph, its test vectors with a program that runs them, and the instructions."""

from thermocomp.core.exceptions import InputError
from thermocomp.export.c99.c99 import identifier
from thermocomp.export.facts import Facts
from thermocomp.export.onnx.graph import GraphBlock, translate
from thermocomp.export.onnx.nodes import IR, OPSET, serialize
from thermocomp.export.onnx.vectors import PROGRAM, answer, pick_readings, pick_zero, without_watch, write_vectors
from thermocomp.export.target import Target
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.gate import DAY
from thermocomp.runtime.program.tables import Tables, gather

#: stated with the facts in all files
NOT_INSIDE = (
    "Not inside: averaging of the zero, the age of a reading, the watch over the sensors with what stands in for one "
    "that failed, probings"
)

_README = """{facts}

# {name}: thermal compensation as ONNX

`{name}.onnx` is one step: ONNX {opset}, double precision, standard operators alone. `{name}_test.py` runs it over the
{calls} calls of `{name}_vectors.json`, faults among them, and compares with what thermocomp says.

## Prove it

    pip install onnxruntime
    python {name}_test.py

It prints how many calls are wrong (none) and the largest difference; its exit code is 0 if all is well. Run the same
vectors in the runtime of the controller: texts such as "nan" stand there for what is not a number.

## Run it

Call it in a cycle, every second or ten, with the time since the call before:

    import numpy as np
    import onnxruntime

    session = onnxruntime.InferenceSession("{name}.onnx")
    state = np.zeros({state})  # at power-on
    while True:  # every dt seconds
        given = {{"value": value, "zero": zero, "dt": np.array([dt]), "state": state}}
        correction, slope, status, state = session.run(
            ["correction", "slope", "status", "next_state"], given)

| input | numbers | what it is |
|---|---|---|
| `value` | {inputs} | readings, in the order below; NaN for one that is missing or older than {age:g} s |
| `zero` | {inputs} | what each of them counts from; see below |
| `dt` | 1 | seconds since the call before |
| `state` | {state} | `next_state` of the call before; zeros at power-on |

| `value` | what it is | unit | `zero` | plausible |
|---|---|---|---|---|
{values}

{zero}

| `correction` | of | `slope` |
|---|---|---|
{corrections}

`status` per target: 1 active, 2 holding, 3 fading, 4 shadow. Give `correction` [um] to the controller{line}.

A value that is missing, no number or not plausible stops all corrections: they stay for {hold:g} s and then go to
zero, slowly; the models continue with the next values that are all good, over that time. A `dt` that is negative,
no number or above 1e10 moves nothing, and so does one of 0. A state that is damaged counts as that of a start.

## What is not inside

- The zero is not averaged here: what it is, comes in.
- No age of a reading: what is too old is yours to give as NaN.
- Sensors are not watched: one that is not plausible stops the corrections, one that is wrong within the plausible range
  is believed, and nothing stands in for either. `thermocomp export --to c99` has all of this inside.
- Nothing is learned from probings. Of a model that ticks at an interval, at most 100,000 ticks are made at once (17
  days at 15 s); what a longer gap would bring beyond is left out.

## Switch it off

Do not set the correction to zero at once: the axis would jump. Call it with a `value` of NaN instead: it stays where
it is for {hold:g} s and then goes to zero. To begin again: a `state` of zeros, once the correction is zero. The
controller must not compensate for temperature itself at the same time.
"""


def write_package(compensator: Compensator, name: str, facts: Facts) -> dict[str, bytes]:
    """Return all files by name."""
    if len({m.zeroing for m in compensator.models}) > 1:
        raise InputError(
            "the models have different averaging times of the zero (reference reading): export each model file "
            "separately"
        )
    inside, name = without_watch(compensator), identifier(name)
    said = [*facts.lines(compensator), NOT_INSIDE]
    tables = gather(inside)
    block, readings, zero = translate(tables), pick_readings(tables), pick_zero(tables)
    answers = answer(inside, tables, readings, zero)
    return {
        f"{name}.onnx": serialize(block.graph, name, said, _properties(tables, said, facts), facts.version),
        f"{name}_vectors.json": write_vectors(tables, readings, answers, zero, said, facts.sha256, block.size).encode(),
        f"{name}_test.py": PROGRAM.format(name=name).encode(),
        f"{name}.md": _readme(compensator, tables, name, said, block, len(readings.dt)).encode(),
    }


def _properties(tables: Tables, said: list[str], facts: Facts) -> dict[str, str]:
    """Return the metadata of the file."""
    named = dict(line.split(": ", 1) for line in said[1:] if line.startswith(("Limits: ", "Sign: ", "Units: ", "Not ")))
    return {
        "verdict": said[0],
        "model": facts.source,
        "sha256": facts.sha256,
        "version": facts.version,
        "date": facts.date,
        **{key.lower().replace(" ", "_"): text for key, text in named.items()},
        "value": ", ".join(f"{c.name} [{c.unit}]" for c in tables.channels),
        "correction": ", ".join(f"{t} [um]" for t in tables.targets),
        "facts": "\n".join(said),
    }


def _readme(compensator: Compensator, tables: Tables, name: str, said: list[str], block: GraphBlock, calls: int) -> str:
    """Return the page of instructions."""
    slopes, zeroing = any(tables.values["to_slope"]), compensator.models[0].zeroing
    counted = sorted({r.name for r in tables.ranges if r.rezero})
    zero = (
        f"Where `zero` is `mean`, it is the mean of that value over the first {zeroing.otherwise:g} s, or over "
        f"{zeroing.at_rest:g} s while the spindle is stopped, without outliers, and stays until the power is off. "
        f"Until it is known, give NaN: nothing moves. Take none where the temperatures together are more than {DAY:g} "
        "degC from the numbers in brackets, those of the training, or one of them is far off the others: that is no "
        "machine at its start."
        if counted
        else "No value counts from the start: `zero` is not used."
    )
    positions = zip(tables.targets, tables.values["position"], strict=True)
    return _README.format(
        facts="  \n".join(said),
        name=name,
        opset=f"opset {OPSET}, IR version {IR}",
        calls=calls,
        state=block.size,
        inputs=len(tables.channels),
        age=compensator.limits.reading_age,
        values="\n".join(_rows(tables)),
        zero=zero,
        corrections="\n".join(
            f"| `correction[{k}]` [um] | {t} | {f'by the distance from {p:g} mm' if slopes else 'none'} |"
            for k, (t, p) in enumerate(positions)
        ),
        line=", and `slope` [um/m] by the distance" if slopes else "; it is the same at every position",
        hold=compensator.limits.hold,
    )


def _rows(tables: Tables) -> list[str]:
    """Return a table row with the meaning of each value."""
    rows, t = list[str](), tables.values
    for k, c in enumerate(tables.channels):
        of = [r for r in range(len(tables.ranges)) if t["channel"][r] == k]
        zero = f"mean ({c.reference:g})" if any(t["rezero"][r] for r in of) else "not used"
        plausible = "; ".join(dict.fromkeys(_plausible(tables, r) for r in of))
        rows.append(f"| `value[{k}]` | {c.name} | {c.unit} | {zero} | {plausible} |")
    return rows


def _plausible(tables: Tables, r: int) -> str:
    """Return the range in which a value is used."""
    t = tables.values
    least, most, low, high = t["least"][r], t["most"][r], t["low"][r] - t["room"][r], t["high"][r] + t["room"][r]
    if not t["applies"][r]:
        return f"{least:g} to {most:g}"
    if not t["rezero"][r]:
        return f"{max(least, t['reference'][r] + low):g} to {min(most, t['reference'][r] + high):g}"
    about = f"zero {low:+g} to zero {high:+g}"
    return f"{about}, within {least:g} to {most:g}" if t["temperature"][r] else about


TARGET = Target(write=write_package)
