"""Directive ``erratum-table``: the errata of the papers by id, with their resolution, from ``errata.toml``."""

import tomllib
from pathlib import Path
from typing import Any

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.util.docutils import SphinxDirective


class ErratumTable(SphinxDirective):
    """See the module."""

    def run(self) -> list[nodes.Node]:
        """Return a table per paper, with a row per erratum."""
        path = Path(self.env.srcdir).parent / "src" / "thermocomp" / "papers" / "errata.toml"
        self.env.note_dependency(str(path))
        place = nodes.container()
        for group in tomllib.loads(path.read_text(encoding="utf-8")).values():
            lines = [f".. list-table:: {group['title']}", "   :header-rows: 1", "   :widths: 10 35 30 25", ""]
            lines += ["   * - id", "     - error or gap", "     - resolution", "     - applied in"]
            for key, entry in group.items():
                if key == "title":
                    continue
                cited = ", ".join(f"``{file.removeprefix('src/thermocomp/')}``" for file in entry.get("cited", ()))
                lines += [f"   * - {key}", f"     - {entry['wrong']}", f"     - {entry['resolution']}"]
                lines += [f"     - {cited or 'nothing: ' + entry['reason']}"]
            self.state.nested_parse(StringList(lines, source=str(path)), self.content_offset, place)
        return place.children


def setup(app: Any) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("erratum-table", ErratumTable)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
