"""The ways through the house are those that its page tells: the calls happen, in that order."""

import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

import pytest
from driftmodels import growing
from reviseruns import PLATE
from smallmachine import small_machine

import thermocomp
from thermocomp.cli.app import run
from thermocomp.core.reading import Reading
from thermocomp.files import recordings
from thermocomp.runtime.compensator import Compensator

PAGE = Path(__file__).parents[2] / "docs" / "house.rst"
PACKAGE = Path(thermocomp.__file__).parent


def told(title: str) -> list[tuple[str, str]]:
    """Return file and function of each call of a way, as the page lists them."""
    _, text = PAGE.read_text(encoding="utf-8").split(f"\n{title}\n{'-' * len(title)}\n")
    block = text.split(".. code-block:: text\n\n")[1].split("\n\n")[0]
    return [(file, name) for file, name in re.findall(r"^   (\S+\.py) +(\S+)", block, re.MULTILINE)]


@contextmanager
def traced() -> Iterator[list[tuple[str, str]]]:
    """Note which functions of the package are called, each when it is called first."""
    found: dict[tuple[str, str], None] = {}

    def note(frame: FrameType, event: str, _: Any) -> None:
        code = frame.f_code
        if event == "call" and code.co_filename.startswith(str(PACKAGE)):
            found[str(Path(code.co_filename).relative_to(PACKAGE)), code.co_qualname] = None

    before = sys.getprofile()
    called: list[tuple[str, str]] = []
    sys.setprofile(note)
    try:
        yield called
    finally:
        sys.setprofile(before)
        called += found


def compared(folder: Path) -> None:
    recordings.write(small_machine(), folder / "drift.csv")
    assert run(["compare", str(folder / "drift.csv"), "--target", "z_um", "--models", "ols", "--jobs", "1"]) in (0, 1)


def revised(folder: Path) -> None:
    (folder / "part.ngc").write_text(PLATE, encoding="ascii")
    words = ["--model", str(folder / "model.json"), "--cold", "-o", str(folder / "out.ngc"), "--tolerance", "0.1 um"]
    assert run(["revise", str(folder / "part.ngc"), *words]) == 0


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
    with traced() as called:
        way(job_folder)
    assert len(wanted) > 5
    assert [call for call in called if call in wanted] == wanted
