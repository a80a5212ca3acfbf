"""Programs written beside the graphs: one runs the test vectors, one runs the graphs inside a compensator."""

TEST = '''"""Runs the graphs of {name} over {name}_vectors.json; exits with 0 if all is well: see {name}.md."""

import json
import sys
from pathlib import Path

import numpy as np
import onnxruntime

folder = Path(__file__).parent
vectors = json.loads((folder / "{name}_vectors.json").read_text(encoding="utf-8"))
wrong, largest, calls = 0, 0.0, 0
for file, model in vectors["graphs"].items():
    session = onnxruntime.InferenceSession(str(folder / file), providers=["CPUExecutionProvider"])
    if session.get_modelmeta().custom_metadata_map["sha256"] != vectors["sha256"]:
        sys.exit("the vectors are of another model")
    state = 0.0  # at the start
    for calls, call in enumerate(model["calls"], start=calls + 1):
        given = {{"zero": model["zero"], "state": state, **call}}
        ports = {{i.name: np.zeros(i.shape) + np.array(given[i.name], float) for i in session.get_inputs()}}
        [deviation], outside, *after = session.run(None, ports)
        state, wanted = after[0] if after else 0.0, float(call["deviation"])
        off = abs(deviation - wanted) / max(1.0, abs(wanted))
        largest = max(largest, off)  # without the calls that are rejected, whose deviation is NaN
        good = off <= model["tolerance"] and outside.tolist() == call["outside"]
        if not (good or np.isnan([deviation, wanted]).all()):
            wrong += 1
            print(f"{{file}}, call {{calls}}: {{deviation}}, outside {{outside.tolist()}}; want {{call}}")
print(f"{{calls}} calls, {{wrong}} wrong; largest difference {{largest:.1e}} of max(1, deviation)")
sys.exit(wrong > 0)
'''

RUN = '''# {verdict}
"""Runs the graphs of {name} inside a compensator: python {name}_run.py model.json < readings.csv

The compensator of thermocomp averages the zero, watches the sensors, rejects readings, applies the limits, holds and
fades. Without one around it, a graph must not drive an axis.
"""

import csv
import sys
from functools import cached_property
from hashlib import sha256
from pathlib import Path

import numpy as np
import onnxruntime
from thermocomp import Limits, Reading
from thermocomp.core.state import State
from thermocomp.files.machines import read_models
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.group import Group

MODEL = "{sha256}"  # SHA-256 of the model file
GRAPHS = {graphs}  # by target
LIMITS = {limits}
APPROVED = {approved}  # by target: who uses an unproven model, and why


class Graph(Group):
    """A model of the compensator, evaluated by its graph."""

    def __init__(self, models, k, file):
        super().__init__(models, [k])
        self.session = onnxruntime.InferenceSession(str(Path(__file__).with_name(file)))

    def step(self, states, values, dt):
        zero, memory, last, _ = states[0]
        known = 0.0 if memory is None else [1.0, last, *memory]
        given = {{"value": values, "zero": zero, "dt": dt, "state": known}}
        ports = {{i.name: np.zeros(i.shape) + given[i.name] for i in self.session.get_inputs()}}
        [deviation], outside, *after = self.session.run(None, ports)
        memory = after[0][2:] if after else np.zeros(0)
        state = State(zero, memory, np.array(deviation), outside)
        return [state], [float(deviation)], [float(self.lead.half_width(state, values))]


class GraphCompensator(Compensator):
    """A compensator whose models are graphs."""

    @cached_property
    def groups(self):
        files = [file for target in self.lines for file in GRAPHS[target]]
        return tuple(Graph(self.models, k, file) for k, file in enumerate(files))


def load(path):
    """Return the compensator of the model file."""
    if sha256(Path(path).read_bytes()).hexdigest() != MODEL:
        sys.exit(f"{{path}} is not the model from which the graphs were written")
    models = [m.taken(APPROVED.get(m.target)) for m in read_models(Path(path)) if m.target in GRAPHS]
    return GraphCompensator.of(models, LIMITS, watching=True)


if __name__ == "__main__":
    compensator = load(sys.argv[1])
    known = [*compensator.models, *compensator.watches]
    names = {{i.name for k in known for i in k.inputs}} | {{k.zeroing.speed for k in known}}
    state = compensator.start()
    for row in csv.DictReader(sys.stdin):  # the time [s], and a column for each input [degC, 1/min]
        time = float(row["time_s"])
        reading = Reading(time, {{name: float(row[name] or "nan") for name in names & row.keys()}})
        state, said = compensator.step(state, reading, now=time)
        corrections = ", ".join(f"{{t}} {{c.offset:.3f}} um, {{c.slope:.3f}} um/m" for t, c in said.corrections.items())
        print(f"{{time:g}} s: {{corrections}}", said.rejected and f"({{said.rejected}})")
'''
