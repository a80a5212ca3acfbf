"""All tests counted from one cold state: a machine that is not the same every morning (C-03, C-07)."""

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray

from thermocomp.core.exceptions import InputError
from thermocomp.core.machine import Channel
from thermocomp.recordings.cycles import make_single_cycle
from thermocomp.recordings.profiles import Profiles
from thermocomp.recordings.recording import Recording
from thermocomp.volumetric.models.position import PositionOptions, fit_position

FloatArray = NDArray[np.float64]
POSITIONS = np.linspace(0.0, 500.0, 6)
#: k1 [um/m per degC], and the profile at 20 degC [um]
LAW, GEOMETRY = 3.0, 0.02 * POSITIONS


def a_day(name: str, morning: float, positions: FloatArray = POSITIONS) -> Profiles:
    """A day that begins at a temperature, warms by ten degrees and cools down."""
    temperature = morning + 10.0 * np.sin(np.linspace(0.0, np.pi, 25))
    values = 0.02 * positions + np.outer(LAW * (temperature - 20.0), 1e-3 * positions)
    points = np.zeros((len(positions), 3))
    points[:, 1] = positions
    states = Recording(
        name,
        np.linspace(0.0, 24.0 * 1200.0, 25),
        pd.DataFrame({"t": temperature}),
        (Channel("t", "temperature", "degC"),),
        make_single_cycle(25),
    )
    return Profiles("EYY", "um", "Y", points, values, states)


DAYS = (a_day("cold", 17.0), a_day("mild", 21.0), a_day("hot", 25.0))


def told(rezero: bool, morning: float) -> FloatArray:
    """The error of the profile on the morning of another day."""
    model = fit_position(DAYS, PositionOptions(method="ols", rezero=rezero)).model
    (slope,) = model.models
    state = slope.init()
    state, _ = slope.step(state, np.array([morning]), 0.0)
    day = a_day("new", morning)
    return np.asarray(model.at(day.points, np.array([float(state.deviation)])) - day.values[0])


def test_a_model_of_absolute_temperatures_knows_the_morning() -> None:
    assert np.abs(told(rezero=False, morning=23.5)).max() < 1e-9
    # counted from its own start every day begins with the mean profile, which it does not have
    assert np.abs(told(rezero=True, morning=23.5)).max() == pytest.approx(LAW * (23.5 - 21.0) * 0.5)


def test_its_zero_is_the_mean_cold_state_and_holds_live() -> None:
    fit = fit_position(DAYS, PositionOptions(method="ols", rezero=False))
    (inputs,) = fit.model.slopes[0].inputs
    assert not inputs.rezero
    assert inputs.reference == pytest.approx(21.0)
    assert fit.model.profile is not None
    assert fit.model.profile.at(DAYS[0].points) == pytest.approx(GEOMETRY + LAW * 1.0 * 1e-3 * POSITIONS)


def test_the_mean_is_that_of_the_tests_that_were_learned_from() -> None:
    learn = np.repeat([True, True, False], 25)
    fit = fit_position(DAYS, PositionOptions(method="ols", rezero=False), learn=learn)
    assert fit.model.slopes[0].inputs[0].reference == pytest.approx(19.0)
    assert fit.model.slopes[0].coefficients_by_name()["t"] == pytest.approx(LAW)


def test_tests_at_other_positions_cannot_share_a_cold_profile() -> None:
    other = a_day("elsewhere", 20.0, POSITIONS + 10.0)
    with pytest.raises(InputError, match="need the same positions"):
        fit_position((*DAYS, other), PositionOptions(method="ols", rezero=False))
