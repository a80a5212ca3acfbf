"""Directive ``code-table``: the G and M codes that are interpreted and those that are refused, from the source code.

.. code-table:: linuxcnc
"""

from itertools import groupby
from typing import Any, ClassVar

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.util.docutils import SphinxDirective

from thermocomp.nc.interpreter import codes


class CodeTable(SphinxDirective):
    """See the module."""

    required_arguments: ClassVar[int] = 1

    def run(self) -> list[nodes.Node]:
        """Return the interpreted codes in a line, and a table of the others with the reasons."""
        self.env.note_dependency(str(codes.__file__))
        (controller,) = self.arguments
        known = [code for table in (codes.G_CODES, codes.M_CODES) for _, code in sorted(table[controller].items())]
        followed = ", ".join(f"``{c.name}``" for c in known if not c.refused)
        lines = [f"Interpreted: {followed}.", ""]
        lines += [
            ".. list-table::",
            "   :header-rows: 1",
            "   :widths: 25 75",
            "",
            "   * - refused",
            "     - reason and remedy",
        ]
        for reason, same in groupby((c for c in known if c.refused), key=lambda c: c.refused):
            names = ", ".join(f"``{c.name}``" for c in same)
            lines += [f"   * - {names}", f"     - {reason.replace('--expand', '``--expand``')}"]
        place = nodes.container()
        self.state.nested_parse(StringList(lines, source=codes.__name__), self.content_offset, place)
        return place.children


def setup(app: Any) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("code-table", CodeTable)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
