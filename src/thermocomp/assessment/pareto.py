"""The sensor budget: what each further sensor buys on thermal cycles that were not seen."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from joblib import effective_n_jobs
from numpy.typing import NDArray

from thermocomp.assessment.candidates import Candidates
from thermocomp.assessment.choice import Choice, Progress, Settings, Table
from thermocomp.assessment.diagnostics import collinearity
from thermocomp.assessment.metrics import rms
from thermocomp.assessment.pieces import work_through
from thermocomp.assessment.replay import replay_compensated
from thermocomp.core.exceptions import FitError, InputError
from thermocomp.models.methods import expand
from thermocomp.models.selection.subsets import best_subsets
from thermocomp.models.training import train
from thermocomp.recording.samples import Samples
from thermocomp.recording.splits import Judging, Split

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

#: more sensors have to gain so much to be worth their cables [um] ...
WORTH = 0.5
#: ... or this share of the error without compensation, where that is less
SHARE = 0.05


@dataclass(frozen=True, eq=False)
class Budget:
    """Error on unseen blocks against the number of temperature sensors, for one target.

    Parameters
    ----------
    target : str
    candidates : tuple of str
        The temperatures there are.
    sensors : tuple of tuple of str
        For 1, 2, ... sensors: the best subset in all rows; at the end all temperatures.
    models : tuple of str
    blocks : tuple of str
        Unseen blocks.
    rms : ndarray of shape (n_models, n_sizes, n_blocks)
        Of the residual, sensors and model chosen without the block [um]; nan where it could not be fitted.
    rows : ndarray of int of shape (n_blocks,)
        Judged rows.
    none : ndarray of shape (n_blocks,)
        RMS without compensation [um].
    frequency : ndarray of shape (n_sizes, n_candidates)
        Share of the blocks without which a sensor is among the best.
    condition : ndarray of shape (n_sizes,)
        Condition number of the correlation matrix of `sensors`.
    proven : bool
        Every set is the best of its size for sure.
    failures : mapping of str to str
        Why a model could not be judged somewhere, by model.
    """

    target: str
    candidates: tuple[str, ...]
    sensors: tuple[tuple[str, ...], ...]
    models: tuple[str, ...]
    blocks: tuple[str, ...]
    rms: FloatArray
    rows: NDArray[np.intp]
    none: FloatArray
    frequency: FloatArray
    condition: FloatArray
    proven: bool = True
    failures: Mapping[str, str] = field(default_factory=dict)

    def pooled(self) -> FloatArray:
        """Return the RMS over all unseen blocks together, (n_models, n_sizes) [um]."""
        return np.asarray(np.sqrt((self.rms**2 * self.rows).sum(axis=2) / self.rows.sum()))

    def none_pooled(self) -> float:
        """Return the RMS over all unseen blocks without compensation [um]."""
        return float(np.sqrt((self.none**2 * self.rows).sum() / self.rows.sum()))

    @property
    def sizes(self) -> tuple[int, ...]:
        """Numbers of sensors."""
        return tuple(len(s) for s in self.sensors)

    def enough(self, model: str) -> int | None:
        """Return the smallest number of sensors whose mean RMS over the blocks is within `margin` of the smallest one.

        None if the model could not be fitted in one of the blocks.
        """
        found = self._fewest([self.models.index(model)])
        return None if found is None else self.sizes[found[1]]

    def recommended(self) -> tuple[str, int] | None:
        """Return the model, and the place in `sensors`, with the fewest sensors that are enough among all models."""
        found = self._fewest(range(len(self.models)))
        return None if found is None else (self.models[found[0]], found[1])

    def margin(self) -> tuple[float, float, float] | None:
        """Return what the mean RMS over the blocks may be above the smallest one, and where that comes from [um].

        The larger of one standard error of the smallest between the blocks (Breiman 1984, Classification and Regression
        Trees, section 3.4.3), and of `WORTH`, but of no more than `SHARE` of what there is without compensation.

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
        errors = self.rms[models].reshape(-1, len(self.blocks))
        best = errors[int(np.argmin(errors.mean(axis=1)))]
        error = float(best.std(ddof=1) / np.sqrt(len(best))) if len(best) > 1 else 0.0
        least = min(WORTH, SHARE * float(self.none.mean()))
        return max(error, least), error, least

    def _fewest(self, models: Sequence[int]) -> tuple[int, int] | None:
        fitted = self._fitted(models)
        if not fitted:
            return None
        mean = self.rms[fitted].mean(axis=2)
        limit = mean.min() + self._margin(fitted)[0]
        near = [(self.sizes[k], mean[m, k], m, k) for m, k in np.argwhere(mean <= limit).tolist()]
        _, _, m, k = min(near)
        return fitted[m], k


