"""Joint support: training rows are inside, corners of the box and speeds between trained ones are not."""

import json
from collections.abc import Callable
from dataclasses import asdict, replace

import numpy as np
import pytest
from driftmodels import judged
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from smallmachine import small_machine

from thermocomp.core.correction import Limits
from thermocomp.core.exceptions import InputError, ReadingError
from thermocomp.core.inputs import Input, Support
from thermocomp.core.joint import JointSupport
from thermocomp.core.machine import Channel
from thermocomp.core.model import ErrorModel
from thermocomp.core.polynomial import Polynomial
from thermocomp.core.reading import Reading
from thermocomp.core.stack import Stack
from thermocomp.core.terms import Variable
from thermocomp.files import jsonfile, modelfile
from thermocomp.models.covering import find_joint_support
from thermocomp.models.training import train
from thermocomp.recordings.stacking import stack
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.group import TOGETHER

FloatArray = NDArray[np.float64]

LINE = JointSupport(
    (0, 1), (2.0, 4.0), ((0.0, 0.0), (1.0, 1.0), (2.0, 2.0)), 0.5, (2,), ((0.0, 1000.0, 3000.0),), (300.0,)
)


def model(policy: str, joint: JointSupport | None = LINE) -> Polynomial:
    inputs = tuple(
        Input(n, q, u, 0.0, False, low, high)
        for n, q, u, low, high in (
            ("a", "temperature", "degC", 0.0, 4.0),
            ("b", "temperature", "degC", 0.0, 8.0),
            ("s", "spindle_speed", "1/min", 0.0, 3000.0),
        )
    )
    return Polynomial(
        target="z_um",
        unit="um",
        inputs=inputs,
        variables=tuple(Variable.single(i.name, k) for k, i in enumerate(inputs)),
        terms=((0,), (1,)),
        coefficients=(3.0, -1.0),
        support=Support(policy),  # type: ignore[arg-type]
        joint=joint,
    )


def test_distances_in_closed_form() -> None:
    states = np.array([[2.0, 4.0, 1000.0], [2.0, 0.0, 0.0], [0.0, 4.0, 0.0], [4.0, 8.0, 2000.0], [4.0, 8.0, 3300.0]])
    # the corners of the box are half a point's distance away in one of two inputs: sqrt(1 / 2) by the limit of 0.5
    assert LINE.distance(states) == pytest.approx([0, np.sqrt(2), np.sqrt(2), 1000 / 300, 1], abs=1e-6)
    assert LINE.distance(states[1]) == LINE.distance(states)[1]
    assert LINE.distance(states.reshape(5, 1, 3)).shape == (5, 1)
    assert JointSupport((), (), (), 1.0).distance(states).tolist() == [0.0] * 5


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(*[st.floats(-1e3, 1e3)] * 3), min_size=1, max_size=20))
def test_a_batch_gives_what_each_state_gives_alone(states: list[tuple[float, float, float]]) -> None:
    together = LINE.distance(np.array(states))
    assert together.tolist() == [float(LINE.distance(np.array(s))) for s in states]
    for policy in ("clip", "hold", "fade"):
        m = model(policy)
        batch, _ = m.step(m.init(), np.array(states), 1.0)
        # numpy adds the products of a batch in another order
        alone = [float(m.step(m.init(), np.array(s), 1.0)[1]) for s in states]
        assert batch.deviation.tolist() == pytest.approx(alone, rel=1e-12)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 5), st.integers(1, 6))
def test_training_rows_are_never_outside(seed: int, n_temperatures: int, n_cycles: int) -> None:
    rng = np.random.default_rng(seed)
    rows = int(rng.integers(3, 900))
    heat = np.cumsum(rng.normal(size=(rows, n_temperatures)) * rng.uniform(0.001, 10, n_temperatures), axis=0)
    speed = rng.choice(rng.uniform(0, 6000, 4), rows) + rng.choice([0.0, 1.0]) * rng.normal(size=rows)
    change = np.column_stack([heat, speed])
    channels = [Channel(f"t{k}_C", "temperature", "degC") for k in range(n_temperatures)]
    joint = find_joint_support(
        change, [*channels, Channel("s", "spindle_speed", "1/min")], np.arange(rows) * n_cycles // rows
    )
    assert joint is not None
    assert (joint.distance(change) <= 1.0).all()


