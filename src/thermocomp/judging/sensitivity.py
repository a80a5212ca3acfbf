"""Effect of random sensor error on the R2 of frozen models (Hwang, section 3.2.4 and Fig. 6; H-18)."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.arrays import BoolArray, FloatArray
from thermocomp.core.exceptions import FitError, InputError
from thermocomp.core.model import ErrorModel
from thermocomp.judging.replay import walk
from thermocomp.recordings.samples import Samples


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """R2 of one model under random sensor error.

    Parameters
    ----------
    r_squared : float
        R2 about the mean, without sensor error.
    draws : ndarray of shape (n_draws,)
        R2 with sensor error, for each draw.
    """

    r_squared: float
    draws: FloatArray

    @property
    def mean(self) -> float:
        """Mean R2 over the draws."""
        return float(self.draws.mean())

    @property
    def std(self) -> float:
        """Standard deviation of R2 over the draws: the smaller, the more robust."""
        return float(self.draws.std(ddof=1))


def sensitivity(
    models: Mapping[str, ErrorModel],
    samples: Samples,
    rows: BoolArray,
    *,
    size: float = 0.4,
    law: Literal["uniform", "normal"] = "uniform",
    draws: int = 100,
    seed: int = 0,
) -> dict[str, Sensitivity]:
    """Replay models with random error on every temperature, the same error for all models.

    The models are not refitted. The error is independent from sensor to sensor and from row to row, and also affects
    the readings of the zero. The paper states neither its distribution nor its size (E-H8): the default size is that of
    C-33.

    Parameters
    ----------
    rows : ndarray of bool of shape (n_rows,)
        Rows to judge; rows without a measured deviation are ignored.
    size : float
        Uniform: within +-size; normal: standard deviation [degC].
    """
    targets = {m.target for m in models.values()}
    if len(targets) != 1:
        raise InputError(f"expected models of one target, found models of {', '.join(sorted(targets)) or 'none'}")
    if not 0 <= size < np.inf or draws < 2 or law not in ("uniform", "normal"):
        raise InputError(
            f"sensor error {law!r} of {size} degC, {draws} draws: expected uniform or normal, a size >= 0 and >= 2 "
            "draws"
        )
    (target,) = targets
    names = [c.name for c in samples.targets]
    if target not in names:
        raise InputError(f"{target} was not recorded; there are {', '.join(names)}")
    measured = samples.deviations[:, names.index(target)]
    judged = rows & np.isfinite(measured)
    total = float(np.sum((measured[judged] - measured[judged].mean()) ** 2)) if judged.any() else 0.0
    if not total > 0:
        raise FitError(f"{target} does not change in the {int(judged.sum())} rows to judge: R2 is not defined")
    found = {}
    for name, model in models.items():
        squares = _squares(model, samples, judged, measured, size, law, draws, seed)
        r_squared = 1 - squares / total
        found[name] = Sensitivity(float(r_squared[0]), r_squared[1:])
    return found


def _squares(
    model: ErrorModel,
    samples: Samples,
    judged: BoolArray,
    measured: FloatArray,
    size: float,
    law: str,
    draws: int,
    seed: int,
) -> FloatArray:
    """Return the residual sum of squares without error, then for each draw; shape (1 + draws,)."""
    columns = [[c.name for c in samples.inputs].index(i.name) for i in model.inputs]
    temperatures = np.array([c.quantity == "temperature" for c in samples.inputs], dtype=np.bool_)
    # each row has its own error, whatever rows the model needs
    walked = np.isin(samples.test, samples.test[judged])

    def disturb(rows: NDArray[np.intp], readings: FloatArray, _: FloatArray) -> FloatArray:
        batch, shape = np.repeat(readings[:, None], 1 + draws, axis=1), (draws, len(samples.inputs))
        for row, own in zip(rows.tolist(), batch, strict=True):
            rng = np.random.default_rng((seed, row))
            error = rng.uniform(-size, size, shape) if law == "uniform" else rng.normal(0.0, size, shape)
            own[1:] += (error * temperatures)[:, columns]
        return batch

    squares = np.zeros(1 + draws)
    for some in walk(model, samples, walked, disturb):
        mine = judged[some.rows]
        squares += ((measured[some.rows[mine], None] - some.deviation[mine]) ** 2).sum(axis=0)
    return squares
