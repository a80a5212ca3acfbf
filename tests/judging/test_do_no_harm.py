"""The do-no-harm gate: units, baselines, margin, correction for the number of methods."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import stats

from thermocomp.core.learned import Learned, probe_noise
from thermocomp.judging import do_no_harm
from thermocomp.judging.do_no_harm import Verdict, join_verdicts
from thermocomp.judging.judgedunits import JudgedUnit, margin_of, measure
from thermocomp.judging.recommend import holm

FloatArray = NDArray[np.float64]

LEARNED = Learned(mean=3.0, last=1.0, noise=0.1, largest=20.0)
NOTHING = Learned(mean=0.0, last=0.0, noise=0.1, largest=20.0)


def drift(size: float = 20.0, n: int = 200) -> FloatArray:
    return size * np.sin(np.linspace(0, 7, n))


def unit(left: float, name: str = "a", size: float = 20.0) -> JudgedUnit:
    """A unit of which a model leaves a share."""
    return measure(name, drift(size), (1 - left) * drift(size), NOTHING)


def test_figures_of_a_unit() -> None:
    y = drift()
    found = measure("a", y, 0.9 * y, LEARNED)
    assert found.rms == pytest.approx(0.1 * np.sqrt(np.mean(y**2)))
    assert found.largest == pytest.approx(0.1 * np.abs(y).max())
    assert [b.other for b in found.baselines] == pytest.approx(
        [np.sqrt(np.mean((y - b) ** 2)) for b in (0.0, 3.0, 1.0)]
    )
    assert [b.rms for b in found.baselines] == [found.rms] * 3
    assert found.none_largest == np.abs(y).max()
    assert found.moves


def test_four_alike_units_that_are_better_are_accepted() -> None:
    verdict = Verdict(tuple(unit(left) for left in (0.1, 0.2, 0.15, 0.12)))
    assert verdict.word == "accepted"
    given = 1 - np.array([0.1, 0.2, 0.15, 0.12])
    agreements = 2 * given / (1 + given**2)
    assert verdict.p_value == pytest.approx(stats.ttest_1samp(agreements, 0.1, alternative="greater").pvalue)
    assert verdict.reason.startswith("better than ")
    assert verdict.advice == ""


@pytest.mark.parametrize("n", [1, 2])
def test_two_units_show_nothing(n: int) -> None:
    verdict = Verdict(tuple(unit(0.1 + 0.01 * k) for k in range(n)))
    assert verdict.word == "unproven"
    assert f"judged on only {n} of 3" in verdict.reason
    assert f"record {3 - n} more thermal cycle{'s' * (n == 1)}, at" in verdict.advice


def test_units_that_disagree_show_nothing() -> None:
    verdict = Verdict(tuple(unit(left) for left in (0.1, 0.95, 1.0, 0.9)))
    assert verdict.word == "unproven"
    assert "not shown to be better than" in verdict.reason
    assert "would decide" in verdict.advice


def test_harm_in_one_unit_refuses_a_blessing_in_all_others() -> None:
    good = tuple(unit(0.1 + 0.01 * k) for k in range(5))
    bad = measure("slow", drift(2.0), -drift(1.5), NOTHING)
    verdict = Verdict((*good, bad))
    assert bad.harm > bad.margin == 1.0
    assert verdict.word == "refused"
    assert verdict.reason.startswith("does harm in slow: RMS ")


def test_a_slow_unit_within_the_margin_does_not_decide_alone() -> None:
    good = tuple(unit(0.1 + 0.01 * k) for k in range(5))
    slow = measure("slow", drift(2.0), -drift(0.6), NOTHING)
    assert 0 < slow.harm < slow.margin
    assert Verdict((*good, slow)).word == "accepted"


def test_no_model_is_accepted_because_of_limits() -> None:
    y = drift()
    limited = measure("a", y, 0.9 * y, NOTHING, alone=-y)
    assert limited.rms == pytest.approx(2 * limited.none_rms)
    assert limited.largest == pytest.approx(2 * limited.none_largest)
    assert limited.baselines[0].agreement == pytest.approx(2 * -1 / 2)
    assert limited.harmful


def test_a_largest_error_does_harm_too() -> None:
    y = drift()
    predicted = 0.9 * y
    predicted[100] = -60.0
    assert Verdict((measure("a", y, predicted, NOTHING), unit(0.1), unit(0.2))).word == "refused"


@pytest.mark.parametrize(
    ("learned", "unit_", "margin"),
    [
        (Learned(0, 0, 0.1, 10.0), "um", 0.5),
        (Learned(0, 0, 0.3, 10.0), "um", 0.9),
        (Learned(0, 0, 5.0, 10.0), "um", 2.0),
        (Learned(0, 0, 0.1, 1000.0), "um", 2.0),
        (Learned(0, 0, 0.1, 1000.0), "urad", 10.0),
        (Learned(0, 0, 0.1, 1000.0), "um/m", 50.0),
    ],
)
def test_the_margin_is_of_noise_and_drift_and_never_large(learned: Learned, unit_: str, margin: float) -> None:
    assert margin_of(learned, unit_) == pytest.approx(margin)
    y = drift()
    assert measure("a", y, y, learned, unit=unit_).margin == pytest.approx(margin)
    assert measure("a", y, y, learned, unit=unit_, margin=4.0).margin == 4.0


@pytest.mark.parametrize("learned", [Learned(18.0, 0, 0.1, 20), Learned(0, 18.0, 0.1, 20)])
def test_every_baseline_has_to_be_beaten(learned: Learned) -> None:
    """The drift hovers about one of them: a model that is far better than none and no better than it is refused."""
    y = [18 + 5 * np.sin(np.linspace(0, 5 + k, 200)) for k in range(6)]
    verdict = Verdict(tuple(measure(str(k), x, x + 4 + 0.1 * k, learned) for k, x in enumerate(y)))
    assert all(u.rms < 0.3 * u.none_rms for u in verdict.units)
    assert verdict.word == "refused"
    assert verdict.reason.startswith(f"no better than {'the learned mean' if learned.mean else 'the last learned'}")
    assert Verdict(tuple(measure(str(k), x, x + 1 + 0.1 * k, learned) for k, x in enumerate(y))).accepted


def test_what_does_not_move_is_unproven_not_accepted() -> None:
    plateau = [20 + 0.1 * np.random.default_rng(k).normal(size=200) for k in range(6)]
    verdict = Verdict(tuple(measure(str(k), y, 0.99 * y, Learned(5.0, 10.0, 0.1, 20.0)) for k, y in enumerate(plateau)))
    assert verdict.word == "unproven"
    assert "no significant drift" in verdict.reason


def test_a_stretch_is_also_held_against_re_zeroing() -> None:
    y = 20 + drift(5.0)
    found = measure("rows", y, y - drift(5.0), LEARNED, stretch=True)  # knows the level, not the moves
    assert found.baselines[3].rms == pytest.approx(found.baselines[3].other)
    verdict = Verdict((found,), caps=("one section",))
    assert verdict.word == "refused"
    assert "re-zeroed" in verdict.reason
    better = measure("rows", y, y - 0.1 * drift(5.0), LEARNED, stretch=True)
    assert Verdict((better,), caps=("one section",)).word == "unproven"


def test_a_cap_keeps_the_best_model_unproven() -> None:
    units = tuple(unit(0.1 + 0.01 * k) for k in range(6))
    assert Verdict(units).accepted
    assert Verdict(units, caps=("spikes in x_um",)).word == "unproven"
    assert Verdict(units, caps=("spikes in x_um",)).reason == "spikes in x_um"
    assert Verdict(units, refusal="no sensor").word == "refused"


def test_no_unit_is_unproven() -> None:
    assert Verdict(()).word == "unproven"
    assert "fewer than 20 rows" in Verdict(()).reason


def test_holm() -> None:
    lefts = [(0.1, 0.12, 0.11, 0.13), (0.3, 0.6, 0.4, 0.5), (0.2, 0.9, 0.5, 0.7)]
    verdicts = [Verdict(tuple(unit(x) for x in left)) for left in lefts]
    raw = [v.p_value for v in verdicts]
    after = [v.p_value for v in holm(verdicts)]
    assert raw == sorted(raw)
    assert after == pytest.approx([3 * raw[0], max(3 * raw[0], 2 * raw[1]), max(3 * raw[0], 2 * raw[1], raw[2])])
    assert all(v.tried == 3 for v in holm(verdicts))
    assert "3 methods tried" in holm(verdicts)[0].reason


def test_correction_takes_a_lucky_one_back() -> None:
    lucky = Verdict(tuple(unit(x) for x in (0.5, 0.6, 0.9, 0.8)))
    others = [Verdict(tuple(unit(x) for x in (0.9, 0.95, 1.0, 0.99)))] * 9
    assert lucky.accepted
    assert not holm([lucky, *others])[0].accepted


def test_together_keeps_caps_and_refusals() -> None:
    parts = [Verdict((unit(0.1, "a"),)), Verdict((unit(0.2, "b"),), caps=("c",)), Verdict((), refusal="r")]
    whole = join_verdicts(parts)
    assert [u.name for u in whole.units] == ["a", "b"]
    assert (whole.caps, whole.refusal) == (("c",), "r")


def test_noise_beneath_which_nothing_is_told_apart() -> None:
    """Of two errors below the probe's noise none is the smaller, and nothing explains one."""
    still = measure("a", drift(0.05), 0.8 * drift(0.05), NOTHING)
    assert [(b.log_ratio(still.noise), b.agreement) for b in still.baselines] == [(0.0, 0.0)] * 3