def test_a_nan_is_never_inside() -> None:
    for column in range(3):
        state = np.array([2.0, 4.0, 1000.0])
        state[column] = np.nan
        assert not LINE.distance(state) <= 1.0
        for policy in ("clip", "hold", "fade"):
            with pytest.raises(ReadingError):
                model(policy).step(model(policy).init(), state, 1.0)


def test_clip_keeps_every_bit_and_only_tells() -> None:
    rng = np.random.default_rng(0)
    with_, without = model("clip"), model("clip", None)
    a, b = with_.init(), without.init()
    told = 0
    for reading in rng.uniform([-2, -4, 0], [6, 12, 4000], (200, 3)):
        a, da = with_.step(a, reading, 1.0)
        b, db = without.step(b, reading, 1.0)
        assert da == db
        assert a.outside.tolist() == b.outside.tolist()
        told += not with_.distance(a, reading) <= 1.0
        assert without.distance(b, reading) == 0.0
    assert told > 100


def test_hold_and_fade_act_on_the_joint_distance() -> None:
    inside, corner = np.array([2.0, 4.0, 1000.0]), np.array([2.0, 0.0, 1000.0])
    near = np.array([2.0, 4.0, 1375.0])  # 375 from 1000: a quarter of the limit beyond it
    for policy, at_corner, at_near in (("hold", 2.0, 2.0), ("fade", 6.0 * (1 - (np.sqrt(2) - 1) / 0.5), 2.0 * 0.5)):
        m = model(policy)
        state, deviation = m.step(m.init(), inside, 1.0)
        assert deviation == 2.0
        assert m.step(state, corner, 1.0)[1] == pytest.approx(at_corner, abs=1e-5)
        assert m.step(state, near, 1.0)[1] == pytest.approx(at_near, abs=1e-5)
        alone = model(policy, None)
        assert alone.step(alone.step(alone.init(), inside, 1.0)[0], corner, 1.0)[1] == 6.0  # the box sees nothing


def test_a_stack_says_what_its_models_say_alone() -> None:
    rng = np.random.default_rng(2)
    models = [replace(model(p), target=f"{p}_{k}", joint=j) for k, j in enumerate((LINE, None)) for p in POLICIES]
    together = Stack(models)
    states, all_together = [m.init() for m in models], together.init()
    for reading in rng.uniform([-2, -4, 0], [6, 12, 4000], (100, 3)):
        all_together, said = together.step(all_together, reading, 1.0)
        for k, m in enumerate(models):
            states[k], alone = m.step(states[k], reading, 1.0)
            assert said[k] == pytest.approx(float(alone), rel=1e-12, abs=1e-12)


POLICIES = ("clip", "hold", "fade")


def test_round_trip_and_older_files() -> None:
    m = model("hold")
    assert modelfile.loads(modelfile.dumps([m])) == (m,)
    body = json.loads(modelfile.dumps([replace(m, joint=None)]))["models"]
    older = [{k: v for k, v in body[0].items() if k not in ("joint", "validity")}]
    assert modelfile.loads(jsonfile.pack(jsonfile.MODELS, older)) == (replace(m, joint=None),)


@pytest.mark.parametrize(
    "change",
    [
        {"limit": 0.0},
        {"limit": float("nan")},
        {"scale": (1.0,)},
        {"scale": (1.0, 0.0)},
        {"points": ((1.0,),)},
        {"points": ()},
        {"levels": ()},
        {"levels": ((),)},
        {"columns": (-1, 0)},
        {"tolerances": (float("inf"),)},
    ],
)
def test_numbers_that_do_not_fit_are_refused(change: dict[str, object]) -> None:
    with pytest.raises(InputError, match="joint support"):
        replace(LINE, **change)  # type: ignore[arg-type]


