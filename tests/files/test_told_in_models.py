"""A model file tells the header data of its recordings, and how noisy its correction is; `fit` and `export` warn."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from smallmachine import small_machine

import thermocomp as tc
from thermocomp.cli.app import run
from thermocomp.core.provenance import NOISY
from thermocomp.files import modelfile
from thermocomp.recordings.declared import Declared, HeaderData
from thermocomp.recordings.readers import recordings


def test_header_data_reach_the_model_explain_and_the_page(tmp_path: Path) -> None:
    test = HeaderData(machine="VMC 3", serial="4711", instrument="probe, certificate 12")
    both = [replace(small_machine(seed=seed, dt=200.0), declared=Declared(test)) for seed in (0, 1)]
    fitted = tc.fit(both, "z_um", "ols", leave_one="cycle", jobs=1)
    (model,) = modelfile.read(fitted.save(tmp_path / "model.json"))
    assert model == fitted.model
    assert model.provenance is not None
    assert model.provenance.tests == (test.stated(),)  # once for both
    assert f"Recorded with: {test}." in str(tc.explain(model)).splitlines()
    found = tc.assess(model, small_machine((2200.0, 1200.0), seed=3, dt=200.0))
    assert f"Models fitted to: {test}" in found.report(tmp_path / "page.html").read_text("utf-8")


def test_what_is_not_known_is_not_in_the_file(tmp_path: Path) -> None:
    """A file of a model without header data and noise is that of an earlier version."""
    fitted = tc.fit(small_machine(dt=200.0), "z_um", "ols", noise=0.0, jobs=1)
    (entry,) = json.loads(fitted.save(tmp_path / "model.json").read_text())["models"]
    assert "tests" not in entry["provenance"]
    assert not {"noise", "scatter"} & {*entry["honest_error"]}


@pytest.mark.parametrize("noise", [0.02, 1.0])
def test_a_noisy_correction_is_told_before_it_is_used(
    noise: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    recordings.write(small_machine(dt=200.0), tmp_path / "drift.csv")
    run(f"fit drift.csv --target z_um --model ols --noise {noise} --jobs 1 -o model.json".split())
    fit = " ".join(capsys.readouterr().out.split())
    run(["export", "model.json", "--to", "c99", "-o", "code"])
    export = capsys.readouterr().out
    (model,) = modelfile.read(tmp_path / "model.json")
    assert model.honest_error is not None
    assert model.accepted
    # of a linear model without memory: noise times the root of the sum of the squared gains (of models without a cycle)
    gains = list(model.coefficients_by_name().values())
    expected = noise * sum(g**2 for g in gains) ** 0.5
    assert model.honest_error.scatter == pytest.approx(expected, rel=0.25)
    told = (
        f"Warning: z_um: noisy correction: noise of {noise:.2g} degC moves it by {model.honest_error.scatter:.2g} RMS"
    )
    loud = model.honest_error.scatter > NOISY * model.honest_error.none_rms
    assert loud == (noise == 1.0)
    assert (told in fit) == loud
    assert [told in line for line in export.splitlines()].count(True) == loud
