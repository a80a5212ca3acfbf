"""The C code of a compensator, compiled by a real compiler and run in this process."""

import ctypes
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.reading import Reading
from thermocomp.exporters.block.tables import gather
from thermocomp.exporters.c99 import translate
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.watch import WORDS

FloatArray = NDArray[np.float64]
FLAGS = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O2")
SANITIZED = ("-fsanitize=undefined", "-fno-sanitize-recover")
COMPILERS = [c for c in ("gcc", "clang") if shutil.which(c)]
STATUS = ("restarting", "active", "holding", "fading", "shadow")

_DRIVER = """
#include "{name}.h"
#include <stdlib.h>

void *begin(void) {{ {name}_state *s = malloc(sizeof *s); {name}_start(s); return s; }}

void run(void *at, int n, const tc_real *values, const double *age, const double *dt, double *said, int *told)
{{
    {name}_state *s = at;
    int k, j;

    for (k = 0; k < n; k++) {{
        {name}_step(s, values + k * {n}, age[k], dt[k]);
        for (j = 0; j < {targets}; j++) {{
            *said++ = s->correction[j];
            *said++ = {slope};
            *told++ = s->status[j];
        }}
        for (j = 0; j < {models}; j++) {{
            *said++ = s->deviation[j];
        }}
        for (j = 0; j < {sensors}; j++) {{
            *told++ = s->fault[j];
        }}
        *told++ = s->rejected;
        *told++ = s->outside;
    }}
}}
"""


class Ran(NamedTuple):
    """What a block, or the compensator itself, said of each row."""

    correction: FloatArray  #: (n_rows, n_targets), at the reference position
    slope: FloatArray
    status: FloatArray  #: by `STATUS`
    deviation: FloatArray  #: of the models, (n_rows, n_models); of the compensator nan where a target is not driven
    fault: FloatArray  #: (n_rows, n_sensors)
    passed: NDArray[np.bool_]


class CompiledBlock:
    """A compensator in C.

    Parameters
    ----------
    compensator : Compensator
    folder : Path
    compiler : str
    flags : sequence of str
    """

    def __init__(
        self, compensator: Compensator, folder: Path, compiler: str = COMPILERS[0], flags: Sequence[str] = SANITIZED
    ) -> None:
        self.tables = gather(compensator)
        sources, t = translate(self.tables, "block"), self.tables
        (folder / f"{sources.name}.h").write_text(sources.header, encoding="ascii")
        (folder / f"{sources.name}.c").write_text(sources.source, encoding="ascii")
        counts = (len(t.channels), len(t.targets), len(t.models), len(t.sensors))
        self._shape, self._real = counts, np.float32 if "-DTC_FLOAT" in flags else np.float64
        text = _DRIVER.format(
            name=sources.name,
            n=counts[0],
            targets=counts[1],
            models=counts[2],
            sensors=counts[3],
            slope="s->slope[j]",
        )
        (folder / "driver.c").write_text(text, encoding="ascii")
        library = folder / "block.so"
        for code in (sources.name, "driver"):
            strict = FLAGS if code == sources.name else ("-O2",)
            command = [compiler, *strict, *flags, "-fPIC", "-c", f"{code}.c", "-o", f"{code}.o"]
            subprocess.run(command, check=True, cwd=folder)
        objects = [f"{sources.name}.o", "driver.o"]
        subprocess.run([compiler, *flags, "-shared", *objects, "-o", str(library), "-lm"], check=True, cwd=folder)
        self._library = ctypes.CDLL(str(library))
        self._library.begin.restype = ctypes.c_void_p

    def run(self, values: FloatArray, age: FloatArray, dt: FloatArray) -> Ran:
        """Run it from the start; `values` (n_rows, n_channels) in the order of the tables' channels."""
        _, targets, models, sensors = self._shape
        n = len(values)
        said, told = np.empty((n, 2 * targets + models)), np.empty((n, targets + sensors + 2), dtype=np.int32)
        given = np.ascontiguousarray(values, dtype=self._real)
        pointers: list[Any] = [
            ctypes.c_void_p(a.ctypes.data)
            for a in (given, np.ascontiguousarray(age, float), np.ascontiguousarray(dt, float), said, told)
        ]
        self._library.run(ctypes.c_void_p(self._library.begin()), n, *pointers)
        return Ran(
            said[:, 0 : 2 * targets : 2],
            said[:, 1 : 2 * targets : 2],
            told[:, :targets].astype(float),
            said[:, 2 * targets :],
            told[:, targets : targets + sensors].astype(float),
            told[:, -2] == 0,
        )


def run_compensator(compensator: Compensator, values: FloatArray, age: FloatArray, dt: FloatArray) -> Ran:
    """Return what the compensator itself says of the same rows."""
    tables = gather(compensator)
    names, targets = [c.name for c in tables.channels], tables.targets
    state, clock, begun = compensator.start(), 0.0, False
    rows = []
    for row, old, passed in zip(values.tolist(), age.tolist(), dt.tolist(), strict=True):
        good = 0.0 <= passed <= 1e10
        clock, begun = clock + passed if good and begun else clock, begun or good
        tick = clock if good else np.nan
        state, said = compensator.step(state, Reading(tick - old, dict(zip(names, row, strict=True))), tick, None, tick)
        rows.append(
            (
                [said.corrections[t].offset for t in targets],
                [said.corrections[t].slope for t in targets],
                [STATUS.index(said.states[t].word) for t in targets],
                [float(s.deviation) for s in state.models],
                [WORDS.index(said.failed.get(s, "good")) for s in tables.sensors],
                not said.rejected,
            )
        )
    columns = [np.array([r[k] for r in rows], dtype=np.float64) for k in range(5)]
    return Ran(*columns, np.array([r[5] for r in rows], dtype=np.bool_))
