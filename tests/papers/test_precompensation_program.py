"""NC programs of the cutting tests: what they make the machine do, what revising does to them, and what is milled."""

from dataclasses import asdict
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray

from thermocomp.core.inputs import Input
from thermocomp.core.lineardynamic import LinearDynamic
from thermocomp.core.machine import Channel
from thermocomp.nc.linuxcnc import rs274
from thermocomp.nc.thermal.drift import Drift
from thermocomp.nc.thermal.start import begin_cold
from thermocomp.papers.precompensation import cutting, program
from thermocomp.papers.precompensation.cutting import COLD, COLDER, HOUR, WARM, WARMER, Changing
from thermocomp.papers.precompensation.setup import POSITIONS, SPEED
from thermocomp.recordings.cycles import find_cycles
from thermocomp.recordings.recording import Recording
from thermocomp.virtual.climate import STABLE
from thermocomp.virtual.datasets import find_experiment, record

FloatArray = NDArray[np.float64]

#: speed of each five minutes
SPEEDS = (2000, 500, 3300, 0, 0, 1200, 2900, 2000)


def recorded(speeds: tuple[int, ...] = SPEEDS, um: float = 0.0) -> Recording:
    speed = np.repeat(np.array([0.0, *speeds]), [1, *[5] * len(speeds)])
    table = pd.DataFrame({f"z_at_{p}_um": np.full(len(speed), um) for p in POSITIONS} | {SPEED: speed})
    channels = tuple(Channel(c, "displacement", "um") for c in table.columns[:-1])
    time = np.arange(0.0, 60.0 * len(speed), 60.0)
    channels += (Channel(SPEED, "spindle_speed", "1/min"),)
    return Recording("by hand", time, table, channels, find_cycles(time, speed))


def models() -> list[LinearDynamic]:
    """Z grows by 15 um per 1000 1/min within minutes, at 600 mm by 9 um."""
    speed = Input(SPEED, "spindle_speed", "1/min", reference=0.0, rezero=False, low=0.0, high=3500.0)
    return [
        LinearDynamic(
            target=f"z_at_{p}_um",
            unit="um",
            inputs=(speed,),
            signals=((0,),),
            direct=(0.0,),
            lag_signals=(0,),
            time_constants=(300.0,),
            lagged=(0.015 - p * 1e-5,),
        )
        for p in POSITIONS
    ]


def drifting(test: Recording) -> Recording:
    """Return the test of a machine that does what the models say."""
    there = program.stations(models())
    drift, rows = Drift(there, begin_cold(there, {})), [(0.0,) * len(POSITIONS)]
    for dt, speed in zip(np.diff(test.time), test.table[SPEED].to_numpy()[1:], strict=True):
        for _ in range(12):
            drift.advance(dt / 12, float(speed))
        rows.append(drift.values)
    columns = [c for c in test.table.columns if c != SPEED]
    table = pd.DataFrame(np.array(rows), columns=columns).assign(**{SPEED: test.table[SPEED]})
    return Recording(test.name, test.time, table, test.channels, test.cycles)


# -- written ---------------------------------------------------------------------------------------------------------


def test_the_spindle_turns_as_in_the_test_to_the_second() -> None:
    test = recorded()
    lines = program.write_program(test)
    times = np.arange(10.0, test.time[-1], 0.7)
    rows = np.minimum(np.searchsorted(test.time, times), len(test) - 1)
    away = np.abs(times[:, None] - test.time).min(axis=1) > 0.01
    assert (program.turning(lines, times) == test.table[SPEED].to_numpy()[rows])[away].all()
    dwells = [t.end for t in program.run(lines) if t.block.pause]
    assert dwells == pytest.approx([300, 600, 900, 1500, 1800, 2100, 2400], abs=0.01)


def test_faces_are_milled_in_the_first_and_last_five_minutes_with_a_turning_spindle() -> None:
    lines = program.write_program(recorded())
    found = program.faces(lines)
    assert [(f.number, f.position) for f in found] == [(n, float(p)) for n in (1, 2) for p in POSITIONS]
    assert all((f.time > 0).all() and (f.time < 300).all() for f in found[:4])
    assert all((f.time > 2100).all() and (f.time < 2400).all() for f in found[4:])
    for face in found:
        assert np.allclose(face.z, 0)
        assert (program.turning(lines, face.time) == 2000).all()
        # all its passes, at their feed, and the ways between them
        way = program.PASSES * program.LENGTH + (program.PASSES - 1) * program.APART
        assert np.ptp(face.time) == pytest.approx(60 * way / program.FEED, abs=2.5)


def test_a_stretch_too_short_for_its_moves() -> None:
    test = recorded()
    table = test.table.copy()
    table.loc[3:, SPEED] = 1000.0
    short = Recording(test.name, test.time, table, test.channels, test.cycles)
    with pytest.raises(ValueError, match=r"the moves before it take \d+\.\d s longer"):
        program.write_program(short)


# -- revised ---------------------------------------------------------------------------------------------------------


def test_every_ten_minutes_adds_the_drift_of_that_moment_and_place() -> None:
    # P-06, E-P4: 30 min after the start the drift is d, so -d is commanded from 30 to 40 min
    test = recorded()
    truth = drifting(test)
    revised = program.faces(program.revise_program(program.write_program(test), models(), program.EVERY))
    for face in revised[:4]:
        assert np.allclose(face.z, 0)
    for face, p in zip(revised[4:], POSITIONS, strict=True):
        told = truth.table[f"z_at_{p}_um"].iloc[30]
        assert told > 5
        assert face.z == pytest.approx(np.full(len(face.z), -told), abs=0.2)


