"""The recommended method, and what is shown of a machine that shows nothing."""

from dataclasses import replace

import numpy as np
import pytest
from smallmachine import small_machine

from thermocomp.core.exceptions import InputError
from thermocomp.judging import splits
from thermocomp.judging.compare import compare
from thermocomp.judging.do_no_harm import Verdict
from thermocomp.judging.inuse import InUse, least
from thermocomp.judging.recommend import GROUPS, PAIRS, inner_splits, recommend
from thermocomp.judging.results import Rules
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack
from thermocomp.recordings.starts import COLD
from thermocomp.report.summary import describe_choice

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


def test_the_least_error_in_use_is_recommended() -> None:
    """Root mean square of the errors with clean readings, with the noise in use, and with a sensor lost."""
    result = compare(of(small_machine(SIX)), ["ols", "dynamic"], splits.leave_one_cycle_out(of(small_machine(SIX))))
    found = {a.model: a for a in result.overall()}
    assert all(a.accepted for a in found.values())
    assert result.noise == pytest.approx(0.02, rel=0.1)  # that of the recording
    ols, dynamic = (result.in_use(found[name]) for name in ("ols", "dynamic"))
    r = found["dynamic"].robustness
    assert r is not None
    assert dynamic.clean == found["dynamic"].metric("rms")
    assert dynamic.lost == pytest.approx(np.mean(list(r.lost_rms.values())), rel=1e-3)
    added = (result.noise / r.noise) ** 2 * (r.noise_rms["normal"][0] ** 2 - found["dynamic"].undisturbed ** 2)
    assert dynamic.noisy == pytest.approx(np.sqrt(dynamic.clean**2 + added))
    assert dynamic.rms == pytest.approx(np.sqrt((dynamic.clean**2 + dynamic.noisy**2 + dynamic.lost**2) / 3))
    assert ols.numbers < dynamic.numbers
    best, other = result.best("z_um"), result.next_best("z_um")
    assert best is not None
    assert other is not None
    assert result.in_use(best).rms < result.in_use(other).rms
    lost = {name: 3 * result.in_use(other).rms for name in best.robustness.lost_rms}  # type: ignore[union-attr]
    worse = replace(best, robustness=replace(best.robustness, lost_rms=lost))  # type: ignore[type-var]
    kept = tuple(worse if a is best else a for a in result.assessments)
    assert replace(result, assessments=kept).best("z_um") == other
    told = describe_choice(result, "z_um")
    assert f"error in use {result.in_use(best).rms:.2f} um (root mean square, weights 1:1:1, of " in told
    assert told.endswith(f"; {other.model} {result.in_use(other).rms:.2f} um")


def test_noise_counts_as_stated() -> None:
    """The mean square that noise adds is that of the replay with the same noise: the model is linear."""
    samples = of(small_machine(SIX))
    judging = splits.leave_one_cycle_out(samples)
    result = compare(samples, ["ols"], judging, rules=Rules(noise=0.4))
    (a,) = result.overall()
    assert (result.noise, result.stated) == (0.4, True)
    assert result.in_use(a).noisy == pytest.approx(a.robustness.noise_rms["normal"][0], rel=1e-3)  # type: ignore[union-attr]
    with pytest.raises(InputError, match=r"noise -1\.0: expected a finite number"):
        Rules(noise=-1.0)


def test_ties_go_to_fewer_sensors_then_to_fewer_coefficients() -> None:
    a, b = InUse(1.0, 1.0, 1.0, sensors=9, numbers=9), InUse(1.04, 1.04, 1.04, sensors=3, numbers=20)
    assert least({"a": a, "b": b}) == "b"
    assert least({"a": a, "b": replace(b, sensors=9)}) == "a"
    assert least({"a": replace(a, numbers=30), "b": replace(b, sensors=9)}) == "b"
    assert least({"a": a, "b": replace(b, clean=1.2)}) == "a"  # no tie
    assert least({"a": InUse(np.inf, np.inf, np.inf), "b": InUse(np.inf, np.inf, np.inf, 1)}) == "a"


def test_a_block_left_out_has_no_part_in_choosing_for_it() -> None:
    """The method of a block follows from the other blocks: an error on it changes the other choices only."""
    good, bad = InUse(1.0, 1.0, 1.0), InUse(2.0, 2.0, 2.0)
    samples = of(small_machine())
    judging = splits.leave_one_cycle_out(samples)
    inners = inner_splits(judging)
    parts = {name: [Verdict((), refusal="x")] * 4 for name in ("a", "b")}
    scores = {"a": [[1.0] * len(i.scores) for i in inners], "b": [[2.0] * len(i.scores) for i in inners]}
    spoiled = [(InUse(1.0, 50.0, 90.0), 100), *[(good, 100)] * 3]
    found = recommend("z", ["a", "b"], parts, {"a": spoiled, "b": [(bad, 100)] * 4}, scores, inners)
    assert found is not None
    assert found.chosen == ("a", "b", "b", "b")
    assert found.method == "b"


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
