"""Tables, figures and numbers as data: rows of any kind, captions with values, curves and panels."""

import importlib
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from thermocomp.papers.exhibits import Exhibits
from thermocomp.papers.study import Panel, PlotCurve

FILE = """
[tables.rows]
caption = "Rows of {subject}, {UNIT}"
columns = [["", "{0}"], ["", "{1.rms:.1f}"], ["both", "{1.names:#}: {1.names:| }"]]

[tables.objects]
caption = "Objects"
columns = [["error", "{rms:.2f}"]]

[figures.small-fig1]
caption = "Fig. 1: {subject}."
columns = 2
panels = [["left", "time [h]", "{subject} [um]"], ["", "a", "b"]]
dashed = ["fit"]
style = "points"

[numbers.study]
rms_um = "best.rms"
names = "best.names"
limit = "limit"
"""


@pytest.fixture
def exhibits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Exhibits:
    package = tmp_path / "drawn_paper"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "exhibits.toml").write_text(FILE, encoding="utf-8")
    (package / "study.py").write_text("UNIT = 'um'\n", encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    study: ModuleType = importlib.import_module("drawn_paper.study")
    return Exhibits(study.__name__)


RESULT = SimpleNamespace(rms=1.25, names=("a", "b"))


def test_a_row_is_a_tuple_or_an_object(exhibits: Exhibits) -> None:
    table = exhibits.table("rows", [("first", RESULT)], subject="z")
    assert (table.caption, list(table.header)) == ("Rows of z, um", ["", "", "both"])
    assert table.rows == [["first", "1.2", "2: a b"]]
    assert exhibits.table("objects", [RESULT, RESULT]).rows == [["1.25"], ["1.25"]]


def test_a_figure_has_curves_by_label_or_ready_ones(exhibits: Exhibits) -> None:
    x, ready = np.arange(3.0), PlotCurve("ready", np.zeros(2), np.ones(2))
    figure = exhibits.figure("small-fig1", (x, {"measured": x, "fit": -x}), [ready], subject="drift")
    assert (figure.key, figure.caption, figure.columns) == ("small-fig1", "Fig. 1: drift.", 2)
    left, right = figure.panels
    assert (left.title, left.xlabel, left.ylabel) == ("left", "time [h]", "drift [um]")
    assert [(c.label, c.style) for c in left.curves] == [("measured", "points"), ("fit", "dashed")]
    assert (right.xlabel, list(right.curves)) == ("a", [ready])
    panel = Panel("own", "x", "y", [ready])
    assert exhibits.figure("small-fig1", panel, subject="").panels == [panel]


def test_numbers_are_values_or_counts(exhibits: Exhibits) -> None:
    assert exhibits.numbers("study", SimpleNamespace(best=RESULT), limit=np.float64(3)) == {
        "rms_um": 1.25,
        "names": 2.0,
        "limit": 3.0,
    }
