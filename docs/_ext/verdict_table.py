"""Directives with the verdicts on the papers' claims, from ``verdicts.json``.

    .. verdict-table::

Number of claims by verdict and study.

    .. headline-table::

       wessel2004 W-08 MLR 5.7

Claims by study, id and a part of the paper's number (without: all claims of this id), with results and reasons.

    .. verdict-text:: hwang H-16

Claims as plain text.
"""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, ClassVar

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.util.docutils import SphinxDirective

from thermocomp.papers.report.papers import count_verdicts, text
from thermocomp.papers.study import Claim, Study

FILE = Path(__file__).parents[1] / "verdicts.json"


def read() -> dict[str, Study]:
    """Return the studies in the file, with their claims."""
    content = json.loads(FILE.read_text(encoding="utf-8"))["studies"]
    return {
        name: Study(name, s["title"], tuple(map(_claim, s["claims"])), tables=(), figures=(), numbers={})
        for name, s in content.items()
    }


def _claim(found: dict[str, Any]) -> Claim:
    given = {"paper": "", "ours": ""} | found
    ids, again = tuple(given.pop("ids")), tuple(given.pop("again", ()))
    return Claim(ids=ids, text=given.pop("claim"), again=again, **given)


def headlines(line: str, studies: dict[str, Study]) -> list[Claim]:
    """Return the claims of a line of ``headline-table``.

    Raises
    ------
    ValueError
        There is none.
    """
    name, key, *printed = line.split(maxsplit=2)
    found = [c for c in studies[name].claims if key in c.ids and c.holds is not None]
    found = [c for c in found if all(part in c.paper for part in printed)]
    if not found:
        raise ValueError(f"no claim of {line}")
    return found


class VerdictTable(SphinxDirective):
    """See the module."""

    header: ClassVar[tuple[str, ...]] = ("study", "hold in each run", "in part", "in some runs", "in none")
    widths = "28 18 18 18 18"

    def run(self) -> list[nodes.Node]:
        """Return a table."""
        self.env.note_dependency(str(FILE))
        lines = [".. list-table::", "   :header-rows: 1", f"   :widths: {self.widths}", ""]
        for row in (self.header, *self.rows(read())):
            lines += [f"   {'-' if k else '* -'} {cell}".replace("   -", "     -") for k, cell in enumerate(row)]
        place = nodes.container()
        self.state.nested_parse(StringList(lines, source=str(FILE)), self.content_offset, place)
        return place.children

    def rows(self, studies: dict[str, Study]) -> Iterator[tuple[str, ...]]:
        """Yield the cells of each row."""
        for name, study in studies.items():
            n = count_verdicts(study)
            yield f"``{name}``", *(str(n[word]) for word in ("yes", "in part", "some", "no"))


class HeadlineTable(VerdictTable):
    """See the module."""

    has_content = True
    header = ("study", "claim", "paper", "here", "holds", "why")
    widths = "10 25 12 18 7 28"

    def rows(self, studies: dict[str, Study]) -> Iterator[tuple[str, ...]]:
        """Yield the cells of each row."""
        for line in self.content:
            for c in headlines(line, studies):
                cells = (c.text, c.paper, c.ours, c.verdict, c.finding)
                yield f"``{line.split()[0]}``", *(re.sub(r"([\\*|_`])", r"\\\1", cell) for cell in cells)


class VerdictText(SphinxDirective):
    """See the module."""

    required_arguments: ClassVar[int] = 1
    final_argument_whitespace: ClassVar[bool] = True

    def run(self) -> list[nodes.Node]:
        """Return the claims as a literal block."""
        self.env.note_dependency(str(FILE))
        name, *ids = self.arguments[0].split()
        said = text(read()[name], *ids)
        return [nodes.literal_block(said, said, language="none")]


def setup(app: Any) -> dict[str, bool]:
    """Register the directives."""
    for name, directive in (
        ("verdict-table", VerdictTable),
        ("headline-table", HeadlineTable),
        ("verdict-text", VerdictText),
    ):
        app.add_directive(name, directive)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
