"""The ways through the house are those that its page tells: the calls happen, in that order."""

import re
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from itertools import groupby
from pathlib import Path
from types import CodeType, FrameType
from typing import Any, NamedTuple

import pytest
from driftmodels import growing
from reviseruns import PLATE
from smallmachine import small_machine

import thermocomp
from thermocomp.cli.app import run
from thermocomp.core.reading import Reading
from thermocomp.recordings.readers import recordings
from thermocomp.runtime.compensator import Compensator

PAGE = Path(__file__).parents[2] / "docs" / "house.rst"
PACKAGE = Path(thermocomp.__file__).parent


class Call(NamedTuple):
    """A call on the page, and the one of the page inside which it happens."""

    file: str
    function: str
    inside: tuple[str, str] | None

    @property
    def room(self) -> str:
        return self.file.partition("/")[0]


def told(title: str) -> list[Call]:
    """Return the calls of a way, as the page lists them: what is set in happens inside the call above it."""
    _, text = PAGE.read_text(encoding="utf-8").split(f"\n{title}\n{'-' * len(title)}\n")
    block = text.split(".. code-block:: text\n\n")[1].split("\n\n")[0]
    above: list[tuple[int, Call]] = []
    found = []
    for blanks, file, name in re.findall(r"^   ( *)(\S+\.py) +(\S+)", block, re.MULTILINE):
        while above and above[-1][0] >= len(blanks):
            above.pop()
        call = Call(file, name, above[-1][1][:2] if above else None)
        above.append((len(blanks), call))
        found.append(call)
    return found


@contextmanager
def traced(wanted: Sequence[Call]) -> Iterator[list[Call]]:
    """Note the calls of the page as they happen for the first time, and inside which other."""
    known = {call[:2] for call in wanted}
    found: dict[tuple[str, str], Call] = {}

    @cache  # the profiler asks for every call of every library
    def listed(code: CodeType) -> tuple[str, str] | None:
        path = Path(code.co_filename)
        name = (str(path.relative_to(PACKAGE)), code.co_qualname) if path.is_relative_to(PACKAGE) else None
        return name if name in known else None

    def note(frame: FrameType, event: str, _: Any) -> None:
        if event == "call" and (name := listed(frame.f_code)) and name not in found:
            above = frame.f_back
            while above and not listed(above.f_code):
                above = above.f_back
            found[name] = Call(*name, listed(above.f_code) if above else None)

    before = sys.getprofile()
    called: list[Call] = []
    sys.setprofile(note)
    try:
        yield called
    finally:
        sys.setprofile(before)
        called += found.values()


def compared(folder: Path) -> None:
    recordings.write(small_machine(dt=200.0), folder / "drift.csv")
    assert run(["compare", str(folder / "drift.csv"), "--target", "z_um", "--models", "ols", "--jobs", "1"]) in (0, 1)


def revised(folder: Path) -> None:
    (folder / "part.ngc").write_text(PLATE, encoding="ascii")
    words = ["--model", str(folder / "model.json"), "--cold", "-o", str(folder / "out.ngc"), "--tolerance", "0.1 um"]
    assert run(["revise", str(folder / "part.ngc"), *words, "--controller", "linuxcnc"]) == 0


def compensated(_: Path) -> None:
    compensator = Compensator.of([growing("z_um", 3.0)])
    state = compensator.start()
    for time, temperature in ((0.0, 20.0), (10.0, 21.0), (20.0, 22.0)):
        state, said = compensator.step(state, Reading(time, {"t": temperature}), time)
    assert said.corrections["z_um"].offset < 0


@pytest.mark.usefixtures("interpreter")
@pytest.mark.parametrize(
    ("title", "way"), [("One reading", compensated), ("One CSV", compared), ("One NC line", revised)]
)
def test_the_calls_happen_in_the_order_of_the_page(title: str, way: Callable[[Path], None], job_folder: Path) -> None:
    wanted = told(title)
    with traced(wanted) as called:
        way(job_folder)
    assert len(wanted) > 5
    assert called == wanted


@pytest.mark.parametrize("title", ["One reading", "One CSV", "One NC line"])
def test_no_call_goes_to_a_room_twice(title: str) -> None:
    wanted = told(title)
    for caller in dict.fromkeys(call.inside for call in wanted):
        home = caller[0].partition("/")[0] if caller else ""
        entered = Counter(r for r, _ in groupby(c.room for c in wanted if c.inside == caller and c.room != home))
        assert {room: n for room, n in entered.items() if n > 1} == {}, caller
