"""A whole test at once is the compensator, reading by reading."""

import math
from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from driftmodels import ACCEPTED
from hypothesis import given
from hypothesis import strategies as st

from thermocomp.core.autoregressive import Autoregressive
from thermocomp.core.correction import Limits
from thermocomp.core.inputs import Input, Support
from thermocomp.core.lineardynamic import LinearDynamic
from thermocomp.core.model import ErrorModel
from thermocomp.core.polynomial import Polynomial
from thermocomp.core.reading import Reading
from thermocomp.core.terms import Variable
from thermocomp.core.zero import FIRST_READING, Zeroing, mean_over_time
from thermocomp.runtime import batch
from thermocomp.runtime.compensator import Compensator

INPUTS = (
    Input("t", "temperature", "degC", 20.0, True, -2.0, 15.0),
    Input("n", "spindle_speed", "1/min", 0.0, False, 0.0, 6000.0),
)
LAGS = LinearDynamic(
    target="z",
    unit="um",
    inputs=INPUTS,
    signals=((0,), (1,)),
    direct=(2.0, 0.0),
    lag_signals=(1,),
    time_constants=(600.0,),
    lagged=(0.01,),
    intercept=1.5,
    honest_error=ACCEPTED,
)
STATIC = Polynomial(
    target="z",
    unit="um",
    inputs=INPUTS,
    variables=(Variable.single("t", 0), Variable.single("n", 1)),
    terms=((0,), (0, 1)),
    coefficients=(3.0, -2e-4),
    intercept=-0.5,
    honest_error=ACCEPTED,
)
TICKS = Autoregressive(
    target="z",
    unit="um",
    inputs=INPUTS,
    interval=30.0,
    a=(0.9,),
    b=((0.1, 0.05), (2e-4, 1e-4)),
    honest_error=ACCEPTED,
)
FAMILIES = {"lags": LAGS, "static": STATIC, "ticks": TICKS}

values = st.one_of(
    st.floats(15.0, 40.0), st.floats(-60.0, 200.0), st.sampled_from([math.nan, math.inf, 1e30, 20.0, 21.0])
)


@given(
    family=st.sampled_from(sorted(FAMILIES)),
    policy=st.sampled_from(["clip", "hold", "fade"]),
    rows=st.lists(
        st.tuples(st.floats(0.5, 200.0), values, st.sampled_from([0.0, 3000.0, 9000.0, math.nan, 1e9])), max_size=40
    ),
    limits=st.sampled_from(
        [Limits(), Limits(magnitude=5.0, rate=0.01, dead_band=0.3), Limits(magnitude=1e9, rate=1e9, reading_age=1e9)]
    ),
    known=st.booleans(),
    zeroing=st.sampled_from([FIRST_READING, Zeroing(300.0, 10.0, "n"), Zeroing(100.0, 100.0), Zeroing(0.0, 60.0, "n")]),
)
def test_it_is_the_online_step(
    family: str,
    policy: Literal["clip", "hold", "fade"],
    rows: list[tuple[float, float, float]],
    limits: Limits,
    known: bool,
    zeroing: Zeroing,
) -> None:
    model: ErrorModel = replace(FAMILIES[family], support=Support(policy), zeroing=zeroing)
    reference = (21.0, 0.0) if known else None
    time = np.cumsum([dt for dt, _, _ in rows]) if rows else np.empty(0)
    table = np.array([[t, n] for _, t, n in rows]).reshape(-1, 2)
    stands = np.array([bool(zeroing.speed) and zeroing.stands(n) for _, n in table.tolist()], dtype=np.bool_)
    found = batch.run(model, limits, time, table, reference=reference, resting=stands)
    running = Compensator.of([model], limits)
    state = running.start()._replace(models=(model.init(reference),))
    first = ""
    for k, row in enumerate(table):
        reading = Reading(float(time[k]), dict(zip("tn", row.tolist(), strict=True)))
        state, result = running.step(state, reading, reading.time)
        # models with a memory are stepped the same way; the others all rows at once, so their sums may round otherwise
        expected = pytest.approx(-result.corrections["z"].offset, rel=1e-13, abs=0 if model.remembers else 1e-13)
        assert found.compensated[k] == expected
        complete = bool(np.isfinite(row).all())
        assert found.rejected[k] == (complete and bool(result.rejected))
        first = first or (result.rejected if complete else "")
    assert found.why == first


