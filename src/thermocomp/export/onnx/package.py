"""All files of an export to ONNX: a graph per model, test vectors, two programs, and the instructions."""

import json
import re

from thermocomp.core.model import ErrorModel
from thermocomp.export.c99.c99 import identifier
from thermocomp.export.facts import Facts
from thermocomp.export.onnx.graph import tell_zeros, translate
from thermocomp.export.onnx.nodes import IR, OPSET
from thermocomp.export.onnx.programs import RUN, TEST
from thermocomp.export.onnx.vectors import write_vectors
from thermocomp.export.target import Target
from thermocomp.runtime.compensator import Compensator

#: stated with the facts in all files
NOT_INSIDE = (
    "Not inside: averaging of the zero, gate, watch over the sensors, limits, hold and fade in time; without a "
    "compensator around it, a graph must not drive an axis"
)

_README = """{facts}

# {name}: error models as ONNX

Each graph is one model: opset {opset} (the lowest that has all its operators in this form), IR version {ir}, double
precision, standard operators only. It subtracts the
zero from the readings, clips the changes to the trained range with its margin, evaluates the model, and applies its
behaviour outside the trained range (`clip`, `hold` or `fade`).

**A graph is not a compensator.** A sensor that fails, or a zero taken on a warm machine, changes its output at once and
without limit. Without a compensator around it (zero, gate, limits), it must not drive an axis.

## Verify it

    pip install onnxruntime
    python {name}_test.py

It runs the graphs over `{name}_vectors.json`, compares with `ErrorModel.step`, and exits with 0 if all agree. Run the
same vectors in the runtime of the controller; "nan" there is not a number.

## Run it inside a compensator

    pip install thermocomp onnxruntime
    python {name}_run.py {model} < readings.csv

prints the corrections, within {limits}, for a file with a column `time_s` and one per input. For a program of your
own, `load` in it returns the compensator. It works like `thermocomp serve`, with zero, gate, watch, limits, hold and
fade; `thermocomp export --to c99` writes all of this in C.

## Call a graph

| graph | `deviation` of | `value` | trained change, with margin | `zero` |
|---|---|---|---|---|
{inputs}

| input | meaning |
|---|---|
| `value` | readings, in the order above |
| `zero` | zero (reference value) of each reading; not used where the table has a number |
| `dt` | time since the previous accepted call [s]; only if the model has a memory |
| `state` | `next_state` of that call, zeros at the start; only if the model has a memory, or holds |

`deviation` is actual minus commanded; the correction is its negative. `outside` marks the inputs outside the trained
range. If a value is not finite, or `dt` is negative, `deviation` is NaN and the state does not change. The state
consists of a flag (1 after the first reading), the last deviation, and the memory. A model with a fixed interval makes
at most 100,000 ticks in a call (17 days at 15 s).

The metadata contain the verdict, `target`, `unit`, `inputs` (their names as a JSON list, in the order of `value`),
`zeros`, model, version, limits and sign; inputs and outputs have descriptions.{axes}
"""

_AXES = """

An error along an axis is the sum of its graphs, one in um/m multiplied by the distance from the reference position [m],
one in um/m^2 by its square. Reference positions: {positions}.
"""


def write_package(compensator: Compensator, name: str, facts: Facts) -> dict[str, bytes]:
    """Return all files by name."""
    name, said = identifier(name), [*facts.lines(compensator), NOT_INSIDE]
    files, vectors, rows = dict[str, bytes](), dict[str, object](), list[str]()
    graphs, approved = dict[str, list[str]](), dict[str, str]()
    for target, line in compensator.lines.items():
        models, graphs[target] = compensator.models[line.models], list[str]()
        alone = Compensator(models, {target: line._replace(models=slice(0, None))}, compensator.limits, watching=True)
        own = [*facts.lines(alone), NOT_INSIDE]
        taken = [m.honest_error.taken for m in models if m.honest_error and m.honest_error.taken]
        if taken and target not in compensator.shadow:
            approved[target] = taken[0]
        for k, model in enumerate(models, start=1):
            stem = re.sub(r"\W+", "_", f"{name}_{target}_{k}" if len(models) > 1 else f"{name}_{target}")
            while (file := f"{stem}.onnx") in files:
                stem += "_"
            files[file] = translate(model).serialize(stem, own, _properties(model, own, facts), facts.version)
            vectors[file] = write_vectors(model)
            rows += _rows(model, file)
            graphs[target].append(file)
    readme = _README.format(
        facts="  \n".join(said),
        name=name,
        opset=OPSET,
        ir=IR,
        model=facts.source,
        limits=f"{compensator.limits.magnitude:g} um and {compensator.limits.rate:g} um/s",
        inputs="\n".join(rows),
        axes=_axes(compensator),
    )
    run = RUN.format(
        verdict=said[0],
        name=name,
        sha256=facts.sha256,
        graphs=graphs,
        limits=compensator.limits,
        approved=approved,
    )
    tests = json.dumps({"facts": said, "sha256": facts.sha256, "graphs": vectors}, ensure_ascii=False, allow_nan=False)
    return files | {
        f"{name}_vectors.json": tests.replace(', {"value"', ',\n{"value"').encode(),  # a call per line
        f"{name}_test.py": TEST.format(name=name).encode(),
        f"{name}_run.py": run.encode(),
        f"{name}.md": readme.encode(),
    }


def _properties(model: ErrorModel, said: list[str], facts: Facts) -> dict[str, str]:
    """Return the metadata of the file of a model."""
    named = dict(line.split(": ", 1) for line in said[1:] if line.startswith(("Limits: ", "Sign: ", "Units: ", "Not ")))
    return {
        "verdict": said[0],
        "model": facts.source,
        "sha256": facts.sha256,
        "version": facts.version,
        "date": facts.date,
        **{key.lower().replace(" ", "_"): text for key, text in named.items()},
        "target": model.target,
        "unit": model.unit,
        "inputs": json.dumps([i.name for i in model.inputs], ensure_ascii=False),
        "zeros": tell_zeros(model),
        "value": ", ".join(f"{i.name} [{i.unit}]" for i in model.inputs),
        "deviation": f"{model.target} [{model.unit}]",
        "facts": "\n".join(said),
    }


def _rows(model: ErrorModel, file: str) -> list[str]:
    """Return a table row per input of a graph."""
    zeroing, rows = model.zeroing, list[str]()
    mean = f"mean over the first {zeroing.otherwise:g} s, over {zeroing.at_rest:g} s while the spindle is stopped"
    for k, (i, low, high) in enumerate(zip(model.inputs, *model.bounds[:2], strict=True)):
        said, zero = f"{model.target} [{model.unit}]", mean if i.rezero else f"{i.reference:g}"
        rows.append(f"| `{file}` | {said} | `value[{k}]`: {i.name} [{i.unit}] | {low:g} to {high:g} | {zero} |")
    return rows


def _axes(compensator: Compensator) -> str:
    """Return how the graphs of an error along an axis belong together."""
    lines = {t: line for t, line in compensator.lines.items() if line.travel[0] < line.travel[1]}
    zeros = {t: line.deviation([0.0] * len(compensator.models[line.models])) for t, line in lines.items()}
    positions = ", ".join(f"{t} {zero.reference_position:g} mm" for t, zero in zeros.items())
    return _AXES.format(positions=positions) if lines else ""


TARGET = Target(write=write_package)
