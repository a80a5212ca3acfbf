"""Training of a method on selected rows."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator, clone
from sklearn.metrics import r2_score

from thermocomp import __version__
from thermocomp.core.arrays import BoolArray, FloatArray
from thermocomp.core.band import Band
from thermocomp.core.exceptions import FitError
from thermocomp.core.inputs import Support
from thermocomp.core.joint import JointSupport
from thermocomp.core.model import ErrorModel
from thermocomp.core.provenance import Provenance
from thermocomp.core.thresholds import THRESHOLDS
from thermocomp.models.bands import find_band
from thermocomp.models.base import ThermalRegressor
from thermocomp.models.covering import find_joint_support
from thermocomp.models.foreign import catch_failures, check_numbers
from thermocomp.models.method import Method
from thermocomp.models.methods import expand, find_method
from thermocomp.models.timed import TimedRegressor
from thermocomp.models.unfrozen import UnfrozenRegressor
from thermocomp.recordings.fingerprints import fingerprint
from thermocomp.recordings.samples import Samples


@dataclass(frozen=True)
class Trained:
    """A fitted estimator and its frozen model.

    Parameters
    ----------
    model : ErrorModel
        Frozen model, unless the method cannot be frozen: see `thermocomp.models.unfrozen`.
    seconds : float
        Duration of the fit [s].
    r_squared : float
        R2 on the training data, about the mean.
    predicted : ndarray of shape (n_rows,)
        Predictions of the estimator for every row; nan where an input is missing.
    """

    method: str
    estimator: ThermalRegressor
    model: ErrorModel
    seconds: float
    r_squared: float
    predicted: FloatArray


@dataclass(frozen=True)
class FittedMethod:
    """A fitted method with its training rows, before it is frozen.

    Parameters
    ----------
    columns : tuple of int
        Inputs that were used.
    seen : ndarray of bool of shape (n_rows,)
        Training rows.
    seconds : float
        Duration of the fit [s].
    predicted : ndarray of shape (n_rows,)
        Predictions for every row; nan where an input is missing.
    left_out : ndarray of shape (n_rows, 2) or None
        Prediction for each row by a model trained without that row's cycle, and the spread of its averaged regressions;
        nan for rows not used for training. None: not provided by the method.
    """

    how: Method
    estimator: ThermalRegressor
    columns: tuple[int, ...]
    seen: BoolArray
    seconds: float
    predicted: FloatArray
    left_out: FloatArray | None = None


def fit_method(name: str | BaseEstimator, samples: Samples, target: int, learn: BoolArray) -> FittedMethod:
    """Fit a method to selected rows.

    Parameters
    ----------
    learn : ndarray of bool of shape (n_rows,)
        Rows whose deviation may be used. A dynamic method also receives the inputs (never the deviations) of the other
        rows, since they describe the thermal history of the machine.
    """
    if not isinstance(name, str):
        (name,) = expand([name])
    how, own = find_method(name), getattr(name, "estimator", None)
    columns = tuple(j for j, c in enumerate(samples.inputs) if how.speed or c.quantity != "spindle_speed")
    if not columns:
        raise FitError(
            f"{how.name}: there is no temperature to predict from; map at least one, or use a method for the spindle "
            "speed"
        )
    channel, valid = samples.targets[target], samples.valid
    seen = valid & learn & np.isfinite(samples.deviations[:, target])
    if seen.sum() < 3:
        raise FitError(
            f"{how.name}: only {int(seen.sum())} complete training rows of {channel.name}; at least 3 are required"
        )
    _refuse_unknown_counts(samples, seen)
    speeds = tuple(samples.inputs[j].name for j in columns if samples.inputs[j].quantity == "spindle_speed")
    with catch_failures(f"{how.name} cannot be fitted to {channel.name}"):
        estimator = how.build(speeds) if own is None else clone(own)
    if isinstance(estimator, TimedRegressor) and estimator.columns == "speed" and not getattr(estimator, "speed", None):
        estimator.set_params(speed=speeds)  # the recording identifies the speed inputs
    frame = samples.frame().iloc[:, list(columns)]
    begin = time.perf_counter()
    # a method with a memory also receives the history of the machine between the training rows
    rows = valid & np.isin(samples.test, samples.test[seen]) if "dt" in how.takes else seen
    learned = seen[rows]
    y = np.where(learned, samples.deviations[rows, target], 0.0)
    driven = samples.take(rows)
    clock: dict[str, Any] = {"dt": pd.Series(driven.dt())} if "dt" in how.takes else {}
    cycles: dict[str, Any] = {"cycle": np.where(learned, driven.cycle, -1)} if "cycle" in how.takes else {}
    with catch_failures(f"{how.name} cannot be fitted to {channel.name}"):
        estimator.fit(frame.iloc[rows], y, **clock, **cycles)
    seconds = time.perf_counter() - begin
    everywhere: dict[str, Any] = {"dt": pd.Series(samples.take(valid).dt())} if "dt" in how.takes else {}
    predicted = np.full(len(samples), np.nan)
    with catch_failures(f"{how.name} cannot predict {channel.name}"):
        found = estimator.predict(frame.iloc[valid], **everywhere)
    predicted[valid] = check_numbers(found, int(valid.sum()), how.name)
    left_out = None
    if isinstance(estimator, TimedRegressor) and hasattr(estimator, "left_out_"):  # for grouping, they are columns
        left_out = np.full((len(samples), 2), np.nan)
        left_out[rows] = estimator.left_out_
    return FittedMethod(
        how=how,
        estimator=estimator,
        columns=columns,
        seen=seen,
        seconds=seconds,
        predicted=predicted,
        left_out=left_out,
    )


def train(
    name: str | BaseEstimator,
    samples: Samples,
    target: int,
    learn: BoolArray,
    *,
    support: Support = Support(),
    prints: bool = False,
    joint: bool = True,
) -> Trained:
    """Fit a method to selected rows and freeze it."""
    fit = fit_method(name, samples, target, learn)
    how, estimator, seen, predicted = fit.how, fit.estimator, fit.seen, fit.predicted
    r_squared = float(r2_score(samples.deviations[seen, target], predicted[seen]))
    freeze: Any = estimator.unfrozen if isinstance(estimator, UnfrozenRegressor) else estimator.freeze
    channel = samples.targets[target]
    model: ErrorModel = freeze(
        target=channel.name,
        unit=channel.unit,
        inputs=samples.model_inputs(fit.columns, seen),
        support=support,
        provenance=_provenance(how, estimator, samples, target, seen),
    )
    if prints and model.provenance is not None:
        # fingerprints of the model's inputs only, since a file can be judged only if it has them
        inputs = samples.only([i.name for i in model.inputs])
        model = replace(model, provenance=replace(model.provenance, prints=fingerprint(inputs, target, learn)))
    model = replace(model, joint=_joint(model, samples, seen) if joint else None, zeroing=samples.zeroing)
    if fit.left_out is not None:
        model = replace(model, band=_band(model, samples, target, fit.left_out))
    return Trained(
        method=how.name, estimator=estimator, model=model, seconds=fit.seconds, r_squared=r_squared, predicted=predicted
    )


def _refuse_unknown_counts(samples: Samples, seen: BoolArray) -> None:
    """Reject training displacements whose zero was set at an unknown drift of a warm machine."""
    for test in np.unique(samples.test[seen]).tolist() if samples.starts else []:
        start = samples.starts[test]
        if start.word == "rezeroed" and start.earlier:
            raise FitError(
                f"{samples.test_names[test]} was re-zeroed on a machine that continued from {start.earlier[-1].name}: "
                "its displacements lack the drift before that. Use such a test to assess, not to fit"
            )


def _joint(model: ErrorModel, samples: Samples, seen: BoolArray) -> JointSupport | None:
    """Return the joint support of the model's inputs in the training rows."""
    columns = [[c.name for c in samples.inputs].index(i.name) for i in model.inputs]
    return find_joint_support(
        samples.change()[seen][:, columns], [samples.inputs[j] for j in columns], samples.cycle[seen]
    )


