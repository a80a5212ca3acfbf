"""ErrorModel: init and step, support, both families."""

from dataclasses import replace
from itertools import combinations_with_replacement

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thermocomp.core import lagbank
from thermocomp.core.exceptions import InputError, ReadingError
from thermocomp.core.inputs import Input, Support
from thermocomp.core.lineardynamic import LinearDynamic
from thermocomp.core.model import ErrorModel
from thermocomp.core.polynomial import Polynomial
from thermocomp.core.stack import Stack
from thermocomp.core.terms import TermTable, Variable, second_order_terms


def temperature(name: str, low: float = -5.0, high: float = 20.0, *, rezero: bool = True) -> Input:
    return Input(name, "temperature", "degC", 20.0, rezero, low, high)


def line(support: Support = Support(margin=0.0), slope: float = 2.0) -> Polynomial:
    """Deviation = slope * change of one temperature, trained from 0 to 10 degC."""
    return Polynomial(
        target="z",
        unit="um",
        inputs=(temperature("t", 0.0, 10.0),),
        variables=(Variable.single("t", 0),),
        terms=((0,),),
        coefficients=(slope,),
        support=support,
    )


def lag(tau: float = 600.0) -> LinearDynamic:
    return LinearDynamic(
        target="z",
        unit="um",
        inputs=(temperature("t"), Input("n", "spindle_speed", "1/min", 0.0, False, 0.0, 5000.0)),
        signals=((0,), (1,), (1, 1)),
        direct=(1.5, 0.0, 0.0),
        lag_signals=(0, 2),
        time_constants=(tau, 2 * tau),
        lagged=(-0.5, 4e-7),
        intercept=0.25,
    )


def run(model: ErrorModel, readings: list[list[float]], dt: float) -> list[float]:
    state = model.init()
    out = []
    for r in readings:
        state, deviation = model.step(state, np.array(r), dt)
        out.append(float(deviation))
    return out


def test_first_reading_is_the_zero() -> None:
    assert run(line(), [[23.0], [24.0], [22.0]], 1.0) == [0.0, 2.0, 0.0]  # 22.0 is clipped to the trained range


def test_the_value_in_the_reference_state_is_added() -> None:
    """C-03: Eq. 1."""
    assert run(replace(line(), intercept=7.0), [[23.0], [24.0], [22.0]], 1.0) == [7.0, 9.0, 7.0]


def test_a_fixed_reference_wins_over_the_first_reading() -> None:
    model = line()
    state = model.init(reference=[20.0])
    _, deviation = model.step(state, np.array([23.0]), 0.0)
    assert deviation == pytest.approx(6.0)


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_a_trained_range_is_finite(bad: float) -> None:
    for low, high in ((-bad, 1.0), (0.0, bad)):
        with pytest.raises(InputError, match=r"input t: (low|high) must be finite"):
            temperature("t", low, high)


def test_an_input_that_never_changed_fades_at_once_and_warns_of_nothing() -> None:
    """Warnings are errors here: nothing may overflow."""
    model = replace(line(Support("fade")), inputs=(temperature("t", 0.0, 0.0),), intercept=8.0)
    readings = [20.0, 20.0, 20.0 + 1e-6, 1e300, -40.0, 20.0]
    expected = [8.0, 8.0, 0.0, 0.0, 0.0, 8.0]
    assert run(model, [[r] for r in readings], 1.0) == expected
    stack, found = Stack([model]), []
    state = stack.init()
    for r in readings:
        state, deviation = stack.step(state, np.array([r]), 1.0)
        found.append(float(deviation[0]))
    assert found == expected


def test_reference_must_fit() -> None:
    with pytest.raises(InputError, match="expected 1 finite numbers"):
        line().init(reference=[20.0, 21.0])


