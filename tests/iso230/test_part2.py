"""ISO 230-2: a small example by hand, an oracle by loops, and what must not change the values."""

import statistics

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from thermocomp.core.exceptions import InputError
from thermocomp.iso230.part2 import assess
from thermocomp.iso230.tables import positioning_content, positioning_tables
from thermocomp.volumetric.positioning import Positioning

FloatArray = NDArray[np.float64]

TARGETS = np.array([0.0, 100.0, 200.0])
# at target 0: 0, 1, 2 and so on; means 1, 4, 3 and -2, 1, 4; s 1, 0, 2 and 0, 1, 2
UP = np.array([[0.0, 4, 1], [1, 4, 3], [2, 4, 5]])
DOWN = np.array([[-2.0, 0, 2], [-2, 1, 4], [-2, 2, 6]])


def test_an_example_by_hand() -> None:
    r = assess(Positioning("Y", "cold", "um", TARGETS, UP, DOWN))
    assert r.up is not None
    assert r.down is not None
    assert r.up.mean.tolist() == [1, 4, 3]
    assert r.down.mean.tolist() == [-2, 1, 4]
    assert r.up.s.tolist() == [1, 0, 2]
    assert r.down.s.tolist() == [0, 1, 2]
    assert r.mean is not None
    assert r.mean.tolist() == [-0.5, 2.5, 3.5]
    assert r.reversal is not None
    assert r.reversal.tolist() == [3, 3, -1]
    assert r.repeatability is not None
    # 2*1 + 2*0 + 3 against 4 and 0; 2*0 + 2*1 + 3 against 0 and 4; 2*2 + 2*2 + 1 against 8 and 8
    assert r.repeatability.tolist() == [5, 5, 9]
    assert r.axis_values == {
        "A↑": 8.0,  # from 3 - 4 = -1 to 3 + 4 = 7
        "E↑": 3.0,
        "R↑": 8.0,
        "A↓": 10.0,  # from -2 to 4 + 4 = 8
        "E↓": 6.0,
        "R↓": 8.0,
        "A": 10.0,
        "E": 6.0,
        "M": 4.0,
        "R": 9.0,
        "B": 3.0,
        "mean B": pytest.approx(5 / 3),
    }
    assert r.notes == (
        "3 targets over 0.2 m; ISO 230-2 requires at least 5",
        "3 runs in direction +; ISO 230-2 requires 5",
        "3 runs in direction -; ISO 230-2 requires 5",
    )


@st.composite
def deviations(draw: st.DrawFn) -> tuple[FloatArray, FloatArray]:
    shape = (draw(st.integers(2, 6)), draw(st.integers(2, 6)))
    values = arrays(np.float64, shape, elements=st.floats(-100, 100).map(lambda v: round(v, 3)))
    return draw(values), draw(values)


def oracle(up: FloatArray, down: FloatArray) -> dict[str, float]:
    """The formulas, one loop after the other, without numpy."""
    n = up.shape[1]
    mu = [statistics.fmean(up[:, i]) for i in range(n)]
    md = [statistics.fmean(down[:, i]) for i in range(n)]
    su = [statistics.stdev(up[:, i].tolist()) for i in range(n)]
    sd = [statistics.stdev(down[:, i].tolist()) for i in range(n)]
    b = [mu[i] - md[i] for i in range(n)]
    m = [(mu[i] + md[i]) / 2 for i in range(n)]
    return {
        "A↑": max(mu[i] + 2 * su[i] for i in range(n)) - min(mu[i] - 2 * su[i] for i in range(n)),
        "E↑": max(mu) - min(mu),
        "R↑": max(4 * s for s in su),
        "A↓": max(md[i] + 2 * sd[i] for i in range(n)) - min(md[i] - 2 * sd[i] for i in range(n)),
        "E↓": max(md) - min(md),
        "R↓": max(4 * s for s in sd),
        "A": max(max(mu[i] + 2 * su[i], md[i] + 2 * sd[i]) for i in range(n))
        - min(min(mu[i] - 2 * su[i], md[i] - 2 * sd[i]) for i in range(n)),
        "E": max(mu + md) - min(mu + md),
        "M": max(m) - min(m),
        "R": max(max(2 * su[i] + 2 * sd[i] + abs(b[i]), 4 * su[i], 4 * sd[i]) for i in range(n)),
        "B": max(abs(v) for v in b),
        "mean B": statistics.fmean(b),
    }


