"""Which sensors a model may lose: judged alone or in pairs, or predicted from the effects of each alone."""

import math
from dataclasses import replace

import pytest
from driftmodels import ACCEPTED, growing
from hypothesis import given
from hypothesis import strategies as st

from thermocomp.core.inputs import Input
from thermocomp.core.polynomial import Polynomial
from thermocomp.core.provenance import PREDICTED, HonestError
from thermocomp.core.terms import Variable
from thermocomp.core.watch import Watch, Watched

#: RMS 3 um, 10 um without compensation
KNOWN = replace(ACCEPTED, rms=3.0, none_rms=10.0, lost={"a": 3.0, "b": 4.0, "c": 5.0, "d": 8.0, "e": 11.0})


def test_a_sensor_alone_is_judged() -> None:
    assert [n for n in KNOWN.lost if KNOWN.may_lose([n])] == ["a", "b", "c", "d"]
    assert not KNOWN.may_lose(["unknown"])
    assert not KNOWN.may_lose([])


def test_effects_of_several_are_added() -> None:
    assert [KNOWN.effect(n) for n in "abc"] == [0.0, math.sqrt(7.0), 4.0]
    assert KNOWN.most_effect == pytest.approx(math.sqrt(64.0 - 9.0))  # 7.4: 1.25 times the error is then 10
    assert KNOWN.may_lose(["a", "b"], 2)
    assert KNOWN.may_lose(["a", "b", "c"], 3)  # 0 + 2.6 + 4
    assert not KNOWN.may_lose(["a", "b", "c"], 2)  # too many
    assert not KNOWN.may_lose(["b", "d"], 2)  # 2.6 + 7.4
    assert not KNOWN.may_lose(["a", "e"], 2)  # harmful without e alone
    assert not KNOWN.may_lose(["a", "unknown"], 2)


def test_where_pairs_were_judged_nothing_is_predicted() -> None:
    judged = replace(KNOWN, lost=KNOWN.lost | {"a, b": 4.0, "a, c": 10.5})
    assert judged.may_lose(["a", "b"], 2)
    assert not judged.may_lose(["a", "c"], 2)
    assert not judged.may_lose(["b", "c"], 2)
    assert judged.widening(["a", "c"]) == 3.5


def test_the_band_is_widened_by_the_prediction() -> None:
    assert KNOWN.widening(["c"]) == pytest.approx(5.0 / 3.0)
    assert KNOWN.widening(["a", "c"]) == pytest.approx(PREDICTED * 5.0 / 3.0)
    assert KNOWN.widening([]) == KNOWN.widening(["unknown"]) == KNOWN.widening(["a", "unknown"]) == 1.0


@given(st.lists(st.floats(0.0, 20.0), min_size=3, max_size=6), st.floats(0.0, 10.0), st.floats(0.0, 20.0))
def test_one_more_failure_never_restarts_a_correction(lost: list[float], rms: float, none: float) -> None:
    names = [f"t{k}" for k in range(len(lost))]
    honest = replace(ACCEPTED, rms=rms, none_rms=none, lost=dict(zip(names, lost, strict=True)))
    may = [honest.may_lose(names[:k], len(names)) for k in range(1, len(names) + 1)]
    assert may == sorted(may, reverse=True)
    wide = [honest.widening(names[:k]) for k in range(1, len(names) + 1) if may[k - 1]]
    assert wide == sorted(wide)


def _watched(count: int, honest: HonestError) -> tuple[str, ...]:
    """Return which of the pairs with the first sensor the model of a watched machine may lose."""
    inputs = tuple(Input(f"t{k}", "temperature", "degC", 20.0, True, -1.0, 5.0) for k in range(count))
    speed = Input("n", "spindle_speed", "1/min", 0.0, False, 0.0, 6000.0)
    sensors = tuple(
        Watched(k, tuple(0.0 if j == k else 1.0 / (count - 1) for j in range(count)), 1.0, 1.0, 1.0, 3600.0, 0.1)
        for k in range(count)
    )
    watch = Watch((*inputs, speed), sensors=sensors)
    model = replace(growing("z_um", 1.0), inputs=(*inputs, speed), honest_error=honest, watch=watch)
    return tuple(n for n in ("t1", "n") if model.may_lose(["t0", n]))


def test_a_quarter_of_the_watched_temperatures_may_be_lost_and_no_speed_with_them() -> None:
    honest = replace(KNOWN, lost={**{f"t{k}": 3.5 for k in range(9)}, "n": 3.5})
    assert _watched(7, honest) == ()
    assert _watched(9, honest) == ("t1",)


def test_a_wrong_speed_holds_the_models_that_need_it() -> None:
    heat = Input("t", "temperature", "degC", reference=20.0, rezero=True, low=0.0, high=10.0)
    speed = Input("n", "spindle_speed", "1/min", reference=0.0, rezero=False, low=0.0, high=5000.0)
    needs = Polynomial(
        target="z_um",
        unit="um",
        inputs=(heat, speed),
        variables=(Variable.single("t", 0), Variable.single("n", 1)),
        terms=((0,), (1,)),
        coefficients=(1.0, 0.01),
    )
    assert needs.wrong_speeds({"n": "off", "t": "off"}) == ["n"]
    assert needs.wrong_speeds({"n": "missing"}) == []
    without = replace(needs, coefficients=(1.0, 0.0))  # the speed is an input, but has no effect
    assert without.wrong_speeds({"n": "off"}) == []
