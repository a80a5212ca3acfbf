"""What fails in one method, target, model or study is refused with its reason; the others have their results."""

import os
import signal
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from numpy.typing import ArrayLike
from smallmachine import small_machine

from thermocomp.core.exceptions import FitError, InputError
from thermocomp.judging import assessing, refit, selecting, splits, study
from thermocomp.judging.choice import Settings
from thermocomp.judging.compare import compare
from thermocomp.judging.pieces import work_through
from thermocomp.judging.results import Assessment
from thermocomp.models import training
from thermocomp.models.methods import METHODS, deployable
from thermocomp.models.ols import LeastSquares
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack

ERRORS = [
    InputError("of the settings"),
    FitError("too few"),
    np.linalg.LinAlgError("Singular matrix"),
    MemoryError(),
    ZeroDivisionError("by zero"),
    SystemExit(3),
    RecursionError("too deep"),
    UserWarning("as an error"),
]


def fails(error: BaseException) -> Callable[..., Any]:
    def raised(*_: Any, **__: Any) -> Any:
        raise error

    return raised


@pytest.fixture(scope="module")
def one(recording: Recording) -> Samples:
    return stack([recording], ["z_um"]).take(np.arange(0, len(recording), 3))


@pytest.fixture(scope="module")
def alone(one: Samples) -> dict[str, Assessment]:
    """Methods that are judged by themselves."""
    judging = splits.parse("0.75/0.25", one)
    return {name: compare(one, [name], judging, robustness=False).overall()[0] for name in ("ols", "dynamic")}


@pytest.mark.parametrize("where", ["fit", "predict", "freeze"])
@pytest.mark.parametrize("name", sorted(METHODS))
def test_no_method_stops_the_others(
    name: str, where: str, one: Samples, alone: dict[str, Assessment], monkeypatch: pytest.MonkeyPatch
) -> None:
    judging, other = splits.parse("0.75/0.25", one), "ols" if name != "ols" else "dynamic"
    kind = METHODS[name].kind
    error = ERRORS[(sorted(METHODS).index(name) + len(where)) % len(ERRORS)]
    with monkeypatch.context() as patched:
        patched.setattr(kind, "unfrozen" if where == "freeze" and not deployable(name) else where, fails(error))
        failed, kept = compare(one, [name, other], judging, robustness=False).overall()
    assert failed.word == "refused"
    assert (str(error) or "Memory") in failed.reason
    assert not kept.failure
    np.testing.assert_array_equal(kept.predicted, alone[other].predicted)


