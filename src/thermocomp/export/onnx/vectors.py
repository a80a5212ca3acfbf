"""Test vectors of one step with a given zero, and a program that runs them with onnxruntime."""

import json
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.zero import FIRST_READING
from thermocomp.export.vectors import Answers, Readings, find_tolerance, make_readings, replay
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.gate import CLOCK_SKEW
from thermocomp.runtime.program.tables import Tables

FloatArray = NDArray[np.float64]

#: minimum tolerance of a runtime, as a fraction of the correction, or in um for corrections below 1 um
_TOLERANCE = 1e-9

PROGRAM = '''"""Runs {name}.onnx over {name}_vectors.json; exits with 0 if all is well: {name}.md says how."""

import json
import sys
from pathlib import Path

import numpy as np
import onnxruntime

NUMBERS = ("correction", "slope")
folder = Path(__file__).parent
vectors = json.loads((folder / "{name}_vectors.json").read_text(encoding="utf-8"))
session = onnxruntime.InferenceSession(str(folder / "{name}.onnx"), providers=["CPUExecutionProvider"])
if session.get_modelmeta().custom_metadata_map["sha256"] != vectors["sha256"]:
    sys.exit("the vectors are of another model")


def array(numbers):
    return np.array([float(x) for x in numbers])


zero = array(vectors["zero"])
state = np.zeros(vectors["state"])
wrong, largest = 0, 0.0
for k, call in enumerate(vectors["calls"]):
    given = {{"value": array(call["value"]), "zero": zero, "dt": array([call["dt"]]), "state": state}}
    *said, status, state = session.run(("correction", "slope", "status", "next_state"), given)
    off = 0.0
    for found, want in zip(said, (array(call[name]) for name in NUMBERS)):
        apart = np.abs(found - want) / np.maximum(1.0, np.abs(want))
        off = max(off, float(np.where(np.isnan(apart), np.inf, apart).max()))
    largest = max(largest, off)
    if off > vectors["tolerance"] or status.tolist() != call["status"]:
        wrong += 1
        if wrong <= 10:
            print(f"call {{k}}: {{[x.tolist() for x in said]}}, status {{status.tolist()}}; want {{call}}")
print(
    f"{{k + 1}} calls, {{wrong}} wrong; largest difference {{largest:.1e}} of max(1 um, correction), "
    f"allowed {{vectors['tolerance']:.0e}}"
)
sys.exit(wrong > 0)
'''


def without_watch(compensator: Compensator) -> Compensator:
    """Return a compensator as represented in a graph: without a watch over its sensors, and with a given zero."""
    models = tuple(replace(m, watch=None, zeroing=FIRST_READING) for m in compensator.models)
    return replace(compensator, models=models)


def pick_zero(tables: Tables) -> FloatArray:
    """Return a zero for test vectors, per channel: close to the training zero but different."""
    return np.array([c.reference + 0.25 * c.rezero for c in tables.channels])


def pick_readings(tables: Tables) -> Readings:
    """Return readings for test vectors; outdated readings are marked as missing, as required of the caller."""
    readings, age = make_readings(tables), tables.values["reading_age"]
    timely = (readings.age >= -CLOCK_SKEW) & (readings.age <= age)
    values = np.where(timely[:, None], readings.values, np.nan)
    # a long gap before values that require a large move: the time available is limited to the reading age
    wide = np.array([[c.reference + c.low + share * (c.high - c.low) for c in tables.channels] for share in (0.9, 0.1)])
    return Readings(
        np.concatenate([values, wide, wide]),
        np.zeros(len(values) + 4),
        np.concatenate([readings.dt, [1.5 * age, 1.5 * age, 3600.0, 1.5 * age]]),
    )


def answer(compensator: Compensator, tables: Tables, readings: Readings, zero: FloatArray) -> Answers:
    """Return the outputs of a compensator for readings, with the zero known from the start.

    Parameters
    ----------
    zero : ndarray of shape (n_channels,)
    """
    place = {c.name: k for k, c in enumerate(tables.channels)}
    states = [m.init([zero[place[i.name]] if i.rezero else i.reference for i in m.inputs]) for m in compensator.models]
    return replay(compensator, tables, readings, compensator.share(states, compensator.start()))


def write_vectors(
    tables: Tables, readings: Readings, answers: Answers, zero: FloatArray, facts: Sequence[str], sha256: str, size: int
) -> str:
    """Return test vectors as JSON; NaN and infinity are strings that Python's `float` accepts.

    Parameters
    ----------
    zero : ndarray of shape (n_channels,)
    """
    head = {
        "facts": list(facts),
        "sha256": sha256,
        "tolerance": max(_TOLERANCE, find_tolerance(tables)),
        "state": size,
        "inputs": [f"{c.name} [{c.unit}]" for c in tables.channels],
        "targets": list(tables.targets),
        "zero": _numbers(zero),
    }
    calls = [
        {
            "value": _numbers(readings.values[k]),
            "dt": _numbers(readings.dt[k : k + 1])[0],
            "correction": _numbers(answers.correction[k]),
            "slope": _numbers(answers.slope[k]),
            "status": answers.status[k].tolist(),
        }
        for k in range(len(readings.dt))
    ]
    lines = [json.dumps(call, allow_nan=False) for call in calls]
    text = json.dumps(head, indent=1, ensure_ascii=False, allow_nan=False).removesuffix("\n}")
    return text + ',\n "calls": [\n  ' + ",\n  ".join(lines) + "\n ]\n}\n"


def _numbers(row: FloatArray) -> list[float | str]:
    return [x if math.isfinite(x) else str(x) for x in row.tolist()]
