"""The sensor budget: what each further sensor buys on thermal cycles that were not seen."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray

from thermocomp.assessment.candidates import Candidates
from thermocomp.assessment.choice import Choice, Settings, Table
from thermocomp.assessment.diagnostics import collinearity
from thermocomp.assessment.metrics import rms
from thermocomp.assessment.replay import replay
from thermocomp.assessment.splits import Protocol, Split
from thermocomp.core.exceptions import FitError, InputError
from thermocomp.models.methods import expand
from thermocomp.models.selection.subsets import best_subsets
from thermocomp.models.training import train
from thermocomp.recording.samples import Samples

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Budget:
    """Error on unseen blocks against the number of temperature sensors, for one target.

    Parameters
    ----------
    target : str
    candidates : tuple of str
        The temperatures there are.
    sensors : tuple of tuple of str
        For 1, 2, ... sensors: the best subset in all rows.
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

    def pooled(self) -> FloatArray:
        """Return the RMS over all unseen blocks together, (n_models, n_sizes) [um]."""
        return np.asarray(np.sqrt((self.rms**2 * self.rows).sum(axis=2) / self.rows.sum()))

    def none_pooled(self) -> float:
        """Return the RMS over all unseen blocks without compensation [um]."""
        return float(np.sqrt((self.none**2 * self.rows).sum() / self.rows.sum()))

    def enough(self, model: str) -> int | None:
        """Return the smallest number of sensors that is not clearly worse than the best number.

        Not clearly worse: its mean RMS over the blocks is within one standard error of the smallest, as in the choice
        of the strength of `DynamicRidge`. None if the model could not be fitted in one of the blocks.
        """
        errors = self.rms[self.models.index(model)]
        if not np.isfinite(errors).all():
            return None
        mean = errors.mean(axis=1)
        best = errors[int(np.argmin(mean))]
        margin = best.std(ddof=1) / np.sqrt(len(best)) if len(best) > 1 else 0.0
        return int(np.flatnonzero(mean <= best.mean() + margin)[0]) + 1


def budget(
    samples: Samples,
    target: int,
    protocol: Protocol,
    models: Sequence[str],
    *,
    max_sensors: int = 10,
    jobs: int = 1,
    progress: Callable[[str], None] = lambda _: None,
) -> Budget:
    """Judge the best subset of each size on unseen blocks.

    In each split the sensors are the exact best subset (least squares) of the rows that may be learned from; every
    model is then trained on these sensors, and on the spindle speed if it has a use for it.

    Parameters
    ----------
    samples : Samples
    target : int
        Index into ``samples.targets``.
    protocol : Protocol
    models : sequence of str
        Methods that are trained on the chosen sensors.
    max_sensors : int
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
    """
    names = expand(models)
    temperatures = [c.name for c in samples.inputs if c.quantity == "temperature"]
    if max_sensors < 1 or not temperatures:
        raise InputError(f"a sensor budget of {max_sensors} among {len(temperatures)} temperatures: want at least 1")
    learned = [split.learn for split in protocol.splits]
    everything = np.ones(len(samples), dtype=np.bool_)
    chosen = [_best(samples, target, learn, temperatures, max_sensors) for learn in [everything, *learned]]
    n_sizes = min(len(c) for c in chosen)
    work = (
        delayed(_unseen_rms)(samples, target, split, sensors[size], name)
        for split, sensors in zip(protocol.splits, chosen[1:], strict=True)
        for name in names
        for size in range(n_sizes)
    )
    found = []
    for value in Parallel(n_jobs=jobs, return_as="generator")(work):
        progress(f"{samples.targets[target].name}: judged")
        found.append(value)
    deviation = samples.deviations[:, target]
    judged = [split.judge & np.isfinite(deviation) for split in protocol.splits]
    values = samples.change()[samples.valid]
    columns = [c.name for c in samples.inputs]
    return Budget(
        target=samples.targets[target].name,
        candidates=tuple(temperatures),
        sensors=tuple(chosen[0][:n_sizes]),
        models=tuple(names),
        blocks=tuple(split.block for split in protocol.splits),
        rms=np.moveaxis(np.reshape(found, (len(protocol.splits), len(names), n_sizes)), 0, 2),
        rows=np.array([rows.sum() for rows in judged]),
        none=np.array([rms(deviation[rows], np.zeros(rows.sum())) for rows in judged]),
        frequency=np.array(
            [
                [np.mean([name in sensors[size] for sensors in chosen[1:]]) for name in temperatures]
                for size in range(n_sizes)
            ]
        ),
        condition=np.array(
            [
                collinearity(values[:, [columns.index(s) for s in sensors]], sensors).condition_number
                for sensors in chosen[0][:n_sizes]
            ]
        ),
    )


