"""The study of stepwise2017: its procedure, and that its claims can fail."""

import re
import shutil
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray

from thermocomp.models.numerics.leastsquares import effective_sample_size
from thermocomp.models.partial_f import PartialF
from thermocomp.papers import common, exported
from thermocomp.papers.common import Errors
from thermocomp.papers.stepwise2017 import redo as stepwise2017
from thermocomp.papers.stepwise2017 import setup as stepwise2017_setup
from thermocomp.papers.study import Claim, Study, tell_nobody
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.stacking import stack
from thermocomp.virtual.datasets import record

FloatArray = NDArray[np.float64]

HEAT = ["t_front_seat_C", "t_table_C", "t_x_bearing_C"]
IDS = {"T-01", *(f"T-{k:02d}" for k in range(3, 11)), "E-T3", "E-T5", "E-C12"}


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Least squares in place of the slowest method, where another one is tested."""
    monkeypatch.setitem(stepwise2017_setup.METHODS, stepwise2017_setup.AVERAGED, "ols")


def claim(study: Study, *ids: str) -> Claim:
    return next(c for c in study.claims if set(ids) <= set(c.ids))


def test_the_virtual_machine() -> None:
    told: list[float] = []
    study = stepwise2017.run(0, lambda share, _: told.append(share))
    assert {i for c in study.claims for i in c.ids} == IDS
    assert told == sorted(told)
    assert all(np.isfinite(v) for v in study.numbers.values())
    n = study.numbers
    assert n["temperatures"] == 24
    # each number stands where it belongs; the verdicts are those of planted cases, in test_papers_planted and _softer
    assert claim(study, "T-07").ours.startswith(f"{n['chosen']:.0f}: ")
    least, pursuit, bound = (c for c in study.claims if {"T-08", "T-09"} <= set(c.ids))
    for c, other in ((least, "least_squares"), (pursuit, "projection_pursuit")):
        assert c.ours == f"RMS {n['rms_online_um']:.2f} um, {n[f'rms_online_{other}_um']:.2f} um"
    assert bound.ours.startswith(f"{n['max_online_um']:.1f} um at most")
    assert "predicted by the C code" in bound.ours or "predicted by its Python twin" in bound.ours
    # the method that is recommended stands beside the paper's, under its name (T-08)
    (averaged,) = (c for c in study.claims if "averaged" in c.text)
    assert averaged.ours.startswith(f"{n['rms_online_averaged_um']:.2f}, ")
    assert f"; stepwise {n['rms_online_um']:.2f}, " in averaged.ours
    assert 0 < n["rms_online_averaged_um"] < n["rms_online_none_um"] / 4
    assert "averaged (recommended, not in the paper)" in [row[1] for row in study.tables[1].rows]
    assert len(study.tables[0].rows) >= n["chosen"]


def _of(experiment: str, seed: int, few: bool) -> list[Recording]:
    """A drift made of two temperatures of the virtual machine; or of eight walks, each a third as important."""
    (test,) = record("stepwise2017", seed=seed + (experiment != "stepwise2017"))
    rng = np.random.default_rng([seed, *experiment.encode()])
    names = [c.name for c in test.temperatures]
    heat = test.values(test.temperatures)
    weights = np.zeros(24)
    weights[[0, 12]] = 3.0, -8.0
    if not few:
        heat = 20 + np.cumsum(0.2 * rng.normal(size=heat.shape), axis=0)
        weights[:8] = 100 * 3.0 ** -np.arange(8)
        weights[12] = 0
    noise = 0.2 if few else 0.01
    x = (heat - heat[0]) @ weights + noise * rng.normal(size=len(test))
    return [replace(test, name=experiment, table=test.table.assign(**dict(zip(names, heat.T, strict=True)), x1_um=x))]


@pytest.mark.usefixtures("quick")
def test_a_drift_of_two_temperatures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stepwise2017_setup, "record", lambda e, *, seed: _of(e, seed, few=True))
    study = stepwise2017.run(0, tell_nobody)
    assert claim(study, "T-07").holds
    assert claim(study, "T-07").ours == "2: front_seat, table"
    assert study.numbers["rms_online_um"] < 0.1 * study.numbers["rms_online_none_um"]
    # a fixed F asks for more where there are fewer rows (E-T3)
    needed = [float(row[2]) for row in study.tables[2].rows]
    assert needed == sorted(needed)
    assert needed[-1] == pytest.approx(100 / (100 + float(study.tables[2].rows[-1][0]) - 2), abs=0.005)


def test_the_model_is_printed_with_its_coefficients() -> None:
    """T-07: Eq. 8 of a drift of which the two temperatures and their coefficients are known."""
    warm = common.stacked(_of("stepwise2017", 0, few=True), ["x1_um"], HEAT)
    models = common.fit_and_freeze(PartialF(), warm, ["x1_um"])
    found = SimpleNamespace(models={stepwise2017_setup.STEPWISE: models["x1_um"]})
    (claim,) = stepwise2017.claims.judged("model", found)  # type: ignore[arg-type]
    assert claim.ours.startswith("x = ")
    found_terms = re.findall(r"([+-]) ([\d.]+) (t_\w+_C)", claim.ours)
    terms = {name: float(sign + value) for sign, value, name in found_terms}
    assert terms == pytest.approx({"t_front_seat_C": 3.0, "t_table_C": -8.0}, abs=0.1)


def test_what_a_first_temperature_has_to_explain() -> None:
    """T-07, E-T3: F_E = 100 with n - 2 degrees of freedom."""
    warm = stack(_of("stepwise2017", 0, few=True), ["x1_um"])
    found = stepwise2017_setup._thinned(warm, warm, 4)
    assert found.first == pytest.approx(100 / (100 + found.rows - 2), rel=1e-12)
    online = stack(_of("stepwise2017-online", 0, few=True), ["x1_um"], HEAT)
    some = stack(_of("stepwise2017", 0, few=True), ["x1_um"], HEAT)
    fourth = some.take(np.arange(0, len(some), 4))
    found = stepwise2017_setup._thinned(some, online, 4)
    chosen = PartialF(f_enter=100.0, f_delete=50.0).fit(fourth.frame(), fourth.deviations[:, 0])
    residual = fourth.deviations[:, 0] - chosen.predict(fourth.frame())
    assert (found.rows, found.names) == (len(fourth), chosen.terms_)
    assert found.effective == pytest.approx(effective_sample_size(residual))
    error = online.deviations[:, 0] - chosen.predict(online.frame())
    assert found.rms == pytest.approx(np.sqrt(np.mean(error**2)), rel=0.03)  # the zero is a mean over five minutes


@pytest.mark.usefixtures("quick")
def test_a_drift_of_many_temperatures_refutes_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """T-07 can fail: here eight temperatures count."""
    monkeypatch.setattr(stepwise2017_setup, "record", lambda e, *, seed: _of(e, seed, few=False))
    study = stepwise2017.run(0, tell_nobody)
    many = claim(study, "T-07")
    assert many.holds is False
    assert many.ours.startswith("8: ")
    assert "F grows with the number of rows" in many.finding


@pytest.mark.usefixtures("quick")
def test_the_online_test_is_another_recording(monkeypatch: pytest.MonkeyPatch) -> None:
    """T-09: learned from one experiment, judged on the other."""
    asked: list[str] = []

    def made(experiment: str, *, seed: int) -> list[Recording]:
        asked.append(experiment)
        return _of(experiment, seed, few=True)

    monkeypatch.setattr(stepwise2017_setup, "record", made)
    monkeypatch.setattr(stepwise2017_setup, "THINNED", (1,))
    told: list[float] = []
    c = stepwise2017_setup.compute(0, lambda share, _: told.append(share))
    methods = [0.2 + 0.07 * k for k in range(len(stepwise2017_setup.METHODS))]
    assert told == pytest.approx([0.0, 0.1, *methods, 0.8, 0.95])
    # temperatures as they are, not their changes
    raw, new = (
        stack(
            _of(e, 0, few=True), ["x1_um"], [i.name for i in c.fit.inputs if i.quantity == "temperature"], rezero=False
        )
        for e in ("stepwise2017", "stepwise2017-online")
    )
    absolute = PartialF(f_enter=100.0, f_delete=50.0).fit(raw.frame(), raw.deviations[:, 0])
    left = new.deviations[:, 0] - absolute.predict(new.frame())
    assert c.absolute == pytest.approx(np.sqrt(np.mean(left**2)))
    assert asked == ["stepwise2017", "stepwise2017-online"]
    for samples, name in zip((c.fit, c.online), asked, strict=True):
        (test,) = _of(name, 0, few=True)
        changes = np.diff(test.table["x1_um"])
        np.testing.assert_allclose(np.diff(samples.deviations[:, 0]), changes, atol=1e-9)
    # what is judged is the error in the second, the residual by the exported program
    np.testing.assert_allclose(c.left_exported, c.left[stepwise2017_setup.STEPWISE], rtol=0, atol=1e-9)
    np.testing.assert_array_equal(c.left[stepwise2017_setup.NONE], c.online.deviations[:, 0])
    np.testing.assert_array_equal(c.left_in_fit[stepwise2017_setup.NONE], c.fit.deviations[:, 0])


@pytest.mark.parametrize("compiler", ["", "cc"])
def test_the_exported_program_predicts_as_the_model(monkeypatch: pytest.MonkeyPatch, compiler: str) -> None:
    """T-09: as C or, where there is no compiler, as its twin; not by the model that was exported."""
    if compiler and not shutil.which(compiler):
        pytest.skip("there is no C compiler")
    monkeypatch.setattr(exported.shutil, "which", lambda name: compiler if name == compiler else None)  # type: ignore[attr-defined]
    fit, online = (
        common.stacked(_of(e, 0, few=True), ["x1_um"], HEAT) for e in ("stepwise2017", "stepwise2017-online")
    )
    model = common.fit_and_freeze(PartialF(), fit, ["x1_um"])["x1_um"]
    found, by = exported.predict_exported(model, online)
    assert by == ("the C code (cc)" if compiler else "its Python twin")
    np.testing.assert_allclose(found, common.predict_deviation(model, online), rtol=0, atol=1e-9)
    assert np.ptp(found) > 10


@pytest.mark.parametrize(("size", "holds", "drift"), [(6.0, False, 30.0), (4.0, True, 30.0), (4.0, True, 9.0)])
def test_the_bound_is_five_um(size: float, holds: bool, drift: float) -> None:
    """T-08: of a drift everything is left but one reading, which stays within the bound or not."""
    x = np.linspace(0.0, drift, 60)
    left = np.where(np.arange(60) == 30, size, 0.5)
    errors = {stepwise2017_setup.NONE: Errors.of(x)}
    fitted = Errors.of(left)
    found = SimpleNamespace(errors=errors, left_exported=left, on_dsp=fitted, fitted=fitted, exported_by="C")
    (claim,) = stepwise2017.claims.judged("bounded", found)  # type: ignore[arg-type]
    assert claim.holds is holds
    assert ("this proves little" in claim.finding) is (drift < 10.0)
