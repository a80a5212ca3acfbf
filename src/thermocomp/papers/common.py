"""What the studies share: recordings in a paper's names, models replayed over whole tests, errors and their tables."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from thermocomp.assessment.replay import replay
from thermocomp.core.exceptions import InputError
from thermocomp.core.machine import Channel
from thermocomp.core.model import ErrorModel, Support
from thermocomp.models.base import ThermalRegressor
from thermocomp.papers.study import Claim, Table
from thermocomp.recording.recording import Recording
from thermocomp.recording.samples import Samples

FloatArray = NDArray[np.float64]

#: no paper's model stops at the edge of its trained range: so far beyond it that no reading gets there
PAPERS_SUPPORT = Support(margin=1e3)


# -- recordings ----------------------------------------------------------------------------------------------------


def renamed(recording: Recording, names: Mapping[str, str]) -> Recording:
    """Return some of the channels of a recording under the names of a paper, in the order given.

    Parameters
    ----------
    recording : Recording
    names : mapping of str to str
        From the channel to its new name, such as ``{"t_air_C": "T1"}``; what is not named is left out.

    Returns
    -------
    Recording

    Raises
    ------
    InputError
        There is no such channel.
    """
    channels = tuple(replace(recording.channel(old), name=new) for old, new in names.items())
    columns = recording.values([recording.channel(old) for old in names])
    return replace(recording, table=pd.DataFrame(columns, columns=[c.name for c in channels]), channels=channels)


def derived(recording: Recording, channel: Channel, weights: Mapping[str, float]) -> Recording:
    """Return a recording with one more channel: a weighted sum of others, such as a mean or a difference.

    Parameters
    ----------
    recording : Recording
    channel : Channel
        The new one.
    weights : mapping of str to float
        Factor of each channel it is made of.

    Returns
    -------
    Recording
    """
    values = recording.values([recording.channel(name) for name in weights]) @ np.array(list(weights.values()))
    table = recording.table.assign(**{channel.name: values})
    return replace(recording, table=table, channels=(*recording.channels, channel))


def with_noise(samples: Samples, size: float, law: Literal["uniform", "normal"], seed: int) -> Samples:
    """Return the same rows with random error on every temperature, also in the rows that count as zero.

    Parameters
    ----------
    samples : Samples
    size : float
        Uniform: within +-size; normal: standard deviation [degC].
    law : {'uniform', 'normal'}
    seed : int

    Returns
    -------
    Samples
    """
    rng = np.random.default_rng(seed)
    shape = samples.values.shape
    error = rng.uniform(-size, size, shape) if law == "uniform" else rng.normal(0.0, size, shape)
    warm = np.array([c.quantity == "temperature" for c in samples.inputs])
    return replace(samples, values=samples.values + error * warm)


def cut_off(samples: Samples, name: str) -> Samples:
    """Return the same rows with one input's change reading zero from the start on, as of a sensor that is cut off.

    Parameters
    ----------
    samples : Samples
    name : str
        Of the input.

    Returns
    -------
    Samples

    Raises
    ------
    InputError
        There is no such input.
    """
    names = [c.name for c in samples.inputs]
    if name not in names:
        raise InputError(f"no input is named {name!r}; there are {', '.join(names)}")
    values = samples.values.copy()
    values[:, names.index(name)] = samples.reference()[samples.test, names.index(name)]
    return replace(samples, values=values)


# -- models --------------------------------------------------------------------------------------------------------


def fitted(
    estimator: ThermalRegressor,
    samples: Samples,
    targets: Sequence[str],
    *,
    support: Support = PAPERS_SUPPORT,
    **fit: Any,
) -> dict[str, ErrorModel]:
    """Fit an estimator to all rows of the samples, which must be complete, and freeze it.

    For a method of `thermocomp.models.methods` with its own settings there is `thermocomp.models.training.train`.

    Parameters
    ----------
    estimator : ThermalRegressor
        Is fitted in place.
    samples : Samples
        Its inputs are the features, see `Samples.only`.
    targets : sequence of str
        Of several, one estimator learns them all at once: a net with as many outputs.
    support : Support
        What the frozen models do outside the trained range.
    **fit
        For the estimator's ``fit``, such as ``cycle=samples.cycle`` and ``dt=samples.dt()``.

    Returns
    -------
    dict of str to ErrorModel
        One per target.

    Raises
    ------
    FitError
        It cannot be fitted.
    """
    columns = [[c.name for c in samples.targets].index(t) for t in targets]
    y = samples.deviations[:, columns]
    every = np.ones(len(samples), dtype=np.bool_)
    inputs = samples.model_inputs(range(len(samples.inputs)), every)
    header: dict[str, Any] = {"inputs": inputs, "support": support}
    fitting: Any = estimator
    fitting.fit(samples.frame(), y[:, 0] if len(columns) == 1 else y, **fit)
    if len(columns) == 1:
        return {targets[0]: estimator.freeze(target=targets[0], unit=samples.targets[columns[0]].unit, **header)}
    return {
        t: fitting.freeze(target=t, unit=samples.targets[j].unit, output=k, **header)
        for k, (t, j) in enumerate(zip(targets, columns, strict=True))
    }


def predicted(model: ErrorModel, samples: Samples) -> FloatArray:
    """Replay a frozen model reading by reading from the start of every test; return its deviation at all rows.

    Parameters
    ----------
    model : ErrorModel
    samples : Samples
        With the model's inputs.

    Returns
    -------
    ndarray of shape (n_rows,)
        [unit of the model]
    """
    return replay(model, samples, np.ones(len(samples), dtype=np.bool_))[0]


def measured(samples: Samples, target: str) -> FloatArray:
    """Return the measured deviation of a target, shape (n_rows,)."""
    return samples.deviations[:, [c.name for c in samples.targets].index(target)]


def residual(model: ErrorModel, samples: Samples) -> FloatArray:
    """Return what a model, replayed, leaves of its target, shape (n_rows,) [unit of the model]."""
    return measured(samples, model.target) - predicted(model, samples)


# -- claims and errors ------------------------------------------------------------------------------------------------


def judged(ids: Sequence[str], text: str, paper: str, ours: str, holds: bool, otherwise: str) -> Claim:
    """Return a claim that holds or does not, with the finding told only if it does not.

    Parameters
    ----------
    ids, text, paper, ours
        See `thermocomp.papers.study.Claim`.
    holds : bool
    otherwise : str
        The finding: why it does not hold.

    Returns
    -------
    Claim
    """
    return Claim(tuple(ids), text, paper, ours, holds, "" if holds else otherwise)


def shown(ids: Sequence[str], text: str, paper: str, ours: str) -> Claim:
    """Return a number that is only to be looked at.

    Parameters
    ----------
    ids, text, paper, ours
        See `thermocomp.papers.study.Claim`.

    Returns
    -------
    Claim
    """
    return Claim(tuple(ids), text, paper, ours, None)


@dataclass(frozen=True)
class Errors:
    """What a residual amounts to.

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
        """Return the figures of a residual of any shape, nan left out; that of no compensation is the deviation."""
        e = residual[np.isfinite(residual)]
        return cls(float(np.sqrt(np.mean(e**2))), float(np.abs(e).mean()), float(np.abs(e).max()), float(np.ptp(e)))


