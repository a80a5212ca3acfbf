"""What expanding writes, without the interpreter: its answers are given."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from thermocomp.core.exceptions import InputError, ProgramError
from thermocomp.nc.linuxcnc.expansion import expand as expanding


@pytest.mark.parametrize("name", ["a\nG0 Z-50 (x)", "a)G0 Z-50(", "50%;a", "\u0416" + "x" * 200])
def test_a_name_stays_in_its_comment(name: str, tmp_path: Path) -> None:
    program = tmp_path / f"{name}.ngc"
    program.write_text("G21\n", encoding="ascii")
    around = expanding._Around(None, None, {}, False, (), False, {})
    comment, line = next(expanding._lines(program, around))
    assert line == 0
    assert re.fullmatch(r"\(expanded from [ !-$&'*-:<-~]{1,48} by thermocomp\)", comment)


def test_what_is_written_is_whole_or_not_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program, out = tmp_path / "p.ngc", tmp_path / "out.ngc"
    program.write_text("G21\nM2\n", encoding="ascii")

    def lines(broken: bool) -> Iterator[tuple[str, int]]:
        yield "G21", 1
        if broken:
            raise ProgramError(1, "no")

    monkeypatch.setattr(expanding._Around, "run", lambda *_, **__: lines(False))
    monkeypatch.setattr(expanding, "compare", lambda *_: 7)
    monkeypatch.setattr(expanding, "compare_parameters", lambda *_: None)
    monkeypatch.setattr(expanding, "_lines", lambda *_: lines(True))
    with pytest.raises(ProgramError, match="line 1: no"):
        expanding.expand(program, out)
    assert list(tmp_path.iterdir()) == [program]
    monkeypatch.setattr(expanding, "_lines", lambda *_: lines(False))
    found = expanding.expand(program, out)
    assert (found.path, list(found.sources), found.acts) == (out, [1], 7)
    assert out.read_text() == "G21\n"
    with pytest.raises(InputError, match=r"out\.ngc: the file exists already"):
        expanding.expand(program, out)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["out.ngc", "p.ngc"]
