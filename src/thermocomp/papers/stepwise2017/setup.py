"""Computation of the study of stepwise2017; `thermocomp.papers.stepwise2017.redo` presents it."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from thermocomp.core.model import ErrorModel
from thermocomp.judging.robustness import Robustness, stress
from thermocomp.models.numerics.leastsquares import effective_sample_size
from thermocomp.models.numerics.stepwise import r_squared_of_f
from thermocomp.models.partial_f import PartialF
from thermocomp.papers import common
from thermocomp.papers.exported import predict_exported
from thermocomp.papers.study import FloatArray, Progress
from thermocomp.recordings.samples import Samples
from thermocomp.virtual.datasets import record

TARGET = "x1_um"
#: F to enter, whose symbol is missing in the text (E-T1), and F to delete (T-03)
F_ENTER, F_DELETE = 100.0, 50.0
#: number of temperatures kept in the paper's model, out of 24 (T-07); its bound on the residual [um] (T-08)
PAPERS_COUNT = 5
PAPERS_RESIDUAL = 5.0
#: methods by name in the study: the paper's and those compared (T-08), related methods (T-10), and ours
METHODS = {
    "stepwise": "partial-f",
    "least squares, all temperatures": "ols",
    "projection pursuit": "ppr",
    "principal components": "pcr",
    "principal components, points traversed": "pcr-traversal",
    "sliced inverse regression": "sir",
    "dynamic (not in the paper)": "dynamic",
    "averaged (recommended, not in the paper)": "averaged",
}
STEPWISE, LEAST, PURSUIT, COMPONENTS, TRAVERSED, SLICED, DYNAMIC, AVERAGED = METHODS
NONE = "no compensation"
#: row intervals for the effect of the number of rows on the F thresholds (E-T3)
THINNED = (1, 2, 4, 8, 16)


@dataclass(frozen=True, eq=False)
class Thinned:
    """Selection from a subset of the rows.

    Parameters
    ----------
    effective : float
        Effective sample size of the rows, from the residual.
    first : float
        R2 required for the first variable to enter.
    names : tuple of str
        Selected temperatures.
    rms : float
        RMS in the on-line test [um].
    """

    rows: int
    effective: float
    first: float
    names: tuple[str, ...]
    rms: float


@dataclass(frozen=True, eq=False)
class Computed:
    """All results of the study of stepwise2017.

    Parameters
    ----------
    fit, online : Samples
        Test used for training, and test on another day.
    models : dict of str to ErrorModel
        Models by the names of `METHODS`.
    absolute : float
        RMS of the stepwise model with absolute temperatures in the on-line test [um].
    exported : ndarray of shape (n_rows,)
        Deviation that the exported program of the stepwise model predicts in the on-line test [um].
    exported_by : str
        What ran the exported program.
    shaken : dict of str to Robustness
        Stepwise, the two compared methods and ours in the on-line test with noise and lost sensors.
    """

    fit: Samples
    online: Samples
    selection: PartialF
    models: dict[str, ErrorModel]
    thinned: tuple[Thinned, ...]
    absolute: float
    exported: FloatArray
    exported_by: str
    shaken: dict[str, Robustness]

    @cached_property
    def left_in_fit(self) -> dict[str, FloatArray]:
        """Residuals of each model in the test used for training [um]."""
        return _left(self.models, self.fit)

    @cached_property
    def left(self) -> dict[str, FloatArray]:
        """Residuals of each model in the on-line test [um]."""
        return _left(self.models, self.online)

    @cached_property
    def errors(self) -> dict[str, common.Errors]:
        """Error metrics of each model in the on-line test."""
        return {name: common.Errors.of(e) for name, e in self.left.items()}

    @cached_property
    def left_exported(self) -> FloatArray:
        """Residual of the exported program in the on-line test [um]."""
        return self.online.deviations[:, 0] - self.exported

    @cached_property
    def on_dsp(self) -> common.Errors:
        """Error metrics of the exported program in the on-line test."""
        return common.Errors.of(self.left_exported)

    @property
    def fitted(self) -> common.Errors:
        """Error metrics of the stepwise model in the test used for training."""
        return common.Errors.of(self.left_in_fit[STEPWISE])

    @property
    def chosen(self) -> tuple[str, ...]:
        """Temperatures in the stepwise model."""
        return self.selection.terms_

    @cached_property
    def worth(self) -> float:
        """Effective sample size of the training rows, from the residuals of the stepwise model."""
        return effective_sample_size(self.left_in_fit[STEPWISE])


def compute(seed: int, progress: Progress) -> Computed:
    """Run the tests and the computations of the paper."""
    progress(0.0, "the two tests")
    test, online = record("stepwise2017", seed=seed)[0], record("stepwise2017-online", seed=seed)[0]
    learn, judge = (common.stacked([t], [TARGET]) for t in (test, online))
    heat = [c.name for c in test.temperatures]
    warm, now = learn.only(heat), judge.only(heat)
    progress(0.1, "stepwise regression")
    selection = PartialF(f_enter=F_ENTER, f_delete=F_DELETE)
    models = common.fit_and_freeze(selection, warm, [TARGET])
    found = {STEPWISE: models[TARGET]}
    for k, (name, method) in enumerate(METHODS.items()):
        progress(0.2 + 0.07 * k, name)
        if name not in found:
            found[name] = common.trained(method, learn, support=common.PAPERS_SUPPORT)
    progress(0.8, "noise and lost sensors")
    measured = judge.deviations[:, 0]
    stressed = (STEPWISE, LEAST, PURSUIT, AVERAGED)
    shaken = {m: stress(found[m], judge, measured, common.every(judge)).robustness for m in stressed}
    progress(0.95, "fewer rows")
    thinned = tuple(_thinned(warm, now, step) for step in THINNED)
    raw, new = (common.stacked([r], [TARGET], heat, rezero=False) for r in (test, online))
    absolute = common.fit_and_freeze(PartialF(f_enter=F_ENTER, f_delete=F_DELETE), raw, [TARGET])[TARGET]
    exported, exported_by = predict_exported(found[STEPWISE], judge)
    return Computed(
        fit=learn,
        online=judge,
        selection=selection,
        models=found,
        thinned=thinned,
        absolute=common.rms(measured - common.predict_deviation(absolute, new)),
        exported=exported,
        exported_by=exported_by,
        shaken=shaken,
    )


def _thinned(warm: Samples, online: Samples, step: int) -> Thinned:
    some = warm.take(np.arange(0, len(warm), step))
    selection = PartialF(f_enter=F_ENTER, f_delete=F_DELETE)
    model = common.fit_and_freeze(selection, some, [TARGET])[TARGET]
    residual = some.deviations[:, 0] - selection.predict(some.frame())
    error = online.deviations[:, 0] - common.predict_deviation(model, online)
    return Thinned(
        rows=len(some),
        effective=effective_sample_size(residual),
        first=r_squared_of_f(F_ENTER, len(some) - 2),
        names=selection.terms_,
        rms=common.rms(error),
    )


def _left(models: dict[str, ErrorModel], samples: Samples) -> dict[str, FloatArray]:
    x = samples.deviations[:, 0]
    return {NONE: x} | {name: x - common.predict_deviation(model, samples) for name, model in models.items()}
