"""`arx-net`: a neural net that predicts the next deviation from the last ones and the spindle speed (P-03)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from joblib import Parallel, delayed
from sklearn import config_context
from sklearn.utils import check_random_state

from thermocomp.core.autoregressive import AutoregressiveNet
from thermocomp.core.exceptions import FitError, InputError
from thermocomp.core.inputs import Input
from thermocomp.core.network import Affine, Perceptron
from thermocomp.models.arx import ARX
from thermocomp.models.base import FloatArray, IntArray
from thermocomp.models.clocked import Clocked, ClockedRegressor, Recursion, TriedSetting, too_few
from thermocomp.models.numerics import ticks
from thermocomp.models.numerics.backprop import learning_rates, scaling_in, scaling_out, train_net
from thermocomp.models.numerics.ticks import TickedRun
from thermocomp.models.timed import Time

#: ticks after which a row without time is regarded as settled
SETTLED = 2000


class _Net:
    """A trained neural net with its scaling: computes one tick, or a free run."""

    def __init__(self, net: Perceptron, scale_in: Affine, scale_out: Affine, k: int, m: int) -> None:
        self.net, self.scale_in, self.scale_out, self.k, self.m = net, scale_in, scale_out, k, m

    def tick(self, regressors: FloatArray) -> FloatArray:
        return self.scale_out(self.net.evaluate(self.scale_in(regressors)))[..., 0]

    def ticked(self, run: TickedRun) -> FloatArray:
        """Return the deviation at each tick in free run from a cold start."""
        k, n = self.k, len(run.drive)
        own = np.zeros(n + k)  # preceded by k ticks at rest
        driven = ticks.regressors(np.empty(0), run.drive, np.arange(n), 0, self.m, run.drive)
        row = np.empty(k + driven.shape[1])
        for t in range(1, n):
            row[:k] = own[t : t + k][::-1]  # own[t + k] is dz(t)
            row[k:] = driven[t]
            own[t + k] = self.tick(row)
        return own[k:]

    def at_rows(self, run: TickedRun) -> FloatArray:
        """Return the deviation at each row of the test in free run from a cold start."""
        ticked = self.ticked(run)
        return ticks.interpolate_at_rows(
            run, ticked, lambda t, now: self.tick(ticks.regressors(ticked, run.drive, t + 1, self.k, self.m, now))
        )

    def settled(self, inputs: FloatArray) -> FloatArray:
        """Return the state of the free run after many ticks with constant inputs."""
        own = np.zeros((len(inputs), max(self.k, 1)))
        driven = np.tile(inputs, self.m + 1)
        for _ in range(SETTLED if self.k else 1):
            value = self.tick(np.hstack([own[:, : self.k], driven]))
            same = np.array_equal(value, own[:, 0])
            own = np.column_stack([value, own[:, :-1]])
            if same:
                break
        return own[:, 0]


@dataclass(kw_only=True, eq=False, repr=False)
class NetARX(ClockedRegressor):
    """Back-propagation net for dz(t) from dz(t-h) .. dz(t-kh) and n(t) .. n(t-mh) (P-03, E-P2).

    The net is trained on measured displacements one step ahead, as in the paper, at the same intervals as `ARX`; the
    number of hidden nodes minimises the free-run error on left-out thermal cycles, which replaces the paper's trial and
    error. Its sigmoid output keeps the free run within the trained displacements, extended by an eighth at either end:
    it cannot diverge. Raises `FitError` if there is no input or too few rows.

    With ``time="none"`` every row is treated as a steady state, and the net is trained with k = m = 0.

    Parameters
    ----------
    inputs : sequence of str or int, optional
        As for `ARX`: the spindle speed in the paper.
    interval : float or None
        h [s]; None: the usual time step of the recording. If steps are much shorter than the time constants of the
        machine, dz(t) and dz(t-h) differ by less than a net can learn.
    k, m : int or None
        Orders; None: those of the linear model with the smallest final prediction error (P-02, E-P2).
    hidden : int or sequence of int
        Numbers of hidden nodes to choose from.
    epochs : int
    rate, final_rate : float
        Learning rate in the first and in the last epoch.
    momentum : float
        Share of the previous change that is added to the next one.
    random_state : int
        Seed of the initial weights and of the order of the patterns.
    jobs : int
        Number of threads for training.
    time : {'column', 'routed', 'none'} or None
        Source of the time, see `thermocomp.models.timed.TimedRegressor`; if None, `fit` raises an error.

    Attributes
    ----------
    k_, m_, hidden_ : int
    interval_ : float
        [s]
    net_ : Perceptron
    trials_ : tuple of TriedSetting
        Numbers of hidden nodes that were assessed; empty if there was nothing to choose.
    cv_rms_ : float
    chosen_by_ : str
    free_run_rms_ : float
        Error on the training data [unit of y].
    caution_ : str
        Limitation of the model (E-P6).

    References
    ----------
    The study of pre-compensation by revised NC programs: requirements P-01 to P-07.

    Narendra, K. S., Parthasarathy, K.: Identification and control of dynamical systems using neural networks. IEEE
    Transactions on Neural Networks 1(1), 1990, 4-27. doi:10.1109/72.80202

    Rumelhart, D. E., Hinton, G. E., Williams, R. J.: Learning representations by back-propagating errors. Nature 323,
    1986, 533-536. doi:10.1038/323533a0

    Examples
    --------
    >>> import numpy as np
    >>> from thermocomp import NetARX
    >>> dt = np.r_[np.inf, np.full(119, 600.0)]  # a row every 10 min [s]
    >>> speed = np.repeat([0.0, 3.0, 1.0, 4.0, 0.0, 2.0], 20)[:, None]  # [1000/min]
    >>> y = np.zeros(120)
    >>> for t in range(1, 120):
    ...     y[t] = 0.9 * y[t - 1] + 0.8 * speed[t, 0]
    >>> model = NetARX(hidden=4, epochs=10_000, time="routed").fit(speed, y, dt=dt)
    >>> print(model.hidden_, f"{model.free_run_rms_:.0f} of {np.ptp(y):.0f} um")
    4 2 of 29 um
    """

    inputs: Sequence[str | int] | None = None
    interval: float | None = 600.0
    k: int | None = 1
    m: int | None = 0
    hidden: int | Sequence[int] = (2, 3, 4, 6, 8)
    epochs: int = 10_000
    rate: float = 0.5
    final_rate: float = 0.02
    momentum: float = 0.0
    random_state: int = 0
    jobs: int = 2
    time: Time | None = None

    def _learn(self, inputs: FloatArray, deviation: FloatArray, step: FloatArray, folds: IntArray) -> None:
        sizes = tuple(int(h) for h in np.atleast_1d(self.hidden))
        if not sizes or min(sizes) < 1:
            raise InputError(f"hidden = {self.hidden}: expected numbers of nodes, each at least 1")
        h = self._intervals(self.interval, step)[0]
        data = Clocked.of(inputs, deviation, step, folds, h)
        self.k_, self.m_ = (0, 0) if self.time == "none" else self._chosen_orders(inputs, deviation, step, folds)
        judged: list[TriedSetting] = []
        if len(sizes) > 1 and self.time != "none":
            jobs = [(size, fold) for size in sizes for fold in range(int(folds.max()) + 1)]
            errors = Parallel(n_jobs=self.jobs, prefer="threads")(delayed(self._judge)(data, *job) for job in jobs)
            means = np.reshape(errors, (len(sizes), -1)).mean(axis=1).tolist()
            judged = [
                TriedSetting(interval=h, k=self.k_, m=self.m_, intercept=False, hidden=size, cv_rms=mean)
                for size, mean in zip(sizes, means, strict=True)
            ]
        self.hidden_, self.interval_ = sizes[self._chosen(judged)], h
        self._net = self._train(data, self.hidden_, None)
        self.net_ = self._net.net
        self._note_free_run(data)

    @property
    def _recursion(self) -> Recursion:
        return self._net

    def _frozen(self, inputs: Sequence[Input], header: dict[str, Any]) -> AutoregressiveNet:
        return AutoregressiveNet(
            **header,
            inputs=tuple(inputs[j] for j in self._columns),
            interval=self.interval_,
            k=self.k_,
            m=self.m_,
            net=self._net.net,
            input_scaling=self._net.scale_in,
            output_scaling=self._net.scale_out,
        )

    # -- choice --------------------------------------------------------------------------------------------------------

    def _chosen_orders(self, inputs: FloatArray, y: FloatArray, step: FloatArray, cycle: IntArray) -> tuple[int, int]:
        self._orders(self.k, 0, "k")
        self._orders(self.m, 0, "m")
        if self.k is not None and self.m is not None:
            return self.k, self.m
        with config_context(enable_metadata_routing=False):  # the steps were already checked
            linear = ARX(interval=self.interval, k=self.k, m=self.m, time="routed").fit(inputs, y, dt=step, cycle=cycle)
        return linear.k_, linear.m_

    def _train(self, data: Clocked, size: int, without: int | None) -> _Net:
        table = data.lagged(data.targets(without), self.k_, self.m_)
        if len(table) < 2:
            raise FitError(too_few(len(table), self.k_, self.m_, data))
        X, y = table[:, :-1], table[:, -1]
        scale_in = scaling_in(X.min(axis=0), X.max(axis=0))
        low, high = y.min(keepdims=True), y.max(keepdims=True)
        seed = check_random_state(self.random_state).randint(2**31 - 1)
        trained = train_net(
            scale_in(X),
            scaling_in(low, high)(y[:, None]),
            size,
            rng=np.random.default_rng(seed),
            rates=learning_rates(self.epochs, self.rate, self.final_rate, "geometric"),
            momentum=self.momentum,
        )
        return _Net(trained.net, scale_in, scaling_out(low, high), self.k_, self.m_)

    def _judge(self, data: Clocked, size: int, fold: int) -> float:
        """Return the free-run RMS on one left-out fold; inf if the remaining rows are too few."""
        try:
            net = self._train(data, size, fold)
        except FitError:
            return math.inf
        return data.free_run_rms(net, data.folds == fold)