def budget(
    samples: Samples,
    target: int,
    judging: Judging,
    models: Sequence[str],
    *,
    max_sensors: int = 10,
    seconds: float | None = None,
    jobs: int = 1,
    progress: Progress = lambda _, steps=1: None,  # noqa: ARG005
) -> Budget:
    """Judge the best subset of each size on unseen blocks.

    In each split the sensors are the best subset (least squares) of the rows that may be learned from; every model is
    then trained on these sensors, and on the spindle speed if it has a use for it. A block without a number of the
    target is left out.

    Parameters
    ----------
    samples : Samples
    target : int
        Index into ``samples.targets``.
    judging : Judging
    models : sequence of str
        Methods that are trained on the chosen sensors.
    max_sensors : int
    seconds : float, optional
        Stop each search for the best subsets after about so long [s].
    jobs : int
        Processes to share the work among; -1 takes all cores.
    progress : callable
        Called with a line of text after each piece of work; there are `n_pieces` of them.

    Returns
    -------
    Budget

    Raises
    ------
    InputError
        `max_sensors` is below 1, or there is no temperature.
    FitError
        There is no block with a number of the target.
    """
    names = expand(models)
    temperatures = [c.name for c in samples.inputs if c.quantity == "temperature"]
    if max_sensors < 1 or not temperatures:
        raise InputError(f"a sensor budget of {max_sensors} among {len(temperatures)} temperatures: want at least 1")
    deviation = samples.deviations[:, target]
    splits = [split for split in judging.splits if np.isfinite(deviation[split.judge]).any()]
    if not splits:
        raise FitError(f"{samples.targets[target].name} has no number in any of the blocks to judge by")
    everything = np.ones(len(samples), dtype=np.bool_)
    searched = partial(
        _best, samples, target, temperatures, max_sensors, seconds, effective_n_jobs(jobs), partial(progress, steps=0)
    )
    results = [searched(learn) for learn in [everything, *(split.learn for split in splits)]]
    n_sizes = min(len(sets) for sets, _ in results)
    # the last of each is all temperatures
    chosen = [[*sets[: n_sizes - 1], sets[-1]] for sets, _ in results]
    pieces = [
        (split, sensors[size], name)
        for split, sensors in zip(splits, chosen[1:], strict=True)
        for name in names
        for size in range(n_sizes)
    ]
    found = []
    failures: dict[str, str] = {}
    for piece, value in zip(
        pieces, work_through(partial(_unseen_rms, samples, target), pieces, _why, jobs=jobs), strict=True
    ):
        progress(f"{samples.targets[target].name}: judged")
        found.append(np.nan if isinstance(value, str) else value)
        if isinstance(value, str):
            failures.setdefault(piece[2], value)
    judged = [split.judge & np.isfinite(deviation) for split in splits]
    return Budget(
        target=samples.targets[target].name,
        candidates=tuple(temperatures),
        sensors=tuple(chosen[0]),
        models=tuple(names),
        blocks=tuple(split.block for split in splits),
        rms=np.moveaxis(np.reshape(found, (len(splits), len(names), n_sizes)), 0, 2),
        rows=np.array([rows.sum() for rows in judged]),
        none=np.array([rms(deviation[rows], np.zeros(rows.sum())) for rows in judged]),
        frequency=np.mean([[[n in s for n in temperatures] for s in sensors] for sensors in chosen[1:]], axis=0),
        condition=_conditions(samples, chosen[0]),
        proven=all(proven for _, proven in results),
        failures=failures,
    )


