"""All that becomes a file goes through the one writer: nothing else writes, and whatever fails leaves the old file."""

import ast
import errno
import os
import subprocess
import sys
import threading
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from allwriters import WRITERS, Writer

import thermocomp
from thermocomp.cli.app import run
from thermocomp.core.exceptions import InputError
from thermocomp.files.draft import write_text
from thermocomp.files.scratch import is_scratch
from thermocomp.recordings.readers import mending

PACKAGE = Path(thermocomp.__file__).parent
#: blocks inside which files are written that become others, or that nobody keeps
SHELTERS = {"draft", "drafts", "scratch"}
#: functions that write into a draft or a folder that they are given
GIVEN = {
    "app/livetrial.py": {"start": 1},  # what a trial prints, only for its error
    "app/runfolder.py": {"ask_to_stop": 1},  # an empty file that the run takes away
    "app/store.py": {"start_run": 1},  # what a run prints is added to its log
    "nc/linuxcnc/_rs274_child.py": {"run": 1},  # a process of its own, in the folder of its run
    "nc/linuxcnc/rs274process.py": {"__init__": 2, "_lay_out": 5},
    "nc/linuxcnc/verification/verify.py": {"of": 1},
    "nc/revision/job.py": {"_expand": 1, "_write": 3},
    "live/journal/journal.py": {"_set_aside": 1},  # a journal that is damaged is moved aside, not lost
    "nc/revision/ncprogram.py": {"copy_without_mark": 1, "open_to_write": 1, "replace_lines": 1},
    "papers/exported.py": {"write_loop": 1},  # sources to be compiled, in a temporary folder
    "live/keeper.py": {"put_aside": 1},  # a state that is refused is moved aside, not lost
}
#: who writes files; each is a kind in `allwriters.WRITERS`, or stands behind one
WRITING = {
    "app/livetrial.py",
    "app/runfolder.py",
    "app/running.py",
    "app/store.py",
    "live/adapters/linuxcnc/halsetup.py",
    "nc/linuxcnc/expansion/expand.py",
    "nc/revision/job.py",
    "export/verbs.py",
    "recordings/readers/mending.py",
    "live/commands/serve.py",  # the configuration of its demo: a text, never over another
    "files/jsonfile.py",
    "files/pdf.py",  # within a draft, as the pages
    "recordings/readers/recordings.py",
    "api/testprogram.py",
    "api/base.py",
    "papers/report/papers.py",
}
_WRITES = {"write_text", "write_bytes", "touch", "symlink_to", "hardlink_to", "open_to_write", "replace_lines"}
_WRITES |= {"to_csv", "to_parquet", "to_excel", "to_json", "to_pickle", "tofile", "savetxt", "savez", "write_table"}
_WRITES |= {"copyfile", "copy2", "copytree", "mkstemp", "NamedTemporaryFile", "imsave"}
_FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)


def functions(tree: ast.AST, name: str = "", *, sheltered: bool = False) -> Iterator[tuple[str, ast.Call, bool]]:
    """Yield every call, with the function it stands in, and whether a block around it shelters it."""
    for node in ast.iter_child_nodes(tree):
        inside = node.name if isinstance(node, _FUNCTIONS) else name
        here = sheltered and not isinstance(node, _FUNCTIONS)
        if isinstance(node, ast.With):
            calls = [c.func for item in node.items for c in ast.walk(item.context_expr) if isinstance(c, ast.Call)]
            here |= any(isinstance(f, ast.Name) and f.id in SHELTERS for f in calls)
        if isinstance(node, ast.Call):
            yield inside, node, here
        yield from functions(node, inside, sheltered=here)


def writes(call: ast.Call) -> bool:
    """Whether a call may write a file, by its looks."""
    name = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
    if name in ("replace", "rename"):  # of texts, dataclasses and tables too
        return isinstance(call.func, ast.Attribute) and len(call.args) == 1 and not call.keywords
    if name == "write_text":  # our own is a function
        return isinstance(call.func, ast.Attribute)
    if name == "savefig":
        return not (call.args and getattr(call.args[0], "id", "") == "buffer")
    if name != "open":
        return name in _WRITES
    modes = [a.value for a in (*call.args, *(k.value for k in call.keywords)) if isinstance(a, ast.Constant)]
    return any(isinstance(m, str) and set(m) <= set("rwxabt+") and set(m) & set("wxa+") for m in modes)