def values(up: FloatArray, down: FloatArray) -> dict[str, float]:
    return assess(Positioning("X", "", "um", np.linspace(0.0, 500.0, up.shape[1]), up, down)).axis_values


@settings(max_examples=60, deadline=None)
@given(test=deviations(), shift=st.floats(-50, 50), scale=st.floats(0.1, 10))
def test_against_an_oracle_and_invariances(test: tuple[FloatArray, FloatArray], shift: float, scale: float) -> None:
    up, down = test
    found = values(up, down)
    assert found == pytest.approx(oracle(up, down), abs=1e-9)
    # another zero changes nothing; another unit changes all alike
    assert values(up + shift, down + shift) == pytest.approx(found, abs=1e-9)
    assert values(scale * up, scale * down) == pytest.approx({k: scale * v for k, v in found.items()}, abs=1e-8)
    # the other sign of the deviations, or the axis read from its other end, turn the mean reversal over and no more
    turned = {**found, "mean B": -found["mean B"]}
    assert values(-up, -down) == pytest.approx(turned, abs=1e-9)
    assert values(up[:, ::-1], down[:, ::-1]) == pytest.approx(found, abs=1e-9)
    # the order of the runs does not matter; the directions change places
    assert values(up[::-1], down[::-1]) == pytest.approx(found, abs=1e-9)
    swapped = values(down, up)
    assert swapped["A"] == pytest.approx(found["A"], abs=1e-9)
    assert swapped["A↑"] == pytest.approx(found["A↓"], abs=1e-9)
    # never smaller than what they are made of
    assert found["A"] >= max(found["A↑"], found["A↓"], found["E"]) - 1e-9
    assert found["R"] >= max(found["R↑"], found["R↓"], found["B"]) - 1e-9
    assert found["E"] >= max(found["E↑"], found["E↓"], found["M"]) - 1e-9


def test_one_direction_only() -> None:
    r = assess(Positioning("X", "", "um", TARGETS, None, DOWN))
    assert r.axis_values == {"A↓": 10.0, "E↓": 6.0, "R↓": 8.0}
    assert np.isnan(r.A)
    assert r.notes[-1].startswith("approached from one direction only")
    main, at_targets = positioning_tables([r])
    assert [row[0] for row in main.rows] == ["A↓", "E↓", "R↓"]
    assert at_targets.columns == ("target [mm]", "mean ↓", "s ↓")
    assert positioning_content(r)["B"] is None


def test_states_stand_side_by_side() -> None:
    cold = assess(Positioning("Y", "cold", "um", TARGETS, UP, DOWN))
    warm = assess(Positioning("Y", "warm", "um", TARGETS, UP + 0.05 * TARGETS, DOWN + 0.05 * TARGETS))
    main, *others = positioning_tables([cold, warm])
    assert main.columns == ("", "cold", "warm")
    assert {row[0]: row[1:] for row in main.rows}["R"] == (9.0, 9.0)
    assert [t.title for t in others] == ["Axis Y, cold: at the targets [um]", "Axis Y, warm: at the targets [um]"]
    assert others[0].rows[1] == (100.0, 4.0, 0.0, 1.0, 1.0, 2.5, 3.0, 5.0)


