"""Position models judged by cycles left out: whole profiles, before and after, and the gate."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from profilemachine import day, planted, profiles

from thermocomp.core.exceptions import FitError, InputError
from thermocomp.core.inputs import Support
from thermocomp.judging.splits import by_rows, leave_one_cycle_out, leave_one_file_out
from thermocomp.models.ols import LeastSquares
from thermocomp.recordings.cycles import Cycle
from thermocomp.recordings.profiles import Profiles
from thermocomp.volumetric.judging.position import n_pieces, study, study_all
from thermocomp.volumetric.models.position import PositionOptions, fit_position
from thermocomp.volumetric.models.positionoptions import SETTINGS, fill_options

# each day is warmer than the one before, so the last one goes beyond what was learned
OLS = PositionOptions(method=LeastSquares(fit_intercept=False), support=Support(margin=1.0))


def test_before_and_after_on_unseen_cycles() -> None:
    found = study(profiles(noise=0.1), OLS)
    judged = found.assessment
    assert judged.accepted
    assert [c.cycle for c in judged.cycles] == ["day 1", "day 2", "day 3"]
    # the cold state is the zero of the test: it is used in every split, and judged in none
    assert [c.n_states for c in judged.cycles] == [23, 24, 24]
    for c in judged.cycles:
        assert c.model < 0.15
        assert min(c.geometric, c.none) > 5.0
        assert c.model_max < 0.6
        assert c.none_max > 15.0
    assert judged.overall.n_states == 71
    together = np.sqrt(np.average([c.model**2 for c in judged.cycles], weights=[23, 24, 24]))
    assert judged.overall.model == pytest.approx(together)
    (slope,) = found.fit.model.slopes
    assert slope.honest_error is not None
    assert slope.honest_error.verdict == "accepted"
    assert slope.honest_error.rms < 0.2 < slope.honest_error.none_rms
    assert set(slope.honest_error.cycles) == {"day 1", "day 2", "day 3"}
    assert found.fit.trained[0].model is slope


def test_errors_are_those_of_a_fit_that_has_not_seen_the_cycle() -> None:
    made = profiles(noise=0.3)
    learn = np.repeat([True, False, True], 24)
    fit = fit_position(made, OLS, learn=learn)
    change = (made.states.table - made.states.table.iloc[0]).to_numpy()
    left = []
    for row in range(24, 48):
        k1 = change[row] @ list(fit.model.slopes[0].coefficients_by_name().values())
        left.append(made.values[row] - fit.model.at(made.points, np.array([k1])))
    judged = study(made, OLS).assessment
    assert judged.cycles[1].model == pytest.approx(np.sqrt(np.mean(np.square(left))))
    assert judged.cycles[1].none == pytest.approx(np.sqrt(np.mean(made.values[24:48] ** 2)))


def test_a_left_out_test_is_judged_by_the_cold_profiles_of_the_others() -> None:
    """Another cold profile on the third day: seen where that day is left out, not where its zero is known."""
    tests = [profiles(noise=0.1, seed=s, n_cycles=1) for s in range(3)]
    tests[2] = replace(tests[2], values=tests[2].values + 3.0)
    by_file = study(tests, OLS, judging=leave_one_file_out).assessment
    assert [c.n_states for c in by_file.cycles] == [24, 24, 24]
    assert by_file.cycles[2].model == pytest.approx(3.0, rel=0.05)
    assert by_file.cycles[0].model == pytest.approx(1.5, rel=0.05)


def test_a_model_that_is_no_better_than_its_cold_profile_is_refused() -> None:
    """The cold profile alone makes it better than none; the thermal part only adds noise, which the gate sees."""
    made = profiles(noise=0.1)
    still = replace(made, values=made.values[0] + 0.3 * np.random.default_rng(0).normal(size=made.values.shape))
    judged = study(still, PositionOptions(method="ols")).assessment
    assert all(u.rms < u.none_rms for u in judged.verdict.units)
    assert judged.verdict.word == "refused"
    assert judged.reason.startswith("no better than the cold profile alone: RMS ")


def test_a_model_that_does_harm_is_refused() -> None:
    """What the temperatures say on day 2 is the opposite of what they said on the others."""
    made = profiles(noise=0.1)
    values = made.values.copy()
    values[24:48] = 2 * made.cold() - values[24:48]
    found = study(replace(made, values=values), OLS)
    assert not found.assessment.accepted
    assert "day" in found.assessment.reason
    assert {m.honest_error.verdict for m in found.fit.model.models if m.honest_error} == {"refused"}


def test_too_few_states_prove_nothing() -> None:
    made = profiles(noise=0.1)
    values = made.values.copy()
    values[30:48] = np.nan
    judged = study(replace(made, values=values), OLS).assessment
    assert not judged.accepted
    assert judged.cycles[1].n_states == 6
    assert judged.reason.startswith("judged on only 2 of 3 required cycles or files; record 1 more")
    with pytest.raises(InputError, match="only one thermal cycle"):
        study(profiles(n_cycles=1), OLS)
    values[24:] = np.nan
    with pytest.raises(FitError, match=r"no profile is left for validation"):
        study(replace(made, values=values), OLS, judging=partial(by_rows, train=0.5, test=0.5))


def test_an_angle_is_judged_in_its_unit() -> None:
    made = replace(profiles(noise=0.1), target="EAY", unit="urad")
    judged = study(made, OLS).assessment
    assert judged.unit == "urad"
    assert "urad" in judged.reason
    assert " um" not in judged.reason


def test_factors_of_every_power_carry_the_verdict() -> None:
    made = profiles(noise=0.1, second=20.0, offset=0.7)
    options = replace(OLS, slopes=2, offset=True)
    told: list[str] = []
    found = study(made, options, progress=told.append)
    assert found.fit.model.powers == (0, 1, 2)
    assert all(m.accepted for m in found.fit.model.models)
    assert len(told) == 4
    rms = [m.honest_error.rms for m in found.fit.model.models if m.honest_error]
    none = [m.honest_error.none_rms for m in found.fit.model.models if m.honest_error]
    assert all(a < 0.5 * b for a, b in zip(rms, none, strict=True))


@pytest.mark.parametrize("method", ["dynamic", "mra"])
def test_profiles_of_the_virtual_machine_on_days_not_learned(method: str) -> None:
    tests: list[Profiles] = [day(s) for s in range(3)]
    judged = study(tests, PositionOptions(method=method), judging=leave_one_file_out).assessment
    assert judged.accepted
    assert judged.overall.none > 15.0
    assert judged.overall.model < 0.12 * judged.overall.none


def test_the_later_half_of_one_day() -> None:
    """A single warm-up and cool-down, as in the paper: the later states are judged, learned from the earlier."""
    found = study(
        planted(seed=0, noise=0.1, draw=0),
        PositionOptions(method="mra", inputs=("T3", "T4")),
        judging=partial(by_rows, train=0.6, test=0.4),
    )
    (cycle,) = found.assessment.cycles
    assert cycle.n_states == 20
    assert cycle.model < 0.2 * cycle.none


def test_replay_counts_from_the_reference_state_too() -> None:
    """The zero of the temperatures is the state of the cold profile, though it comes later in the test."""
    found = study(profiles(noise=0.1), replace(OLS, reference=(8, 9)))
    assert found.assessment.accepted
    assert found.assessment.overall.model < 0.2


# -- settings left open, several components ---------------------------------------------------------------------------


def test_settings_left_open_are_chosen_in_each_split_from_what_is_learned_there() -> None:
    """The last day is bent: all together ask for m = 2, the two others for m = 1, and they are what it is judged by."""
    straight, bent = profiles(noise=0.1), profiles(noise=0.1, second=60.0)
    last = np.arange(72) >= 48
    made = replace(straight, values=np.where(last[:, None], bent.values, straight.values))
    found = study(made, OLS, left_open=SETTINGS)
    assert found.options.slopes == 2
    assert len(found.fit.model.slopes) == 2
    others = fill_options(made, OLS, learn=~last)
    assert others.slopes == 1
    blind = fit_position(made, others, learn=~last)
    change = (made.states.table - made.states.table.iloc[0]).to_numpy()[last]
    k1 = change @ list(blind.model.slopes[0].coefficients_by_name().values())
    left = [v - blind.model.at(made.points, np.array([k])) for v, k in zip(made.values[last], k1, strict=True)]
    assert found.assessment.cycles[2].model == pytest.approx(np.sqrt(np.mean(np.square(left))))
    # factors are in the powers of the whole, though one alone predicted it: the other was zero
    honest = found.fit.model.slopes[1].honest_error
    assert honest is not None
    k2 = found.fit.slopes[0].factors[last, 1]
    assert honest.cycles["day 3"] == pytest.approx(np.sqrt(np.mean(k2**2)), rel=1e-6)


def test_predicted_factors_are_those_of_the_model_where_all_splits_agree() -> None:
    made = profiles(noise=0.1)
    left_open, fixed = (study(made, OLS, left_open=names) for names in (SETTINGS, ()))
    assert left_open.assessment.cycles == fixed.assessment.cycles
    learn = np.arange(72) >= 24
    model = fit_position(made, OLS, learn=learn).model
    change = (made.states.table - made.states.table.iloc[0]).to_numpy()[1:24]
    k1 = change @ list(model.slopes[0].coefficients_by_name().values())
    (honest,) = (m.honest_error for m in fixed.fit.model.slopes)
    assert honest is not None
    measured = made.slopes().factors[1:24, 0]
    assert honest.cycles["day 1"] == pytest.approx(np.sqrt(np.mean((measured - k1) ** 2)))


def test_noise_has_no_thermal_part() -> None:
    made = profiles(noise=0.1)
    noise = 0.3 * np.random.default_rng(0).normal(size=made.values.shape)
    found = study(replace(made, values=made.values[0] + noise), PositionOptions(method="ols"), left_open=SETTINGS)
    assert found.assessment.accepted
    assert len(found.assessment.verdict.units[0].baselines) == 1
    assert found.dropped == "it is noise"
    assert found.fit.model.models == ()
    assert found.assessment.overall.model == found.assessment.overall.geometric
    assert found.assessment.factors == ()


def test_a_thermal_part_that_is_refused_leaves_the_cold_profile() -> None:
    """Temperatures say nothing of this slope: it goes up and down as it likes, within what the cold profile is."""
    made = profiles(noise=0.1)
    rng = np.random.default_rng(3)
    slope = np.concatenate([[0.0], 1.5 * rng.normal(size=71)])
    wild = replace(made, values=made.cold() + np.outer(slope, 1e-3 * made.position) + 20.0)
    options = PositionOptions(method="ols")
    assert fill_options(wild, options).slopes == 1
    refused = study(wild, options)
    assert not refused.assessment.accepted
    found = study(wild, options, left_open=SETTINGS)
    assert found.assessment.accepted
    assert found.fit.model.models == ()
    assert found.dropped.startswith("no better than the cold profile alone: RMS ")
    # one that is refused with its profile stays refused
    assert not study(replace(wild, values=wild.values - 1.5 * made.cold() - 20.0), options).assessment.accepted


def test_a_file_that_is_left_out_is_judged_as_one() -> None:
    """Each of its cycles is too short to prove anything."""
    tests = [profiles(noise=0.1, seed=s, n_cycles=1) for s in range(3)]
    short = [
        replace(t, states=t.states.with_cycles([Cycle(f"job {k}", 4 * k, 4 * k + 4) for k in range(6)])) for t in tests
    ]
    assert not study(short, OLS).assessment.accepted
    judged = study(short, OLS, judging=leave_one_file_out).assessment
    assert judged.accepted
    assert [(c.cycle, c.n_states) for c in judged.cycles] == [("made#1", 24), ("made#2", 24), ("made#3", 24)]


@pytest.mark.parametrize("jobs", [1, 2])
def test_several_components_are_judged_as_each_alone(jobs: int) -> None:
    first = profiles(noise=0.1)
    second = replace(profiles(noise=0.1, second=20.0), target="EXY")
    told: list[str] = []
    both = study_all([[first], [second]], OLS, left_open=SETTINGS, jobs=jobs, progress=told.append)
    alone = [study(p, OLS, left_open=SETTINGS) for p in (first, second)]
    assert [f.assessment.cycles for f in both] == [f.assessment.cycles for f in alone]
    assert [f.options.slopes for f in both] == [1, 2]
    assert len(told) == n_pieces([[first], [second]], OLS, leave_one_cycle_out) == 8
