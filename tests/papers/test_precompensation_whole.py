"""Pre-compensation: the minutes, tests, positions and models of which the errors and depths are told."""

from dataclasses import fields
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from thermocomp.core.machine import Channel
from thermocomp.papers.precompensation import cutting, program, redo, setup
from thermocomp.papers.precompensation.setup import (
    CUTS,
    LEAST,
    LINEAR,
    NET,
    NONE,
    POSITIONS,
    Computed,
    CuttingTest,
)
from thermocomp.papers.study import tell_nobody
from thermocomp.recordings.cycles import find_cycles
from thermocomp.recordings.recording import Recording


def test_surfaces_are_milled_in_the_first_and_the_last_five_minutes(monkeypatch: pytest.MonkeyPatch) -> None:
    """P-07: of the spindle's running, to the minute; before and after it the machine rests."""
    speed = np.repeat([0.0, 2000.0, 900.0, 2000.0, 0.0], [3, 5, 30, 5, 4])
    minutes = np.arange(float(len(speed)))
    drifts = {f"z_at_{p}_um": (1 + p / 1000) * minutes**2 for p in POSITIONS}
    channels = (*(Channel(c, "displacement", "um") for c in drifts), Channel("spindle_rpm", "spindle_speed", "1/min"))
    table = pd.DataFrame({**drifts, "spindle_rpm": speed})
    test = Recording("cut", 60 * minutes, table, channels, find_cycles(60 * minutes, speed))
    monkeypatch.setattr(setup, "at_positions", lambda _, samples: np.zeros((len(samples), len(POSITIONS))))
    found = setup.cut(test, [])
    cold, later = np.mean(np.arange(3.0, 8.0) ** 2), np.mean(np.arange(38.0, 43.0) ** 2)
    assert found.without == pytest.approx([(1 + p / 1000) * (later - cold) for p in POSITIONS])
    np.testing.assert_array_equal(found.scheduled, found.without)


def test_depths_are_means_over_all_cutting_tests() -> None:
    """P-07: without and with the corrected program."""
    cuts = [CuttingTest(np.array([4.0, -4.0]), np.array([1.0, 1.0])), CuttingTest(np.full(2, 8.0), np.full(2, -3.0))]
    assert Computed.depths.fget(SimpleNamespace(cuts=cuts)) == (6.0, 2.0)  # type: ignore[attr-defined]


def test_depths_in_table_and_figure_are_not_exchanged(monkeypatch: pytest.MonkeyPatch) -> None:
    """P-07: of each test, without compensation and with it, by position."""
    cuts = [CuttingTest(np.array([10.0, 20.0, 30.0, 40.0]) + n, np.array([1.0, 2.0, 3.0, 4.0])) for n in range(CUTS)]
    some = np.zeros(3)
    c: Any = SimpleNamespace(
        judge=SimpleNamespace(time=some, deviations=np.zeros((3, 4))),
        left={NET: np.zeros((3, 4))},
        free_run={NET: np.zeros((3, 4))},
        schedule=np.zeros((3, 4)),
        cuts=cuts,
        between={LINEAR: cuts},
        orders=[[]],
        clocks={},
        warm=SimpleNamespace(hours=some, drift=some, cold=some, carried=some),
    )
    monkeypatch.setattr(redo, "errors_table", lambda *_: None)
    (table,) = (t for t in redo._tables(c) if t and t.caption.startswith("Depth difference between"))
    assert list(table.rows[1]) == ["test 2", "+11.0", "+21.0", "+31.0", "+41.0", "+1.0", "+2.0", "+3.0", "+4.0"]
    (figure,) = (f for f in redo._figures(c) if f.key == "precompensation-cut")
    drawn = {curve.label: curve.y.tolist() for curve in figure.panels[0].curves}
    assert drawn == {"without": [25.0 + n for n in range(CUTS)], "with": [2.5] * CUTS}


def test_programs_are_milled_in_tests_of_their_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """P-07: eight of them in each state of machine and room, each with its own hour of speeds."""
    asked: list[int] = []

    def record(_: Any, *, seed: int) -> list[int]:
        asked.append(seed)
        return [seed]

    def stop(_: Any) -> None:
        raise InterruptedError

    monkeypatch.setattr(cutting, "record", record)
    monkeypatch.setattr(program, "write_program", stop)
    with pytest.raises(InterruptedError):
        cutting.compute({}, 5, tell_nobody)
    assert asked == [5 + n for n in range(8)] * 4


def test_the_depth_is_that_of_the_second_surface_below_or_above_the_first() -> None:
    """P-07: at each position, by the means of both faces."""
    faces: list[Any] = [SimpleNamespace(number=n, position=float(p)) for n in (1, 2) for p in POSITIONS]
    lies = [np.array([k - 1.0, k + 1.0]) for k in (0.0, 1.0, 2.0, 3.0, 10.0, 13.0, 16.0, -19.0)]
    assert cutting._second_minus_first(faces, lies) == [10.0, 12.0, 14.0, -22.0]


def test_every_model_is_judged_by_its_own_free_run_at_every_position(monkeypatch: pytest.MonkeyPatch) -> None:
    """P-05: error and described share in the verification, also in the table of the residuals."""
    rng = np.random.default_rng(5)
    z, learned = np.cumsum(rng.normal(size=(2, 60, 4)), axis=1)
    judge, learn = (SimpleNamespace(deviations=d, time=60.0 * np.arange(60)) for d in (z, learned))
    free = {name: z + size * rng.normal(size=z.shape) * [1, 2, 3, 4] for name, size in ((NET, 0.1), (LEAST, 0.3))}

    def at_positions(models: Any, samples: Any) -> Any:
        assert samples is judge
        return free[models]

    monkeypatch.setattr(setup, "at_positions", at_positions)
    given: Any = dict.fromkeys(f.name for f in fields(Computed))
    one = CuttingTest(np.ones(3), np.ones(3))
    given |= {"judge": judge, "learn": learn, "models": {name: name for name in free}, "orders": [()], "clocks": {}}
    c = Computed(**given | {"cuts": [], "between": {LINEAR: [one]}})
    (table,) = (t for t in redo._tables(c) if t.caption.startswith("Free run in the verification"))
    assert [tuple(row[:2]) for row in table.rows] == [
        (f"z at {p} mm", name) for p in POSITIONS for name in (NONE, NET, LEAST)
    ]
    rms = {(row[0], row[1]): row[2] for row in table.rows}
    for name, predicted in free.items():
        left = z - predicted
        assert c.errors[name].rms == pytest.approx(np.sqrt(np.mean(left**2)))
        assert c.errors[name].max_abs == np.abs(left).max()
        shares = 1 - np.sum(left**2, axis=0) / np.sum((z - z.mean(axis=0)) ** 2, axis=0)
        assert c.shares(name) == pytest.approx(shares.tolist())
        for k, p in enumerate(POSITIONS):
            assert rms[f"z at {p} mm", name] == f"{np.sqrt(np.mean(left[:, k] ** 2)):.2f}"
