"""LinuxCNC's interpreter in a child process."""

import math
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thermocomp.core.exceptions import InputError, ProgramError
from thermocomp.nc.linuxcnc import rs274, rs274process
from thermocomp.nc.linuxcnc.rs274 import Canonical, ProgramFrame, Stored, read

pytestmark = pytest.mark.usefixtures("interpreter")

Run = Callable[..., list[Canonical]]
MOVES = ("rapid", "feed", "arc", "probe", "tap")
#: a child that tells what it is told to
TELLS = f"""
import json, os, struct, sys
sys.path.append({str(rs274process.CHILD.parent)!r})
from _rs274_kinds import CODES, KINDS, RECORD
RAPID = CODES["rapid"]
def tell(*rows):
    print(json.dumps(KINDS), flush=True)
    os.write(1, struct.pack("<II", len(rows), 2) + b"".join(rows) + b"[]")
"""


@pytest.fixture
def run(tmp_path: Path) -> Run:
    """Run a text; without what stands before its first line."""

    def run(text: str, stored: Stored | None = None, **options: Any) -> list[Canonical]:
        path = tmp_path / "program.ngc"
        path.write_text(text, encoding="latin-1")
        return [call for call in read(path, stored, **options) if call.line]

    return run


def ends(calls: list[Canonical]) -> list[tuple[float, ...]]:
    return [call.machine[:3] for call in calls if call.kind in MOVES]


def close(*points: tuple[float, ...]) -> Any:
    return [pytest.approx(point, abs=1e-9) for point in points]


def test_every_call_is_told_in_order_with_its_line(run: Run) -> None:
    calls = run(
        "(first)\nG21 G90 G17\nT3 M6\nS800 M3\nM8\nF200\nG0 X1 Y2 Z3\nG1 X4\nM0\nG4 P1.5\nM4 S900\nM7\nM9\nM5\n"
        "M49\nM48\nG95\nG94\nM62 P1\nM68 E2 Q3\n(MSG,look)\nM1\nG64 P0.1 Q0.2\nG61\nM101 P1 Q2\nM30\n"
    )
    told = [(c.line, c.kind, *c.values) for c in calls if c.kind not in {"comment", "message", "feedrate"}]
    first = told[: told.index((26, "pallet"))]
    assert first == [
        (2, "plane", 17.0), (2, "unit", 1.0), (3, "select", 3.0), (3, "m5", 0.0), (3, "change", 3.0),
        (4, "speed", 0.0, 800.0), (4, "m3", 0.0, 1.0), (5, "flood"), (7, "rapid"), (8, "feed"), (9, "m0"),
        (10, "dwell", 1.5), (11, "speed", 0.0, 900.0), (11, "m4", 0.0, 1.0), (12, "mist"), (13, "mistoff"),
        (13, "floodoff"), (14, "m5", 0.0), (15, "nofeedoverride"), (15, "nospeedoverride", 0.0),
        (16, "feedoverride"), (16, "speedoverride", 0.0), (17, "feedmode", 0.0, 1.0), (18, "feedmode", 0.0, 0.0),
        (19, "m62", 1.0), (20, "m68", 2.0, 3.0), (22, "m1"), (23, "path", 3.0, 0.1), (23, "naive", 0.2),
        (24, "path", 2.0, 0.0), (25, "user", 101.0, 1.0, 2.0), *first[31:],
    ]  # fmt: skip
    assert told[-1] == (26, "end")
    texts = [(c.line, c.kind, c.text) for c in calls if c.text and not c.text.startswith("interpreter")]
    assert texts == [(1, "comment", "first"), (21, "message", "look")]
    assert next(c.values for c in calls if c.kind == "feedrate") == (200.0, 200.0)


