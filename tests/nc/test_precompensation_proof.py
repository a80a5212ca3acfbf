"""What LinuxCNC's interpreter says of a revised program: the law holds, or the line where it does not."""

from array import array
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest

from thermocomp.core.exceptions import InputError, ProgramError
from thermocomp.nc.interpreter.block import Block, Modal, Setup
from thermocomp.nc.linuxcnc import rs274
from thermocomp.nc.linuxcnc.verification.states import build_stored
from thermocomp.nc.linuxcnc.verification.verify import Ledger, prove
from thermocomp.nc.parser.line import Line
from thermocomp.nc.rewrite.revise import Revised

Vector = tuple[float, float, float]
NONE: Vector = (0.0, 0.0, 0.0)

interpreter = pytest.mark.usefixtures("interpreter")


#: nothing is stored that turns or shifts X and Y
PLAIN = Setup(inch=False, rotations=dict.fromkeys(range(1, 10), 0.0), no_shift=True)


def ledger(
    rows: Sequence[tuple[Vector, Vector]],
    *,
    inverse: Sequence[int] = (),
    machine: Sequence[int] = (),
    header: int = 0,
    texts: Mapping[int, int] | None = None,
    knots: Mapping[int, tuple[Vector, ...]] | None = None,
    placed: bool = True,
    others: Mapping[int, Vector] | None = None,
) -> Ledger:
    """Return what lines 1, 2, ... carry at their end, or may carry instead, and on the way; and how many they are."""
    made = Ledger()
    if header:
        made.take(Revised(0, "", ("",) * header, None, 0.0, 0.0, NONE, NONE, NONE))
    for number, (after, inner) in enumerate(rows, start=1):
        modal = Modal(feed_mode=93 if number in inverse else 94)
        written = ("",) * (texts or {}).get(number, 1)
        block = Block(Line(number, ""), modal, kind="machine" if number in machine else "none")
        inside = (knots or {}).get(number, ())
        other = (others or {}).get(number)
        made.take(
            Revised(number, "", written, block, 0.0, 0.0, NONE, after, inner, other=other, placed=placed, knots=inside)
        )
    return made


def allowed(made: Ledger, line: int) -> tuple[Vector, Vector, Vector, bool]:
    """Return what a line carries before, at its end and inside, and whether F is its time."""
    before, after, inner, inverse = (row[0].tolist() for row in made.of(np.array([line]))[:4])
    return tuple(before), tuple(after), tuple(inner), inverse


def test_a_ledger_is_kept_short() -> None:
    made = ledger(
        [(NONE, NONE)] * 5 + [((1.0, 0.0, 0.0), NONE)] * 2 + [((1.0, 0.0, 2.0), (0.0, 0.0, 3.0))], inverse=[8]
    )
    assert allowed(made, 0) == (NONE, NONE, NONE, False)
    assert allowed(made, 1) == allowed(made, 5) == (NONE, NONE, NONE, False)
    assert allowed(made, 6) == (NONE, (1.0, 0.0, 0.0), NONE, False)
    assert allowed(made, 7) == ((1.0, 0.0, 0.0), (1.0, 0.0, 0.0), NONE, False)
    assert allowed(made, 8) == ((1.0, 0.0, 0.0), (1.0, 0.0, 2.0), (0.0, 0.0, 3.0), True)
    assert allowed(made, 9) == ((1.0, 0.0, 2.0), (1.0, 0.0, 2.0), (0.0, 0.0, 3.0), True)
    assert len(made._carried.lines) == 2
    assert made.originals(np.arange(1, 9)).tolist() == list(range(1, 9))


def test_a_ledger_knows_where_lines_come_from() -> None:
    made = ledger([shift()] * 6, header=2, texts={2: 3, 4: 0})
    #                                         header   1  2        3  5  6  and beyond
    assert made.originals(np.arange(1, 11)).tolist() == [0, 0, 1, 2, 2, 2, 3, 5, 6, 7]
    after_percent = Ledger()
    for number, count in ((1, 1), (0, 2), (2, 2), (3, 1)):
        block = Block(Line(number, ""), Modal()) if number else None
        after_percent.take(Revised(number, "", ("",) * count, block, 0.0, 0.0, NONE, NONE, NONE))
    assert after_percent.originals(np.arange(1, 7)).tolist() == [1, 1, 1, 2, 2, 3]


def test_a_ramp_takes_little_room() -> None:
    made = Ledger()
    for number in range(1, 2001):
        carried = (0.0, 0.0, 0.01 * number)
        made.take(Revised(number, "", ("",), Block(Line(number, ""), Modal()), 0.0, 0.0, NONE, carried, carried))
    arrays = [a for t in vars(made).values() for a in ((t.lines, t.numbers) if hasattr(t, "lines") else (t,))]
    assert sum(a.itemsize * len(a) for a in arrays if isinstance(a, array)) <= 30 * 2000