@pytest.mark.parametrize("way", [program.NEEDED, program.SAFE])
def test_a_machine_that_does_what_the_models_say_mills_to_the_drawing(way: str) -> None:
    test = recorded()
    truth, lines = drifting(test), program.write_program(test)
    before = [f.surface(truth).mean() for f in program.faces(lines)]
    after = [f.surface(truth) for f in program.faces(program.revise_program(lines, models(), way))]
    assert np.ptp(before) > 15
    assert max(np.abs(s).max() for s in after) < (3.5 if way == program.NEEDED else 7)
    assert np.abs([s.mean() for s in after[4:]]).max() < 1.5


def test_a_state_carried_over_is_that_of_the_job_before() -> None:
    lines = program.write_program(recorded())
    there = models()
    from_cold, from_warm = (
        program.faces(program.revise_program(lines, there, program.EVERY, start))
        for start in (None, program.warmed(there, HOUR, 2000.0))
    )
    # settled at 2000 1/min before: the work is set up on the warm machine, and 30 um of drift are behind it
    late = [f[4].z[0] for f in (from_cold, from_warm)]
    assert late[1] - late[0] == pytest.approx(0.015 * 2000, abs=0.3)


def test_linuxcnc_mills_what_is_read_back(tmp_path: Path) -> None:
    if reason := rs274.find_obstacle():
        pytest.skip(reason)
    stored = rs274.Stored(origins={1: (0.0, 0.0, -program.TOOL)}, lengths={1: program.TOOL})
    for way in program.WAYS:
        lines = program.revise_program(program.write_program(recorded()), models(), way)
        path = tmp_path / "cut.ngc"
        path.write_text("".join(lines), encoding="ascii")
        calls = [c.machine[:3] for c in rs274.read(path, stored) if c.kind in ("rapid", "feed")]
        ours = [m.end for t in program.run(lines) for m in t.block.moves]
        assert len(calls) == len(ours) > 100
        x, y, z = np.abs(np.array(calls) - np.array(ours)).max(axis=0)
        assert max(x, y) < 1e-6
        assert z < 1e-4


# -- milled ----------------------------------------------------------------------------------------------------------


def test_a_surface_is_what_is_commanded_plus_the_drift_at_its_time_and_place() -> None:
    test = recorded()
    table = test.table.assign(**{f"z_at_{p}_um": p / 100 + test.time / 60 for p in POSITIONS})
    truth = Recording(test.name, test.time, table, test.channels, test.cycles)
    face = program.FacedSurface(1, 300.0, np.array([30.0, 600.0]), np.array([-4.0, -5.0]))
    # 300 mm lies in the middle of two positions; -5 um is 5e-6 of the way to the next one
    assert face.surface(truth) == pytest.approx([-4 + 3 + 0.5, -5 + 3 + 10], abs=1e-3)
    deep = program.FacedSurface(1, 300.0, np.array([30.0]), np.array([-1e5]))  # 100 mm lower
    assert deep.surface(truth) == pytest.approx([-1e5 + 2 + 0.5], abs=1e-3)


def test_a_pass_that_climbs_is_looked_at_all_along() -> None:
    lines = ["G21 G90 G54 T1 M6\n", "G43 H1 S500 M3\n", "G0 X0 Y0 Z0\n", "(FACE 1 AT Z 0)\n", "G1 X200 Z0.01 F1200\n"]
    (face,) = program.faces([*lines, "G0 Z600\n", "G1 X0 F1200\n", "M30\n"])
    assert face.z == pytest.approx(np.arange(0.5, 10.5, 1.0))
    assert np.diff(face.time) == pytest.approx(np.ones(9), abs=0.01)


def test_the_true_states_differ_in_nothing_but_what_they_should() -> None:
    tests = {what: record(cutting.make_true_test(what), seed=3)[0] for what in (COLD, WARM, WARMER, COLDER)}
    speed = tests[COLD].table[SPEED].to_numpy()
    noisy = record("precompensation-cut", seed=3)[0]
    assert np.abs(tests[COLD].table["z_at_0_um"].to_numpy()[::3] - noisy.table["z_at_0_um"].to_numpy()).max() < 2
    z = {what: test.table["z_at_0_um"].to_numpy() for what, test in tests.items()}
    for what, test in tests.items():
        assert (test.table[SPEED].to_numpy() == speed).all()
        assert z[what][0] == 0
    # the room begins to change after the first surface
    assert np.array_equal(z[WARMER][:16], z[COLD][:16])
    assert not np.allclose(z[WARMER][-1], z[COLD][-1], atol=1)
    assert z[WARMER][-1] - z[COLD][-1] == pytest.approx(z[COLD][-1] - z[COLDER][-1], rel=0.05)
    # a warm machine has the greater part of its way behind it
    assert abs(z[WARM][-1]) < 0.7 * abs(z[COLD][-1])


def test_a_room_that_changes() -> None:
    room = Changing(**asdict(STABLE), change=2.0)
    plain, changed = (
        climate.air(climate.init(rng := np.random.default_rng(1)), -600.0, 60.0, 90, rng)[1]
        for climate in (STABLE, room)
    )
    time = -600.0 + 60.0 * np.arange(1, 91)
    more = changed[:, 0] - plain[:, 0]
    assert np.allclose(more, np.interp(time, [300.0, 3900.0], [0.0, 2.0]))
    assert np.array_equal(plain[:, 1:], changed[:, 1:])


def test_warm_is_as_long_soaked_as_cold() -> None:
    (plan,) = cutting.make_true_test(WARM).tests
    assert plan.soak.longest == find_experiment("precompensation-cut").tests[0].soak.longest
    assert plan.soak.segments[1].duration == 1800
