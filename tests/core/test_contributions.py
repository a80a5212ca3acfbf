"""What the answer of a paced model is made of: the parts sum up to it, and no reading adds more than is said."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thermocomp.core.band import Band
from thermocomp.core.contributions import contributions, gains
from thermocomp.core.exceptions import InputError
from thermocomp.core.inputs import Input
from thermocomp.core.lineardynamic import LinearDynamic
from thermocomp.core.paceddynamic import LaggedInput, PacedDynamic, SpeedState

MODEL = PacedDynamic(
    target="z_um",
    unit="um",
    intercept=0.5,
    inputs=(
        Input("T1", "temperature", "degC", 20.0, True, -10.0, 20.0),
        Input("n", "spindle_speed", "1/min", 0.0, False, -6000.0, 6000.0),
        Input("T2", "temperature", "degC", 20.0, True, -10.0, 20.0),
    ),
    time_constants=(600.0, 3600.0),
    temperatures=(LaggedInput(0, 0.5, (2.0, -1.0)), LaggedInput(2, -0.25, (0.0, 4.0))),
    top_speed=6000.0,
    states=(SpeedState(1, 2.0, 3600.0, 1200.0, 30.0), SpeedState(1, 1.0, 600.0, 600.0, -10.0)),
)
TIME = np.r_[np.arange(0.0, 6000.0, 60.0), np.arange(0.0, 3000.0, 30.0)]  # two tests


def table(seed: int = 0, spread: float = 8.0) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    n = len(TIME)
    return {
        "time_s": TIME,
        "T1": 20 + spread * rng.normal(size=n),
        "T2": 20 + spread * rng.normal(size=n),
        "n": rng.choice([0.0, 3000.0, 9000.0], n),
    }


@pytest.mark.parametrize("missing", [False, True])
def test_the_parts_sum_up_to_the_answer(missing: bool) -> None:
    rows = table()
    if missing:
        rows["T2"][[5, 6, 150]] = np.nan
    found = contributions(MODEL, rows)
    assert list(found) == ["T1", "n", "T2"]
    assert sum(found.values()) + MODEL.intercept == pytest.approx(MODEL.predict(rows), rel=1e-12, abs=1e-12)


def test_each_part_is_the_answer_to_that_input_alone() -> None:
    rows = table()
    still = {**rows, "T1": np.full(len(TIME), 20.0), "n": np.zeros(len(TIME))}
    assert contributions(MODEL, rows)["T2"] == pytest.approx(MODEL.predict(still) - 0.5, rel=1e-12, abs=1e-12)


def test_before_the_first_reading_there_is_nothing() -> None:
    rows = table()
    rows["T1"][:3] = np.nan
    assert [v[:3].tolist() for v in contributions(MODEL, rows).values()] == [[0.0] * 3] * 3


def test_gains_are_what_a_step_comes_to() -> None:
    by_name = {g.name: g for g in gains(MODEL, 60.0)}
    for name, start, change in (("T1", 20.0, 1.0), ("T2", 20.0, 1.0), ("n", 0.0, 6000.0)):
        rows = {"T1": np.full(3, 20.0), "T2": np.full(3, 20.0), "n": np.zeros(3)}
        rows[name] = np.array([start, start + change, start + change])
        _, now, late = MODEL.predict(rows, np.array([0.0, 60.0, 60.0 + 1e6])) - 0.5
        assert by_name[name].instantaneous == pytest.approx(now)
        assert by_name[name].settled == pytest.approx(late)
    assert by_name["T1"].settled == 1.5


@given(st.integers(0, 10_000), st.floats(1.0, 1e6))
def test_no_reading_adds_more_than_the_bound(seed: int, spread: float) -> None:
    found = contributions(MODEL, table(seed, spread))
    for g in gains(MODEL, 60.0):
        assert np.abs(found[g.name]).max() <= g.bound * (1 + 1e-12)


def test_the_bound_is_reached() -> None:
    by_name = {g.name: g for g in gains(MODEL, 60.0)}
    alone = replace(MODEL, temperatures=(LaggedInput(0, 0.5, (2.0, 1.0)), MODEL.temperatures[1]))
    rows = {"T1": np.array([20.0, 1e3, 1e3]), "T2": np.full(3, 20.0), "n": np.zeros(3)}
    last = contributions(alone, rows, np.array([0.0, 60.0, 1e7]))["T1"][-1]
    bound = {g.name: g for g in gains(alone, 60.0)}["T1"].bound
    assert last == pytest.approx(bound)
    # lags of opposite sign can add up on the way: -1 still follows what was, 0.5 + 2 what is
    assert by_name["T1"].bound == pytest.approx(2.5 * 27.5 + 1.0 * 17.5)


def test_only_paced_models_have_parts_and_a_step_is_positive() -> None:
    other = LinearDynamic(
        target="z_um",
        unit="um",
        inputs=MODEL.inputs,
        signals=((0,),),
        direct=(2.0,),
        lag_signals=(),
        time_constants=(),
        lagged=(),
    )
    with pytest.raises(InputError, match=r"z_um has a model of the family linear-dynamic.* averaged produces"):
        gains(other, 60.0)
    known = contributions(other, table())
    assert not any(part.any() for name, part in known.items() if name != MODEL.inputs[0].name)
    with pytest.raises(InputError, match="a term depends on several inputs"):
        contributions(replace(other, signals=((0, 1),)), table())
    for step in (0.0, -5.0, np.nan):
        with pytest.raises(InputError, match=f"^step {step}: the time between two rows .s. must be"):
            gains(MODEL, step)
    assert gains(MODEL, np.inf)[0].settled == gains(MODEL, np.inf)[0].instantaneous


def test_the_largest_comes_first() -> None:
    bounds = [g.bound for g in gains(MODEL, 60.0)]
    assert bounds == sorted(bounds, reverse=True)


def test_half_widths_of_a_table_are_those_of_its_steps() -> None:
    rows = table()
    rows["T1"][[0, 7]] = np.nan
    assert np.isnan(MODEL.half_widths(rows)).all()
    banded = replace(MODEL, band=Band(0.9, "assumption", 4, 1.0, 2.0, 3.0, (1,)), spread=((1.0,) * 8,))
    found = banded.half_widths(rows)
    assert np.isnan(found[0])
    assert found[7] == found[6]
    assert np.isfinite(found[1:]).all()
    state = banded.init()
    for k in (1, 2, 3):
        reading = np.array([rows["T1"][k], rows["n"][k], rows["T2"][k]])
        state, _ = banded.step(state, reading, 60.0)
        assert found[k] == pytest.approx(banded.half_width(state, reading), rel=1e-12)