def test_what_stands_at_the_controller() -> None:
    setup = Setup(offsets={1: (1.0, 2.0, 3.0), 103: (9.0, 9.0, 9.0)}, tools={4: 120.0}, home=(0.0, 0.0, 400.0))
    given = build_stored(setup)
    assert given.origins == {1: (1.0, 2.0, 3.0)}
    assert given.lengths == {4: 120.0}
    assert given.home28 == (0.0, 0.0, 400.0)


def shift(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> tuple[Vector, Vector]:
    return (x, y, z), (x, y, z)


def write(folder: Path, original: str, revised: str) -> tuple[Path, Path]:
    paths = folder / "original.ngc", folder / "revised.ngc"
    for path, text in zip(paths, (original, revised), strict=True):
        path.write_text(text, encoding="ascii")
    return paths


GOOD = {
    "lines": (
        "G21\nG0 X1\nG1 Y2 F100\nZ3\nM2\n",
        "(THERMOCOMP 0)\nG21\nG0 X1.01\nG1 Y2 F100\nZ2.98\nM2\n",
        [shift(), shift(10), shift(10), shift(10, 0, -20)],
        3,
    ),
    "inch and G91": (
        "G20 G91\nG0 X1\nX1\nM2\n",
        "G20 G91\nG0 X1\nX1.0005\nM2\n",
        [shift(), shift(), shift(12.7)],
        2,
    ),
    "arc and its centre": (
        "G21 G17\nG0 X10 Y0\nG2 X0 Y-10 I-10 J0 F50\nM2\n",
        "G21 G17\nG0 X10.02 Y0.03\nG2 X0.02 Y-9.97 I-10 J0 F50\nM2\n",
        [shift(), shift(20, 30), shift(20, 30)],
        2,
    ),
    "cycle": (
        "G21 G98\nG0 X0 Y0 Z10\nG81 X5 Z-3 R2 F50\nM2\n",
        "G21 G98\nG0 X0 Y0 Z10\nG81 X5.01 Z-3.02 R1.98 F50\nM2\n",
        [shift(), shift(), ((10.0, 0.0, 0.0), (10.0, 0.0, -20.0))],
        5,
    ),
    "offset": (
        "G21\nG0 X1 Z5\nG1 Z1 F100\nM2\n",
        "G21\nG52 Z-0.02\nG0 X1 Z5\nG1 Z1 F100\nM2\n",
        [shift(), shift(0, 0, -20), shift(0, 0, -20)],
        2,
    ),
    "a place that gets another name": (
        "G21\nG0 X1\nG92 X5\nG0 X6\nM2\n",
        "G21\nG0 X1.01\nG92 X5.01\nG0 X6.02\nM2\n",
        [shift(), shift(10), shift(10), shift(20)],
        2,
    ),
    "inverse time": (
        "G21\nG93\nG1 X1 F2\nM2\n",
        "G21\nG93\nG1 X1.5 F2\nM2\n",
        [shift(), shift(), shift(500)],
        1,
    ),
    "curve": (
        "G21\nG0 X0 Y0\nG5 X10 Y10 I5 J0 P0 Q-5 F100\nM2\n",
        "G21\nG0 X0.01 Y0.02\nG5 X10.01 Y10.02 I5 J0 P0 Q-5 F100\nM2\n",
        [shift(), shift(10, 20), shift(10, 20)],
        2,
    ),
    "tap": (
        "G21\nS100 M3\nG0 X0 Y0 Z5\nG33.1 Z-5 K1\nM2\n",
        "G21\nS100 M3\nG0 X0 Y0 Z5.01\nG33.1 Z-4.99 K1\nM2\n",
        [shift(), shift(), shift(0, 0, 10), shift(0, 0, 10)],
        2,
    ),
}


def written(name: str, shifts: Sequence[tuple[Vector, Vector]]) -> Ledger:
    """Return the ledger of one of them."""
    texts = {2: 2} if name == "offset" else {}
    return ledger(shifts, inverse=[3] if name == "inverse time" else [], header=int(name == "lines"), texts=texts)


@interpreter
@pytest.mark.parametrize("name", GOOD)
def test_the_law_holds(tmp_path: Path, name: str) -> None:
    original, revised, shifts, moves = GOOD[name]
    lines: list[int] = []
    proof = prove(*write(tmp_path, original, revised), written(name, shifts), PLAIN, lines.append)
    assert proof.moves == moves
    assert proof.largest < 1e-6
    assert proof.states == 8
    assert proof.slower <= 2.0
    assert lines == sorted(lines)
    assert max(lines) == len(shifts)


@interpreter
@pytest.mark.parametrize("name", GOOD)
def test_the_law_does_not_hold_without_its_shifts(tmp_path: Path, name: str) -> None:
    original, revised, shifts, _ = GOOD[name]
    with pytest.raises(ProgramError, match="LinuxCNC's interpreter disagrees"):
        prove(*write(tmp_path, original, revised), written(name, [shift()] * len(shifts)), PLAIN)


AT = "G21 G0 X0 Y0 Z0 A0\n"


@interpreter
@pytest.mark.parametrize(
    ("original", "revised", "line", "message"),
    [
        ("G21\nG0 X1\nM2\n", "G21\nG0 X1.00021\nM2\n", 2, r"moves X by 0\.21 um instead of 0\.00 um"),
        ("G21\nG0 X1\nM2\n", "G21\nG1 X1 F9\nM2\n", 2, "makes a 'feedrate' instead of a 'rapid'"),
        ("G21\nG1 X1 F8\nM2\n", "G21\nG1 X1 F9\nM2\n", 2, "gives 'feedrate'"),
        ("G21 M3 S5\nG0 X1\nM2\n", "G21 M3 S6\nG0 X1\nM2\n", 1, r"gives 'speed' 0 6 instead of 0 5"),
        ("G21\nG0 X1\nM2\n", "G21\nG0 X1\nG0 X1\nM2\n", 3, "makes a 'rapid' instead of"),
        ("G21\nG4 P1\nM2\n", "G21\nG4 P2\nM2\n", 2, "gives 'dwell'"),
        ("%\nG21\nG0 X1\nG0 X2\n%\n", "%\nG21\nG0 X1\n%\n", 4, "only the original|instead of"),
        ("%\nG21\nG0 X1\n%\n", "%\nG21\nG0 X1\nG0 X2\n%\n", 4, "only the revised program|instead of"),
        (f"{AT}S9 M3\nG33.1 Z-5 K1\nM2\n", f"{AT}S9 M3\nG33.1 Z-5.01 K1\nM2\n", 3, "makes another tap"),
        (f"{AT}G5 X9 Y9 I5 J0 P0 Q-5 F9\nM2\n", f"{AT}G5 X9 Y9 I5.01 J0 P0 Q-5 F9\nM2\n", 2, "makes another curve"),
        ("G21\nG0 A1\nM2\n", "G21\nG0 A2\nM2\n", 2, "moves an axis other than"),
        (f"{AT}G2 X2 I1 F9\nM2\n", f"{AT}G3 X2 I1 F9\nM2\n", 2, "turns another way"),
        (f"{AT}G2 X2 R2 F9\nM2\n", f"{AT}G2 X2 R2.1 F9\nM2\n", 2, r"moves Y of an arc's centre by -?\d+"),
    ],
)
def test_what_is_not_the_same_is_found(tmp_path: Path, original: str, revised: str, line: int, message: str) -> None:
    with pytest.raises(ProgramError, match=message) as found:
        prove(*write(tmp_path, original, revised), ledger([shift()] * 3), PLAIN)
    assert found.value.line == line


@interpreter
def test_a_move_is_judged_at_the_end_of_its_line(tmp_path: Path) -> None:
    """Inside a cycle an axis may carry what it carries on the way; at its end it may not."""
    original, revised, shifts, _ = GOOD["cycle"]
    wrong = [*shifts[:2], shift(10, 0, -20)]
    with pytest.raises(ProgramError, match=r"line 3: .* moves Z by 0\.00 um instead of -20\.00 um"):
        prove(*write(tmp_path, original, revised), ledger(wrong), PLAIN)


@interpreter
def test_an_original_that_is_not_run_proves_nothing(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="does not run the original: line") as found:
        prove(*write(tmp_path, "G21\nG0 X\nM2\n", "G21\nG0 X\nM2\n"), ledger([shift()] * 3), PLAIN)
    assert not isinstance(found.value, ProgramError)
    with pytest.raises(ProgramError, match="the revised program does not run"):
        prove(*write(tmp_path, "G21\nG0 X1\nM2\n", "G21\nG0 X\nM2\n"), ledger([shift()] * 3), PLAIN)


def test_without_the_interpreter_nothing_is_proved(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rs274, "find_obstacle", lambda: "it is not here")
    with pytest.raises(InputError, match="it is not here"):
        prove(*write(tmp_path, "M2\n", "M2\n"), Ledger(), Setup())
