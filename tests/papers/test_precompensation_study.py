"""The study of pre-compensation: its procedure, and that its claims can fail."""

from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray

from thermocomp.core.machine import Channel
from thermocomp.models.arx import ARX
from thermocomp.models.arx_net import NetARX
from thermocomp.papers.common import fit_and_freeze, rms
from thermocomp.papers.precompensation import cutting
from thermocomp.papers.precompensation import redo as precompensation
from thermocomp.papers.precompensation import setup as precompensation_setup
from thermocomp.papers.precompensation.setup import at_positions
from thermocomp.papers.study import Claim, Study, tell_nobody
from thermocomp.recordings.cycles import find_cycles
from thermocomp.recordings.recording import Recording
from thermocomp.virtual.protocol import Experiment

FloatArray = NDArray[np.float64]

IDS = {*(f"P-{k:02d}" for k in range(1, 8)), *(f"E-P{k}" for k in range(2, 7))}


def claim(study: Study, *ids: str) -> Claim:
    return next(c for c in study.claims if set(ids) <= set(c.ids))


def made(asked: str | Experiment, *, seed: int, room: float = 0.0) -> list[Recording]:
    """A machine with one store of heat (40 min), whose drift grows along Z; the room moves it too."""
    experiment = asked if isinstance(asked, str) else asked.name
    rng = np.random.default_rng([seed, *experiment.encode()])
    hours = {"precompensation": (12, 9), "precompensation-cut": (1.25,), "etve": (24,)}[experiment]
    tests = []
    for number, h in enumerate(hours):
        speed = np.repeat(100.0 * rng.integers(0, 34, size=round(6 * h) + 1), 10)[: round(60 * h) + 1]
        speed = np.append(0.0, speed[:-1]) * (experiment != "etve")  # a row tells the speed that led to it
        keep, z = np.exp(-1 / 40), np.zeros(len(speed))
        for k in range(1, len(z)):
            z[k] = keep * z[k - 1] - (1 - keep) * 0.02 * speed[k]
        walk = room * np.cumsum(rng.normal(size=len(z))) / 10
        walk -= walk[0]
        columns = {
            f"z_at_{p}_um": (1 - p / 2000) * z + walk + 0.05 * rng.normal(size=len(z))
            for p in (*precompensation_setup.POSITIONS, *precompensation_setup.BETWEEN)
        }
        table = pd.DataFrame({**columns, "z_um": z + walk, "spindle_rpm": speed})
        channels = tuple(Channel(c, "displacement", "um") for c in [*columns, "z_um"])
        channels += (Channel("spindle_rpm", "spindle_speed", "1/min"),)
        time = np.arange(0.0, 60.0 * len(z), 60.0)
        tests.append(Recording(f"{experiment}-{number}", time, table, channels, find_cycles(time, speed)))
    return tests


def another_machine(monkeypatch: pytest.MonkeyPatch, room: float = 0.0) -> Study:
    for module in (precompensation_setup, cutting):
        monkeypatch.setattr(module, "record", lambda e, *, seed: made(e, seed=seed, room=room))
    monkeypatch.setattr(cutting, "CUTS", 2)
    monkeypatch.setattr(cutting, "HOUSE", ("dynamic",))
    return precompensation.run(0, tell_nobody)


@pytest.fixture
def simple(monkeypatch: pytest.MonkeyPatch) -> Study:
    return another_machine(monkeypatch)


