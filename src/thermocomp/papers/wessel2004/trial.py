"""Wessel's two steps: transformations are learned from some tests, displacements estimated in another (W-05)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from thermocomp.core.inputs import Support
from thermocomp.judging.replay import replay
from thermocomp.models.ace import ACE
from thermocomp.models.ace_monotone import MonotoneACE
from thermocomp.models.base import ThermalRegressor
from thermocomp.models.dynamic import DynamicRidge
from thermocomp.models.ols import LeastSquares
from thermocomp.papers import common
from thermocomp.papers.claims import Facts
from thermocomp.papers.common import errors_table, every, fit_and_freeze, predict_deviation, rms, trained
from thermocomp.papers.pictures import curves
from thermocomp.papers.study import BoolArray, FloatArray, Panel, StudyTable
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples

ACE_NAME = "ACE"
MLR_NAME = "multiple linear regression"
NONE_NAME = "no compensation"
#: the recommended method of this package, not one of the paper
AVERAGED = "averaged"
#: name of a method with temperatures relative to the start of each test
FROM_START = "{}, from each start"
#: maximum number of sweeps by the paper's rule: they end when the error no longer decreases, which may take long
SWEEPS = 20_000
#: maximum slight difference as a share of the displacement's span: visible limit in a figure
SLIGHT = 0.01
#: number of equal intervals of a temperature in which the width of its loop is sought
LOOP_STEPS = 20


@dataclass(frozen=True, eq=False)
class MillingTrial:
    """One displacement, with a model trained on some tests and used in another.

    Parameters
    ----------
    learned, unseen : Samples
        Temperatures as read [degC].
    ace : ACE
        ACE of the paper: boxcar of N = 10, k = 2.
    estimates : dict of str to ndarray of shape (n_unseen,)
        Estimates in the unseen test, by method [um].
    fits : dict of str to ndarray of shape (n_learned,)
        Estimates in the tests used for training, by method [um].
    flagged : ndarray of bool of shape (n_unseen,)
        Whether a temperature is outside the training range: the guard of the frozen model.
    """

    learned: Samples
    unseen: Samples
    ace: ACE
    estimates: dict[str, FloatArray]
    fits: dict[str, FloatArray]
    flagged: BoolArray

    @property
    def target(self) -> str:
        """Name of the displacement channel."""
        return self.unseen.targets[0].name

    @property
    def measured(self) -> FloatArray:
        """Measured displacements of the unseen test [um]."""
        return self.unseen.deviations[:, 0]

    @property
    def beyond(self) -> BoolArray:
        """Rows of the unseen test with a displacement outside the training range by more than `SLIGHT` of its span."""
        seen = self.learned.deviations[:, 0]
        margin = SLIGHT * np.ptp(seen)
        return np.asarray((self.measured < seen.min() - margin) | (self.measured > seen.max() + margin))

    def residual(self, method: str) -> FloatArray:
        """Return measured minus estimated in the unseen test [um].

        Returns
        -------
        ndarray of shape (n_unseen,)
        """
        return self.measured - self.estimates[method]

    def rms(self, method: str) -> float:
        """Return the root mean square of the residual of one of `estimates` in the unseen test [um]."""
        return rms(self.residual(method))

    def fit_rms(self, method: str) -> float:
        """Return the root mean square of the residual of one of `fits` in the tests used for training [um]."""
        return rms(self.learned.deviations[:, 0] - self.fits[method])

    def numbers(self, prefix: str) -> dict[str, float]:
        """Return the numbers reported for every trial, with a prefix to their names."""
        return {
            f"{prefix}_psi": self.ace.psi_,
            f"{prefix}_falling_theta": self.ace.falling_theta_,
            f"{prefix}_loop_width": loop_width(self.learned),
            f"{prefix}_flagged": float(self.flagged.mean()),
            f"{prefix}_none_rms_um": rms(self.measured),
        }

    def rms_by_method(self, prefix: str) -> dict[str, float]:
        """Return the RMS residuals by the short names of the methods, with a prefix."""
        short = {"ace": ACE_NAME, "mlr": MLR_NAME, "ace_monotone": "ace-monotone", "dynamic": "dynamic"}
        short[AVERAGED] = AVERAGED
        return {f"{prefix}_{key}_rms_um": self.rms(method) for key, method in short.items()}

    def table(self, caption: str) -> StudyTable:
        """Return a table of the errors of all methods in the unseen test."""
        name = f"{self.target}, {self.unseen.test_names[0]}"
        residuals = {(name, m): self.residual(m) for m in self.estimates}
        return errors_table(caption, {(name, NONE_NAME): self.measured} | residuals)

    def reach(self) -> FloatArray:
        """Return the one-sided extent of the boxcar at the displacement of each row of the unseen test [um]."""
        known, n = np.sort(self.learned.deviations[:, 0]), self.ace.half_window_
        rank = np.searchsorted(known, self.measured).clip(max=len(known) - 1)
        above = known[(rank + n).clip(max=len(known) - 1)] - known[rank]
        return np.asarray(np.maximum(above, known[rank] - known[(rank - n).clip(min=0)]))

    def straight(self) -> dict[str, float]:
        """Return the linearity of each transformation, R2: if linear, linear regression is sufficient (W-01)."""
        curves = {f"theta({place(self.target)})": self.ace.theta_}
        curves |= {f"phi({place(c.name)})": phi for c, phi in zip(self.learned.inputs, self.ace.phi_, strict=True)}
        varying = {name: np.ptp(curve.x) > 0 and np.ptp(curve.y) > 0 for name, curve in curves.items()}
        return {n: np.corrcoef(c.x, c.y)[0, 1] ** 2 if varying[n] else 1.0 for n, c in curves.items()}

    def rms_beside(self, *methods: str) -> dict[str, float]:
        """Return the RMS residuals of all methods except one, by name."""
        return {m: self.rms(m) for m in self.estimates if m not in methods}

    def reasons(self) -> Facts:
        """Return the limits of the estimate by ACE, and the results of linear regression and of a model with memory."""
        error, out, reach = self.residual(ACE_NAME), self.flagged, self.reach()
        wide = reach >= np.quantile(reach, 0.9)
        linear = np.corrcoef(self.learned.deviations[:, 0], self.fits[MLR_NAME])[0, 1]
        facts: Facts = {"reasons": True, "straightness": True, "linear": True, "ace": self.ace}
        facts |= {"ace_rms": rms(error), "mlr": self.rms(MLR_NAME)}
        facts |= {"fit": self.fit_rms(ACE_NAME), "fit_mlr": self.fit_rms(MLR_NAME), "correlation": linear}
        facts |= {"loop": loop_width(self.learned), "straight": self.straight()}
        facts |= {"outside": out.any(), "flagged": out.sum(), "rows": len(out), "partly": not out.all()}
        facts |= {"out": rms(error[out]) if out.any() else 0.0, "inside": rms(error[~out]) if not out.all() else 0.0}
        facts |= {"ranks": 2 * self.ace.half_window_ + 1, "reach": reach.max()}
        facts |= {"wide": np.sum(error[wide] ** 2) / np.sum(error**2)}
        memory = "dynamic" in self.estimates
        return facts | {"memory": memory, "dynamic": self.rms("dynamic") if memory else 0.0}


def stacked(
    recordings: Sequence[Recording], displacement: int, temperatures: Sequence[int], *, rezero: bool = False
) -> Samples:
    """Stack recordings with one displacement and some temperatures, given by their indices."""
    first = recordings[0]
    inputs = [first.temperatures[j].name for j in temperatures]
    return common.stacked(recordings, [first.displacements[displacement].name], inputs, rezero=rezero)


def trial(
    recordings: Sequence[Recording], displacement: int, temperatures: Sequence[int], *, beside: bool = True
) -> MillingTrial:
    """Learn from all recordings except the last, and estimate the last.

    Absolute temperatures are used, as in the paper, where the laptop receives the temperatures as measured. If the
    tests do not start at equal temperatures, both methods are repeated with temperatures relative to each start, like
    the displacements.
    """
    parts = (recordings[:-1], recordings[-1:])
    learned, unseen = (stacked(r, displacement, temperatures) for r in parts)
    target = learned.targets[0].name
    ace = ACE(max_sweeps=SWEEPS)
    model = fit_and_freeze(ace, learned, [target], support=Support(margin=0.0))[target]
    estimate, flagged = replay(model, unseen, every(unseen))
    estimates, fits = {ACE_NAME: estimate}, {ACE_NAME: predict_deviation(model, learned)}

    def also(name: str, estimator: ThermalRegressor, samples: Sequence[Samples], **fit: Any) -> None:
        found = fit_and_freeze(estimator, samples[0], [target], **fit)[target]
        fits[name], estimates[name] = (predict_deviation(found, s) for s in samples)

    also(MLR_NAME, LeastSquares(), (learned, unseen))
    if beside:
        zeroed = [stacked(r, displacement, temperatures, rezero=True) for r in parts]
        begins = np.vstack([s.reference() for s in zeroed])
        if np.ptp(begins, axis=0).max() > 0.01 * np.ptp(learned.values, axis=0).max():
            also(FROM_START.format(ACE_NAME), ACE(max_sweeps=SWEEPS), zeroed)
            also(FROM_START.format(MLR_NAME), LeastSquares(), zeroed)
        also("ace-monotone", MonotoneACE(), zeroed)
        # the same temperatures, and the spindle speed if there is one
        speeds = [c.name for c in recordings[0].of_quantity("spindle_speed")]
        timed = [common.stacked(r, [target], [*(c.name for c in learned.inputs), *speeds]) for r in parts]
        memory = DynamicRidge(speed=speeds, time="routed")
        also("dynamic", memory, timed, support=Support(), dt=timed[0].dt(), cycle=timed[0].cycle)
        averaged = trained(AVERAGED, timed[0])
        fits[AVERAGED], estimates[AVERAGED] = (predict_deviation(averaged, s) for s in timed)
    return MillingTrial(learned=learned, unseen=unseen, ace=ace, estimates=estimates, fits=fits, flagged=flagged)


def loop_width(samples: Samples) -> float:
    """Return the range of the displacement at equal temperature, as a fraction of its span: the hysteresis loop.

    The span of each temperature is divided into equal intervals; the width is the largest range of the displacement in
    an interval after subtraction of a straight line. For several temperatures the narrowest loop is used.
    """
    y = samples.deviations[:, 0]
    widths = []
    for x in samples.values.T:
        place = np.minimum((LOOP_STEPS * (x - x.min()) / max(np.ptp(x), 1e-12)).astype(np.intp), LOOP_STEPS - 1)
        level = y - np.polyval(np.polyfit(x, y, 1), x) if np.ptp(x) > 0 else y
        widths.append(max(float(np.ptp(level[place == k])) for k in np.unique(place)))
    return min(widths) / float(np.ptp(y))


def points(samples: Samples) -> FloatArray:
    """Return the numbers of the measuring points, from 1."""
    return np.arange(1, len(samples) + 1, dtype=np.float64)


def named(samples: Samples) -> dict[str, FloatArray]:
    """Return the temperatures by their place names in the paper."""
    return {place(c.name): column for c, column in zip(samples.inputs, samples.values.T, strict=True)}


def recorded(recordings: Sequence[Recording], temperatures: Sequence[int]) -> list[Panel]:
    """Return panels of the measured data as in the paper: temperatures above, displacements below, by point."""
    first = recordings[0]
    names = [c.name for c in first.displacements], [first.temperatures[j].name for j in temperatures]
    shown = common.stacked(recordings, *names, rezero=False)
    moved = {place(c.name): column for c, column in zip(shown.targets, shown.deviations.T, strict=True)}
    return [
        Panel("", "measuring point", y, curves(points(shown), values))
        for y, values in (("temperature [degC]", named(shown)), ("displacement [um]", moved))
    ]


def loops(samples: Samples) -> list[Panel]:
    """Return the displacement against each temperature: an open curve shows hysteresis."""
    axis, y = f"{place(samples.targets[0].name)} [um]", samples.deviations[:, 0]
    return [Panel("", f"{name} [degC]", axis, curves(x, {"": y})) for name, x in named(samples).items()]


def place(channel: str) -> str:
    """Return the name of the place in a channel name as in the paper: ``t_t1_C`` is T1."""
    short = channel.removeprefix("t_").rpartition("_")[0]
    return short.upper() if short[:1] in "ts" and short[1:].isdigit() else short
