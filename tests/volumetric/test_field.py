"""ErrorField and VolumetricModel: Chen's numbers, corrections, replays."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from volumetricmachine import STRUCTURES, by_hand, line, random_machine, random_values, temperature

from thermocomp.core.components import COMPONENTS
from thermocomp.core.exceptions import InputError, ReadingError
from thermocomp.core.lineardynamic import LinearDynamic
from thermocomp.core.machine import Machine, Source
from thermocomp.core.position import PositionModel
from thermocomp.core.profile import PolynomialProfile
from thermocomp.core.provenance import RULES, HonestError
from thermocomp.runtime.geometry.field import ErrorField
from thermocomp.runtime.geometry.kinematics import INDEX, Kinematics
from thermocomp.runtime.geometry.straight import straight_lines
from thermocomp.runtime.geometry.volumetric import VolumetricModel

#: C-22, Eq. (6), for y in mm and d in mm (E-C6): 1000 times as much in um
CHEN = PolynomialProfile(
    exponents=tuple((0, k, 0) for k in range(6)),
    coefficients=tuple(1e3 * c for c in (2.424e-4, 3.096e-4, -3.571e-6, 1.474e-8, -2.662e-11, 1.738e-14)),
    low=(0.0, 0.0, 0.0),
    high=(0.0, 550.0, 0.0),
)


def chen() -> PositionModel:
    """C-22 and C-24: k_1 = 0.465 T3 + 2.705 T4 + 3.675 (T6 - T8) - 5.589 (T7 - T9) [um/m]."""
    slope = line("EYY", "um/m", {"T3": 0.465, "T4": 2.705}, differences=[("T6", "T8", 3.675), ("T7", "T9", -5.589)])
    return PositionModel(target="EYY", unit="um", axis="Y", travel=(0.0, 550.0), profile=CHEN, slopes=(slope,))


def rich(code: str, seed: int = 0) -> Machine:
    """Return a machine with every kind of source in it."""
    rng = np.random.default_rng(seed)
    components: dict[str, Source] = {}
    for k, c in enumerate(COMPONENTS):
        if k % 7 == 3:
            continue
        if c.depends_on is None or k % 5 == 0:
            components[c.code] = float(rng.normal() * 20) if k % 2 else line(c.code, c.unit, {"T1": 2.0, "T2": -1.0})
        else:
            components[c.code] = PositionModel(
                target=c.code,
                unit=c.unit,
                axis=c.depends_on,
                travel=(0.0, 600.0),
                reference_position=100.0,
                profile=PolynomialProfile(
                    exponents=((1, 0, 0), (0, 2, 0), (1, 0, 1)),
                    coefficients=tuple((10 * rng.normal(size=3)).tolist()),
                    scale=(300.0, 300.0, 300.0),
                    low=(0.0, 0.0, 0.0),
                    high=(600.0, 600.0, 600.0),
                )
                if k % 2
                else None,
                offset=line(c.code, c.unit, {"T2": 1.5}) if k % 3 else None,
                slopes=tuple(line(c.code, u, {"T1": 1.0}) for u in (f"{c.unit}/m", f"{c.unit}/m^2")),
            )
    return by_hand(code, components, reference=300.0)


def test_chen_at_500_mm() -> None:
    """E-C6: with T3 = 10, T4 = 20, T6-T8 = 2, T7-T9 = 1 degC the slope is 60.5 um/m: 30 um at 500 mm."""
    model = VolumetricModel(by_hand("XYZ", {"EYY": chen()}))
    assert model.inputs == ("T3", "T4", "T6", "T8", "T7", "T9")
    cold = dict.fromkeys(model.inputs, 20.0)
    state, field = model.step(model.init(), cold, 0.0)
    before = field.error(np.array([0.0, 500.0, 0.0]))
    assert before == pytest.approx([0.0, -15.83, 0.0], abs=0.005)
    warm = {"T3": 30.0, "T4": 40.0, "T6": 23.0, "T8": 21.0, "T7": 25.0, "T9": 24.0}
    state, field = model.step(state, warm, 60.0)
    assert field.varying[0][2] == pytest.approx([60.5], abs=0.05)
    after = field.error(np.array([[0.0, 500.0, 0.0], [0.0, 250.0, 0.0]]))
    assert after[0] - before == pytest.approx([0.0, 30.26, 0.0], abs=0.005)
    assert after[1] == pytest.approx([0.0, -2.24 + 15.13, 0.0], abs=0.01)


def test_a_component_may_be_a_number_a_model_or_nothing() -> None:
    sources: dict[str, Source] = {"EXX": 3.0, "EYX": line("EYX", "um", {"T1": 2.0}), "EYY": chen()}
    model = VolumetricModel(by_hand("XYZ", sources))
    state, _ = model.step(model.init(), dict.fromkeys(model.inputs, 20.0), 0.0)
    _, field = model.step(state, {**dict.fromkeys(model.inputs, 20.0), "T1": 25.0}, 1.0)
    points = np.array([[0.0, 50.0, 0.0], [600.0, 250.0, 9.0]])
    values = field.components(points)
    assert values.shape == (2, 32)
    assert values[:, INDEX["EXX"]].tolist() == [3.0, 3.0]
    assert values[:, INDEX["EYX"]].tolist() == [10.0, 10.0]  # a model of time alone: the same over the travel
    assert values[:, INDEX["EYY"]] == pytest.approx([8.48, -2.24], abs=0.005)
    others = [k for c, k in INDEX.items() if c not in sources]
    assert not values[:, others].any()


def test_a_machine_without_models_needs_no_reading() -> None:
    model = VolumetricModel(by_hand("XYZ", {"C0Y": 10.0}))
    assert model.inputs == ()
    _, field = model.step(model.init(), {}, 0.0)
    assert field.error(np.array([0.0, 500.0, 0.0])) == pytest.approx([-5.0, 0.0, 0.0])


@pytest.mark.parametrize("code", ["XYZ", "w X' b Z Y (C1) t"])
def test_one_point_is_many_points_alone(code: str) -> None:
    model = VolumetricModel(rich(code))
    state, _ = model.step(model.init(), {"T1": 20.0, "T2": 20.0}, 0.0)
    _, field = model.step(state, {"T1": 33.0, "T2": 27.0}, 1.0)
    points = np.random.default_rng(1).uniform(-100, 700, (4, 5, 3))
    tool = (0.0, 30.0, -200.0)
    for job in (
        field.components,
        field.error,
        field.tilt,
        lambda p: field.error(p, tool),
        lambda p: field.error(p, tool, exact=True),
    ):
        together = job(points)
        assert together.shape[:2] == (4, 5)
        assert np.abs(together).max() > 1.0
        assert together[2, 3] == pytest.approx(job(points[2, 3]), rel=1e-12, abs=1e-9)
    # the worst point decides how often all are inserted
    together = field.correction(points, tool)
    assert together[2, 3] == pytest.approx(field.correction(points[2, 3], tool), abs=1e-4)


@given(st.sampled_from(STRUCTURES), st.integers(0, 2**32), st.floats(10.0, 1000.0))
def test_correction_leaves_less_than_a_hundredth_of_a_micrometre(code: str, seed: int, size: float) -> None:
    """The truth is exact: at the corrected command the machine stands where it should."""
    rng = np.random.default_rng(seed)
    machine = random_machine(code, rng)
    profiles = {}
    for c in COMPONENTS:
        if c.depends_on in machine.structure.axes:
            k = "XYZ".index(c.depends_on or "")
            profiles[c.code] = PositionModel(
                target=c.code,
                unit=c.unit,
                axis=c.depends_on or "",
                travel=(-400.0, 400.0),
                profile=PolynomialProfile(
                    exponents=tuple(tuple(n * (i == k) for i in range(3)) for n in range(4)),  # type: ignore[misc]
                    coefficients=tuple(rng.uniform(-size, size, 4).tolist()),
                    scale=(400.0, 400.0, 400.0),
                    low=(-500.0, -500.0, -500.0),
                    high=(500.0, 500.0, 500.0),
                ),
            )
    values = random_values(machine, rng, size, size)[0]
    varying = tuple((INDEX[code], m, ()) for code, m in profiles.items())
    field = ErrorField(Kinematics(machine), values, varying)
    points = rng.uniform(-400, 400, (6, 3))
    correction = field.correction(points)
    there = np.array([a in machine.structure.axes for a in "XYZ"])
    left = field.error(points + 1e-3 * correction, exact=True) + correction
    assert np.abs(left[:, there]).max() < 0.01
    assert np.abs(correction[:, there]).max() > 0.1
    assert not correction[:, ~there].any()


def test_an_axis_that_is_not_there_corrects_nothing() -> None:
    """A lathe-like machine errs along Y as well: that stays, and is not in the way of X and Z."""
    values = np.zeros(len(COMPONENTS))
    values[[INDEX[c] for c in ("EXX", "EYX", "EZX", "Y0C")]] = 3.0, 40.0, -2.0, -5.0
    field = ErrorField(Kinematics(by_hand("XFZ", {})), values)
    point = np.array([100.0, 0.0, 50.0])
    correction = field.correction(point)
    assert correction.tolist() == [pytest.approx(-3.0), 0.0, pytest.approx(2.0)]
    assert field.error(point + 1e-3 * correction, exact=True) + correction == pytest.approx([0.0, 35.0, 0.0], abs=1e-9)


def test_a_correction_that_does_not_settle_is_refused() -> None:
    steep = PositionModel(
        target="EXX",
        unit="um",
        axis="X",
        travel=(0.0, 600.0),
        profile=PolynomialProfile(
            exponents=((1, 0, 0),), coefficients=(1500.0,), low=(-1e6, 0.0, 0.0), high=(1e6, 0.0, 0.0)
        ),
    )
    _, field = VolumetricModel(machine := by_hand("XYZ", {"EXX": steep})).step(VolumetricModel(machine).init(), {}, 0.0)
    with pytest.raises(InputError, match="machine round: the correction still changes by"):
        field.correction(np.array([300.0, 0.0, 0.0]))


def test_beyond_the_travel_the_correction_at_its_end_is_held() -> None:
    """A live compensator a hundredth of a millimetre beyond must not stop, and nothing continues without limit."""
    field = VolumetricModel(machine := rich("XFZY")).field(np.full(len(VolumetricModel(machine).stack.models), 9.0))
    ends = np.array([[0.0, 600.0, 600.0], [600.0, 0.0, 300.0]])
    at_ends = field.correction(ends)
    assert np.abs(at_ends).max() > 10.0
    for beyond in (0.01, 1.0, 1e9):
        points = ends + np.array([[-beyond, beyond, beyond], [beyond, -beyond, 0.0]])
        assert np.array_equal(field.correction(points), at_ends)
    within = field.correction(ends + np.array([[0.01, -0.01, -0.01], [-0.01, 0.01, 0.0]]))
    assert within == pytest.approx(at_ends, abs=0.05)
    assert not np.array_equal(within, at_ends)


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_numbers_that_are_none_are_refused(bad: float) -> None:
    field = ErrorField(Kinematics(by_hand("XFZ", {})), np.zeros(len(COMPONENTS)))
    point, good = (0.0, bad, 0.0), (1.0, 2.0, 3.0)
    for points in (point, [good, point]):
        for job in (field.components, field.error, field.tilt, field.correction, lambda p: field.error(p, exact=True)):
            with pytest.raises(InputError, match=f"positions: must be finite numbers, found {bad}"):
                job(points)
    with pytest.raises(InputError, match=f"position: must be finite numbers, found {bad}"):
        field.sensitivity(point)
    for use in (field.error, field.correction, field.sensitivity):
        with pytest.raises(InputError, match=f"tool: must be finite numbers, found {bad}"):
            use(good, point)
    with pytest.raises(InputError, match=f"at: must be finite numbers, found {bad}"):
        straight_lines(field, point)
    with pytest.raises(InputError, match=f"tool: must be finite numbers, found {bad}"):
        straight_lines(field, good, point)


def test_a_refused_model_does_not_run() -> None:
    refused = HonestError("made", 2.0, 2.0, 4.0, 1.0, 1.0, {"1": 2.0}, "refused", "worse than none", rules=RULES)
    slope = replace(line("EYY", "um/m", {"T1": 1.0}), honest_error=refused)
    sources: tuple[Source, ...] = (
        replace(line("EYY", "um", {"T1": 1.0}), honest_error=refused),
        PositionModel(target="EYY", unit="um", axis="Y", travel=(0.0, 600.0), slopes=(slope,)),
    )
    for source in sources:
        with pytest.raises(InputError, match="model of EYY was refused and will not run: worse than none"):
            VolumetricModel(by_hand("XYZ", {"EYY": source}))
    accepted = replace(line("EYY", "um", {"T1": 1.0}), honest_error=replace(refused, verdict="accepted"))
    assert VolumetricModel(by_hand("XYZ", {"EYY": accepted})).inputs == ("T1",)


def test_missing_channels_are_named() -> None:
    model = VolumetricModel(by_hand("XYZ", {"EYY": chen()}))
    with pytest.raises(ReadingError, match="machine round: channel T4 is not in the reading"):
        model.step(model.init(), {"T3": 20.0}, 0.0)
    with pytest.raises(ReadingError, match="must be finite"):
        model.step(model.init(), dict.fromkeys(model.inputs, float("nan")), 0.0)
    time = np.arange(3.0)
    with pytest.raises(InputError, match="there is no channel 'T4'; there are T3"):
        model.replay(time, {"T3": time})
    with pytest.raises(InputError, match="channel T3: 2 values for 3 times"):
        model.replay(time, dict.fromkeys(model.inputs, time[:2]))
    with pytest.raises(InputError, match="times of the recording must be finite and increase"):
        model.replay(time[::-1], dict.fromkeys(model.inputs, time))
    two = {"EXX": line("EXX", "um", {"T1": 1.0}), "EYY": line("EYY", "um", {"T1": 1.0})}
    odd = replace(two["EYY"], inputs=(replace(temperature("T1"), quantity="spindle_speed", unit="1/min"),))
    with pytest.raises(
        InputError, match="input T1: one model needs temperature in degC, another needs spindle_speed in 1/min"
    ):
        VolumetricModel(by_hand("XYZ", {**two, "EYY": odd}))


def lagging() -> LinearDynamic:
    return LinearDynamic(
        target="Z0C",
        unit="um",
        inputs=(temperature("T1"),),
        signals=((0,),),
        direct=(1.0,),
        lag_signals=(0,),
        time_constants=(600.0,),
        lagged=(3.0,),
    )


def test_a_replay_is_a_step_per_row() -> None:
    machine = rich("XYFZ")
    machine = replace(machine, components={**machine.components, "Z0C": lagging()})
    model, rng = VolumetricModel(machine), np.random.default_rng(2)
    time = np.cumsum(rng.uniform(5, 60, 40))
    table = {name: 20 + 10 * rng.random(40) for name in ("T2", "T1", "unused")}
    states = model.replay(time, table)
    assert len(states) == 40
    state, points = model.init(), rng.uniform(0, 600, (5, 3))
    fields = list(states)  # each keeps its state while others are made
    for k, field in enumerate(fields):
        reading = {name: float(table[name][k]) for name in model.inputs}
        state, live = model.step(state, reading, float(time[k] - time[k - 1]) if k else 0.0)
        assert field.error(points) == pytest.approx(live.error(points), rel=1e-12)
    assert states[-1].error(points) == pytest.approx(live.error(points))
    with pytest.raises(IndexError):
        states[40]


def test_a_row_with_a_gap_holds_what_was() -> None:
    model = VolumetricModel(by_hand("XYZ", {"Z0C": lagging(), "X0C": 2.0}))
    time, t1 = np.linspace(0.0, 300.0, 6), np.array([np.nan, 20.0, 30.0, np.nan, np.nan, 30.0])
    states, spot = model.replay(time, {"T1": t1}), np.zeros(3)
    errors = np.array([field.error(spot) for field in states])
    first, later = (10 + 30 * (1 - np.exp(-t / 600.0)) for t in (60.0, 240.0))
    assert errors[:, 2] == pytest.approx([0.0, 0.0, first, first, first, later])
    assert errors[:, 0].tolist() == [2.0] * 6
    assert len(model.replay(time[:0], {"T1": t1[:0]})) == 0


def test_sensitivities_of_a_field_are_those_of_its_machine() -> None:
    model = VolumetricModel(by_hand("XYZ", {"EXX": 1.0}))
    _, field = model.step(model.init(), {}, 0.0)
    at = (100.0, 200.0, 300.0)
    assert field.sensitivity(at)[INDEX["EBX"]] == pytest.approx([0.170, 0.0, -0.005])
    assert np.array_equal(field.sensitivity(at), Kinematics(model.machine).sensitivity(at))
