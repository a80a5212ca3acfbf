"""X-01: what a virtual machine needs so that the papers' methods differ: several time constants, air, hysteresis."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from thermocomp.virtual.centre import MachiningCentre
from thermocomp.virtual.climate import STILL, Climate
from thermocomp.virtual.datasets import EXPERIMENTS
from thermocomp.virtual.experiments import SimulatedTest, simulate

FloatArray = NDArray[np.float64]


@cache
def recorded(experiment: str, climate: Climate = STILL) -> SimulatedTest:
    """Return the last test of an experiment, in still air; Chen's: 6 h at 2600 1/min, then 10 h at rest."""
    plan = replace(EXPERIMENTS[experiment].tests[-1], climate=climate)
    *_, test = simulate(replace(EXPERIMENTS[experiment], tests=(plan,)), seed=0)
    return test


def rise(test: SimulatedTest, place: str) -> FloatArray:
    """Return the temperature rise of a place since the start [degC]."""
    heat = test.values[:, [c.name for c in test.channels].index(f"t_{place}_C")]
    return np.asarray(heat - heat[0])


def growth(test: SimulatedTest) -> FloatArray:
    """Return the true drift of Z since the start [um]."""
    z = test.truth[:, [c.name for c in test.displacements].index("z_um")]
    return np.asarray(z - z[0])


def passed(x: FloatArray, level: float) -> int:
    """Return the first row in which a quantity has passed a level on the way from its first value."""
    return int(np.argmax((x - level) * np.sign(level - x[0]) >= 0))


#: rows per hour, and the last one with a turning spindle
HOUR, STOP = 10, 60


def test_a_bearing_cools_with_several_time_constants() -> None:
    """X-01: a body of one time constant loses one half, and half of the rest, in equal times."""
    cooling = rise(recorded("chen1996"), "front_seat")[STOP:]
    half, quarter = (passed(cooling, share * cooling[0]) for share in (0.5, 0.25))
    assert half > 0
    assert quarter - half > 1.5 * half


def test_places_have_different_time_constants() -> None:
    """X-01: a bearing follows the spindle within the hour or so, the column takes hours."""
    warming = {p: rise(recorded("chen1996"), p)[: STOP + 1] for p in ("front_seat", "housing", "column_front_right")}
    bearing, housing, column = (passed(x, 0.63 * x[-1]) for x in warming.values())
    assert bearing < 1.5 * HOUR
    assert bearing < housing < column
    assert column > 2 * bearing


@pytest.mark.parametrize("place", ["front_seat", "housing", "column_front_right"])
def test_the_drift_of_z_runs_through_a_loop(place: str) -> None:
    """X-01, W-08: at equal temperature Z differs between warm-up and cool-down: no function of this one is enough."""
    heat, z = rise(recorded("chen1996"), place), growth(recorded("chen1996"))
    middle = 0.5 * heat[STOP]
    up, down = passed(heat[: STOP + 1], middle), STOP + passed(heat[STOP:], middle)
    assert abs(z[up] - z[down]) > 0.1 * np.abs(z).max()


def test_the_air_alone_moves_the_machine() -> None:
    """X-01: for a day at rest; in still air it hardly moves."""
    still, usual = (growth(recorded("etve", climate)) for climate in (STILL, Climate()))
    assert np.ptp(usual) > 2.0
    assert np.ptp(still) < 0.1 * np.ptp(usual)


def test_a_warm_spindle_grows() -> None:
    """Towards the workpiece: the table's probe reads less distance."""
    z = growth(recorded("chen1996"))
    tip = recorded("wessel-fem").truth[:, 1]
    assert z[STOP] < -10.0
    assert tip.max() > 10.0


def test_the_foot_of_the_column_sticks() -> None:
    machine = MachiningCentre()
    row = machine._observable("slide")
    wish = np.array([3.0, 2.5, 0.0])
    fields = np.tile(machine.model.one * 20.0, (3, 1)) + np.outer(wish / (row @ row), row)
    _, slid = machine._truth(fields, np.zeros(3), 0.0)
    assert slid == pytest.approx(1.0)
