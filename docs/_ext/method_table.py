"""Directive ``method-table``: all methods with their summary, taken from the registry at build time."""

from typing import Any

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.util.docutils import SphinxDirective

from thermocomp.models import methods


class MethodTable(SphinxDirective):
    """See the module."""

    def run(self) -> list[nodes.Node]:
        """Return a table with a row per method."""
        self.env.note_dependency(str(methods.__file__))
        lines = [".. list-table::", "   :header-rows: 1", "   :widths: 20 80", "", "   * - name", "     - description"]
        for m in methods.METHODS.values():
            lines += [f"   * - ``{m.name}``", f"     - {m.summary}"]
        place = nodes.container()
        self.state.nested_parse(StringList(lines, source=methods.__name__), self.content_offset, place)
        return place.children


def setup(app: Any) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("method-table", MethodTable)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
