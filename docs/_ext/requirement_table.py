"""Directive ``requirement-table``: the requirements of the papers, and what covers each, from ``requirements.toml``."""

import tomllib
from pathlib import Path
from typing import Any

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.util.docutils import SphinxDirective


class RequirementTable(SphinxDirective):
    """See the module."""

    def run(self) -> list[nodes.Node]:
        """Return a table per paper, with a row per requirement."""
        path = Path(self.env.srcdir) / "requirements.toml"
        self.env.note_dependency(str(path))
        place = nodes.container()
        for group in tomllib.loads(path.read_text(encoding="utf-8")).values():
            lines = [f".. list-table:: {group['title']}", "   :header-rows: 1", "   :widths: 10 40 50", ""]
            lines += ["   * - id", "     - requirement", "     - covered by"]
            for key, entry in group.items():
                if key == "title":
                    continue
                by = [f"``thermocomp papers {entry['study']}``"] if "study" in entry else []
                by += [f"``{test}``" for test in entry.get("tests", ())]
                lines += [f"   * - {key}", f"     - {entry['what']}", f"     - {', '.join(by) or entry['reason']}"]
            self.state.nested_parse(StringList(lines, source=str(path)), self.content_offset, place)
        return place.children


def setup(app: Any) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("requirement-table", RequirementTable)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
