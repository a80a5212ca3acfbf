"""Base classes of results: table, figure, page, and short text."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from thermocomp.core.messages import Message, join
from thermocomp.files.draft import write_text
from thermocomp.files.pdf import write_pdf

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Result(ABC):
    """Base class of all results."""

    @abstractmethod
    def to_frame(self) -> pd.DataFrame:
        """Return the values as a table, a row for each judged, fitted or selected item."""

    @abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """Return all results as a dict, as printed by ``--json``."""

    @abstractmethod
    def plot(self) -> "Figure":
        """Return the most informative figure."""

    @abstractmethod
    def __str__(self) -> str:
        """Return the result in a sentence or two."""

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self}>"

    def _repr_html_(self) -> str:
        from html import escape

        return f"<p>{escape(str(self))}</p>{self.to_frame().to_html(index=False, float_format='{:.2f}'.format)}"


class Paged(ABC):
    """A result with an HTML page."""

    @abstractmethod
    def page(self) -> str:
        """Return the page as a self-contained HTML text."""

    def report(self, path: str | Path, *, overwrite: bool = False) -> Path:
        """Write the page as HTML, or as PDF if the name ends so; return its path."""
        if Path(path).suffix.lower() == ".pdf":
            return write_pdf(self.page(), Path(path), overwrite=overwrite)
        return write_text(self.page(), path, overwrite=overwrite)


def told_trouble(trouble: Sequence[str]) -> list[str]:
    """Return the data-quality problems of recordings as a sentence; empty if there are none."""
    return [Message("Trouble: {what}.", what=join(trouble, "; "))] if trouble else []