def test_offsets_make_machine_coordinates(run: Run) -> None:
    stored = Stored(
        origins={1: (10, 20, 30), 2: (1, 2, 3)},
        rotations={2: 90.0},
        lengths={7: 50.0},
        home28=(9, 8, 7, 0, 0, 0, 0, 0, 0),
    )
    calls = run(
        "G21\nG0 X0 Y0 Z0\nT7 M6\nG43\nG0 Z0\nG55 G0 X1 Y2 Z0\nG54 G49 G0 X0 Y0 Z0\nG92 X5\nG0 X5\nG0 X6\nG92.1\n"
        "G53 G0 Z-1\nG28\nM2\n",
        stored,
    )
    assert ends(calls) == close(
        (10, 20, 30), (10, 20, 80), (1 - 2, 2 + 1, 53), (10, 20, 30), (10, 20, 30), (11, 20, 30), (11, 20, -1),
        (11, 20, -1), (9, 8, 7),
    )  # fmt: skip


def test_inches(run: Run) -> None:
    calls = run("G20\nF10\nG1 X1 Y-2\nG21\nG1 X1 F10\nM2\n")
    assert ends(calls) == close((25.4, -50.8, 0), (1, -50.8, 0))
    assert [c.values for c in calls if c.kind == "feedrate"] == [(254.0, 10.0), (10.0, 10.0), (0.0, 0.0)]
    assert ends(run("G1 X1 F10\nM2\n", inch=True)) == close((25.4, 0, 0))


def test_where_it_stands_survives_a_change_of_unit_tool_and_system(run: Run) -> None:
    """The package's module answers these questions wrongly, which moved axes that no word named."""
    stored = Stored(origins={1: (10, 20, 30), 2: (-5, 7, 1)}, rotations={2: 30.0}, lengths={1: 40.0, 2: 60.0})
    calls = run("G21\nG0 X1 Y2 Z3\nG43 H1\nG20\nT2 M6\nG0 X1\nG43\nG0 Z1\nG55\nT1 M6\nG43\nG0 Z0\nM2\n", stored)
    assert ends(calls) == close((11, 22, 33), (35.4, 22, 33), (35.4, 22, 30 + 25.4 + 60), (35.4, 22, 1 + 40))


def test_path_mode_is_put_back_by_a_cycle(run: Run) -> None:
    calls = run("G21 G64 P0.05\nG0 Z5\nG81 X1 Y1 Z-1 R1 F100\nM2\n")
    assert [c.values for c in calls if c.kind == "path"] == [(3.0, 0.05), (2.0, 0.0), (3.0, 0.05)]


@pytest.mark.parametrize(
    ("plane", "words", "axes"),
    [("G17", "X10 Y10 I10 J0 Z1", (0, 1)), ("G18", "X10 Z10 I10 K0 Y1", (2, 0)), ("G19", "Y10 Z10 J10 K0 X1", (1, 2))],
)
def test_arcs_in_all_planes(run: Run, plane: str, words: str, axes: tuple[int, int]) -> None:
    stored = Stored(origins={1: (5, 6, 7)}, rotations={1: 25.0})
    start, arc, back = (
        c
        for c in run(f"G21 {plane}\nG0 X0 Y0 Z0\nG2 {words} F100\nG3 X0 Y0 Z0 R20\nM2\n", stored)
        if c.kind in {"rapid", "arc"}
    )
    assert arc.arc is not None
    assert back.arc is not None
    assert (arc.arc.plane, arc.arc.turns, back.arc.turns) == (int(plane[1:]), -1, 1)
    first, second, third = rs274.PLANE_AXES[arc.arc.plane]
    assert {first, second} == set(axes)
    assert (arc.arc.centre[first], arc.arc.centre[second]) == pytest.approx((10, 0) if plane != "G18" else (0, 10))
    assert arc.arc.centre[third] == pytest.approx(1.0)  # that of the end
    assert math.dist(arc.machine[:3], arc.arc.machine_centre) == pytest.approx(10.0)
    assert math.dist(start.machine[:3], arc.arc.machine_centre) == pytest.approx(math.hypot(10.0, 1.0))
    assert math.dist(arc.machine[:3], back.arc.machine_centre) == pytest.approx(math.hypot(20.0, 1.0))


