"""Run an NC program through LinuxCNC's interpreter and write its canonical calls to standard output, in blocks.

A script for Debian's ``/usr/bin/python3``, whose package linuxcnc-uspace provides the module `gcode`; from thermocomp
it only uses `_rs274_canon.py`, which receives the calls, and `_rs274_hooks.py`, `_rs274_kinds.py` and
`_rs274_reading.py` in the same folder. `rs274process.py` starts it with the folders of jobs, which run one after the
other, each in a separate process, and reads the output: a line with the names of the kinds (JSON), then blocks, each
with two numbers (number of records, bytes of JSON), the records, and a JSON list of all non-numeric data: the first
number of such a record is its index in the list. The output of each job ends with a block without records that contains
the exit code. Moves are in program coordinates [inch, deg]; each arc is preceded by a record with its centre.
"""

import ctypes
import json
import os
import resource
import struct
import sys
import traceback
from contextlib import suppress
from importlib.util import module_from_spec, spec_from_file_location
from typing import Any


def load_sibling(name: str) -> Any:
    """Load a file next to this one, whose folder is not on the module path, and return it as a module."""
    spec = spec_from_file_location(name, __file__.replace("_rs274_child", name))
    assert spec is not None
    assert spec.loader is not None
    sys.modules[name] = module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


load_sibling("_rs274_hooks")
kinds, reading = load_sibling("_rs274_kinds"), load_sibling("_rs274_reading")
canonical = load_sibling("_rs274_canon")  # uses the others


def run(job: dict[str, Any], canon: Any, gcode: Any) -> None:
    """Run a job, and write its canonical calls to standard output."""
    ctypes.CDLL(None).prctl(1, 9)  # PR_SET_PDEATHSIG: end with the parent process
    resource.setrlimit(resource.RLIMIT_CPU, (job["seconds"], job["seconds"] + 1))
    os.environ["HOME"] = job["home"]
    os.environ["INI_FILE_NAME"] = job["ini"]
    # T, M6 and G43 crash the interpreter unless the tool store $HOME/.tool.mmap exists
    tools = ctypes.CDLL("libtooldata.so.0")
    tools._Z17tool_mmap_creatorPK13EMC_TOOL_STATi(None, 0)
    tools._Z13tooldata_initb(ctypes.c_bool(False))
    tools._Z13tooldata_loadPKcPPc(job["table"].encode(), None)
    ctypes.c_int.in_dll(ctypes.CDLL(gcode.__file__), "_task").value = job["task"]
    canon.begin(job)
    result = 0
    with suppress(KeyboardInterrupt):  # raised by the module if `check_abort` returns True
        result = gcode.parse(job["program"], canon, job["units"], job["start"])[0]
    failure = canon.hooks.failure
    if isinstance(failure, reading.RefusedError):
        canon.refuse(*failure.args)
    elif failure is not None:
        raise failure
    elif result > gcode.MIN_ERROR:
        canon.text("error", gcode.strerror(result))
    else:
        canon.linked._ZN6Interp4exitEv(ctypes.c_void_p(canon.interpreter))  # writes the parameters
        with open(job["opened"], "wb") as file:  # noqa: PTH123
            file.write(b"\0".join(canon.files))
        canon.record("done")
    canon.flush()


def main() -> None:
    """Run the jobs in the given folders, each from the same fresh state of the interpreter module."""
    with os.fdopen(os.dup(1), "wb", buffering=1 << 18) as out:
        os.dup2(2, 1)  # (PRINT, ...) of a program goes to standard output
        os.environ["HOME"] = os.getcwd()  # noqa: PTH109
        import gcode  # type: ignore[import-not-found,unused-ignore]

        canon = canonical.Canon(out)
        canon.connect("gcode.cpython")
        out.write(json.dumps(kinds.KINDS).encode() + b"\n")
        out.flush()
        for folder in sys.argv[1:]:
            child = os.fork()
            if not child:
                code = 1
                try:
                    with open(f"{folder}/job", encoding="utf-8") as file:  # noqa: PTH123
                        job = json.load(file)
                    run(job, canon, gcode)
                    code = 0
                except BaseException:  # noqa: BLE001
                    traceback.print_exc()
                finally:
                    sys.stderr.flush()
                    os._exit(code)
            end = json.dumps([os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])]).encode()
            out.write(struct.pack("<II", 0, len(end)) + end)
            out.flush()


if __name__ == "__main__":
    main()
