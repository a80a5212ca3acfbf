"""Hwang's study: its procedure on the virtual machine, and that its claims can fail."""

import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from thermocomp.models.numerics.leastsquares import Triangle
from thermocomp.models.selection import grouping
from thermocomp.models.selection.grouping import Grouped, Groups, Interval
from thermocomp.papers.common import predict_deviation
from thermocomp.papers.hwang import redo as hwang
from thermocomp.papers.hwang import setup as hwang_setup
from thermocomp.papers.hwang.setup import Computed
from thermocomp.papers.study import Claim, Study, tell_nobody
from thermocomp.recordings.recording import Recording
from thermocomp.virtual.datasets import record

FloatArray = NDArray[np.float64]

IDS = {"H-01", *(f"H-{k:02d}" for k in range(3, 20)), "E-H1", "E-H2", "E-H7", "E-H8", "E-H10", "E-C12"}


def claim(study: Study, *ids: str) -> Claim:
    return next(c for c in study.claims if set(ids) <= set(c.ids))


@pytest.fixture(scope="module")
def told() -> list[float]:
    return []


@pytest.fixture(scope="module")
def computed(told: list[float]) -> Computed:
    return hwang_setup.compute(0, lambda share, _: told.append(share))


@pytest.fixture(scope="module")
def study(computed: Computed) -> Study:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(hwang_setup, "compute", lambda *_: computed)
        return hwang.run(0, tell_nobody)


def test_it_covers_its_requirements(study: Study, told: list[float]) -> None:
    assert {i for c in study.claims for i in c.ids} == IDS
    assert told == sorted(told)
    assert told[0] == 0
    assert told[-1] < 1
    assert {f.key for f in study.figures} == {"hwang-fig4", "hwang-fig5", "hwang-fig6", "hwang-thresholds"}
    assert all(np.isfinite(v) for v in study.numbers.values())


def test_a_hundred_draws_of_the_noise(study: Study) -> None:
    # H-18
    (figure,) = [f for f in study.figures if f.key == "hwang-fig6"]
    assert [len(curve.x) for panel in figure.panels for curve in panel.curves] == [100, 100]
    assert [len(np.unique(curve.y)) for panel in figure.panels for curve in panel.curves] == [100, 100]


def test_numbers_of_models(study: Study) -> None:
    # H-07
    n = study.numbers
    assert n["models_tried_without_grouping"] == 2**13 - 1
    assert n["models_tried"] >= 2 ** n["groups"]
    assert 1 <= n["variables"] <= n["groups"]
    assert claim(study, "H-07").holds is None  # arithmetic, no finding


def test_rows_are_those_of_whole_tests_every_half_hour(computed: Computed) -> None:
    """H-09, E-H7: three tests of 13 rows, the fewest with 32, each with its own order; the new ones are others."""
    for samples, runs in ((computed.fit, 3), (computed.new, 5)):
        assert samples.time.reshape(runs, 13).tolist() == [[1800.0 * k for k in range(13)]] * runs
        assert samples.test.reshape(runs, 13).T.tolist() == [[*range(runs)]] * 13
    assert 2 * 13 < hwang_setup.PAPERS_ROWS <= len(computed.fit)
    hashes = [*computed.fit.hashes, *computed.new.hashes]
    assert len(set(hashes)) == len(hashes) == 8
    for k, samples in ((0, computed.fit), (2, computed.fit), (3, computed.new)):
        (test,) = record("hwang", seed=k)
        z = test.table["z_um"].to_numpy()[::3]
        mine = samples.deviations[samples.test == k % 3, 0]
        np.testing.assert_array_equal(mine, z)


def test_both_searches_are_counted_and_timed(computed: Computed, study: Study) -> None:
    """H-19: 8191 models without grouping, 255 and those of the members with it; both times are printed."""
    assert computed.single.searched_ == (8191, 1)
    assert computed.grouped.searched_[0] == 2 ** len(computed.grouped.groups_) - 1
    said = claim(study, "H-19").ours
    printed = re.match(r"(\d+) models instead of 8191: (\d+\.\d) ms instead of (\d+\.\d) ms, \d", said)
    assert printed is not None
    assert int(printed[1]) == sum(computed.grouped.searched_)
    times = [1e3 * computed.seconds[name] for name in (hwang_setup.OPTIMAL, hwang_setup.SINGLE)]
    assert [float(printed[2]), float(printed[3])] == pytest.approx(times, abs=0.051)


@pytest.mark.parametrize(("seconds", "holds"), [(0.001, True), (0.009, False)])
def test_time_is_saved_if_the_search_is_shorter(seconds: float, holds: bool) -> None:
    # H-19
    searched = {name: SimpleNamespace(searched_=n) for name, n in (("grouped", (255, 4)), ("single", (8191, 1)))}
    found: Any = SimpleNamespace(seconds={hwang_setup.OPTIMAL: seconds, hwang_setup.SINGLE: 0.008}, **searched)
    (said,) = hwang.claims.judged("quicker", found)
    assert said.holds is holds
    assert said.ours.startswith("259 models instead of 8191")


