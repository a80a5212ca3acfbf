"""Programs for a Fanuc as posts and hands write them: most are revised, and each of these is judged by LinuxCNC."""

import random
from itertools import groupby, pairwise
from pathlib import Path
from typing import NamedTuple

import pytest
from nc_law import Growing

from thermocomp.core.exceptions import ProgramError
from thermocomp.nc.expansion.unroll import unroll
from thermocomp.nc.interpreter.block import Setup
from thermocomp.nc.linuxcnc import rs274
from thermocomp.nc.linuxcnc.verification.translation import Translator
from thermocomp.nc.linuxcnc.verification.verify import Ledger
from thermocomp.nc.parser.tokens import split_lines
from thermocomp.nc.planner.timeline import MotionLimits
from thermocomp.nc.rewrite.coordinates import Coordinates
from thermocomp.nc.rewrite.demand import Demand
from thermocomp.nc.rewrite.method import CorrectionMethod
from thermocomp.nc.rewrite.offset import Offset
from thermocomp.nc.rewrite.revise import Revised, Revision
from thermocomp.nc.rewrite.text import DIGITS, Vector

PROGRAMS = sorted((Path(__file__).parents[1] / "nc" / "fanuc").glob("*.nc"))
KINDS = ("drilling", "pocket", "subprogram", "macro", "g68", "home")
SETUP = Setup("fanuc", speed=3000.0, integers="refuse", no_shift=True)
#: what is refused, and why
REFUSED = {"g68_6_incremental.nc": "G68 in G91", "macro_6_stored.nc": "#500 is unknown"}


class Trial(NamedTuple):
    original: Path
    revised: Path
    rows: list[Revised]
    ledger: Ledger


def method(way: str) -> CorrectionMethod:
    digits = DIGITS["fanuc"]
    return Coordinates(digits, 1.0, helix=False) if way == "coordinates" else Offset(digits, 1.0, safe_z=5.0)


def revise(path: Path, folder: Path, way: str) -> Trial:
    """Write a program out and revise it by a drift that grows fast; `ProgramError` if it is refused."""
    lines = [text for text, _ in unroll(split_lines(path.read_text("ascii")), SETUP)]
    drift = Growing(rate=(0.3, -0.2, 0.6), slope=0.0)
    run = Revision(SETUP, MotionLimits(), drift, method(way), Demand(1.0, None))
    ledger, rows = Ledger(), []
    for row in run.revise(lines):
        ledger.take(row)
        rows.append(row)
    if not run.changed:
        raise ProgramError(1, "nothing was corrected")
    original, revised = folder / "original.nc", folder / "revised.nc"
    original.write_text("".join(lines), "ascii")
    revised.write_text("".join(t for row in rows for t in row.texts), "ascii")
    return Trial(original, revised, rows, ledger)


def test_there_are_six_of_each_kind() -> None:
    assert [sum(path.name.startswith(kind) for path in PROGRAMS) for kind in KINDS] == [6] * 6
    assert all(20 <= len(path.read_text("ascii").splitlines()) <= 80 for path in PROGRAMS)


@pytest.mark.parametrize(("way", "least"), [("coordinates", 0.9), ("offset", 0.8)])
def test_most_are_revised(way: str, least: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    told = {}
    for path in PROGRAMS:
        try:
            revise(path, tmp_path, way)
            told[path.name] = "revised"
        except ProgramError as error:
            told[path.name] = str(error)
    assert not any("please report" in what for what in told.values())
    with capsys.disabled():
        print("", *(f"{way} {name}: {what}" for name, what in told.items() if what != "revised"), sep="\n")
    assert sum(what == "revised" for what in told.values()) >= least * len(PROGRAMS)
    if way == "coordinates":
        assert {name for name, what in told.items() if what != "revised"} == REFUSED.keys()
        assert all(reason in told[name] for name, reason in REFUSED.items())


def moves(path: Path, stored: rs274.Stored) -> list[tuple[int, Vector]]:
    """Return the moves of a translated program, each with its line of the program."""
    translator = Translator(SETUP)
    told = list(translator.translate(split_lines(path.read_text("ascii"))))
    out = path.with_suffix(".ngc")
    out.write_text("".join(text for text, _ in told), "ascii")
    calls = rs274.read(out, stored, inch=bool(translator.setup().inch))
    return [(told[c.line - 1][1], c.machine[:3]) for c in calls if c.line and c.kind in ("rapid", "feed", "arc", "tap")]


def some_controller(seed: int) -> rs274.Stored:
    chance = random.Random(seed)

    def place() -> tuple[float, ...]:
        return tuple(chance.uniform(-300, 300) for _ in range(6))

    return rs274.Stored(
        origins={n: place() for n in range(1, 10)},
        lengths={n: chance.uniform(20, 200) for n in range(1, 100)},
        home28=place(),
        home30=place(),
        startup=f"G64 G9{8 + seed % 2}",
        start=place(),
    )


@pytest.mark.usefixtures("interpreter")
@pytest.mark.parametrize("way", ["coordinates", "offset"])
@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: path.stem)
def test_linuxcnc_moves_by_what_was_asked_for(path: Path, way: str, tmp_path: Path) -> None:
    try:
        trial = revise(path, tmp_path, way)
    except ProgramError as error:
        assert way == "offset" or path.name in REFUSED, error  # noqa: PT017
        return
    numbers = [row.number for row in trial.rows for _ in row.texts]  # line of the original, for each that was written
    carried = {row.number: row for row in trial.rows if row.number}
    before = {b.number: a.carried for a, b in pairwise(row for row in trial.rows if row.number)}
    for seed in (1, 2):
        stored = some_controller(seed)
        original = moves(trial.original, stored)
        revised = [(numbers[line - 1], end) for line, end in moves(trial.revised, stored)]
        assert [line for line, _ in original] == [line for line, _ in revised]
        assert len(original) > 8
        pairs = zip(original, revised, strict=True)
        for line, group in groupby(pairs, key=lambda pair: pair[0][0]):
            shifts = [[(b - a) * 1e3 for a, b in zip(was, now, strict=True)] for (_, was), (_, now) in group]
            row = carried[line]
            assert shifts[-1] == pytest.approx(row.carried, abs=0.1), row.text
            for shift in shifts[:-1]:
                for axis in range(3):
                    allowed = (row.carried[axis], row.inner[axis], before.get(line, row.carried)[axis])
                    assert any(abs(shift[axis] - a) < 0.1 for a in allowed), row.text
