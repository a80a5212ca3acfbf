"""The documentation is complete: what the code has, the pages tell, and what they show still runs."""

import ast
import doctest
import importlib
import inspect
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import fields
from functools import cached_property
from pathlib import Path
from typing import Any

import pytest
from numpydoc.docscrape import NumpyDocString  # type: ignore[import-untyped]
from numpydoc.validate import validate  # type: ignore[import-untyped]

import thermocomp
from thermocomp.cli.app import app
from thermocomp.recordings.cleaning import Cut, Resample, Rezero, Shift, Swap
from thermocomp.recordings.declared import ExpandingBody, HeaderData, MeasuringUncertainty, Workpiece
from thermocomp.recordings.readers.limits import FileLimits
from thermocomp.recordings.readers.mapping import ColumnMap, CycleRule, Mapping, ReadOptions, TimeColumn, read_mapping
from thermocomp.recordings.readers.recordings import read

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
SOURCE = ROOT / "src" / "thermocomp"

COMMANDS = {name for name in app if not name.startswith("-")}
MODULES = sorted(
    ".".join(("thermocomp", *path.relative_to(SOURCE).with_suffix("").parts))
    for path in SOURCE.rglob("[!_]*.py")
    if not {"cli", "commands"} & set(path.relative_to(SOURCE).parts)
)
NOUNS = {
    "Machine": "core.machine",
    "Axis": "core.machine",
    "Channel": "core.machine",
    "Recording": "recordings.recording",
    "ErrorComponent": "core.components",
    "ErrorModel": "core.model",
    "Deviation": "core.correction",
    "Reading": "core.reading",
    "Correction": "core.correction",
    "Limits": "core.correction",
    "Assessment": "judging.compare",
}
VERBS = ["read", "select", "fit", "freeze", "assess", "compare"]
VERBS += ["synthesize", "compensate", "revise", "export", "report", "serve"]
TABLES = {"time": TimeColumn, "columns.NAME": ColumnMap, "read": ReadOptions, "cycles": CycleRule, "limits": FileLimits}
TABLES |= {"test": HeaderData, "uncertainty": MeasuringUncertainty}
TABLES |= {"expansion.NAME": ExpandingBody, "workpiece": Workpiece}
STEPS = (Cut, Shift, Rezero, Swap, Resample)
# Written by Sphinx itself, or not a page.
_MADE = ("_build", "_templates", "auto_examples", "auto_papers", "papers", "reference", "tutorial")


def _page(name: str) -> str:
    return (DOCS / name).read_text(encoding="utf-8")


def _pages() -> list[Path]:
    found = [p for ending in ("rst", "md") for p in DOCS.rglob(f"*.{ending}")]
    return sorted(p for p in found if p.relative_to(DOCS).parts[0] not in _MADE)


def _glossary() -> dict[str, str]:
    """Return term -> definition."""
    entries = re.split(r"\n   (?=\S)", _page("glossary.rst"))[1:]
    return {e.splitlines()[0].strip(): " ".join(e.splitlines()[1:]) for e in entries if not e.startswith(":")}


# -- pages --------------------------------------------------------------------------------------------------------


def test_every_command_shows_its_help() -> None:
    assert set(re.findall(r"^\.\. cli-help:: (\S+)$", _page("cli.rst"), re.MULTILINE)) == COMMANDS


@pytest.mark.parametrize("noun", NOUNS)
def test_every_noun_is_a_class_and_in_the_glossary(noun: str) -> None:
    home = f"thermocomp.{NOUNS[noun]}"
    assert inspect.isclass(getattr(importlib.import_module(home), noun))
    assert f"`{home}.{noun}`" in _glossary()[noun]


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_is_in_the_glossary(verb: str) -> None:
    text = _glossary()[verb]
    assert text.strip()
    assert not (verb in COMMANDS and "Not built yet" in text), f"the command {verb} is there, its entry says it is not"


def test_every_module_is_in_the_reference() -> None:
    assert sorted(re.findall(r"^   (thermocomp\.\S+)$", _page("reference.rst"), re.MULTILINE)) == MODULES


def test_every_mapping_key_is_described_and_no_other() -> None:
    assert {f.name for f in fields(Mapping)} == {
        "clean",
        "clocks",
        "compensation",
        *(table.partition(".")[0] for table in TABLES),
    }
    sections = re.split(r"^``\[(\S+?)\]``\n\^+\n", _page("mapping.rst"), flags=re.MULTILINE)
    described = {
        t: re.findall(r"^``(\w+)``$", text, re.MULTILINE)
        for t, text in zip(sections[1::2], sections[2::2], strict=True)
    }
    del described["[clean]"]
    assert described == {table: [f.name for f in fields(cls)] for table, cls in TABLES.items()}
    section = _page("mapping.rst").partition("``[[clean]]``")[2].partition("``[limits]``")[0]
    keys = re.findall(r"``(\w+)``", " ".join(re.findall(r"^``.*``$", section, re.MULTILINE)))
    assert sorted(keys) == sorted({f.name for step in STEPS for f in fields(step)})
    for step in STEPS:
        assert f'``"{step.do}"``:' in section


def test_every_page_is_in_a_table_of_contents() -> None:
    reached = {DOCS / "index.rst"}
    for page in _pages():
        for block in re.findall(r"^\.\. toctree::\n((?:   .*\n|\n)+)", page.read_text(encoding="utf-8"), re.MULTILINE):
            entries = [line.strip() for line in block.splitlines() if line.strip() and ":" not in line]
            reached.update(p for e in entries for end in ("rst", "md") for p in page.parent.glob(f"{e}.{end}"))
    assert [str(p.relative_to(DOCS)) for p in _pages() if p not in reached] == []