@given(st.lists(st.tuples(st.floats(0.5, 200.0), st.floats(15.0, 40.0)), min_size=1, max_size=40))
def test_without_limits_it_is_the_model(rows: list[tuple[float, float]]) -> None:
    time = np.cumsum([dt for dt, _ in rows])
    table = np.array([[t, 1000.0] for _, t in rows])
    tilt = replace(LAGS, unit="urad")  # no limit of micrometres can hold for it
    found = batch.run(tilt, None, time, table)
    state, last = tilt.init(), time[0]
    for k, row in enumerate(table):
        state, deviation = tilt.step(state, row, float(time[k] - last))
        last = time[k]
        assert found.deviation[k] == pytest.approx(float(deviation), rel=1e-13, abs=1e-13)
        if not found.rejected.any():
            assert found.compensated[k] == found.deviation[k]


def test_counted_anew_the_correction_begins_at_zero_again() -> None:
    time = np.arange(0.0, 3600.0, 10.0)
    table = np.column_stack([20.0 + np.minimum(time / 60, 10.0), np.where(time < 1800, 3000.0, 0.0)])
    model = replace(LAGS, zeroing=Zeroing(100.0, 10.0, "n"))
    stands = table[:, 1] == 0
    whole = batch.run(model, Limits(rate=1e9, magnitude=1e9), time, table, resting=stands)
    found = batch.run(model, Limits(rate=1e9, magnitude=1e9), time, table, resting=stands, anew=180)
    at_rest = slice(180, 191)  # 100 s at 10 s
    assert found.deviation == pytest.approx(whole.deviation - mean_over_time(time[at_rest], whole.deviation[at_rest]))
    assert (found.compensated[:190] == 0.0).all()
    assert found.compensated[190:] == pytest.approx(found.deviation[190:])


def test_a_correction_that_nothing_drives_is_held_and_then_fades() -> None:
    time = np.arange(0.0, 6 * 3600.0, 60.0)
    table = np.column_stack([np.where(time > 0, 25.0, 20.0), np.zeros(len(time))])
    limits = Limits(rate=1e9)
    for undriven in (time >= 3600.0, np.ones(len(time), dtype=np.bool_)):
        found = batch.run(STATIC, limits, time, table, undriven=undriven)
        before = found.compensated[undriven.argmax() - 1] if undriven.argmax() else 0.0
        since = time[undriven] - time[undriven][0] + 60.0
        assert (found.compensated[undriven][since <= limits.hold] == before).all()
        # the row in which the hold ends fades as a whole
        left = before * math.exp(-(since[-1] - limits.hold) / limits.fade)
        assert found.compensated[-1] == pytest.approx(left)
        assert found.deviation[-1] == pytest.approx(14.5)  # the model alone continues


def test_a_slow_limit_is_seen_in_what_runs_and_not_in_the_model() -> None:
    time = np.arange(0.0, 3600.0, 10.0)
    table = np.column_stack([20.0 + np.minimum(time / 60, 10.0), np.zeros(len(time))])
    found = batch.run(STATIC, Limits(rate=0.001), time, table)
    assert found.deviation[-1] == pytest.approx(29.5)
    assert found.compensated[-1] == pytest.approx(0.001 * 3580)  # the first two rows want nothing positive
    assert batch.run(STATIC, Limits(magnitude=4.0), time, table).compensated.max() == 4.0