def test_a_long_axis_wants_more_targets() -> None:
    up = np.tile(np.arange(6.0), (5, 1))
    assert assess(Positioning("X", "", "um", np.linspace(0, 1000, 6), up, up)).notes == ()
    notes = assess(Positioning("X", "", "um", np.linspace(0, 1900, 6), up, up)).notes
    assert notes == ("6 targets over 1.9 m; ISO 230-2 requires at least 10",)


def test_a_single_run_tells_systematic_values_only() -> None:
    """ISO 230-2 over 2 m: one approach in each direction, every 250 mm."""
    positions = np.linspace(0.0, 3000.0, 13)
    up = (0.01 * positions)[None]
    r = assess(Positioning("X", "", "um", positions, up, up - 2.0))
    assert r.axis_values == pytest.approx({"E↑": 30.0, "E↓": 30.0, "E": 32.0, "M": 30.0, "B": 2.0, "mean B": 2.0})
    assert r.repeatability is None
    assert np.isnan([r.A, r.R]).all()
    assert r.notes == tuple(
        f"a single run in direction {d}: s, R and A need at least two; ISO 230-2 requires no more over 2 m"
        for d in "+-"
    )
    main, at_targets = positioning_tables([r])
    assert [row[0] for row in main.rows] == ["E↑", "E↓", "E", "M", "B", "mean B"]
    assert at_targets.columns == ("target [mm]", "mean ↑", "mean ↓", "mean", "B")
    content = positioning_content(r)
    assert content["s"] == {"+": None, "-": None}
    assert content["R"] is None
    # several runs in one direction only
    r = assess(Positioning("X", "", "um", positions, np.concatenate([up, up + 1.0]), up))
    assert {"A↑", "R↑", "E", "B"} <= r.axis_values.keys()
    assert not {"A↓", "R↓", "A", "R"} & r.axis_values.keys()
    assert r.notes == (
        "a single run in direction -: s, R and A need at least two; ISO 230-2 requires no more over 2 m",
    )


def test_what_is_wanted_changes_at_2_m() -> None:
    def notes(length: float, n: int, runs: int) -> tuple[str, ...]:
        up = np.tile(np.arange(float(n)), (runs, 1))
        return assess(Positioning("X", "", "um", np.linspace(0.0, length, n), up, up)).notes

    assert notes(2000.0, 10, 5) == ()
    assert notes(2000.0, 9, 5) == ("9 targets over 2 m; ISO 230-2 requires at least 10",)
    short = notes(2000.0, 10, 1)
    assert short[0] == "a single run in direction +: s, R and A need at least two, ISO 230-2 requires 5"
    assert notes(2250.0, 10, 3) == ()
    assert notes(2250.0, 9, 5) == ("9 targets over 2.25 m; ISO 230-2 requires at least 10",)


def test_the_uncertainty_is_said_not_to_be_told() -> None:
    r = assess(Positioning("Y", "cold", "um", TARGETS, UP, DOWN))
    assert "uncertainty is not given" in positioning_tables([r])[0].caption
    content = positioning_content(r)
    assert content["uncertainty"] is None
    assert "uncertainty is not given" in content["notes"][-1]


@pytest.mark.parametrize(
    ("positions", "up", "down", "told"),
    [
        ([0.0], np.zeros((5, 1)), None, "1 target; positioning needs at least 2"),
        ([0.0, 0.0], np.zeros((5, 2)), None, "must increase and differ"),
        ([0.0, 1.0], None, None, "expected deviations of at least one direction"),
        ([0.0, 1.0], np.zeros((0, 2)), None, "no run in direction +"),
        ([0.0, 1.0], np.zeros((2, 2)), np.zeros((2, 3)), "direction - have the shape"),
        ([0.0, 1.0], np.array([[0.0, np.nan], [0, 0]]), None, "must be finite"),
    ],
)
def test_refusals(positions: list[float], up: FloatArray | None, down: FloatArray | None, told: str) -> None:
    with pytest.raises(InputError, match=told):
        Positioning("X", "cold", "um", np.array(positions), up, down)