@given(st.lists(st.floats(0.01, 1.5), min_size=3, max_size=10), st.floats(0.1, 100))
def test_the_verdict_does_not_depend_on_the_unit_of_length(lefts: list[float], scale: float) -> None:
    """Scaling drift, prediction, noise and margin alike changes nothing."""
    small, large = [], []
    for k, left in enumerate(lefts):
        small.append(measure(str(k), drift(), (1 - left) * drift(), NOTHING, margin=1.0))
        scaled = Learned(0.0, 0.0, NOTHING.noise * scale, NOTHING.largest * scale)
        large.append(measure(str(k), scale * drift(), scale * (1 - left) * drift(), scaled, margin=scale))
    assert Verdict(tuple(small)).word == Verdict(tuple(large)).word


@given(st.integers(3, 12), st.integers(0, 2**32 - 1))
def test_an_order_of_units_changes_nothing(n: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    units = [unit(float(x), str(k)) for k, x in enumerate(rng.uniform(0.05, 1.3, n))]
    shuffled = [units[k] for k in rng.permutation(n)]
    assert Verdict(tuple(units)).word == Verdict(tuple(shuffled)).word


def test_probe_noise_is_that_of_the_probe() -> None:
    rng = np.random.default_rng(0)
    slow = 30 * (1 - np.exp(-np.arange(2000) / 300))
    assert probe_noise(slow + 0.2 * rng.normal(size=2000)) == pytest.approx(0.2, rel=0.1)
    assert probe_noise(slow) < 0.002
    spiked = slow + 0.2 * rng.normal(size=2000)
    spiked[::50] += 100.0
    assert probe_noise(spiked) == pytest.approx(0.2, rel=0.3)
    assert probe_noise(np.array([1.0, np.nan])) == 0.0


def test_chance_is_accepted_in_five_of_a_hundred() -> None:
    """Outputs that have nothing to do with the drift, of one direction and size per unit: the test keeps its level."""
    rng = np.random.default_rng(0)
    lucky = 0
    y, other = drift(), 20.0 * np.cos(np.linspace(0, 7, 200))
    other -= y * (other @ y) / (y @ y)
    for _ in range(2000):
        shares = rng.uniform(-1, 1, 5)
        outputs = [0.2 * (c * y + np.sqrt(1 - c**2) * other) for c in shares]
        units = (measure(str(k), y, x, NOTHING, margin=np.inf) for k, x in enumerate(outputs))
        lucky += Verdict(tuple(units)).accepted
    assert 0.01 < lucky / 2000 < do_no_harm.LEVEL + 0.015
