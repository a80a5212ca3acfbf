"""`ErrorModel.predict`: a model replayed through a table, with numpy alone."""

from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from thermocomp.core.exceptions import InputError
from thermocomp.core.inputs import Input
from thermocomp.core.lineardynamic import LinearDynamic
from thermocomp.core.polynomial import Polynomial
from thermocomp.core.terms import Variable
from thermocomp.core.zero import Zeroing

T = Input("t", "temperature", "degC", reference=20.0, rezero=True, low=-50.0, high=50.0)
LAG = LinearDynamic(
    target="z",
    unit="um",
    inputs=(T,),
    signals=((0,),),
    direct=(1.0,),
    lag_signals=(0,),
    time_constants=(100.0,),
    lagged=(2.0,),
)
PLANE = Polynomial(
    target="z",
    unit="um",
    inputs=(T,),
    variables=(Variable.single("t", 0),),
    terms=((0,),),
    coefficients=(3.0,),
    intercept=1.0,
)


@pytest.mark.parametrize(("low", "reversed_"), [(0.0, 2.0), (-4000.0, -2.0)])
def test_a_spindle_in_reverse(low: float, reversed_: float) -> None:
    """Its amount counts if no speed was negative in the training; else the model has seen what the sign does."""
    speed = Input("n", "spindle_speed", "1/min", reference=0.0, rezero=False, low=low, high=4000.0)
    model = replace(PLANE, inputs=(speed,), variables=(Variable.single("n", 0),), coefficients=(1e-3,), intercept=0.0)
    np.testing.assert_allclose(model.predict({"n": np.array([2000.0, -2000.0])}), [2.0, reversed_])


def test_it_is_the_replay() -> None:
    t, time = np.array([20.0, 22.0, 23.0, 23.0]), np.array([0.0, 10.0, 40.0, 100.0])
    state, expected = LAG.init(), []
    for value, step in zip(t, np.diff(time, prepend=0.0), strict=True):
        state, deviation = LAG.step(state, np.array([value]), float(step))
        expected.append(float(deviation))
    ways: list[Any] = [
        LAG.predict({"t": t.tolist()}, time),
        LAG.predict(pd.DataFrame({"t": t, "seconds": time}), "seconds"),
        LAG.predict({"t": t, "time_s": time}),
        LAG.predict({"t": t}, np.datetime64("2026-01-01") + time.astype("timedelta64[s]")),
        LAG.predict({"t": t}, 1e6 + time),
    ]
    for found in ways:
        assert found.tolist() == expected
    assert expected[-1] > expected[1] > expected[0] == 0


@pytest.mark.parametrize("zone", [None, "Europe/Berlin"])
def test_dates_with_a_time_zone(zone: str | None) -> None:
    """The clock of Berlin is put back between the second row and the third."""
    t, time = np.array([20.0, 22.0, 23.0, 23.0]), np.array([0.0, 10.0, 40.0, 100.0])
    stamps = (pd.Timestamp("2026-10-25T00:59:45", tz="UTC") + pd.to_timedelta(time, unit="s")).tz_convert(zone)
    table = pd.DataFrame({"t": t, "stamp": stamps})
    ways: list[Any] = [stamps, "stamp", stamps.to_series(), stamps.to_pydatetime().tolist()]
    for way in ways:
        assert LAG.predict(table, way).tolist() == LAG.predict(table, time).tolist()


def test_a_new_test_starts_anew() -> None:
    t, time = np.array([20.0, 25.0, 30.0, 35.0]), np.array([0.0, 60.0, 0.0, 60.0])
    assert LAG.predict({"t": t}, time)[2:].tolist() == LAG.predict({"t": t[2:]}, time[2:]).tolist()
    assert LAG.predict({"t": t}, time)[2] == 0.0
    assert LAG.predict({"t": t}, time, reference=[20.0])[2] != 0.0


def test_a_missing_reading_is_passed_over() -> None:
    t = np.array([np.nan, 20.0, 24.0, np.nan, 24.0])
    found = LAG.predict({"t": t}, np.arange(5) * 60.0)
    assert found[:2].tolist() == [0.0, 0.0]
    assert found[3] == found[2]
    whole = LAG.predict({"t": t[[1, 2, 4]]}, np.array([0.0, 60.0, 180.0]))
    assert found[4] == pytest.approx(whole[2], rel=1e-12)  # the time that has passed counts


def test_without_memory_no_time_is_needed() -> None:
    assert PLANE.predict({"t": [20.0, 21.0, 25.0]}).tolist() == [1.0, 4.0, 16.0]
    none = Polynomial(target="z", unit="um", inputs=(), variables=(), terms=(), coefficients=(), intercept=2.0)
    assert none.predict({"t": [1.0, 2.0]}).tolist() == [2.0, 2.0]


def test_what_is_refused() -> None:
    with pytest.raises(InputError, match=r"has a memory and needs the time of the rows \[s\]"):
        LAG.predict({"t": [1.0]})
    with pytest.raises(InputError, match="the table has no column 't'"):
        PLANE.predict(pd.DataFrame({"T": [1.0]}))
    with pytest.raises(InputError, match="the table has no column 'clock'"):
        LAG.predict({"t": [1.0]}, "clock")
    with pytest.raises(InputError, match=r"the time has shape \(2,\); expected one value for each of 1 rows"):
        LAG.predict({"t": [1.0]}, [0.0, 1.0])
    with pytest.raises(InputError, match="time must be finite"):
        LAG.predict({"t": [1.0]}, [np.nan])
    with pytest.raises(InputError, match=r"model of z: column 't' contains a non-numeric value: .*'warm'"):
        LAG.predict({"t": ["warm"]}, [0.0])
    with pytest.raises(InputError, match="column 't' contains a non-numeric value: found dates and times"):
        LAG.predict({"t": [np.datetime64("2026-01-01")]}, [0.0])
    with pytest.raises(InputError, match=r"the time in column 'clock' must be numbers .* or datetimes: .*'noon'"):
        LAG.predict({"t": [1.0], "clock": ["noon"]}, "clock")
    timed = replace(LAG, zeroing=Zeroing(speed="rpm"))
    with pytest.raises(InputError, match="column 'rpm' contains a non-numeric value"):
        timed.predict({"t": [1.0], "rpm": ["fast"]}, [0.0])
