"""Directives ``requirement-table``, ``erratum-table`` and ``exhibit-table``: a table per paper, from a TOML file."""

import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, ClassVar

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.util.docutils import SphinxDirective

Entry = Mapping[str, Any]


def requirement(entry: Entry) -> list[str]:
    """Return the cells of a requirement: what it is, and what covers it."""
    by = [f"``thermocomp papers {entry['study']}``"] if "study" in entry else []
    by += [f"``{test}``" for test in entry.get("tests", ())]
    return [entry["what"], ", ".join(by) or entry["reason"]]


def erratum(entry: Entry) -> list[str]:
    """Return the cells of an erratum: what is wrong, its resolution, and where it is applied."""
    cited = ", ".join(f"``{file.removeprefix('src/thermocomp/')}``" for file in entry.get("cited", ()))
    return [entry["wrong"], entry["resolution"], cited or "nothing: " + entry["reason"]]


def exhibit(entry: Entry) -> list[str]:
    """Return the cells of an equation, table or figure: what it shows, and where ours is."""
    places = [f"``{file}``" for file in entry.get("code", ())]
    places += [f":doc:`study <auto_papers/plot_{key.split('.')[0]}>`, ``{key}``" for key in entry.get("study", ())]
    return [entry["what"], "; ".join([*places, *entry.get("reason", "").splitlines()])]


class PaperTable(SphinxDirective):
    """A table per paper, with a row per entry of a file; subclasses say which file and which columns."""

    file: ClassVar[str]
    header: ClassVar[tuple[str, ...]]
    widths: ClassVar[str]
    cells: ClassVar[Callable[[Entry], list[str]]]

    def run(self) -> list[nodes.Node]:
        """Return the tables."""
        path = Path(self.env.srcdir) / self.file
        self.env.note_dependency(str(path))
        place = nodes.container()
        for group in tomllib.loads(path.read_text(encoding="utf-8")).values():
            lines = [f".. list-table:: {group['title']}", "   :header-rows: 1", f"   :widths: {self.widths}", ""]
            rows = [self.header] + [(k, *type(self).cells(e)) for k, e in group.items() if k != "title"]
            lines += [f"   {' ' if k else '*'} - {cell}" for row in rows for k, cell in enumerate(row)]
            self.state.nested_parse(StringList(lines, source=str(path)), self.content_offset, place)
        return place.children


def table(file: str, header: tuple[str, ...], widths: str, cells: Callable[[Entry], list[str]]) -> type[PaperTable]:
    """Return a directive."""
    members = {"file": file, "header": header, "widths": widths, "cells": staticmethod(cells), "__doc__": file}
    return type("Table", (PaperTable,), members)


def setup(app: Any) -> dict[str, bool]:
    """Register the directives."""
    errata = "../src/thermocomp/papers/errata.toml"
    app.add_directive(
        "requirement-table", table("requirements.toml", ("id", "requirement", "covered by"), "10 40 50", requirement)
    )
    app.add_directive(
        "erratum-table", table(errata, ("id", "error or gap", "resolution", "applied in"), "10 35 30 25", erratum)
    )
    app.add_directive(
        "exhibit-table", table("exhibits.toml", ("in the paper", "what it shows", "here"), "12 44 44", exhibit)
    )
    return {"parallel_read_safe": True, "parallel_write_safe": True}
