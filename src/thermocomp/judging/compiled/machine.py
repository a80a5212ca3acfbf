"""Procedures of a compensator's program, compiled to machine code of this computer."""

import ctypes
import threading
import time
from collections.abc import Callable
from functools import cache

import llvmlite.binding as llvm

from thermocomp.judging.compiled import rows
from thermocomp.judging.compiled.intermediate import write_module
from thermocomp.runtime.program.memory import ARRAYS, FlatMemory

#: threads that compile at once would discard all machine code but the last, while they run it
_ONE = threading.Lock()
#: s of running code that is not optimised, after which it is: that takes some 2 s, and halves the time
_PATIENCE = 2.0
_spent = 0.0


def compile_module(text: str, effort: int) -> llvm.ExecutionEngine:
    """Return the machine code of a module, see `thermocomp.judging.compiled.intermediate`.

    Parameters
    ----------
    text : str
    effort : int
        Optimisation: 0 to 3. Results are the same to the last bit.
    """
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    machine = llvm.Target.from_default_triple().create_target_machine(opt=effort)
    module = llvm.parse_assembly(text)
    module.verify()
    options = llvm.create_pipeline_tuning_options(speed_level=effort)
    builder = llvm.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)
    return llvm.create_mcjit_compiler(module, machine)


@cache
def _engine(effort: int) -> llvm.ExecutionEngine:
    """Return the machine code of all procedures that are called from Python."""
    return compile_module(write_module(rows.PROCEDURES), effort)


@cache
def _compiled(name: str, effort: int) -> Callable[..., None]:
    address = _engine(effort).get_function_address(name)
    return ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * len(ARRAYS))(address)


def run(procedure: Callable[..., None], memory: FlatMemory) -> None:
    """Run a procedure of `thermocomp.judging.compiled.rows` on the variables of a compensator."""
    global _spent  # noqa: PLW0603
    with _ONE:
        found = _compiled(procedure.__name__, 0 if _spent < _PATIENCE else 2)
    start = time.perf_counter()
    found(*(memory.arrays[name].ctypes.data for name in ARRAYS))
    _spent += time.perf_counter() - start
