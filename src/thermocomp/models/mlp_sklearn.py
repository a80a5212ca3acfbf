"""`mlp-sklearn`: scikit-learn's multilayer perceptron, for comparison."""

import warnings
from dataclasses import dataclass
from typing import Literal

import numpy as np
from sklearn.exceptions import ConvergenceWarning

from thermocomp.core.network import Activation, Affine, Perceptron
from thermocomp.models.base import FloatArray, StaticRegressor
from thermocomp.models.nets import NetRegressor, thin_rows
from thermocomp.models.numerics.backprop import constant

_NAMES: dict[str, Activation] = {"logistic": "sigmoid", "tanh": "tanh"}


@dataclass(kw_only=True, eq=False, repr=False)
class SklearnNet(StaticRegressor, NetRegressor):
    """`sklearn.neural_network.MLPRegressor` with one hidden layer, inputs and targets standardised.

    Its output is linear: it extrapolates beyond the trained range, where Chen's net saturates. Constant channels are
    ignored.

    Parameters
    ----------
    hidden : int
        Number of hidden nodes.
    activation : {'logistic', 'tanh'}
        Activation of the hidden nodes.
    solver : {'lbfgs', 'adam', 'sgd'}
    alpha : float
        L2 regularization strength.
    max_iter : int
        Maximum number of iterations of the solver.
    max_patterns : int
        Maximum number of training rows; longer data are thinned evenly in time.
    seed : int
        Seed of the initial weights and of the order of the patterns.

    Attributes
    ----------
    converged_ : bool
        False: the solver did not converge, as noted in `caution_`.
    n_iter_ : int
        Number of iterations of the solver.
    net_, input_scaling_, output_scaling_, n_parameters_, n_patterns_, n_effective_, caution_, data_min_, data_max_
        See `thermocomp.models.nets.NetRegressor`.

    References
    ----------
    Pedregosa, F., et al.: Scikit-learn: machine learning in Python. Journal of Machine Learning Research 12, 2011,
    2825-2830.

    Examples
    --------
    >>> import numpy as np
    >>> from thermocomp import SklearnNet
    >>> rises = np.random.default_rng(0).uniform(0, 10, (100, 2))  # of two temperatures [degC]
    >>> y = 20 * np.sin(rises[:, 0] / 4) + rises[:, 1]
    >>> model = SklearnNet(hidden=6).fit(rises, y)
    >>> print(model.n_parameters_, round(model.score(rises, y), 2))
    25 1.0
    """

    hidden: int = 20
    activation: Literal["logistic", "tanh"] = "logistic"
    solver: Literal["lbfgs", "adam", "sgd"] = "lbfgs"
    alpha: float = 1e-4
    max_iter: int = 1000
    max_patterns: int = 2000
    seed: int = 0

    def _fit(self, change: FloatArray, deviation: FloatArray) -> None:
        from sklearn.neural_network import MLPRegressor  # slow to import, and unused by other methods

        (gain, offset, _), (out_gain, out_offset, unit) = _standard(change), _standard(deviation)
        into = Affine(tuple(gain.tolist()), tuple(offset.tolist()))
        rows = thin_rows(len(change), self.max_patterns)
        targets = deviation[rows] * out_gain + out_offset
        peer = MLPRegressor(
            hidden_layer_sizes=(self.hidden,),
            activation=self.activation,
            solver=self.solver,
            alpha=self.alpha,
            max_iter=self.max_iter,
            random_state=self.seed,
        )
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", ConvergenceWarning)
            peer.fit(into(change[rows]), targets[:, 0] if targets.shape[1] == 1 else targets)
        unfinished = [w for w in caught if issubclass(w.category, ConvergenceWarning)]
        for other in caught:
            if other not in unfinished:
                warnings.warn_explicit(other.message, other.category, other.filename, other.lineno)
        (first, second), (first_thresholds, second_thresholds) = peer.coefs_, peer.intercepts_
        net = Perceptron.of(
            first.T, first_thresholds, second.T, second_thresholds, hidden=_NAMES[self.activation], output="identity"
        )
        out_of = Affine(tuple(unit.tolist()), tuple(deviation.mean(axis=0).tolist()))
        self._keep(net, into, out_of, change, deviation, rows.size)
        self.converged_, self.n_iter_ = not unfinished, int(peer.n_iter_)
        if unfinished:
            first_line = str(unfinished[0].message).splitlines()[0].rstrip(":.")
            self.caution_ = "; ".join(
                filter(None, [f"scikit-learn's solver stopped early: {first_line}", self.caution_])
            )


def _standard(values: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return gain and offset that standardise channels, and their standard deviations; all 0 for constant channels."""
    still = constant(values.min(axis=0), values.max(axis=0))
    deviation = np.where(still, 0.0, values.std(axis=0))
    gain = 1.0 / np.where(still, np.inf, deviation)
    return gain, -gain * values.mean(axis=0), deviation
