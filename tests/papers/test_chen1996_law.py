"""Chen 1996: a planted slope law is sought in 51 profiles; what is told of it can be false."""

from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd
import pytest

from thermocomp.models.mlp import SigmoidNet
from thermocomp.papers.chen1996 import law
from thermocomp.papers.chen1996.law import DESIGNS, OURS, Law, Recovery
from thermocomp.papers.chen1996.setup import EQ6, EQ8, SLOPE_VARIABLES, TEMPERATURES
from thermocomp.papers.study import FloatArray
from thermocomp.volumetric.models.position import PositionOptions, slope_samples

DAYS = range(3)
#: experiments and days of which the temperatures were taken
ASKED: list[tuple[str, int]] = []
TEMPERATURES_OF = law.temperatures


def asked(experiment: str, day: int) -> list[FloatArray]:
    ASKED.append((experiment, day))
    return TEMPERATURES_OF(experiment, day)


@pytest.fixture(scope="module")
def days() -> list[list[FloatArray]]:
    return [law.temperatures("chen1996-law", k) for k in DAYS]


@pytest.fixture(scope="module")
def sought() -> Law:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(law, "SigmoidNet", partial(SigmoidNet, n_epochs=500))
        for name, value in {"DAYS": 2, "DRAWS": 20, "FEWER": 10}.items():
            patch.setattr(law, name, value)
        patch.setattr(law, "temperatures", asked)
        return law.seek(5)


def test_three_tests_of_17_profiles(days: list[list[FloatArray]]) -> None:
    """C-23: 51 sets."""
    measured = law.plant(days[0], OURS, np.random.default_rng(0))
    assert [m.errors.shape for m in measured] == [(17, 12)] * 3
    assert [m.temperatures.shape for m in measured] == [(17, 9)] * 3


def test_what_is_planted_are_the_paper_s_equations(days: list[list[FloatArray]]) -> None:
    """C-22, C-24, E-C4, E-C6: um/m, and at 500 mm half as many um."""
    quiet = replace(OURS, laser=0.0, sensor=0.0, runs=1)
    for true, m in zip(days[0], law.plant(days[0], quiet, np.random.default_rng(0)), strict=True):
        np.testing.assert_array_equal(m.temperatures, true)
        np.testing.assert_allclose(m.errors[0], EQ6(law.POSITIONS), atol=1e-12)
        t = dict(zip(TEMPERATURES, (true - true[0]).T, strict=True))
        k1 = 0.465 * t["T3"] + 2.705 * t["T4"] + 3.675 * (t["T6"] - t["T8"]) - 5.589 * (t["T7"] - t["T9"])
        np.testing.assert_allclose(m.errors[:, 10] - m.errors[0, 10], 0.5 * k1, atol=1e-9)
        np.testing.assert_allclose(m.profiles("test").slopes().factors[:, 0], k1, atol=1e-9)


def slope(rise: FloatArray) -> FloatArray:
    """Return the slope of Eq. 8, as printed."""
    t = dict(zip(TEMPERATURES, rise.T, strict=True))
    return np.asarray(0.465 * t["T3"] + 2.705 * t["T4"] + 3.675 * (t["T6"] - t["T8"]) - 5.589 * (t["T7"] - t["T9"]))


