"""LinuxCNC's own interpreter (package linuxcnc-uspace), in a process of the system's Python, as a judge of NC text."""

import json
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

import pytest

PROGRAMS = Path("/usr/share/linuxcnc/ncfiles")
PYTHON = Path("/usr/bin/python3")
MODULES = Path("/usr/lib/python3/dist-packages")

needs_programs = pytest.mark.skipif(not PROGRAMS.is_dir(), reason="the programs of linuxcnc-uspace are not installed")
needs_interpreter = pytest.mark.skipif(
    not list(MODULES.glob("gcode*.so")), reason="LinuxCNC's interpreter (linuxcnc-uspace) is not installed"
)

# What the interpreter says goes to its standard output, so the answer goes to a file.
CHILD = """
import json, os, sys
sys.path.insert(0, sys.argv[2])
import gcode

class Machine:
    def __init__(self, parameter_file):
        self.parameter_file, self.end = parameter_file, [0.0, 0.0, 0.0]
    def __getattr__(self, name):
        if name.startswith("__") or name in ("use_move_batches", "move_batch"):
            raise AttributeError(name)
        return lambda *values: None
    def straight_traverse(self, *point):
        self.end = [25.4 * value for value in point[:3]]
    straight_feed = straight_traverse
    def get_tool(self, number): return (-1,) + (0.0,) * 12 + (0,)
    def get_external_angular_units(self): return 1.0
    def get_external_length_units(self): return 1.0
    def get_axis_mask(self): return 7
    def get_block_delete(self): return False

os.chdir(sys.argv[1])
answer = []
for text in json.load(open("programs.json")):
    with open("program.ngc", "w") as file:
        file.write(text + "\\nM2\\n")
    open("parameters", "w").close()
    machine = Machine("parameters")
    try:
        result = gcode.parse("program.ngc", machine, "G21 G49 G90", "")[0]
        answer.append(None if result > gcode.MIN_ERROR else machine.end)
    except RuntimeError:
        answer.append(None)
json.dump(answer, open("answer.json", "w"))
"""


def ends(texts: Sequence[str]) -> list[tuple[float, float, float] | None]:
    """Return where each program (ASCII, no tools) takes the tool [mm]; None: the interpreter refuses it."""
    with tempfile.TemporaryDirectory() as home:
        (Path(home) / "programs.json").write_text(json.dumps(list(texts)))
        command = [str(PYTHON), "-B", "-c", CHILD, home, str(MODULES)]
        subprocess.run(command, env={"HOME": home, "PATH": "/usr/bin:/bin"}, capture_output=True, check=True)
        answer = json.loads((Path(home) / "answer.json").read_text())
    assert len(answer) == len(texts)
    return [None if end is None else (end[0], end[1], end[2]) for end in answer]
