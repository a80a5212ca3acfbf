"""NC programs: lines per second of the tokenizer, and microseconds and memory of ``thermocomp revise``.

Run with ``python benchmarks/bench_nc.py [PROGRAM]``. Without a program: LinuxCNC's 3D_Chips.ngc if it is installed, and
generated programs like those of CAM systems. The latter are also revised by the command, each in a separate process:
program, differences, table and thermal state are written, without a figure and without verification. If LinuxCNC is
installed, a program of 500,000 lines is also verified by its interpreter. Goals: the tokenizer reads at least 100,000
lines per second; a program of 1,000,000 lines takes at most 1.2 times the memory of one of 100,000; with verification
150 s of processor time and 300 MB.
"""

# The parent imports no large package: on Linux a child's ru_maxrss starts at the size of the process that forked it.
import itertools
import json
import math
import os
import random
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

from thermocomp.nc.parser.tokens import read_lines, split_lines

GOAL, GOAL_MEMORY = 100_000.0, 1.2
INSTALLED = Path("/usr/share/linuxcnc/ncfiles/3D_Chips.ngc")
ROUNDS = 7
SIZES = (10_000, 100_000, 1_000_000)
PROVED, GOAL_SECONDS, GOAL_MEGABYTES = 500_000, 150.0, 300.0


def made(count: int = 20_000) -> list[str]:
    """Return lines of a finishing program, some with a comment, an arc or an expression."""
    draw = random.Random(1)
    lines = ["%\n", "O1000 (made)\n", "G21 G17 G90 G40 G49 G80\n", "T1 M6\n", "S8000 M3\n", "G0 X0 Y0 Z5.\n"]
    for k in range(count):
        x, y, z = (draw.uniform(-100, 100) for _ in range(3))
        match k % 50:
            case 0:
                lines.append(f"N{k} (pass {k})\n")
            case 1:
                lines.append(f"G2 X{x:.3f} Y{y:.3f} I{z:.3f} J0. F800.\n")
            case 2:
                lines.append(f"#1=[{z:.3f}+0.1] ; depth\n")
            case _:
                lines.append(f"N{k} G1 X{x:.3f} Y{y:.3f} Z{z:.3f}\n")
    return lines


def rate(lines: list[str]) -> float:
    """Return lines per second of processor time in the best round, which was disturbed least by other programs."""
    best = float("inf")
    for _ in range(ROUNDS):
        begin = time.process_time()
        for _line in read_lines(lines):
            pass
        best = min(best, time.process_time() - begin)
    return len(lines) / best


def cam(count: int) -> Iterator[str]:
    """Yield this number of lines of a program: rows of short cuts over a wavy face, retracts, arcs, two tools."""
    head = ["%\n", "(made)\n", "G21 G17 G90 G94 G40 G49 G80 G54\n", "G64 P0.01\n", "S8000 M3\n", "G0 Z50.\n"]
    tail = ["G0 Z50.\n", "M5\n", "M30\n", "%\n"]
    yield from head
    yield from itertools.islice(operations(), count - len(head) - len(tail))
    yield from tail


def operations() -> Iterator[str]:
    """Yield the lines between head and tail, without an end."""

    def face(x: float, y: float) -> float:
        return -3.0 + 2.0 * math.sin(0.11 * x) * math.cos(0.07 * y)

    for k in itertools.count():
        yield from (f"(operation {k})\n", f"T{1 + k % 2} M6\n", f"S{(8000, 12_000)[k % 2]} M3\n", "G0 X0. Y0. Z50.\n")
        for row in range(50):
            y = 0.4 * row
            yield f"N{10 * row} G0 X0. Y{y:.3f}\n"
            yield "Z5.\n"
            yield f"G1 Z{face(0.0, y):.3f} F500.\n"
            for _ in range(10 if row % 10 == 9 else 0):
                yield f"G3 X20. Y{y:.3f} I10. J0. F1200.\n"
                yield f"G3 X0. Y{y:.3f} I-10. J0.\n"
            yield f"G1 X0.600 Z{face(0.6, y):.3f} F2400.\n"
            for x in range(2, 100):
                yield f"X{0.6 * x:.3f} Z{face(0.6 * x, y):.3f}\n"
            yield "G0 Z50.\n"


