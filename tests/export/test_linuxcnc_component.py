"""The component of an export to LinuxCNC: it does what the compensator does, and moves no axis that it may not."""

import itertools
import math
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from driftmodels import growing
from halstand import HalStand, needs_halcompile
from watchedmachine import watched_model

from thermocomp.core.correction import Limits
from thermocomp.core.exceptions import InputError
from thermocomp.core.model import ErrorModel
from thermocomp.core.position import PositionModel
from thermocomp.export.facts import Facts
from thermocomp.export.linuxcnc.package import write_package
from thermocomp.export.scenarios import make_readings
from thermocomp.export.vectors import Readings, replay
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.program.tables import gather

FACTS = Facts("model.json", "0" * 64, "1", "2026-01-31")
#: what an order of the servo thread brings at most [mm]: half a count
FINE = 0.51e-5
OLD = 1e9

Make = Callable[..., HalStand]


@pytest.fixture
def make(tmp_path: Path) -> Make:
    def made(*models: ErrorModel | PositionModel, limits: Limits = Limits()) -> HalStand:
        for file, text in write_package(Compensator.of(list(models), limits), "mill", FACTS).items():
            (tmp_path / file).write_bytes(text)
        stand = HalStand(tmp_path)
        stand["told-cold"] = True
        return stand

    return made


class Plant:
    """An axis of LinuxCNC as far as its external offset goes: it takes changes of the counts while it can."""

    def __init__(self, stand: HalStand, axis: str = "z") -> None:
        self.stand, self.axis, self.request, self.counts = stand, axis, 0.0, 0
        self.moves: list[float] = []  # in each period [mm]
        self.switch(True)

    def switch(self, on: bool) -> None:
        for pin in ("motion-enabled", "all-homed", "coord-mode"):
            self.stand[pin] = on
        if not on:
            self.request = 0.0

    def check_rate(self, rate: float) -> None:
        """See that no tenth of a second has more than the rate [um/s] and a count in it."""
        there = np.cumsum([0.0, *self.moves])
        assert np.abs(there[100:] - there[:-100]).max() <= 1e-4 * rate + 1.001e-5

    def run(self, periods: int) -> None:
        for _ in range(periods):
            self.stand.run(1)
            counts = self.stand[f"{self.axis}-counts"]
            if self.stand["motion-enabled"]:
                self.request += (counts - self.counts) * self.stand["scale"]
            self.moves.append((counts - self.counts) * self.stand["scale"])
            self.counts = counts
            self.stand[f"{self.axis}-request"] = self.request


@needs_halcompile
def test_it_is_the_compensator_over_its_test_vectors(make: Make) -> None:
    models, limits = [watched_model("z_um"), watched_model("x_um")], Limits(dead_band=0.2)
    stand, compensator = make(*models, limits=limits), Compensator.of(models, limits)
    tables = gather(compensator)
    vectors = make_readings(tables)
    rows, ages, steps, said = [], [], [], []
    stand["enable"] = True
    count = 0
    for k, values in enumerate(vectors.values):
        # what is too old never comes; a step of more than a second is one of a slow thread
        seconds = round(min(max(float(np.nan_to_num(vectors.dt[k])), 1.0), 600.0))
        fresh = float(vectors.age[k]) <= limits.reading_age
        for c, value in enumerate(values.tolist()):
            stand[f"value-{c}"] = value
            stand[f"good-{c}"] = not (k % 7 == 3 and c == k % 3 and k > 60)
            if not stand[f"good-{c}"]:
                values[c] = math.nan
        if fresh:
            count += 1
            stand["reading"] = count
        stand.run(1, seconds * 1_000_000_000)
        rows.append(values)
        ages.append(0.0 if fresh else OLD)
        steps.append(1e-9 * (seconds * 1_000_000_000))
        said.append([[stand[f"{name}-{j}"] for j in range(2)] for name in ("correction", "status")])
    wanted = replay(compensator, tables, Readings(np.array(rows), np.array(ages), np.array(steps)))
    found = np.array(said)
    assert np.abs(1e3 * found[:, 0] - wanted.correction).max() < 1e-9
    assert (found[:, 1] == wanted.status).all()
    assert set(wanted.status.ravel()) == {0, 1, 2, 3}
    assert np.abs(wanted.correction).max() > 10.0


@needs_halcompile
def test_it_steps_once_a_second_and_counts_the_age_of_a_reading(make: Make) -> None:
    stand = make(growing("z_um", 2.0), limits=Limits(rate=1e3))
    assert math.isnan(stand["value-0"])
    stand["value-0"], stand["reading"] = 20.0, 7
    stand.run(999)
    assert stand["status-0"] == 0
    stand.run(1)
    assert (stand["status-0"], stand["rejected"]) == (1, 0)
    stand["value-0"], stand["reading"] = 25.0, 8
    stand.run(999)
    assert stand["correction-0"] == 0.0
    stand.run(1)
    assert stand["correction-0"] == pytest.approx(-0.010)
    stand["value-0"] = 30.0  # nobody counted
    stand.run(5000)
    assert stand["correction-0"] == pytest.approx(-0.010)
    assert (stand["status-0"], stand["rejected"]) == (2, 1)


