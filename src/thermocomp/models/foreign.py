"""External regressors: any scikit-learn regressor, or a small custom class, assessed like built-in methods."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator, clone, is_regressor
from sklearn.pipeline import Pipeline

from thermocomp.core.exceptions import FitError, InputError, ThermocompError
from thermocomp.models.base import FloatArray, ThermalRegressor
from thermocomp.models.pipelines import PipelineRegressor, freezes
from thermocomp.models.timed import TimedRegressor
from thermocomp.models.unfrozen import UnfrozenRegressor


class ForeignRegressor(UnfrozenRegressor):
    """A regressor without `freeze`: replayed and judged like the others, but never deployed.

    Raises `FitError` if its prediction raises an error or does not return one finite number per row.

    Parameters
    ----------
    estimator : estimator
        Estimator with `fit` and `predict`; it is cloned, not changed. It receives a table with the names of the inputs.

    Attributes
    ----------
    estimator_ : estimator
        Fitted clone.
    data_min_, data_max_ : ndarray of shape (n_features,)
        Trained range.
    """

    def __init__(self, estimator: Any) -> None:
        self.estimator = estimator

    @property
    def name(self) -> str:  # type: ignore[override]
        """Class name of the estimator, or those of the steps of a Pipeline."""
        return title(self.estimator)

    def _fit(self, change: FloatArray, deviation: FloatArray) -> None:
        self.estimator_ = clone(self.estimator).fit(self._table(change), deviation)

    def _predict(self, change: FloatArray) -> FloatArray:
        with catch_failures(f"{self.name} cannot predict"):
            found = self.estimator_.predict(self._table(change))
        return check_numbers(found, len(change), self.name)

    def _table(self, change: FloatArray) -> FloatArray | pd.DataFrame:
        return pd.DataFrame(change, columns=self._names()) if hasattr(self, "feature_names_in_") else change

    def _bulk(self) -> str:
        return "it is not a method of thermocomp and has no 'freeze'"


@contextmanager
def catch_failures(what: str) -> Iterator[None]:
    """Convert any exception of an estimator into a `FitError`, so that the results of other estimators are kept.

    Errors of thermocomp are passed on unchanged: their messages state the remedy.
    """
    try:
        yield
    except ValueError as e:  # scikit-learn's error for unusable data: its text is sufficient
        raise FitError(f"{what}: {e}") from e
    except ThermocompError:
        raise
    except Exception as e:
        raise FitError(f"{what}: {type(e).__name__}: {e}") from e


def check_numbers(predicted: Any, n_rows: int, name: str) -> FloatArray:
    """Return the predictions as one finite number per row.

    Parameters
    ----------
    predicted : array-like of shape (n_rows,) or (n_rows, 1)

    Returns
    -------
    ndarray of shape (n_rows,)
    """
    with catch_failures(f"{name} predicts values that are not numbers"):
        found = np.asarray(predicted, dtype=np.float64)
    if found.shape not in ((n_rows,), (n_rows, 1)):
        raise FitError(
            f"{name}: predict returned an array of shape {found.shape} for {n_rows} rows; expected shape ({n_rows},)"
        )
    wrong = np.flatnonzero(~np.isfinite(found))
    if wrong.size:
        raise FitError(
            f"{name} predicts {found.flat[wrong[0]]:g} in {wrong.size} of {n_rows} rows; expected finite numbers"
        )
    return found.reshape(n_rows)


def adopt_estimator(estimator: Any) -> Any:
    """Return a user-supplied estimator in a form that can be trained and judged."""
    if isinstance(estimator, type):
        raise InputError(f"{estimator.__name__} is a class: pass an instance, {estimator.__name__}()")
    if isinstance(estimator, TimedRegressor):
        return estimator.routed()
    if isinstance(estimator, ThermalRegressor):
        return estimator
    if isinstance(estimator, Pipeline) and freezes(estimator):
        return PipelineRegressor(estimator)
    if not _is_regressor(estimator) and not (isinstance(estimator, BaseEstimator) and hasattr(estimator, "freeze")):
        raise InputError(
            f"{type(estimator).__name__} is not a regressor: name a method, or pass an instance of a class with "
            "fit(X, y), predict(X), get_params and set_params, such as one derived from RegressorMixin and "
            "BaseEstimator of sklearn.base"
        )
    for name, part in estimator.get_params().items():
        if isinstance(part, TimedRegressor):
            raise InputError(
                f"{type(part).__name__} ({name}) has a memory, and {title(estimator)} cannot pass it the time here: "
                "use it alone, or in a Pipeline of selectors and one method that can be frozen"
            )
    return estimator if hasattr(estimator, "freeze") else ForeignRegressor(estimator)


def _is_regressor(estimator: Any) -> bool:
    """Return whether an object follows scikit-learn's protocol of a regressor, also without its base classes."""
    if isinstance(estimator, BaseEstimator):
        return bool(is_regressor(estimator))
    protocol = all(callable(getattr(estimator, name, None)) for name in ("fit", "predict", "get_params", "set_params"))
    return protocol and getattr(estimator, "_estimator_type", "regressor") == "regressor"


def title(estimator: Any) -> str:
    """Return the title of an estimator: its class name, or the class names of the steps of a Pipeline."""
    if isinstance(estimator, ForeignRegressor):
        return title(estimator.estimator)
    if isinstance(estimator, PipelineRegressor):
        return title(estimator.pipeline)
    if isinstance(estimator, Pipeline):
        return " + ".join(title(step) for _, step in estimator.steps if step not in (None, "passthrough"))
    return type(estimator).__name__
