"""Wessel et al. 2004 redone: each judgement on data whose answer is known, and the whole study on a heated rod."""

import re
from collections.abc import Callable, Iterator, Sequence
from itertools import combinations_with_replacement
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.typing import ArrayLike, NDArray

from thermocomp.core.machine import Channel
from thermocomp.models.selection.equivalents import equivalents
from thermocomp.models.selection.maximal_correlation import MaximalCorrelations
from thermocomp.papers.common import residual, rms, trained
from thermocomp.papers.study import Claim, Study
from thermocomp.papers.wessel2004 import redo as wessel2004
from thermocomp.papers.wessel2004 import sets as wessel2004_sets
from thermocomp.papers.wessel2004 import spindle as wessel2004_spindle
from thermocomp.papers.wessel2004 import tools as wessel2004_tools
from thermocomp.papers.wessel2004 import transfer as wessel2004_transfer
from thermocomp.papers.wessel2004.sets import Selection
from thermocomp.papers.wessel2004.trial import (
    ACE_NAME,
    FROM_START,
    MLR_NAME,
    MillingTrial,
    loop_width,
    place,
    stacked,
    trial,
)
from thermocomp.recordings.cycles import make_single_cycle
from thermocomp.recordings.recording import Recording
from thermocomp.virtual.datasets import record
from thermocomp.virtual.protocol import Physics

FloatArray = NDArray[np.float64]
#: the modules that record experiments
MODULES = (wessel2004_spindle, wessel2004_sets, wessel2004_tools, wessel2004_transfer)
#: errors of the paper's set of temperatures on the resting tool
OWN_SET = [f"paper_set_{m}_rms_um" for m in ("mlr", "ace", "averaged")]


def table(name: str, temperatures: FloatArray, displacements: FloatArray, dt: float = 100.0) -> Recording:
    """Return a recording with the names of the paper."""
    names = [f"t_t{k + 1}_C" for k in range(temperatures.shape[1])]
    names += [f"s{k + 1}_um" for k in range(displacements.shape[1])]
    kinds = {"t": ("temperature", "degC"), "s": ("displacement", "um")}
    channels = tuple(Channel(n, *kinds[n[0]]) for n in names)
    values = pd.DataFrame(np.hstack([temperatures, displacements]), columns=names)
    return Recording(
        name, dt * np.arange(len(values), dtype=np.float64), values, channels, make_single_cycle(len(values))
    )


def heated_rod(name: str, heat: FloatArray, *, room: float = 20.0, n_t: int = 9, n_s: int = 3) -> Recording:
    """Return a test of a rod of 12 cells, heated at both ends; its thermometers lag, the last hangs in the room."""
    rng = np.random.default_rng([*name.encode()])
    cells, felt = np.full(12, room), np.full(12, room)
    rows, inner = [], []
    for ends in heat:
        for _ in range(6):
            flow = np.zeros(12)
            flow[:-1] += np.diff(cells)
            flow[1:] -= np.diff(cells)
            flow[[0, -1]] += ends
            cells = cells + 0.15 * (flow - 0.03 * (cells - room))
            felt = felt + 0.1 * (cells - felt)
        rows.append(np.append(felt[[0, 1, 3, 4, 6, 7, 9, 11][: n_t - 1]], room))
        inner.append([(cells - room)[:k].sum() for k in (12, 8, 4)[:n_s]])
    temperatures, displacements = np.array(rows), np.array(inner)
    return table(
        name,
        temperatures + 0.03 * rng.normal(size=temperatures.shape),
        displacements - displacements[0] + 0.1 * rng.normal(size=displacements.shape),
    )


