"""Pages as PDF, by a real browser."""

import sys
from pathlib import Path

import pytest

import thermocomp as tc
from thermocomp.cli.app import run
from thermocomp.core import browsers
from thermocomp.core.browsers import find_browser
from thermocomp.core.exceptions import InputError
from thermocomp.files.pdf import write_pdf

BIG = (
    "<!doctype html><html><head><title>t</title></head>"
    '<body><p>a</p>{}<p style="break-before: page">b</p></body></html>'
)


def pages(path: Path) -> int:
    """Return the number of pages that the tree of a PDF states."""
    return path.read_bytes().count(b"/Type /Page\n") or path.read_bytes().count(b"/Type /Page ")


def test_a_page_is_printed(tmp_path: Path) -> None:
    made = write_pdf(BIG.format(""), tmp_path / "x.pdf", overwrite=False)
    assert made.read_bytes().startswith(b"%PDF")
    assert pages(made) == 2
    assert [p.name for p in tmp_path.iterdir()] == ["x.pdf"]


def test_nothing_in_a_page_runs(tmp_path: Path) -> None:
    script = """<script>document.body.innerHTML += '<p style="break-before: page">c</p>'.repeat(5)</script>"""
    assert pages(write_pdf(BIG.format(script), tmp_path / "x.pdf", overwrite=False)) == 2


def test_a_file_is_not_overwritten(tmp_path: Path) -> None:
    (tmp_path / "x.pdf").write_text("mine")
    with pytest.raises(InputError, match="exists already"):
        write_pdf(BIG.format(""), tmp_path / "x.pdf", overwrite=False)
    assert (tmp_path / "x.pdf").read_text() == "mine"


def test_without_a_browser_nothing_is_computed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(browsers, "BROWSERS", ("no-such-browser",))
    assert run(["check", "no-such-file.csv", "-o", str(tmp_path / "x.pdf")]) == 2
    assert "install one, or write .html" in " ".join(capsys.readouterr().err.replace("│", "").split())


WRITES = 'for a in "$@"; do case $a in --print-to-pdf=*) printf "%s" > "${a#--print-to-pdf=}";; esac; done\n'


@pytest.mark.skipif(sys.platform == "win32", reason="a shell script stands for the browser")
@pytest.mark.parametrize(
    "work",
    [
        pytest.param("", id="nothing"),
        pytest.param(WRITES % "%%PDF-1.4 half", id="half a file"),
        pytest.param(f"{WRITES % '%%PDF-1.4 %%%%EOF'}kill -9 $$\n", id="killed"),
        pytest.param(WRITES % "%%%%EOF", id="no PDF"),
    ],
)
def test_a_browser_that_does_not_finish_is_reported(work: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fake = tmp_path / "browser"
    fake.write_text(f"#!/bin/sh\necho first >&2\necho no display >&2\n{work}")
    fake.chmod(0o755)
    monkeypatch.setattr(browsers, "BROWSERS", (str(fake),))
    with pytest.raises(InputError, match=r"printed no PDF \(no display\)"):
        write_pdf(BIG.format(""), tmp_path / "x.pdf", overwrite=False)
    assert [p.name for p in tmp_path.iterdir()] == ["browser"]


def test_a_report_is_printed_under_the_name_of_a_pdf(tmp_path: Path) -> None:
    rows = "\n".join(f"{10 * k},{20 + 0.01 * k},{1500 * (k > 5)},{0.1 * k}" for k in range(60))
    (tmp_path / "a.csv").write_text(f"time_s,t_C,speed_rpm,z_um\n{rows}\n")
    made = tc.check(str(tmp_path / "a.csv")).report(tmp_path / "a.PDF")
    assert made.read_bytes().startswith(b"%PDF")
    assert find_browser()
