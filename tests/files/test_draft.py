"""Drafts: whole files or none, and nothing that a killed run has left stays for long."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path

import pytest

from thermocomp.core.exceptions import InputError
from thermocomp.core.scratch import scratch
from thermocomp.files.draft import draft, publish

pytestmark = pytest.mark.skipif(find_spec("fcntl") is None, reason="files are not locked here")

WRITER = """
import sys
from pathlib import Path
from thermocomp.files.draft import draft
target = Path(sys.argv[1])
with draft(target) as path:
    path.write_text("half")
    print("begun", flush=True)
    sys.stdin.readline()
    path.write_text("whole")
"""


@contextmanager
def writer(target: Path) -> Iterator[subprocess.Popen[str]]:
    """A process that has written half of a file, and goes on when it gets a line."""
    command = [sys.executable, "-c", WRITER, str(target)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout
        assert process.stdout.readline() == "begun\n"
        try:
            yield process
        finally:
            process.kill()


def hidden(folder: Path) -> set[Path]:
    return {p for p in folder.iterdir() if p.name.startswith(".")}


def test_a_killed_run_is_cleared_away_and_a_living_one_is_not(tmp_path: Path) -> None:
    with writer(tmp_path / "a.txt") as living:
        (mine,) = hidden(tmp_path)
        with writer(tmp_path / "b.txt") as killed:
            assert len(hidden(tmp_path)) == 2
            killed.kill()
            killed.wait()
        assert len(hidden(tmp_path)) == 2  # SIGKILL: it could not clear up
        with draft(tmp_path / "c.txt") as path:
            path.write_text("c")
            assert mine in hidden(tmp_path)
            assert len(hidden(tmp_path)) == 2  # that of the living one, and this
        assert hidden(tmp_path) == {mine}
        living.communicate("go on\n")
        assert living.returncode == 0
    assert {p.name: p.read_text() for p in tmp_path.iterdir()} == {"a.txt": "whole", "c.txt": "c"}


def test_many_at_once_do_not_take_each_other_for_dead(tmp_path: Path) -> None:
    code = (
        "import sys\nfrom pathlib import Path\nfrom thermocomp.files.draft import draft\n"
        "for k in range(300):\n    with draft(Path(sys.argv[1]) / f'{sys.argv[2]}-{k}') as p: p.write_text('x')\n"
    )
    runs = [subprocess.Popen([sys.executable, "-c", code, str(tmp_path), str(k)]) for k in range(3)]
    assert [run.wait() for run in runs] == [0, 0, 0]
    assert not hidden(tmp_path)
    assert len(list(tmp_path.iterdir())) == 900


def test_a_folder_that_was_killed_before_its_lock_goes_too(tmp_path: Path) -> None:
    bare = tmp_path / f".thermocomp-{'0' * 32}"
    bare.mkdir()
    others = [tmp_path / f".thermocomp-{'0' * 31}", tmp_path / ".other"]
    for other in others:
        other.mkdir()
    with scratch(tmp_path):
        assert not bare.exists()
    assert hidden(tmp_path) == set(others)


def test_a_draft_that_fails_leaves_the_old_file(tmp_path: Path) -> None:
    target = tmp_path / "a.txt"
    target.write_text("old")
    with pytest.raises(FileNotFoundError), draft(target):
        (tmp_path / "gone").read_text()
    with pytest.raises(FileNotFoundError), draft(target):
        pass  # nobody has written anything
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]
    assert target.read_text() == "old"
    with draft(target) as path:
        path.write_text("new")
    assert target.read_text() == "new"


def test_a_file_that_comes_into_being_meanwhile_is_not_replaced(tmp_path: Path) -> None:
    first, last = tmp_path / "a.diff", tmp_path / "a.ngc"
    with scratch(tmp_path) as folder:
        drafts = {first: folder / "1", last: folder / "2"}
        for path in drafts.values():
            path.write_text("new")
        last.write_text("precious")
        with pytest.raises(InputError, match="has come into being meanwhile; nothing was written"):
            publish(drafts, overwrite=False)
        assert not first.exists()
        assert last.read_text() == "precious"
        publish(drafts, overwrite=True)
    assert (first.read_text(), last.read_text()) == ("new", "new")
    with scratch(tmp_path) as folder:
        (folder / "1").write_text("newer")
        publish({tmp_path / "b": folder / "1"}, overwrite=False)
    assert (tmp_path / "b").read_text() == "newer"
