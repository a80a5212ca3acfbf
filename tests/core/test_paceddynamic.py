"""Paced models: states of the spindle speed that are faster while it turns, and the spread beside the deviation."""

from dataclasses import replace
from typing import Any, Literal

import numpy as np
import pytest

from thermocomp.core.band import Band
from thermocomp.core.exceptions import SettingError
from thermocomp.core.inputs import Input, Support
from thermocomp.core.joint import JointSupport
from thermocomp.core.paceddynamic import LaggedInput, PacedDynamic, SpeedState
from thermocomp.files import modelfile

MODEL = PacedDynamic(
    target="z_um",
    unit="um",
    inputs=(
        Input("T", "temperature", "degC", 20.0, False, -10.0, 20.0),
        Input("n", "spindle_speed", "1/min", 0.0, False, -6000.0, 6000.0),
    ),
    time_constants=(600.0,),
    temperatures=(LaggedInput(0, 0.5, (2.0,)),),
    top_speed=6000.0,
    states=(SpeedState(1, 2.0, 3600.0, 1200.0, 30.0),),
    spread=((0.1, 0.2, 3.0), (0.0, 0.0, 4.0)),
    band=Band(0.9, "assumption", 4, 1.0, 2.0, 3.0, (1,)),
)


def run(model: PacedDynamic, speeds: list[float], dt: float, temperature: float = 20.0) -> np.ndarray:
    state, found = model.init(), []
    for n in speeds:
        state, deviation = model.step(state, np.array([temperature, n]), dt)
        found.append(float(deviation))
    return np.array(found)


@pytest.mark.parametrize("share", [1.0, 0.5])
def test_the_rate_is_linear_in_the_speed(share: float) -> None:
    speed = 6000.0 * share
    rise = run(MODEL, [0.0, speed], 60.0)[1]
    rate = (1 - share) / 3600.0 + share / 1200.0
    assert rise == pytest.approx(30.0 * share**2 * -np.expm1(-60.0 * rate), rel=1e-12)


def test_a_spindle_that_stops_cools_at_the_slower_rate() -> None:
    warm = run(MODEL, [0.0] + [6000.0] * 2000 + [0.0], 60.0)
    assert warm[-2] == pytest.approx(30.0)
    assert warm[-1] == pytest.approx(30.0 * np.exp(-60.0 / 3600.0))


def test_the_sense_of_rotation_makes_no_difference() -> None:
    assert run(MODEL, [0.0, -3000.0, -3000.0], 60.0) == pytest.approx(run(MODEL, [0.0, 3000.0, 3000.0], 60.0))


def test_steps_may_be_of_any_length() -> None:
    assert run(MODEL, [0.0, *[4000.0] * 60], 60.0)[-1] == pytest.approx(run(MODEL, [0.0, 4000.0], 3600.0)[-1])


def test_the_band_is_the_spread_of_the_parts() -> None:
    state, reading = MODEL.init(), np.array([24.0, 3000.0])
    state, _ = MODEL.step(state, np.array([20.0, 0.0]), 0.0)
    assert MODEL.half_width(state, np.array([20.0, 0.0])) == pytest.approx(3.0)  # floor 1, factor 3 at rest
    state, _ = MODEL.step(state, reading, 300.0)
    lagged, paced = 4.0 * -np.expm1(-0.5), 0.25 * -np.expm1(-300.0 * (0.5 / 3600 + 0.5 / 1200))
    spread = np.hypot(0.1 * 4.0 + 0.2 * lagged + 3.0 * paced, 4.0 * paced)
    assert MODEL.half_width(state, reading) == pytest.approx(2.0 * np.hypot(1.0, spread), rel=1e-12)


@pytest.mark.parametrize(("away", "wider"), [(0.5, 1.0), (1.0, 1.0), (3.0, 2.0), (5.0, 3.0), (9.0, 3.0)])
def test_the_band_is_wider_far_from_the_training(away: float, wider: float) -> None:
    assert MODEL.band is not None
    joint = JointSupport((0,), (2.0,), ((0.0,),), 1.0)  # a distance of 1 is 2 degC
    far = replace(MODEL, band=replace(MODEL.band, widening=0.5), joint=joint)
    table = {"T": np.array([20.0, 20.0 + 2.0 * away]), "n": np.array([0.0, 3000.0])}
    plain, found = MODEL.half_widths(table, [0.0, 300.0]), far.half_widths(table, [0.0, 300.0])
    assert found == pytest.approx(plain * [1.0, wider], rel=1e-12)
    assert replace(far, joint=None).half_widths(table, [0.0, 300.0]) == pytest.approx(plain, rel=1e-12)
    assert modelfile.loads(modelfile.dumps([far])) == (far,)


