"""The C code of a compensator, compiled by a real compiler and run in this process."""

import ctypes
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from thermocomp.export.c99.c99 import translate
from thermocomp.export.vectors import Answers, Readings, replay
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.program.tables import gather

FloatArray = NDArray[np.float64]

FLAGS = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic")
#: what a program must not do ends it; compiled four times as fast as with optimisation
SANITIZED = ("-fsanitize=undefined", "-fno-sanitize-recover")
OPTIMISED = ("-O2",)
COMPILERS = [c for c in ("gcc", "clang") if shutil.which(c)]
#: where any will do: clang takes half the time of gcc with checks, and a third without
QUICK = COMPILERS[-1] if COMPILERS else ""

_DRIVER = """
#include "{name}.c"
#include <stdlib.h>

void *begin(void) {{ {name}_state *s = malloc(sizeof *s); {name}_start(s); return s; }}
void end(void *s) {{ free(s); }}

void happen({name}_state *s, int event, double amount)
{{
    {name}_saved saved;

    if (event == 1 || event == 2) {{
        {name}_save(s, &saved);
        saved.state.correction[0] += event == 2;
        {name}_power_up(s, &saved, amount);
    }} else if (event == 3) {{
        {name}_cold(s);
    }} else if (event > 3) {{
        {name}_rezero(s, event - 4, amount);
    }}
}}

void run(void *at, int n, const tc_real *values, const double *age, const double *dt, const double *counter,
         const double *event, const double *amount, double *said, int *told)
{{
    {name}_state *s = at;
    int k, j;

    for (k = 0; k < n; k++) {{
        happen(s, (int)event[k], amount[k]);
        {name}_step_counted(s, values + k * {n}, age[k], dt[k], counter[k]);
        for (j = 0; j < {targets}; j++) {{
            *said++ = s->correction[j];
            *said++ = s->slope[j];
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
        *told++ = s->warm;
    }}
}}
"""


@lru_cache(maxsize=8)
def compiled(files: tuple[tuple[str, str], ...], name: str, compiler: str, flags: tuple[str, ...]) -> ctypes.CDLL:
    """Compile sources, by name and text, into a library that is loaded; the same ones once for several tables."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        for file, text in files:
            (folder / file).write_text(text, encoding="utf-8")
        command = [compiler, *FLAGS, *flags, "-fPIC", "-shared", "driver.c", "-o", "block.so", "-lm"]
        subprocess.run(command, check=True, cwd=folder)
        return ctypes.CDLL(str(folder / "block.so"))


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
        self, compensator: Compensator, folder: Path, compiler: str = QUICK, flags: Sequence[str] = SANITIZED
    ) -> None:
        self.tables = gather(compensator)
        sources, t = translate(self.tables, "block"), self.tables
        (folder / f"{sources.name}.h").write_text(sources.header, encoding="utf-8")
        (folder / f"{sources.name}.c").write_text(sources.source, encoding="utf-8")
        counts = (len(t.channels), len(t.targets), len(t.models), len(t.sensors))
        self._shape, self._real = counts, np.float32 if "-DTC_FLOAT" in flags else np.float64
        text = _DRIVER.format(
            name=sources.name,
            n=counts[0],
            targets=counts[1],
            models=counts[2],
            sensors=counts[3],
        )
        if compiler == "clang":  # its run-time library is for programs alone
            flags = ["-fsanitize-trap=undefined" if f == "-fno-sanitize-recover" else f for f in flags]
        files = tuple((f.name, f.read_text(encoding="utf-8")) for f in sorted(folder.glob(f"{sources.name}.[ch]")))
        self._library = compiled((*files, ("driver.c", text)), sources.name, compiler, tuple(flags))
        self._library.begin.restype = ctypes.c_void_p

    def run(self, readings: Readings) -> Answers:
        """Run it from the start."""
        _, targets, models, sensors = self._shape
        n = len(readings.age)
        said, told = np.empty((n, 2 * targets + models)), np.empty((n, targets + sensors + 3), dtype=np.int32)
        given = np.ascontiguousarray(readings.values, dtype=self._real)
        orders = [np.ascontiguousarray(a) for a in readings.columns[:, -5:].T]
        pointers = [ctypes.c_void_p(a.ctypes.data) for a in (given, *orders, said, told)]
        state = ctypes.c_void_p(self._library.begin())
        self._library.run(state, n, *pointers)
        self._library.end(state)
        return Answers(
            said[:, 0 : 2 * targets : 2],
            said[:, 1 : 2 * targets : 2],
            told[:, :targets].astype(int),
            said[:, 2 * targets :],
            told[:, targets : targets + sensors].astype(int),
            told[:, -3] == 0,
            told[:, -1] != 0,
        )


def check_same(one: Answers, other: Answers, within: float = 1e-12) -> None:
    """Compare what two said: decisions exactly, numbers to a share of their size."""
    assert (one.passed == other.passed).all()
    assert (one.status == other.status).all()
    assert (one.warm == other.warm).all()
    assert (one.fault == other.fault).all()
    for a, b in ((one.correction, other.correction), (one.slope, other.slope), (one.deviation, other.deviation)):
        assert np.isfinite(b).all()
        assert (np.abs(a - b) <= within * np.maximum(1.0, np.abs(a))).all()


def check_block(
    compensator: Compensator,
    rows: FloatArray,
    dt: FloatArray,
    *,
    age: FloatArray | None = None,
    flags: tuple[str, ...] = SANITIZED,
    within: float = 1e-12,
    compiler: str = QUICK,
) -> Answers:
    """Run a compensator and its C code over the same rows; return what they said."""
    age = np.zeros(len(rows)) if age is None else age
    with tempfile.TemporaryDirectory() as folder:
        block = CompiledBlock(compensator, Path(folder), compiler, flags)
        readings = Readings(rows, age, dt)
        expected = replay(compensator, block.tables, readings)
        check_same(expected, block.run(readings), within)
    return expected
