"""Directives ``requirement-table``, ``erratum-table`` and ``exhibit-table``: a table per paper, from a TOML file."""

import json
import re
import tomllib
from collections import Counter
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.util.docutils import SphinxDirective
from verdict_table import FILE, read

Entry = Mapping[str, Any]
#: the cells of an entry, by its key
Cells = Callable[[str, Entry], list[str]]


@cache
def verdicts() -> dict[str, Counter[str]]:
    """Return how many claims of each requirement have which verdict; numbers for information are none."""
    found: dict[str, Counter[str]] = {}
    for claim in (c for study in read().values() for c in study.claims if c.verdict != "-"):
        for key in claim.ids:
            found.setdefault(key, Counter())[claim.verdict + " runs" * (" of " in claim.verdict)] += 1
    return found


@cache
def others() -> tuple[dict[str, list[str]], dict[str, Any]]:
    """Return the code of each requirement, and its mutants."""
    code = tomllib.loads(FILE.with_name("requirements_code.toml").read_text(encoding="utf-8"))["code"]
    return code, json.loads(FILE.with_name("mutants.json").read_text(encoding="utf-8"))


def requirement(key: str, entry: Entry) -> list[str]:
    """Return the cells of a requirement: what it is, its code, what covers it, and the verdict."""
    code, mutants = others()
    by = [f"``thermocomp papers {entry['study']}``"] if "study" in entry else []
    by += [f"``{test}``" for test in entry.get("tests", ())]
    killed = sum(m["verdict"] == "killed" for m in mutants[key]["mutants"])
    said = ", ".join(f"{word} ({n})" for word, n in verdicts().get(key, Counter()).items())
    decides = f"; would be decided by {entry['decides']}" if "decides" in entry else ""
    files = ", ".join(dict.fromkeys(f"``{piece.partition('::')[0]}``" for piece in code[key]))
    tests = f"{', '.join(by)}; {killed} mutants killed"
    return [entry["what"], files, tests, f"{said}{decides}" if said else "no claim: built, and decided by its tests"]


def erratum(_: str, entry: Entry) -> list[str]:
    """Return the cells of an erratum: what is wrong, its resolution, and where it is applied."""
    cited = ", ".join(f"``{file.removeprefix('src/thermocomp/')}``" for file in entry.get("cited", ()))
    return [entry["wrong"], entry["resolution"], cited or "nothing: " + entry["reason"]]


def caption(key: str) -> str:
    """Return the beginning of the caption of a table or figure of a study, such as ``hwang.tables.noise``."""
    study, kind, name = key.split(".")
    file = FILE.parents[1] / "src" / "thermocomp" / "papers" / study / "exhibits.toml"
    said = " ".join(tomllib.loads(file.read_text(encoding="utf-8"))[kind][name]["caption"].split())
    return f"{kind.removesuffix('s')} '{re.split('[{:;(]', said)[0].strip(' .')}'"


def exhibit(_: str, entry: Entry) -> list[str]:
    """Return the cells of an equation, table or figure: what it shows, an equation as it is here, and where ours is."""
    places = [f":mod:`thermocomp.{file.removesuffix('.py').replace('/', '.')}`" for file in entry.get("code", ())]
    places += [f":doc:`study <auto_papers/plot_{key.split('.')[0]}>`, {caption(key)}" for key in entry.get("study", ())]
    what = f"{entry['what']}: ``{entry['form']}``" if "form" in entry else entry["what"]
    return [what, "; ".join([*places, *entry.get("reason", "").splitlines()])]


class PaperTable(SphinxDirective):
    """A table per paper, with a row per entry of a file; subclasses say which file and which columns."""

    file: ClassVar[str]
    header: ClassVar[tuple[str, ...]]
    widths: ClassVar[str]
    cells: ClassVar[Cells]

    def run(self) -> list[nodes.Node]:
        """Return the tables."""
        path = Path(self.env.srcdir) / self.file
        self.env.note_dependency(str(path))
        place = nodes.container()
        for group in tomllib.loads(path.read_text(encoding="utf-8")).values():
            lines = [f".. list-table:: {group['title']}", "   :header-rows: 1", f"   :widths: {self.widths}", ""]
            rows = [self.header] + [(k, *type(self).cells(k, e)) for k, e in group.items() if k != "title"]
            lines += [f"   {' ' if k else '*'} - {cell}" for row in rows for k, cell in enumerate(row)]
            self.state.nested_parse(StringList(lines, source=str(path)), self.content_offset, place)
        return place.children


def table(file: str, header: tuple[str, ...], widths: str, cells: Cells) -> type[PaperTable]:
    """Return a directive."""
    members = {"file": file, "header": header, "widths": widths, "cells": staticmethod(cells), "__doc__": file}
    return type("Table", (PaperTable,), members)


def setup(app: Any) -> dict[str, bool]:
    """Register the directives."""
    errata = "../src/thermocomp/papers/errata.toml"
    requirements = ("id", "requirement", "code", "covered by", "claims by verdict")
    app.add_directive("requirement-table", table("requirements.toml", requirements, "7 21 20 32 20", requirement))
    app.add_directive(
        "erratum-table", table(errata, ("id", "error or gap", "resolution", "applied in"), "10 35 30 25", erratum)
    )
    app.add_directive(
        "exhibit-table", table("exhibits.toml", ("in the paper", "what it shows", "here"), "12 44 44", exhibit)
    )
    return {"parallel_read_safe": True, "parallel_write_safe": True}
