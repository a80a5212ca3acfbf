"""Many machines in one tick: each as a compensator of its own would have it."""

from dataclasses import replace

import numpy as np
import pytest
from driftmodels import ACCEPTED, growing, lags

from thermocomp.core.correction import Limits
from thermocomp.core.exceptions import InputError
from thermocomp.core.inputs import Input, Support
from thermocomp.core.lineardynamic import LinearDynamic
from thermocomp.core.reading import Reading
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.fleet import Fleet

CHANNELS, MACHINES = 24, 7


def model(*, twice: bool = False) -> LinearDynamic:
    """Return a model with a lag behind each temperature, or two."""
    rng = np.random.default_rng(3)
    n = CHANNELS * (1 + twice)
    return LinearDynamic(
        target="z_um",
        unit="um",
        inputs=tuple(Input(f"t{k}_C", "temperature", "degC", 20.0, True, -3.0, 12.0) for k in range(CHANNELS)),
        signals=tuple((k,) for k in range(CHANNELS)),
        direct=tuple(rng.normal(0, 0.5, CHANNELS).tolist()),
        lag_signals=tuple(k % CHANNELS for k in range(n)),
        time_constants=tuple(rng.uniform(300.0, 9000.0, n).tolist()),
        lagged=tuple(rng.normal(0, 0.5, n).tolist()),
        intercept=0.25,
        support=Support(margin=0.1),
        honest_error=ACCEPTED,
    )


@pytest.mark.parametrize("twice", [False, True])
@pytest.mark.parametrize("kind", ["float64", "float32"])
@pytest.mark.parametrize("dead_band", [0.0, 0.3])
def test_each_machine_is_as_its_own_compensator_would_have_it(twice: bool, kind: str, dead_band: float) -> None:
    rng = np.random.default_rng(5)
    own, limits = model(twice=twice), Limits(magnitude=8.0, rate=0.05, hold=300.0, fade=400.0, dead_band=dead_band)
    zeros = 20.0 + rng.normal(0, 2.0, (MACHINES, CHANNELS))
    fleet = Fleet(own, zeros, limits, kind)
    machines = [Compensator.of([own], limits) for _ in range(MACHINES)]
    states, time, values = [m.start() for m in machines], 0.0, zeros.copy()
    bad = rng.random((400, MACHINES)) < 0.15
    bad[0] = False
    bad[0:5, 5] = True  # one whose first readings are none
    bad[150:260, 3] = True  # so long that its correction fades
    hostile = np.array([np.nan, np.inf, -np.inf, 1e300, -200.0, 3e38])
    worst = 0.0
    for k in range(400):
        dt = 0.0 if k == 0 else float(rng.choice([10.0, 10.0, 25.0, 90.0]))
        time += dt
        values = values if k <= 5 else values + rng.normal(0.03, 0.2, values.shape) - 0.02 * (values - zeros - 4.0)
        given = values.copy()
        for row in np.flatnonzero(bad[k]).tolist():
            given[row, rng.integers(CHANNELS)] = rng.choice(hostile)
        with np.errstate(over="ignore"):
            told = given.T.astype(kind)
        used = fleet.tick(told, dt)
        for m, machine in enumerate(machines):
            table = dict(zip((i.name for i in own.inputs), given[m].tolist(), strict=True))
            states[m], said = machine.step(states[m], Reading(time, table), time)
            assert used[m] == (not said.rejected), (k, m, said.rejected)
            worst = max(worst, abs(said.corrections["z_um"].offset - float(fleet.corrections[m])))
        assert np.abs(fleet.corrections).max() <= limits.magnitude
    assert np.abs(fleet.corrections).max() > 1.0
    assert worst < (1e-9 if kind == "float64" else 1e-3 + dead_band)


def test_what_a_fleet_cannot_run_is_refused() -> None:
    zeros = np.full((2, CHANNELS), 20.0)
    good = model()
    for wrong, why in (
        (replace(good, honest_error=None), "judged"),
        (replace(good, unit="urad"), "linear models"),
        (replace(good, support=Support(policy="hold")), "clip"),
        (growing("z_um", 1.0), "linear models"),
        (replace(lags(), honest_error=ACCEPTED), "products of inputs"),
    ):
        with pytest.raises(InputError, match=why):
            Fleet(wrong, zeros)  # type: ignore[arg-type]
    for odd in (zeros[0], zeros[:, 1:]):
        with pytest.raises(InputError, match=r"zeros: expected shape \(n_machines, "):
            Fleet(good, odd)
    with pytest.raises(InputError, match="zeros: 48 of 48 values are not finite; remove NaN and infinity"):
        Fleet(good, np.full((2, CHANNELS), np.nan))
    fleet = Fleet(good, zeros)
    for readings, dt in ((zeros, 1.0), (zeros.T, -1.0), (zeros.T, np.nan), (zeros.T, np.inf)):
        with pytest.raises(InputError, match="expected"):
            fleet.tick(readings, dt)
