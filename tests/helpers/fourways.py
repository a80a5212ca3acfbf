"""Every way in which a compensator takes readings: numpy, machine code, C and structured text, over the same stream."""

import ctypes
import math
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any, NamedTuple

import numpy as np
import stmachine
from compiledblock import SANITIZED, compiled
from drawnreadings import Stream
from numpy.typing import NDArray

from thermocomp.core.bounds import GAP
from thermocomp.core.reading import Reading
from thermocomp.core.thresholds import THRESHOLDS
from thermocomp.export.c99.c99 import translate
from thermocomp.export.st.structuredtext import translate as translate_st
from thermocomp.export.vectors import NOTHING, STATUS, TOLD_COLD, count_outside, reason_code
from thermocomp.judging.compiled.intermediate import write_functions
from thermocomp.judging.compiled.machine import compile_module
from thermocomp.live import statefile
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.program.assembly import functions
from thermocomp.runtime.program.memory import ARRAYS, FlatMemory
from thermocomp.runtime.program.tables import Tables
from thermocomp.runtime.state import Compensated, CompensatorState, resume, silence
from thermocomp.runtime.watchstate import WORDS

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
WRITTEN = datetime(2026, 1, 31, tzinfo=UTC)
#: what a block keeps that is compared: decisions, and numbers
DECISIONS, NUMBERS = ("status", "fault", "rejected", "outside"), ("correction", "slope", "deviation")


class Said(NamedTuple):
    """What came out, call by call."""

    decisions: IntArray  #: (n_calls, n_decisions): status of each target, fault of each sensor, rejected, outside
    numbers: FloatArray  #: (n_calls, n_numbers): correction and slope of each target, deviation of each model


# -- numpy -------------------------------------------------------------------------------------------------------------


def run_numpy(compensator: Compensator, tables: Tables, stream: Stream) -> Said:
    """Step a compensator through a stream; its state goes through a file on the way.

    A clock is set between two readings only, and after the first that was used: until then a state knows no other clock
    than that of the readings, by which the watch would be as far behind or ahead.
    """
    names, decisions, numbers, shown = [c.name for c in tables.channels], [], [], float(stream.clock[0])
    state, time, begun, outside = compensator.start(), 0.0, False, 0
    for k, (values, age, dt, counter, ahead, restarts, stored, resumed) in enumerate(
        zip(*map(_listed, stream), strict=True)
    ):
        if restarts:  # longer ago than the memory of the models
            state = resume(_stored(state, compensator), compensator.start(), 2 * THRESHOLDS.resumable)
            time, begun, outside = 0.0, False, 0
        elif stored:
            state = _stored(state, compensator)
        good = 0.0 <= dt <= GAP
        before, time = time, time + dt if good and begun else time
        begun = begun or good
        if good and dt > 0.0 and state.time is not None:
            shown = ahead
        if resumed and state.clock is not None:
            outage = silence(state, time)
            if outage <= THRESHOLDS.resumable:
                left = _stored(state, compensator)
                # corrections wait in an outage: here they go on, as those of a program that is not started again
                state = resume(left, compensator.start(), outage, tick=time)._replace(clock=before)
        table: Mapping[str, float] = dict(zip(names, values, strict=True))
        if k % 2:  # a source tells in two ways that there is no value
            table = {name: v for name, v in table.items() if not math.isnan(v)}
        now = time + shown if good else math.nan
        reading = Reading(now - age, table, counter=counter)
        state, said = compensator.step(state, reading, now, tick=time if good else math.nan)
        if not said.rejected:
            outside = count_outside(tables, state)
        decisions.append([*_decisions(tables, said), outside])
        each = said.corrections.values()
        deviations = [float(s.deviation) for s in state.models]
        numbers.append([*(c.offset for c in each), *(c.slope for c in each), *deviations])
    return Said(np.array(decisions, dtype=np.int64), np.array(numbers))


def _listed(array: NDArray[np.generic]) -> list[Any]:
    found: list[Any] = array.tolist()
    return found


def _stored(state: CompensatorState, compensator: Compensator) -> CompensatorState:
    return statefile.loads(statefile.dumps(state, compensator, WRITTEN), compensator).state


def _decisions(tables: Tables, said: Compensated) -> list[int]:
    """Return decisions as the codes of a block."""
    status = []
    for target in tables.targets:
        word, reason = said.states[target]
        # a block knows of no outage: a correction that catches up after one is active
        catches_up = word == "restarting" and reason.startswith("compensation did not run")
        status.append(STATUS.index("active" if catches_up else word))
    fault = [WORDS.index(said.failed.get(s, WORDS[0])) for s in tables.sensors]
    return [*status, *fault, reason_code(said.rejected)]


# -- the program -------------------------------------------------------------------------------------------------------


