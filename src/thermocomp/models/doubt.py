"""Parameter uncertainty of `averaged`: covariance of its weights, and its reduction by a further test."""

from dataclasses import dataclass, replace

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.core.exceptions import FitError, InputError
from thermocomp.models.averaged import AveragedDynamic
from thermocomp.models.numerics.folds import number_folds
from thermocomp.models.numerics.structures import average, fit_each, share_out
from thermocomp.models.pacedfeatures import PacedFeatures
from thermocomp.recordings.samples import Samples


@dataclass(frozen=True, eq=False)
class Doubt:
    """Uncertainty of an average of ridge regressions, and the response of temperatures to the speed.

    The covariance of the weights is that between the averaged regressions: they fit the rows equally well and differ
    where the rows contain no information. Each part that is left out in turn (half a thermal cycle) counts as one
    observation with the error found on it, because neighbouring rows are not independent.

    Parameters
    ----------
    columns : int
        Number of inputs of the recordings.
    covariance : ndarray of shape (n_targets, n_features, n_features)
        Covariance of the weights.
    error : ndarray of shape (n_targets,)
        Root mean square error on the left-out parts [unit of the target].
    part : float
        Mean duration of a part that is left out [s].
    heating : tuple of PacedFeatures and ndarray of shape (n_states, n_temperatures)
        Features from the speed alone, and the weights with which they predict the temperatures.
    """

    features: PacedFeatures
    columns: int
    covariance: FloatArray
    error: FloatArray
    part: float
    heating: tuple[PacedFeatures, FloatArray]

    @property
    def speed(self) -> int:
        """Column of the spindle speed."""
        return self.features.states[0][0]

    def table(self, speed: FloatArray, dt: float, room: FloatArray | None = None) -> FloatArray:
        """Return the features of a planned test, (n_rows, n_features).

        Parameters
        ----------
        speed : ndarray of shape (n_rows,)
            [1/min]
        dt : float
            Time between two rows [s].
        room : ndarray of shape (n_rows, n_temperatures), optional
            Effect of the ambient temperature on each temperature [degC]. The effect of the speed is predicted.
        """
        step = np.full(len(speed), dt)
        step[0] = np.inf
        of, weights = self.heating
        rows = np.zeros((len(speed), self.columns))
        rows[:, self.speed] = speed
        heat = of.table(rows[:, [self.speed]], step) @ weights
        rows[:, list(self.features.temperatures)] = heat if room is None else heat + room
        return self.features.table(rows, step)

    def spread(self, table: FloatArray) -> FloatArray:
        """Return the expected RMS error over the given rows, (n_targets,) [unit of the target]."""
        squares = (self.covariance * (table.T @ table / len(table))).sum(axis=(1, 2))
        return np.asarray(np.sqrt(np.maximum(squares, 0.0)))

    def after(self, table: FloatArray, duration: float) -> "Doubt":
        """Return the uncertainty that remains after a test.

        Parameters
        ----------
        table : ndarray of shape (n_rows, n_features)
            Features of the test; a few dozen rows are enough.
        duration : float
            [s]
        """
        left = []
        for covariance, error in zip(self.covariance, self.error, strict=True):
            seen = table * np.sqrt(duration / self.part / len(table)) / max(error, 1e-9)
            common = covariance @ seen.T
            left.append(covariance - common @ np.linalg.solve(np.eye(len(seen)) + seen @ common, common.T))
        return replace(self, covariance=np.array(left))


def find_doubt(samples: Samples) -> Doubt:
    """Return the uncertainty of `averaged` after the given recordings."""
    of = AveragedDynamic()
    complete = samples.take(samples.valid)
    speeds = [j for j, c in enumerate(complete.inputs) if c.quantity == "spindle_speed"]
    if len(speeds) != 1 or len(speeds) == len(complete.inputs):
        names = ", ".join(c.name for c in complete.inputs)
        raise InputError(
            f"inputs {names}: planning a test requires one spindle speed and at least one temperature; name them with "
            "--inputs, or specify the speed column in a mapping"
        )
    learned = np.isfinite(complete.deviations).all(axis=1) & (complete.cycle >= 0)
    if learned.sum() < 20:
        raise FitError(f"{int(learned.sum())} rows contain all inputs and targets; planning requires at least 20")
    rows, step = complete.change(), complete.dt()
    folds, _ = number_folds(np.where(learned, complete.cycle, -1), len(complete))
    features, parts, _ = of.lay_out(rows, step, folds, speeds)
    deviations = np.where(learned[:, None], complete.deviations, 0.0)
    moments = features.moments(rows, deviations, step, parts, of.noise)
    structures = features.draw(of.structures, of.random_state)
    shares, errors = share_out(moments, structures)
    error = np.sqrt(np.mean(errors**2, axis=0))
    each = fit_each(moments, structures, range(len(moments.rows)))
    apart = each - (shares[:, None] * each).sum(axis=0)
    covariance = np.einsum("st,sjt,skt->tjk", shares, apart, apart)
    alone, _, _ = AveragedDynamic(lags=()).lay_out(rows[:, speeds], step, folds, [0])
    heat = alone.moments(rows[:, speeds], rows[:, list(features.temperatures)], step, parts, 0.0)
    weights, _ = average(heat, alone.draw(of.structures, of.random_state))
    seconds = np.where(np.isfinite(step) & learned, step, 0.0).sum()
    part = max(float(seconds) / len(moments.rows), 1.0)
    return Doubt(
        features=features,
        columns=rows.shape[1],
        covariance=covariance,
        error=error,
        part=part,
        heating=(alone, weights),
    )
