"""Directive ``component-table``: the 32 error components, taken from the code at build time."""

from typing import Any

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.util.docutils import SphinxDirective

from thermocomp.core import components

_GROUPS = {"axis": "axes", "squareness": "between axes", "spindle": "spindle", "origin": "references of axes"}


class ComponentTable(SphinxDirective):
    """See the module."""

    def run(self) -> list[nodes.Node]:
        """Return a table with a row per component, and a heading per group."""
        self.env.note_dependency(str(components.__file__))
        place = nodes.container()
        for group, heading in _GROUPS.items():
            found = [c for c in components.COMPONENTS if c.group == group]
            lines = [f".. list-table:: {heading}: {len(found)}", "   :header-rows: 1", "   :widths: 14 12 24 50", ""]
            lines += ["   * - code", "     - unit", "     - depends on", "     - description"]
            for c in found:
                depends = "time" if c.is_scalar else f"time, position of {c.depends_on}"
                lines += [f"   * - ``{c.code}``", f"     - {c.unit}", f"     - {depends}", f"     - {c.description}"]
            self.state.nested_parse(StringList(lines, source=components.__name__), self.content_offset, place)
        return place.children


def setup(app: Any) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("component-table", ComponentTable)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
