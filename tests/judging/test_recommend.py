"""The recommended method, and what is shown of a machine that shows nothing."""

from dataclasses import replace

import numpy as np
import pytest
from smallmachine import small_machine

from thermocomp.core.exceptions import InputError
from thermocomp.judging import splits
from thermocomp.judging.compare import compare
from thermocomp.judging.recommend import GROUPS, PAIRS, inner_splits
from thermocomp.judging.results import Rules
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack
from thermocomp.recordings.starts import COLD

SIX = (1000.0, 2500.0, 1800.0, 3000.0, 1400.0, 2200.0)


def of(recording: Recording) -> Samples:
    return stack([recording], ["z_um"], starts=COLD)


def changed(recording: Recording, **columns: np.ndarray[tuple[int], np.dtype[np.float64]]) -> Recording:
    return replace(recording, table=recording.table.assign(**columns))


@pytest.mark.parametrize("n", [2, 3, PAIRS, PAIRS + 2])
def test_a_choice_sees_nothing_of_the_unit_it_is_judged_on(n: int) -> None:
    samples = of(small_machine(tuple(800.0 + 150 * k for k in range(n))))
    judging = splits.leave_one_cycle_out(samples)
    found = inner_splits(judging)
    if n == 2:
        assert found == []
        return
    assert len(found) == (n * (n - 1) // 2 if n <= PAIRS else n * GROUPS)
    for inner in found:
        for u, v in inner.scores:
            assert not (inner.split.learn & (judging.splits[u].judge | judging.splits[v].judge)).any()
    scored = sorted(s for inner in found for s in inner.scores)
    assert scored == [(u, v) for u in range(n) for v in range(n) if u != v]  # each once


@pytest.mark.long
def test_the_recommended_method_is_judged_with_its_choosing() -> None:
    samples = of(small_machine(SIX))
    judging = splits.leave_one_cycle_out(samples)
    result = compare(samples, ["ols", "dynamic", "gp"], judging, robustness=False)
    (found,) = result.recommended
    assert found.method == "dynamic"
    assert found.chosen == ("dynamic",) * 6
    assert found.verdict.accepted
    best = result.best("z_um")
    assert best is not None
    assert best.model == "dynamic"
    assert "3 methods tried, selected again in each fold" in best.reason


def test_without_a_recommendation_the_method_least_disturbed_by_noise_is_used() -> None:
    """The smallest error on quiet readings may belong to the method with the largest effects of single sensors."""
    samples = of(small_machine(SIX))
    result = compare(samples, ["ols", "dynamic"], splits.leave_one_cycle_out(samples), rules=Rules(primary="ols"))
    found = {a.model: a for a in result.overall()}
    assert all(a.accepted for a in found.values())
    assert found["dynamic"].metric("rms") < found["ols"].metric("rms")
    for share, method in ((0.9, "dynamic"), (1.1, "ols")):
        a, mine = found["dynamic"], found["ols"].noisy_rms * share
        assert a.robustness is not None
        noisy = replace(
            a, robustness=replace(a.robustness, noise_rms=dict.fromkeys(("uniform", "normal"), (mine, mine)))
        )
        best = replace(result, assessments=(found["ols"], noisy)).best("z_um")
        assert best is not None
        assert best.model == method


def test_one_that_is_named_beforehand_is_not_corrected() -> None:
    samples = of(small_machine(SIX))
    judging = splits.leave_one_cycle_out(samples)
    result = compare(samples, ["ols", "dynamic"], judging, rules=Rules(primary="ols"), robustness=False)
    assert result.recommended == ()
    ols, dynamic = result.overall()
    alone = compare(samples, ["ols"], judging, robustness=False).overall()[0]
    assert ols.verdict.p_value == alone.verdict.p_value
    only = compare(samples, ["dynamic"], judging, robustness=False).overall()[0]
    assert dynamic.verdict.p_value >= 2 * only.verdict.p_value or dynamic.verdict.p_value >= ols.verdict.p_value
    assert dynamic.verdict.p_value > only.verdict.p_value
    with pytest.raises(InputError, match="primary method 'mra' is not among the compared methods"):
        compare(samples, ["ols"], judging, rules=Rules(primary="mra"))


def test_a_stated_margin_lets_harm_pass() -> None:
    recording = small_machine(SIX)
    z = recording.table["z_um"].to_numpy().copy()
    z[:200] = 0.02 * z[:200]  # a cycle that hardly moves
    samples = of(changed(recording, z_um=z))
    judging = splits.leave_one_cycle_out(samples)
    (plain,) = compare(samples, ["ols"], judging, robustness=False).overall()
    (wide,) = compare(samples, ["ols"], judging, rules=Rules(margin=100.0), robustness=False).overall()
    assert plain.word == "refused"
    assert plain.reason.startswith("does harm in 1 (1000 1/min)")
    assert wide.word != "refused" or "does harm" not in wide.reason
    with pytest.raises(InputError, match="margin"):
        Rules(margin=-1.0)


@pytest.mark.parametrize("methods", [("ols", "partial-f", "mra", "pcr", "ridge")])
def test_constant_temperatures_are_refused(methods: tuple[str, ...]) -> None:
    recording = small_machine(SIX)
    still = {name: np.full(len(recording), 20.0) for name in ("t1_C", "t2_C", "t3_C", "spindle_rpm")}
    samples = of(changed(recording, **still))
    for judging in (splits.leave_one_cycle_out(samples), splits.parse("0.75/0.25", samples)):
        result = compare(samples, methods, judging, robustness=False)
        assert {a.word for a in result.overall()} == {"refused"}


def test_a_plateau_is_never_accepted() -> None:
    recording = small_machine(SIX)
    rng = np.random.default_rng(0)
    n = len(recording)
    level = -40 * (1 - np.exp(-np.arange(n) / 60))
    z = level + 0.1 * rng.normal(size=n)
    warm = {f"t{k}_C": 22 - 0.1 * k * level + 0.02 * rng.normal(size=n) for k in (1, 2, 3)}
    samples = of(changed(recording, z_um=z, **warm))
    result = compare(samples, ["ols", "mra", "dynamic"], splits.parse("0.75/0.25", samples), robustness=False)
    assert {a.word for a in result.overall()} == {"unproven"}
    assert all("no significant drift" in a.reason for a in result.overall())


@pytest.mark.parametrize("methods", [("arx", "ols", "dynamic"), ("dynamic", "ols", "arx")])
@pytest.mark.parametrize("left", [0, 13])
def test_a_cycle_with_few_readings_decides_nothing(methods: tuple[str, ...], left: int) -> None:
    machine = small_machine(SIX)
    z = machine.table["z_um"].to_numpy().copy()
    z[400 + left : 600] = np.nan
    samples = of(changed(machine, z_um=z))
    result = compare(samples, methods, splits.leave_one_cycle_out(samples), robustness=False)
    (found,) = result.recommended
    assert found.method == "dynamic"
    assert len(found.chosen) == 5
    for a in result.overall():
        assert len(a.verdict.units) == 5
        assert not a.failure