def choose(
    samples: Samples, target: int, protocol: Protocol, settings: Settings, *, jobs: int, progress: Callable[[str], None]
) -> Choice:
    """Choose by the error on unseen blocks against the number of sensors.

    Parameters
    ----------
    samples : Samples
    target : int
        Index into ``samples.targets``.
    protocol : Protocol
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
        protocol,
        settings.models,
        max_sensors=settings.most("pareto"),
        jobs=jobs,
        progress=progress,
    )
    pooled = found.pooled()
    enough = {m: found.enough(m) for m in found.models}
    known = {m: n for m, n in enough.items() if n is not None}
    if not known:
        raise FitError(f"{candidates.target}: none of {', '.join(found.models)} could be judged in every block")
    model = min(known, key=lambda m: pooled[found.models.index(m), known[m] - 1])
    size = known[model]
    errors = Table(
        f"Error on unseen blocks: {protocol.name}",
        ("sensors", *(f"{m} RMS [um]" for m in found.models), "condition", "chosen in all rows"),
        tuple(
            (k + 1, *(float(v) for v in pooled[:, k]), float(found.condition[k]), " ".join(found.sensors[k]))
            for k in range(len(found.sensors))
        ),
        size - 1,
        f"Without compensation {found.none_pooled():.2f} um. Marked: enough for {model}; "
        + "; ".join(f"{m}: {n or 'not judged'}" for m, n in enough.items() if m != model),
    )
    order = np.argsort(-found.frequency[size - 1], kind="stable")
    frequency = Table(
        f"How surely a sensor is among the best {size}",
        ("sensor", "share of the blocks [%]"),
        tuple(
            (found.candidates[j], float(100 * found.frequency[size - 1, j]))
            for j in order
            if found.frequency[size - 1, j] > 0
        ),
        None,
        "Chosen anew without each block: a sensor far below 100 % was a matter of luck.",
    )
    sensors = found.sensors[size - 1]
    best = float(pooled[found.models.index(model), size - 1])
    return Choice(
        "pareto",
        candidates.target,
        sensors,
        f"{model} with {size} of {len(found.candidates)} temperatures leaves {best:.2f} um RMS on unseen cycles, "
        f"instead of {found.none_pooled():.2f} um; more sensors are not clearly better",
        (errors, frequency, candidates.repeats(sensors)),
        (
            "Sensors of each number are the exact best subset by least squares in the rows to learn from, whatever "
            "model is then trained on them. That number was chosen by the errors shown, so they flatter it a little.",
        ),
        found,
    )


def n_pieces(samples: Samples, protocol: Protocol, models: Sequence[str], max_sensors: int) -> int:
    """Return the number of pieces of work of `budget`, at most.

    Parameters
    ----------
    samples : Samples
    protocol : Protocol
    models : sequence of str
    max_sensors : int

    Returns
    -------
    int
    """
    temperatures = sum(c.quantity == "temperature" for c in samples.inputs)
    return len(protocol.splits) * len(expand(models)) * min(max_sensors, temperatures)


def _best(
    samples: Samples, target: int, learn: BoolArray, temperatures: Sequence[str], max_sensors: int
) -> list[tuple[str, ...]]:
    """Return the best sensors of every number, in the rows that may be learned from."""
    columns = [j for j, c in enumerate(samples.inputs) if c.name in temperatures]
    rows = learn & samples.valid & np.isfinite(samples.deviations[:, target])
    if rows.sum() < 3:
        raise FitError(f"{int(rows.sum())} complete rows of {samples.targets[target].name} to choose sensors by")
    found = best_subsets(samples.change()[rows][:, columns], samples.deviations[rows, target], max_size=max_sensors)
    return [tuple(samples.inputs[columns[j]].name for j in subset.columns) for subset in found.best]


def _unseen_rms(samples: Samples, target: int, split: Split, sensors: Sequence[str], name: str) -> float:
    speeds = [c.name for c in samples.inputs if c.quantity == "spindle_speed"]
    reduced = samples.only([*sensors, *speeds])
    try:
        model = train(name, reduced, target, split.learn).model
    except FitError:
        return float("nan")
    rows = split.judge & np.isfinite(samples.deviations[:, target])
    return rms(samples.deviations[rows, target], replay(model, reduced, rows)[0])
