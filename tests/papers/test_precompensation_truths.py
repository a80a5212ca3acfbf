"""Claims of pre-compensation on machines of a known law: planted cases for which each holds, or does not."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray

from thermocomp.core.machine import Channel
from thermocomp.models.arx_net import NetARX
from thermocomp.papers.precompensation import redo, setup
from thermocomp.papers.precompensation.setup import BETWEEN, LEAST, NET, POSITIONS, Computed
from thermocomp.papers.study import Claim, tell_nobody
from thermocomp.recordings.cycles import find_cycles
from thermocomp.recordings.recording import Recording
from thermocomp.virtual.protocol import Experiment

FloatArray = NDArray[np.float64]
#: what the drift keeps of its last two values in 10 min, and takes from the speed now and before [um per 1/min]
ONE_STORE = ((0.7,), (-0.006,))
TWO_STORES = ((1.3, -0.4), (-0.004, 0.002))


def drift(speed: FloatArray, law: tuple[tuple[float, ...], tuple[float, ...]], rng: np.random.Generator) -> FloatArray:
    """Return the drift that the equation P-01 gives, with noise that the drift keeps: what least squares assumes."""
    past, now = law
    z = np.zeros(len(speed))
    for k in range(1, len(z)):
        z[k] = sum(a * z[k - i] for i, a in enumerate(past, 1) if k >= i) + 0.05 * rng.normal()
        z[k] += sum(b * speed[k - i] for i, b in enumerate(now) if k >= i)
    return z


def recordings(
    asked: str | Experiment,
    *,
    seed: int,
    law: tuple[tuple[float, ...], tuple[float, ...]] = ONE_STORE,
    along: Callable[[float], float] = lambda p: 1 - p / 2000,
    room: float = 0.0,
) -> list[Recording]:
    """Return tests of a machine of one law, whose drift depends on Z by a function; the room swings it by the day."""
    experiment = asked if isinstance(asked, str) else asked.name
    rng = np.random.default_rng([seed, *experiment.encode()])
    tests = []
    for hours in {"precompensation": (30, 20), "precompensation-cut": (2,), "etve": (24,)}[experiment]:
        speed = np.append(0.0, 100.0 * rng.integers(0, 34, size=6 * hours)) * (experiment != "etve")
        z = drift(speed, law, rng) + room * np.sin(np.arange(len(speed)) * 2 * np.pi / 144)
        columns = {f"z_at_{p}_um": along(p) * (z - z[0]) for p in (*POSITIONS, *BETWEEN)} | {"z_um": z}
        channels = (
            *(Channel(c, "displacement", "um") for c in columns),
            Channel("spindle_rpm", "spindle_speed", "1/min"),
        )
        time: FloatArray = 600.0 * np.arange(len(speed), dtype=np.float64)
        table = pd.DataFrame({**columns, "spindle_rpm": speed})
        tests.append(Recording(f"{experiment}-{hours}", time, table, channels, find_cycles(time, speed)))
    return tests


@pytest.fixture
def computed(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Computed]:
    """Return the results for a machine; the nets are replaced by least squares, which learns such laws exactly."""

    def compute(**machine: Any) -> Computed:
        monkeypatch.setattr(setup, "record", partial(recordings, **machine))
        monkeypatch.setattr(setup, "NetARX", partial(NetARX, hidden=1, epochs=1))
        monkeypatch.setattr(setup, "CUTS", 1)
        monkeypatch.setattr(setup, "INTERVALS", (600.0,))
        found = setup.compute(0, tell_nobody)
        return replace(found, models=found.models | {NET: found.models[LEAST]})

    return compute


def judged(key: str, found: Computed) -> Claim:
    (claim,) = redo.claims.judged(key, found)
    return claim


def test_the_orders_of_the_law_are_found(computed: Callable[..., Computed]) -> None:
    """P-02: k = 1 and m = 0 if the machine has one store of heat, and others if it has two."""
    one, two = judged("orders", computed()), judged("orders", computed(law=TWO_STORES))
    assert one.verdict == "yes"
    assert one.ours == "; ".join(f"{p} mm: k = 1, m = 0" for p in POSITIONS)
    assert two.verdict == "no"
    assert "0 mm: k = 2, m = 1" in two.ours


def test_one_position_of_other_orders_is_enough_to_refute_it(computed: Callable[..., Computed]) -> None:
    """P-02: at every position."""
    found, two = computed(), computed(law=TWO_STORES)
    (claim,) = redo.claims.judged("orders", replace(found, orders=[*found.orders[:3], two.orders[3]]))
    assert claim.verdict == "no"


@pytest.mark.parametrize(("room", "verdict"), [(0.0, "in part"), (20.0, "no")])
def test_a_drift_that_the_speed_makes_is_described(
    computed: Callable[..., Computed], room: float, verdict: str
) -> None:
    """P-05: a room that moves the machine is in no model of the speed."""
    claim = judged("described", computed(room=room))
    assert claim.verdict == verdict
    assert claim.finding.startswith(
        "The paper gives no number: we read 'well' as 90% of the variance at every position."
    )


def test_one_position_that_is_not_described_refutes_it(computed: Callable[..., Computed]) -> None:
    """P-05: its mean would still be above 90 %."""
    found = computed()
    silent = replace(found, models=found.models | {NET: [*found.models[NET][:3], found.models[NET][0]]})
    silent.left[NET][:, 3] = 0.4 * silent.judge.deviations[:, 3]  # 84 % of the variance
    assert judged("described", silent).verdict == "no"


@pytest.mark.parametrize(("bend", "verdict"), [(0.0, "in part"), (0.1, "no")])
def test_a_drift_that_bends_along_z_is_not_interpolated(
    computed: Callable[..., Computed], bend: float, verdict: str
) -> None:
    """P-04: between models of the outer positions, a line."""
    found = computed(along=lambda p: 1 - p / 2000 + bend * (p == 400))
    claim = judged("interpolated", found)
    assert claim.verdict == verdict
    assert [part.partition(" mm")[0] for part in claim.ours.split("; ")] == ["200", "400"]
