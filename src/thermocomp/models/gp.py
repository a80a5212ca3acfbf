"""`gp`: Gaussian process regression."""

import warnings
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, DotProduct, WhiteKernel

from thermocomp.core.exceptions import InputError
from thermocomp.models.base import FloatArray
from thermocomp.models.shrinkage import scaling
from thermocomp.models.unfrozen import UnfrozenRegressor

_CHUNK = 2_000  # rows predicted at once: bounds the memory


@dataclass(kw_only=True, eq=False, repr=False)
class GaussianProcess(UnfrozenRegressor):
    """Gaussian process regression (Rasmussen and Williams 2006) on standardised inputs.

    Uses scikit-learn's `GaussianProcessRegressor`: a plane, a smooth deviation from it (squared-exponential kernel, one
    length scale for all inputs) and white noise. Their hyperparameters maximise the likelihood from a single start, so
    that the same data give the same model. The likelihood treats rows as independent, which the rows of a drift test
    are not. Prediction requires the training rows, so the model cannot be frozen.

    Parameters
    ----------
    max_rows : int
        Maximum number of training rows, at least 2, thinned evenly: fitting time grows with the cube of this number.

    Attributes
    ----------
    kernel_ : sklearn.gaussian_process.kernels.Kernel
        Kernel with the fitted hyperparameters, for standardised inputs and deviation.
    n_rows_ : int
        Number of training rows used.
    data_min_, data_max_ : ndarray of shape (n_features,)
        Trained range of all rows given to `fit`.

    References
    ----------
    Rasmussen, C. E., Williams, C. K. I.: Gaussian Processes for Machine Learning. MIT Press, 2006.

    Examples
    --------
    >>> import numpy as np
    >>> from thermocomp import GaussianProcess
    >>> rise = np.linspace(0, 10, 60)[:, None]  # [degC]
    >>> model = GaussianProcess().fit(rise, 20 * np.sin(rise[:, 0] / 4))
    >>> print(f"{model.predict([[5.0]])[0]:.1f} um instead of {20 * np.sin(5.0 / 4):.1f} um")
    19.0 um instead of 19.0 um
    """

    name: ClassVar[str] = "gp"

    max_rows: int = 500

    def _fit(self, change: FloatArray, deviation: FloatArray) -> None:
        if self.max_rows < 2:
            raise InputError(f"max_rows {self.max_rows}: expected at least 2")
        rows = np.linspace(0, len(change) - 1, min(self.max_rows, len(change))).round().astype(np.intp)
        self.n_rows_ = len(rows)
        self._centre, self._scale = scaling(change[rows])
        process = GaussianProcessRegressor(
            ConstantKernel(1.0, (1e-4, 1e4)) * RBF(np.sqrt(change.shape[1]), (1e-1, 1e3))
            + ConstantKernel(1.0, (1e-6, 1e4)) * DotProduct(1.0, "fixed")
            + WhiteKernel(1e-2, (1e-6, 1e1))
        )
        (mean,), (spread,) = scaling(deviation[rows, None])
        spread = spread if np.isfinite(spread) else 1.0
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)  # an unnecessary kernel part ends at its bound
            process.fit((change[rows] - self._centre) / self._scale, (deviation[rows] - mean) / spread)
        self.kernel_ = process.kernel_
        self._prepare(process, mean, spread)

    def _prepare(self, process: GaussianProcessRegressor, mean: float, spread: float) -> None:
        """Store the data for predictions: the plane as coefficients, the rest as a sum over the training rows."""
        smooth, plane = process.kernel_.k1.k1, process.kernel_.k1.k2
        rows: FloatArray = process.X_train_
        alpha: FloatArray = spread * process.alpha_
        slope = plane.k1.constant_value
        self._plane = slope * (alpha @ rows)
        self._level = mean + slope * plane.k2.sigma_0**2 * float(alpha.sum())
        self._length = float(smooth.k2.length_scale)
        self._rows = rows / self._length
        self._weights = smooth.k1.constant_value * alpha

    def _predict(self, change: FloatArray) -> FloatArray:
        Z = (change - self._centre) / self._scale
        deviation = Z @ self._plane + self._level
        half = 0.5 * np.einsum("ij,ij->i", self._rows, self._rows)
        for start in range(0, len(Z), _CHUNK):
            part = Z[start : start + _CHUNK] / self._length
            exponent = part @ self._rows.T  # minus half the squared distance, computed term by term
            exponent -= half
            exponent -= 0.5 * np.einsum("ij,ij->i", part, part)[:, None]
            deviation[start : start + _CHUNK] += np.exp(exponent, out=exponent) @ self._weights
        return np.asarray(deviation)

    def _bulk(self) -> str:
        numbers = self._rows.size + self._weights.size
        return f"a prediction needs all {self.n_rows_} training rows ({numbers} numbers)"
