"""Sensor budget: reduction of the error on unseen thermal cycles by each further sensor, for all targets together."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from thermocomp.core.arrays import BoolArray, FloatArray
from thermocomp.core.exceptions import FitError, InputError
from thermocomp.judging.choice import Progress
from thermocomp.judging.diagnostics import collinearity
from thermocomp.judging.metrics import rms
from thermocomp.judging.pieces import work_through
from thermocomp.judging.replay import replay_compensated
from thermocomp.judging.sensorsets import PERCENT, choose_sets, weigh_targets
from thermocomp.judging.splits import Judging, Split
from thermocomp.models.methods import expand
from thermocomp.models.selection.standins import SensorSets, StandInAnswer
from thermocomp.models.training import train
from thermocomp.recordings.samples import Samples

#: minimum gain of further sensors that justifies their cost [um, urad] ...
WORTH = 0.5
#: ... or this fraction of the error without compensation, if smaller, or if the targets have different units
SHARE = 0.05


@dataclass(frozen=True, eq=False)
class Budget:
    """Error on unseen blocks as a function of the number of temperature sensors, which are the same for all targets.

    Parameters
    ----------
    unit : str
        Common unit of the targets, see `thermocomp.judging.sensorsets.weigh_targets`.
    scales : ndarray of shape (n_targets,)
        One common unit, expressed in the unit of each target.
    candidates : tuple of str
        All temperatures.
    sensors : tuple of tuple of str
        Sets of 1, 2, ... sensors selected on all rows, each including the previous one; the last has all temperatures.
    blocks : tuple of str
        Unseen blocks.
    rms : ndarray of shape (n_models, n_sizes, n_targets, n_blocks)
        RMS of the residual, with sensors and model selected without the block [unit of the target]; nan where the model
        could not be fitted.
    none : ndarray of shape (n_targets, n_blocks)
        RMS without compensation [unit of the target].
    rows : ndarray of shape (n_targets, n_blocks)
        Number of judged rows.
    frequency : ndarray of shape (n_sizes, n_candidates)
        Fraction of the splits in which a sensor belongs to the best set.
    condition : ndarray of shape (n_sizes,)
        Condition number of the correlation matrix of `sensors`.
    answer : StandInAnswer
        Output of `averaged` with all temperatures and rows, for the virtual sensors; targets in `unit`.
    failures : mapping of str to str
        Reason why a model could not be judged on some block, by model.
    """

    targets: tuple[str, ...]
    unit: str
    scales: FloatArray
    candidates: tuple[str, ...]
    sensors: tuple[tuple[str, ...], ...]
    models: tuple[str, ...]
    blocks: tuple[str, ...]
    rms: FloatArray
    none: FloatArray
    rows: FloatArray
    frequency: FloatArray
    condition: FloatArray
    answer: StandInAnswer
    failures: Mapping[str, str] = field(default_factory=dict)

    def of_blocks(self) -> FloatArray:
        """Return the RMS on each unseen block, mean over the targets, (n_models, n_sizes, n_blocks) [`unit`]."""
        return np.asarray((self.rms / self.scales[:, None]).mean(axis=2))

    def none_of_blocks(self) -> FloatArray:
        """Return the RMS on each unseen block without compensation, mean over the targets, (n_blocks,) [`unit`]."""
        return np.asarray((self.none / self.scales[:, None]).mean(axis=0))

    def of_targets(self) -> FloatArray:
        """Return the RMS over all unseen rows, as in `compare`, (n_models, n_sizes, n_targets) [unit of the target]."""
        return np.asarray(np.sqrt((self.rows * self.rms**2).sum(axis=3) / self.rows.sum(axis=1)))

    def none_of_targets(self) -> FloatArray:
        """Return the RMS without compensation over all unseen rows, (n_targets,) [unit of the target]."""
        return np.asarray(np.sqrt((self.rows * self.none**2).sum(axis=1) / self.rows.sum(axis=1)))

    def stated(self, model: str, place: int) -> tuple[float, float]:
        """Return the RMS over all unseen rows with a set of sensors, and without compensation, mean of the targets."""
        none = self.none_of_targets()
        scales = np.where(none > 0, none / 100, 1.0) if self.unit == PERCENT else self.scales
        of = self.of_targets()[self.models.index(model), place]
        return float((of / scales).mean()), float((none / scales).mean())

    def mean(self) -> FloatArray:
        """Return the mean RMS over blocks and targets, by which sets are compared, (n_models, n_sizes) [`unit`]."""
        return np.asarray(self.of_blocks().mean(axis=2))

    def none_mean(self) -> float:
        """Return the mean RMS without compensation over blocks and targets [`unit`]."""
        return float(self.none_of_blocks().mean())

    def gains(self, model: str) -> tuple[FloatArray, FloatArray]:
        """Return the gain of the next sensor for each number of sensors but the last [`unit`].

        Returns
        -------
        gain : ndarray of shape (n_sizes - 1,)
            Mean over the unseen blocks.
        of_blocks : ndarray of shape (n_sizes - 1, n_blocks)
            Gain on each block.
        """
        found = -np.diff(self.of_blocks()[self.models.index(model)], axis=0)
        return np.asarray(found.mean(axis=1)), found

    @property
    def sizes(self) -> tuple[int, ...]:
        """Number of sensors in each set."""
        return tuple(len(s) for s in self.sensors)

    def enough(self, model: str) -> int | None:
        """Return the smallest number of sensors whose mean RMS over the blocks is within `margin` of the smallest.

        None if the model could not be fitted in one of the blocks, or no set is better than no compensation.
        """
        found = self._fewest([self.models.index(model)])
        return None if found is None else self.sizes[found[1]]

    def recommended(self) -> tuple[str, int] | None:
        """Return the model that needs the fewest sensors, and the index of their set in `sensors`.

        A set is not better than no compensation, and so not sufficient, if its mean gain over the blocks is less than
        the minimum gain of a sensor, or at most one standard error of this gain over the blocks.

        Returns
        -------
        place : int
            None if no model could be fitted in all blocks, or no set is better than no compensation.
        """
        found = self._fewest(range(len(self.models)))
        return None if found is None else (self.models[found[0]], found[1])

    def margin(self) -> tuple[float, float, float] | None:
        """Return the tolerated excess of the mean RMS over the smallest one, and the two values behind it [`unit`].

        The larger of one standard error of the smallest mean over the blocks (Breiman 1984, Classification and
        Regression Trees, section 3.4.3) and `WORTH`, the latter at most `SHARE` of the error without compensation.

        Returns
        -------
        margin, standard_error, least : float
            None if no model could be fitted in all blocks.
        """
        fitted = self._fitted(range(len(self.models)))
        return self._margin(fitted) if fitted else None

    def _fitted(self, models: Sequence[int]) -> list[int]:
        return [m for m in models if np.isfinite(self.rms[m]).all()]

    def _margin(self, models: Sequence[int]) -> tuple[float, float, float]:
        errors = self.of_blocks()[models].reshape(-1, len(self.blocks))
        error = float(_standard_error(errors[int(np.argmin(errors.mean(axis=1)))]))
        share = SHARE * self.none_mean()
        least = share if self.unit == PERCENT else min(WORTH, share)
        return max(error, least), error, least

    def _fewest(self, models: Sequence[int]) -> tuple[int, int] | None:
        fitted = self._fitted(models)
        if not fitted:
            return None
        mean, (margin, _, least) = self.mean()[fitted], self._margin(fitted)
        gain = self.none_of_blocks() - self.of_blocks()[fitted]
        better = gain.mean(axis=2) >= np.maximum(_standard_error(gain), least)
        near = np.argwhere(better & (mean <= mean.min() + margin)).tolist()
        _, _, m, k = min(((self.sizes[k], mean[m, k], m, k) for m, k in near), default=(0, 0.0, -1, -1))
        return (fitted[m], k) if near else None


def _standard_error(of_blocks: FloatArray) -> FloatArray:
    """Return the standard error of the mean over the last axis; 0 for a single block, where it is unknown."""
    n = of_blocks.shape[-1]
    return np.asarray(of_blocks.std(axis=-1, ddof=1) / np.sqrt(n) if n > 1 else np.zeros(of_blocks.shape[:-1]))


def budget(
    samples: Samples,
    judging: Judging,
    models: Sequence[str],
    *,
    max_sensors: int = 6,
    jobs: int = 1,
    progress: Progress = lambda _, steps=1: None,  # noqa: ARG005
) -> Budget:
    """Judge one set of temperatures of each size on unseen blocks.

    In each split the sets are selected on the training rows (`thermocomp.models.selection.standins.reduce_sensors`),
    the same for all targets; every model is then trained on these sensors, and on the spindle speed if the model uses
    it. A block without a value of one of the targets is left out.
    """
    names, targets = expand(models), samples.targets
    temperatures = [c.name for c in samples.inputs if c.quantity == "temperature"]
    if max_sensors < 1 or not temperatures:
        raise InputError(
            f"a sensor budget of {max_sensors} among {len(temperatures)} temperatures: expected at least 1 sensor and "
            "1 temperature"
        )
    numbers = np.array([judged_blocks(samples, t, judging) for t in range(len(targets))])
    splits = [split for split, known in zip(judging.splits, numbers.T, strict=True) if known.all()]
    if not splits:
        called = ", ".join(c.name for c in targets)
        raise FitError(
            f"no validation block (left-out cycle, day or file) has values of all of {called}; select sensors "
            "for fewer targets at once"
        )
    samples = samples.only([c.name for c in samples.inputs if c.quantity in ("temperature", "spindle_speed")])
    chosen = _chosen(samples, splits, max_sensors, jobs, progress)
    sensors = [[tuple(temperatures[j] for j in places) for places in sets.sets] for sets in chosen]
    unseen, failures = _judged(samples, splits, sensors[1:], names, jobs, progress)
    judged = [[split.judge & np.isfinite(samples.deviations[:, t]) for split in splits] for t in range(len(targets))]
    none = np.array(
        [[rms(samples.deviations[r, t], np.zeros(r.sum())) for r in blocks] for t, blocks in enumerate(judged)]
    )
    unit, scales = weigh_targets(samples, np.any([split.judge for split in splits], axis=0))
    if unit == PERCENT:  # percent of the compared figure: the mean over the blocks
        scales = np.where(none.any(axis=1), none.mean(axis=1) / 100, 1.0)
    return Budget(
        targets=tuple(c.name for c in targets),
        unit=unit,
        scales=scales,
        candidates=tuple(temperatures),
        sensors=tuple(sensors[0]),
        models=tuple(names),
        blocks=tuple(split.block for split in splits),
        rms=unseen,
        none=none,
        rows=np.array([[r.sum() for r in blocks] for blocks in judged], dtype=np.float64),
        frequency=np.mean([[[n in s for n in temperatures] for s in subsets] for subsets in sensors[1:]], axis=0),
        condition=_conditions(samples, sensors[0]),
        answer=chosen[0].answer,
        failures=failures,
    )


def _chosen(
    samples: Samples, splits: Sequence[Split], max_sensors: int, jobs: int, progress: Progress
) -> list[SensorSets]:
    """Return the sets of each size, first for all rows, then for the training rows of each split."""
    learned, chosen = [samples.cycle >= 0, *(split.learn for split in splits)], []
    for sets in work_through(partial(choose_sets, samples, max_sensors), learned, jobs=jobs):
        if isinstance(sets, str):
            raise FitError(sets)
        progress("sensors chosen")
        chosen.append(sets)
    return chosen


def _judged(
    samples: Samples,
    splits: Sequence[Split],
    sensors: Sequence[Sequence[tuple[str, ...]]],
    names: Sequence[str],
    jobs: int,
    progress: Progress,
) -> tuple[FloatArray, dict[str, str]]:
    """Return the RMS on unseen blocks, (n_models, n_sizes, n_targets, n_splits), and the reasons for failures."""
    pieces = [
        (split, subset, name)
        for split, subsets in zip(splits, sensors, strict=True)
        for name in names
        for subset in subsets
    ]
    found, failures = [], dict[str, str]()
    for piece, value in zip(pieces, work_through(partial(_judge_subset, samples), pieces, jobs=jobs), strict=True):
        progress(f"{piece[2]} with {len(piece[1])} sensors: judged")
        found.append(np.full(len(samples.targets), np.nan) if isinstance(value, str) else value)
        if isinstance(value, str):
            failures.setdefault(piece[2], value)
    unseen = np.reshape(found, (len(splits), len(names), len(sensors[0]), len(samples.targets)))
    return np.moveaxis(unseen, 0, -1), failures


def judged_blocks(samples: Samples, target: int, judging: Judging) -> BoolArray:
    """Return the blocks in which a target has a value for judging, (n_splits,)."""
    found = np.array([np.isfinite(samples.deviations[split.judge, target]).any() for split in judging.splits])
    if not found.any():
        raise FitError(
            f"{samples.targets[target].name} has no value in any validation block (left-out cycle, day or file)"
        )
    return found


def n_pieces(samples: Samples, judging: Judging, models: Sequence[str], max_sensors: int) -> int:
    """Return the maximum number of tasks of `budget`."""
    temperatures, blocks = sum(c.quantity == "temperature" for c in samples.inputs), len(judging.splits)
    return 1 + blocks + blocks * len(expand(models)) * min(max_sensors + 1, temperatures)


def _conditions(samples: Samples, sets: Sequence[Sequence[str]]) -> FloatArray:
    """Return the condition number of each set of temperatures."""
    values, columns = samples.change()[samples.valid], [c.name for c in samples.inputs]
    return np.array(
        [collinearity(values[:, [columns.index(s) for s in names]], tuple(names)).condition_number for names in sets]
    )


def _judge_subset(samples: Samples, piece: tuple[Split, Sequence[str], str]) -> FloatArray | str:
    """Return the RMS of a model with a subset of the temperatures on the unseen rows of a split, see `unseen_rms`."""
    split, sensors, name = piece
    speeds = [c.name for c in samples.inputs if c.quantity == "spindle_speed"]
    return unseen_rms(samples.only([*sensors, *speeds]), name, split.learn, split.judge)


def unseen_rms(samples: Samples, name: str, learn: BoolArray, judge: BoolArray) -> FloatArray:
    """Train a method on some rows, and judge it on others.

    Parameters
    ----------
    learn, judge : ndarray of bool of shape (n_rows,)
        Rows for training, and unseen rows.

    Returns
    -------
    ndarray of shape (n_targets,)
        Residual RMS on the unseen rows [unit of the target].
    """
    left = []
    for target in range(len(samples.targets)):
        model = train(name, samples, target, learn, joint=False).model
        rows = judge & np.isfinite(samples.deviations[:, target])
        left.append(rms(samples.deviations[rows, target], replay_compensated(model, samples, rows).compensated))
    return np.array(left)
