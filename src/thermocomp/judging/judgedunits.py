"""Results of a model in one unseen cycle or file, and the harm that is tolerated there."""

from dataclasses import dataclass, field

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.core.learned import Learned
from thermocomp.core.size import Size
from thermocomp.judging.baselines import Against, Series, rezero, worst_of

#: largest harm tolerated by default [um], [urad]: 10 urad are 2 um at 200 mm
MOST_MARGIN = {"um": 2.0, "urad": 10.0}
#: the margin is the larger of this multiple of the probe's noise and this share of the largest training drift, capped
TIMES_NOISE, SHARE = 3.0, 0.05
#: a cycle or file whose deviation changes by less than this fraction of the largest training drift is not informative
MOVES = 0.1


@dataclass(frozen=True)
class JudgedUnit:
    """Results in one unseen cycle or file.

    Parameters
    ----------
    rms, largest : float
        RMS and largest absolute value of the residual [um].
    baselines : tuple of Against
        Comparison with each of `BASELINES`; in a section that continues the training data also with `REZEROED`.
    none_largest : float
        Largest deviation without compensation [um].
    noise : float
        Noise of the probe [um]; smaller errors are set to this value.
    margin : float
        Tolerated degradation [um].
    moves : bool
        Whether the deviation changes enough to distinguish a model from a constant.
    series : Series or None
        Rows for the comparison with the baselines that know the time; None: without these.
    """

    name: str
    rows: int
    rms: float
    largest: float
    baselines: tuple[Against, ...]
    none_largest: float
    noise: float
    margin: float
    moves: bool
    series: Series | None = field(default=None, compare=False)

    @property
    def none_rms(self) -> float:
        """RMS without compensation in this cycle or file [um]."""
        return self.baselines[0].other

    @property
    def harm(self) -> float:
        """Excess of the RMS or the largest error over that without compensation, whichever is larger [um]."""
        return max(self.rms - self.none_rms, self.largest - self.none_largest)

    @property
    def harmful(self) -> bool:
        """True if the harm exceeds the margin."""
        return self.harm > self.margin


def measure(
    name: str,
    measured: FloatArray,
    predicted: FloatArray,
    learned: Learned,
    *,
    alone: FloatArray | None = None,
    unit: str = "um",
    margin: float | None = None,
    stretch: bool = False,
    series: tuple[str, FloatArray] | None = None,
) -> JudgedUnit:
    """Return the results of a model in one unseen cycle or file.

    Parameters
    ----------
    measured, predicted : ndarray of shape (n_rows,)
        Deviations of one unseen cycle or file [um].
    alone : ndarray of shape (n_rows,), optional
        Prediction of the model alone, if `predicted` is the output of a compensator: the worse one counts, so no model
        is accepted because of limits [um].
    margin : float, optional
        Tolerated degradation [um], set before the evaluation; see `margin_of`.
    series : tuple of str and ndarray of shape (n_rows,), optional
        Fingerprint of the recording, and time since its start [s]: see `Series`.
    """
    errors = [measured - predicted]
    if alone is not None and not np.array_equal(alone, predicted):
        errors.append(measured - alone)
    sizes = [Size.of(e) for e in errors]
    others = [worst_of(errors, measured - b, learned.noise) for b in (0.0, learned.mean, learned.last)]
    if stretch:
        others.append(worst_of([rezero(e) for e in errors], rezero(measured), learned.noise))
    span = float(np.ptp(measured)) - 4 * learned.noise  # minus the span of the noise alone
    return JudgedUnit(
        name=name,
        rows=len(measured),
        rms=max(s.rms for s in sizes),
        largest=max(s.largest for s in sizes),
        baselines=tuple(others),
        none_largest=float(np.abs(measured).max()),
        noise=learned.noise,
        margin=margin_of(learned, unit) if margin is None else margin,
        moves=span > max(TIMES_NOISE * learned.noise, MOVES * learned.largest),
        series=None if series is None else Series(*series, measured, tuple(errors)),
    )


def margin_of(learned: Learned, unit: str = "um") -> float:
    """Return the default of the tolerated degradation in a single cycle or file [unit]."""
    return min(max(TIMES_NOISE * learned.noise, SHARE * learned.largest), MOST_MARGIN.get(unit, np.inf))