def test_readings_are_means_over_runs_with_their_noise(days: list[list[FloatArray]]) -> None:
    """C-23, C-24: five runs of the laser make a profile; each reading has its own error, added to the truth."""
    made, rng = law.plant(days[1], OURS, np.random.default_rng(7)), np.random.default_rng(7)
    assert (OURS.runs, OURS.centred, OURS.hierarchy, OURS.laser, OURS.sensor) == (5, True, False, 0.3, 0.05)
    assert (OURS.reference(3), replace(OURS, centred=False).reference(3)) == ([0, 1, 2], [0])
    for true, m in zip(days[1], made, strict=True):
        clean = EQ6(law.POSITIONS) + slope(true - true[0])[:, None] * law.POSITIONS / 1000
        errors = clean + 0.3 * rng.standard_normal(clean.shape)
        read = true + 0.05 * rng.standard_normal(true.shape)
        for k in range(len(true) // 5):
            np.testing.assert_allclose(m.errors[k], errors[5 * k : 5 * k + 5].mean(axis=0), rtol=0, atol=1e-9)
            np.testing.assert_allclose(m.temperatures[k], read[5 * k : 5 * k + 5].mean(axis=0), rtol=0, atol=1e-9)


@pytest.mark.parametrize("design", [OURS, replace(OURS, centred=False)])
def test_slopes_and_temperatures_are_those_of_the_house(days: list[list[FloatArray]], design: law.Design) -> None:
    measured = law.plant(days[0], design, np.random.default_rng(1))
    tests = [m.profiles(f"test {k}") for k, m in enumerate(measured)]
    samples, _ = slope_samples(tests, PositionOptions(inputs=TEMPERATURES, reference=design.reference(17)))
    change, k1 = (np.concatenate(v) for v in zip(*(m.counted(design) for m in measured), strict=True))
    np.testing.assert_allclose(change, samples.change(), atol=1e-9)
    np.testing.assert_allclose(k1, samples.deviations[:, 0], atol=1e-9)


def test_the_law_comes_back_whole(days: list[list[FloatArray]]) -> None:
    """C-23: four terms of 20, none that is not there; not so from the cold state, or from one warm-up."""
    ours = law.recover(OURS, days, 60, 0)
    assert ours.whole >= law.MOST
    np.testing.assert_allclose(ours.coefficients.mean(axis=0), list(EQ8.values()), atol=0.1)
    assert law.recover(replace(OURS, centred=False), days, 30, 0).whole < 0.8
    (one,) = [d for d in DESIGNS if d.experiment == "chen1996-slope"]
    assert law.recover(one, [law.temperatures(one.experiment, k) for k in DAYS], 30, 0).whole < 0.2
    assert law.recover(replace(OURS, laser=12 * law.LASER), days, 30, 0).missing > 0.3


def test_shares_of_draws() -> None:
    more, fewer = {**EQ8, "T1": 0.1}, {t: c for t, c in EQ8.items() if t != "T3"}
    recovery = Recovery(EQ8, [EQ8, more, fewer, {**fewer, "T1": 0.1}])
    assert (recovery.whole, recovery.missing, recovery.wrong) == (0.25, 0.5, 0.5)
    np.testing.assert_array_equal(recovery.coefficients, [list(EQ8.values())])
    assert np.isnan(Recovery(EQ8, [fewer]).coefficients).all()


def test_claims_can_fail(sought: Law) -> None:
    whole, otherwise, near, net = law.claims(sought)
    assert whole.holds
    assert near.holds
    assert (otherwise.holds, net.holds) == (None, None)
    fewer = Recovery(EQ8, [{t: c for t, c in EQ8.items() if t != "T3"}])
    whole, _, near, _ = law.claims(replace(sought, recoveries={**sought.recoveries, OURS: fewer}))
    assert (whole.holds, near.holds) == (False, False)
    far = Recovery(EQ8, [{t: c + 1.0 for t, c in EQ8.items()}])
    assert not law.claims(replace(sought, recoveries={**sought.recoveries, OURS: far}))[2].holds


def test_tables_tell_planted_and_found(sought: Law) -> None:
    rates, coefficients = law.tables(sought)
    assert [r[0] for r in rates.rows] == [d.name for d in DESIGNS]
    assert [r[0] for r in coefficients.rows] == list(EQ8)
    for row, true in zip(coefficients.rows, EQ8.values(), strict=True):
        planted, found, error, mean, spread = map(float, row[1:])
        assert planted == true
        assert abs(found - true) < 4 * error
        assert abs(mean - true) < 4 * error
        assert 0.4 * error < spread < 2.5 * error


def test_a_net_tells_no_law(sought: Law) -> None:
    """C-27: it fits, with more weights than patterns, and uses a temperature that has no part in the law."""
    assert (sought.net.n_parameters_, sought.net.n_patterns_) == (57, 51)
    assert "57 weights" in sought.net.caution_
    assert sought.net_r2 > 0.9
    assert {design: len(r.found) for design, r in sought.recoveries.items()} == dict.fromkeys(DESIGNS, 10) | {OURS: 20}
    assert sought.idle > 0.3
    assert sought.elsewhere["MRA"] < 0.1 * sought.elsewhere["law"]
    assert sought.elsewhere["net"] > 2 * sought.elsewhere["MRA"]
    numbers = law.numbers(sought)
    assert numbers["law_whole"] >= law.MOST
    assert numbers["law_elsewhere_net"] == sought.elsewhere["net"]


def test_what_the_net_says_is_computed_by_hand(sought: Law) -> None:
    """C-27: in training, without T1's part, and in one warm-up of another experiment; days follow each other."""
    assert sorted(ASKED) == sorted((e, day) for e in {d.experiment for d in DESIGNS} for day in (5, 6))
    first = law.plant(TEMPERATURES_OF(OURS.experiment, 5), OURS, np.random.default_rng(5))
    cold = replace(OURS, centred=False)
    change, k1 = (np.concatenate(v) for v in zip(*(m.counted(cold) for m in first), strict=True))

    def table(rises: FloatArray) -> pd.DataFrame:
        t = dict(zip(TEMPERATURES, rises.T, strict=True))
        return pd.DataFrame({v: t[v[:2]] - t[v[3:]] if "-" in v else t[v] for v in SLOPE_VARIABLES})

    X = table(change)
    assert sought.net_r2 == pytest.approx(1 - np.sum((k1 - sought.net.predict(X)) ** 2) / np.sum(k1**2))
    ends = [sought.net.predict(X.assign(T1=X["T1"].agg(end))) for end in ("min", "max")]
    assert sought.idle == pytest.approx(np.abs(ends[1] - ends[0]).max())
    (true,) = TEMPERATURES_OF("chen1996-slope", 5)
    planted = slope(true - true[0])
    assert sought.elsewhere["law"] == pytest.approx(np.sqrt(np.mean(planted**2)))
    left = planted - sought.net.predict(table(true - true[0]))
    assert sought.elsewhere["net"] == pytest.approx(np.sqrt(np.mean(left**2)))
