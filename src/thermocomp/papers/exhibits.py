"""Tables, figures and numbers of a paper's study as data: entries of ``exhibits.toml`` next to it, filled in.

``tables``
    ``caption``; ``columns``: the heading and the template of the cells of each column. A row is a tuple, with its items
    as ``{0}``, ``{1}``, or an object, with its attributes by name.
``figures``
    ``caption``; ``columns``: number of panels next to each other (default: 1); ``panels``: title, x label and y label
    of each; ``style``, and the labels of the curves that are ``dashed`` or ``points``.

``numbers``
    Names and values of numbers, by section: attributes of the results, or further values. The value of a collection
    is its number of items.

Captions and labels are templates; see `thermocomp.papers.sentences.Sentences`.
"""

from collections.abc import Iterable, Mapping, Sequence, Sized
from types import ModuleType
from typing import Any

from thermocomp.papers.pictures import curves
from thermocomp.papers.sentences import TextFile
from thermocomp.papers.study import Figure, FloatArray, Panel, PlotCurve, StudyTable

#: curves of a panel; or their x, and y by label
Drawn = Sequence[PlotCurve] | tuple[FloatArray, Mapping[str, FloatArray]]


class Exhibits:
    """Tables, figures and numbers of a study.

    Parameters
    ----------
    module, *others
        See `thermocomp.papers.sentences.TextFile`.
    """

    def __init__(self, module: str, *others: ModuleType) -> None:
        self._file = TextFile("exhibits.toml", module, *others)

    def table(self, key: str, items: Iterable[Any], **names: Any) -> StudyTable:
        """Return a table with a row per item; `names` are values for the templates of caption and cells."""
        entry = self._file.content["tables"][key]
        caption = self._file.sentences(names, None).fill(entry["caption"])
        rows = []
        for item in items:
            values = item if isinstance(item, tuple) else ()
            said = self._file.sentences(names, item)
            rows.append([said.fill(cell, *values) for _, cell in entry["columns"]])
        return StudyTable(caption, [heading for heading, _ in entry["columns"]], rows)

    def figure(self, key: str, *drawn: Drawn | Panel, **names: Any) -> Figure:
        """Return a figure from its panels, or from the curves of panels whose texts are in the entry."""
        entry = self._file.content["figures"][key]
        said = self._file.sentences(names, None)
        styles = {name: entry[name] for name in ("style", "dashed", "points") if name in entry}
        panels = []
        described = iter(entry.get("panels", ()))
        for each in drawn:
            if isinstance(each, Panel):
                panels.append(each)
                continue
            title, xlabel, ylabel = map(said.fill, next(described))
            shown = curves(*each, **styles) if isinstance(each, tuple) else each
            panels.append(Panel(title, xlabel, ylabel, shown))
        return Figure(key, said.fill(entry["caption"]), panels, entry.get("columns", 1))

    def numbers(self, section: str, found: object, **facts: Any) -> dict[str, float]:
        """Return the key numbers of a section of the study, by name."""
        said = self._file.sentences(facts, found)
        values = {name: said.value(path) for name, path in self._file.content["numbers"][section].items()}
        return {name: float(len(v) if isinstance(v, Sized) else v) for name, v in values.items()}