@pytest.mark.long
def test_the_virtual_machine() -> None:
    told: list[float] = []
    study = precompensation.run(0, lambda share, _: told.append(share))
    assert {i for c in study.claims for i in c.ids} == IDS
    assert told == sorted(told)
    assert all(np.isfinite(v) for v in study.numbers.values())
    n = study.numbers
    assert claim(study, "P-02").holds is False or (n["k"], n["m"]) == (1, 0)
    assert n["rms_net_um"] < n["rms_none_um"]
    assert claim(study, "P-07").holds is (n["depth_difference_corrected_um"] <= 2 / 7 * n["depth_difference_um"])
    # the same with NC programs: another way to the same figures
    before, after = n["program_depth_difference_cold_um"], n["program_depth_difference_cold_revised_um"]
    assert claim(study, "P-06", "P-07").holds is (after <= 2 / 7 * before)
    assert before == pytest.approx(n["depth_difference_um"], rel=0.1)
    assert after < 0.5 * before
    assert n["program_depth_difference_by_tolerance_um"] < 0.5 * before
    assert n["program_time_turning_as_recorded"] > 0.99
    # E-P5: what is carried over is worth more than a wrong guess, on either side
    carried = n["program_depth_difference_warm_carried_over_revised_um"]
    assert carried < 0.5 * n["program_depth_difference_warm_taken_for_cold_revised_um"]
    assert after < 0.5 * n["program_depth_difference_cold_taken_for_warm_revised_um"]
    # E-P6: a room that warms or cools moves the unrevised surfaces to either side
    cools, warms = (n[f"program_depth_difference_room_{what}_um"] for what in ("cools", "warms"))
    assert cools + 1 < before < warms - 1
    assert len({f.key for f in study.figures}) == len(study.figures) == 6


@pytest.mark.long
def test_a_machine_with_one_store_of_heat(simple: Study) -> None:
    n = simple.numbers
    # noise of the probe biases one-step coefficients a little (E-P3), so not to nothing
    assert n["rms_least_squares_um"] < 0.02 * n["rms_none_um"]
    assert claim(simple, "P-05").holds
    assert claim(simple, "P-04").holds
    assert claim(simple, "P-07").holds
    assert n["rms_one_step_um"] <= n["rms_least_squares_um"] + 0.1
    assert n["room_peak_to_peak_um"] == 0
    assert n["rms_scheduled_um"] > n["rms_net_um"]
    assert claim(simple, "P-06", "P-07").holds
    # what the net leaves is its own error: with the true model the way through the program loses next to nothing
    assert n["program_depth_difference_by_tolerance_least_squares_um"] < 0.3
    assert n["program_depth_difference_cold_least_squares_um"] < 1
    assert n["program_depth_difference_cold_um"] == n["program_depth_difference_room_warms_um"]


@pytest.mark.long
def test_a_room_that_changes_refutes_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """P-05 and P-07 can fail, and E-P6 says why: nothing of that drift follows from the speed."""
    study = another_machine(monkeypatch, room=15)
    assert claim(study, "P-05").holds is False
    assert claim(study, "P-07").holds is False
    assert claim(study, "P-06", "P-07").holds is False
    assert study.numbers["room_peak_to_peak_um"] > 20


