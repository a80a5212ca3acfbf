"""NC programs as files: bytes as they are, and a header that is filled in at the end."""

from pathlib import Path

import pytest

from thermocomp.core.exceptions import InputError
from thermocomp.nc.revision import ncprogram

BYTES = bytes(range(256)) + b"\r\nG1 X1\n\nlast"


def test_any_bytes_come_through(tmp_path: Path) -> None:
    (tmp_path / "a.ngc").write_bytes(BYTES)
    with ncprogram.open_to_read(tmp_path / "a.ngc") as read, ncprogram.open_to_write(tmp_path / "b.ngc") as written:
        written.writelines(read)
    assert (tmp_path / "b.ngc").read_bytes() == BYTES


def test_what_cannot_be_opened(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"a\.ngc: no such file"):
        ncprogram.open_to_read(tmp_path / "a.ngc")
    with pytest.raises(InputError, match="is a directory; give an NC program"):
        ncprogram.open_to_read(tmp_path)


def test_lines_are_filled_in_their_order(tmp_path: Path) -> None:
    draft, target = tmp_path / "draft", tmp_path / "target"
    draft.write_bytes(b"%\r\n(0)\r\n(1)\r\nG1\n(0)\r\n\xfcber\r\n")
    ncprogram.replace_lines(draft, target, {"(0)\r\n": "(für Z)\r\n", "(1)\r\n": "(b)\r\n"})
    assert target.read_bytes() == b"%\r\n(f\xfcr Z)\r\n(b)\r\nG1\n(0)\r\n\xfcber\r\n"
    with pytest.raises(ValueError, match=r"there is no line b'\(2\)"):
        ncprogram.replace_lines(draft, target, {"(0)\r\n": "a", "(2)\r\n": "b"})
