"""The top of the package: what is there, how little it loads, and the main job through it."""

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray
from reviseruns import PLATE
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.ensemble import HistGradientBoostingRegressor, RandomForestRegressor
from sklearn.pipeline import make_pipeline
from smallmachine import small_machine

import thermocomp as tc
from thermocomp.api.base import Result
from thermocomp.api.results import Assessed, Compared, FittedModels
from thermocomp.api.select import Selected, SelectionMethod
from thermocomp.core.exceptions import InputError
from thermocomp.judging import splits
from thermocomp.judging.compare import compare as own_compare
from thermocomp.models.methods import METHODS
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.stacking import stack

FAST = ("ols", "partial-f")


def test_importing_it_loads_next_to_nothing() -> None:
    code = (
        "import sys, thermocomp\n"
        "thermocomp.ErrorModel, thermocomp.Polynomial\n"
        "print([m for m in sys.modules if m.split('.')[0] in ('pandas', 'sklearn', 'scipy', 'matplotlib', 'numba', "
        "'joblib', 'rich', 'cyclopts', 'pydantic') or m.startswith(('thermocomp.models', 'thermocomp.api'))])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def typed_names() -> Iterator[str]:
    """Yield the names that type checkers see."""
    tree = ast.parse(Path(tc.__file__).read_text(encoding="utf-8"))
    for node in (n for part in tree.body if isinstance(part, ast.If) for n in ast.walk(part)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("thermocomp."):
            yield from (name.name for name in node.names)


def test_every_name_is_there_and_every_method() -> None:
    for name in tc.__all__:
        assert getattr(tc, name) is not None
    assert set(dir(tc)) == set(tc.__all__)
    assert set(tc.__all__) == {*tc._PUBLIC, "__version__"} == {*typed_names(), "__version__"}
    assert {m.kind.__name__ for m in METHODS.values()} <= set(tc.__all__)
    with pytest.raises(AttributeError, match="no attribute 'compere'"):
        tc.compere  # noqa: B018


# -- the main job ------------------------------------------------------------------------------------------------------


def test_three_kinds_of_models_in_one_comparison(recording: Recording) -> None:
    """HistGradientBoostingRegressor, a Pipeline and a class of one's own: fewer than fifteen lines."""

    class Mean(RegressorMixin, BaseEstimator):  # type: ignore[misc]
        def fit(self, X: ArrayLike, y: ArrayLike) -> "Mean":
            self.mean_ = np.mean(np.asarray(y))
            return self

        def predict(self, X: pd.DataFrame) -> NDArray[np.float64]:
            return np.full(len(X), self.mean_)

    pipeline = make_pipeline(tc.SensorSelector("partial-f"), tc.LeastSquares())
    found = tc.compare(recording, "z_um", ["ols", HistGradientBoostingRegressor(max_iter=5), pipeline, Mean()])
    table = found.to_frame().set_index("model")
    assert set(table.index) == {"ols", "HistGradientBoostingRegressor", "SensorSelector + LeastSquares", "Mean"}
    assert not table.loc["HistGradientBoostingRegressor", "deployable"]
    assert table.loc["SensorSelector + LeastSquares", "deployable"]
    assert (table["none_rms"] > 15).all()
    ours = own_compare(stack([recording], ["z_um"]), ["ols"], splits.leave_one_cycle_out(stack([recording], ["z_um"])))
    assert table.loc["ols", "rms"] == pytest.approx(ours.overall()[0].metric("rms"), rel=1e-12)


def test_residuals_are_a_table_and_a_recording_a_figure(recording: Recording) -> None:
    found = tc.compare(recording, ["z_um", "x_um"], "ols", robustness=False)
    table = found.residuals()
    assert table.columns.tolist() == ["target", "model", "recording", "time_s", "measured", "predicted", "residual"]
    for (target, _), part in table.groupby(["target", "model"]):
        (row,) = found.to_frame().query("target == @target")["rms"]
        assert np.sqrt((part["residual"] ** 2).mean()) == pytest.approx(row)
        at = np.searchsorted(recording.time, part["time_s"])
        assert np.array_equal(recording.time[at], part["time_s"])
        measured = recording.table[target].to_numpy()[at]
        assert np.allclose(np.diff(part["measured"]), np.diff(measured))
    panels = recording.plot().axes
    assert [ax.get_ylabel() for ax in panels] == ["temperature [degC]", "spindle speed [1/min]", "displacement [um]"]
    assert [len(ax.lines) for ax in panels] == [3, 1, 2]


@pytest.fixture(scope="module")
def results() -> dict[str, Result]:
    """Each kind of result, of the same small machine."""
    test = small_machine(dt=200.0)
    fitted = tc.fit(test, ["z_um", "x_um"], "ols")
    return {
        "compare": tc.compare(test, models=FAST),
        "fit": fitted,
        "assess": tc.assess(fitted, small_machine((2000.0, 1500.0), seed=3)),
        "select": tc.select(test, "z_um", "grouping", threshold=0.95),
    }


@pytest.mark.parametrize("name", ["compare", "fit", "assess", "select"])
def test_every_result_is_a_table_a_figure_and_a_sentence(name: str, results: dict[str, Result]) -> None:
    found = results[name]
    table = found.to_frame()
    assert len(table) == {"compare": 4, "fit": 2, "assess": 2, "select": 1}[name]
    assert isinstance(found.plot(), Figure)
    assert len(repr(found)) < 700
    assert repr(found).startswith(f"<{type(found).__name__}: ")
    assert "array(" not in repr(found)
    html = found._repr_html_()
    assert html.count("<tr") == len(table) + 1
    assert str(table["target"].iloc[0]) in html


def test_comparison(results: dict[str, Result], tmp_path: Path) -> None:
    found = results["compare"]
    assert isinstance(found, Compared)
    assert list(found.best) == ["z_um", "x_um"]
    assert found.best["z_um"] in FAST
    table = found.to_frame()
    assert table["target"].tolist() == ["z_um", "z_um", "x_um", "x_um"]
    assert (table.groupby("target")["rms"].diff().dropna() >= 0).all()
    assert len(found.to_frame(blocks=True)) == 4 * 5
    assert isinstance(found.plot("z_um", "ols"), Figure)
    with pytest.raises(InputError, match="no dynamic for z_um; there are ols for z_um"):
        found.plot("z_um", "dynamic")
    assert "<svg" in found.report(tmp_path / "report.html").read_text(encoding="utf-8")


def test_the_verdict_is_that_of_the_command(recording: Recording) -> None:
    samples = stack([recording], ["z_um", "x_um"])
    ours = own_compare(samples, ["ols", "dynamic"], splits.leave_one_cycle_out(samples)).overall()
    table = tc.compare(recording, ["z_um", "x_um"], ["ols", "dynamic"]).to_frame().set_index(["target", "model"])
    assert [(a.word, a.reason) for a in ours] == [
        tuple(table.loc[(a.target, str(a.model)), ["verdict", "reason"]]) for a in ours
    ]
    assert ours[0].word == "accepted"


def test_nothing_is_accepted_that_was_not_tried_with_noise(recording: Recording) -> None:
    found = tc.compare(recording, "z_um", "ols", robustness=False)
    untried = "the effects of noise and of a lost sensor were not tested: compare with robustness=True"
    assert found.to_frame()[["verdict", "reason"]].to_numpy().tolist() == [["unproven", untried]]
    assert found.best == {"z_um": None}
    assert str(found) == f"No model may run yet for z_um: {untried}."


def test_one_where_several_may_be(recording: Recording) -> None:
    alone = tc.compare(recording, "z_um", RandomForestRegressor(2), inputs="t1_C", robustness=False).to_frame()
    assert alone[["model", "sensors"]].to_numpy().tolist() == [["RandomForestRegressor", 1]]
    assert tc.training_table(recording, "z_um", inputs="t1_C").X.columns.tolist() == ["t1_C"]
    with pytest.raises(InputError, match="no model given: name at least one method"):
        tc.compare(recording, "z_um", [])
    with pytest.raises(InputError, match="no model given: name a model file"):
        tc.assess([], recording)
    with pytest.raises(InputError, match="int is not a regressor"):
        tc.compare(recording, "z_um", 3)


def test_fit_and_assess_take_what_the_commands_take(recording: Recording) -> None:
    tight = tc.Limits(magnitude=5.0)
    fitted = tc.fit(recording, "z_um", "ols", harm_margin=0.5, limits=tight)
    (whole,) = fitted.fitted.comparison.overall()
    other = small_machine((2000.0, 1500.0), seed=3)
    (judged,) = tc.assess(fitted, other, harm_margin=0.5, limits=tight).judged.overall()
    for a in (whole, judged):
        assert a.limits == tight
        assert {u.margin for u in a.verdict.units} == {0.5}
    weather = recording.to_frame().rename(columns={"t3_C": "t_ambient_C"})
    validity = tc.fit(weather, "z_um", "ols", inputs=["t1_C", "t2_C"]).model.validity
    assert validity is not None
    assert validity.ambient_channel == "t_ambient_C"  # which no model uses: the recordings tell it


def test_how_a_recording_begins(recording: Recording) -> None:
    before, after = small_machine((1000.0, 2500.0, 2000.0), seed=1), small_machine((3000.0, 1500.0, 2200.0), seed=2)
    went_on = tc.Start("continued", earlier=(before,), gap=60.0)
    rezeroed = tc.Start("rezeroed")
    for starts, words in ((rezeroed, ["rezeroed"]), ([went_on], ["continued"]), (None, ["cold"])):
        assert [s.word for _, s in tc.compare(after, "z_um", "ols", starts=starts).comparison.starts] == words
    fitted = tc.fit(after, "z_um", "ols", starts=rezeroed)
    assert fitted.model.provenance is not None
    assert fitted.model.provenance.starts == ("rezeroed",)
    judged = tc.assess(fitted, [after, recording], starts=[rezeroed, tc.Start()]).judged
    assert [s.word for _, s in judged.starts] == ["rezeroed", "cold"]
    warm = after.to_frame().assign(z_um=lambda t: t["z_um"] + 50.0)
    with pytest.raises(InputError, match=r"z_um begins at 49.*In Python: starts=Start"):
        tc.select(warm, "z_um", "partial-f")
    assert tc.select(warm, "z_um", "partial-f", starts=rezeroed).sensors["z_um"]
    for wrong, message in (
        ([rezeroed], r"starts: 1 given for 2 recording\(s\): give one for each, or one for all"),
        (went_on, "starts: 2 recordings cannot all continue from the same files"),
        ([tc.Start(), tc.Start("continued", earlier=(after,))], "small cannot continue from itself"),
    ):
        with pytest.raises(InputError, match=message):
            tc.compare([before, after], "z_um", "ols", starts=wrong)


def test_report_of_a_handed_in_estimator(recording: Recording, tmp_path: Path) -> None:
    found = tc.compare(recording, "z_um", [tc.Ridge(strengths=(0.1,)), "gp"], split="0.5/0.5", robustness=True)
    assert "an estimator supplied by the user" in found.report(tmp_path / "r.html").read_text(encoding="utf-8")


def test_fitted_models(results: dict[str, Result], tmp_path: Path) -> None:
    found, test = results["fit"], small_machine(dt=200.0)
    assert isinstance(found, FittedModels)
    with pytest.raises(InputError, match=r"there are several models, of z_um, x_um: use one of \.models"):
        found.model  # noqa: B018
    predicted = found.predict(test.to_frame())
    assert list(predicted) == ["z_um", "x_um"]
    expected = found.fitted.estimators[0].predict(stack([test], ["z_um"]).frame()[["t1_C", "t2_C", "t3_C"]])
    np.testing.assert_allclose(predicted["z_um"], expected, atol=1e-9)
    judged = tc.assess(found.save(tmp_path / "m.json"), small_machine((2000.0, 1500.0), seed=3))
    other = results["assess"]
    assert isinstance(other, Assessed)
    assert judged.to_frame()["rms"].tolist() == other.to_frame()["rms"].tolist()
    assert len(other.to_frame(blocks=True)) == 6
    again = tc.assess(found.models["z_um"], test)
    assert "not a test on unseen data: fitted to small" in str(again)


def test_selection(results: dict[str, Result], recording: Recording) -> None:
    found = results["select"]
    assert isinstance(found, Selected)
    assert set(found.sensors["z_um"]) <= {"t1_C", "t2_C", "t3_C"}
    methods: dict[SelectionMethod, str] = {
        "partial-f": "1 - R2",
        "subsets": "RMS on left-out cycles [um]",
        "ace": "1 - mean Psi z_um",
    }
    for method, shown in methods.items():
        (axes,) = tc.select(recording, "z_um", method).plot().axes
        assert axes.get_xlabel() == shown
        assert len(axes.get_lines()) == len(axes.get_yticklabels()) > 0
    for wrong, message in (
        ({"method": "best"}, "method 'best': expected pareto"),
        ({"threshold": 0.5}, "--threshold is for --method grouping"),
        ({"sensors": 3}, "unexpected keyword argument 'sensors'; the settings are threshold"),
    ):
        with pytest.raises(InputError, match=message):
            tc.select(recording, "z_um", **wrong)


def test_recordings_come_as_anything(recording: Recording, tmp_path: Path) -> None:
    from thermocomp.recordings.readers.recordings import write

    write(recording, tmp_path / "r.csv")
    ways: list[Any] = [
        recording,
        str(tmp_path / "r.csv"),
        [tmp_path / "r.csv"],
        recording.to_frame(),
        tc.read(tmp_path / "r.csv"),
    ]
    found = [tc.compare(w, "z_um", "ols", split="0.75/0.25").to_frame()["rms"].item() for w in ways]
    assert found == pytest.approx([found[0]] * len(ways), rel=1e-9)
    files: list[Any] = [small_machine((1000.0, 2500.0), seed=1), small_machine((3000.0, 1500.0), seed=2).to_frame()]
    assert len(tc.compare(files, "z_um", ["ols"], leave_one="file").to_frame(blocks=True)) == 3
    with pytest.raises(InputError, match="no recording given"):
        tc.compare([])
    with pytest.raises(InputError, match="int is not a recording: give a Recording, a path or a DataFrame"):
        tc.compare([3])  # type: ignore[list-item]
    with pytest.raises(InputError, match="split and leave_one exclude each other"):
        tc.compare(recording, split="0.5/0.5", leave_one="cycle")
    with pytest.raises(InputError, match="leave_one 'week': expected 'cycle', 'day' or 'file'"):
        tc.compare(recording, leave_one="week")  # type: ignore[arg-type]


def test_tables_tell_their_days() -> None:
    def table(day: int) -> pd.DataFrame:
        made = small_machine((1000.0, 2500.0), seed=day).to_frame()
        stamps = pd.Timestamp(f"2026-03-{27 + day}T08:00", tz="Europe/Berlin") + pd.to_timedelta(
            made.pop("time_s"), "s"
        )
        return made.set_index(pd.DatetimeIndex(stamps))

    found = tc.compare([table(day) for day in range(4)], "z_um", ["ols"], leave_one="day")
    assert len(found.to_frame(blocks=True)) == 4 + 1


def test_trouble_is_told(recording: Recording) -> None:
    table = recording.to_frame()
    table.loc[400:, "t2_C"] = 22.0
    found = tc.compare(table, "z_um", ["ols"], split="0.75/0.25")
    assert found.trouble
    assert "Trouble: table: t2_C" in repr(found)


def test_of_two_spindle_speeds_the_first_is_taken_and_the_other_named(recording: Recording) -> None:
    table = recording.to_frame().assign(second_rpm=lambda t: t["spindle_rpm"] / 2)
    found = tc.fit(table, "z_um", "ols")
    assert "second_rpm" not in found.model.sensors
    said = "table: second_rpm left out: of several spindle speeds only the first, spindle_rpm, is an input; name"
    assert any(line.startswith(said) for line in found.trouble)
    named = tc.fit(table, "z_um", "ols", inputs=["t1_C", "second_rpm"])
    assert not any("second_rpm" in line for line in named.trouble)
    assert not any("spindle speeds" in line for line in tc.fit(recording, "z_um", "ols").trouble)


def test_simulate() -> None:
    (found,) = tc.simulate("demo", seed=3)
    assert len(found.cycles) > 1
    with pytest.raises(InputError, match="no experiment 'demos'"):
        tc.simulate("demos")


def test_what_cannot_be_frozen_is_not_fitted(recording: Recording) -> None:
    with pytest.raises(InputError, match="HistGradientBoostingRegressor cannot be stored as coefficients"):
        tc.fit(recording, "z_um", HistGradientBoostingRegressor())
    with pytest.raises(InputError, match="treats every row as a steady state"):
        tc.compare(recording, "z_um", [tc.DynamicRidge(time="none")])
    # found out in its fit: the others have their results
    still = make_pipeline(tc.SensorSelector(), tc.DynamicRidge(time="none"))
    table = tc.compare(recording, "z_um", [still, "ols"]).to_frame().set_index("model")
    assert "treats every row as a steady state" in table["reason"]["SensorSelector + DynamicRidge"]
    assert np.isfinite(table["rms"]["ols"])


def test_a_fitted_pipeline(recording: Recording) -> None:
    pipeline = make_pipeline(tc.SensorSelector("partial-f"), tc.LeastSquares())
    fitted = tc.fit(recording, "z_um", pipeline)
    assert fitted.model.family == "polynomial"
    assert fitted.model.provenance is not None
    assert fitted.model.provenance.method == "SensorSelector + LeastSquares"


# -- revise ------------------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("job_folder")
def test_revise() -> None:
    done = tc.revise(
        "part.ngc", "model.json", "out.ngc", controller="linuxcnc", cold=True, unproved=True, date="2026-01-31"
    )
    assert done.written
    assert all(p.exists() for p in done.files)
    assert Path("out.ngc").read_text(encoding="ascii") != PLATE
    assert done.summary["files"]
    with pytest.raises(InputError, match="exists already"):
        tc.revise("part.ngc", "model.json", "out.ngc", controller="linuxcnc", cold=True, unproved=True)
    with pytest.raises(InputError, match="no option 'colde'; the nearest are cold"):
        tc.revise("part.ngc", "model.json", "out2.ngc", controller="linuxcnc", colde=True)
    with pytest.raises(InputError, match="the initial thermal state of the machine is"):
        tc.revise("part.ngc", "model.json", "out2.ngc", controller="linuxcnc", unproved=True)
    assert not Path("out2.ngc").exists()
