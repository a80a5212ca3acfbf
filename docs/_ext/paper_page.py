"""A study on a page of ``docs/papers``: claims as text, tables and figures."""

import matplotlib.pyplot as plt

from thermocomp.papers.report import papers as page
from thermocomp.papers.studies import run
from thermocomp.papers.study import Figure


class Page:
    """The study of a paper, run when its page is built."""

    def __init__(self, name: str) -> None:
        self._study = run(name)
        self.numbers = self._study.numbers
        self._figures = {f.key.removeprefix(f"{name}-"): f for f in self._study.figures}
        print(page.headline(self._study))

    def tell(self, *ids: str) -> None:
        """Print the claims with some ids."""
        print(page.text(self._study, *ids))

    def show(self, *captions: str) -> None:
        """Print tables, by the beginning of their captions."""
        for caption in captions:
            (table,) = (t for t in self._study.tables if t.caption.startswith(caption))
            print(f"\n{page.format_table(table)}")

    def draw(self, *keys: str) -> None:
        """Draw figures, one below the other."""
        drawn = [self._figures[key] for key in keys]
        together = Figure("", "", [panel for figure in drawn for panel in figure.panels], drawn[0].columns)
        page.paint(together, plt.figure(figsize=page.size(together), layout="constrained"))
        plt.show()
