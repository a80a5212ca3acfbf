"""The figure of a plan: what was recorded, and the next test in the gap that it fills."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from smallmachine import small_machine

from thermocomp.judging.planning.planning import SAME, Covered, Plan, plan
from thermocomp.judging.planning.trial import Trial
from thermocomp.recordings.stacking import stack
from thermocomp.report import plans


@pytest.fixture(scope="module")
def found() -> Plan:
    return plan(stack([small_machine()], ["z_um"]), 6000.0)


def points(ax: Axes, marker: str) -> list[tuple[float, float]]:
    lines: list[Line2D] = [line for line in ax.lines if line.get_marker() == marker]
    filled = [line for line in lines if line.get_markerfacecolor() != "none"]
    return sorted((x, y) for line in filled for x, y in np.asarray(line.get_xydata(), dtype=np.float64).tolist())


def test_what_was_recorded_is_known(found: Plan) -> None:
    # runs and stops of 100 min; the first row of all stands, the last row of a stop has no step after it
    speeds, runs, stops = np.array(found.covered.runs).T
    assert speeds.tolist() == [1000.0, 2500.0, 1800.0, 3000.0]
    assert runs == pytest.approx(6000.0, abs=120.0)
    assert stops == pytest.approx(6000.0, abs=120.0)
    assert found.covered.rooms == ()


def test_the_next_test_stands_in_its_gap(found: Plan) -> None:
    figure = plans.draw(found, None).figure
    runs, stops, room, tests = figure.axes
    best = found.candidates[0].trial
    assert best.kind == "stop"
    assert points(runs, "o") == pytest.approx(np.array([(v, t / 3600) for v, t, _ in sorted(found.covered.runs)]))
    assert points(stops, "o") == pytest.approx(np.array([(v, s / 3600) for v, _, s in sorted(found.covered.runs)]))
    assert points(runs, "*") == points(stops, "*") == [(6000.0, 6.0)]
    assert points(room, "*") == []
    (near,) = (p for p in runs.patches if p.get_label() == "treated as the same speed")
    ends = near.get_window_extent().transformed(runs.transData.inverted())
    assert (ends.x0, ends.x1) == pytest.approx((6000 - SAME * 6000, 6000 + SAME * 6000))
    assert not [v for v, _, _ in found.covered.runs if ends.x0 <= v <= ends.x1]  # it is a gap
    assert [t.get_text() for t in room.texts] == ["no room temperature\nwas recorded"]
    assert len(tests.patches) == len(found.candidates)
    shown = figure.subfigs[0].get_suptitle()
    assert shown == f"next: {best.words}: no run faster than 3,000 1/min"


def test_speeds_in_a_random_order_are_all_marked(found: Plan) -> None:
    figure = plans.draw(replace(found, proof=True), None).figure
    runs, stops, room, _ = figure.axes
    speeds = [1200.0, 2400.0, 3600.0, 4800.0, 6000.0]
    assert points(runs, "*") == points(stops, "*") == [(v, 0.5) for v in speeds]
    assert points(room, "*") == []
    assert "in a random order (seed 0)" in (figure.subfigs[0].get_suptitle() or "")


@pytest.mark.parametrize("rooms", [(), (0.4,), tuple(0.1 * k for k in range(30))])
def test_a_test_of_the_room_is_marked_there(found: Plan, rooms: tuple[float, ...]) -> None:
    best, *others = found.candidates
    still = replace(best, trial=Trial("room", 0.0, ((0.0, 900.0), (0.0, 43200.0))), news="")
    there = replace(found, candidates=(still, *others), covered=Covered(found.covered.runs, rooms))
    figure = plans.draw(there, None).figure
    runs, stops, room, _ = figure.axes
    assert points(runs, "*") == points(stops, "*") == []
    assert points(room, "*") == [(len(rooms) + 1.0, found.swing)]
    assert [bar.get_height() for bar in room.patches] == list(rooms)  # type: ignore[attr-defined]
    low, high = room.get_ylim()
    assert low == 0
    assert high > max(found.swing, *rooms, 0)
    assert figure.subfigs[0].get_suptitle() == f"next: {still.trial.words}"


def test_a_run_without_a_stop_is_no_stop(found: Plan) -> None:
    best, *others = found.candidates
    run = replace(best, trial=Trial("run", 6000.0, ((0.0, 900.0), (6000.0, 43200.0))))
    runs, stops, *_ = plans.draw(replace(found, candidates=(run, *others), swing=0.0), None).figure.axes
    assert points(runs, "*") == [(6000.0, 12.0)]
    assert points(stops, "*") == []
