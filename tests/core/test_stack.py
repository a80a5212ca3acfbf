"""A stack of models says what each of its models says alone."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thermocomp.core.additive import Additive
from thermocomp.core.band import Band
from thermocomp.core.curves import Curve
from thermocomp.core.exceptions import InputError, ReadingError
from thermocomp.core.inputs import Input, Support
from thermocomp.core.joint import JointSupport
from thermocomp.core.lineardynamic import LinearDynamic
from thermocomp.core.model import ErrorModel
from thermocomp.core.paceddynamic import LaggedInput, PacedDynamic, SpeedState
from thermocomp.core.polynomial import Polynomial
from thermocomp.core.stack import Stack
from thermocomp.core.terms import Variable

NAMES = ("a", "b", "c", "d")


def inputs(rng: np.random.Generator, count: int) -> tuple[Input, ...]:
    """Return inputs of few different references and ranges: some models share one, some differ in one number."""
    return tuple(
        Input(
            name,
            "temperature",
            "degC",
            float(rng.choice([0.0, 20.0])),
            bool(rng.integers(2)),
            float(rng.choice([-5.0, -1.0])),
            float(rng.choice([2.0, 10.0])),
        )
        for name in rng.permutation(NAMES)[:count].tolist()
    )


def random_model(rng: np.random.Generator, number: int) -> ErrorModel:
    n = int(rng.integers(0, 5))
    taken = inputs(rng, n)
    policy = ("clip", "hold", "fade")[rng.integers(3)]
    support = Support(policy, margin=float(rng.choice([0.0, 0.25])), fade_over=float(rng.choice([0.5, 1.0])))  # type: ignore[arg-type]
    intercept = float(rng.normal())
    singles = tuple(Variable.single(x.name, i) for i, x in enumerate(taken))
    names = [x.name for x in taken]
    n_terms = int(rng.integers(0, 7)) if n else 0
    terms = tuple(tuple(rng.integers(0, n, rng.integers(1, 4)).tolist()) for _ in range(n_terms))
    kind = rng.integers(7)
    if kind < 2:
        more = (Variable.difference(names, names[0], names[1]),) if n > 1 and rng.integers(2) else ()
        return Polynomial(
            target=f"p{number}",
            unit="um",
            inputs=taken,
            support=support,
            intercept=intercept,
            variables=(*singles, *more),
            terms=(*terms, (n, 0)) if more else terms,
            coefficients=tuple(rng.normal(size=n_terms + len(more)).tolist()),
        )
    if kind < 4:
        n_lags = int(rng.integers(0, 5)) if n_terms else 0
        return LinearDynamic(
            target=f"d{number}",
            unit="urad",
            inputs=taken,
            support=support,
            intercept=intercept,
            signals=terms,
            direct=tuple(rng.normal(size=n_terms).tolist()),
            lag_signals=tuple(rng.integers(0, max(n_terms, 1), n_lags).tolist()),
            time_constants=tuple(rng.uniform(1.0, 500.0, n_lags).tolist()),
            lagged=tuple(rng.normal(size=n_lags).tolist()),
        )
    if kind < 6:
        n_lags = int(rng.integers(0, 3))
        parts = n * (1 + n_lags) + n
        pair = rng.choice([100.0, 500.0], 2)  # few different ones: some models share their states
        return PacedDynamic(
            target=f"t{number}",
            unit="um",
            inputs=taken,
            support=support,
            intercept=intercept,
            time_constants=(60.0, 600.0)[:n_lags],
            temperatures=tuple(LaggedInput(i, float(rng.normal()), tuple(rng.normal(size=n_lags))) for i in range(n)),
            top_speed=5.0,
            states=tuple(SpeedState(i, 1.5, float(max(pair)), float(min(pair)), float(rng.normal())) for i in range(n)),
            spread=tuple(map(tuple, rng.normal(size=(2, parts)).tolist())),
            band=Band(0.9, "assumption", 3, 0.5, 2.0, 1.0, (0,) if n else (), 0.5) if rng.integers(2) else None,
            joint=JointSupport((0,), (5.0,), ((0.0,), (1.0,)), 0.5) if n and rng.integers(2) else None,
        )
    return Additive(
        target=f"a{number}",
        unit="um",
        inputs=taken,
        support=support,
        intercept=intercept,
        variables=singles,
        curves=(Curve((-1.0, 3.0), (0.0, 2.0)),) * n,
    )


def values_of(stack: Stack, model: ErrorModel, reading: np.ndarray) -> np.ndarray:
    return reading[..., [stack.inputs.index(i.name) for i in model.inputs]]


@given(st.integers(0, 2**32), st.integers(0, 9), st.sampled_from([(), (3,)]))
def test_each_model_says_what_it_says_alone(seed: int, count: int, batch: tuple[int, ...]) -> None:
    rng = np.random.default_rng(seed)
    models = [random_model(rng, k) for k in range(count)]
    stack = Stack(models)
    assert set(stack.inputs) == {i.name for m in models for i in m.inputs}
    state, alone = stack.init(), [m.init() for m in models]
    for _ in range(12):
        # a quarter of the readings lies outside, on either side
        reading = np.where(rng.random((*batch, len(stack.inputs))) < 0.75, 1.0, 20.0)
        reading = 20.0 + reading * rng.uniform(-1.0, 1.0, reading.shape)
        dt = float(rng.choice([0.0, 1.0, rng.uniform(0, 1000)]))
        state, deviations = stack.step(state, reading, dt)
        outside: set[str] = set()
        for k, model in enumerate(models):
            alone[k], expected = model.step(alone[k], values_of(stack, model, reading), dt)
            # cubes of up to 20 times coefficients of about 1
            assert deviations[..., k] == pytest.approx(expected, rel=1e-12, abs=1e-9)
            assert state.deviation[..., k] == pytest.approx(alone[k].deviation, rel=1e-12, abs=1e-9)
            widths = model.half_width(alone[k], values_of(stack, model, reading))
            found = stack.half_widths(state, reading)[..., k]
            assert found == pytest.approx(widths, rel=1e-12, nan_ok=True)
            beyond = alone[k].outside.any(axis=tuple(range(alone[k].outside.ndim - 1)))
            outside |= {i.name for i, out in zip(model.inputs, np.atleast_1d(beyond), strict=True) if out}
        assert stack.outside(state) == tuple(n for n in stack.inputs if n in outside)


def test_all_policies_beyond_the_range() -> None:
    """The three on one input of their own range, by hand; a fourth model looks elsewhere."""

    def line(policy: str, name: str, high: float) -> Polynomial:
        return Polynomial(
            target=policy,
            unit="um",
            inputs=(Input(name, "temperature", "degC", 20.0, True, 0.0, high),),
            variables=(Variable.single(name, 0),),
            terms=((0,),),
            coefficients=(2.0,),
            support=Support(policy, margin=0.0),  # type: ignore[arg-type]
        )

    stack = Stack([line("fade", "t", 10.0), line("clip", "t", 10.0), line("hold", "t", 10.0), line("hold", "u", 99.0)])
    state, said = stack.init(), []
    for t in (20.0, 25.0, 32.5, 50.0, 24.0):
        state, deviations = stack.step(state, np.array([t, t]), 1.0)
        said.append(deviations.tolist())
    assert said == [[0.0] * 4, [10.0] * 4, [10.0, 20.0, 10.0, 25.0], [0.0, 20.0, 10.0, 60.0], [8.0] * 4]


def test_models_that_differ_in_their_fading_alone_fade_apart() -> None:
    seen = (Input("t", "temperature", "degC", 20.0, True, 0.0, 10.0),)
    supports = (Support("fade", margin=0.0, fade_over=over) for over in (0.5, 1.0))
    stack = Stack(
        [
            Polynomial(
                target="d", unit="um", inputs=seen, variables=(), terms=(), coefficients=(), intercept=8.0, support=s
            )
            for s in supports
        ]
    )
    state, _ = stack.step(stack.init(), np.array([20.0]), 0.0)
    # 2.5 degC beyond: half of 5, a quarter of 10
    assert stack.step(state, np.array([32.5]), 1.0)[1].tolist() == [4.0, 6.0]


def test_the_state_is_handed_on_and_not_changed() -> None:
    rng = np.random.default_rng(7)
    stack = Stack([random_model(rng, k) for k in range(12)])
    state, _ = stack.step(stack.init(), np.full(len(stack.inputs), 20.0), 0.0)
    reading = np.full(len(stack.inputs), 26.0)
    kept = [np.array(x) for x in state[:4]]
    first, second = stack.step(state, reading, 10.0)[1], stack.step(state, reading, 10.0)[1]
    assert first.tolist() == second.tolist()
    assert all(np.array_equal(a, b) for a, b in zip(kept, state[:4], strict=True))  # type: ignore[arg-type]


@pytest.mark.parametrize("bad", [np.nan, np.inf])
@pytest.mark.parametrize("kind", ["polynomial", "additive"])
def test_a_number_that_is_none_is_refused(bad: float, kind: str) -> None:
    rng = np.random.default_rng(1)
    models = [m for m in (random_model(rng, k) for k in range(60)) if m.family == kind and m.inputs][:3]
    assert len(models) == 3
    stack = Stack(models)
    good = np.full(len(stack.inputs), 20.0)
    state, _ = stack.step(stack.init(), good, 0.0)
    for k in range(len(stack.inputs)):
        reading = good.copy()
        reading[k] = bad
        for before in (stack.init(), state):
            with pytest.raises(ReadingError, match="must be finite"):
                stack.step(before, reading, 1.0)
    for dt in (bad, -1.0):
        with pytest.raises(ReadingError, match="must be finite"):
            stack.step(state, good, dt)


def test_one_name_is_one_channel() -> None:
    rng = np.random.default_rng(0)
    model = next(m for m in (random_model(rng, k) for k in range(40)) if m.inputs)
    name = model.inputs[0].name
    speed = Additive(
        target="s",
        unit="um",
        inputs=(Input(name, "spindle_speed", "1/min", 0.0, False, 0.0, 1.0),),
        variables=(),
        curves=(),
    )
    with pytest.raises(
        InputError, match=f"input {name}: one model needs temperature in degC, another needs spindle_speed in 1/min"
    ):
        Stack([model, speed])


def test_channels_of_one_machine_share_their_states() -> None:
    rng = np.random.default_rng(5)
    first = random_model(rng, 0)
    while not isinstance(first, PacedDynamic) or not first.temperatures or not first.states:
        first = random_model(rng, 0)
    other = replace(first, target="other", temperatures=tuple(replace(t, direct=9.0) for t in first.temperatures))
    slower = replace(first, target="slower", states=tuple(replace(s, stopped=9e5) for s in first.states))
    sizes = []
    for models in ([first], [first, other], [first, slower, other]):
        stack = Stack(models)
        state, _ = stack.step(stack.init(), np.full(len(stack.inputs), 20.0), 0.0)
        assert state.memory is not None
        sizes.append(state.memory.shape[-1])
    assert sizes == [sizes[0], sizes[0], sizes[0] + len(first.states)]
