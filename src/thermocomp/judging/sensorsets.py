"""Sets of 1, 2, ... temperatures for all targets together, selected on the training rows."""

import numpy as np

from thermocomp.core.arrays import BoolArray, FloatArray
from thermocomp.core.exceptions import FitError
from thermocomp.judging.splits import MIN_ROWS
from thermocomp.models.averaged import AveragedDynamic
from thermocomp.models.numerics.folds import number_folds
from thermocomp.models.selection.standins import SensorSets, reduce_sensors
from thermocomp.recordings.samples import Samples

#: common unit for targets of different units: percent of the error without compensation
PERCENT = "%"


def weigh_targets(samples: Samples, rows: BoolArray) -> tuple[str, FloatArray]:
    """Return a common unit of all targets, and its size in the unit of each target, (n_targets,).

    Parameters
    ----------
    rows : ndarray of bool of shape (n_rows,)
        Rows for the root mean square of the targets without compensation.

    Returns
    -------
    scales : ndarray of shape (n_targets,)
        1 if the unit is common. Targets without values or without variation keep their own unit.
    """
    units = {c.unit for c in samples.targets}
    if len(units) == 1:
        return units.pop(), np.ones(len(samples.targets))
    found = np.where(np.isfinite(samples.deviations[rows]), samples.deviations[rows], 0.0)
    count = np.isfinite(samples.deviations[rows]).sum(axis=0)
    scales = np.sqrt((found**2).sum(axis=0) / np.maximum(count, 1)) / 100
    return PERCENT, np.where(scales > 0, scales, 1.0)


def choose_sets(samples: Samples, most: int, learn: BoolArray) -> SensorSets:
    """Select sets of temperatures by the loss of accuracy of the model `averaged` without the others.

    Parameters
    ----------
    learn : ndarray of bool of shape (n_rows,)
        Training rows.
    """
    seen = learn & samples.valid & np.isfinite(samples.deviations).all(axis=1)
    if seen.sum() < MIN_ROWS:
        names = ", ".join(c.name for c in samples.targets)
        several = "; select sensors for fewer targets at once" if len(samples.targets) > 1 else ""
        raise FitError(
            f"{int(seen.sum())} rows have values of all of {names} and of all {len(samples.inputs)} inputs: "
            f"at least {MIN_ROWS} are needed for selecting sensors{several}"
        )
    _, scales = weigh_targets(samples, seen)
    # a model with memory also receives the rows between its training rows
    rows = samples.valid & np.isin(samples.test, samples.test[seen])
    driven, change, learned = samples.take(rows), samples.change()[rows], seen[rows]
    speeds = [j for j, c in enumerate(samples.inputs) if c.quantity == "spindle_speed"]
    how, step = AveragedDynamic(), driven.dt()
    folds, _ = number_folds(np.where(learned, driven.cycle, -1), len(driven))
    features, parts, _ = how.lay_out(change, step, folds, speeds)
    targets = np.where(learned[:, None], driven.deviations / scales, 0.0)
    moments = features.moments(change, targets, step, parts, how.noise)
    return reduce_sensors(features, moments, how.noise, most, structures=how.structures, random_state=how.random_state)
