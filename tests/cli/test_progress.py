"""Long work tells how far it is: a bar on a terminal, lines in a pipe, nothing where it is short or has to be still."""

import os
import pty
import re
import subprocess
import sys

import pytest

from thermocomp.cli import progress

WORK = """
import time
from thermocomp.cli import progress
progress.OFTEN = 0.01
with progress.show_share("proving", hidden=False) as tell:
    for k in range(10):
        time.sleep(0.02)
        tell(k / 9, f"line {k}")
"""


def test_a_pipe_gets_lines_now_and_then() -> None:
    done = subprocess.run([sys.executable, "-c", WORK], capture_output=True, text=True, check=True)
    lines = done.stderr.splitlines()
    assert 2 <= len(lines) <= 4
    assert all(re.fullmatch(r"proving: line \d: \d+% after \d s", line) for line in lines), lines
    assert done.stdout == ""


def test_a_terminal_gets_a_bar_and_no_lines() -> None:
    main, other = pty.openpty()
    with subprocess.Popen([sys.executable, "-c", WORK], stderr=other, env={**os.environ, "TERM": "xterm"}) as process:
        os.close(other)
        text = b""
        try:
            while piece := os.read(main, 4096):
                text += piece
        except OSError:  # the other end is closed
            pass
        assert process.wait() == 0
    os.close(main)
    assert b"proving: line" in text
    assert b" after " not in text


@pytest.mark.parametrize("hidden", [False, True])
def test_short_or_still_work_tells_nothing(
    hidden: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    if hidden:
        monkeypatch.setattr(progress, "OFTEN", 0.0)
    with progress.show_progress(hidden=hidden) as step, progress.show_share("proving", hidden=hidden) as tell:
        step.begin(3)
        for k in range(3):
            step("fitting")
            tell(k / 2)
    assert capsys.readouterr().err == ""


def test_steps_are_counted(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(progress, "OFTEN", 0.0)
    monkeypatch.setattr(progress, "LATER", 0.0)
    with progress.show_progress(hidden=False) as step:
        step.begin(5)
        step("fitting\x1b[31m")
        step("judging", 3)
    assert capsys.readouterr().err == "fitting?[31m: 1 of 5 after 0 s\njudging: 4 of 5 after 0 s\n"
