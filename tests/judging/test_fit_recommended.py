"""`fit` writes what `compare` recommends, for each target, in one file that every command takes."""

from pathlib import Path

import pytest
from smallmachine import small_machine

import thermocomp as tc
from thermocomp.api.results import Compared, FittedModels
from thermocomp.core.exceptions import InputError
from thermocomp.files import modelfile
from thermocomp.runtime.compensator import Compensator

METHODS = ["ols", "partial-f", "dynamic"]
TARGETS = ["z_um", "x_um"]


@pytest.fixture(scope="module")
def compared() -> Compared:
    return tc.compare(small_machine(dt=200.0), TARGETS, METHODS, jobs=1)


@pytest.fixture(scope="module")
def mixed() -> FittedModels:
    return tc.fit(small_machine(dt=200.0), TARGETS, ["partial-f", "z_um=dynamic"], jobs=1)


def test_fit_and_compare_agree_on_every_target(compared: Compared) -> None:
    fitted = tc.fit(small_machine(dt=200.0), TARGETS, METHODS, jobs=1)
    assert None not in compared.best.values()
    for result in (fitted, compared.fit()):
        for target, model in result.models.items():
            judged, honest = compared.comparison.written(target), model.honest_error
            assert model.provenance is not None
            assert judged is not None
            assert honest is not None
            assert model.provenance.method == compared.best[target] == judged.model
            assert (honest.word, honest.rms, honest.tried) == (judged.word, judged.metric("rms"), len(METHODS))
            assert honest.reason == judged.reason
            assert honest.lost.items() >= judged.robustness.lost_rms.items()  # type: ignore[union-attr]
    assert compared.fit().models == fitted.models


def test_a_method_given_for_one_target_leaves_the_others_as_recommended(compared: Compared) -> None:
    by_words = tc.fit(small_machine(dt=200.0), TARGETS, [*METHODS, "x_um=partial-f"], jobs=1)
    assert compared.best["x_um"] != "partial-f"
    for fitted in (by_words, compared.fit({"x_um": "partial-f"})):
        assert list(fitted.to_frame()["model"]) == [compared.best["z_um"], "partial-f"]
        honest = fitted.models["x_um"].honest_error
        assert honest is not None
        assert honest.tried == 1  # chosen before the evaluation
    with pytest.raises(InputError, match=r"a model for 'y_um', which is not a target; the targets are z_um, x_um"):
        tc.fit(small_machine(dt=200.0), TARGETS, {"y_um": "ols"})


def test_with_none_accepted_the_least_bad_is_written_as_what_it_is() -> None:
    """Two cycles prove nothing: the model is unproven, and so it is in the file."""
    found = tc.compare(small_machine((1000.0, 2500.0), dt=200.0), "z_um", METHODS, jobs=1)
    assert found.best == {"z_um": None}
    honest = found.fit().model.honest_error
    assert honest is not None
    assert honest.word == "unproven"
    open_ones = [a.metric("rms") for a in found.comparison.overall() if a.word == "unproven"]
    assert honest.rms == min(open_ones)
    assert honest.lost  # tested as written, although not accepted
    only = tc.compare(small_machine((1000.0, 2500.0), dt=200.0), "z_um", "gp", jobs=1)
    with pytest.raises(InputError, match="z_um: no method could be fitted and judged that can be stored"):
        only.fit()


def test_a_file_of_several_methods_is_taken_everywhere(mixed: FittedModels, tmp_path: Path) -> None:
    file, again = tmp_path / "model.json", small_machine((2200.0, 1200.0), seed=3, dt=200.0)
    mixed.save(file)
    assert [m.provenance.method for m in modelfile.read(file) if m.provenance] == ["dynamic", "partial-f"]
    assert list(tc.assess(file, again).to_frame()["model"]) == ["dynamic", "partial-f"]
    told = str(tc.explain(file))
    assert "z_um [um]: predicted by dynamic" in told
    assert "x_um [um]: predicted by partial-f" in told
    live = Compensator.of(modelfile.read(file))
    assert list(live.lines) == TARGETS
    assert not live.shadow
    exported = tc.export(file, "c99")
    assert exported.verdict == "z_um, x_um: accepted on unseen cycles"
    assert any(b"x_um" in text for text in exported.files.values())