def test_our_methods_learn_from_the_same_tests(computed: Computed) -> None:
    rows = {name: len(residual) for name, residual in computed.ours.items()}
    assert [*rows.values()] == [5 * 13, 5 * 37] * 2
    assert [name.partition(",")[0] for name in rows] == ["dynamic"] * 2 + ["averaged"] * 2
    z = computed.new.deviations[:, 0]
    assert all(np.sqrt(np.mean(e**2)) < 0.2 * np.sqrt(np.mean(z**2)) for e in computed.ours.values())


@pytest.fixture
def searched(monkeypatch: pytest.MonkeyPatch) -> list[Grouped]:
    """The searches that were timed, by a clock that needs 1 ms for each of their models."""
    done: list[Grouped] = []

    def choose(tri: Triangle, groups: Groups) -> Grouped:
        done.append(grouping.choose(tri, groups))
        return done[-1]

    def perf_counter() -> float:
        return sum(s.subsets.count + s.members.count for s in done) / 1000

    monkeypatch.setattr(hwang_setup, "choose", choose)
    monkeypatch.setattr(hwang_setup, "time", SimpleNamespace(perf_counter=perf_counter))
    return done


def test_a_seed_is_a_study(computed: Computed, study: Study, searched: list[Grouped]) -> None:
    """And H-19: both searches are done by the same routine, and find the models of the study."""
    again = hwang.run(0, tell_nobody)
    assert again.numbers == study.numbers
    models = int(again.numbers["models_tried"])
    assert claim(again, "H-19").ours.startswith(f"{models} models instead of 8191: {models}.0 ms instead of 8192.0 ms")
    both = (computed.grouped, computed.single)
    assert {s.selected: (s.subsets.count, s.members.count) for s in searched} == {
        m.selected_: m.searched_ for m in both
    }
    assert hwang.run(1, tell_nobody).numbers != study.numbers


def test_a_drift_of_squares_refutes_the_linear_model(monkeypatch: pytest.MonkeyPatch) -> None:
    """H-12 and H-13 can fail: here the drift is what the engineering judgement model is made of."""

    def made(experiment: str, *, seed: int) -> list[Recording]:
        (test,) = record(experiment, seed=seed)
        change = {p: (test.table[f"t_{p}_C"] - test.table["t_bed_rear_C"]).to_numpy() for p in ("z_nut", "front_seat")}
        noise = 0.5 * np.random.default_rng(seed).normal(size=len(test))
        z = 3 * (change["front_seat"] - 5) ** 2 + 20 * change["z_nut"] ** 2 + noise
        return [replace(test, table=test.table.assign(z_um=z))]

    monkeypatch.setattr(hwang_setup, "record", made)
    study = hwang.run(0, tell_nobody)
    refuted = claim(study, "H-12", "H-13")
    assert refuted.holds is False
    assert "times the error of the engineering judgement model" in refuted.finding
    assert study.numbers["r_squared_judgement"] > 0.999


def test_the_documentation_shows_this_study(study: Study) -> None:
    """The first of its runs: what is judged, and how; `make verdicts STUDIES=hwang` makes it again."""
    content = json.loads((Path(__file__).parents[2] / "docs" / "verdicts.json").read_text(encoding="utf-8"))
    kept = content["studies"]["hwang"]["claims"]
    told = [([*c.ids], c.text, c.holds) for c in study.claims if "H-19" not in c.ids]  # that one is about times
    assert [(c["ids"], c["claim"], c["holds"]) for c in kept if "H-19" not in c["ids"]] == told


def test_agreement_with_table_1() -> None:
    paper = tuple(tuple(k - 1 for k in g) for g in hwang_setup.TABLE_1)
    assert hwang_setup.agreement(paper) == 1
    assert hwang_setup.agreement((tuple(range(13)),)) == pytest.approx(8 / 78)  # pairs in one group: 6 + 1 + 1
    assert hwang_setup.agreement(tuple((k,) for k in range(13))) == pytest.approx(70 / 78)


def test_the_threshold_taken_is_the_widest_of_the_nearest() -> None:
    one, two, three = ((0, 1, 2),), ((0, 1), (2,)), ((0,), (1,), (2,))
    found = [
        Interval(-1, 0.1, one),
        Interval(0.1, 0.3, two),
        Interval(0.3, 0.8, two),
        Interval(0.8, 1, three),
    ]
    assert hwang_setup.nearest(found, 2).low == 0.3
    assert hwang_setup.nearest(found, 8).low == 0.8


def test_the_engineering_judgement_model_is_least_squares() -> None:
    # H-13
    samples = hwang_setup.samples_of(record("hwang", seed=3))
    fit = hwang_setup.polynomial(samples, ("T6", "T7", "T13"), 2)
    columns = {name: samples.values[:, k] - samples.values[:, 13] for k, name in enumerate(hwang_setup.NAMES)}
    three = np.column_stack([columns[n] for n in ("T6", "T7", "T13")])
    X = np.column_stack([np.ones(len(three)), three, three**2])
    z = samples.deviations[:, 0]
    weights, *_ = np.linalg.lstsq(X, z, rcond=None)
    residual = z - X @ weights
    assert fit.error == pytest.approx(np.sqrt(residual @ residual / (len(z) - 7)))
    assert fit.r_squared == pytest.approx(1 - residual @ residual / np.sum((z - z.mean()) ** 2))
    assert predict_deviation(fit.model, samples) == pytest.approx(X @ weights, abs=1e-6)