def test_turns_curves_threads_and_taps(run: Run) -> None:
    calls = run(
        "G21 G17 F100\nG0 X0 Y0 Z0\nG3 X0 Y0 I5 J0 P3\nG5.1 X10 Y0 I5 J5\nG5 X20 Y0 I1 J1 P-1 Q1\nS100 M3\n"
        "G33 Z-5 K1.5\nG33.1 Z-7 K2\nG20\nG33.1 Z-1 K0.1\nM2\n"
    )
    assert [c.arc.turns for c in calls if c.arc] == [3]
    curves = [c.values for c in calls if c.kind == "curve"]
    assert curves == close((3, 0, 0, 1, 5, 5, 1, 10, 0, 1), (4, 10, 0, 1, 11, 1, 1, 19, 1, 1, 20, 0, 1))
    told = [(c.kind, *c.values[:2]) for c in calls if c.kind in {"sync", "unsync", "tap"}]
    assert [t[0] for t in told] == ["sync", "unsync", "sync", "tap", "unsync", "sync", "tap", "unsync"]
    assert [c.values[1] for c in calls if c.kind == "sync"] == pytest.approx([1.5, 2.0, 2.54])
    assert [c.values for c in calls if c.kind == "tap"] == close((20, 0, -7, 1), (20, 0, -25.4, 1))


def test_subprograms_in_other_files(run: Run, tmp_path: Path) -> None:
    (tmp_path / "beside.ngc").write_text("o<beside> sub\nG0 X#1\no<beside> endsub\nM2\n", encoding="ascii")
    folder = tmp_path / "subs"
    folder.mkdir()
    (folder / "far.ngc").write_text("o<far> sub\n\nG0 Y[#1/0]\no<far> endsub\nM2\n", encoding="ascii")
    calls = run("G21\no<beside> call [4]\nG0 Z1\nM2\n")
    assert [(c.line, c.file) for c in calls if c.kind == "rapid"] == [(2, "beside.ngc"), (3, "")]
    with pytest.raises(ProgramError, match=r"line 1: .*refuses the program: o<far> was not found: .*\(--subroutines\)"):
        run("o<far> call [1]\nM2\n")
    with pytest.raises(ProgramError, match="line 1: the interpreter refuses the program: Attempt to divide by zero"):
        run("o<far> call [1]\nM2\n", subroutines=[folder])
    with pytest.raises(InputError, match="9 folders of subprograms"):
        run("M2\n", subroutines=[folder] * 9)


def test_block_delete_and_task(run: Run) -> None:
    text = "G21\n/G0 X1\nG0 X[#<_task> + 5]\nM2\n"
    assert ends(run(text)) == close((1, 0, 0), (5, 0, 0))
    assert ends(run(text, block_delete=True, task=True)) == close((6, 0, 0))


def test_start_and_parameters(run: Run) -> None:
    left: dict[int, float] = {}
    stored = Stored(start=(1, 2, 3), active_length=4.0, parameters={100: 7.5}, shift=(1, 0, 0), origins={1: (10, 0, 0)})
    calls = run("G21 G91\nG0 Z-1\nG90 G0 X#100\nG10 L2 P3 X12\nM2\n", stored, left=left)
    assert ends(calls) == close((1, 2, 2), (18.5, 2, 2))
    assert (left[5261], left[5221], left[5211]) == (12.0, 10.0, 1.0)


@pytest.mark.parametrize(
    ("text", "line", "reason"),
    [
        ("G21\nG1 X1\nM2\n", 2, "zero feed"),
        ("G21\nG0 X1\nG99999\nM2\n", 3, "G-code out of range"),
        ("G21\nG0 X1\n", 2, "ended with no percent sign"),
        ("G21\nG0 X[1\nM2\n", 2, "Unclosed expression"),
        ("G21\nT5000 M6\nM2\n", 2, "tool"),
    ],
)
def test_refused_with_line_and_words(run: Run, text: str, line: int, reason: str) -> None:
    with pytest.raises(ProgramError, match=rf"line {line}: the interpreter refuses the program: .*{reason}"):
        run(text)


def test_an_endless_loop_ends(run: Run) -> None:
    # whatever is reached first
    with pytest.raises(ProgramError, match=r"takes more than 1 s to interpret|seems to have no end"):
        run("G21\n#1 = 1\no1 while [#1 GT 0]\nG0 X#1\no1 endwhile\nM2\n", seconds=1)