def _band(model: ErrorModel, samples: Samples, target: int, left_out: FloatArray) -> Band | None:
    """Return the uncertainty band of a model from its errors on left-out cycles."""
    speeds = [k for k, i in enumerate(model.inputs) if i.quantity == "spindle_speed"]
    columns = [j for j, c in enumerate(samples.inputs) if c.quantity == "spindle_speed"]
    known = np.isfinite(left_out).all(axis=1)
    return find_band(
        samples.deviations[known, target] - left_out[known, 0],
        left_out[known, 1],
        samples.cycle[known],
        np.asarray((np.abs(samples.change()[known][:, columns]) > THRESHOLDS.stopped_speed).any(axis=1)),
        speeds,
    )


def _provenance(how: Method, estimator: ThermalRegressor, samples: Samples, target: int, seen: BoolArray) -> Provenance:
    cycles: Sequence[int] = np.unique(samples.cycle[seen]).tolist()
    tests: Sequence[int] = np.unique(samples.test[seen]).tolist()
    return Provenance(
        method=how.name,
        parameters={k: repr(v) for k, v in sorted(estimator.get_params().items())},
        data_sha256=tuple(samples.hashes[t] for t in tests),
        cycles=tuple(samples.cycle_names[c] for c in cycles),
        rows=int(seen.sum()),
        version=__version__,
        learned=samples.learned(target, seen),
        starts=tuple(samples.starts[t].word for t in tests) if samples.starts else (),
        clocks=tuple(samples.clocks[t] for t in tests if samples.clocks[t:] and samples.clocks[t]),
    )
