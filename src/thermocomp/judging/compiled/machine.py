"""Procedures of a compensator's program, compiled to machine code of this computer."""

import ctypes
import threading
from collections.abc import Callable
from functools import cache

import llvmlite.binding as llvm

from thermocomp.judging.compiled import rows
from thermocomp.judging.compiled.intermediate import write_module
from thermocomp.runtime.program.memory import ARRAYS, FlatMemory

#: threads that compile at once would discard all machine code but the last, while they run it
_ONE = threading.Lock()


def compile_module(text: str, effort: int = 2) -> llvm.ExecutionEngine:
    """Return the machine code of a module, see `thermocomp.judging.compiled.intermediate`."""
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
def _engine() -> llvm.ExecutionEngine:
    """Return the machine code of all procedures that are called from Python; a fraction of a second, once."""
    return compile_module(write_module(rows.PROCEDURES))


@cache
def _compiled(name: str) -> Callable[..., None]:
    address = _engine().get_function_address(name)
    return ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * len(ARRAYS))(address)


def run(procedure: Callable[..., None], memory: FlatMemory) -> None:
    """Run a procedure of `thermocomp.judging.compiled.rows` on the variables of a compensator."""
    with _ONE:
        found = _compiled(procedure.__name__)
    found(*(memory.arrays[name].ctypes.data for name in ARRAYS))