@needs_halcompile
def test_an_axis_follows_no_faster_than_it_may_and_comes_back_after_off_and_on(make: Make) -> None:
    stand = make(growing("z_um", 2.0), limits=Limits(rate=2.0, magnitude=15.0))
    plant = Plant(stand)
    stand["value-0"], stand["reading"] = 20.0, 1
    plant.run(1000)
    stand["value-0"] = 24.0
    for k in range(8):
        stand["reading"] = 2 + k
        plant.run(1000)
    assert plant.request == pytest.approx(-0.008, abs=FINE)
    assert stand["engaged"]
    plant.switch(False)
    plant.run(3000)
    assert (plant.request, stand["engaged"]) == (0.0, False)
    plant.switch(True)
    plant.run(1000)
    assert plant.request == pytest.approx(-0.002, abs=2e-5)
    plant.run(4000)
    assert plant.request == pytest.approx(-0.008, abs=FINE)
    plant.switch(False)
    plant.run(10)
    plant.switch(True)
    stand["value-0"] = 60.0  # beyond the magnitude, while it comes back
    for k in range(10):
        stand["reading"] = 20 + k
        plant.run(1000)
    assert plant.request == pytest.approx(-0.015, abs=FINE)
    plant.check_rate(2.0)


@needs_halcompile
def test_it_moves_only_while_an_external_offset_can_and_not_in_its_first_period(make: Make) -> None:
    stand = make(growing("z_um", 2.0), limits=Limits(rate=1e4))
    stand["value-0"], stand["reading"] = 20.0, 1
    stand.run(1000)
    stand["value-0"], stand["reading"] = 25.0, 2
    stand.run(1000)
    assert stand["correction-0"] == pytest.approx(-0.010)
    names = ("motion-enabled", "all-homed", "coord-mode", "teleop-mode")
    for pins in itertools.product((False, True), repeat=4):
        for name in names:
            stand[name] = False
        stand["z-request"] = 0.003  # found there
        stand.run(1)
        before = stand["z-counts"]
        for name, value in zip(names, pins, strict=True):
            stand[name] = value
        stand["z-request"] = 0.0  # LinuxCNC does that in this period when it is switched on
        stand.run(1)
        assert (stand["engaged"], stand["z-counts"], stand["z-lost"]) == (False, before, False)
        stand.run(1)
        can = pins[0] and pins[1] and (pins[2] or pins[3])
        assert (stand["engaged"], stand["z-counts"] - before, stand["z-lost"]) == (can, -1000 if can else 0, False)


@needs_halcompile
@pytest.mark.parametrize("how", ["silent", "nan", "bad", "off", "wild"])
def test_without_a_usable_reading_it_holds_then_fades(make: Make, how: str) -> None:
    limits = Limits(rate=100.0, hold=120.0, fade=60.0, reading_age=10.0)
    stand = make(growing("z_um", 2.0), limits=limits)
    plant = Plant(stand)
    stand["value-0"], stand["reading"] = 20.0, 1
    plant.run(1000)
    stand["value-0"], stand["reading"] = 25.0, 2
    plant.run(3000)
    before = plant.request
    assert before == pytest.approx(-0.010, abs=FINE)
    for k in range(600):
        if how != "silent":
            stand["reading"] = 3 + k
        if how in ("nan", "wild"):
            stand["value-0"] = math.nan if how == "nan" else 1e30
        stand["good-0"], stand["enable"] = how != "bad", how != "off"
        plant.stand.run(9, 100_000_000)
        plant.run(100)
        if k == 110:
            assert plant.request == before
    assert abs(plant.request) < 0.01 * abs(before)
    assert stand["status-0"] == 3


@needs_halcompile
@pytest.mark.parametrize("pin", ["z-request", "unit"])
@pytest.mark.parametrize("wild", [math.nan, math.inf, 1e300, 0.0])
def test_what_the_controller_says_may_be_wild(make: Make, pin: str, wild: float) -> None:
    stand = make(growing("z_um", 2.0), limits=Limits(rate=100.0))
    stand["value-0"], stand["reading"] = 20.0, 1
    stand.run(1000)
    for name in ("motion-enabled", "all-homed", "coord-mode"):
        stand[name] = True
    stand["value-0"], stand["reading"], stand[pin] = 25.0, 2, wild
    stand.run(3000)
    assert abs(stand["z-counts"]) <= 10  # what the rate lets through in a period, and then nobody answers


