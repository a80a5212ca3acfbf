"""What people typed reaches no terminal as markup, and moves no cursor: names of files, channels, cycles, machines."""

import ast
import io
import json
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from hostile import NAMES, renamed
from rich.console import Console
from rich.panel import Panel
from smallmachine import small_machine

from thermocomp.cli import terminal
from thermocomp.cli.app import run
from thermocomp.cli.terminal import marked, words
from thermocomp.recordings.readers import mending
from thermocomp.report.layout import Column, Layout, Toned

CLI = Path(terminal.__file__).parent
#: what may stand in a printed text: it is made safe, or is a number
_SAFE = {"words", "mark", "marked", "len", "_many"}
#: what else stands there: words of our own, numbers, and what was made safe before
_OURS = {
    "answers.py": {"text", "table"},
    "app.py": {"text"},
    "checked.py": {"kind[1]", "where"},
    "map.py": {"k", "more", "best"},
    "iso230.py": {"TITLES[t.kind]"},
    "face.py": {"file"},
    "positiontables.py": {"unit", "again", "states", "fit.enough", "sum((len(t) for t in tests))"},
    "revise.py": {"mark", "revision.changed", "outcome.duration(revision.seconds)", "_spindle(job)", "took"},
    "terminal.py": {"table"},
    "volumetric.py": {
        "', '.join(others)",
        "bool(others)",
        "study.missing",
        "told.headline(study)",
        "told.said(study.course.point)",
        "told.said(study.course.tool)",
        "what",
    },
}


def bare(node: ast.AST) -> Iterator[str]:
    """Yield what a printed text has in it as it is."""
    if isinstance(node, ast.Constant) or (isinstance(node, ast.FormattedValue) and node.format_spec is not None):
        return  # numbers have a format
    if isinstance(node, ast.FormattedValue):
        yield from bare(node.value)
    elif isinstance(node, ast.JoinedStr):
        for part in node.values:
            yield from bare(part)
    elif isinstance(node, ast.BinOp):
        yield from bare(node.left)
        yield from bare(node.right)
    elif isinstance(node, ast.IfExp):
        yield from bare(node.body)
        yield from bare(node.orelse)
    elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "lstrip":
        yield from bare(node.func.value)
    elif not (isinstance(node, ast.Call) and getattr(node.func, "id", "") in _SAFE):
        yield ast.unparse(node)


def test_nothing_is_printed_as_it_is() -> None:
    found: dict[str, set[str]] = {}
    for path in sorted([*CLI.glob("*.py"), *CLI.parent.glob("*/commands/*.py")]):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "print":
                mine = {text for argument in node.args for text in bare(argument)} - _OURS.get(path.name, set())
                if mine:
                    found.setdefault(path.name, set()).update(mine)
    assert found == {}
    assert not any(list(bare(ast.parse(f'f"{{{name}}}"', mode="eval").body)) for name in ("words(x)", "x:.2f", "'a'"))
    assert list(bare(ast.parse("f'[bold]{x.name}[/]'", mode="eval").body)) == ["x.name"]


@pytest.mark.parametrize("name", NAMES)
def test_words_stay_words(name: str) -> None:
    file = io.StringIO()
    console = Console(file=file, force_terminal=True, width=20_000, color_system=None, highlight=False, emoji=False)
    console.print(f"[bold]{words(name)}[/]|{marked(Toned(name, 'good'))}|", soft_wrap=True)
    terminal.print_table(Layout((Column(name, 0),), [(name,)], title=name, note=name), console)
    printed = file.getvalue()
    assert all(c.isprintable() or c in "\n\x1b" for c in printed)
    plain = "".join(c if c.isprintable() else " " if c == "\xa0" else "?" for c in name)
    first = printed.split("\n")[0]
    for code in ("\x1b[1m", "\x1b[0m"):
        first = first.replace(code, "")
    assert first == f"{plain}|{plain}|"


@pytest.mark.parametrize("name", NAMES)
def test_a_file_of_such_names_is_checked(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    recording = renamed(small_machine(), name)
    monkeypatch.setattr(mending, "read_or_offer", lambda *_: recording)
    assert run(["check", "x.csv", "-o", str(tmp_path / "page.html")]) in (0, 1)
    printed = capsys.readouterr()
    assert all(c.isprintable() or c == "\n" for c in printed.out + printed.err)
    assert (tmp_path / "page.html").stat().st_size > 10_000
    assert run(["check", "x.csv", "--json"]) in (0, 1)
    text = capsys.readouterr().out
    assert all(c.isprintable() or c == "\n" for c in text)
    content: dict[str, Any] = json.loads(text)
    assert content["recordings"][0]["channels"][0]["name"] == recording.channels[0].name


@pytest.mark.parametrize(
    "line", ["check --{}", "{}", "select x.csv --method {}", "check {}.csv", "compare x.csv --jobs {}"]
)
def test_what_stands_on_the_command_line(line: str, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("\x1b[31m\x07[red]", "\x9b31m", "a\u202eb", "\udcff"):
        with suppress(SystemExit):
            run([word.format(name) for word in line.split()])
        said = capsys.readouterr()
        assert all(c.isprintable() or c == "\n" for c in said.out + said.err)
        assert len(said.err) > 10


def test_a_console_obeys_nothing() -> None:
    file = io.StringIO()
    console = terminal.make_console(file=file, force_terminal=True, color_system="standard")
    console.print("[red]a\x1b[2J:cat:\u202e 12[/]\nb", Panel("\x9b1m"))
    printed = file.getvalue()
    assert printed.startswith("\x1b[31ma?[2J:cat:? 12\x1b[0m\nb")
    assert "\x9b" not in printed