@pytest.mark.parametrize("page", [p.name for p in _pages() if ">>>" in p.read_text(encoding="utf-8")])
@pytest.mark.long
def test_the_examples_of_a_page_still_run(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copytree(DOCS / "files", tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)

    found = doctest.testfile(str(DOCS / page), module_relative=False, encoding="utf-8")

    assert found.attempted > 0
    assert found.failed == 0


def test_the_mapping_of_the_page_reads_the_real_logs(shared_data: Path) -> None:
    logs = sorted((shared_data / "voron_frame").glob("*.csv"))
    assert logs
    for log in logs:
        recording = read(log, read_mapping(DOCS / "files" / "voron.toml"))
        assert {c.name: c.unit for c in recording.channels} == {"z": "um", "frame_t": "degC", "bed_t": "degC"}
        assert recording.table["z"].iloc[0] == 0


@pytest.mark.parametrize("example", sorted(DOCS.glob("tutorial/plot_*.py")), ids=lambda path: path.stem)
@pytest.mark.long
def test_the_tutorials_run(example: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.setenv("PYTHONPATH", str(DOCS / "_ext"))

    subprocess.run([sys.executable, example], check=True)


@pytest.mark.parametrize(
    "example", sorted([*DOCS.glob("tutorial/plot_*.py"), *DOCS.glob("papers/plot_*.py")]), ids=lambda path: path.stem
)
def test_every_example_asserts_a_number(example: Path) -> None:
    asserts = [
        node for node in ast.walk(ast.parse(example.read_text(encoding="utf-8"))) if isinstance(node, ast.Assert)
    ]
    assert any(isinstance(n, ast.Constant) and isinstance(n.value, int | float) for a in asserts for n in ast.walk(a))


# -- docstrings ---------------------------------------------------------------------------------------------------

#: no docstring, an unknown section, sections in the wrong order, a parameter that is not there, in another order
_WRONG = ("GL06", "GL07", "GL08", "PR02", "PR03")
#: what other packages program against; elsewhere an entry stands only for what the annotation does not say
INTERFACES = {
    "thermocomp.api.base",
    "thermocomp.api.check",
    "thermocomp.api.explain",
    "thermocomp.api.inputs",
    "thermocomp.api.plan",
    "thermocomp.api.results",
    "thermocomp.api.select",
    "thermocomp.cli.face",
    "thermocomp.core.correction",
    "thermocomp.core.exceptions",
    "thermocomp.core.expression",
    "thermocomp.core.family",
    "thermocomp.core.plugins",
    "thermocomp.core.ports",
    "thermocomp.core.reading",
    "thermocomp.core.units",
    "thermocomp.export.target",
    "thermocomp.files.machines",
    "thermocomp.files.modelfile",
    "thermocomp.judging.metrics",
    "thermocomp.live.page.pages",
    "thermocomp.models.base",
    "thermocomp.models.method",
    "thermocomp.models.timed",
    "thermocomp.nc.revise",
    "thermocomp.recordings.recording",
    "thermocomp.recordings.samples",
}


@pytest.mark.parametrize("module", MODULES)
def test_docstrings_are_there_and_right(module: str) -> None:
    assert importlib.import_module(module).__doc__
    wrong = []
    for name, thing in _public(module):
        wrong += [f"{name}: {text}" for code, text in validate(name)["errors"] if code in _WRONG]
        home = name.removeprefix(f"{module}.").split(".")[0]
        if module in INTERFACES or module.endswith(".verbs") or thermocomp._PUBLIC.get(home) == module:
            wrong += [f"{name}: parameter {p} is not described" for p in _undescribed(thing)]
    assert wrong == []


def _public(module: str) -> Iterator[tuple[str, Any]]:
    """Yield name and object of the public functions and classes of a module, and of the classes' methods."""
    for name, thing in vars(importlib.import_module(module)).items():
        if name.startswith("_") or getattr(thing, "__module__", "") != module:
            continue
        if inspect.isfunction(thing) or inspect.isclass(thing):
            yield f"{module}.{name}", thing
        if inspect.isclass(thing):
            for key, member in vars(thing).items():
                if not key.startswith("_") and isinstance(
                    member, property | cached_property | classmethod | staticmethod
                ):
                    yield f"{module}.{name}.{key}", None if isinstance(member, property | cached_property) else member
                elif not key.startswith("_") and inspect.isfunction(member):
                    yield f"{module}.{name}.{key}", member


def _undescribed(thing: Any) -> list[str]:
    """Return parameters without a description, where some are described or more than three are taken.

    Up to three may speak for themselves; fields of a named tuple have comments of their own.
    """
    if thing is None or getattr(thing, "_is_protocol", False) or hasattr(thing, "_fields"):
        return []
    function = thing.__func__ if isinstance(thing, classmethod | staticmethod) else thing
    try:
        signature = inspect.signature(function)
    except ValueError:  # an exception without a constructor of its own
        return []
    taken = [p for p in signature.parameters if p not in ("self", "cls", "args", "kwargs")]
    homes = function.__mro__ if inspect.isclass(function) else (function,)
    described = [_described(home) for home in homes]
    if len(taken) <= 3 and not described[0]:
        return []
    known = set().union(*described)
    return [p for p in taken if p not in known]


def _described(thing: Any) -> set[str]:
    sections = NumpyDocString(inspect.cleandoc(thing.__doc__ or ""))
    return {name.strip("* ") for p in sections["Parameters"] for name in p.name.split(",")}