@pytest.mark.parametrize("policy", ["hold", "fade"])
def test_the_band_is_wider_by_what_a_policy_keeps_back(policy: Literal["hold", "fade"]) -> None:
    plain, kept = (replace(MODEL, support=Support(p, margin=0.0)) for p in ("clip", policy))
    one, other = plain.init(), kept.init()
    for n in (0.0, 6000.0, 8000.0):  # the last is beyond the training
        reading = np.array([25.0, n])
        one, said = plain.step(one, reading, 600.0)
        other, passed = kept.step(other, reading, 600.0)
        assert kept.half_width(other, reading) == pytest.approx(plain.half_width(one, reading) + abs(said - passed))
    assert abs(said - passed) > 1.0


def test_a_band_without_spread_is_as_wide_as_its_floor() -> None:
    bare = replace(MODEL, spread=())
    state, reading = bare.init(), np.array([25.0, 6000.0])
    for _ in range(3):
        state, _ = bare.step(state, reading, 600.0)
    assert bare.half_width(state, reading) == pytest.approx(2.0)


def test_without_a_band_nothing_is_known() -> None:
    bare = replace(MODEL, band=None)
    state, _ = bare.step(bare.init(), np.array([20.0, 0.0]), 0.0)
    assert np.isnan(bare.half_width(state, np.array([20.0, 0.0])))
    assert np.isnan(MODEL.half_width(MODEL.init(), np.array([20.0, 0.0])))


def test_a_file_gives_the_same_bits() -> None:
    assert modelfile.loads(modelfile.dumps([MODEL])) == (MODEL,)


def test_what_it_is_made_of_has_names() -> None:
    assert MODEL.sensors == ("T", "n")
    assert MODEL.coefficients_by_name() == {"T": 0.5, "lag(T, 10 min)": 2.0, "lag((n/6000)^2, 60 to 20 min)": 30.0}
    assert MODEL.formula().startswith("0.5 T + 2 lag(T, 10 min) + 30 lag(")
    assert replace(MODEL, states=(replace(MODEL.states[0], weight=0.0),)).sensors == ("T",)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"temperatures": (LaggedInput(0, 0.5, ()),)}, "lagged coefficients of input 0: expected 1"),
        ({"temperatures": (LaggedInput(2, 0.5, (1.0,)),)}, "temperature 0: input index 2: expected 0 to 1"),
        ({"states": (SpeedState(1, 2.0, 600.0, 1200.0, 1.0),)}, "the first must not be longer"),
        ({"states": (SpeedState(1, 20.0, 3600.0, 1200.0, 1.0),)}, "power"),
        ({"states": (SpeedState(1, 2.0, float("nan"), 1200.0, 1.0),)}, "stopped"),
        ({"states": (SpeedState(1, 2.0, 3600.0, 1200.0, float("inf")),)}, "weight"),
        ({"time_constants": (0.0,)}, "time_constants"),
        ({"top_speed": 0.0}, "top_speed"),
        ({"spread": ((1.0,),)}, "a row of spread has 1 numbers; expected 3"),
        ({"spread": ((1.0, 1.0, float("nan")),)}, "spread"),
        ({"band": Band(0.9, "conformal", 9, 1.0, 1.0, 1.0, (2,))}, "band uses input index 2: expected 0 to 1"),
    ],
)
def test_numbers_that_do_not_fit_are_refused(change: dict[str, Any], says: str) -> None:
    with pytest.raises(SettingError, match=says):
        replace(MODEL, **change)


@pytest.mark.parametrize(
    "change",
    [
        {"level": 1.5},
        {"level": 0.0},
        {"cycles": 1},
        {"basis": "conformal", "cycles": 8},
        {"floor": -1.0},
        {"floor": 0.0},
        {"running": float("nan")},
        {"running": 0.0},
        {"stopped": 1e12},
        {"speeds": (1, 1)},
        {"speeds": (-1,)},
        {"widening": -0.1},
        {"widening": float("nan")},
    ],
)
def test_a_band_of_nonsense_is_refused(change: dict[str, Any]) -> None:
    with pytest.raises(SettingError, match="band: "):
        replace(MODEL.band, **change)  # type: ignore[type-var]


def test_a_band_says_by_what_it_holds() -> None:
    assert MODEL.band is not None
    assert MODEL.band.words == "90 % band by assumption, 4 cycles"
    assert replace(MODEL.band, basis="conformal", cycles=12).words == "90 % band conformal, 12 cycles"
    assert replace(MODEL.band, speeds=()).half_width(np.zeros(2), np.zeros(())) == 3.0  # the larger one
