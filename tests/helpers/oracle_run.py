"""LinuxCNC's interpreter in a child process of Debian's own Python: the moves of a program, with line numbers."""

import json
import math
import shutil
import subprocess
import tempfile
from collections.abc import Iterable
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self

from thermocomp.nc.interpreter.block import Block

CHILD = r"""
import contextlib, ctypes, json, math, os, sys
sys.path.insert(0, "/usr/lib/python3/dist-packages")
import gcode
home = sys.argv[1]
os.environ["HOME"] = home
tools = ctypes.CDLL("libtooldata.so.0")
tools._Z17tool_mmap_creatorPK13EMC_TOOL_STATi(None, 0)
MM = 25.4

class Canon:
    def __init__(self, params):
        self.parameter_file = params
        self.out, self.line, self.plane, self.rot, self.loaded = [], 0, 1, 0.0, 0
        self.g5x = self.g92 = self.tlo = (0.0,) * 9
    def __getattr__(self, name):
        if name.startswith("__") or name in ("use_move_batches", "move_batch"):
            raise AttributeError(name)
        return lambda *a: None
    def next_line(self, st): self.line = st.sequence_number
    def set_g5x_offset(self, idx, *o): self.g5x = o
    def set_g92_offset(self, *o): self.g92 = o
    def set_xy_rotation(self, t): self.rot = math.radians(t)
    def tool_offset(self, *o): self.tlo = o
    def set_plane(self, p): self.plane = p
    def set_feed_rate(self, f): self.out.append((self.line, "F", (f * MM,)))
    def set_spindle_rate(self, s): self.out.append((self.line, "S", (s,)))
    def get_tool(self, idx):
        number = idx if idx else self.loaded
        return (number, 0.0, 0.0, tools_by_place.get(str(number), 0.0)) + (0.0,) * 9 + (0,)
    def get_external_angular_units(self): return 1.0
    def get_external_length_units(self): return 1.0
    def get_axis_mask(self): return 63
    def get_block_delete(self): return delete
    def change_tool(self, t):
        self.loaded = t
        self.out.append((self.line, "tool", (t,)))
    def machine(self, p):
        x, y, z = (p[i] + self.g92[i] for i in range(3))
        c, s = math.cos(self.rot), math.sin(self.rot)
        x, y = x * c - y * s, x * s + y * c
        return tuple((v + self.g5x[i] + self.tlo[i]) * MM for i, v in enumerate((x, y, z)))
    def straight_traverse(self, *p): self.out.append((self.line, "rapid", self.machine(p) + tuple(p[3:6])))
    def straight_feed(self, *p): self.out.append((self.line, "feed", self.machine(p) + tuple(p[3:6])))
    def straight_probe(self, *p): self.out.append((self.line, "probe", self.machine(p) + tuple(p[3:6])))
    def rigid_tap(self, x, y, z, *a): self.out.append((self.line, "tap", self.machine((x, y, z))))
    def dwell(self, t): self.out.append((self.line, "dwell", (t,)))
    def arc_feed(self, e1, e2, c1, c2, turns, e3, *r):
        order = {1: (0, 1, 2), 3: (2, 0, 1), 2: (1, 2, 0)}[self.plane]
        end, centre = [0.0] * 3, [0.0] * 3
        for k, e, c in zip(order, (e1, e2, e3), (c1, c2, e3)):
            end[k], centre[k] = e, c
        centre = self.machine(centre)
        plane = {1: 17, 3: 18, 2: 19}[self.plane]
        turned = (centre[order[0]], centre[order[1]], turns, plane)
        self.out.append((self.line, "arc", self.machine(end) + turned + tuple(r[:3])))

def run(job, out):
    global delete, tools_by_place
    delete, tools_by_place = job["delete"], job["tools"]
    params = os.path.join(home, "p.var")
    open(params, "w").close()
    tools._Z13tooldata_initb(ctypes.c_bool(False))
    tools._Z13tooldata_loadPKcPPc(job["table"].encode(), None)
    canon = Canon(params)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    code, line = gcode.parse(job["path"], canon, job["init"], "")[:2]
    error = gcode.strerror(code) if code > gcode.MIN_ERROR else ""
    os.write(out, json.dumps({"out": canon.out, "error": error, "line": line}).encode())

for text in sys.stdin:
    # the module keeps positions and offsets from one program to the next: every program gets a process of its own
    reading, writing = os.pipe()
    pid = os.fork()
    if not pid:
        os.close(reading)
        try:
            run(json.loads(text), writing)
        finally:
            os._exit(0)
    os.close(writing)
    with open(reading, "rb") as answer:
        got = answer.read()
    os.waitpid(pid, 0)
    print(got.decode() or json.dumps({"out": [], "error": "the interpreter died", "line": 0}), flush=True)
"""


_DIED = "the interpreter died"


class Ran(NamedTuple):
    """What the interpreter made of a program; `error` empty if it took it, `line` where it stopped."""

    out: list[tuple[int, str, tuple[float, ...]]]
    error: str
    line: int


