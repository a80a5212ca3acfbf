"""Time constants: what is known beforehand is found again, and what cannot be known is said."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from smallmachine import small_machine

from thermocomp.core.machine import Channel
from thermocomp.iso230.tables import settling_content, time_constant_tables
from thermocomp.judging.settling.averaging import scatter
from thermocomp.judging.settling.exponentials import fit
from thermocomp.judging.settling.settling import Phase, find_driven_rows, find_phases, settle, time_constants
from thermocomp.recordings.cycles import make_single_cycle
from thermocomp.recordings.recording import Recording

FloatArray = NDArray[np.float64]

PHASE = Phase("warm-up", 1, 0, 240)
TIME = np.arange(0.0, 14_401.0, 60.0)


def rise(tau: float, time: FloatArray = TIME) -> FloatArray:
    return np.asarray(1.0 - np.exp(-time / tau))


def speeds(*stretches: tuple[int, float], feed: bool = False) -> Recording:
    """Return a recording with so many rows, a minute apart, at each speed."""
    values = np.concatenate([np.full(n, v) for n, v in stretches])
    channel = Channel("feed_mm_min", "feed", "mm/min") if feed else Channel("s_rpm", "spindle_speed", "1/min")
    table = pd.DataFrame({channel.name: values})
    time = np.arange(0.0, 60.0 * len(values), 60.0)
    return Recording("r", time, table, (channel,), make_single_cycle(len(values)))


# -- one channel --------------------------------------------------------------------------------------------------


@settings(max_examples=25, deadline=None)
@given(
    tau=st.floats(300.0, 4300.0), size=st.floats(0.5, 200.0), sign=st.sampled_from([-1.0, 1.0]), zero=st.floats(-50, 50)
)
def test_one_exponential_is_found_again(tau: float, size: float, sign: float, zero: float) -> None:
    s = settle(TIME, zero + sign * size * rise(tau), "z_um", "um", PHASE)
    assert s.settled
    assert s.one is not None
    (term,) = s.one.terms
    assert term.tau == pytest.approx(tau, rel=1e-6)
    assert term.amplitude == pytest.approx(sign * size, rel=1e-6)
    assert s.one.start == pytest.approx(zero, abs=1e-6 * size)
    assert s.one.r_squared == pytest.approx(1.0)
    assert s.two is None
    # read from the curve: of the change up to the end, so the logarithm of what of it is left
    end = float(rise(tau)[-1])
    assert s.t90 == pytest.approx(-tau * np.log(1 - 0.9 * end), abs=8)
    assert s.t63 == pytest.approx(-tau * np.log(1 - (1 - np.exp(-1)) * end), abs=8)


@pytest.mark.parametrize(("tau", "settled"), [(14_400 / 3.32, True), (14_400 / 3.22, False)])
def test_settled_is_from_3_3_time_constants_on(tau: float, settled: bool) -> None:
    s = settle(TIME, 40 * rise(tau), "z_um", "um", PHASE)
    assert s.settled is settled
    assert s.words == ("" if settled else "not settled")


def test_two_exponentials_are_found_again() -> None:
    s = settle(TIME, 10 * rise(900) - 4 * rise(5400), "z_um", "um", PHASE)
    assert s.two is not None
    assert [e.tau for e in s.two.terms] == pytest.approx([900, 5400], rel=1e-6)
    assert [e.amplitude for e in s.two.terms] == pytest.approx([10, -4], rel=1e-6)
    assert s.two.final == pytest.approx(6)
    assert s.two(TIME) == pytest.approx(10 * rise(900) - 4 * rise(5400), abs=1e-8)


def test_standard_errors_say_how_far_the_time_constant_is_off() -> None:
    """Independent noise: about two in three lie within one standard error."""
    rng = np.random.default_rng(3)
    within = 0
    for _ in range(60):
        one, _two = fit(TIME, 10 * rise(1800) + 0.3 * rng.normal(size=TIME.size))
        assert one is not None
        (term,) = one.terms
        within += abs(term.tau - 1800) <= term.tau_error
        assert 5 < term.tau_error < 120
    assert 0.45 <= within / 60 <= 0.95


def test_noise_calls_for_no_second_exponential() -> None:
    rng = np.random.default_rng(5)
    found = [settle(TIME, 10 * rise(1800) + 0.1 * rng.normal(size=TIME.size), "z", "um", PHASE) for _ in range(20)]
    assert sum(s.two is not None for s in found) <= 2
    assert scatter(0.1 * rng.normal(size=4000)) == pytest.approx(0.1, rel=0.1)


def test_what_cannot_be_known_is_said() -> None:
    rng = np.random.default_rng(1)
    jitter = 0.1 * rng.normal(size=TIME.size)

    creeping = settle(TIME, 10 * rise(40_000) + jitter, "y", "um", PHASE)
    assert creeping.words == "not settled"
    assert creeping.one is not None
    assert not creeping.one.reliable  # longer than what was recorded

    still = settle(TIME, jitter, "x", "um", PHASE)
    assert still.words == "does not change"
    assert still.one is None
    assert np.isnan(still.t90)

    assert settle(TIME, np.full(TIME.size, 3.0), "x", "um", PHASE).words == "does not change"

    bump = settle(TIME, 10 * (rise(900) - rise(3000)) + jitter, "x", "um", PHASE)
    assert bump.words == "returns"
    assert np.isnan(bump.t63)


def test_an_overshoot_has_no_time_to_90_percent() -> None:
    """It peaks at 1.28 of its end value: 90 % were first passed long before it came to rest."""
    rng = np.random.default_rng(2)
    jitter = 0.05 * rng.normal(size=TIME.size)
    for sign in (-1.0, 1.0):
        s = settle(TIME, sign * (20 * rise(600) - 10 * rise(2400)) + jitter, "z", "um", PHASE)
        peak = float((20 * rise(600) - 10 * rise(2400)).max())
        assert peak > 1.1 * 10
        assert s.overshoots
        assert s.words == "overshoots"
        assert np.isnan([s.t63, s.t90]).all()
        assert s.two is not None
        (table,) = time_constant_tables([s])
        assert table.rows[0][2:4] == ("peaks", "peaks")
        assert "peaks: the curve overshoots" in str(table.caption)
        assert settling_content(s)["told"] == "overshoots"
    # a twentieth is within the band of t90
    slight = settle(TIME, 11 * rise(600) - rise(4000) + jitter, "z", "um", PHASE)
    assert not slight.overshoots
    assert np.isfinite(slight.t90)
    # still on its way down
    late = settle(TIME, 20 * rise(600) - 10 * rise(9000) + jitter, "z", "um", PHASE)
    assert late.words == "overshoots, not settled"


def test_channels_may_be_left_out() -> None:
    recording = small_machine()
    found = time_constants(recording, None, {"t1_C"})
    assert "t1_C" not in {s.channel for s in found}
    assert len(found) == 8 * 4


def test_missing_values_and_outliers_are_passed_over() -> None:
    y = 10 * rise(1800)
    y[50] = 500.0
    y[100:120] = np.nan
    s = settle(TIME, y, "z", "um", PHASE)
    clean = settle(TIME, 10 * rise(1800), "z", "um", PHASE)
    assert s.t90 == pytest.approx(clean.t90, abs=1)
    few = settle(TIME[:5], y[:5], "z", "um", PHASE)
    assert few.one is None
    assert np.isnan(few.change)


# -- phases -------------------------------------------------------------------------------------------------------


def test_phases_begin_in_the_row_before_the_change() -> None:
    found = find_phases(speeds((6, 0), (60, 1000), (40, 0), (60, 2000)))
    assert [(p.kind, p.number, p.start, p.end) for p in found] == [
        ("warm-up", 1, 5, 65),
        ("cool-down", 1, 65, 105),
        ("warm-up", 2, 105, 165),
    ]


def test_a_spectrum_of_speeds_is_one_warm_up() -> None:
    spectrum = [stretch for _ in range(8) for stretch in ((6, 3500.0), (6, 875.0), (6, 2625.0), (6, 0.0))]
    found = find_phases(speeds((5, 0), *spectrum[:-1], (120, 0)))
    assert [(p.kind, p.start) for p in found] == [("warm-up", 4), ("cool-down", 4 + 8 * 24 - 6)]


def test_feeds_count_and_blips_do_not() -> None:
    assert [p.kind for p in find_phases(speeds((30, 0), (60, 6000), (30, 0), feed=True))] == ["warm-up", "cool-down"]
    assert find_phases(speeds((60, 0), (3, 500), (60, 0))) == ()
    assert find_phases(speeds((60, 0))) == ()
    on = find_driven_rows(speeds((2, 0), (2, 1000)))
    assert on is not None
    assert on.tolist() == [False, False, True, True]


def test_known_physics_of_a_recording() -> None:
    """t1_C follows heat with 20 min, x_um is its mirror image: small_machine."""
    recording = small_machine()
    found = time_constants(recording)
    assert len(found) == 8 * 5
    first = {s.channel: s for s in found if s.phase.kind == "warm-up" and s.phase.number == 4}
    one = first["t1_C"].one
    assert one is not None
    assert one.terms[0].tau == pytest.approx(1200, rel=0.1)
    assert first["x_um"].change < 0 < first["z_um"].change