@pytest.mark.parametrize(
    ("policy", "expected"),
    [("clip", [20.0, 20.0, 20.0, 8.0]), ("hold", [10.0, 10.0, 10.0, 8.0]), ("fade", [16.0, 10.0, 0.0, 8.0])],
)
def test_support_policies(policy: str, expected: list[float]) -> None:
    model = line(Support(policy, margin=0.0, fade_over=0.5))  # type: ignore[arg-type]
    # change 5 (inside), then 11, 12.5 and 30 (outside by 1, 2.5 and 20 of a fade span of 5), then 4 (inside again)
    values = run(model, [[20.0], [25.0], [31.0], [32.5], [50.0], [24.0]], 1.0)
    assert values[:2] == [0.0, 10.0]
    assert values[2:] == pytest.approx(expected)
    # two independent runs together, of which one leaves the range
    state, _ = model.step(model.init([20.0]), np.array([[25.0], [25.0]]), 0.0)
    assert model.step(state, np.array([[31.0], [24.0]]), 1.0)[1].tolist() == pytest.approx([expected[0], 8.0])
    for reading, beyond in ((50.0, True), (24.0, False)):  # one run has one deviation
        state, deviation = model.step(model.init([20.0]), np.array([reading]), 0.0)
        assert (np.shape(deviation), state.outside.tolist()) == ((), [beyond])


def test_margin_widens_the_trained_range() -> None:
    assert run(line(Support(margin=0.1)), [[20.0], [31.0], [40.0]], 1.0) == pytest.approx([0.0, 22.0, 22.0])


def test_outside_tells_which_input() -> None:
    model = lag()
    state, _ = model.step(model.init(), np.array([20.0, 0.0]), 0.0)
    assert not state.outside.any()
    state, _ = model.step(state, np.array([60.0, 100.0]), 1.0)
    assert state.outside.tolist() == [True, False]


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_number_that_is_none_is_refused(bad: float) -> None:
    model = line()
    state, _ = model.step(model.init(), np.array([20.0]), 0.0)
    for before in (model.init(), state):
        with pytest.raises(ReadingError):
            model.step(before, np.array([bad]), 1.0)
    with pytest.raises(ReadingError):
        model.step(state, np.array([20.0]), bad)
    with pytest.raises(ReadingError):
        model.step(state, np.array([20.0]), -1.0)


def test_lag_follows_the_exact_solution() -> None:
    tau, dt = 600.0, 30.0
    model = lag(tau)
    values = run(model, [[20.0, 0.0]] + [[30.0, 3000.0]] * 50, dt)
    t = dt * np.arange(1, 51)
    expected = 0.25 + 15.0 - 0.5 * 10 * (1 - np.exp(-t / tau)) + 4e-7 * 9e6 * (1 - np.exp(-t / (2 * tau)))
    assert values[1:] == pytest.approx(expected.tolist(), rel=1e-12)


@given(st.lists(st.floats(0.1, 5000.0), min_size=1, max_size=6))
def test_one_long_step_is_many_short_ones(steps: list[float]) -> None:
    """With a constant input the lag is exact, whatever the sampling: irregular recordings are no special case."""
    tau = np.array([300.0, 4000.0])
    start, signal = np.array([1.0, -2.0]), np.array([5.0, 5.0])
    memory = start
    for dt in steps:
        memory = lagbank.advance(memory, signal, dt, tau)
    assert memory == pytest.approx(lagbank.advance(start, signal, sum(steps), tau), rel=1e-12)


def test_whole_recording_equals_single_steps() -> None:
    rng = np.random.default_rng(1)
    signals, dt = rng.normal(size=(40, 3)), rng.uniform(1, 100, 40)
    dt[0] = dt[17] = np.inf  # two tests
    tau = np.array([10.0, 100.0, 1000.0])
    whole = lagbank.run(signals, dt, tau)
    memory = signals[0]
    for k in range(40):
        memory = lagbank.advance(memory, signals[k], float(dt[k]), tau)
        assert whole[k] == pytest.approx(memory, rel=1e-12)
    assert whole[17] == pytest.approx(signals[17])
    halves = np.vstack([lagbank.run(signals[:25], dt[:25], tau), lagbank.run(signals[25:], dt[25:], tau, whole[24])])
    assert np.array_equal(halves, whole)


