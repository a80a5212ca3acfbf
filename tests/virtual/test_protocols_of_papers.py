"""Protocols of the papers: what rests does rest, and what is unseen is unseen; a thermal cell acts on the tool."""

from dataclasses import replace

import numpy as np
import pytest

from thermocomp.virtual.datasets import EXPERIMENTS, record


@pytest.mark.parametrize(
    "experiment", ["chen1996", "chen1996-new", "stepwise2017", "stepwise2017-online", "wessel-milling"]
)
def test_while_the_spindle_stands_the_axes_rest(experiment: str) -> None:
    """C-32, T-01, T-09, W-09: the machine cools down in a stop; while it runs, the axes move."""
    for planned in EXPERIMENTS[experiment].programmes(0):
        for s in planned.segments:
            assert any(s.drive.feed) is bool(s.drive.speed)
            assert s.drive.speed or not any(s.drive.loads.values())


def test_speeds_of_the_online_test_were_not_trained() -> None:
    """T-09: other speeds than those of the test from which the temperatures were chosen."""
    trained, online = (
        {s.drive.speed for p in EXPERIMENTS[e].programmes(0) for s in p.segments} - {0.0}
        for e in ("stepwise2017", "stepwise2017-online")
    )
    assert not trained & online
    assert (len(trained), len(online)) == (4, 3)


def test_each_day_of_milling_has_its_cutting_speeds() -> None:
    """W-09: 120, 200 and 370 m/min with a cutter of 50 mm, one each on three days, all on the fourth and the fifth."""
    slow, usual, fast = (float(round(1000 * v / (np.pi * 50))) for v in (120, 200, 370))
    found = [{s.drive.speed for s in p.segments} - {0.0} for p in EXPERIMENTS["wessel-milling"].programmes(0)]
    assert found == [{slow}, {usual}, {fast}, {slow, usual, fast}, {slow, usual, fast}]


def test_the_foundation_of_the_cell_warms_the_tool() -> None:
    """W-15: the same test, weather and noise, on a foundation that is 8 K warmer."""
    planned = EXPERIMENTS["wessel-tool"]
    cold, warm = (
        record(replace(planned, tests=tuple(replace(t, foundation=by) for t in planned.tests[1:])))[0].table
        for by in (-4.0, 4.0)
    )
    rises = {k: float((warm[f"t_t{k}_C"] - cold[f"t_t{k}_C"]).mean()) for k in (7, 8, 1, 9)}
    assert 8.0 > rises[7] > rises[8] > rises[1] > 0.0
    assert abs(rises[9]) < 0.05  # the room