def _conditions(samples: Samples, sets: Sequence[Sequence[str]]) -> FloatArray:
    """Return the condition number of each set of temperatures."""
    values, columns = samples.change()[samples.valid], [c.name for c in samples.inputs]
    return np.array(
        [collinearity(values[:, [columns.index(s) for s in names]], tuple(names)).condition_number for names in sets]
    )


def choose(
    samples: Samples, target: int, judging: Judging, settings: Settings, *, jobs: int, progress: Progress
) -> Choice:
    """Choose by the error on unseen blocks against the number of sensors.

    Parameters
    ----------
    samples : Samples
    target : int
        Index into ``samples.targets``.
    judging : Judging
    settings : Settings
    jobs : int
        Processes to share the work among; -1 takes all cores.
    progress : callable
        Called with a line of text after each piece of work; there are `n_pieces` of them.

    Returns
    -------
    Choice

    Raises
    ------
    FitError
        None of the models could be judged in every block.
    """
    candidates = Candidates.of(samples, target)
    found = budget(
        samples,
        target,
        judging,
        settings.models,
        max_sensors=settings.most("pareto"),
        seconds=settings.seconds,
        jobs=jobs,
        progress=progress,
    )
    recommended = found.recommended()
    if recommended is None:
        raise FitError(f"{candidates.target}: none of the models could be judged in every block: {_failed(found)}")
    model, place = recommended
    sensors = found.sensors[place]
    notes = [
        _rule(found),
        "Sensors of each number are the best subset by least squares in the rows to learn from, whatever model is then "
        "trained on them. Their number was chosen by the errors shown, so they flatter it a little.",
    ]
    if not found.proven:
        notes.append("Not all of these sets are proven to be the best of their size.")
    if found.failures:
        notes.append(f"Not judged with some numbers of sensors: {_failed(found)}")
    if len(found.blocks) < len(judging.splits):
        notes.append(
            f"{len(judging.splits) - len(found.blocks)} block(s) without a number of the target were left out."
        )
    return Choice(
        "pareto",
        candidates.target,
        sensors,
        f"{model} with {len(sensors)} of {len(found.candidates)} temperatures leaves "
        f"{float(found.pooled()[found.models.index(model), place]):.2f} um RMS on unseen cycles, instead of "
        f"{found.none_pooled():.2f} um; {_trade_off(found, model, place)}",
        (_errors(found, judging, place), _frequency(found, place), candidates.repeats(sensors)),
        tuple(notes),
        found,
    )


def _failed(found: Budget) -> str:
    return "; ".join(f"{model}: {why}" for model, why in found.failures.items())


def _errors(found: Budget, judging: Judging, place: int) -> Table:
    pooled = found.pooled()
    return Table(
        f"Error on unseen blocks: {judging.name}",
        ("sensors", *(f"{m} RMS [um]" for m in found.models), "condition", "chosen in all rows"),
        tuple(
            (size, *(float(v) for v in pooled[:, k]), float(found.condition[k]), " ".join(found.sensors[k]))
            for k, size in enumerate(found.sizes)
        ),
        place,
        f"Without compensation {found.none_pooled():.2f} um. Enough, each model by itself: "
        + ", ".join(f"{found.enough(m) or 'not judged'} for {m}" for m in found.models)
        + ".",
    )


def _frequency(found: Budget, place: int) -> Table:
    order = np.argsort(-found.frequency[place], kind="stable")
    return Table(
        f"How surely a sensor is among the best {len(found.sensors[place])}",
        ("sensor", "share of the blocks [%]"),
        tuple(
            (found.candidates[j], float(100 * found.frequency[place, j]))
            for j in order
            if found.frequency[place, j] > 0
        ),
        None,
        "Chosen anew without each block: a sensor far below 100 % was a matter of luck.",
    )