def test_the_verification_is_another_recording(monkeypatch: pytest.MonkeyPatch) -> None:
    """P-05: learned from the first test, judged in the second, with other speeds."""
    asked: list[tuple[str, int]] = []

    def record(e: str | Experiment, *, seed: int) -> list[Recording]:
        asked.append((e if isinstance(e, str) else e.name, seed))
        return made(e, seed=seed, room=0.2 if e == "etve" else 0.0)

    monkeypatch.setattr(precompensation_setup, "record", record)
    monkeypatch.setattr(precompensation_setup, "NetARX", partial(NetARX, hidden=2, epochs=20))
    monkeypatch.setattr(precompensation_setup, "CUTS", 2)
    monkeypatch.setattr(precompensation_setup, "INTERVALS", (600.0,))
    told: list[float] = []
    c = precompensation_setup.compute(0, lambda share, _: told.append(share))
    assert told == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.9])
    cutting_tests = [("precompensation-cut", k) for k in (0, 1)]
    both = [("precompensation", 0), *cutting_tests * 2, ("etve", 0), ("precompensation", 0)]
    assert asked == both
    assert (len(c.orders), c.hidden) == (4, [2] * 4)
    assert c.room == pytest.approx(np.ptp(made("etve", seed=0, room=0.2)[0].table["z_um"]))
    nets = c.models[precompensation_setup.NET]
    for k in (0, 1):
        (test,) = made("precompensation-cut", seed=k)
        np.testing.assert_array_equal(c.cuts[k].scheduled, precompensation_setup.cut(test, nets).scheduled)
        for function, cuts in c.between.items():
            again = precompensation_setup.cut(test, nets, precompensation_setup.BETWEEN, function)
            np.testing.assert_array_equal(cuts[k].scheduled, again.scheduled)
    # one step ahead by least squares, at every position
    steps = []
    for k, channel in enumerate(c.learn.targets):
        paper = ARX(inputs=("spindle_rpm",), time="routed", interval=600.0, k=1, m=0)
        paper.fit(c.learn.frame(), c.learn.deviations[:, k], dt=c.learn.dt(), cycle=c.learn.cycle)
        ahead = paper.one_step(c.judge.frame(), c.judge.deviations[:, k], dt=c.judge.dt())
        steps.append(ahead[:, 1] - ahead[:, 0])
        assert channel.name == f"z_at_{precompensation_setup.POSITIONS[k]}_um"
    assert c.one_step == pytest.approx(rms(np.concatenate(steps)))
    ((orders, _, least),) = c.clocks.values()
    assert orders == (min(c.orders[0], key=lambda o: o.fpe).k, min(c.orders[0], key=lambda o: o.fpe).m)
    assert least == pytest.approx(rms(c.left[precompensation_setup.LEAST][:, 0]))
    identification, verification = made("precompensation", seed=0)
    for samples, test in ((c.learn, identification), (c.judge, verification)):
        np.testing.assert_array_equal(samples.values[:, 0], test.table["spindle_rpm"])
        measured = np.column_stack([test.table[f"z_at_{p}_um"] for p in precompensation_setup.POSITIONS])
        np.testing.assert_allclose(np.diff(samples.deviations, axis=0), np.diff(measured, axis=0), atol=1e-9)
    # what is judged is the drift of the second test, and least squares predicts it without having seen it
    np.testing.assert_array_equal(c.left[precompensation_setup.NONE], c.judge.deviations)
    assert c.errors[precompensation_setup.LEAST].rms < 0.1 * c.errors[precompensation_setup.NONE].rms
    left = c.judge.deviations - at_positions(c.models[precompensation_setup.NET], c.judge)
    assert c.workshop == pytest.approx(rms(left))  # this machine knows no room: that of the workshop is the same
    warm = precompensation_setup.warm_start(c.judge, c.models[precompensation_setup.NET][0])
    np.testing.assert_array_equal(c.warm.carried, warm.carried)
    fitted = at_positions(c.models[precompensation_setup.LEAST], c.learn)
    assert rms(c.learn.deviations - fitted) < 0.1 * rms(c.learn.deviations)


@pytest.mark.parametrize(("after", "holds"), [(0.27, True), (0.3, False), (0.9, False)])
def test_the_depth_must_shrink_as_in_the_paper(after: float, holds: bool) -> None:
    """P-07: 7 -> 2 um."""
    found = SimpleNamespace(
        depths=(20.0, 20.0 * after),
        cuts=[precompensation_setup.CuttingTest(np.full(4, 20.0), np.full(4, 20.0 * after))],
    )
    (claim,) = precompensation.claims.judged("depth", found)  # type: ignore[arg-type]
    assert claim.holds is holds


def test_what_is_added_to_the_program_is_minus_the_deviation() -> None:
    # E-P4: a growth of +10 um is taken back by -10 um
    time = np.arange(0.0, 31 * 60.0, 60.0)
    assert (precompensation_setup.schedule_corrections(time, np.full((31, 2), 10.0)) == -10).all()


def test_the_program_is_corrected_every_ten_minutes() -> None:
    # P-06
    time = np.arange(0.0, 31 * 60.0, 60.0)
    added = precompensation_setup.schedule_corrections(time, time[:, None] / 60)[:, 0]
    assert added.tolist() == [0.0] * 10 + [-10.0] * 10 + [-20.0] * 10 + [-30.0]