def test_a_loop_that_does_nothing_ends_before_its_time(run: Run) -> None:
    with pytest.raises(ProgramError, match=r"line 3: .* 300,000 lines without a move"):
        run("G21\nG0 X1\no1 while [1]\n#1 = 1\no1 endwhile\nM2\n", seconds=200)


def test_a_crash_is_an_error(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    child = tmp_path / "crash.py"
    told = "RECORD.pack(RAPID, 9, 7, *(0.0,) * 10)"
    child.write_text(f"{TELLS}tell({told})\nos.kill(os.getpid(), 11)\n", encoding="ascii")
    monkeypatch.setattr(rs274process, "CHILD", child)
    with pytest.raises(ProgramError, match="line 7: the interpreter was ended by signal 11"):
        run("M2\n")
    child.write_text("raise RuntimeError('of a version that is not known')\n", encoding="ascii")
    with pytest.raises(InputError, match="ended with code 1: RuntimeError: of a version that is not known"):
        run("M2\n")


def test_the_child_dies_with_the_reader(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[subprocess.Popen[str]] = []
    popen = subprocess.Popen

    def start(*arguments: Any, **options: Any) -> Any:
        started.append(popen(*arguments, **options))
        return started[-1]

    monkeypatch.setattr(subprocess, "Popen", start)
    path = tmp_path / "long.ngc"
    path.write_text("G21\n#1 = 0\no1 while [1]\nG0 X#1\n#1 = [#1 + 1]\no1 endwhile\nM2\n", encoding="ascii")
    calls = read(path)
    assert next(calls).line == 0
    assert started[0].poll() is None
    calls.close()
    assert started[0].poll() == -9


def test_why_it_cannot_be_used(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    assert rs274.find_obstacle() is None
    monkeypatch.setattr(rs274process, "PYTHON", tmp_path / "python3")
    assert "install the Debian package linuxcnc-uspace" in str(rs274.find_obstacle.__wrapped__())
    (tmp_path / "python3").symlink_to("/usr/bin/false")
    assert "cannot import gcode" in str(rs274.find_obstacle.__wrapped__())
    monkeypatch.setattr(rs274process, "PYTHON", Path("/usr/bin/python3"))
    child = tmp_path / "mute.py"
    rows = "RECORD.pack(RAPID, 9, 7, *(0.0,) * 10), RECORD.pack(CODES['done'], 0, 0, *(0.0,) * 10)"
    end = "os.write(1, struct.pack('<II', 0, 3) + b'[0]')"
    child.write_text(f"{TELLS}tell({rows})\n{end}\n", encoding="ascii")
    monkeypatch.setattr(rs274process, "CHILD", child)
    assert "does not report end, m3, m5, speed" in str(rs274.find_obstacle.__wrapped__())


def test_no_such_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none.ngc is not a file"):
        list(read(tmp_path / "none.ngc"))


coordinate = st.floats(-1000, 1000)
place = st.tuples(*[coordinate] * 9)


@given(place, place, place, place, st.floats(-360, 360))
def test_frame_there_and_back(origin: Any, shift: Any, length: Any, point: Any, angle: float) -> None:
    frame = ProgramFrame()
    for kind, values in (("g5x", (2.0, *origin)), ("g92", shift), ("length", length), ("rotation", (angle,))):
        frame.take(kind, values)
    assert frame.system == 2
    assert frame.program(frame.machine(point)) == pytest.approx(point, abs=1e-9)


def test_a_tool_the_program_stores_is_what_m6_and_g43_take(tmp_path: Path) -> None:
    path = tmp_path / "p.ngc"
    path.write_text("G21 G49\nT1 M6\nG10 L1 P5 Z10\nG10 L1 P1 Z20\nG43\nT5 M6\nG43\nM2\n", encoding="ascii")
    calls = read(path, Stored(lengths=dict.fromkeys(range(1, 9), 100.0)))
    assert [c.values[2] for c in calls if c.kind == "length" and c.line > 1] == [20.0, 10.0]


@pytest.mark.parametrize("head", ["", "G21\n", "G21\n\nG1 X1 F5\n", "%\n"])
def test_what_cannot_be_read_is_told_with_its_line(tmp_path: Path, head: str) -> None:
    path = tmp_path / "p.ngc"
    path.write_text(f"{head}G0 X\nG0 X5\nM2\n", encoding="ascii")
    with pytest.raises(ProgramError, match="No characters found") as caught:
        list(read(path))
    assert caught.value.line == head.count("\n") + 1


def test_comments_of_any_bytes_are_read(run: Run, tmp_path: Path) -> None:
    """The interpreter's module cannot tell of a comment that is not ASCII, in the program or in a subprogram."""
    (tmp_path / "far.ngc").write_bytes("o<far> sub\n(Fräser 6 mm)\nG0 Y1\no<far> endsub\nM2\n".encode("latin-1"))
    calls = run("G21\n(ge\xe4ndert \xb5m)\n(MSG,\xe4)\nG0 X1\no<far> call\nM2\n")
    assert [c.text for c in calls if c.kind in ("comment", "message")][:2] == ["ge?ndert ?m", "?"]
    assert [(c.line, c.kind) for c in calls if c.kind == "rapid"] == [(4, "rapid"), (3, "rapid")]
    with pytest.raises(ProgramError, match="line 2: the interpreter refuses the program"):
        run("G21\nG0 X1\xe4\nM2\n")
    with pytest.raises(ProgramError, match=r"line 2: the interpreter refuses the program: .*o<fr\?sen>"):
        run("G21\no<fr\xe4sen> call\nM2\n")


def test_nothing_beside_a_program_is_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mark = tmp_path / "mark"
    made = f"open({str(mark)!r}, 'w')\n"
    for name in ("gcode", "json", "ctypes", "sitecustomize", "usercustomize", "_rs274_hooks", "oword", "remap"):
        (tmp_path / f"{name}.py").write_text(made, encoding="ascii")
    user = tmp_path / "M101"
    user.write_text(f"#!/bin/sh\ntouch {mark}\n", encoding="ascii")
    user.chmod(0o755)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setenv("PYTHONSTARTUP", str(tmp_path / "gcode.py"))
    path = tmp_path / "p.ngc"
    path.write_text("G21\nM101\nG0 X1\n(LOGOPEN,mark)\n(LOG,x)\n(PROBEOPEN mark)\nM2\n", encoding="ascii")
    assert rs274.find_obstacle.__wrapped__() is None
    assert [c.kind for c in read(path) if c.kind in ("user", "rapid")] == ["user", "rapid"]
    assert not mark.exists()
    assert {f.name for f in tmp_path.iterdir()} == {
        "M101", "p.ngc", "gcode.py", "json.py", "ctypes.py", "sitecustomize.py", "usercustomize.py", "_rs274_hooks.py",
        "oword.py", "remap.py",
    }  # fmt: skip


@pytest.mark.parametrize("comment", [";py,open({!r}, 'w')", "(py,open{{{!r}}})", "(PY,import os)"])
def test_python_in_a_comment_is_not_run(run: Run, tmp_path: Path, comment: str) -> None:
    mark = tmp_path / "mark"
    with pytest.raises(
        ProgramError, match=r"line 3: the interpreter refuses the program: it contains Python code \(py, ...\)"
    ):
        run(f"G21\nG0 X1\n{comment.format(str(mark))}\nG0 X2\nM2\n")
    assert not mark.exists()


def test_states_of_one_program_are_run_by_one_child(tmp_path: Path) -> None:
    path = tmp_path / "p.ngc"
    path.write_text("G21\nG54 G0 X1\n#5221 = 7\nM2\n", encoding="ascii")
    jobs = [rs274process.InterpreterJob(path, Stored(origins={1: (x,)})) for x in (1.0, 2.0)]
    with rs274process.InterpreterRun(*jobs) as running:
        for _ in jobs:
            kinds = [code for block in running.blocks() for code in block.records["kind"].tolist()]
            assert kinds[-1] == running.codes["done"]
            assert running.left()[5221] == 7.0
            assert running.opened() == {path}
        ends = [c.machine[0] for x in (1.0, 2.0) for c in read(path, jobs[int(x) - 1].stored) if c.kind == "rapid"]
    assert ends == pytest.approx([2.0, 3.0])
