"""Effect of noise, of a lost sensor and of undetected deviations on a model."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.arrays import BoolArray, FloatArray
from thermocomp.core.messages import Message, join
from thermocomp.core.model import ErrorModel
from thermocomp.core.size import Size
from thermocomp.judging.guards import Guard
from thermocomp.judging.replay import Disturb, walk
from thermocomp.recordings.samples import Samples

#: amplitude of the noise on every temperature (C-33) [degC]
NOISE = 0.4
#: lasting deviation of a temperature, at most half its trained range [degC]. A watch may not detect it if it grows
#: slowly: heat from an axis that did not move in the recording, colder coolant, or a drift of the sensor
OFF = 1.0


@dataclass(frozen=True)
class Robustness:
    """Errors of a model replayed with disturbed readings.

    Parameters
    ----------
    noise : float
        Noise on every temperature [degC].
    noise_rms : dict of str to tuple of float
        Mean and largest RMS over the draws, per noise distribution [um].
    lost_rms : dict of str to float
        RMS with one sensor lost [um].
    outside : float
        Fraction of rows with an input outside the trained range.
    outside_rms : float
        RMS in these rows [um]; nan without any.
    none_rms : float
        RMS without compensation in all rows [um].
    unlike : float
        Fraction of rows outside the joint support: inputs that together are unlike the training data, or an untrained
        speed.
    unlike_rms : float
        RMS in these rows [um]; nan without any.
    together_rms : dict of str to float
        RMS with several sensors lost at once (``t1_C, t2_C``); used only to decide whether the model may then run
        [um].
    deviating : dict of str to tuple of float
        By temperature: lasting deviation that a watch may not detect [degC], and RMS with it [um].
    """

    noise: float
    noise_rms: dict[str, tuple[float, float]]
    lost_rms: dict[str, float]
    outside: float
    outside_rms: float
    none_rms: float
    unlike: float = 0.0
    unlike_rms: float = float("nan")
    together_rms: dict[str, float] = field(default_factory=dict)
    deviating: dict[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def worse_than_none(self) -> tuple[str, ...]:
        """Disturbances under which the error of the model exceeds that without compensation, so that it does harm.

        Examples: ``noise of 0.4 degC`` (the mean over the draws of one of its distributions), ``loss of t3_C`` and
        ``t3_C off by 1.2 degC``.
        """
        return tuple(self._above(self.none_rms))

    @property
    def harm(self) -> str:
        """Disturbances that make the model worse than no compensation, with the RMS, as text; empty if none do."""
        return self.harm_beyond(0.0)

    def harm_beyond(self, margin: float) -> str:
        """Return the disturbances that make a model worse than no compensation by more than a margin [um], as text."""
        above = self._above(self.none_rms + margin)
        if not above:
            return ""
        told = join([Message("{what} ({rms:.2f} um)", what=what, rms=rms) for what, rms in [*above.items()][:4]], ", ")
        return Message(
            "worse than no compensation ({none:.2f} um RMS) with {disturbances}",
            none=self.none_rms,
            disturbances=told if len(above) <= 4 else Message("{names} and {n} more", names=told, n=len(above) - 4),
        )

    def _above(self, limit: float) -> dict[Message, float]:
        """Return the disturbances whose RMS exceeds a limit, with the RMS [um]: of a kind, the worst first."""
        lost = sorted(self.lost_rms.items(), key=lambda item: -item[1])
        off = sorted(self.deviating.items(), key=lambda item: -item[1][1])
        found = {Message("noise of {noise:g} degC", noise=self.noise): self.noisy_rms}
        found |= {Message("loss of {sensor}", sensor=name): rms for name, rms in lost}
        found |= {Message("{sensor} off by {by:.2g} degC", sensor=name, by=by): rms for name, (by, rms) in off}
        return {what: rms for what, rms in found.items() if rms > limit}

    @property
    def noisy_rms(self) -> float:
        """Mean RMS over the draws of the noise, for the distribution with the larger one [um]."""
        return max((mean for mean, _ in self.noise_rms.values()), default=0.0)

    @property
    def worst_lost(self) -> tuple[str, float]:
        """Sensor whose loss causes the largest error, and the RMS without it [um]."""
        return max(self.lost_rms.items(), key=lambda item: item[1], default=("", float("nan")))

    @property
    def worst_off(self) -> tuple[str, float]:
        """Sensor whose undetected deviation causes the largest error, and the RMS with it [um]."""
        found = ((name, rms) for name, (_, rms) in self.deviating.items())
        return max(found, key=lambda item: item[1], default=("", float("nan")))


def worse(one: Robustness, other: Robustness) -> Robustness:
    """Return `one`, with the worse result of `one` and `other` for each disturbance."""
    noise = {
        law: (max(mean, other.noise_rms[law][0]), max(largest, other.noise_rms[law][1]))
        for law, (mean, largest) in one.noise_rms.items()
    }
    lost, together = (
        {n: max(a.get(n, 0.0), b.get(n, 0.0)) for n in dict.fromkeys((*a, *b))}
        for a, b in ((one.lost_rms, other.lost_rms), (one.together_rms, other.together_rms))
    )
    off = dict(one.deviating)
    for name, (by, rms) in other.deviating.items():
        off[name] = max(off.get(name, (by, rms)), (by, rms), key=lambda found: found[1])
    return replace(one, noise_rms=noise, lost_rms=lost, together_rms=together, deviating=off)


def pool_robustness(parts: Sequence[tuple[Robustness | None, int]]) -> Robustness | None:
    """Pool the results of several blocks, weighted by their numbers of rows; None if a block has no result.

    RMS values are pooled as the root of the mean square; for the largest over the draws, the maximum is used.
    """
    known = [(r, n) for r, n in parts if r is not None]
    if not known or len(known) < len(parts):
        return None

    def mean_square(values: Sequence[float], weights: Sequence[float]) -> float:
        total = sum(weights)
        return float(np.sqrt(sum(w * v**2 for v, w in zip(values, weights, strict=True)) / total)) if total else np.nan

    def by_name(parts: Sequence[tuple[dict[str, float], int]]) -> dict[str, float]:
        names = dict.fromkeys(name for of, _ in parts for name in of)
        return {
            name: mean_square([of[name] for of, _ in parts if name in of], [n for of, n in parts if name in of])
            for name in names
        }

    rows = [n for _, n in known]
    first = known[0][0]
    beyond = [(r.outside_rms, r.outside * n) for r, n in known if r.outside > 0]
    unlike = [(r.unlike_rms, r.unlike * n) for r, n in known if r.unlike > 0]
    return Robustness(
        noise=first.noise,
        noise_rms={
            law: (
                mean_square([r.noise_rms[law][0] for r, _ in known], rows),
                max(r.noise_rms[law][1] for r, _ in known),
            )
            for law in first.noise_rms
        },
        lost_rms=by_name([(r.lost_rms, n) for r, n in known]),
        together_rms=by_name([(r.together_rms, n) for r, n in known]),
        deviating={
            name: (max(r.deviating[name][0] for r, _ in known if name in r.deviating), rms)
            for name, rms in by_name([({k: v for k, (_, v) in r.deviating.items()}, n) for r, n in known]).items()
        },
        outside=sum(r.outside * n for r, n in known) / sum(rows),
        outside_rms=mean_square([v for v, _ in beyond], [w for _, w in beyond]),
        none_rms=mean_square([r.none_rms for r, _ in known], rows),
        unlike=sum(r.unlike * n for r, n in known) / sum(rows),
        unlike_rms=mean_square([v for v, _ in unlike], [w for _, w in unlike]),
    )


@dataclass(frozen=True)
class Replayed:
    """Prediction with undisturbed readings, and RMS errors with disturbed ones."""

    predicted: FloatArray
    outside: BoolArray
    robustness: Robustness


def stress(
    model: ErrorModel,
    samples: Samples,
    measured: FloatArray,
    rows: BoolArray,
    *,
    draws: int = 100,
    guard: Guard | None = None,
) -> Replayed:
    """Replay a model once, undisturbed and disturbed in parallel.

    - Noise on every temperature, independent from row to row (C-33). The paper states an amplitude but no distribution
      (E-C9), so both are drawn: uniform within +-`NOISE`, and normal with `NOISE` as standard deviation.
    - Each sensor lost: its change reads zero from the start (C-34), the worst kind of failure. With a guard, a
      watch may detect it; without, it goes undetected.
    - Each temperature off by `OFF` once the zero is known. The deviation may have either sign: its effect is added to
      the error as if uncorrelated with it.

    Parameters
    ----------
    measured : ndarray of shape (n_wanted,)
        Deviations in `rows` [um].
    rows : ndarray of bool of shape (n_rows,)
        Rows to judge.
    """
    lost: list[tuple[str, ...]] = [(i.name,) for i in model.inputs if i.name in model.sensors]
    lost += [names for names in (guard.readings if guard else ()) if len(names) > 1 and {*names} <= {*model.sensors}]
    off = _find_undetected(model, samples)
    disturb = _disturb(model, samples, draws, lost, guard, off)
    # sums instead of a table: a long recording times two hundred variants would not fit into memory
    predicted, beyond = np.empty(len(measured)), np.empty(len(measured), dtype=np.bool_)
    squares, done = np.zeros(1 + 2 * draws + len(lost) + len(off)), 0
    for some in walk(model.merged(), samples, rows, disturb):
        part = slice(done, done + len(some.rows))
        error = measured[part, None] - some.deviation
        error[:, len(squares) - len(off) :] -= error[:, :1]  # the effect alone
        squares += (error**2).sum(axis=0)
        predicted[part], beyond[part] = some.deviation[:, 0], some.outside[:, 0].any(axis=-1)
        done = part.stop
    squares[len(squares) - len(off) :] += squares[0]
    rms = np.sqrt(squares / len(measured))
    without, deviating = rms[1 + 2 * draws :][: len(lost)], rms[len(rms) - len(off) :]
    laws = {"uniform": rms[1 : 1 + draws], "normal": rms[1 + draws : 1 + 2 * draws]}
    unlike = unlike_rows(model, samples, rows)
    robustness = Robustness(
        noise=NOISE,
        noise_rms={law: (float(v.mean()), float(v.max())) for law, v in laws.items() if v.size},
        lost_rms={names[0]: float(v) for names, v in zip(lost, without, strict=True) if len(names) == 1},
        together_rms={", ".join(n): float(v) for n, v in zip(lost, without, strict=True) if len(n) > 1},
        deviating={name: (abs(by), float(v)) for (name, by), v in zip(off.items(), deviating, strict=True)},
        outside=float(beyond.mean()),
        outside_rms=Size.of((measured - predicted)[beyond]).rms,
        none_rms=Size.of(measured).rms,
        unlike=float(unlike.mean()),
        unlike_rms=Size.of((measured - predicted)[unlike]).rms,
    )
    return Replayed(predicted, beyond, robustness)


def _disturb(
    model: ErrorModel,
    samples: Samples,
    draws: int,
    lost: Sequence[tuple[str, ...]],
    guard: Guard | None,
    off: dict[str, float],
) -> Disturb:
    """Return what makes the variants of readings: undisturbed, with noise, with sensors lost, with sensors off."""
    names = [i.name for i in model.inputs]
    temperatures = np.flatnonzero([i.quantity == "temperature" for i in model.inputs])
    cut = [[names.index(name) for name in of] for of in lost]
    known = [c.name for c in samples.inputs]
    columns = {known.index(name): k for k, name in enumerate(names)}
    let = [
        {columns[c]: v for c, v in guard.readings.get(of, {}).items() if c in columns} if guard else {} for of in lost
    ]
    first = np.full(len(samples.test_names), np.inf)
    np.minimum.at(first, samples.test, samples.time)
    zeroed = samples.time > first[samples.test] + model.zeroing.at_rest
    rng = np.random.default_rng(0)
    adjacent = temperatures.size and temperatures[-1] - temperatures[0] + 1 == temperatures.size
    # a slice of adjacent columns is added to in place, in a third of the time
    heat = slice(temperatures[0], temperatures[-1] + 1) if adjacent else temperatures

    def disturb(rows: NDArray[np.intp], readings: FloatArray, reference: FloatArray) -> FloatArray:
        batch = np.repeat(readings[:, None], 1 + 2 * draws + len(lost) + len(off), axis=1)
        noise = np.empty((2, draws, len(temperatures)))
        for own in batch:  # a row after the other: the noise of a row does not depend on those after it
            rng.random(out=noise[0])
            rng.standard_normal(out=noise[1])
            noise[0] += noise[0] - 1.0
            noise *= NOISE
            own[1 : 1 + 2 * draws, heat] += noise.reshape(2 * draws, len(temperatures))
        for variant, (places, through) in enumerate(zip(cut, let, strict=True), start=1 + 2 * draws):
            if guard and lost[variant - 1 - 2 * draws] in guard.readings:
                for k, values in through.items():
                    batch[:, variant, k] = values[rows]
            else:
                batch[:, variant, places] = reference[places]
        for variant, (name, by) in enumerate(off.items(), start=1 + 2 * draws + len(lost)):
            batch[:, variant, names.index(name)] += by * zeroed[rows]
        return batch

    return disturb


def _find_undetected(model: ErrorModel, samples: Samples) -> dict[str, float]:
    """Return a lasting deviation of each temperature that a watch may not detect [degC].

    Its sign is towards the middle of the trained range, so that the support does not hide its effect.
    """
    usual = dict(zip((c.name for c in samples.inputs), np.nanmean(samples.change(), axis=0).tolist(), strict=True))
    return {
        i.name: float(np.copysign(min(OFF, (i.high - i.low) / 2), (i.low + i.high) / 2 - usual[i.name]))
        for i in model.inputs
        if i.quantity == "temperature"
    }


def unlike_rows(model: ErrorModel, samples: Samples, rows: BoolArray) -> BoolArray:
    """Return a mask of the rows outside the joint support of a model; rows with a missing input are not included.

    Parameters
    ----------
    rows : ndarray of bool of shape (n_rows,)

    Returns
    -------
    ndarray of bool of shape (n_wanted,)
    """
    if model.joint is None:
        return np.zeros(int(rows.sum()), dtype=np.bool_)
    columns = [[c.name for c in samples.inputs].index(i.name) for i in model.inputs]
    return np.asarray(model.joint.distance(samples.change()[rows][:, columns]) > 1.0)
