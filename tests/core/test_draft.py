"""Drafts: whole files or none, and nothing that a killed run has left stays for long."""

import errno
import os
import stat
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path

import pytest

from thermocomp.core.exceptions import InputError
from thermocomp.core.outputs import refuse_existing
from thermocomp.files.draft import draft, drafts
from thermocomp.files.scratch import scratch

pytestmark = pytest.mark.skipif(find_spec("fcntl") is None, reason="files are not locked here")

WRITER = """
import sys
from pathlib import Path
from thermocomp.files.draft import draft
target = Path(sys.argv[1])
with draft(target, overwrite=True) as path:
    path.write_text("half")
    print("begun", flush=True)
    sys.stdin.readline()
    path.write_text("whole")
"""


@contextmanager
def writer(target: Path) -> Iterator[subprocess.Popen[str]]:
    """A process that has written half of a file, and continues when it gets a line."""
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
        with draft(tmp_path / "c.txt", overwrite=False) as path:
            path.write_text("c")
            assert mine in hidden(tmp_path)
            assert len(hidden(tmp_path)) == 2  # that of the living one, and this
        assert hidden(tmp_path) == {mine}
        living.communicate("continue\n")
        assert living.returncode == 0
    assert {p.name: p.read_text() for p in tmp_path.iterdir()} == {"a.txt": "whole", "c.txt": "c"}


def test_many_at_once_do_not_take_each_other_for_dead(tmp_path: Path) -> None:
    code = (
        "import sys\nfrom pathlib import Path\nfrom thermocomp.files.draft import draft\n"
        "folder, name = Path(sys.argv[1]), sys.argv[2]\n"
        "for k in range(300):\n    with draft(folder / f'{name}-{k}', overwrite=False) as p: p.write_text('x')\n"
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
    with pytest.raises(FileNotFoundError), draft(target, overwrite=True):
        (tmp_path / "gone").read_text()  # another file's error stays what it is
    with pytest.raises(InputError, match=r"a\.txt: the file cannot be written"), draft(target, overwrite=True):
        pass  # nothing was written
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]
    assert target.read_text() == "old"
    with draft(target, overwrite=True) as path:
        path.write_text("new")
    assert target.read_text() == "new"


def put(texts: Mapping[Path, str], *, overwrite: bool = True) -> None:
    """Write files, all of them or none."""
    with drafts(list(texts), overwrite=overwrite) as started:
        for target, text in texts.items():
            started[target].write_text(text)
        started.publish()


def test_a_file_that_comes_into_being_meanwhile_is_not_replaced(tmp_path: Path) -> None:
    first, last = tmp_path / "a.diff", tmp_path / "a.ngc"

    def meanwhile() -> None:
        with drafts([first, last], overwrite=False) as started:
            for path in started.values():
                path.write_text("new")
            last.write_text("precious")
            started.publish()

    with pytest.raises(InputError, match=r"a\.ngc: the file was created in the meantime, so nothing was written"):
        meanwhile()
    assert {p.name: p.read_text() for p in tmp_path.iterdir()} == {"a.ngc": "precious"}
    put({first: "new", last: "new"})
    put({first: "newer", last: "newer"})
    assert {p.name: p.read_text() for p in tmp_path.iterdir()} == {"a.diff": "newer", "a.ngc": "newer"}
    with pytest.raises(InputError, match=r"a\.diff: the file exists already"):
        put({first: "new"}, overwrite=False)


