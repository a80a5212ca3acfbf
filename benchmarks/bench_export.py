"""One call of a compensator's C code compared with the compensator: five targets of the demo, 16 temperatures, watch.

Run with ``python benchmarks/bench_export.py``; it requires gcc. Both process the same readings, one a second; every
decision must be the same and corrections agree to 1e-12. Goal: the median call of the C code takes at most 1 us. The
watch evaluates the sensors in every tenth call, which is therefore slower.
"""

import ctypes
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from thermocomp.core.provenance import RULES, HonestError
from thermocomp.core.reading import Reading
from thermocomp.export.c99.c99 import translate
from thermocomp.export.vectors import Readings, replay
from thermocomp.models.training import train
from thermocomp.models.watching import find_watch
from thermocomp.recordings.stacking import stack
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.program.tables import gather
from thermocomp.virtual.datasets import record

GOAL_US, CALLS = 1.0, 4000
HONEST = HonestError("made up", 1.0, 1.0, 2.0, 5.0, 5.0, {}, "accepted", "so that it runs", rules=RULES)
DRIVER = """
#define _POSIX_C_SOURCE 199309L
#include "tc_bench.h"
#include <time.h>

void drive(int n, const double *values, double *took, double *said)
{
    static tc_bench_state s;
    struct timespec a, b;
    int k, j;

    tc_bench_start(&s);
    for (k = 0; k < n; k++) {
        clock_gettime(CLOCK_MONOTONIC, &a);
        tc_bench_step(&s, values + k * CHANNELS, 0.0, 1.0);
        clock_gettime(CLOCK_MONOTONIC, &b);
        took[k] = (double)(b.tv_sec - a.tv_sec) * 1e6 + (double)(b.tv_nsec - a.tv_nsec) * 1e-3;
        for (j = 0; j < TARGETS; j++) {
            said[k * TARGETS + j] = s.correction[j];
        }
    }
}
"""


def main() -> int:
    """Time both; return 1 if the goal is missed."""
    compiler = shutil.which("gcc")
    if compiler is None:
        print("no gcc: left out")
        return 0
    (found,) = record("demo")
    samples = stack([found], [c.name for c in found.channels if c.quantity == "displacement"])
    every = np.ones(len(samples), np.bool_)
    watch = find_watch(samples, every)
    models = [
        replace(train("averaged", samples, k, every).model, watch=watch, honest_error=HONEST)
        for k in range(len(samples.targets))
    ]
    compensator = Compensator.of(models)
    tables = gather(compensator)
    names = [c.name for c in tables.channels]
    values = np.ascontiguousarray(samples.values[:CALLS, [[i.name for i in samples.inputs].index(n) for n in names]])
    code = translate(tables, "bench")
    with tempfile.TemporaryDirectory() as folder:
        for name, text in ((f"{code.name}.h", code.header), (f"{code.name}.c", code.source), ("drive.c", DRIVER)):
            Path(folder, name).write_text(text, encoding="ascii")
        sizes = [f"-DCHANNELS={len(names)}", f"-DTARGETS={len(tables.targets)}"]
        command = [compiler, "-std=c99", "-O2", *sizes, "-shared", "-fPIC", f"{code.name}.c", "drive.c", "-lm"]
        subprocess.run([*command, "-o", "bench.so"], cwd=folder, check=True)
        library = ctypes.CDLL(str(Path(folder, "bench.so")))
        took, said = np.empty(CALLS), np.empty((CALLS, len(tables.targets)))
        pointers = [ctypes.c_void_p(a.ctypes.data) for a in (values, took, said)]
        library.drive(CALLS, *pointers)  # once to warm up
        ours, state = [], compensator.start()
        for k, row in enumerate(values.tolist()):
            reading = Reading(float(k), dict(zip(names, row, strict=True)))
            begin = time.perf_counter()
            state, _ = compensator.step(state, reading, float(k))
            ours.append(1e6 * (time.perf_counter() - begin))
            if k % 100 == 0:
                library.drive(CALLS, *pointers)
    expected = replay(compensator, tables, Readings(values, np.zeros(CALLS), np.ones(CALLS))).correction
    apart = float((np.abs(said - expected) / np.maximum(1.0, np.abs(expected))).max())
    p50, mean, worst = np.median(took), np.mean(took), np.percentile(took, 99)
    print(f"C: p50 {p50:.2f} us, mean {mean:.2f} us, p99 {worst:.1f} us; goal {GOAL_US:g} us for the median")
    print(f"Python: p50 {np.median(ours):.0f} us; {np.median(ours) / p50:.0f} times as long")
    print(f"largest difference {apart:.1e}")
    return int(p50 > GOAL_US or apart > 1e-12)


if __name__ == "__main__":
    sys.exit(main())
