"""One call of a compensator's C code compared with the compensator: five targets of the demo, 16 temperatures, watch.

Run with ``python benchmarks/bench_export.py``; it requires gcc. Both process the same readings, one a second; every
decision must be the same and corrections agree to 1e-12. Goal: the median call of the C code takes at most 1 us. The
watch evaluates the sensors in every tenth call, which is therefore slower; where valgrind is installed, the
instructions of each call are counted. Goal: once the zero is known, no call takes more than five times the mean.
"""

import ctypes
import re
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from thermocomp.core.arrays import FloatArray
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

GOAL_US, GOAL_WORST, CALLS, COUNTED, START = 1.0, 5.0, 4000, 2500, 400
HONEST = HonestError("made up", 1.0, 1.0, 2.0, 5.0, 5.0, {}, "accepted", "so that it runs", rules=RULES)
DRIVER = """
#define _POSIX_C_SOURCE 199309L
#include "tc_bench.h"
#include <stdio.h>
#include <time.h>

void drive(int n, const double *values, double *took, double *said)
{
    static tc_bench_state s;
    struct timespec a, b;
    int k, j;

    tc_bench_start(&s);
    tc_bench_cold(&s);
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

int main(void) /* for valgrind: readings from a file */
{
    static tc_bench_state s;
    static double values[CHANNELS];
    FILE *file = fopen("values.bin", "rb");

    tc_bench_start(&s);
    tc_bench_cold(&s);
    while (fread(values, sizeof(double), CHANNELS, file) == CHANNELS) {
        tc_bench_step(&s, values, 0.0, 1.0);
    }
    return 0;
}
"""


def count_instructions(folder: Path, command: list[str]) -> FloatArray:
    """Return the instructions of each call after the start, counted by callgrind."""
    subprocess.run([*command, "-g", "-o", "bench"], cwd=folder, check=True)
    step = "tc_bench_step_double"
    count = ["valgrind", "--tool=callgrind", f"--toggle-collect={step}", f"--dump-after={step}"]
    quiet = subprocess.DEVNULL
    subprocess.run([*count, "--callgrind-out-file=out", "./bench"], cwd=folder, check=True, stdout=quiet, stderr=quiet)
    calls = sorted(folder.glob("out.*"), key=lambda path: int(path.suffix[1:]))
    totals = (re.search(r"^totals: (\d+)", path.read_text(), re.MULTILINE) for path in calls)
    return np.array([int(m[1]) for m in totals if m][START:COUNTED], dtype=np.float64)


def main() -> int:
    """Time both; return 1 if a goal is missed."""
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
        command = [compiler, "-std=c99", "-O2", *sizes, f"{code.name}.c", "drive.c", "-lm"]
        subprocess.run([*command, "-shared", "-fPIC", "-o", "bench.so"], cwd=folder, check=True)
        Path(folder, "values.bin").write_bytes(values[:COUNTED].tobytes())
        counted = count_instructions(Path(folder), command) if shutil.which("valgrind") else None
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
    ratio = 0.0
    if counted is not None:
        ratio = float(counted.max() / counted.mean())
        verdict = "reached" if ratio <= GOAL_WORST else "MISSED"
        print(
            f"instructions: mean {counted.mean():,.0f}, worst {counted.max():,.0f}: {ratio:.1f} times the mean, ",
            end="",
        )
        print(f"goal {GOAL_WORST:g}: {verdict}")
    return int(p50 > GOAL_US or apart > 1e-12 or ratio > GOAL_WORST)


if __name__ == "__main__":
    sys.exit(main())