def errors_table(caption: str, residuals: Mapping[tuple[str, str], FloatArray], unit: str = "um") -> Table:
    """Lay errors out: a row per residual.

    Parameters
    ----------
    caption : str
    residuals : mapping of (str, str) to ndarray
        Residual by what is judged and by method, such as ``("z, 1250 1/min", "no compensation")``.
    unit : str
        Of the residuals.

    Returns
    -------
    Table
    """
    rows = []
    for (what, method), residual in residuals.items():
        e = Errors.of(residual)
        rows.append([what, method, *(f"{v:.2f}" for v in (e.rms, e.mae, e.max_abs, e.peak_to_peak))])
    header = ("", "method", f"RMS [{unit}]", f"MAE [{unit}]", f"max [{unit}]", f"peak-to-peak [{unit}]")
    return Table(caption, header, rows)


# -- curves --------------------------------------------------------------------------------------------------------


def end_to_end(samples: Samples, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Put the tests of samples one after the other on one axis of time, with a break in the line between them.

    Parameters
    ----------
    samples : Samples
    values : ndarray of shape (n_rows,)

    Returns
    -------
    hours, values : ndarray of shape (n_rows + n_tests - 1,)
        A nan between two tests.
    """
    x: list[FloatArray] = []
    y: list[FloatArray] = []
    begin = 0.0
    for test in dict.fromkeys(samples.test.tolist()):
        mine = samples.test == test
        if x:
            x.append(np.array([begin]))
            y.append(np.array([np.nan]))
        x.append(begin + samples.time[mine] / 3600.0)
        y.append(values[mine])
        begin = float(x[-1][-1])
    return np.concatenate(x), np.concatenate(y)