class Oracle:
    """A child process that lives as long as the tests need it, and forks for every program."""

    def __init__(self, tools: dict[int, float] | None = None) -> None:
        self.home = Path(tempfile.mkdtemp(prefix="oracle"))
        self.child: subprocess.Popen[str] | None = None
        self.table = self.home / "tools.tbl"
        # the interpreter asks for tools by their place in the table: give every number its own place
        self.tools = {n: (tools or {}).get(n, 0.0) for n in range(1, 100)}
        self.table.write_text("".join(f"T{n} P{n} Z{z!r} D0\n" for n, z in self.tools.items()))
        (self.home / "child.py").write_text(CHILD)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()
        shutil.rmtree(self.home, ignore_errors=True)

    def close(self) -> None:
        if self.child is not None:
            assert self.child.stdin is not None
            assert self.child.stdout is not None
            self.child.stdin.close()
            self.child.stdout.close()
            self.child.wait()
            self.child = None

    def run(self, program: str | Path, init: str = "G21 G49 G90", delete: bool = False) -> Ran:
        if isinstance(program, str):
            path = self.home / "program.ngc"
            path.write_text(program, encoding="latin-1", newline="")
        else:
            path = program
        job = {"path": str(path), "table": str(self.table), "init": init, "delete": delete, "tools": self.tools}
        ran = self._ask(job)
        if ran.error == _DIED:  # the module reads memory that is not its own: whether it dies is chance
            self.close()
            ran = self._ask(job)
        return ran

    def _ask(self, job: dict[str, Any]) -> Ran:
        if self.child is None:
            command = ["/usr/bin/python3", "-I", str(self.home / "child.py"), str(self.home)]
            self.child = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
                cwd=self.home,
            )
        assert self.child.stdin is not None
        assert self.child.stdout is not None
        self.child.stdin.write(json.dumps(job) + "\n")
        self.child.stdin.flush()
        answer = self.child.stdout.readline()
        if not answer:
            self.close()
            return Ran([], _DIED, 0)
        got: dict[str, Any] = json.loads(answer)
        return Ran([(n, k, tuple(v)) for n, k, v in got["out"]], got["error"], got["line"])


def ends(texts: Iterable[str]) -> list[tuple[float, float, float] | None]:
    """Return where each program of straight moves takes the tool [mm]; None: the interpreter refuses it."""
    found: list[tuple[float, float, float] | None] = []
    with Oracle() as oracle:
        for text in texts:
            ran = oracle.run(f"{text}\nM2\n")
            x, y, z = next((v[:3] for _, kind, v in reversed(ran.out) if kind in ("rapid", "feed")), (0.0, 0.0, 0.0))
            found.append(None if ran.error else (x, y, z))
    return found


class Comparison(NamedTuple):
    """How far the follower is from the interpreter."""

    moves: int
    apart: float  #: the largest difference of an end point or a centre [mm]
    where: str  #: the line of the largest difference, or of the first other difference; empty if there is none


def compare(blocks: Iterable[Block], ran: Ran) -> Comparison:  # noqa: PLR0911, PLR0912
    """Compare every move, arc, dwell and tool change with the interpreter's, line by line."""
    told: dict[int, list[tuple[str, tuple[float, ...]]]] = {}
    for line, kind, values in ran.out:
        told.setdefault(line, []).append((kind, values))
    count, apart, where = 0, 0.0, ""
    at: tuple[float, ...] = (0.0, 0.0, 0.0)
    beside = arced = lengthened = False
    unsure: set[str] = set()  # axes that the module has lost
    for block in blocks:
        lengthened = (lengthened or any(c.startswith("G43") for c in block.codes)) and "G49" not in block.codes
        if lengthened and {"G20", "G21"} & set(block.codes):
            return Comparison(count, apart, where)  # from here on the module has the length in the old unit
        events = told.pop(block.line.number, [])
        dwell = sum(v[0] for k, v in events if k == "dwell")
        tools = [v[0] for k, v in events if k == "tool"]
        mine = [m for m in block.moves if math.dist(m.start, m.end) > 1e-9 or m.arc]
        theirs = []
        for kind, values in events:
            if kind == "arc" or (kind in ("rapid", "feed", "probe", "tap") and math.dist(at, values[:3]) > 1e-9):
                theirs.append((kind, values))
                if kind == "tap":
                    theirs.append(("feed", at))
                else:
                    at = values[:3]
        beside = block.modal.cutter or (beside and not (block.known[0] and block.known[1]))
        # after M6 the module continues where the last straight move was, and takes no notice of G43 on that line
        if block.tool_change is not None and (arced or "G43" in block.codes):
            unsure = {"X", "Y", "Z"}
        arced = block.kind == "arc" if block.moves else arced
        unsure -= block.values.keys() if block.modal.absolute else set()
        if beside or unsure:  # cutter compensation: the interpreter tells the compensated path, and later
            continue
        if block.kind == "curve":
            theirs = theirs[-1:] if mine else []
        what = f"line {block.line.number}: {block.line.text.strip()!r}"
        if abs(dwell - block.pause) > 1e-9 or (tools and block.tool_change not in (-1, *tools)):
            return Comparison(count, apart, f"{what} dwell {dwell} {block.pause} tool {tools} {block.tool_change}")
        if len(mine) != len(theirs):
            return Comparison(count, apart, f"{what} moves {mine} instead of {theirs}")
        for move, (kind, values) in zip(mine, theirs, strict=True):
            count += 1
            far = math.dist(move.end, values[:3])
            if (kind == "rapid") != move.rapid or (kind == "arc") != (move.arc is not None):
                return Comparison(count, apart, f"{what} {move} is not a {kind}")
            if move.arc is not None:
                far = max(far, math.dist(move.arc.centre, values[3:5]))
                if (move.arc.turns * (-1 if move.arc.clockwise else 1), move.arc.plane) != (values[5], values[6]):
                    return Comparison(count, apart, f"{what} {move} turns as {values[5:7]}")
            if far > apart:
                apart = far
                if far > 1e-6:
                    where = where or f"{what} {move} instead of {values}"
        feeds = [v[0] for k, v in events if k == "F"]
        if feeds and block.modal.feed_mode != 93 and not block.ends and abs(feeds[-1] - block.feed) > 1e-9 * block.feed:
            return Comparison(count, apart, f"{what} feed {block.feed} instead of {feeds[-1]}")
    if told and not where:
        where = f"the interpreter moves in {sorted(told)} too"
    return Comparison(count, apart, where)