def test_a_disk_without_links(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first, last = tmp_path / "a", tmp_path / "b"

    def none(*_: object) -> None:
        raise OSError(errno.EPERM, "no links here")

    monkeypatch.setattr(Path, "hardlink_to", none)
    put({first: "old", last: "old"}, overwrite=False)
    put({first: "new", last: "new"})
    assert {p.name: p.read_text() for p in tmp_path.iterdir()} == {"a": "new", "b": "new"}
    last.unlink()

    def meanwhile() -> None:
        with draft(last, overwrite=False) as path:
            path.write_text("newer")
            last.write_text("precious")

    with pytest.raises(InputError, match="was created in the meantime"):
        meanwhile()
    assert last.read_text() == "precious"
    replace = Path.replace

    def broken(self: Path, target: Path) -> Path:
        if target == last.resolve() and self.name == "draft-1":
            raise OSError(errno.EIO, "Input/output error")
        return replace(self, target)

    monkeypatch.setattr(Path, "replace", broken)
    with pytest.raises(
        InputError, match="b: the file cannot be written: Input/output error; an existing file is unchanged"
    ):
        put({first: "newest", last: "newest"})
    assert {p.name: p.read_text() for p in tmp_path.iterdir()} == {"a": "new", "b": "precious"}
    last.unlink()
    first.unlink()
    with pytest.raises(InputError, match="b: the file cannot be written: Input/output error"):
        put({first: "newest", last: "newest"}, overwrite=False)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("when", range(4))
@pytest.mark.parametrize("there", [True, False])
def test_a_disk_that_fails_leaves_all_as_it_was(
    tmp_path: Path, when: int, there: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two files, and their two folders: whatever cannot be flushed, nothing has changed."""
    targets = [tmp_path / "a" / "1", tmp_path / "b" / "2"]
    for target in targets:
        target.parent.mkdir()
        if there:
            target.write_text("old")
    count = 0

    def flush(_: int) -> None:
        nonlocal count
        count += 1
        if count == when + 1:
            raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(os, "fsync", flush)
    with pytest.raises(
        InputError, match="2: the file cannot be written: Input/output error; an existing file is unchanged"
    ):
        put(dict.fromkeys(targets, "new"))
    assert count == when + 1
    assert [(t.exists() and t.read_text()) for t in targets] == ["old" if there else False] * 2
    assert sorted(p.name for p in tmp_path.rglob("*") if p.is_file()) == ["1", "2"] * there
    put(dict.fromkeys(targets, "new"))
    assert [t.read_text() for t in targets] == ["new", "new"]
    assert count == when + 5


def test_a_folder_that_is_not_flushed_is_no_fault(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def flush(handle: int) -> None:
        if stat.S_ISDIR(os.fstat(handle).st_mode):
            raise OSError(errno.EINVAL, "not here")

    monkeypatch.setattr(os, "fsync", flush)
    put({tmp_path / "a": "new"})
    assert (tmp_path / "a").read_text() == "new"


def test_the_keyboard_between_two_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first, last = tmp_path / "a", tmp_path / "b"
    first.write_text("old")
    replace = Path.replace

    def stopped(self: Path, target: Path) -> Path:
        if target == last:
            raise KeyboardInterrupt
        return replace(self, target)

    monkeypatch.setattr(Path, "replace", stopped)
    with pytest.raises(KeyboardInterrupt):
        put({first: "new", last: "new"})
    assert {p.name: p.read_text() for p in tmp_path.iterdir()} == {"a": "old"}


def test_links_stay_and_their_targets_are_written(tmp_path: Path) -> None:
    elsewhere, here = tmp_path / "elsewhere", tmp_path / "here"
    elsewhere.mkdir()
    here.mkdir()
    (elsewhere / "model.json").write_text("old")
    (here / "link").symlink_to("../elsewhere/model.json")
    (here / "chain").symlink_to("link")
    (here / "dangling").symlink_to(elsewhere / "new")
    (here / "folder").symlink_to(elsewhere)
    for name, place, overwrite in (
        ("link", "model.json", True),
        ("chain", "model.json", True),
        ("dangling", "new", False),
        ("folder/2", "2", False),
    ):
        put({here / name: name}, overwrite=overwrite)
        assert (elsewhere / place).read_text() == name
    assert all(p.is_symlink() for p in here.iterdir())
    assert sorted(p.name for p in elsewhere.iterdir()) == ["2", "model.json", "new"]
    with pytest.raises(InputError, match="link: the file exists already"):
        put({here / "link": "x"}, overwrite=False)
    with pytest.raises(InputError, match="two of these are the same file"):
        put({here / "link": "x", elsewhere / "model.json": "y"})
    assert (elsewhere / "model.json").read_text() == "chain"


def test_what_is_no_place_for_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "round").symlink_to("and round")
    (tmp_path / "and round").symlink_to("round")
    (tmp_path / "nowhere").symlink_to("gone/file")
    (tmp_path / "file").write_text("mine")
    os.mkfifo(tmp_path / "pipe")
    there = sorted(tmp_path.iterdir())
    for name, said in (
        ("round", "round: the file cannot be written: Too many levels of symbolic links"),
        ("nowhere", "nowhere: there is no folder .*/gone; create it first"),
        ("gone/file", "gone/file: there is no folder .*/gone; create it first"),
        ("file/file", "file/file: the file cannot be written: Not a directory"),
        (".", "is a folder; name a file"),
        ("pipe", "pipe: this is a pipe or a device"),
        ("x" * 256, "xxx: the file cannot be written: File name too long"),
    ):
        with pytest.raises(InputError, match=said):
            put({tmp_path / name: "x"})
        with pytest.raises(InputError, match=said):
            refuse_existing([tmp_path / name], overwrite=True)
    with pytest.raises(InputError, match="is a pipe or a device"):
        put({Path("/dev/null"): "x"})
    monkeypatch.setattr(os, "access", lambda *_: False)  # root may do anything
    with pytest.raises(InputError, match="file: the file is read-only"):
        put({tmp_path / "file": "x"})
    assert sorted(tmp_path.iterdir()) == there
    assert (tmp_path / "file").read_text() == "mine"


def test_a_folder_where_nothing_may_be_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(self: Path, *_: object) -> None:
        raise PermissionError(errno.EACCES, "Permission denied", str(self))

    monkeypatch.setattr(Path, "mkdir", refused)
    with pytest.raises(
        InputError,
        match=r"a: the file cannot be written: Permission denied; you need permission to create files in its folder",
    ):
        put({tmp_path / "a": "x"})


def test_permissions(tmp_path: Path) -> None:
    before = os.umask(0o027)
    try:
        put({tmp_path / "new": "x"})
        (tmp_path / "old").write_text("x")
        for mode in (0o600, 0o664, 0o755):
            (tmp_path / "old").chmod(mode)
            put({tmp_path / "old": oct(mode)})
            assert stat.S_IMODE((tmp_path / "old").stat().st_mode) == mode
            assert (tmp_path / "old").read_text() == oct(mode)
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "new").stat().st_mode) == 0o640
    if os.geteuid() == 0:
        os.chown(tmp_path / "old", 1234, 4321)
        put({tmp_path / "old": "again"})
        assert ((tmp_path / "old").stat().st_uid, (tmp_path / "old").stat().st_gid) == (1234, 4321)


def test_the_lock_goes_last(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Killed while it clears up, a run leaves a folder that the next one knows to be dead."""
    unlink, found = Path.unlink, []

    def watched(self: Path, missing_ok: bool = False) -> None:
        found.append(sorted(p.name for p in self.parent.iterdir()))
        unlink(self, missing_ok)

    monkeypatch.setattr(Path, "unlink", watched)
    with scratch(tmp_path) as folder:
        (folder / "zzz").write_text("x")
        (folder / "aaa").write_text("x")
        (folder / "within").mkdir()
    assert found[-1] == ["lock"]
    assert len(found) == 3
    assert all("lock" in names for names in found)


def test_a_full_disk_at_the_lock_leaves_no_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(path: Path, *_: object) -> int:
        raise OSError(errno.ENOSPC, "No space left on device", str(path))

    monkeypatch.setattr(os, "open", full)
    with pytest.raises(InputError, match="a: the file cannot be written: No space left on device"):
        put({tmp_path / "a": "x"})
    assert not list(tmp_path.iterdir())