@pytest.mark.parametrize(
    ("function", "halfway"),
    [
        (precompensation_setup.NEAREST, [[0, 1, 8], [0, 1, 4]]),  # the lower of two equally near
        (precompensation_setup.LINEAR, [[0.5, 4.5, 17.5], [0.5, 2.5, 6.5]]),
        ("quadratic spline", [[None] * 3, [0.25, 2.25, 6.25]]),
        # second derivatives 0, m, n, 0 with 4m + n = 6 (y0 - 2y1 + y2) and m + 4n = 6 (y1 - 2y2 + y3)
        ("natural cubic spline", [[0.5 - 4.8 / 16, 4.5 - (4.8 + 16.8) / 16, 17.5 - 16.8 / 16], [0.35, 2.2, 6.35]]),
        ("cubic polynomial", [[0.125, 3.375, 15.625], [0.25, 2.25, 6.25]]),
    ],
)
def test_functions_that_interpolate_between_the_models(function: str, halfway: list[list[float | None]]) -> None:
    """P-04, P-07: the cubes and the squares of 0, 1, 2, 3 at the models."""
    at = np.array([[0.0, 1, 8, 27], [0, 1, 4, 9]])
    positions = precompensation_setup.POSITIONS
    found = precompensation_setup.INTERPOLATIONS[function](positions, at)
    assert found(positions) == pytest.approx(at)
    for row, expected in zip(found(precompensation_setup.BETWEEN), halfway, strict=True):
        assert None in expected or row == pytest.approx(expected)


def test_depths_halfway_between_the_models() -> None:
    """P-07: on a machine whose drift is linear along Z a line is right, the nearest model is 100 mm off."""
    learn = precompensation_setup.samples_of(made("precompensation", seed=0)[0])
    estimator = ARX(inputs=("spindle_rpm",), time="routed", interval=60.0, k=1, m=0)
    models = [
        fit_and_freeze(estimator, learn, [c.name], dt=learn.dt(), cycle=learn.cycle)[c.name] for c in learn.targets
    ]
    (test,) = made("precompensation-cut", seed=5)
    between = precompensation_setup.BETWEEN
    nearest, line = (
        precompensation_setup.cut(test, models, between, f)
        for f in (precompensation_setup.NEAREST, precompensation_setup.LINEAR)
    )
    np.testing.assert_array_equal(nearest.without, line.without)
    # the nearest model computes the drift of 100 mm lower, and the drift falls by 1/2000 per mm
    off = np.array([100 / (2000 - p) for p in between])
    assert np.abs(line.without).min() > 5
    assert nearest.scheduled - line.scheduled == pytest.approx(off * (line.scheduled - line.without), rel=0.05)


@pytest.mark.parametrize(("others", "holds"), [(5.0, True), (6.0, False)])
def test_every_function_must_shrink_the_depth(others: float, holds: bool) -> None:
    """P-07: 7 -> 2 um, so 20 -> 5.7 um."""
    after = dict.fromkeys(precompensation_setup.INTERPOLATIONS, 3.0) | {"cubic polynomial": others}
    found = SimpleNamespace(
        between={f: [precompensation_setup.CuttingTest(np.full(3, 20.0), np.full(3, a))] for f, a in after.items()}
    )
    (claim,) = precompensation.claims.judged("between", found)  # type: ignore[arg-type]
    assert claim.holds is holds
    assert claim.ours.count(" um") == 1 + len(after)
    assert f"at most {others - 3:.2f} um" in claim.finding


def test_depth_difference_of_two_surfaces() -> None:
    # P-07: the surfaces are means over the first and the last five minutes of running
    (test,) = made("precompensation-cut", seed=1)
    rows = len(test)
    running = test.table["spindle_rpm"].to_numpy() > 0
    z = np.where(np.arange(rows) < 30, 3.0, 10.0)
    z[~running] = 99.0  # nothing is milled there
    table = test.table.assign(**{f"z_at_{p}_um": z for p in precompensation_setup.POSITIONS})
    learn = precompensation_setup.samples_of(made("precompensation", seed=1)[0])
    still = replace(learn, deviations=0 * learn.deviations)
    estimator = ARX(inputs=("spindle_rpm",), time="routed", k=0, m=0)
    nothing = [
        fit_and_freeze(estimator, still, [c.name], dt=learn.dt(), cycle=learn.cycle)[c.name] for c in still.targets
    ]
    found = precompensation_setup.cut(replace(test, table=table), nothing)
    assert found.without == pytest.approx([7.0] * 4)
    assert found.scheduled == pytest.approx([7.0] * 4)