def _trade_off(found: Budget, model: str, place: int) -> str:
    """Say what the sensors that were saved cost, beside the best of the table and beside all sensors."""
    pooled = found.pooled()
    m, n = found.models.index(model), found.sizes[place]
    best = np.unravel_index(int(np.nanargmin(pooled)), pooled.shape)
    others = {(int(best[0]), int(best[1])): ", the best of the table"}
    others.setdefault((m, len(found.sizes) - 1), "")
    said = []
    for (k, j), what in others.items():
        cost = float(pooled[m, place] - pooled[k, j])
        if (k, j) != (m, place):
            by = f" by {found.models[k]}" if k != m else ""
            said.append(f"{abs(cost):.2g} um {'more' if cost >= 0 else 'less'} than {found.sizes[j]}{by}{what}")
    if not said:
        return "fewer cost more than the rule allows"
    return f"{n} sensor{'s' if n > 1 else ''} cost{'s' if n == 1 else ''} {' and '.join(said)}"


def _rule(found: Budget) -> str:
    """Say by what rule the number of sensors was chosen, in numbers."""
    margins = found.margin()
    assert margins is not None
    margin, error, least = margins
    told = "what a further sensor has to gain to be worth it"
    if least < WORTH:
        told = f"{100 * SHARE:g} % of what there is without compensation, {told}"
    return (
        f"Rule: the fewest sensors whose mean RMS over the unseen blocks is within {margin:.2f} um of the smallest: "
        f"the larger of one standard error between the blocks (Breiman 1984), {error:.2f} um, and of {least:.2f} um, "
        f"{told}."
    )


def n_pieces(samples: Samples, judging: Judging, models: Sequence[str], max_sensors: int) -> int:
    """Return the number of pieces of work of `budget`, at most.

    Parameters
    ----------
    samples : Samples
    judging : Judging
    models : sequence of str
    max_sensors : int

    Returns
    -------
    int
    """
    temperatures = sum(c.quantity == "temperature" for c in samples.inputs)
    return len(judging.splits) * len(expand(models)) * min(max_sensors + 1, temperatures)


def _best(
    samples: Samples,
    target: int,
    temperatures: Sequence[str],
    max_sensors: int,
    seconds: float | None,
    jobs: int,
    progress: Callable[[str], None],
    learn: BoolArray,
) -> tuple[list[tuple[str, ...]], bool]:
    """Return the best sensors of every number, and all, by the rows that may be learned from; and the certificate."""
    columns = [j for j, c in enumerate(samples.inputs) if c.name in temperatures]
    rows = learn & samples.valid & np.isfinite(samples.deviations[:, target])
    if rows.sum() < 3:
        raise FitError(f"{int(rows.sum())} complete rows of {samples.targets[target].name} to choose sensors by")
    found = best_subsets(
        samples.change()[rows][:, columns],
        samples.deviations[rows, target],
        max_size=max_sensors,
        seconds=seconds,
        jobs=jobs,
        progress=progress,
    )
    if found.stopped == "interrupted":
        raise KeyboardInterrupt
    best = [tuple(samples.inputs[columns[j]].name for j in subset.columns) for subset in found.best]
    everything = tuple(samples.inputs[j].name for j in columns)
    return best if len(best[-1]) == len(everything) else [*best, everything], found.proven


def _unseen_rms(samples: Samples, target: int, piece: tuple[Split, Sequence[str], str]) -> float | str:
    split, sensors, name = piece
    speeds = [c.name for c in samples.inputs if c.quantity == "spindle_speed"]
    reduced = samples.only([*sensors, *speeds])
    model = train(name, reduced, target, split.learn, joint=False).model
    rows = split.judge & np.isfinite(samples.deviations[:, target])
    return rms(samples.deviations[rows, target], replay_compensated(model, reduced, rows).compensated)


def _why(_: tuple[Split, Sequence[str], str], why: str) -> float | str:
    return why