def test_a_batch_is_many_single_runs() -> None:
    model = lag()
    rng = np.random.default_rng(2)
    readings = np.stack([rng.uniform(18, 32, (7, 12)), rng.uniform(0, 5000, (7, 12))], axis=-1)  # (runs, rows, inputs)
    state = model.init()
    together = []
    for k in range(12):
        state, deviation = model.step(state, readings[:, k], 20.0)
        together.append(deviation)
    for one in range(7):
        alone = run(model, readings[one].tolist(), 20.0)
        assert np.array(together)[:, one] == pytest.approx(alone, rel=1e-13)


def test_state_in_state_out() -> None:
    model = lag()
    start, _ = model.step(model.init(), np.array([20.0, 0.0]), 0.0)
    before = [np.array(x) for x in start if x is not None]
    first = model.step(start, np.array([25.0, 1000.0]), 10.0)[1]
    second = model.step(start, np.array([25.0, 1000.0]), 10.0)[1]
    assert first == second
    assert all(np.array_equal(a, b) for a, b in zip(before, [x for x in start if x is not None], strict=True))


@pytest.mark.parametrize(("variables", "terms"), [(5, 20), (7, 35), (9, 54)])
def test_term_counts(variables: int, terms: int) -> None:
    """C-10."""
    assert len(second_order_terms(variables)) == terms == len(set(second_order_terms(variables)))


def test_terms_of_differences() -> None:
    names = ["T1", "T2", "T3"]
    table = TermTable(
        3, (Variable.difference(names, "T2", "T3"), Variable.single("T1", 0)), ((0,), (0, 0), (0, 1), (1,))
    )
    assert table.names() == ("(T2-T3)", "(T2-T3)*(T2-T3)", "(T2-T3)*T1", "T1")
    assert table.evaluate(np.array([2.0, 7.0, 4.0])).tolist() == [3.0, 9.0, 6.0, 2.0]
    assert table.inputs_of(2) == {0, 1, 2}
    assert table.evaluate(np.array([[[2.0, 7.0, 4.0]], [[1.0, 4.0, 6.0]]])).tolist() == [
        [[3.0, 9.0, 6.0, 2.0]],
        [[-2.0, 4.0, -2.0, 1.0]],
    ]
    none = TermTable(3, table.variables, ())
    assert none.evaluate(np.zeros((2, 5, 3))).shape == (2, 5, 0)
    with pytest.raises(InputError, match="no input is named 'T9'"):
        Variable.difference(names, "T9", "T1")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"coefficients": (1.0, 2.0)}, "1 terms but 2 coefficients"),
        ({"coefficients": (float("nan"),)}, "must be finite"),
        ({"terms": ((4,),)}, "expected at least one variable index, from 0 to 0"),
        ({"inputs": (temperature("t"), temperature("t"))}, "named twice"),
    ],
)
def test_polynomial_refuses_numbers_that_do_not_fit(change: dict[str, object], message: str) -> None:
    good = {
        "target": "z",
        "unit": "um",
        "inputs": (temperature("t"),),
        "variables": (Variable.single("t", 0),),
        "terms": ((0,),),
        "coefficients": (2.0,),
    }
    with pytest.raises(InputError, match=message):
        Polynomial(**{**good, **change})  # type: ignore[arg-type]


def test_lag_refuses_numbers_that_do_not_fit() -> None:
    with pytest.raises(InputError, match="time_constants must be from 1e-06"):
        lag(0.0)


def test_formula_and_sensors() -> None:
    assert lag().formula() == "0.25 + 1.5 t - 0.5 lag(t, 10 min) + 4e-07 lag(n*n, 20 min)"
    assert lag().sensors == ("t", "n")
    assert line(slope=-2.0).formula() == "- 2 t"
    assert line(slope=0.0).sensors == ()


@pytest.mark.parametrize("n", [1, 5])
def test_the_terms_are_all_squares_and_products(n: int) -> None:
    wanted = [(i,) for i in range(n)] + list(combinations_with_replacement(range(n), 2))
    assert sorted(second_order_terms(n)) == sorted(wanted)
