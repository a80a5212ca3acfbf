"""Faults put into sound signals on purpose, and sound signals that must raise no alarm."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from thermocomp.core.machine import Channel
from thermocomp.core.units import HOUSE_UNITS
from thermocomp.recordings.checks.quality import Finding, check, lasting_trouble, troubled_rows
from thermocomp.recordings.cycles import find_cycles, make_single_cycle
from thermocomp.recordings.recording import Recording

FloatArray = NDArray[np.float64]

N = 2000
TIME: FloatArray = np.arange(0.0, 15.0 * N, 15.0)


def _warm_up(*, noise: float = 0.02, resolution: float = 0.0, seed: int = 1) -> FloatArray:
    """Return a sensor that warms up by 10 degC until row 1000 and cools down again."""
    clean = 20 + 10 * (1 - np.exp(-np.minimum(TIME, 15000) / 4000)) * np.exp(-np.maximum(TIME - 15000, 0) / 4000)
    values = clean + noise * np.random.default_rng(seed).normal(size=N)
    return np.asarray(np.round(values / resolution) * resolution if resolution else values)


def _recording(time: FloatArray = TIME, quantity: str = "temperature", **columns: FloatArray) -> Recording:
    channels = tuple(Channel(name, quantity, HOUSE_UNITS[quantity]) for name in columns)
    return Recording("test", time, pd.DataFrame(columns), channels, make_single_cycle(len(time)))


def _check(values: FloatArray, quantity: str = "temperature") -> list[Finding]:
    return [f for f in check(_recording(quantity=quantity, t1=values)) if f.kind != "no cycle"]


@pytest.mark.parametrize("noise", [0.0, 0.005, 0.02, 0.05, 0.2])
@pytest.mark.parametrize("resolution", [0.0, 0.001, 0.01, 0.1])
@pytest.mark.parametrize("quantity", ["temperature", "displacement"])
def test_a_sound_sensor_of_any_noise_and_resolution_raises_nothing(
    noise: float, resolution: float, quantity: str
) -> None:
    for seed in range(3):
        zero = 0.0 if quantity == "temperature" else 20.0  # a probe starts at its zero
        assert _check(_warm_up(noise=noise, resolution=resolution, seed=seed) - zero, quantity) == []


def test_a_displacement_that_jumps_or_creeps_to_rest_raises_nothing() -> None:
    creeping = np.round(1000 * np.expm1(-TIME / 600))  # a dial gauge of 1 um that stands still for the last 5 hours
    jumping = np.where(TIME > 5000, 100.0, 0.0) - 20  # the tool was changed: all probes tell it
    both = _recording(quantity="displacement", x=jumping + _warm_up(), y=jumping + _warm_up(seed=2))

    assert _check(creeping, "displacement") == []
    assert [f.kind for f in check(both)] == ["no cycle"]


def test_a_spindle_speed_and_a_position_may_stand_still() -> None:
    speed = np.where(TIME % 8000 < 4000, 3000.0, 0.0)

    for quantity in ("spindle_speed", "position"):
        assert _check(speed, quantity) == []


@settings(deadline=None, max_examples=100)
@given(start=st.integers(0, N - 100), length=st.integers(40, N - 100), resolution=st.sampled_from([0.0, 0.001]))
def test_a_stuck_sensor_is_trouble_wherever_it_sticks(start: int, length: int, resolution: float) -> None:
    values = _warm_up(resolution=resolution)
    stop = start + length if start + length < N - 5 else N
    values[start:stop] = values[start]

    found = _check(values)

    assert [(f.severity, f.channel, f.kind) for f in found] == [("trouble", "t1", "stuck")]
    # a neighbour may happen to hold the same number
    rows = [int(word) for word in found[0].text.split() if word.isdigit()][-2:]
    assert abs(rows[0] - start) <= 3
    assert abs(rows[1] - (stop - 1)) <= 3


def test_a_noiseless_sensor_that_stops_dead_is_stuck() -> None:
    values = _warm_up(noise=0.0)
    values[50:] = values[50]

    assert [f.kind for f in _check(values)] == ["stuck"]


def test_a_sensor_that_dies_at_once_is_stuck() -> None:
    values = _warm_up()
    values[5:] = values[5]

    assert [(f.severity, f.kind) for f in _check(values)] == [("trouble", "stuck")]


def test_a_coarse_sensor_that_stands_still_is_only_a_warning() -> None:
    values = _warm_up(resolution=0.1)  # noise of a fifth of a step: it rests now and then
    values[1500:] = values[1500]

    assert [(f.severity, f.kind) for f in _check(values)] == [("warning", "stuck")]


def test_several_stuck_stretches_are_counted() -> None:
    values = _warm_up()
    values[200:260] = values[200]
    values[600:700] = values[600]

    (found,) = _check(values)

    assert "100 rows, from row 600 (9000 s) to row 699 (10485 s), one of 2 such periods" in found.text


@settings(deadline=None, max_examples=100)
@given(row=st.integers(0, N - 1), height=st.sampled_from([-3.0, 0.6, 3.0]), noise=st.sampled_from([0.0, 0.01, 0.03]))
def test_a_single_spike_is_a_warning_that_names_its_row(row: int, height: float, noise: float) -> None:
    values = _warm_up(noise=noise)
    values[row] += height

    (found,) = _check(values)

    assert (found.severity, found.kind) == ("warning", "spike")
    # measured from the neighbour next to it, which noise and slope have moved a little
    assert abs(_height(found) - abs(height)) < 0.3
    assert f"at row {row} ({15 * row} s)" in found.text


def _height(finding: Finding) -> float:
    return float(finding.text.split("by ")[1].split()[0])


def test_a_spike_higher_than_all_else_is_trouble() -> None:
    values = _warm_up()
    values[[300, 900]] += [0.8, 50.0]

    (found,) = _check(values)

    assert found.severity == "trouble"
    assert "2 spikes" in found.text
    assert "row 900" in found.text


@pytest.mark.parametrize("code", [-180.0, -273.15, -999.0, -9999.0, 85.0, 850.0, 9999.0, 1e30])
@pytest.mark.parametrize("rows", [[700], [0, 700, 701, 1999]])
def test_a_missing_value_code_is_trouble_and_nothing_else_is_said(code: float, rows: list[int]) -> None:
    values = _warm_up()
    values[rows] = code

    (found,) = _check(values)

    assert (found.severity, found.kind) == ("trouble", "missing-value code")
    assert f"are {code:g}, a value" in found.text
    assert f"{len(rows)} of 2000 values" in found.text
    assert f"row {rows[0]} " in found.text
    assert f"missing = [{code:g}]" in found.text


def test_a_code_that_lies_among_the_values_is_a_value() -> None:
    values = _warm_up() + 60.0
    values[700] = 85.0  # between 80 and 90 degC

    assert "missing-value code" not in [f.kind for f in _check(values)]


@pytest.mark.parametrize(("code", "quantity"), [(-180.0, "temperature"), (-9999.0, "displacement")])
def test_a_sensor_that_gives_nothing_but_a_code_is_absent(code: float, quantity: str) -> None:
    (found,) = _check(np.full(N, code), quantity)

    assert (found.severity, found.kind) == ("trouble", "missing-value code")
    assert "no sensor is connected" in found.text


@pytest.mark.parametrize(
    ("quantity", "severity"), [("temperature", "trouble"), ("displacement", "trouble"), ("spindle_speed", "info")]
)
def test_a_constant_channel_is_told(quantity: str, severity: str) -> None:
    (found,) = _check(np.full(N, 21.5), quantity)

    assert (found.severity, found.kind) == (severity, "constant")
    assert "is 21.5" in found.text


def test_missing_values_are_counted_and_located() -> None:
    values = _warm_up()
    values[400] = np.nan
    values[600:700] = np.nan
    half = values.copy()
    half[1000:] = np.nan

    (found,) = _check(values)

    assert (found.severity, found.kind) == ("warning", "missing values")
    assert "101 of 2000 values (5.1%) missing, at most 100 consecutively, from row 600 (9000 s)" in found.text
    assert [f.severity for f in _check(half)] == ["trouble"]
    assert [(f.severity, f.text[:19]) for f in _check(np.full(N, np.nan))] == [("trouble", "has no value at all")]


def test_an_implausible_temperature_is_trouble() -> None:
    (found,) = _check(_warm_up() + 600)

    assert (found.severity, found.kind) == ("trouble", "implausible")


@pytest.mark.parametrize(
    ("quantity", "value", "severity"),
    [
        ("temperature", 401.0, "trouble"),
        ("temperature", -61.0, "trouble"),
        ("displacement", -1.2e5, "trouble"),
        ("displacement", 1e201, "trouble"),
        ("angle", -1.7e308, "trouble"),
    ],
)
def test_an_implausible_value_is_trouble_and_hides_nothing_else(quantity: str, value: float, severity: str) -> None:
    values = _warm_up() - (0.0 if quantity == "temperature" else 20.0)
    values[[300, 1200]] = value
    stuck = values.copy()
    stuck[1500:] = stuck[1500]

    (found,) = _check(values, quantity)

    assert (found.severity, found.kind) == (severity, "implausible")
    assert "2 of 2000 values" in found.text
    assert f"the most extreme {value:g} at row 300 (4500 s)" in found.text
    assert [f.kind for f in _check(stuck, quantity)] == ["implausible", "stuck"]


@settings(deadline=None, max_examples=200)
@given(
    values=st.lists(st.floats(width=64), min_size=1, max_size=40),
    quantity=st.sampled_from([q for q in HOUSE_UNITS if q != "time"]),
)
def test_any_numbers_are_looked_at_without_a_warning_of_numpy(values: list[float], quantity: str) -> None:
    assert check(_recording(TIME[: len(values)], quantity, t1=np.array(values)))


def test_what_the_reader_left_out_is_a_warning() -> None:
    recording = replace(_recording(t1=_warm_up()), notes=("left out: 'P [kW]'", "t2: infinite", "left out: 'a'"))

    found = [f for f in check(recording) if f.kind == "left out"]

    assert found == [Finding("warning", "", "left out", f"left out: {name}") for name in ("'P [kW]'", "'a'")]


def test_a_coarse_resolution_is_told() -> None:
    (found,) = _check(_warm_up(resolution=0.5))

    assert (found.severity, found.kind) == ("info", "quantised")
    assert "steps of 0.5 degC" in found.text


def test_the_same_sensor_twice_is_told_but_empty_ones_are_not() -> None:
    empty = np.full(N, np.nan)
    recording = _recording(a=_warm_up(), b=_warm_up(seed=2), c=_warm_up(), d=empty, e=empty)

    found = [f for f in check(recording) if f.kind == "duplicate channel"]

    assert [(f.channel, f.text[:32]) for f in found] == [("c", "has the same value as a in every")]


def test_gaps_and_irregular_sampling_are_told() -> None:
    values = _warm_up()
    gaps = TIME + 600 * (np.arange(N) > 700) + 90 * (np.arange(N) > 1200)
    jitter = TIME + np.random.default_rng(1).uniform(0, 6, size=N)
    bursts = np.cumsum(np.tile([52.0, 4.0, 4.0], N)[:N])  # three probings a minute: no gap, but no interval either

    def kinds(time: FloatArray) -> list[tuple[str, str]]:
        return [(f.severity, f.kind) for f in check(_recording(time, t1=values)) if f.kind != "no cycle"]

    assert kinds(gaps) == [("warning", "gap")]
    text = next(f.text for f in check(_recording(gaps, t1=values)) if f.kind == "gap")
    assert "2 gaps in time, the longest 615 s after row 700 (10500 s), where rows are 15 s apart" in text
    assert kinds(jitter) == [("warning", "irregular sampling")]
    assert kinds(bursts) == [("warning", "irregular sampling")]


def test_one_cycle_is_told_with_its_reason() -> None:
    plain = _recording(t1=_warm_up())
    speed = np.where(TIME % 15000 < 7500, 3000.0, 0.0)
    turning = Recording(
        "test",
        TIME,
        pd.DataFrame({"t1": _warm_up(), "n": speed}),
        (*plain.channels, Channel("n", "spindle_speed", "1/min")),
        find_cycles(TIME, speed),
    )

    assert [(f.severity, f.kind) for f in check(plain)] == [("info", "no cycle")]
    assert "no spindle speed" in check(plain)[0].text
    assert check(turning) == ()
    once = np.where(TIME < 7500, 3000.0, 0.0)
    still = replace(turning, table=turning.table.assign(n=once)).with_cycles(make_single_cycle(N))
    assert "does not start again" in check(still)[0].text
    assert (
        "spindle starts follows a standstill of at least 300 s"
        in check(turning.with_cycles(make_single_cycle(N)))[0].text
    )


def test_a_drift_of_millimetres_is_another_unit() -> None:
    plain = _recording(t1=_warm_up())
    for factor, told in ((100.0, False), (1e5, True)):
        table = plain.table.assign(z_um=factor * np.linspace(0.0, 0.74, N) ** 2)
        recording = replace(plain, table=table, channels=(*plain.channels, Channel("z_um", "displacement", "um")))
        found = [f for f in check(recording) if f.kind == "unit"]
        assert ([f.severity for f in found] == ["trouble"]) is told
        assert all("more than any machine drifts" in f.text for f in found)


def test_the_gravest_comes_first() -> None:
    values = _warm_up()
    values[300] += 3.0
    recording = _recording(TIME + 600 * (np.arange(N) > 700), spiking=values, dead=np.full(N, 20.0))

    assert [f.severity for f in check(recording)] == ["trouble", "warning", "warning", "info"]


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 9, 10])
def test_a_few_rows_are_looked_at_without_failing(n: int) -> None:
    recording = _recording(TIME[:n], t1=_warm_up()[:n], t2=np.full(n, np.nan), t3=np.full(n, -180.0))
    short = replace(recording, cycles=make_single_cycle(n))

    kinds = {(f.channel, f.kind) for f in check(short)}

    assert {("t2", "missing values"), ("t3", "missing-value code"), ("", "no cycle")} <= kinds
    few = [(f.severity, f.text.split(";")[0]) for f in check(short) if f.kind == "short"]
    assert few == ([("warning", f"too few rows to assess ({n})")] if n < 10 else [])
    assert not {f for f in kinds if f[0] == "t1"}


def test_probing_cycles_are_no_trouble() -> None:
    """A touch probe has values in its cycles only, in the same rows for all points; a lone gappy probe is trouble."""
    drift = _warm_up(noise=0.5) - 20
    there = np.arange(N) % 50 == 0
    touched = {name: np.where(there, drift + k, np.nan) for k, name in enumerate(("x", "y"))}
    found = check(_recording(quantity="displacement", **touched))
    assert [(f.severity, f.kind, f.channel) for f in found if f.channel] == [("info", "probed", n) for n in "xy"]
    assert "has values in only 40 of 2000 rows" in found[-1].text
    (lone,) = [f for f in _check(np.where(there, drift, np.nan), "displacement") if f.kind == "missing values"]
    assert lone.severity == "trouble"


def test_rows_in_trouble_are_told_apart_from_channels_in_trouble() -> None:
    """Codes, implausible values, stuck stretches and spikes have rows; a dead sensor and a wrong unit have none."""
    coded, wild, stuck, spiking = (_warm_up(seed=k) for k in range(4))
    coded[[3, 700]] = -999.0
    wild[1200] = 2000.0
    stuck[1500:1600] = stuck[1500]
    spiking[[300, 301]] += 60.0
    recording = _recording(
        coded=coded,
        wild=wild,
        stuck=stuck,
        spiking=spiking,
        sound=_warm_up(seed=5),
        dead=np.full(N, 21.0),
        absent=np.full(N, -180.0),
        hot=_warm_up(seed=6) + 600,
        kelvin=_warm_up(seed=7) + 273.15,
    )

    rows = {name: np.flatnonzero(found).tolist() for name, found in troubled_rows(recording).items()}

    assert rows.pop("stuck") == pytest.approx(list(range(1501, 1600)), abs=2)
    assert rows == {"coded": [3, 700], "wild": [1200], "spiking": [300, 301]}
    lasting = lasting_trouble(check(recording))
    assert {(f.channel, f.kind) for f in lasting} == {
        ("dead", "constant"),
        ("absent", "missing-value code"),
        ("hot", "implausible"),
        ("kelvin", "unit"),
    }
    given = check(recording)
    assert troubled_rows(recording, given).keys() == troubled_rows(recording).keys()
    assert troubled_rows(recording, ()) == {}


@pytest.mark.parametrize("seed", [744223, 845023, 593990, 325133, 186843, 407086])
def test_a_quantised_column_that_rests_by_chance_is_not_stuck(seed: int) -> None:
    """Steps of 0.25 um, noise of a quarter of a step with rare larger values: it may rest for 40 rows and more."""
    rng = np.random.default_rng(seed)
    noise, amplitude, freedom = rng.uniform(0.05, 0.13), rng.choice([0.5, 1, 3, 10]), rng.choice([2.5, 4, 50])
    time: FloatArray = np.arange(0.0, 60000.0, 15.0)
    drift = amplitude * np.sin(2 * np.pi * time / rng.uniform(5000, 40000))
    values = np.round((drift + noise * rng.standard_t(freedom, size=4000)) / 0.25) * 0.25
    longest = int(np.diff(np.flatnonzero(np.diff(values, prepend=np.nan, append=np.nan))).max())

    found = check(_recording(time, "displacement", z=values))

    assert longest >= 30
    assert [f for f in found if f.severity == "trouble" and f.kind == "stuck"] == []
