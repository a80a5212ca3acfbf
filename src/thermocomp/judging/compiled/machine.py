"""Procedures of a compensator's program, compiled to machine code of this computer."""

import ctypes
from collections.abc import Callable
from functools import cache

import llvmlite.binding as llvm

from thermocomp.judging.compiled import rows
from thermocomp.judging.compiled.intermediate import write_module
from thermocomp.runtime.program.memory import ARRAYS, FlatMemory


@cache
def _engine() -> llvm.ExecutionEngine:
    """Return the machine code of all procedures that are called from Python; a fraction of a second, once."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    machine = llvm.Target.from_default_triple().create_target_machine(opt=2)
    module = llvm.parse_assembly(write_module(rows.PROCEDURES))
    module.verify()
    options = llvm.create_pipeline_tuning_options(speed_level=2)
    builder = llvm.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)
    return llvm.create_mcjit_compiler(module, machine)


@cache
def _compiled(name: str) -> Callable[..., None]:
    address = _engine().get_function_address(name)
    return ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * len(ARRAYS))(address)


def run(procedure: Callable[..., None], memory: FlatMemory) -> None:
    """Run a procedure of `thermocomp.judging.compiled.rows` on the variables of a compensator."""
    _compiled(procedure.__name__)(*(memory.arrays[name].ctypes.data for name in ARRAYS))
