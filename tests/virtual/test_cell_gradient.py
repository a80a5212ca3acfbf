"""The gradient of the thermal cell (W-15): the room has it, the tool feels it, and the protocol sets it."""

from dataclasses import replace

import numpy as np
import pytest

from thermocomp.virtual.climate import STILL
from thermocomp.virtual.datasets import EXPERIMENTS, record
from thermocomp.virtual.machine import Air, FeedDrive
from thermocomp.virtual.nonlinear import NonlinearTool
from thermocomp.virtual.toolsystem import RestingTool


@pytest.mark.parametrize("layers", [1.5, -0.5])
def test_the_air_of_a_day_has_the_gradient_of_its_room(layers: float) -> None:
    """W-15: on average; the day and doors change it."""
    room, found = replace(STILL, layers=layers), []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        _, air = room.air(room.init(rng), 0.0, 600.0, 144, rng)
        found.append(air[:, 1].mean())
    assert np.mean(found) == pytest.approx(layers, rel=0.1)
    assert room.middle.values.tolist() == [22.0, layers, 0.0]


@pytest.mark.parametrize("machine", [RestingTool(), NonlinearTool()])
def test_a_gradient_cools_the_foot_below_the_tip(machine: RestingTool) -> None:
    """W-15: a tool at rest comes to the state in which one begins that has always been in the gradient."""
    air = Air(20.0, 2.0)
    _, left = machine.run(machine.init(Air(20.0)), [FeedDrive()] * 3600, np.tile(air.values, (3600, 1)), 60.0)
    _, begun = machine.run(machine.init(air), [FeedDrive()], air.values[None], 1.0)
    tip, middle, foot = (machine.places.index(place) for place in ("t1", "t5", "t7"))
    for warm in (left.temperatures[-1], begun.temperatures[-1]):
        assert warm[tip] - 0.1 > warm[middle] > warm[foot] + 0.1
    np.testing.assert_allclose(left.temperatures[-1], begun.temperatures[-1], atol=0.1)


def test_the_cell_of_the_heated_tool_has_a_gradient() -> None:
    """W-15: the same in both tests; in another one, by 4 K/m, the same test is warmer above, colder below."""
    planned = EXPERIMENTS["wessel-tool"]
    assert [(p.climate.layers, p.foundation) for p in planned.programmes(0)] == [(1.0, -2.0)] * 2
    below, above = (
        record(replace(planned, tests=(replace(planned.tests[1], climate=replace(STILL, layers=by)),)))[0].table
        for by in (-2.0, 2.0)
    )
    rises = {k: float((above[f"t_t{k}_C"] - below[f"t_t{k}_C"]).mean()) for k in (1, 5, 8)}
    assert rises[1] > 0.05 > -0.1 > rises[5] > rises[8]
