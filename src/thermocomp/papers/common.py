"""Common part of the studies: recordings with a paper's names, replay of models over whole tests, error tables."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
import pandas as pd

from thermocomp.core.exceptions import InputError
from thermocomp.core.inputs import Support
from thermocomp.core.machine import Channel
from thermocomp.core.model import ErrorModel
from thermocomp.core.polynomial import Polynomial
from thermocomp.core.terms import Variable
from thermocomp.core.zero import FIRST_READING
from thermocomp.judging import metrics
from thermocomp.judging.replay import replay
from thermocomp.models.base import ThermalRegressor
from thermocomp.models.training import train
from thermocomp.papers.study import BoolArray, FloatArray, StudyTable
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack
from thermocomp.recordings.starts import COLD

#: the papers' models are not limited to their training range: a margin that no reading exceeds
PAPERS_SUPPORT = Support(margin=1e3)


# -- recordings --------------------------------------------------------------------------------------------------------


def rename_channels(recording: Recording, names: Mapping[str, str]) -> Recording:
    """Return selected channels of a recording under the names of a paper, in the given order."""
    channels = tuple(replace(recording.channel(old), name=new) for old, new in names.items())
    columns = recording.values([recording.channel(old) for old in names])
    return replace(recording, table=pd.DataFrame(columns, columns=[c.name for c in channels]), channels=channels)


def add_derived_channel(recording: Recording, channel: Channel, weights: Mapping[str, float]) -> Recording:
    """Return a recording with an additional channel: a weighted sum of others, such as a mean or a difference."""
    values = recording.values([recording.channel(name) for name in weights]) @ np.array(list(weights.values()))
    table = recording.table.assign(**{channel.name: values})
    return replace(recording, table=table, channels=(*recording.channels, channel))


def stacked(
    recordings: Sequence[Recording], targets: Sequence[str], inputs: Sequence[str] | None = None, *, rezero: bool = True
) -> Samples:
    """Stack tests as in the papers: they start with a cold machine, and their first reading is the zero."""
    return stack(recordings, targets, inputs, rezero=rezero, zeroing=FIRST_READING, starts=COLD)


def every(samples: Samples) -> BoolArray:
    """Return a mask that selects all rows, shape (n_rows,)."""
    return np.ones(len(samples), dtype=np.bool_)


def with_noise(samples: Samples, size: float, law: Literal["uniform", "normal"], seed: int) -> Samples:
    """Return the same rows with random errors of all temperatures, including the rows used as zero.

    Parameters
    ----------
    size : float
        Half-width of the uniform distribution, or standard deviation of the normal one [degC].
    """
    rng = np.random.default_rng(seed)
    shape = samples.values.shape
    error = rng.uniform(-size, size, shape) if law == "uniform" else rng.normal(0.0, size, shape)
    warm = np.array([c.quantity == "temperature" for c in samples.inputs])
    return replace(samples, values=samples.values + error * warm)


def cut_off(samples: Samples, name: str) -> Samples:
    """Return the same rows with the change of one input set to zero from the start, as for a cut-off sensor."""
    names = [c.name for c in samples.inputs]
    if name not in names:
        raise InputError(f"no input is named {name!r}; there are {', '.join(names)}")
    values = samples.values.copy()
    values[:, names.index(name)] = samples.reference()[samples.test, names.index(name)]
    return replace(samples, values=values)


# -- models ------------------------------------------------------------------------------------------------------------


def fit_and_freeze(
    estimator: ThermalRegressor,
    samples: Samples,
    targets: Sequence[str],
    *,
    support: Support = PAPERS_SUPPORT,
    **fit: Any,
) -> dict[str, ErrorModel]:
    """Fit an estimator to all rows of the samples, which must be complete, and freeze it.

    For a method of `thermocomp.models.methods` with default settings use `thermocomp.models.training.train`.
    """
    columns = [[c.name for c in samples.targets].index(t) for t in targets]
    y = samples.deviations[:, columns]
    inputs = samples.model_inputs(range(len(samples.inputs)), every(samples))
    header: dict[str, Any] = {"inputs": inputs, "support": support}
    fitting: Any = estimator
    fitting.fit(samples.frame(), y[:, 0] if len(columns) == 1 else y, **fit)
    if len(columns) == 1:
        return {targets[0]: estimator.freeze(target=targets[0], unit=samples.targets[columns[0]].unit, **header)}
    return {
        t: fitting.freeze(target=t, unit=samples.targets[j].unit, output=k, **header)
        for k, (t, j) in enumerate(zip(targets, columns, strict=True))
    }


def trained(method: str, samples: Samples, target: int = 0, support: Support = Support()) -> ErrorModel:
    """Train a method of thermocomp with default settings on all rows of the samples."""
    return train(method, samples, target, every(samples), support=support).model


def frozen(
    samples: Samples, columns: Sequence[int], coefficients: Sequence[float], intercept: float, **shape: Any
) -> Polynomial:
    """Freeze coefficients as a polynomial of some inputs for the first target.

    Parameters
    ----------
    intercept : float
        [unit of the target]
    **shape
        ``variables`` and ``terms`` of the polynomial. Default: each input linearly.
    """
    inputs = samples.model_inputs(columns, every(samples))
    single = tuple(Variable.single(c.name, k) for k, c in enumerate(inputs))
    shape = {"variables": single, "terms": tuple((k,) for k in range(len(single)))} | shape
    (target, *_) = samples.targets
    return Polynomial(
        target=target.name,
        unit=target.unit,
        inputs=inputs,
        support=PAPERS_SUPPORT,
        coefficients=tuple(coefficients),
        intercept=intercept,
        **shape,
    )


def predict_deviation(model: ErrorModel, samples: Samples) -> FloatArray:
    """Replay a frozen model reading by reading from the start of each test; return its deviation in all rows.

    Returns
    -------
    ndarray of shape (n_rows,)
        [unit of the model]
    """
    return replay(model, samples, every(samples))[0]


def take_measured(samples: Samples, target: str) -> FloatArray:
    """Return the measured deviation of a target, shape (n_rows,)."""
    return samples.deviations[:, [c.name for c in samples.targets].index(target)]


def residual(model: ErrorModel, samples: Samples) -> FloatArray:
    """Return the residual of a replayed model for its target, shape (n_rows,) [unit of the model]."""
    return take_measured(samples, model.target) - predict_deviation(model, samples)


# -- errors ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Errors:
    """Error metrics of a residual.

    Parameters
    ----------
    rms, mae, max_abs, peak_to_peak : float
        [unit of the residual]
    """

    rms: float
    mae: float
    max_abs: float
    peak_to_peak: float

    @classmethod
    def of(cls, residual: FloatArray) -> "Errors":
        """Return the error metrics of a residual of any shape, ignoring nan; for no compensation pass the deviation."""
        e = residual[np.isfinite(residual)]
        return cls(*(m(e, 0.0 * e) for m in (metrics.rms, metrics.mae, metrics.max_abs, metrics.peak_to_peak)))


def rms(residual: FloatArray) -> float:
    """Return the root mean square of a residual of any shape."""
    return Errors.of(residual).rms


def described(residual: FloatArray, deviation: FloatArray) -> float:
    """Return the share of the variance of a deviation that is explained by a model with this residual: R2."""
    return float(1 - np.sum(residual**2) / np.sum((deviation - deviation.mean()) ** 2))


def errors_table(caption: str, residuals: Mapping[tuple[str, str], FloatArray]) -> StudyTable:
    """Return a table with a row of error metrics per residual.

    Parameters
    ----------
    residuals : mapping of (str, str) to ndarray
        Residual by subject and method, such as ``("z, 1250 1/min", "no compensation")`` [um].
    """
    rows = []
    for (what, method), residual in residuals.items():
        e = Errors.of(residual)
        rows.append([what, method, *(f"{v:.2f}" for v in (e.rms, e.mae, e.max_abs, e.peak_to_peak))])
    header = ("", "method", "RMS [um]", "MAE [um]", "max [um]", "peak-to-peak [um]")
    return StudyTable(caption, header, rows)
