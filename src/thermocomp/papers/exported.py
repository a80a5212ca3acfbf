"""The exported C of a model in a loop, as on the DSP of the papers: readings in, prediction and correction out."""

import shutil
import subprocess
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from thermocomp.core.model import ErrorModel
from thermocomp.export.c99.c99 import translate
from thermocomp.export.vectors import Readings, replay
from thermocomp.papers.study import FloatArray
from thermocomp.recordings.samples import Samples
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.program.tables import Tables, gather

_LOOP = """/* a line with a time step [s] and values in; a line with correction and deviation [um] of each target out */
#include "{name}.h"

#include <stdio.h>

int main(void)
{{
    static {name}_state s;
    tc_real value[{inputs}];
    double dt, x;
    int k;

    {name}_start(&s);
    {name}_cold(&s);
    while (scanf("%lf", &dt) == 1) {{
        for (k = 0; k < {inputs} && scanf("%lf", &x) == 1; k++) {{
            value[k] = (tc_real)x;
        }}
        {name}_step(&s, value, 0.0, dt);
        for (k = 0; k < {targets}; k++) {{
            printf("%.17g %.17g ", (double)s.correction[k], (double)s.deviation[k]);
        }}
        printf("\\n");
        fflush(stdout);
    }}
    return 0;
}}
"""


def write_loop(compensator: Compensator, folder: Path) -> list[str]:
    """Write the exported C of a compensator with one model per target, and a program that runs it (T-09, C-38).

    Returns
    -------
    list of str
        Names of the files to compile.
    """
    tables = gather(compensator)
    sources = translate(tables, "loop")
    program = _LOOP.format(name=sources.name, inputs=len(tables.channels), targets=len(tables.targets))
    for name, text in ((f"{sources.name}.h", sources.header), ("block.c", sources.source), ("loop.c", program)):
        (folder / name).write_text(text, encoding="utf-8")
    return ["block.c", "loop.c", "-lm"]


def as_line(dt: float, values: Iterable[float]) -> str:
    """Return a reading as a line of input; `dt` is the time since the previous one [s]."""
    return " ".join(map(repr, map(float, (dt, *values)))) + "\n"


def run_loop(program: Sequence[str], folder: Path, readings: Readings) -> tuple[FloatArray, FloatArray]:
    """Run a compiled program over readings, from its start.

    Parameters
    ----------
    program : sequence of str
        Command that starts it.

    Returns
    -------
    corrections, deviations : ndarray of shape (n_readings, n_targets)
        [um]
    """
    lines = "".join(map(as_line, readings.dt, readings.values))
    done = subprocess.run(program, input=lines, cwd=folder, capture_output=True, text=True, check=True, timeout=60)
    said = np.array([line.split() for line in done.stdout.splitlines()], dtype=np.float64)
    return said[:, ::2], said[:, 1::2]


def take_readings(tables: Tables, samples: Samples) -> Readings:
    """Return the rows of one test as readings of a program."""
    names = [c.name for c in samples.inputs]
    values = samples.values[:, [names.index(c.name) for c in tables.channels]]
    return Readings(values, np.zeros(len(values)), np.diff(samples.time, prepend=samples.time[:1]))


def predict_exported(model: ErrorModel, samples: Samples) -> tuple[FloatArray, str]:
    """Return the deviation that the exported program of a model predicts over a test, and what ran it.

    It is the C code, compiled by the C compiler of this computer; without one, the compensator in Python, from which
    the code is checked. The program predicts and does not correct, as in the on-line test of stepwise2017, so it needs
    no verdict.

    Parameters
    ----------
    samples : Samples
        One test, with the inputs of the model.

    Returns
    -------
    ndarray of shape (n_rows,)
        [um]
    str
    """
    compensator = Compensator.of([model], watching=True)
    tables = gather(compensator)
    readings = take_readings(tables, samples)
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        return replay(compensator, tables, readings).deviation[:, 0], "its Python twin"
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        subprocess.run([compiler, "-std=c99", *write_loop(compensator, folder), "-o", "loop"], cwd=folder, check=True)
        _, deviations = run_loop([str(folder / "loop")], folder, readings)
    return deviations[:, 0], f"the C code ({Path(compiler).name})"
