"""Computation of the study of pre-compensation; `thermocomp.papers.precompensation.redo` presents it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from scipy import interpolate

from thermocomp.core.correction import Correction, Deviation
from thermocomp.core.model import ErrorModel
from thermocomp.models.arx import ARX
from thermocomp.models.arx_net import NetARX
from thermocomp.models.selection.orders import Order
from thermocomp.papers.common import Errors, described, fit_and_freeze, predict_deviation, rms, stacked
from thermocomp.papers.study import FloatArray, Progress
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples
from thermocomp.virtual.climate import Climate
from thermocomp.virtual.datasets import find_experiment, record
from thermocomp.virtual.protocol import Experiment

SPEED = "spindle_rpm"
#: positions of Z with a drift model (P-04) [mm]
POSITIONS = (0, 200, 400, 600)
#: positions halfway between them [mm], and functions that interpolate there (P-04, P-07); nearest: the lower one
BETWEEN = (100, 300, 500)
NEAREST, LINEAR = "nearest model", "piecewise linear"
INTERPOLATIONS: Mapping[str, Callable[..., Any]] = {
    NEAREST: partial(interpolate.interp1d, kind="nearest", axis=1),
    LINEAR: partial(interpolate.interp1d, axis=1),
    "quadratic spline": partial(interpolate.interp1d, kind="quadratic", axis=1),
    "natural cubic spline": partial(interpolate.CubicSpline, bc_type="natural", axis=1),
    "cubic polynomial": partial(interpolate.BarycentricInterpolator, axis=1),
}
#: orders of the paper (P-02), and largest orders tried
PAPERS_ORDERS = (1, 0)
GREATEST = 5
#: "every 10 min" (P-06) [s], and other intervals tried
INTERVAL = 600.0
INTERVALS = (60.0, 120.0, 300.0, 600.0, 1200.0)
#: depth difference of the milled surfaces (P-07), without and with compensation [um]
PAPERS_DEPTHS = (7.0, 2.0)
#: criterion of the cutting tests: maximum remaining share of the depth difference, as in the paper
SHARE = PAPERS_DEPTHS[1] / PAPERS_DEPTHS[0]
#: number of cutting tests
CUTS = 8
#: duration of milling at the start and at the end of the spindle run of a cutting test [min]
MILLING = 5.0
#: names of the compared models
NONE = "no compensation"
NET, LEAST, CHOSEN = "net, k = 1, m = 0", "least squares, k = 1, m = 0", "least squares, orders by FPE"


@dataclass(frozen=True, eq=False)
class CuttingTest:
    """A cutting test: depth of the second surface relative to the first [um], per position of Z.

    Parameters
    ----------
    without, scheduled : ndarray of shape (n_positions,)
        Without compensation, and with a program corrected every ten minutes.
    """

    without: FloatArray
    scheduled: FloatArray

    @property
    def means(self) -> tuple[float, float]:
        """Mean magnitudes of both depth differences over the positions [um]."""
        return float(np.abs(self.without).mean()), float(np.abs(self.scheduled).mean())


@dataclass(frozen=True, eq=False)
class Warm:
    """A job that starts on a machine that is still warm (E-P5), at one position.

    Parameters
    ----------
    hours, drift : ndarray of shape (n_rows,)
        Time since the start of the job [h], and the drift since then [um].
    cold, carried : ndarray of shape (n_rows,)
        Residual [um] if the model starts cold, and if its state is carried over.
    """

    hours: FloatArray
    drift: FloatArray
    cold: FloatArray
    carried: FloatArray


@dataclass(frozen=True, eq=False)
class Computed:
    """All results of the study of precompensation.

    Parameters
    ----------
    learn, judge : Samples
        Identification data, and verification data under new conditions; one target per position.
    models : dict of str to list of ErrorModel
        Models by name, one per position.
    orders : list of tuple of Order
        Table of final prediction errors per position.
    hidden : list of int
        Number of hidden nodes of each neural net.
    one_step : float
        One-step-ahead RMS of least squares with k = 1, m = 0 over all positions [um].
    clocks : dict of float to (tuple of int, float, float)
        By interval [s], at the first position: orders by FPE, free-run RMS with these, and with k = 1, m = 0 [um].
    between : dict of str to list of CuttingTest
        Cutting tests at `BETWEEN`, by the name of the interpolation.
    room : float
        Peak-to-peak drift of Z of a machine at rest for a day [um]: no part of it can be predicted from the speed
        (E-P6).
    workshop : float
        RMS residual of the nets in the same verification, but in a workshop with a daily temperature cycle [um].
    """

    learn: Samples
    judge: Samples
    models: dict[str, list[ErrorModel]]
    orders: list[tuple[Order, ...]]
    hidden: list[int]
    one_step: float
    clocks: dict[float, tuple[tuple[int, int], float, float]]
    cuts: list[CuttingTest]
    between: dict[str, list[CuttingTest]]
    warm: Warm
    room: float
    workshop: float

    @cached_property
    def free_run(self) -> dict[str, FloatArray]:
        """Prediction of each model for the verification, (n_rows, n_positions) [um]."""
        return {name: at_positions(models, self.judge) for name, models in self.models.items()}

    @cached_property
    def left(self) -> dict[str, FloatArray]:
        """Residuals of each model in the verification, (n_rows, n_positions) [um]."""
        z = self.judge.deviations
        return {NONE: z} | {name: z - p for name, p in self.free_run.items()}

    @cached_property
    def errors(self) -> dict[str, Errors]:
        """Error metrics of each model in the verification, over all positions."""
        return {name: Errors.of(e) for name, e in self.left.items()}

    @property
    def scheduled(self) -> float:
        """RMS residual of the verification with the schedule of corrections [um]."""
        return rms(self.judge.deviations + self.schedule)

    @cached_property
    def schedule(self) -> FloatArray:
        """Values added to the programmed Z in the verification, by the nets, (n_rows, n_positions) [um]."""
        return schedule_corrections(self.judge.time, self.free_run[NET])

    @property
    def by_fpe(self) -> list[Order]:
        """Model orders with the smallest final prediction error, by position."""
        return [min((o for o in table if o.admissible), key=lambda o: o.fpe) for table in self.orders]

    @property
    def depths(self) -> tuple[float, float]:
        """Mean depth difference of all cutting tests, without and with the schedule [um]."""
        without, with_ = np.mean([k.means for k in self.cuts], axis=0)
        return float(without), float(with_)

    def shares(self, name: str) -> list[float]:
        """Return the explained share of the variance of the drift at each position."""
        return [described(e, z) for e, z in zip(self.left[name].T, self.judge.deviations.T, strict=True)]

    def interpolated(self, k: int, name: str) -> FloatArray:
        """Return the prediction for position k by linear interpolation between the models of all other positions."""
        others = [j for j in range(len(POSITIONS)) if j != k]
        nodes = [float(POSITIONS[j]) for j in others]
        return np.asarray(INTERPOLATIONS[LINEAR](nodes, self.free_run[name][:, others])(POSITIONS[k]))


def compute(seed: int, progress: Progress) -> Computed:
    """Run the tests and the computations of the paper."""
    progress(0.0, "identification and verification")
    learn, judge = (samples_of(r) for r in record("precompensation", seed=seed))
    targets = [c.name for c in learn.targets]
    timed: dict[str, Any] = {"dt": learn.dt(), "cycle": learn.cycle}
    models: dict[str, list[ErrorModel]] = {name: [] for name in (NET, LEAST, CHOSEN)}
    tables, hidden, steps = [], [], []
    for number, target in enumerate(targets):
        progress(0.1 + 0.1 * number, f"models at z = {POSITIONS[number]} mm")
        chosen, paper = _by_fpe_and_papers(INTERVAL)
        k, m = PAPERS_ORDERS
        net = NetARX(inputs=(SPEED,), time="routed", interval=INTERVAL, k=k, m=m, random_state=seed)
        for name, estimator in ((CHOSEN, chosen), (LEAST, paper), (NET, net)):
            models[name].append(fit_and_freeze(estimator, learn, [target], **timed)[target])
        tables.append(chosen.orders_)
        hidden.append(net.hidden_)
        ahead = paper.one_step(judge.frame(), judge.deviations[:, number], dt=judge.dt())
        steps.append(ahead[:, 0] - ahead[:, 1])
    progress(0.5, "other sampling intervals")
    clocks = {h: _clock(learn, judge, h, timed) for h in INTERVALS}
    progress(0.6, "cutting tests")
    cuts = [cut(record("precompensation-cut", seed=seed + n)[0], models[NET]) for n in range(CUTS)]
    there = changed("precompensation-cut", probes=tuple(f"z_at_{p}" for p in BETWEEN))
    tests = [record(there, seed=seed + n)[0] for n in range(CUTS)]
    between = {f: [cut(test, models[NET], BETWEEN, f) for test in tests] for f in INTERPOLATIONS}
    progress(0.9, "a warm machine, and another room")
    still = record("etve", seed=seed)[0]
    room = Errors.of(still.table["z_um"].to_numpy(dtype=np.float64)).peak_to_peak
    *_, verification = record(changed("precompensation", climate=Climate()), seed=seed)
    workshop = samples_of(verification)
    left = workshop.deviations - at_positions(models[NET], workshop)
    warm = warm_start(judge, models[NET][0])
    return Computed(
        learn=learn,
        judge=judge,
        models=models,
        orders=tables,
        hidden=hidden,
        one_step=rms(np.concatenate(steps)),
        clocks=clocks,
        cuts=cuts,
        between=between,
        warm=warm,
        room=room,
        workshop=rms(left),
    )


def samples_of(recording: Recording, positions: Sequence[int] = POSITIONS) -> Samples:
    """Return samples of the drift of Z at some positions, with the spindle speed as the only input (P-01)."""
    return stacked([recording], [f"z_at_{p}_um" for p in positions], [SPEED])


def changed(name: str, **settings: Any) -> Experiment:
    """Return the same tests with other settings, such as a workshop instead of a measuring room."""
    experiment = find_experiment(name)
    return replace(experiment, tests=tuple(replace(plan, **settings) for plan in experiment.tests))


def at_positions(models: Sequence[ErrorModel], samples: Samples) -> FloatArray:
    """Return the free-run prediction of the model of each position, (n_rows, n_positions) [um]."""
    return np.column_stack([predict_deviation(m, samples) for m in models])


def schedule_corrections(time: FloatArray, predictions: FloatArray) -> FloatArray:
    """Return the values added to the programmed Z: computed every ten minutes and held in between (P-06).

    Parameters
    ----------
    time : ndarray of shape (n_rows,)
        Time since the start of the program [s].
    predictions : ndarray of shape (n_rows, n_positions)
        Deviation, actual minus commanded [um].

    Returns
    -------
    ndarray of shape (n_rows, n_positions)
        [um]; minus the deviation (E-P4).
    """
    begins = np.searchsorted(time, np.floor(time / INTERVAL + 1e-9) * INTERVAL - 1e-6)
    opposed = np.vectorize(lambda d: Correction.opposing(Deviation(d)).offset, otypes=[np.float64])
    return np.asarray(opposed(predictions[begins]), dtype=np.float64)


def cut(
    recording: Recording, models: Sequence[ErrorModel], positions: Sequence[int] = POSITIONS, function: str = LINEAR
) -> CuttingTest:
    """Simulate milling a surface cold and another after an hour, without and with a corrected program (P-07).

    Parameters
    ----------
    positions : sequence of int
        Positions of the surfaces [mm].
    function : str
        Interpolation between the models, of `INTERPOLATIONS`.
    """
    samples = samples_of(recording, positions)
    running = np.flatnonzero(samples.values[:, 0] > 0)
    minutes = samples.time / 60
    first = (minutes >= minutes[running[0]]) & (minutes < minutes[running[0]] + MILLING)
    last = (minutes > minutes[running[-1]] - MILLING) & (minutes <= minutes[running[-1]])
    z = samples.deviations
    predicted = INTERPOLATIONS[function](POSITIONS, at_positions(models, samples))(positions)
    corrected = z + schedule_corrections(samples.time, predicted)
    return CuttingTest(*(values[last].mean(axis=0) - values[first].mean(axis=0) for values in (z, corrected)))


def warm_start(judge: Samples, model: ErrorModel) -> Warm:
    """Start a job in the middle of the verification: the part is probed then, so the drift is relative to that time."""
    late = np.arange(len(judge)) >= len(judge) // 2
    job = judge.take(late)
    job = replace(job, time=job.time - job.time[0])
    drift = job.deviations[:, 0] - job.deviations[0, 0]
    carried, cold = predict_deviation(model, judge)[late], predict_deviation(model, job)
    return Warm(job.time / 3600, drift, drift - (cold - cold[0]), drift - (carried - carried[0]))


def _by_fpe_and_papers(interval: float) -> tuple[ARX, ARX]:
    """Return least squares for an interval [s]: with orders chosen by FPE, and with those of the paper."""
    k, m = PAPERS_ORDERS
    step: dict[str, Any] = {"inputs": (SPEED,), "time": "routed", "interval": interval}
    return ARX(**step, k_max=GREATEST, m_max=GREATEST), ARX(**step, k=k, m=m)


def _clock(
    learn: Samples, judge: Samples, interval: float, timed: Mapping[str, Any]
) -> tuple[tuple[int, int], float, float]:
    target, z = learn.targets[0].name, judge.deviations[:, 0]
    chosen, paper = _by_fpe_and_papers(interval)
    left, least = (
        rms(z - predict_deviation(fit_and_freeze(e, learn, [target], **timed)[target], judge)) for e in (chosen, paper)
    )
    return (chosen.k_, chosen.m_), left, least