@pytest.mark.parametrize("error", ERRORS, ids=lambda e: type(e).__name__)
def test_no_error_stops_a_comparison(error: BaseException, one: Samples, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also in the choice among methods, and when what is accepted is fitted to all rows."""
    judging = splits.leave_one_cycle_out(one)
    monkeypatch.setattr(LeastSquares, "fit", fails(error))
    found = compare(one, ["ols", "dynamic"], judging)
    assert [a.word for a in found.overall()] == ["refused", "accepted"]
    assert [r.method for r in found.recommended] == ["dynamic"]
    monkeypatch.setattr(refit, "train", fails(error))
    unsure = compare(one, ["dynamic"], judging).overall()
    assert [a.word for a in unsure] == ["unproven"]
    assert "cannot be fitted to all rows" in unsure[0].reason


class Deadly(LeastSquares):
    """Kills the process that fits it."""

    def fit(self, X: ArrayLike, y: ArrayLike) -> "Deadly":
        if os.getpid() == int(os.environ["SPARED"]):
            raise RuntimeError("it is fitted in the main process")
        os.kill(os.getpid(), signal.SIGKILL)
        return self


class Unsendable(LeastSquares):
    """Cannot be sent to another process."""

    def __getstate__(self) -> Any:
        raise TypeError("cannot pickle it")


def test_a_killed_process_costs_its_method_alone(one: Samples, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SPARED", str(os.getpid()))
    judging = splits.parse("0.75/0.25", one)
    alone = compare(one, ["ols", "dynamic"], judging, robustness=False)
    told: list[str] = []
    found = compare(
        one, ["ols", Deadly(), "dynamic", Unsendable()], judging, robustness=False, jobs=2, progress=told.append
    )
    assert len(told) == 4
    first, deadly, last, unsendable = found.overall()
    assert deadly.reason == (
        "could not be judged: its process ended: it crashed, or was killed by the system, for example "
        "because the memory is full"
    )
    assert "Could not pickle the task" in unsendable.reason
    for mine, theirs in zip((first, last), alone.overall(), strict=True):
        np.testing.assert_array_equal(mine.predicted, theirs.predicted)


def once(piece: tuple[int, Path]) -> int:
    """Die the first time, as of a memory that others had filled."""
    number, seen = piece
    if number == 3 and not seen.exists():
        seen.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def lost(piece: tuple[int, Path], why: str) -> int:
    raise AssertionError(f"{piece}: {why}")


def test_a_process_that_dies_once_costs_nothing(tmp_path: Path) -> None:
    pieces = [(k, tmp_path / "seen") for k in range(12)]
    assert list(work_through(once, pieces, lost, jobs=2)) == list(range(12))


def test_the_keyboard_still_stops_it(one: Samples, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(LeastSquares, "fit", fails(KeyboardInterrupt()))
    with pytest.raises(KeyboardInterrupt):
        compare(one, ["ols"], splits.parse("0.75/0.25", one))


@pytest.mark.parametrize("method", ["grouping", "partial-f", "stepwise", "subsets", "pareto"])
def test_a_target_without_a_choice_leaves_the_others(method: str, samples: Samples) -> None:
    still = replace(samples, deviations=samples.deviations * [0.0, 1.0])
    judging = splits.leave_one_cycle_out(samples)
    settings = Settings(models=["ols"], max_sensors=2) if method == "pareto" else Settings()
    failed, chosen = selecting.select(method, still, judging, settings)
    assert (failed.target, failed.sensors) == ("z_um", ())
    assert failed.reason == "no sensors could be selected: z_um is constant; name a target that changes"
    assert chosen.sensors
    assert not chosen.failure
    with pytest.raises(FitError, match="z_um is constant"):
        selecting.select(method, replace(samples, deviations=samples.deviations * 0.0), judging, settings)


def test_a_model_that_fails_on_the_way_to_few_sensors(samples: Samples, monkeypatch: pytest.MonkeyPatch) -> None:
    judging, train = splits.leave_one_cycle_out(samples), training.train

    def some(name: str, *arguments: Any, **how: Any) -> Any:
        if name == "ols":
            raise MemoryError
        return train(name, *arguments, **how)

    monkeypatch.setattr("thermocomp.judging.budget.train", some)
    settings = Settings(models=["ols", "dynamic"], max_sensors=2)
    (choice,) = selecting.select("pareto", samples, judging, settings)
    assert choice.reason.startswith("dynamic with")
    assert "Some numbers of sensors could not be judged: ols: the memory is full (MemoryError)" in choice.notes
    with pytest.raises(FitError, match="could be judged in every block: ols: the memory is full"):
        selecting.select("pareto", samples, judging, Settings(models=["ols"], max_sensors=2))


def test_a_model_that_cannot_be_assessed_leaves_the_others(recording: Recording, samples: Samples) -> None:
    models = study.fit(samples, "ols", splits.leave_one_cycle_out(samples)).models
    unseen = small_machine((2200.0, 1200.0, 1700.0, 2500.0), seed=5)
    channels = tuple(c for c in unseen.channels if c.name != "x_um")
    poorer = replace(unseen, table=pd.DataFrame(unseen.table.drop(columns="x_um")), channels=channels)
    good, failed = assessing.assess(models, [poorer]).overall()
    assert (good.target, failed.target, failed.word) == ("z_um", "x_um", "refused")
    assert "could not be judged: " in failed.reason
    assert "no channel is named 'x_um'" in failed.reason
    assert good.metric("rms") == assessing.assess(models[:1], [poorer]).overall()[0].metric("rms")
    with pytest.raises(InputError, match="no channel is named 'x_um'"):
        assessing.assess(models[1:], [poorer])