class MachineCode:
    """The program of a compensator as machine code of this computer."""

    def __init__(self, tables: Tables) -> None:
        self._tables = tables
        self._engine = compile_module(write_functions(functions(tables), ["step"]), effort=0)
        address = self._engine.get_function_address("step")
        self._step = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * len(ARRAYS))(address)

    def run(self, stream: Stream) -> Said:
        """Run it from the start."""
        memory = FlatMemory(self._tables.sizes, self._tables.values)
        pointers = [memory.arrays[name].ctypes.data for name in ARRAYS]
        value, age, dt, counter = (memory.find("w", name) for name in ("value", "age", "dt", "counter"))
        seen = [[memory.find("s", name).reshape(-1) for name in group] for group in (DECISIONS, NUMBERS)]
        kept = [memory.find("s", name) for name in ("correction", "slope")]
        memory.find("s", "referenced")[:] = 1
        decisions, numbers = [], []
        for k in range(len(stream.dt)):
            if stream.restarts[k]:
                in_force = [a.copy() for a in kept]
                memory.arrays["sr"][:], memory.arrays["si"][:] = 0.0, 0
                for array, was in zip(kept, in_force, strict=True):
                    array[:] = was
                memory.find("s", "referenced")[:] = 1
            value[:], age[...], dt[...] = stream.values[k], stream.age[k], stream.dt[k]
            counter[...] = stream.counter[k]
            self._step(*pointers)
            decisions.append(np.concatenate(seen[0]))
            numbers.append(np.concatenate(seen[1]))
        return Said(np.array(decisions, dtype=np.int64), np.array(numbers))


_DRIVER = """
#include "{name}.c"

void run(int n, const tc_real *values, const double *age, const double *dt, const double *counter,
         const unsigned char *restarts, double *numbers, int *decisions)
{{
    {name}_state s;
    int k, j;

    {name}_start(&s);
    {name}_cold(&s);
    for (k = 0; k < n; k++) {{
        if (restarts[k]) {{
            {name}_cold(&s);
        }}
        {name}_step_counted(&s, values + k * {channels}, age[k], dt[k], counter[k]);
        for (j = 0; j < {targets}; j++) {{ *decisions++ = s.status[j]; }}
        for (j = 0; j < {sensors}; j++) {{ *decisions++ = s.fault[j]; }}
        *decisions++ = s.rejected;
        *decisions++ = s.outside;
        for (j = 0; j < {targets}; j++) {{ *numbers++ = s.correction[j]; }}
        for (j = 0; j < {targets}; j++) {{ *numbers++ = s.slope[j]; }}
        for (j = 0; j < {models}; j++) {{ *numbers++ = s.deviation[j]; }}
    }}
}}
"""


class CCode:
    """A compensator in C, with checks of what it must not do."""

    def __init__(self, tables: Tables, compiler: str) -> None:
        sources, t = translate(tables, "drawn"), tables
        n = {"channels": len(t.channels), "targets": len(t.targets), "models": len(t.models), "sensors": len(t.sensors)}
        self._width = n["targets"] + n["sensors"] + 2, 2 * n["targets"] + n["models"]
        driver = _DRIVER.format(name=sources.name, **n)
        files = (f"{sources.name}.h", sources.header), (f"{sources.name}.c", sources.source), ("driver.c", driver)
        flags = SANITIZED if compiler != "clang" else (SANITIZED[0], "-fsanitize-trap=undefined")
        self._library = compiled(files, sources.name, compiler, flags)

    def run(self, stream: Stream) -> Said:
        """Run it from the start."""
        n = len(stream.dt)
        decisions, numbers = np.empty((n, self._width[0]), dtype=np.int32), np.empty((n, self._width[1]))
        given = [
            np.ascontiguousarray(a) for a in (stream.values, stream.age, stream.dt, stream.counter, stream.restarts)
        ]
        pointers = [ctypes.c_void_p(a.ctypes.data) for a in (*given, numbers, decisions)]
        self._library.run(n, *pointers)
        return Said(decisions.astype(np.int64), numbers)


class StructuredText:
    """A compensator in structured text, run by `stmachine`."""

    def __init__(self, tables: Tables) -> None:
        self._machine = stmachine.Machine(translate_st(tables, "tc_x", "codesys"))
        self._decisions = DECISIONS if tables.sensors else ("status", "rejected", "outside")

    def run(self, stream: Stream) -> Said:
        """Run it from the start."""
        self._machine.start()
        decisions, numbers, first = [], [], True
        rows = (stream.values, stream.age, stream.dt, stream.counter, stream.restarts)
        for values, age, dt, counter, restarts in zip(*rows, strict=True):
            good = np.isfinite(values)
            given = {
                "value": np.where(good, values, 0.0).tolist(),
                "good": good.tolist(),
                "age": stmachine.finite(age),
                "elapsed": stmachine.finite(dt),
                "reading": float(counter),
            }
            seen = self._machine.call(**given, **stmachine.happening(TOLD_COLD if restarts or first else NOTHING, 0.0))
            first = False
            decisions.append(np.concatenate([np.ravel(getattr(seen, name)) for name in self._decisions]))
            numbers.append(np.concatenate([np.ravel(getattr(seen.s, name)) for name in NUMBERS]))
        return Said(np.array(decisions, dtype=np.int64), np.array(numbers))
