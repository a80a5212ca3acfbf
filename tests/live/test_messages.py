"""Readings as messages: bounded, and what is not a number is missing."""

import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thermocomp.core.correction import Correction
from thermocomp.core.exceptions import ReadingError
from thermocomp.core.reading import Measurement
from thermocomp.live.adapters.messages import read_measurement, read_message, write_message


def test_values_by_name() -> None:
    found = read_message(
        '{"motor": 21.5, "n": 4000, "time": 100.5, "s": "x", "b": true, "z": null}', 7.0, {"motor": "t1_C"}
    )
    assert found.time == 100.5
    assert found.values == {"t1_C": 21.5, "n": 4000.0}
    assert read_message(b'{"a": 1}', 7.0, {}).time == 7.0


@pytest.mark.parametrize(
    ("payload", "says"),
    [
        (b"21.5", "not a table"),
        (b"\xff\xfe", "not JSON"),
        (b"{", "not JSON"),
        (b"[" * 50_000, "not JSON"),
        (b'{"time": "noon"}', "expected seconds since 1970"),
        (b'{"time": NaN}', "expected seconds since 1970"),
        (b"x" * 70_000, "at most 65,536"),
        (json.dumps({f"t{k}": k for k in range(2000)}).encode(), "at most 1,000"),
    ],
)
def test_what_is_none(payload: bytes, says: str) -> None:
    with pytest.raises(ReadingError, match=says):
        read_message(payload, 7.0, {})


@given(st.binary(max_size=200) | st.text(max_size=200))
def test_whatever_comes(payload: bytes | str) -> None:
    try:
        found = read_message(payload, 7.0, {})
    except ReadingError:
        return
    assert all(math.isfinite(v) for v in (found.time, *found.values.values()))


def test_corrections() -> None:
    table = json.loads(write_message({"Z": Correction(1.5, 2.0, 3.0)}, 9.0))
    assert table == {
        "time": 9.0,
        "corrections": {"Z": {"offset_um": 1.5, "slope_um_per_m": 2.0, "reference_position_mm": 3.0}},
    }


@pytest.mark.parametrize(
    "payload",
    [
        '{"target": "z_um", "measured_um": 3.0}',
        '{"target": "z_um", "measured_um": 3.0, "under_correction": "yes"}',
        '{"target": "z_um", "measured_um": NaN, "under_correction": true}',
        '{"target": "z_um", "measured_um": 1e308, "under_correction": true}',
        '{"target": "z_um", "measured_um": 3.0, "under_correction": true, "repeatability_um": -1}',
        '{"target": "z_um", "measured_um": 3.0, "under_correction": true, "more": 1}',
        '{"target": 7, "measured_um": 3.0, "under_correction": true}',
        '{"measured_um": 3.0, "under_correction": true}',
        "[]",
        "{",
    ],
)
def test_a_measurement_that_is_none(payload: str) -> None:
    with pytest.raises(ReadingError, match=r"measurement|message"):
        read_measurement(payload, 5.0)


def test_a_measurement() -> None:
    told = '{"target": "z_um", "measured_um": 3, "under_correction": false, "position_mm": 10.5, "time": 7}'
    assert read_measurement(told, 5.0) == Measurement(7.0, "z_um", 3.0, False, 0.5, 10.5, ("time 7.0",))


def test_what_tells_a_measurement_from_others() -> None:
    def keys(more: str, measured: float = 3.0, arrived: float = 5.0) -> tuple[str, ...]:
        told = f'{{"target": "z_um", "measured_um": {measured}, "under_correction": false{more}}}'
        return read_measurement(told, arrived).keys

    assert keys(', "id": "p 17", "time": 7') == ("id p 17", "time 7.0")
    assert keys(', "id": 17') == keys(', "id": "17"', 4.0, 9.0) == ("id 17",)
    assert keys("", arrived=5.0) == keys("", arrived=6.0) != keys("", 3.1)  # its content
    for wrong in ('""', "null", "1.5", "true", "[1]", f'"{"x" * 300}"'):
        with pytest.raises(ReadingError, match="unknown keys: id; expected"):
            keys(f', "id": {wrong}')