def schedule(name: str, rows: int, pieces: int) -> FloatArray:
    """Return heat at both ends, drawn again for every piece of a test."""
    drawn = np.random.default_rng([*name.encode()]).choice([0.0, 0.5, 1.0, 2.0], (pieces, 2))
    return drawn[np.arange(rows) * pieces // rows]


def stand_in(experiment: str, *, physics: str | None = None, mounting: str = "", seed: int = 0) -> list[Recording]:
    """Return the experiments of the study on the rod, which has one physics; another mounting: heated otherwise."""
    assert physics is None

    def rod(name: str, rows: int, pieces: int, n_t: int = 9, n_s: int = 3, room: float = 20.0) -> Recording:
        return heated_rod(name, schedule(f"{seed} {name}", rows, pieces), n_t=n_t, n_s=n_s, room=room)

    if experiment == "wessel-fem":
        return [rod(n, 199, 6, 3, 2) for n in ("reference", "test")]
    if experiment == "wessel-tool":
        return [rod(n + mounting.removeprefix("hydraulic"), 240, 5) for n in ("training", "test")]
    if experiment == "wessel-milling":
        return [rod(f"day{k}", 80, 5, 3, 1, room=19.0 + k) for k in range(1, 6)]
    return [rod(f"set{k}", 100, 4) for k in range(23)]


@pytest.fixture
def experiments(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in MODULES:
        monkeypatch.setattr(module, "record", stand_in)


@pytest.fixture(scope="module")
def study() -> Iterator[tuple[Study, list[float]]]:
    told: list[float] = []
    with pytest.MonkeyPatch.context() as patch:
        for module in MODULES:
            patch.setattr(module, "record", stand_in)
        yield wessel2004.run(0, lambda share, _: told.append(share)), told


def claim(claims: Sequence[Claim], words: str) -> Claim:
    (found,) = [c for c in claims if words in c.text]
    return found


# -- the whole study -----------------------------------------------------------------------------------------------


def test_every_requirement_of_the_study_is_covered(study: tuple[Study, list[float]]) -> None:
    ids = {i for c in study[0].claims for i in c.ids}
    assert ids >= {f"W-{k:02d}" for k in range(1, 15)}
    assert ids >= {"E-W1", "E-W2", "E-W3", "E-W5", "E-W6", "E-W8"}


def test_figures_are_those_of_the_paper(study: tuple[Study, list[float]]) -> None:
    keys = {f.key.removeprefix("wessel2004-") for f in study[0].figures}
    assert keys == {"fig2a", "fig2b", "fig3", "fig5", "fig6", "fig7", "fig8", "fig9", "loops", "tool-loops"}
    (fig2b,) = [f for f in study[0].figures if f.key.endswith("fig2b")]
    assert [p.title.partition(")")[0].strip("(") for p in fig2b.panels] == ["i", "ii", "iii", "iv", "v", "vi"]
    for figure in study[0].figures:
        for curve in (c for p in figure.panels for c in p.curves):
            assert curve.x.shape == curve.y.shape
    curves = {f.key.removeprefix("wessel2004-"): [c for p in f.panels for c in p.curves] for f in study[0].figures}
    # one test of the spindle; training and test of the tool; the days that are learned together, and the last one
    rows = {"fig2a": 199, "fig3": 199, "fig5": 240, "fig6": 240, "fig7": 240, "fig8": 4 * 80, "fig9": 80}
    assert {key: {len(c.x) for c in curves[key]} for key in rows} == {key: {n} for key, n in rows.items()}
    (fig3,) = [f for f in study[0].figures if f.key.endswith("fig3")]
    assert "S2" in fig3.panels[1].ylabel  # the last displacement, at the tip
    for curve in curves["fig3"]:
        np.testing.assert_allclose(curve.x, 100.0 / 3600.0 * np.arange(199))  # [h]
    assert [p.xlabel.split(" ")[1] for p in fig2b.panels[:4]] == ["[um]", *["[degC]"] * 3]
    theta, total, residual = (fig2b.panels[k].curves[0] for k in (0, 4, 5))
    np.testing.assert_allclose(residual.y, theta.y - total.y)


def test_progress_rises_and_numbers_are_finite(study: tuple[Study, list[float]]) -> None:
    found, told = study
    assert told == sorted(told)
    assert (told[0], told[-1]) == (0.0, 1.0)
    assert all(np.isfinite(v) for v in found.numbers.values())
    for t in found.tables:
        assert all(len(row) == len(t.header) for row in t.rows)


def test_claims_agree_with_the_numbers(study: tuple[Study, list[float]]) -> None:
    found, n = study[0], study[0].numbers
    assert n["sets_models"] == 511 * 23 * 3
    assert n["sets_small"] == 129
    assert claim(found.claims, "more models than").holds is None
    for words, key in (
        ("the paper's set", "tool_paper_set"),
        ("our own Appendix", "tool_own_set"),
        ("fifth", "milling"),
    ):
        c = claim(found.claims, words)
        assert f"MLR {n[f'{key}_mlr_rms_um']:.2f} um, ACE {n[f'{key}_ace_rms_um']:.2f} um" in c.ours
    bent = claim(found.claims, "Linear regression is not")
    assert bent.ours == f"MLR {n['fem_mlr_rms_um']:.2f} um, ACE {n['fem_ace_rms_um']:.2f} um"
    (triples,) = re.findall(r" 3: ([\d., ]+);", claim(found.claims, "best triples").ours)
    assert min(map(float, triples.split(", "))) == pytest.approx(n["sets_best_psi"], abs=6e-5)
    assert f"{n['sets_common']:.0f} common" in claim(found.claims, "Several sets").ours


@pytest.mark.usefixtures("experiments")
def test_claims_are_the_same_ones_in_every_run(study: tuple[Study, list[float]]) -> None:
    other = wessel2004.run(1, lambda *_: None)
    assert [(c.ids, c.text) for c in other.claims] == [(c.ids, c.text) for c in study[0].claims]


def test_days_of_other_temperature_are_also_counted_from_their_start(study: tuple[Study, list[float]]) -> None:
    (milling,) = [t for t in study[0].tables if t.caption.startswith("Milling")]
    (fem,) = [t for t in study[0].tables if t.caption.startswith("Finite")]
    assert FROM_START.format(ACE_NAME) in [row[1] for row in milling.rows]
    assert FROM_START.format(ACE_NAME) not in [row[1] for row in fem.rows]


def test_models_are_exchanged_between_mountings(study: tuple[Study, list[float]]) -> None:
    """W-14: the diagonal is the study of the tool at rest; others by least squares in numpy."""
    found, n = study[0], study[0].numbers
    (table,) = [t for t in found.tables if t.caption.startswith("RMS of S1")]
    mountings = ["hydraulic", "shrink", "collet"]
    assert [tuple(row[:2]) for row in table.rows] == [(a, b) for a in mountings for b in mountings]
    own = [f"{n[f'tool_{name}']:.2f}" for name in ("none_rms_um", *OWN_SET)]
    assert table.rows[0][2:] == own
    learned, unseen = (stand_in("wessel-tool", mounting=m)[k] for m, k in (("shrink", 0), ("collet", 1)))
    A, B = (np.column_stack([r.values(r.temperatures)[:, [0, 1, 7]], np.ones(len(r))]) for r in (learned, unseen))
    y, measured = (r.values(r.displacements)[:, 0] for r in (learned, unseen))
    linear = np.sqrt(np.mean((measured - B @ np.linalg.lstsq(A, y, rcond=None)[0]) ** 2))
    assert float(table.rows[5][3]) == pytest.approx(linear, abs=0.006)
    assert float(table.rows[5][2]) == pytest.approx(np.sqrt(np.mean(measured**2)), abs=0.006)
    samples = [stacked([r], 0, (0, 1, 7), rezero=True) for r in (learned, unseen)]
    averaged = trained("averaged", samples[0])
    assert float(table.rows[5][5]) == pytest.approx(rms(residual(averaged, samples[1])), abs=0.006)


@pytest.mark.usefixtures("experiments")
def test_same_seed_same_numbers() -> None:
    once, again, other = (wessel2004_spindle.spindle(seed, lambda *_: None).numbers for seed in (1, 1, 2))
    assert once == again
    assert once != other


# -- the virtual machines ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("experiment", "tests", "temperatures", "displacements"),
    [("wessel-fem", 2, 3, 2), ("wessel-tool", 2, 9, 3), ("wessel-milling", 5, 3, 1), ("wessel-sets", 23, 9, 3)],
)
def test_experiments_are_those_of_the_paper(experiment: str, tests: int, temperatures: int, displacements: int) -> None:
    recordings = record(experiment)
    assert len(recordings) == tests
    assert {len(r.temperatures) for r in recordings} == {temperatures}
    assert {len(r.displacements) for r in recordings} == {displacements}
    if experiment == "wessel-milling":
        assert all(70 <= len(r) <= 90 for r in recordings)
    if experiment == "wessel-tool":
        assert [place(c.name) for c in recordings[0].temperatures] == [f"T{k}" for k in range(1, 10)]


def test_the_finite_element_spindle() -> None:
    part = wessel2004_spindle.spindle(0, lambda *_: None)
    assert claim(part.claims, "Two series").ours == "199, 199 rows, 100, 100 s"
    assert part.numbers["fem_psi"] > 0.99
    assert part.numbers["fem_ace_rms_um"] < 0.5 * part.numbers["fem_none_rms_um"]
    assert claim(part.claims, "cropped, and worse").ours != "no row beyond"
    assert part.numbers["fem_loop_width"] > 0.05  # hysteresis is there to be seen


# -- one experiment ------------------------------------------------------------------------------------------------


def curved(rows: int, top: float, seed: int = 0) -> Recording:
    """Return a test in which s1 = t1^2 - t2 / 2, of t1 from -top to top."""
    rng = np.random.default_rng(seed)
    warm = np.column_stack([np.linspace(-top, top, rows), np.sin(np.linspace(0.0, 9.0 + seed, rows))])
    s = warm[:, :1] ** 2 - 0.5 * warm[:, 1:]
    return table(f"curved {seed}", 20.0 + warm + 1e-6 * rng.normal(size=warm.shape), s)


def test_linear_regression_is_least_squares_on_temperatures_as_read() -> None:
    learned, unseen = curved(199, 10.0), curved(150, 9.0, seed=1)
    found = trial([learned, unseen], 0, (0, 1), beside=False)
    A = np.column_stack([learned.values(learned.temperatures), np.ones(199)])
    weights = np.linalg.lstsq(A, learned.values(learned.displacements)[:, 0], rcond=None)[0]
    expected = np.column_stack([unseen.values(unseen.temperatures), np.ones(150)]) @ weights
    np.testing.assert_allclose(found.estimates[MLR_NAME], expected, atol=1e-9)
    assert set(found.estimates) == {ACE_NAME, MLR_NAME}


def test_ace_beats_linear_regression_where_the_truth_is_curved_and_not_where_it_is_straight() -> None:
    bent = trial([curved(199, 10.0), curved(150, 9.0, seed=1)], 0, (0, 1), beside=False)
    assert bent.rms(ACE_NAME) < 0.5 * bent.rms(MLR_NAME)
    straight = [
        table("a", 20.0 + x, 4.0 * x[:, :1])
        for x in (np.linspace(0, 9, n)[:, None] * np.array([[1.0, 0.5]]) for n in (199, 150))
    ]
    lines = trial(straight, 0, (0, 1), beside=False)
    assert lines.rms(MLR_NAME) < 1e-6 < lines.rms(ACE_NAME)


def test_a_row_is_beyond_only_if_one_can_see_it() -> None:
    slightly, clearly = (trial([curved(199, 10.0), curved(150, top, seed=1)], 0, (0, 1)) for top in (10.01, 12.0))
    assert not slightly.beyond.any()
    learned = clearly.learned.deviations[:, 0]
    assert clearly.beyond.sum() == (clearly.measured > learned.max() + 0.01 * np.ptp(learned)).sum() > 0


def peaks(learned: Recording, unseen: Recording) -> tuple[Claim, Claim]:
    found = trial([learned, unseen], 0, (0, 1), beside=False)
    both = wessel2004_spindle.Spindle([learned, unseen], found, found)
    (cropped,), (guarded,) = (wessel2004_spindle.claims.judged(key, both) for key in ("cropped", "guarded"))
    return cropped, guarded


def test_peaks_are_cropped_and_flagged() -> None:
    cropped, guarded = peaks(curved(199, 10.0), curved(150, 12.0, seed=1))
    assert cropped.holds
    assert guarded.holds
    assert "2 of 2 peak(s)" in guarded.ours


def test_without_a_peak_nothing_is_claimed() -> None:
    cropped, guarded = peaks(curved(199, 10.0), curved(150, 9.0, seed=1))
    assert cropped.holds is False
    assert "stay within" in cropped.finding
    assert guarded.holds is None


def test_a_peak_without_its_temperature_is_not_flagged() -> None:
    unseen = curved(150, 9.0, seed=1)
    higher = unseen.table.copy()
    higher["s1_um"] += np.where(np.arange(150) > 140, 50.0, 0.0)
    cropped, guarded = peaks(curved(199, 10.0), Recording("up", unseen.time, higher, unseen.channels, unseen.cycles))
    assert cropped.holds
    assert guarded.holds is False
    assert "0 of 1 peak(s)" in guarded.ours


@pytest.mark.parametrize(("tops", "exchanged"), [((10.0, 12.0), False), ((12.0, 10.0), True)])
def test_the_wider_series_is_the_one_with_peaks(
    tops: tuple[float, float], exchanged: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    both = [curved(199, top, seed=k) for k, top in enumerate(tops)]
    monkeypatch.setattr(wessel2004_spindle, "record", lambda *_, **__: both)
    orders: list[tuple[str, ...]] = []

    def asked(
        recordings: Sequence[Recording], target: int, temperatures: Sequence[int], *, beside: bool = True
    ) -> MillingTrial:
        orders.append((*(r.name for r in recordings), str(beside)))
        return trial(recordings, target, temperatures, beside=beside)

    monkeypatch.setattr(wessel2004_spindle, "trial", asked)
    found = wessel2004_spindle.spindle(0, lambda *_: None)
    for words in ("are cropped", "support guard"):
        c = claim(found.claims, words)
        assert c.holds
        assert c.ours.startswith("the two series exchanged: ") == exchanged
    # the other methods are fitted once, and the second time the other way round
    names = tuple(r.name for r in both)
    assert orders == [(*names, "True"), (*names[::-1], "False")][: 1 + exchanged]


def test_runs_of_rows() -> None:
    rows = np.array([True, False, True, True, False, True])
    assert wessel2004_spindle.runs(rows) == [slice(0, 1), slice(2, 4), slice(5, 6)]
    assert wessel2004_spindle.runs(~rows[:1]) == []


@pytest.mark.parametrize(("shift", "low", "high"), [(0.0, 0.0, 0.03), (np.pi / 2, 0.95, 1.0)])
def test_width_of_a_loop(shift: float, low: float, high: float) -> None:
    t = np.linspace(0.0, 2 * np.pi, 500)
    test = table("loop", 20 + np.sin(t)[:, None], np.sin(t + shift)[:, None])
    assert low <= loop_width(stacked([test], 0, [0])) <= high


def test_names_of_places() -> None:
    assert [place(n) for n in ("t_t8_C", "s1_um", "t_front_seat_C", "z_um")] == ["T8", "S1", "front_seat", "z"]


# -- claims on residuals that are set --------------------------------------------------------------------------------


def judged(residual: Callable[[FloatArray], tuple[FloatArray, FloatArray]]) -> MillingTrial:
    """Return a trial of 100 points with the residuals of (linear regression, ACE) given."""
    found = trial([curved(199, 10.0), curved(100, 9.0, seed=1)], 0, (0, 1), beside=False)
    linear, ace = residual(np.arange(1.0, 101.0))
    found.estimates[MLR_NAME] = found.measured - linear
    found.estimates[ACE_NAME] = found.measured - ace
    return found


def test_the_local_gain_is_the_greatest_of_ten_stretches() -> None:
    def locally(found: MillingTrial) -> Claim:
        resting = wessel2004_tools.Resting(found, found, selection([[[0.4, 0.5, 0.6]]], [(0,)]), {})
        return wessel2004_tools.resting.judged("locally", resting)[0]

    c = locally(judged(lambda x: (np.where(x <= 10, 12.0, 1.0), np.ones(100))))
    assert c.holds
    assert c.ours.startswith("up to 12.0x, in rows 1-10 of 100")
    assert not locally(judged(lambda _: (np.full(100, 9.0), np.ones(100)))).holds


def test_the_worst_episode_is_left_out() -> None:
    spike = judged(lambda x: (np.ones(100), np.where(np.abs(x - 17) <= 5, 9.0 - np.abs(x - 17), 1.5)))
    (c,) = wessel2004_tools.milling.judged("without_episode", spike)
    assert c.holds
    assert "1.50 um without points 12-22" in c.ours
    flat = judged(lambda _: (np.ones(100), np.full(100, 2.5)))
    assert not wessel2004_tools.milling.judged("without_episode", flat)[0].holds


def test_over_and_under_estimates_go_by_the_drift() -> None:
    found = judged(lambda x: (np.where(x <= 40, -1.0, 1.0), np.ones(100)))
    towards = float(np.sign(found.measured.mean()))
    found.estimates[MLR_NAME] = found.measured + towards * np.repeat(
        [-50.0, 16.0, 0.5, 50.0, -21.0, -0.5], [9, 1, 30, 19, 1, 40]
    )
    (c,) = wessel2004_tools.milling.judged("systematic", found)
    assert c.holds
    assert c.ours.startswith("mean excess +1.00 um between them, -1.00 um")


# -- choice of temperatures ----------------------------------------------------------------------------------------


def selection(psi: ArrayLike, sets: list[tuple[int, ...]]) -> Selection:
    """Return the comparison of sets by their maximal correlations, (displacements, sets, tests)."""
    values = np.asarray(psi, dtype=np.float64)
    known = MaximalCorrelations(values, tuple(sets), tuple(f"set{k}" for k in range(values.shape[2])), complete=True)
    small = equivalents(list(values), sets)
    return Selection(known, known, small, small, small, [100], 1.0)


def test_the_choice_is_the_greatest_sum_of_the_common_sets() -> None:
    sets = [(0,), (1,), (0, 1)]
    rng = np.random.default_rng(0)
    noise = 1e-4 * rng.normal(size=(2, 3, 23))
    psi = np.array([0.5, 0.9, 0.9])[None, :, None] + noise
    psi[:, 2] += 1e-6
    small = equivalents(list(psi), sets)
    assert small.common == ((1,), (0, 1))
    best = max(((1,), (0, 1)), key=lambda s: psi[:, sets.index(s)].sum())
    assert wessel2004_sets._choice(small) == best
    found = selection(psi, sets)
    assert found.chosen == best
    (several,), (shared,) = (wessel2004_sets.claims.judged(key, found) for key in ("several", "shared"))
    assert several.holds
    assert shared.holds is False  # T2 is in both, and by itself as good as the best
    assert "{T2} by itself is as good" in shared.finding


def test_no_common_set_is_told() -> None:
    rng = np.random.default_rng(1)
    psi = np.array([[0.9, 0.5], [0.5, 0.9]])[:, :, None] + 1e-4 * rng.normal(size=(2, 2, 23))
    found = selection(psi, [(0,), (1,)])
    (several,), (shared,) = (wessel2004_sets.claims.judged(key, found) for key in ("several", "shared"))
    assert several.holds is False
    assert shared.holds is False
    assert several.ours.endswith("0 common: none")


def test_sets_are_written_like_the_papers() -> None:
    assert wessel2004_sets.name_set((0, 1, 7)) == "{T1, T2, T8}"


@pytest.mark.parametrize("physics", ["linear", "nonlinear"])
@pytest.mark.parametrize(
    ("row", "experiment", "target", "temperatures"),
    [("resting tool", "wessel-tool", 0, (0, 1, 7)), ("spindle of finite elements", "wessel-fem", 1, (0, 1, 2))],
)
def test_the_page_tells_the_errors_of_both_physics(
    row: str, experiment: str, target: int, temperatures: tuple[int, ...], physics: Physics
) -> None:
    page = (Path(__file__).resolve().parents[2] / "docs" / "virtual_machine.rst").read_text(encoding="utf-8")
    cells = re.findall(r"- ([\d.]+)", page.partition(f"* - {row}, {physics}\n")[2])[:5]
    recordings = record(experiment, physics=physics)
    found = trial(recordings, target, temperatures)
    learned, unseen = (stacked(r, target, temperatures) for r in (recordings[:-1], recordings[-1:]))
    terms = [
        np.array([[1.0, *z, *(a * b for a, b in combinations_with_replacement(z, 2))] for z in s.values - 30.0])
        for s in (learned, unseen)
    ]
    weights = np.linalg.lstsq(terms[0], learned.deviations[:, 0], rcond=None)[0]
    second = float(np.sqrt(np.mean((unseen.deviations[:, 0] - terms[1] @ weights) ** 2)))
    ours = [found.rms(ACE_NAME), found.rms(MLR_NAME), second, found.rms("ace-monotone"), found.rms("dynamic")]
    assert [float(c) for c in cells] == pytest.approx(ours, abs=0.02)
    # what the page concludes: plain regression is as good as ACE, or better
    assert found.rms(MLR_NAME) < found.rms(ACE_NAME)
