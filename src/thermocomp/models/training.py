"""The methods by name, and how one is trained on the rows it may learn from."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.metrics import r2_score

from thermocomp import __version__
from thermocomp.core.exceptions import FitError, InputError
from thermocomp.core.model import ErrorModel, Provenance, Support
from thermocomp.models.base import ThermalRegressor
from thermocomp.models.dynamic import DynamicRidge
from thermocomp.models.mra import StepwiseMRA
from thermocomp.models.ols import LeastSquares
from thermocomp.models.partial_f import PartialF
from thermocomp.recording.samples import Samples

BoolArray = NDArray[np.bool_]


@dataclass(frozen=True)
class Method:
    """A way to get a model.

    Parameters
    ----------
    name : str
        On the command line.
    summary : str
        One line.
    build : callable
        Makes the estimator, given the names of the spindle speeds among its inputs.
    uses_speed : bool
        The spindle speed is one of its inputs.
    dynamic : bool
        Its estimator takes `dt` and `cycle`.
    """

    name: str
    summary: str
    build: Callable[[tuple[str, ...]], ThermalRegressor]
    uses_speed: bool = False
    dynamic: bool = False


METHODS: dict[str, Method] = {
    m.name: m
    for m in (
        Method("ols", "least squares on all temperatures", lambda _: LeastSquares()),
        Method("partial-f", "stepwise by partial F, 100 to enter and 50 to delete", lambda _: PartialF()),
        Method("mra", "Chen's stepwise second-order regression", lambda _: StepwiseMRA()),
        Method(
            "dynamic",
            "ridge on temperatures, their lagged copies and the lagged spindle speed",
            lambda speeds: DynamicRidge(speed=speeds),
            uses_speed=True,
            dynamic=True,
        ),
    )
}


@dataclass(frozen=True)
class Trained:
    """A fitted method.

    Parameters
    ----------
    method : str
    estimator : ThermalRegressor
    model : ErrorModel
        Frozen.
    seconds : float
        The fit took [s].
    r_squared : float
        In-sample, about the mean.
    """

    method: str
    estimator: ThermalRegressor
    model: ErrorModel
    seconds: float
    r_squared: float


def method(name: str) -> Method:
    """Find a method.

    Raises
    ------
    InputError
        There is none of that name.
    """
    found = METHODS.get(name)
    if found is None:
        near = get_close_matches(name, METHODS, n=1, cutoff=0.4)
        hint = f"; did you mean {near[0]}?" if near else "."
        raise InputError(f"unknown model {name!r}{hint} Known are {', '.join(METHODS)}")
    return found


def train(name: str, samples: Samples, target: int, learn: BoolArray, *, support: Support = Support()) -> Trained:
    """Fit a method to some of the rows and freeze it.

    Parameters
    ----------
    name : str
        Of the method.
    samples : Samples
    target : int
        Index into ``samples.targets``.
    learn : ndarray of bool of shape (n_rows,)
        Rows whose deviation may be seen. A dynamic method also gets the inputs (never the deviations) of the other
        rows: they are what the machine has gone through in between.
    support : Support
        For the frozen model.

    Returns
    -------
    Trained

    Raises
    ------
    FitError
        Too few rows, or the method cannot be fitted to them.
    """
    how = method(name)
    columns = [j for j, c in enumerate(samples.inputs) if how.uses_speed or c.quantity != "spindle_speed"]
    if not columns:
        raise FitError(f"{name}: there is no temperature to predict from")
    channel = samples.targets[target]
    seen = samples.valid & learn & np.isfinite(samples.deviations[:, target])
    if seen.sum() < 3:
        raise FitError(
            f"{name}: {int(seen.sum())} complete rows of {channel.name} to learn from; at least 3 are needed"
        )
    speeds = tuple(samples.inputs[j].name for j in columns if samples.inputs[j].quantity == "spindle_speed")
    estimator = how.build(speeds)
    begin = time.perf_counter()
    rows = samples.valid if how.dynamic else seen
    X, learned = samples.frame().iloc[rows, columns], seen[rows]
    y = np.where(learned, samples.deviations[rows, target], 0.0)
    clock: dict[str, Any] = {}
    cycles: dict[str, Any] = {}
    if how.dynamic:
        driven = samples.take(rows)
        clock, cycles = {"dt": driven.dt()}, {"cycle": np.where(learned, driven.cycle, -1)}
    try:
        estimator.fit(X, y, **clock, **cycles)
    except ValueError as e:  # what scikit-learn raises for data it cannot use
        raise FitError(f"{name} cannot be fitted to {channel.name}: {e}") from e
    seconds = time.perf_counter() - begin
    r_squared = float(r2_score(y[learned], estimator.predict(X, **clock)[learned]))
    model = estimator.freeze(
        target=channel.name,
        unit=channel.unit,
        inputs=samples.model_inputs(columns, seen),
        support=support,
        provenance=_provenance(how, estimator, samples, seen),
    )
    return Trained(name, estimator, model, seconds, r_squared)


def _provenance(how: Method, estimator: ThermalRegressor, samples: Samples, seen: BoolArray) -> Provenance:
    cycles: Sequence[int] = np.unique(samples.cycle[seen]).tolist()
    tests: Sequence[int] = np.unique(samples.test[seen]).tolist()
    return Provenance(
        method=how.name,
        parameters={k: repr(v) for k, v in sorted(estimator.get_params().items())},
        data_sha256=tuple(samples.hashes[t] for t in tests),
        cycles=tuple(samples.cycle_names[c] for c in cycles),
        rows=int(seen.sum()),
        version=__version__,
    )