@needs_halcompile
def test_when_nobody_answers_or_another_one_clears_it_nothing_runs_away(make: Make) -> None:
    stand = make(growing("z_um", 2.0), limits=Limits(rate=100.0))
    plant = Plant(stand)
    stand["value-0"], stand["reading"] = 20.0, 1
    plant.run(1000)
    stand["value-0"], stand["reading"] = 25.0, 2
    plant.run(3000)
    assert plant.request == pytest.approx(-0.010, abs=FINE)
    plant.request = 0.0  # somebody sets eoffset-clear
    plant.run(3000)
    assert (plant.request, stand["z-lost"]) == (0.0, True)
    plant.switch(False)
    plant.run(10)
    plant.switch(True)
    plant.run(1000)
    assert plant.request == pytest.approx(-0.010, abs=FINE)
    assert not stand["z-lost"]
    stand["value-0"], stand["reading"] = 20.0, 3
    before = stand["z-counts"]
    stand.run(60000)  # the plant does not answer
    assert abs(stand["z-counts"] - before) <= 10


@needs_halcompile
def test_in_inches_and_along_the_travel(make: Make) -> None:
    slope = growing("z_um", 40.0, "um/m")
    model = PositionModel(
        target="z_um",
        unit="um",
        axis="Z",
        travel=(0.0, 500.0),
        reference_position=100.0,
        offset=growing("z_um", 2.0),
        slopes=(slope,),
    )
    stand = make(model, limits=Limits(rate=1e4))
    stand["unit"] = 1.0 / 25.4
    plant = Plant(stand)
    stand["z-position"] = 300.0 / 25.4
    stand["value-0"], stand["reading"] = 20.0, 1
    plant.run(1000)
    stand["value-0"], stand["reading"] = 21.0, 2
    plant.run(3000)
    assert stand["slope-0"] == pytest.approx(-40.0)
    assert 25.4 * plant.request == pytest.approx(-0.002 - 0.040 * 0.2, abs=FINE)
    stand["z-position"] = 0.0
    plant.run(1)
    assert 25.4 * plant.request == pytest.approx(-0.002 + 0.040 * 0.1, abs=FINE)
    stand["z-position"] = 5000.0  # beyond the travel the end holds
    plant.run(1)
    assert 25.4 * plant.request == pytest.approx(-0.002 - 0.040 * 0.4, abs=FINE)
    before = stand["z-counts"]
    stand["z-position"] = math.nan
    plant.run(100)
    assert stand["z-counts"] == before


@needs_halcompile
def test_a_line_comes_back_no_faster_than_it_may_at_either_end(make: Make) -> None:
    slope = growing("z_um", 40.0, "um/m")
    model = PositionModel(target="z_um", unit="um", axis="Z", travel=(0.0, 500.0), slopes=(slope,))
    stand = make(model, limits=Limits(rate=2.0))
    plant = Plant(stand)
    stand["z-position"] = 500.0
    stand["value-0"], stand["reading"] = 20.0, 1
    plant.run(1000)
    for k in range(12):
        stand["value-0"], stand["reading"] = 21.0, 2 + k
        plant.run(1000)
    assert plant.request == pytest.approx(-0.020, abs=FINE)
    plant.switch(False)
    plant.run(10)
    plant.switch(True)
    stand["z-position"] = 250.0
    plant.run(2500)
    assert plant.request == pytest.approx(-0.0025, abs=2 * FINE)  # half of what the end may
    stand["z-position"] = 0.0
    plant.run(1)
    assert plant.request == pytest.approx(0.0, abs=FINE)
    stand["z-position"] = 500.0
    plant.run(9000)
    assert plant.request == pytest.approx(-0.020, abs=FINE)


@needs_halcompile
def test_it_is_installed_as_halcompile_wants_it(tmp_path: Path) -> None:
    models = [growing("z_um", 2.0), growing("a*/ b\\", 3.0)]
    name = "5 \u00b0 */ mill ;;"
    texts = write_package(Compensator.of(models), name, FACTS, {"a*/ b\\": "X"})
    assert sorted(texts) == sorted(
        ["tc_5_mill.c", "tc_5_mill.h", "tc_5_mill.hal", "tc_5_mill.md", "tc_5_mill_hal.comp", "tc_5_mill_test.c"]
    )
    assert list(texts)[-1] == "tc_5_mill.md"
    for file, text in texts.items():
        (tmp_path / file).write_bytes(text)
    assert not any(line.endswith("\\") for line in texts["tc_5_mill.hal"].decode("ascii").splitlines())
    subprocess.run(["halcompile", "--compile", "tc_5_mill_hal.comp"], cwd=tmp_path, check=True)
    assert (tmp_path / "tc_5_mill_hal.so").exists()


def test_what_cannot_be_an_export() -> None:
    one = Compensator.of([growing("z_um", 2.0)])
    with pytest.raises(InputError, match="too long: a name in HAL has at most 47"):
        write_package(one, "a" * 40, FACTS)
    with pytest.raises(InputError, match="expected a separate axis for each target"):
        write_package(Compensator.of([growing("bed_um", 2.0)]), "mill", FACTS)
    with pytest.raises(InputError, match="expected a separate axis for each target"):
        write_package(Compensator.of([growing("z_um", 2.0), growing("z2_um", 2.0)]), "mill", FACTS)
