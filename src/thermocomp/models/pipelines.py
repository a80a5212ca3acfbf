"""Pipelines of selectors and one method, frozen into a single model of plain numbers."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from sklearn.base import clone
from sklearn.feature_selection import SelectorMixin
from sklearn.pipeline import Pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils.validation import check_is_fitted

from thermocomp.core.exceptions import FitError
from thermocomp.core.inputs import Input, Support
from thermocomp.core.model import ErrorModel
from thermocomp.core.polynomial import Polynomial
from thermocomp.core.provenance import Provenance
from thermocomp.core.terms import Variable
from thermocomp.models.base import FloatArray, IntArray, ThermalRegressor, plain_inputs
from thermocomp.models.timed import TimedRegressor


def freezes(pipeline: Pipeline) -> bool:
    """Return whether a Pipeline can be frozen: selectors or a `StandardScaler`, followed by a freezable method."""
    *before, last = _steps(pipeline)
    return (
        isinstance(last, ThermalRegressor)
        and last.freezable
        and all(isinstance(s, SelectorMixin | StandardScaler) for s in before)
    )


def freeze(
    estimator: Any,
    *,
    target: str,
    unit: str = "um",
    inputs: Sequence[Input] | None = None,
    support: Support = Support(),
    provenance: Provenance | None = None,
) -> ErrorModel:
    """Return a fitted method, or a fitted Pipeline of selectors and a method, as plain numbers.

    A selector is any `SelectorMixin`; a `StandardScaler` may precede a method without products of inputs.

    Parameters
    ----------
    estimator : estimator
        Fitted estimator.
    target, unit, inputs, support, provenance
        As in `thermocomp.models.base.ThermalRegressor.freeze`; `inputs` are the Pipeline's inputs without the time.

    Returns
    -------
    ErrorModel

    Raises
    ------
    FitError
        The estimator cannot be frozen.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn.pipeline import make_pipeline
    >>> from thermocomp import LeastSquares, SensorSelector, freeze
    >>> rng = np.random.default_rng(0)
    >>> rises = rng.uniform(0, 10, (200, 6))  # of six temperatures, two of which matter [degC]
    >>> pipeline = make_pipeline(SensorSelector("partial-f"), LeastSquares(fit_intercept=False))
    >>> model = freeze(pipeline.fit(rises, 5 * rises[:, 1] - 3 * rises[:, 4]), target="z_um")
    >>> print({name: round(value, 3) for name, value in model.coefficients_by_name().items()})
    {'x1': 5.0, 'x4': -3.0}
    """
    header: dict[str, Any] = {"target": target, "unit": unit, "support": support, "provenance": provenance}
    if not isinstance(estimator, Pipeline):
        if not hasattr(estimator, "freeze"):
            raise FitError(
                f"{type(estimator).__name__} has no 'freeze': use it only in compare, and deploy another method"
            )
        frozen: ErrorModel = estimator.freeze(inputs=inputs, **header)
        return frozen
    if not freezes(estimator):
        raise FitError(
            "a Pipeline can be frozen if it consists of selectors or a StandardScaler, followed by one method of "
            "thermocomp that can be frozen; this one consists of "
            f"{', '.join(type(s).__name__ for s in _steps(estimator))}"
        )
    check_is_fitted(estimator)
    last = _steps(estimator)[-1]
    columns, mean, scale = _passed(estimator)
    hidden = last.n_features_in_ - len(last.data_min_)  # number of leading time columns
    if (columns[:hidden] != np.arange(hidden)).any():
        raise FitError(
            "a step before the last has removed the first column, the time: set time='column' in its selector"
        )
    columns, mean, scale = columns[hidden:], mean[hidden:], scale[hidden:]
    if inputs is None:
        first = _steps(estimator)[0]
        names = getattr(first, "feature_names_in_", [f"x{i}" for i in range(first.n_features_in_)])
        kept = [str(names[c]) for c in columns.tolist()]
        mine = plain_inputs(kept, last.data_min_ * scale + mean, last.data_max_ * scale + mean)
    else:
        mine = tuple(inputs[c - hidden] for c in columns.tolist())
    model: ErrorModel = last.freeze(inputs=mine, **header)
    if not mean.any() and (scale == 1).all():
        return model
    return _unscaled(model, {i.name: (m, s) for i, m, s in zip(mine, mean.tolist(), scale.tolist(), strict=True)})


class PipelineRegressor(ThermalRegressor):
    """A freezable Pipeline, trained as one method: its selectors are fitted to the training rows only.

    Parameters
    ----------
    pipeline : Pipeline
        Pipeline to be cloned; it is not changed.

    Attributes
    ----------
    pipeline_ : Pipeline
        Fitted clone.
    """

    def __init__(self, pipeline: Pipeline) -> None:
        self.pipeline = pipeline

    def fit(
        self, X: ArrayLike, y: ArrayLike, *, dt: ArrayLike | None = None, cycle: ArrayLike | None = None
    ) -> "PipelineRegressor":
        """Fit each step to the output of the previous step.

        Parameters
        ----------
        X : DataFrame of shape (n_rows, n_features)
            Inputs minus their reference, in chronological order.
        y : array-like of shape (n_rows,)
            Deviation.
        dt, cycle : array-like of shape (n_rows,), optional
            As in `thermocomp.models.dynamic.DynamicRidge.fit`; rows with cycle -1 are not used for training.
        """
        change, deviation = self._read(X, y)
        folds = np.zeros(len(deviation), dtype=np.intp) if cycle is None else np.asarray(cycle)
        learned = folds >= 0
        self._note_range(change[learned])
        *before, last = (clone(s) for s in _steps(self.pipeline))
        table: Any = X
        for step in before:
            if "time" in step.get_params():
                step.set_params(time=None)  # the time is not a column here
            step.set_output(transform="pandas").fit(table[learned], deviation[learned])
            table = step.transform(table)
        if isinstance(last, TimedRegressor):
            last = last.routed()
            last.fit(table, deviation, dt=dt, cycle=cycle)
        else:
            last.fit(table[learned], deviation[learned])
        self.pipeline_ = Pipeline([(str(k), s) for k, s in enumerate([*before, last])])
        return self

    def predict(self, X: ArrayLike, *, dt: ArrayLike | None = None) -> FloatArray:
        """Predict the deviation.

        Parameters
        ----------
        X : DataFrame of shape (n_rows, n_features)
        dt : array-like of shape (n_rows,), optional
            As in `fit`.

        Returns
        -------
        ndarray of shape (n_rows,)
        """
        check_is_fitted(self)
        *before, last = _steps(self.pipeline_)
        for step in before:
            X = step.transform(X)
        return np.asarray(last.predict(X, dt=dt) if isinstance(last, TimedRegressor) else last.predict(X))

    def _frozen(self, inputs: Sequence[Input], header: dict[str, Any]) -> ErrorModel:
        return freeze(self.pipeline_, inputs=inputs, **header)


def _steps(pipeline: Pipeline) -> list[Any]:
    return [step for _, step in pipeline.steps if step not in (None, "passthrough")]


def _passed(pipeline: Pipeline) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return the columns that reach the last step, and the offsets and scales applied before it."""
    *before, last = _steps(pipeline)
    n = (before or [last])[0].n_features_in_
    columns, mean, scale = np.arange(n), np.zeros(n), np.ones(n)
    for step in before:
        if isinstance(step, SelectorMixin):
            kept = step.get_support()
            columns, mean, scale = columns[kept], mean[kept], scale[kept]
        else:
            mean = mean + scale * (0.0 if step.mean_ is None else step.mean_)
            scale = scale * (1.0 if step.scale_ is None else step.scale_)
    return columns, mean, scale


def _unscaled(model: ErrorModel, scaling: dict[str, tuple[float, float]]) -> Polynomial:
    """Return the model of scaled inputs as a model of the unscaled inputs."""
    if not isinstance(model, Polynomial) or any(len(term) > 1 for term in model.terms):
        raise FitError(
            f"a StandardScaler before a model of the family {model.family} cannot be frozen: the model multiplies "
            "inputs or has a memory. Remove the scaler; the methods scale their inputs themselves"
        )
    variables, constants = [], []
    for v in model.variables:
        of = [(i, factor, *scaling[model.inputs[i].name]) for i, factor in v.weights]
        variables.append(Variable(v.name, tuple((i, factor / scale) for i, factor, _, scale in of)))
        constants.append(sum(factor * mean / scale for _, factor, mean, scale in of))
    taken = sum(c * constants[v] for (v,), c in zip(model.terms, model.coefficients, strict=True))
    return replace(model, variables=tuple(variables), intercept=model.intercept - taken)