def found() -> Iterator[tuple[str, str, ast.Call, bool]]:
    for path in sorted(PACKAGE.rglob("*.py")):
        file = path.relative_to(PACKAGE).as_posix()
        if file not in ("files/draft.py", "files/scratch.py"):
            for function, call, sheltered in functions(ast.parse(path.read_text(encoding="utf-8"))):
                yield file, function, call, sheltered


def test_nothing_else_writes() -> None:
    bare: dict[str, Counter[str]] = {}
    for file, function, call, sheltered in found():
        if writes(call) and not sheltered:
            bare.setdefault(file, Counter())[function] += 1
    assert bare == GIVEN


@pytest.mark.parametrize(
    "code",
    [
        "def f(p): p.write_text('x')",
        "def f(p): open(p, 'w')",
        "def f(p):\n with p.open(mode='ab') as g: pass",
        "def f(figure, p): figure.savefig(p)",
        "def f(table, p): table.to_csv(p)",
        "def f(p, q): p.replace(q)",
        "def f(p):\n with draft(p) as q:\n  def g(): q.write_text('x')",
        "def f(p):\n with draft(p) as q:\n  async def g(): q.write_text('x')",
    ],
)
def test_the_look_for_writers_sees_them(code: str) -> None:
    assert [(writes(call), sheltered) for _, call, sheltered in functions(ast.parse(code)) if writes(call)] == [
        (True, False)
    ]


def test_every_writer_is_tried_here() -> None:
    users = {file for file, _, call, _ in found() if getattr(call.func, "id", "") in ("draft", "drafts", "write_text")}
    assert users == WRITING


def ready(folder: Path, writer: Writer) -> dict[str, bytes]:
    """The files of a kind, in their first version."""
    folder.mkdir(exist_ok=True)
    writer.write(folder, 0)
    return contents(folder)


def contents(folder: Path) -> dict[str, bytes]:
    return {p.name: p.read_bytes() for p in folder.iterdir()}


_opened: list[tuple[str, int]] = []
_listening = threading.local()


def _listen(event: str, arguments: tuple[Any, ...]) -> None:
    if event == "open" and getattr(_listening, "on", False) and isinstance(arguments[0], str):
        _opened.append((arguments[0], arguments[2]))


@pytest.fixture
def opened() -> Iterator[list[tuple[str, int]]]:
    """Files that are opened, as the interpreter tells."""
    if not hasattr(_listening, "on"):
        sys.addaudithook(_listen)
    _opened.clear()
    _listening.on = True
    yield _opened
    _listening.on = False


