"""`arx` and `arx-free-run`: the deviation predicted from its own past and the spindle speed (P-01, P-02)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from thermocomp.core.autoregressive import Autoregressive
from thermocomp.core.exceptions import FitError, InputError
from thermocomp.core.inputs import Input
from thermocomp.core.model import ErrorModel
from thermocomp.models.base import FloatArray, IntArray
from thermocomp.models.clocked import Clocked, ClockedRegressor, Recursion, TriedSetting, rms, too_few
from thermocomp.models.numerics.freerun import Coefficients, output_error
from thermocomp.models.numerics.leastsquares import triangle
from thermocomp.models.selection import orders
from thermocomp.models.timed import Time


@dataclass(frozen=True, eq=False)
class _Setting:
    """Candidates to try: data at one interval, orders to choose from, with or without intercept."""

    data: Clocked
    ks: tuple[int, ...]
    ms: tuple[int, ...]
    intercept: bool


@dataclass(kw_only=True, eq=False, repr=False)
class ARX(ClockedRegressor):
    """Autoregressive model with inputs: dz(t) = sum_{i=1..k} a_i dz(t - ih) + sum_{i=0..m} b_i n(t - ih) (P-01).

    The recording is resampled to ticks at a fixed `interval`: the input at each tick is the mean of the inputs over the
    interval that ends there, and the displacement is interpolated at the tick (see `thermocomp.core.autoregressive`).

    With ``criterion`` ``"fpe"``, ``"aic"`` or ``"bic"`` the coefficients come from least squares on one-step errors,
    and the orders from that criterion (P-02); k = 0 is a candidate, so there is always an order whose free run decays.
    Orders whose free run does not decay within the length of the longest test are not admissible. One-step errors
    are trivially small, and the noise of the probe biases the coefficients (E-P3). With ``"free-run"`` the coefficients
    minimise the free-run error (see `thermocomp.models.numerics.freerun.output_error`), and the orders minimise the
    free-run error on left-out thermal cycles. The choice among several intervals always uses that error.

    Rows with cycle -1 are not used for training, but their inputs drive the model. Inputs that depend linearly on
    others, or are always zero, get no coefficient. Raises `FitError` if there is no input, if there are too few rows,
    or if the free run with the requested orders does not decay.

    With ``time="none"`` every row is treated as a steady state: only k = m = 0 can be learned, and `predict` returns
    the deviation at which the model settles.

    Parameters
    ----------
    inputs : sequence of str or int, optional
        Names (or indices) of the input columns: the spindle speed in the paper. Default: all columns. An empty sequence
        raises `FitError`, since it means that there is no spindle speed.
    interval : float or sequence of float, optional
        h [s], or several values to choose from. None: the usual time step of the recording. The paper uses 10 min.
    k, m : int, optional
        Orders; chosen automatically if None.
    k_max, m_max : int
        Maximum orders that are tried.
    criterion : {'fpe', 'aic', 'bic', 'free-run'}
    fit_intercept : bool or None
        False: no deviation without inputs, as in the paper. True: a deviation that builds up from the start of each
        test, such as from auxiliary units that run with the spindle. None: chosen by free run on left-out cycles.
    time : {'column', 'routed', 'none'} or None
        Source of the time, see `thermocomp.models.timed.TimedRegressor`; if None, `fit` raises an error.

    Attributes
    ----------
    k_, m_ : int
    interval_ : float
        [s]
    a_ : ndarray of shape (k,)
    b_ : ndarray of shape (m + 1, n_inputs_used)
        One row per lag, for the inputs in the order of `inputs`.
    intercept_ : float
    orders_ : tuple of Order
        Table of FPE, AIC and BIC at `interval_`; empty with ``"free-run"``.
    trials_ : tuple of TriedSetting
        Settings assessed in free run on left-out cycles; empty if there was nothing to choose.
    cv_rms_ : float
        RMS of the chosen setting; nan if none was assessed.
    chosen_by_ : str
        Description of the cross-validation folds.
    one_step_rms_, free_run_rms_ : float
        Errors on the training data [unit of y]; the first is trivially small, the second is that of the model in use.
    caution_ : str
        Limitation of the model (E-P6).

    References
    ----------
    The study of pre-compensation by revised NC programs: requirements P-01 to P-07.

    Akaike, H.: Fitting autoregressive models for prediction. Annals of the Institute of Statistical Mathematics 21,
    1969, 243-247.

    Ljung, L.: System Identification: Theory for the User. 2nd edition, Prentice Hall, 1999.

    Examples
    --------
    >>> import numpy as np
    >>> from thermocomp import ARX
    >>> dt = np.r_[np.inf, np.full(119, 600.0)]  # a row every 10 min [s]
    >>> speed = np.repeat([0.0, 3.0, 1.0, 4.0, 0.0, 2.0], 20)[:, None]  # [1000/min]
    >>> y = np.zeros(120)
    >>> for t in range(1, 120):
    ...     y[t] = 0.9 * y[t - 1] + 0.8 * speed[t, 0]
    >>> model = ARX(k=1, m=0, time="routed").fit(speed, y, dt=dt)
    >>> print(model.a_.round(3).tolist(), model.b_.round(3).tolist())
    [0.9] [[0.8]]
    """

    inputs: Sequence[str | int] | None = None
    interval: float | Sequence[float] | None = 600.0
    k: int | None = None
    m: int | None = None
    k_max: int = 5
    m_max: int = 5
    criterion: Literal["fpe", "aic", "bic", "free-run"] = "fpe"
    fit_intercept: bool | None = False
    time: Time | None = None

    def _learn(self, inputs: FloatArray, deviation: FloatArray, step: FloatArray, folds: IntArray) -> None:
        if self.criterion not in ("fpe", "aic", "bic", "free-run"):
            raise InputError(f"criterion {self.criterion!r}: expected fpe, aic, bic or free-run")
        ks, ms = self._orders(self.k, self.k_max, "k"), self._orders(self.m, self.m_max, "m")
        data = [Clocked.of(inputs, deviation, step, folds, h) for h in self._intervals(self.interval, step)]
        constants = (False, True) if self.fit_intercept is None else (self.fit_intercept,)
        if self.time == "none":  # no choice: no row has a past
            ks, ms, data, constants = ks[:1], ms[:1], data[:1], constants[:1]
        # one-step criteria choose among all orders in a single fit
        groups = [((k,), (m,)) for k in ks for m in ms] if self.criterion == "free-run" else [(ks, ms)]
        tried = [_Setting(d, k, m, c) for d in data for k, m in groups for c in constants]
        best = self._chosen([self._judge(t) for t in tried] if len(tried) > 1 else [])
        clocked = tried[best].data
        self._coefficients, self.orders_, self.one_step_rms_ = self._solve(tried[best], clocked.targets())
        self.interval_ = clocked.interval
        self.a_, self.b_, self.intercept_ = (c := self._coefficients).a, c.b, c.intercept
        self.k_, self.m_ = len(c.a), len(c.b) - 1
        self._note_free_run(clocked)

    @property
    def _recursion(self) -> Recursion:
        return self._coefficients

    def one_step(self, X: ArrayLike, y: ArrayLike, *, dt: ArrayLike | None = None) -> FloatArray:
        """Predict each tick from the measured displacements before it; for diagnosis only (E-P3).

        Parameters
        ----------
        X : array-like of shape (n_rows, n_features)
        y : array-like of shape (n_rows,)
            Measured deviation.
        dt : array-like of shape (n_rows,), optional
            As in `fit`.

        Returns
        -------
        ndarray of shape (n_predicted, 2)
            Measured and predicted deviation at all ticks with a sufficient past.
        """
        rows, step = self._given(X, dt)
        measured, folds = np.asarray(y, dtype=np.float64), np.zeros(len(rows), dtype=np.intp)
        data = Clocked.of(self._used(rows), measured, step, folds, self.interval_)
        work = data.lagged(data.targets(), self.k_, self.m_)
        return np.column_stack([work[:, -1], self._coefficients.one_step(work[:, :-1])])

    def _frozen(self, inputs: Sequence[Input], header: dict[str, Any]) -> ErrorModel:
        return Autoregressive(
            **header,
            inputs=tuple(inputs[j] for j in self._columns),
            interval=self.interval_,
            a=tuple(self.a_.tolist()),
            b=tuple(tuple(b) for b in self.b_.T.tolist()),
            intercept=self.intercept_,
        )

    # -- choice --------------------------------------------------------------------------------------------------------

    def _solve(
        self, setting: _Setting, targets: Sequence[FloatArray]
    ) -> tuple[Coefficients, tuple[orders.Order, ...], float]:
        """Return the coefficients of the best orders of a setting, the table of orders, and the one-step RMS error."""
        data, ks, ms, constant = setting.data, setting.ks, setting.ms, setting.intercept
        J = len(self._columns)
        if self.criterion == "free-run" and any(len(r.drive) > 1 for r in data.runs):
            least = output_error(data.runs, targets, ks[0], ms[0], intercept=constant, largest_root=data.largest_root)
            if least is None:
                raise FitError(too_few(sum(int(np.isfinite(t[1:]).sum()) for t in targets), ks[0], ms[0], data))
            work = data.lagged(targets, ks[0], ms[0])
            return least, (), rms(work[:, -1] - least.one_step(work[:, :-1]))
        while True:  # largest orders for which there are enough rows
            K, M = ks[-1], ms[-1]
            work = data.lagged(targets, K, M)
            if len(work) > K + (M + 1) * J + int(constant):
                break
            if len(ks) == len(ms) == 1:
                raise FitError(too_few(len(work), K, M, data))
            ks, ms = ks[: max(len(ks) - 1, 1)], ms[: max(len(ms) - 1, 1)]
        tri = triangle(work, intercept=constant)
        found = orders.compute_orders(tri, J, ks, ms, data.largest_root)
        chosen = orders.best(found, "fpe" if self.criterion == "free-run" else self.criterion)
        if chosen is None:
            raise FitError(
                f"k = {', '.join(map(str, ks))} at an interval of {data.interval:g} s: the largest root is "
                f"{min(o.largest_root for o in found):.6g}, so the free run does not decay within the data; use "
                "another interval, omit k and m so that they are chosen, or set criterion='free-run'"
            )
        k, m = chosen.k, chosen.m
        weights, intercept = orders.coefficients(tri, [*range(k), *range(K, K + (m + 1) * J)])
        found_at = Coefficients(weights[:k], weights[k:].reshape(m + 1, J), intercept)
        return found_at, found, math.sqrt(chosen.sse / chosen.n_rows)

    def _judge(self, setting: _Setting) -> TriedSetting:
        """Assess a setting by its free run on the folds, each left out in turn."""
        data, errors = setting.data, []
        for fold in range(int(data.folds.max()) + 1):
            try:
                c, *_ = self._solve(setting, data.targets(fold))
            except FitError:
                errors = [math.inf]
                break
            errors.append(data.free_run_rms(c, data.folds == fold))
        ks, ms = setting.ks, setting.ms
        return TriedSetting(
            interval=data.interval,
            k=max(ks),
            m=max(ms),
            intercept=setting.intercept,
            hidden=0,
            cv_rms=float(np.mean(errors)),
        )
