"""Directives with the verdicts on the papers' claims, from ``verdicts.json``.

    .. verdict-table::

Number of claims by verdict and study.

    .. headline-table::

       wessel2004 W-08 MLR 5.7

Claims by study, id and a part of the paper's number (without: all claims of this id), with results and reasons.

    .. verdict-text:: hwang H-16

Claims as plain text.

    .. measured-table::

RMS errors of linear regression and ACE on a measured machine, from ``measured.json``.
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

#: headings of verdicts
HEADINGS = {"yes": "hold in each run", "some": "in some runs", "no": "in none"}
FILE = Path(__file__).parents[1] / "verdicts.json"
MEASURED = FILE.with_name("measured.json")


def read() -> dict[str, Study]:
    """Return the studies in the file, with their claims."""
    content = json.loads(FILE.read_text(encoding="utf-8"))["studies"]
    return {
        name: Study(name, s["title"], tuple(map(_claim, s["claims"])), tables=(), figures=(), numbers={})
        for name, s in content.items()
    }


def _claim(found: dict[str, Any]) -> Claim:
    named = {"text" if key == "claim" else key: value for key, value in found.items()}
    return Claim(**named | {key: tuple(found[key]) for key in ("ids", "again")})


def headlines(line: str, studies: dict[str, Study]) -> list[Claim]:
    """Return the claims of a line of ``headline-table``.

    Raises
    ------
    ValueError
        There is none.
    """
    name, key, *printed = line.split(maxsplit=2)
    found = [c for c in studies[name].claims if key in c.ids and c.verdict != "-"]
    found = [c for c in found if all(part in c.paper for part in printed)]
    if not found:
        raise ValueError(f"no claim of {line}")
    return found


class VerdictTable(SphinxDirective):
    """See the module."""

    widths = "auto"
    file = FILE

    def run(self) -> list[nodes.Node]:
        """Return a table."""
        self.env.note_dependency(str(self.file))
        lines = [".. list-table::", "   :header-rows: 1", f"   :widths: {self.widths}", ""]
        for row in self.rows(read()):
            lines += [f"   {' ' if k else '*'} - {cell}" for k, cell in enumerate(row)]
        place = nodes.container()
        self.state.nested_parse(StringList(lines, source=str(self.file)), self.content_offset, place)
        return place.children

    def rows(self, studies: dict[str, Study]) -> Iterator[tuple[str, ...]]:
        """Yield the cells of each row, first the header."""
        counts = {name: count_verdicts(study) for name, study in studies.items()}
        words = [word for word in next(iter(counts.values())) if word != "-"]
        yield "study", *(HEADINGS.get(word, word) for word in words)
        for name, n in counts.items():
            yield f"``{name}``", *(str(n[word]) for word in words)


class HeadlineTable(VerdictTable):
    """See the module."""

    has_content = True
    widths = "10 25 12 18 7 28"

    def rows(self, studies: dict[str, Study]) -> Iterator[tuple[str, ...]]:
        """Yield the cells of each row, first the header."""
        yield "study", "claim", "paper", "here", "holds", "why"
        for line in self.content:
            for c in headlines(line, studies):
                cells = (c.text, c.paper, c.ours, c.verdict, c.finding)
                yield f"``{line.split()[0]}``", *(re.sub(r"([\\*|_`])", r"\\\1", cell) for cell in cells)


class MeasuredTable(VerdictTable):
    """See the module."""

    file = MEASURED

    def rows(self, _: dict[str, Study]) -> Iterator[tuple[str, ...]]:
        """Yield the cells of each row, first the header."""
        rms: dict[str, dict[str, float]] = json.loads(MEASURED.read_text(encoding="utf-8"))["rms_um"]
        yield "method", *(f"``{target}``" for target in rms["none"])
        for method, errors in rms.items():
            yield f"``{method}``" if method != "none" else method, *(f"{e:.1f}" for e in errors.values())


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
        ("measured-table", MeasuredTable),
    ):
        app.add_directive(name, directive)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
