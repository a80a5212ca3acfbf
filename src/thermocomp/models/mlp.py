"""`mlp`: Chen's net with sigmoids in both layers, trained by backpropagation (Chen, Yuan, Ni 1996, section 4)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import ArrayLike

from thermocomp.core.exceptions import InputError
from thermocomp.core.network import Affine
from thermocomp.models.base import FloatArray, IntArray
from thermocomp.models.nets import NetRegressor, thin_rows
from thermocomp.models.numerics.backprop import TrainedNet, constant, learning_rates, scaling_in, scaling_out, train_net

#: consecutive hidden-node counts without improvement that end a sweep
PATIENCE = 2


@dataclass(frozen=True)
class HiddenCount:
    """One step of a sweep over the number of hidden nodes.

    Parameters
    ----------
    rms : tuple of float
        RMS of the residual in each left-out cycle, over all outputs [unit of y].
    """

    n_hidden: int
    rms: tuple[float, ...]

    @property
    def mean(self) -> float:
        """Mean RMS over the cycles."""
        return float(np.mean(self.rms))

    @property
    def standard_error(self) -> float:
        """Standard error of `mean`."""
        return float(np.std(self.rms, ddof=1) / np.sqrt(len(self.rms))) if len(self.rms) > 1 else 0.0


@dataclass(kw_only=True, eq=False, repr=False)
class SigmoidNet(NetRegressor):
    """Chen's neural network: sigmoids in one hidden layer and in the outputs, trained by backpropagation.

    Inputs and targets are scaled to 0.1 .. 0.9 (C-28), a constant channel to 0.5. Since a sigmoid stays between 0 and
    1, a prediction cannot leave the range of y by more than an eighth of that range at either end: the net saturates
    where other models extrapolate.

    Initial weights are uniform in -0.3 .. 0.3 (C-29). Chen starts with a learning rate of 0.5 and decreases it
    continuously but does not state how: here it decreases to `final_learning_rate` by `schedule`. Chen also does not
    state the order of the patterns or the number of epochs.

    Parameters
    ----------
    hidden : int or sequence of int
        Number of hidden nodes; Chen uses 20 for the spindle drifts and 8 for the slope (C-26, C-27). If several numbers
        are given, the best is chosen by cross-validation over the thermal cycles of the data given to `fit`: the
        numbers are tried in ascending order until two in a row bring no improvement, and the smallest number is chosen
        whose mean RMS is within one standard error of the best.
    n_epochs : int
        Number of passes through the patterns.
    learning_rate, final_learning_rate : float
        Learning rate in the first and in the last epoch.
    schedule : {'geometric', 'harmonic'}
        See `thermocomp.models.numerics.backprop.learning_rates`.
    update : {'pattern', 'batch'}
        Change the weights after every pattern, as Chen does, or once per epoch by the mean over all patterns (C-30).
    order : {'shuffled', 'fixed'}
        Order of the patterns, see `thermocomp.models.numerics.backprop.train_net`.
    momentum : float
        Share of the previous weight change that is added to the next; Chen uses none.
    scaling : {'channel', 'common'}
        Scale each input by its own range, which Chen found to be better, or all inputs by their common range. Each
        target is always scaled by its own range.
    max_patterns : int
        Maximum number of training rows; longer data are thinned evenly in time, since neighbouring rows of a drift test
        are nearly equal and training time is proportional to their number.
    goal : float
        Stop after the first epoch whose loss does not exceed this; see `loss_history_`.
    seed : int
        Seed of the initial weights and of the order of the patterns.
    jobs : int
        Number of threads for a sweep; -1 for all cores.

    Attributes
    ----------
    n_hidden_ : int
        Number of hidden nodes.
    loss_history_ : ndarray of shape (n_epochs run,)
        Mean squared error in each epoch [scaled units], accumulated while the weights change.
    sweep_ : tuple of HiddenCount
        Numbers of hidden nodes that were tried; empty if `hidden` is a single number.
    chosen_by_ : str
        Description of the cross-validation folds.
    net_, input_scaling_, output_scaling_, n_parameters_, n_patterns_, n_effective_, caution_, data_min_, data_max_
        See `thermocomp.models.nets.NetRegressor`.

    References
    ----------
    Chen, J. S., Yuan, J., Ni, J.: Thermal Error Modelling for Real-Time Error Compensation. The International Journal
    of Advanced Manufacturing Technology 12, 1996.

    Rumelhart, D. E., Hinton, G. E., Williams, R. J.: Learning representations by back-propagating errors. Nature 323,
    1986, 533-536. doi:10.1038/323533a0

    Examples
    --------
    >>> import numpy as np
    >>> from thermocomp import SigmoidNet
    >>> rises = np.random.default_rng(0).uniform(0, 10, (100, 2))  # of two temperatures [degC]
    >>> y = 20 * np.sin(rises[:, 0] / 4) + rises[:, 1]
    >>> model = SigmoidNet(hidden=6, n_epochs=2000).fit(rises, y)
    >>> print(model.n_parameters_, round(model.score(rises, y), 2))
    25 0.98
    """

    hidden: int | Sequence[int] = 20
    n_epochs: int = 5000
    learning_rate: float = 0.5
    final_learning_rate: float = 0.01
    schedule: Literal["geometric", "harmonic"] = "geometric"
    update: Literal["pattern", "batch"] = "pattern"
    order: Literal["shuffled", "fixed"] = "shuffled"
    momentum: float = 0.0
    scaling: Literal["channel", "common"] = "channel"
    max_patterns: int = 2000
    goal: float = 0.0
    seed: int = 0
    jobs: int = -1

    def fit(
        self,
        X: ArrayLike,
        y: ArrayLike,
        *,
        cycle: ArrayLike | None = None,
        progress: Callable[[str], None] | None = None,
    ) -> "SigmoidNet":
        """Fit the neural net.

        Parameters
        ----------
        X : array-like of shape (n_rows, n_features)
            Inputs minus their reference.
        y : array-like of shape (n_rows,) or (n_rows, n_outputs)
            Deviation.
        cycle : array-like of int of shape (n_rows,), optional
            Thermal cycle of each row, for the choice of the number of hidden nodes; rows with cycle -1 are not used for
            training. Default: five blocks of equal length replace the cycles.
        progress : callable, optional
            Receives the intermediate results of a sweep. After an interrupt (KeyboardInterrupt) the fit continues with
            the counts tried so far, as noted in `chosen_by_`.

        Returns
        -------
        SigmoidNet

        Raises
        ------
        FitError
            Fewer than two training rows.
        InputError
            A setting is out of its range.
        """
        change, deviation, folds, left_out = self._learned(X, y, cycle)
        self.sweep_: tuple[HiddenCount, ...] = ()
        if np.ndim(self.hidden):
            self._sweep(change, deviation, folds, left_out, progress)
        else:
            self.n_hidden_, self.chosen_by_ = int(np.asarray(self.hidden)), "given"
        trained, into, out_of = self._trained(change, deviation, self.n_hidden_, np.random.default_rng(self.seed))
        self.loss_history_ = trained.losses
        self._keep(trained.net, into, out_of, change, deviation, min(len(change), self.max_patterns))
        return self

    def _trained(
        self, X: FloatArray, y: FloatArray, n_hidden: int, rng: np.random.Generator
    ) -> tuple[TrainedNet, Affine, Affine]:
        """Train a net; return the net, the input scaling and the output scaling."""
        into, out_of = self._input_scaling(X), scaling_out(y.min(axis=0), y.max(axis=0))
        rows = thin_rows(len(X), self.max_patterns)
        trained = train_net(
            into(X[rows]),
            scaling_in(y.min(axis=0), y.max(axis=0))(y[rows]),
            n_hidden,
            rng=rng,
            rates=learning_rates(self.n_epochs, self.learning_rate, self.final_learning_rate, self.schedule),
            update=self.update,
            order=self.order,
            momentum=self.momentum,
            goal=self.goal,
        )
        return trained, into, out_of

    def _input_scaling(self, X: FloatArray) -> Affine:
        low, high = X.min(axis=0), X.max(axis=0)
        if self.scaling == "common":
            moving = ~constant(low, high)
            if moving.any():
                low[moving], high[moving] = low[moving].min(), high[moving].max()
        elif self.scaling != "channel":
            raise InputError(f"scaling {self.scaling!r}: expected 'channel' or 'common'")
        return scaling_in(low, high)

    def _sweep(
        self,
        X: FloatArray,
        y: FloatArray,
        folds: IntArray,
        left_out: str,
        progress: Callable[[str], None] | None,
    ) -> None:
        """Select the number of hidden nodes by cross-validation (C-26)."""
        counts = sorted({int(h) for h in np.atleast_1d(np.asarray(self.hidden))})
        if not counts:
            raise InputError(f"hidden = {self.hidden}: expected at least one number of hidden nodes to choose from")

        def rms(n_hidden: int, fold: int) -> float:
            rest, mine = folds != fold, folds == fold
            rng = np.random.default_rng([self.seed, n_hidden, fold])
            trained, into, out_of = self._trained(X[rest], y[rest], n_hidden, rng)
            residual = y[mine] - out_of(trained.net.evaluate(into(X[mine])))
            return float(np.sqrt(np.mean(residual**2)))

        tried: list[HiddenCount] = []
        self.chosen_by_ = left_out
        numbers = range(int(folds.max()) + 1)
        try:
            with Parallel(n_jobs=self.jobs, prefer="threads") as pool:
                for n_hidden in counts:
                    tried.append(HiddenCount(n_hidden, tuple(pool(delayed(rms)(n_hidden, k) for k in numbers))))
                    if progress is not None:
                        progress(f"{n_hidden} hidden nodes: RMS {tried[-1].mean:.4g} in {left_out}")
                    if len(tried) - 1 - int(np.argmin([t.mean for t in tried])) >= PATIENCE:
                        break
        except KeyboardInterrupt:
            if not tried:
                raise
            self.chosen_by_ += f"; interrupted after {tried[-1].n_hidden} hidden nodes"
        best = min(tried, key=lambda t: t.mean)
        self.sweep_ = tuple(tried)
        self.n_hidden_ = min(t.n_hidden for t in tried if t.mean <= best.mean + best.standard_error)
