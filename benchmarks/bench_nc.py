"""NC programs: lines per second of the tokenizer.

Run with ``python benchmarks/bench_nc.py [PROGRAM]``. Without a program: LinuxCNC's 3D_Chips.ngc where it is installed,
and a program like those of CAM systems, made here. Goal: at least 100,000 lines per second.
"""

import random
import sys
import time
from pathlib import Path

from thermocomp.compensation.nc.reading.tokens import read_lines, split_lines

GOAL = 100_000.0
INSTALLED = Path("/usr/share/linuxcnc/ncfiles/3D_Chips.ngc")
ROUNDS = 7


def made(count: int = 20_000) -> list[str]:
    """Return lines of a finishing program, now and then with a comment, an arc, or an expression."""
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
    """Return lines per second of processor time, of the best round: the others were disturbed."""
    best = float("inf")
    for _ in range(ROUNDS):
        begin = time.process_time()
        for _line in read_lines(lines):
            pass
        best = min(best, time.process_time() - begin)
    return len(lines) / best


def main(paths: list[Path]) -> int:
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
    return 0 if slowest >= GOAL else 1


if __name__ == "__main__":
    sys.exit(main([Path(path) for path in sys.argv[1:]]))