def test_more_inputs_than_the_model_has_are_refused() -> None:
    with pytest.raises(InputError, match="joint support for 4 inputs, but the model has 3"):
        model("clip", replace(LINE, speeds=(3,)))


# -- of a fitted model --------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def trained() -> ErrorModel:
    samples = stack([small_machine()], ["z_um"])
    return train("dynamic", samples, 0, np.ones(len(samples), np.bool_)).model


def at_speed(speed: float, trained: ErrorModel) -> float:
    """Return the share of rows of a new test at one speed that are outside the joint support while it turns."""
    samples = stack([small_machine([speed, speed], seed=5)], ["z_um"])
    columns = [[c.name for c in samples.inputs].index(i.name) for i in trained.inputs]
    assert trained.joint is not None
    running = samples.values[:, [c.name for c in samples.inputs].index("spindle_rpm")] > 0
    return float((trained.joint.distance(samples.change()[running][:, columns]) > 1.0).mean())


def test_speeds_between_trained_speeds_are_outside(trained: ErrorModel) -> None:
    """Trained at 1000, 1800, 2500 and 3000 1/min: each is inside its own range, what lies between them is not."""
    assert at_speed(1800.0, trained) < 0.1
    assert at_speed(2500.0, trained) < 0.1
    for between in (500.0, 1400.0, 2150.0):
        assert at_speed(between, trained) == 1.0


def test_limit_is_that_of_cycles_left_out() -> None:
    """Cycles that all look alike make a tight limit, cycles that differ a wide one."""
    rng = np.random.default_rng(0)
    channel = [Channel("a_C", "temperature", "degC"), Channel("b_C", "temperature", "degC")]
    cycle = np.repeat(np.arange(6), 100)
    rise = np.tile(np.linspace(0, 10, 100), 6)
    alike = np.column_stack([rise, rise]) + 0.05 * rng.normal(size=(600, 2))
    other = np.column_stack([rise, rise * np.repeat(rng.uniform(0.2, 2.0, 6), 100)])
    limits = []
    for change in (alike, other):
        joint = find_joint_support(change, channel, cycle)
        assert joint is not None
        limits.append(joint.limit)
    assert limits[1] > 2 * limits[0]
    tight = find_joint_support(alike, channel, cycle)
    assert tight is not None
    corners: Callable[[float, float], bool] = lambda a, b: bool(tight.distance(np.array([a, b])) > 1.0)  # noqa: E731
    assert corners(10.0, 0.0)
    assert corners(0.0, 10.0)
    assert not corners(5.0, 5.0)


def test_size_in_the_file_is_limited() -> None:
    rng = np.random.default_rng(1)
    for n in (1, 17, 60):
        change = np.cumsum(rng.normal(size=(2000, n)), axis=0)
        joint = find_joint_support(
            change, [Channel(f"t{k}_C", "temperature", "degC") for k in range(n)], np.arange(2000) // 400
        )
        assert joint is not None
        assert len(json.dumps(asdict(joint), indent=1)) < 8192
    assert find_joint_support(np.zeros((9, 1)), [Channel("t_C", "temperature", "degC")], np.zeros(9, np.intp)) is None


def test_the_online_step_says_it() -> None:
    m = model("clip")
    limits = Limits(magnitude=50.0, rate=1.0, dead_band=0.0, reading_age=60.0)
    compensator = Compensator.of([judged(m, 2.0)], limits)
    state = compensator.start()
    readings = [({"a": 2.0, "b": 4.0, "s": 1000.0}, ()), ({"a": 2.0, "b": 4.0, "s": 2000.0}, (TOGETHER,))]
    for k, (values, told) in enumerate(readings):
        state, result = compensator.step(state, Reading(float(k), values), float(k))
        assert not result.rejected
        assert result.outside == told