def revise(program: Path, proof: str) -> dict[str, float]:
    """Revise a program by the command; return times in us per line, also of its children, and memory in MB."""
    sys.modules["matplotlib"] = None  # type: ignore[assignment]
    from thermocomp.cli.app import run
    from thermocomp.core.inputs import Input
    from thermocomp.core.lineardynamic import LinearDynamic
    from thermocomp.core.provenance import RULES, HonestError
    from thermocomp.files import modelfile
    from thermocomp.nc.linuxcnc import rs274process

    if proof == "unproved":
        rs274process.PYTHON = Path("/nowhere")
    speed = Input("spindle_rpm", "spindle_speed", "1/min", 0.0, False, 0.0, 12_000.0)
    taus, gains = (120.0, 1200.0, 2400.0), (1e-3, 1e-3, 3e-3)
    cycles = {"1": 1.0, "2": 1.0}
    judged = HonestError("made up", 1.0, 1.0, 2.0, 5.0, 5.0, cycles, "accepted", "so that it runs", 2, rules=RULES)
    models = [
        LinearDynamic(
            target=target,
            unit="um",
            inputs=(speed,),
            signals=((0,),),
            direct=(0.0,),
            lag_signals=(0, 0, 0),
            time_constants=taus,
            lagged=tuple(size * g for g in gains),
            honest_error=judged,
        )
        for target, size in (("y_um", 0.5), ("z_um", 1.0))
    ]
    folder = program.parent
    modelfile.write(models, folder / "model.json", overwrite=True)
    told = StringIO()
    options = [
        "--model",
        str(folder / "model.json"),
        "--cold",
        "--controller",
        "linuxcnc",
        "--rotation",
        "none",
        "--no-g92",
        "--json",
        "--overwrite",
        *(["--unproved"] if proof == "unproved" else []),
    ]
    begin = sum(os.times()[:4])
    with redirect_stdout(told):
        if run(["revise", str(program), *options, "-o", str(folder / "revised.ngc")]):
            raise SystemExit(f"{program} was not revised")
    found = json.loads(told.getvalue())
    return {
        "lines": found["lines"],
        "changed": found["changed"],
        "revising": found["us_per_line"],
        "processor": 1e6 * (sum(os.times()[:4]) - begin) / found["lines"],
        "proving": 1e6 * found["proving_s"] / found["lines"],
        "moves": found["proof"]["moves"] if found["proof"] else 0,
        "memory": max(resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
        / 1024,
    }


def revisions() -> bool:
    """Revise programs of growing length and state whether their memory is bounded."""
    from thermocomp.nc.linuxcnc.rs274 import find_obstacle

    jobs = [(size, "unproved") for size in SIZES] + ([(PROVED, "proved")] if find_obstacle() is None else [])
    memory: dict[tuple[int, str], float] = {}
    reached = True
    print(f"{'revise':<32} {'lines':>9} {'us/line':>8} {'CPU':>6} {'changed':>9} {'proof us/line':>14} {'MB':>5}")
    with tempfile.TemporaryDirectory() as folder:
        for size, proof in jobs:
            program = Path(folder, "program.ngc")
            with program.open("w", encoding="ascii", newline="") as file:
                file.writelines(cam(size))
            command = [sys.executable, __file__, "--revise", str(program), proof]
            found = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout)
            memory[size, proof] = found["memory"]
            print(
                f"{'made, as CAM systems do, ' + proof:<32} {found['lines']:>9.0f} {found['revising']:>8.1f} "
                f"{found['processor']:>6.1f} {found['changed']:>9.0f} "
                f"{format(found['proving'], '.1f') if found['moves'] else '':>14} {found['memory']:>5.0f}",
                flush=True,
            )
            if proof == "proved":
                seconds = found["processor"] * found["lines"] / 1e6
                reached = seconds <= GOAL_SECONDS and found["memory"] <= GOAL_MEGABYTES
                print(
                    f"{seconds:.0f} s of processor time, goal <= {GOAL_SECONDS:g}, {found['memory']:.0f} MB, "
                    f"goal <= {GOAL_MEGABYTES:g}: {'reached' if reached else 'MISSED'}"
                )
    ratio = memory[SIZES[-1], "unproved"] / memory[SIZES[-2], "unproved"]
    print(
        f"memory at {SIZES[-1]:,} lines {ratio:.2f} times that at {SIZES[-2]:,}, goal <= {GOAL_MEMORY:g}: "
        f"{'reached' if ratio <= GOAL_MEMORY else 'MISSED'}"
    )
    return reached and ratio <= GOAL_MEMORY


def tokenizer(paths: list[Path]) -> bool:
    """Read programs and state whether that was fast enough."""
    programs = {path.name: list(split_lines(path.read_text("latin-1"))) for path in paths}
    if not paths:
        programs["a finishing program, made"] = made()
        if INSTALLED.is_file():
            programs[INSTALLED.name] = list(split_lines(INSTALLED.read_text("latin-1")))
    print(f"{'tokenizer':<32} {'lines':>9} {'us/line':>8} {'lines/s':>9}")
    slowest = float("inf")
    for name, lines in programs.items():
        speed = rate(lines)
        slowest = min(slowest, speed)
        print(f"{name:<32} {len(lines):>9} {1e6 / speed:>8.2f} {speed:>9.0f}")
    print(f"goal >= {GOAL:.0f} lines/s: {'reached' if slowest >= GOAL else 'MISSED'}")
    return slowest >= GOAL


def main(paths: list[Path]) -> int:
    reached = [tokenizer(paths)]
    if not paths:
        reached.append(revisions())
    return 0 if all(reached) else 1


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["--revise", where, proof]:
            print(json.dumps(revise(Path(where), proof)))
        case others:
            sys.exit(main([Path(path) for path in others]))
