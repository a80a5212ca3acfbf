"""The picture of a revised program says how far the tool would drift, and what is left."""

import math

import numpy as np
import pytest

from thermocomp.nc.report import revision
from thermocomp.nc.rewrite.course import Bound, Run


def made(seconds: float = 600.0, n: int = 50) -> Run:
    time = np.linspace(seconds / n, seconds, n)
    drift = np.zeros((n, 2, 3))
    drift[:, :, 2] = (20.0 * time / seconds)[:, None]
    carried = np.zeros((n, 2, 3))
    carried[:, :, 2] = -np.floor(drift[:, :, 2])
    left = drift + carried
    left[: n // 2] = np.nan
    return Run(time, drift, carried, left, np.full((n, 2), 4000.0))


X = Bound("X", 0.0, 0.0, 0.0, 0.0, 0, math.nan)
Z = Bound("Z", -3.0, 20.0, 20.0, 0.81, 7, 9.0)


def test_panels_and_their_titles() -> None:
    figure = revision.draw(made(), [X, Z], [60.0, 300.0], "part.ngc, cold")
    x, z, speed = figure.axes
    assert x.get_title("left") == (
        "X: the tool drifts by up to 0.0 um; residual in the cuts at most 0.0 um; no bound, since the model "
        "was never judged"
    )
    assert z.get_title("left") == (
        "Z: the tool drifts by up to 20.0 um; residual in the cuts at most 0.8 um; bound 9.8 um"
    )
    assert speed.get_xlabel() == "time since the start of the program [min]"
    assert speed.get_xlim() == (0.0, 10.0)
    drift, taken, left = z.lines[1:4]
    assert np.nanmax(np.asarray(drift.get_ydata())) == 20.0
    assert np.nanmax(np.asarray(taken.get_ydata())) == 20.0  # minus the correction: it lies on the drift
    assert np.isnan(np.asarray(left.get_ydata())[:50]).all()  # nothing is cut in the first half
    marks = [line for line in speed.lines if len(set(np.asarray(line.get_xdata()).tolist())) == 1]
    assert [line.get_xdata()[0] for line in marks] == [1.0, 5.0]  # type: ignore[index]
    low, high = x.get_ylim()
    assert low <= -1 < 1 <= high  # noise of a still axis is not blown up
    (legend,) = figure.legends
    assert [t.get_text() for t in legend.get_texts()][-1] == "tool change"


def test_a_long_run_is_shown_in_hours_and_many_tool_changes_are_only_counted() -> None:
    changes = [float(k) for k in range(100)]
    figure = revision.draw(made(3 * 3600.0), [Z], changes, "")
    assert figure.axes[-1].get_xlabel().endswith("[h]")
    assert figure.axes[-1].get_xlim()[1] == pytest.approx(3.0)
    assert [t.get_text() for t in figure.legends[0].get_texts()][-1] == "100 tool changes, not shown"
    assert revision.render(made(), [Z], changes, "part.ngc").startswith(b"\x89PNG")
