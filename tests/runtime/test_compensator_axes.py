"""The compensator of axes: offset and slope, from models along one axis or from a whole machine."""

import math
from dataclasses import replace

import numpy as np
import pytest
from driftmodels import growing
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from volumetricmachine import random_machine

from thermocomp.core.correction import Correction, Limits
from thermocomp.core.exceptions import InputError
from thermocomp.core.machine import Source
from thermocomp.core.position import PositionModel
from thermocomp.core.reading import Reading
from thermocomp.core.zero import Zeroing
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.geometry.straight import straight_lines
from thermocomp.runtime.geometry.volumetric import VolumetricModel
from thermocomp.runtime.limits import limit_line

FloatArray = NDArray[np.float64]

OPEN = Limits(magnitude=1e9, rate=1e9, reading_age=1e9)


def along_x(*slopes: float, offset: float | None = None) -> PositionModel:
    units = ("um/m", "um/m^2")
    return PositionModel(
        target="EXX",
        unit="um",
        axis="X",
        travel=(-200.0, 600.0),
        reference_position=100.0,
        offset=None if offset is None else growing("EXX", offset),
        slopes=tuple(growing("EXX", k, unit) for unit, k in zip(units, slopes, strict=False)),
    )


def correction_at(compensator: Compensator, *temperatures: float) -> dict[str, Correction]:
    state = compensator.start()
    for k, t in enumerate(temperatures):
        state, said = compensator.step(state, Reading(10.0 * k, {"t": t}), 10.0 * k)
        assert not said.rejected
    return state.corrections


def test_offset_and_slope_of_an_axis() -> None:
    found = correction_at(Compensator.of([along_x(4.0, offset=3.0)], OPEN), 20.0, 25.0)["EXX"]
    assert (found.offset, found.slope, found.reference_position) == pytest.approx((-15.0, -20.0, 100.0))


def test_a_bend_is_taken_as_its_best_line() -> None:
    found = correction_at(Compensator.of([along_x(4.0, 10.0)], OPEN), 20.0, 21.0)["EXX"]
    q = 1e-3 * (np.linspace(-200.0, 600.0, 41) - 100.0)
    best = np.polynomial.Polynomial.fit(q, 4.0 * q + 10.0 * q**2, 1).convert().coef
    assert (found.offset, found.slope) == pytest.approx((-best[0], -best[1]))


@pytest.mark.parametrize("seed", range(3))
def test_a_machine_is_corrected_by_the_lines_of_its_axes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    bare = random_machine("XYZ", rng)
    components: dict[str, Source] = {"EXX": along_x(6.0, offset=1.0), "EBY": growing("EBY", 5.0, "urad"), "EYZ": 3.0}
    machine = replace(bare, components=components)
    found = correction_at(Compensator.of_machine(machine, (50.0, 0.0, 10.0), limits=OPEN), 20.0, 24.0)
    field = VolumetricModel(machine).replay(np.array([0.0, 10.0]), {"t": np.array([20.0, 24.0])})[1]
    wanted = {line.axis: line.correction for line in straight_lines(field, (50.0, 0.0, 10.0)).lines}
    assert found.keys() == wanted.keys()
    for axis, correction in wanted.items():
        p = np.array(machine.axis(axis).travel)
        assert found[axis].at(p) == pytest.approx(correction.at(p), abs=1e-9)


def test_the_zero_is_the_mean_of_the_first_readings_for_every_model() -> None:
    source = along_x(4.0, offset=3.0)
    assert source.offset is not None
    zeroing = Zeroing(20.0, 20.0)
    source = replace(
        source,
        offset=replace(source.offset, zeroing=zeroing),
        slopes=tuple(replace(m, zeroing=zeroing) for m in source.slopes),
    )
    running = Compensator.of([source], OPEN)
    assert correction_at(running, 20.0, 21.0)["EXX"] == Correction(0.0)  # not known yet
    found = correction_at(running, 19.0, 21.0, 20.0, 25.0)["EXX"]
    assert (found.offset, found.slope) == pytest.approx((-15.0, -20.0))


def test_a_dead_sensor_moves_no_line() -> None:
    running = Compensator.of([along_x(4.0, offset=3.0)], Limits(reading_age=1e9))
    state = running.start()
    for k, t in enumerate((20.0, 25.0)):
        state, _ = running.step(state, Reading(10.0 * k, {"t": t}), 10.0 * k)
    after, said = running.step(state, Reading(20.0, {"t": math.nan}), 20.0)
    assert said.rejected
    assert after.corrections == state.corrections


lines = st.builds(Correction, st.floats(-900, 900), st.floats(-900, 900), st.sampled_from([0.0, 100.0, -3000.0]))


@given(lines, lines, st.floats(0, 100), st.sampled_from([Limits(), Limits(20.0, 0.05, 0.5)]))
def test_the_limits_hold_from_end_to_end(wanted: Correction, now: Correction, dt: float, limits: Limits) -> None:
    travel = (-200.0, 600.0)
    current = limit_line(now, Correction(0.0, 0.0, now.reference_position), travel, 1e9, limits)
    found = limit_line(wanted, current, travel, dt, limits)
    for position in np.linspace(*travel, 9).tolist():
        assert abs(found.at(position)) <= limits.magnitude * (1 + 1e-12)
        assert abs(found.at(position) - current.at(position)) <= limits.rate * dt + 1e-9


def test_what_is_no_length_is_refused() -> None:
    with pytest.raises(InputError, match="predict um"):
        Compensator.of([growing("EBX", 1.0, "urad")])
    with pytest.raises(InputError, match="two models for the same target"):
        Compensator.of([growing("z", 1.0), growing("z", 2.0)])