@pytest.mark.parametrize("kind", WRITERS)
def test_every_kind_is_written_beside_flushed_and_moved(
    kind: str, tmp_path: Path, opened: list[tuple[str, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, writer = tmp_path / "out", WRITERS[kind]
    before = ready(folder, writer)
    assert sorted(before) == sorted(writer.names)
    opened.clear()
    flushed: set[tuple[int, int]] = set()
    flush = os.fsync

    def watched(handle: int) -> None:
        flushed.add((os.fstat(handle).st_dev, os.fstat(handle).st_ino))
        flush(handle)

    monkeypatch.setattr(os, "fsync", watched)
    writer.write(folder, 1)
    after = contents(folder)
    assert sorted(after) == sorted(writer.names)
    assert after != before
    for path in (folder, *folder.iterdir()):
        assert (path.stat().st_dev, path.stat().st_ino) in flushed, path.name
    written = [Path(p) for p, flags in opened if flags & (os.O_WRONLY | os.O_RDWR) and Path(p).is_relative_to(folder)]
    for path in written:
        assert is_scratch(path.relative_to(folder).parts[0]), path


@pytest.mark.parametrize("kind", WRITERS)
def test_a_disk_that_does_not_flush_leaves_the_old_files(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, writer = tmp_path / "out", WRITERS[kind]
    before = ready(folder, writer)

    def broken(_: int) -> None:
        raise OSError(errno.EIO, "Input/output error")

    with monkeypatch.context() as patched:
        patched.setattr(os, "fsync", broken)
        with pytest.raises(InputError, match=f"{writer.last}: the file cannot be written: Input/output error"):
            writer.write(folder, 1)
    assert contents(folder) == before


@pytest.fixture(scope="module")
def small_disk(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A disk of 2 MB."""
    folder = tmp_path_factory.mktemp("disk")
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=2m", "tmpfs", str(folder)], capture_output=True, text=True, check=False
    )
    if mounted.returncode:
        pytest.skip(f"a small disk cannot be mounted here: {mounted.stderr.strip()}")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


def told(writer: Writer, folder: Path) -> str:
    """Why the second version cannot be written; nothing if it can."""
    try:
        writer.write(folder, 1)
    except InputError as e:
        return str(e)
    return ""


@pytest.mark.parametrize("kind", WRITERS)
def test_a_full_disk_leaves_the_old_files(kind: str, small_disk: Path, tmp_path: Path) -> None:
    """From no room at all to almost enough: the error names the file, the old ones are whole, nothing stays."""
    writer = WRITERS[kind]
    aside = tmp_path / "aside"
    ready(aside, writer)
    writer.write(aside, 1)
    wanted = contents(aside)
    needed = sum(-(-len(v) // 4096) * 4096 for v in wanted.values())
    folder, filler = small_disk / kind, small_disk / "filler"
    failed = done = 0
    for room in (0, 4096, 8192, needed // 2, needed, needed + 400_000):
        before = ready(folder, writer)
        with filler.open("wb") as file:
            file.write(bytes(max(os.statvfs(small_disk).f_bavail * 4096 - room, 0)))
        said = told(writer, folder)
        filler.unlink()
        assert contents(folder) == (before if said else wanted)
        if said:
            failed += 1
            assert f"{writer.last}: the file cannot be written: No space left on device" in " ".join(said.split())
        else:
            done += 1
    assert failed >= 2
    assert done >= 1
    for path in folder.iterdir():
        path.unlink()


def test_a_full_disk_is_an_unusable_output_on_the_command_line(
    small_disk: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ready(tmp_path, WRITERS["csv"])
    folder = small_disk / "command"
    folder.mkdir()
    page = folder / "check.html"
    page.write_text("old")
    filler = small_disk / "filler"
    filler.write_bytes(bytes(os.statvfs(small_disk).f_bavail * 4096 - 4096))
    code = run(["check", str(tmp_path / "drift.csv"), "-o", str(page), "--overwrite"])
    filler.unlink()
    assert code == 2
    assert f"error: {page}: the file cannot be written: No space left on device" in capsys.readouterr().err
    assert page.read_text() == "old"
    assert list(folder.iterdir()) == [page]


def test_what_comes_into_being_during_the_work_is_not_replaced(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    ready(tmp_path, WRITERS["csv"])
    page = tmp_path / "check.html"
    read = mending.read_or_offer

    def meanwhile(*arguments: Any) -> Any:
        page.write_text("precious")
        return read(*arguments)

    monkeypatch.setattr(mending, "read_or_offer", meanwhile)
    assert run(["check", str(tmp_path / "drift.csv"), "-o", str(page)]) == 2
    assert "check.html: the file exists already" in " ".join(capsys.readouterr().err.split())
    assert page.read_text() == "precious"


def test_a_new_file_is_there_in_one_step_too(tmp_path: Path, opened: list[tuple[str, int]]) -> None:
    write_text("whole", tmp_path / "new.txt", overwrite=False)
    written = [Path(p) for p, flags in opened if flags & (os.O_WRONLY | os.O_RDWR) and Path(p).is_relative_to(tmp_path)]
    assert written
    assert all(is_scratch(path.relative_to(tmp_path).parts[0]) for path in written)
    assert (tmp_path / "new.txt").read_text() == "whole"
