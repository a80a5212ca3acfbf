"""Rules of an evaluation, and its results: `Assessment` and `Comparison`."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.arrays import FloatArray, IntArray
from thermocomp.core.correction import Limits
from thermocomp.core.exceptions import InputError
from thermocomp.core.messages import Message, join
from thermocomp.core.model import ErrorModel
from thermocomp.core.provenance import Word, accepted
from thermocomp.judging import do_no_harm, judgedunits, metrics
from thermocomp.judging.diagnostics import Collinearity
from thermocomp.judging.inuse import InUse, least
from thermocomp.judging.probing import Probed
from thermocomp.judging.recommend import Recommendation
from thermocomp.judging.robustness import Robustness
from thermocomp.judging.splits import Judging
from thermocomp.judging.uncertainty import FigureUncertainty, find_scatter, find_uncertainty
from thermocomp.models.methods import deployable
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.starts import Start


@dataclass(frozen=True)
class Rules:
    """Rules set before the evaluation.

    Parameters
    ----------
    margin : float or None
        Tolerated degradation in a single cycle or file [unit of the target]; None: calculated by
        `judgedunits.margin_of`.
    primary : str or None
        Primary method: its verdict is found without a correction for multiple comparisons, those of the others with
        one.
    noise : float or None
        Standard deviation of the noise of the temperatures in use [degC]; None: estimated from the recordings.
    """

    margin: float | None = None
    primary: str | None = None
    noise: float | None = None

    def __post_init__(self) -> None:
        if self.noise is not None and not 0 <= self.noise < np.inf:
            raise InputError(f"noise {self.noise}: expected a finite number that is not negative")
        if self.margin is not None and not 0 <= self.margin < np.inf:
            raise InputError(f"margin {self.margin}: expected a finite number that is not negative")

    def check(self, names: Sequence[str]) -> None:
        """Raise `InputError` if the primary method is not among the methods compared."""
        if self.primary is not None and self.primary not in names:
            raise InputError(f"primary method {self.primary!r} is not among the compared methods, {', '.join(names)}")


@dataclass(frozen=True, eq=False)
class Assessment:
    """Result of one model for one target on one unseen block.

    Parameters
    ----------
    measured, predicted : ndarray of shape (n_judged,)
        Deviations [um].
    row, test, cycle : ndarray of int of shape (n_judged,)
        Row in the file, index of the file, and thermal cycle of each judged row.
    verdict : Verdict
        Verdict of the do-no-harm gate.
    sensors : tuple of str
        Inputs that affect the result; if several models were trained, those of all models.
    fit_s : float
        Total duration of the fits [s].
    n_effective : float
        Effective sample size of the residual.
    frozen : ErrorModel or None
        The model replayed; None for several blocks together, or if it could not be fitted.
    failure : str
        Reason why the method could not be fitted; empty if it could.
    caveat : str
        Reason why the result is not an honest error, such as training rows among the judged ones; empty if it is.
    overall : bool
        True for the final result of this model and target, over all judged data instead of one cycle.
    n_sensors : tuple of (int, int)
        Smallest and largest number of inputs that affect the result of one model.
    learned : int
        Number of rows used for training the model: not judged, unless there are no others (see `caveat`).
    alone : ndarray of shape (n_judged,), optional
        Prediction of the model alone, without gate and limits; `predicted` is the output with them [um].
    limits : Limits or None
        Limits applied to `predicted`; None: no limits, only the model behind the gate, or the model alone.
    rejected : int
        Number of judged readings rejected by the gate although they were complete.
    turned_away : str
        The first rejected reading, and the reason.
    half_widths : ndarray of shape (n_judged,), optional
        Half-widths of the band about the prediction of the model alone, from the training rows only; nan in rows
        without a band [um].
    band : str
        Name of the band; empty if no row has one.
    probed : Probed or None
        Effect of probings; None: the model ran without probings.
    uncertainty : FigureUncertainty or None
        Measurement uncertainty of RMS and largest error; None: the recordings state no contribution.
    """

    model: str
    target: str
    block: str
    measured: FloatArray
    predicted: FloatArray
    row: IntArray
    test: IntArray
    cycle: IntArray
    verdict: do_no_harm.Verdict
    sensors: tuple[str, ...] = ()
    fit_s: float = 0.0
    n_effective: float = float("nan")
    robustness: Robustness | None = None
    frozen: ErrorModel | None = None
    failure: str = ""
    caveat: str = ""
    overall: bool = False
    n_sensors: tuple[int, int] = (0, 0)
    learned: int = 0
    alone: FloatArray | None = None
    limits: Limits | None = None
    rejected: int = 0
    turned_away: str = ""
    half_widths: FloatArray | None = None
    band: str = ""
    probed: Probed | None = None
    uncertainty: FigureUncertainty | None = None

    @property
    def coverage(self) -> float:
        """Fraction of the judged rows inside the band; nan without a band."""
        known = self._banded
        alone = self.predicted if self.alone is None else self.alone
        if self.half_widths is None or not known.any():
            return float("nan")
        return float((np.abs(self.measured - alone) <= self.half_widths)[known].mean())

    @property
    def half_width(self) -> float:
        """Mean half-width of the band over the judged rows [um]; nan without a band."""
        known = self._banded
        return float(self.half_widths[known].mean()) if self.half_widths is not None and known.any() else float("nan")

    @property
    def _banded(self) -> NDArray[np.bool_]:
        """Mask of the judged rows that have an uncertainty band."""
        return np.zeros(0, np.bool_) if self.half_widths is None else np.isfinite(self.half_widths)

    @property
    def deployable(self) -> bool:
        """True if the method can be frozen and may run at a machine."""
        return deployable(self.model)

    def metric(self, name: str) -> float:
        """Return a metric of `thermocomp.judging.metrics`; nan if the method could not be fitted."""
        return float("nan") if self.failure else metrics.METRICS[name](self.measured, self.predicted)

    def alone_metric(self, name: str) -> float:
        """Return the value of a metric for the model alone, without gate and limits."""
        alone = self.predicted if self.alone is None else self.alone
        return float("nan") if self.failure else metrics.METRICS[name](self.measured, alone)

    def unprobed_metric(self, name: str) -> float:
        """Return the value of a metric for the compensator without probings."""
        return metrics.METRICS[name](self.measured, self.predicted if self.probed is None else self.probed.without)

    @property
    def undisturbed(self) -> float:
        """Reference RMS for noise and lost sensors: of the model alone, without probings."""
        if self.probed is not None or self.alone is None:
            return self.unprobed_metric("rms")
        return metrics.METRICS["rms"](self.measured, self.alone)

    @property
    def noisy_rms(self) -> float:
        """RMS with noise on every temperature; without, if its effect was not tested [um]."""
        return self.metric("rms") if self.robustness is None else self.robustness.noisy_rms

    def in_use(self, noise: float) -> InUse:
        """Return the error in use with a noise of the temperatures [degC]; its numbers only for a single block."""
        numbers = len(self.frozen.coefficients_by_name()) if self.frozen is not None and self.deployable else 0
        ties = {"sensors": self.n_sensors[1], "numbers": numbers}
        if self.failure:
            return InUse(np.inf, np.inf, np.inf, **ties)
        return InUse.of(self.metric("rms"), self.undisturbed, self.robustness, noise, **ties)

    def held_metric(self, name: str) -> float:
        """Return a metric for compensation by probings alone, each held until the next; without probings, for none."""
        held = np.zeros_like(self.measured) if self.probed is None else self.probed.held(self.measured, self.test)
        return metrics.METRICS[name](self.measured, held)

    def none_metric(self, name: str) -> float:
        """Return the value of a metric without compensation."""
        return (
            metrics.METRICS[name](self.measured, np.zeros_like(self.measured)) if self.measured.size else float("nan")
        )

    @property
    def accepted(self) -> bool:
        """True if the model may run."""
        return accepted(self.word)

    @property
    def word(self) -> Word | Literal["not unseen"]:
        """``accepted``, ``accepted for this duty``, ``unproven``, ``refused`` or, on training data, ``not unseen``."""
        if self.failure:
            return "refused"
        if self.caveat:
            return "not unseen"
        return "unproven" if self._fragile else self.verdict.word

    @property
    def _fragile(self) -> str:
        """Effect of disturbed readings on a model that is accepted without them; empty if it is harmless."""
        if self.robustness is None or not self.verdict.accepted:
            return ""
        margin = max(u.margin for u in self.verdict.units)  # a stated one applies to the judged errors only
        most = judgedunits.MOST_MARGIN.get(self.verdict.unit, np.inf)
        return self.robustness.harm_beyond(min(margin, most))

    @property
    def reason(self) -> str:
        """Reason for the verdict, and for an unproven one the test that would decide it."""
        if self.failure:
            return Message("could not be judged: {reason}", reason=self.failure)
        if self.caveat:
            return self.caveat
        reason = self.verdict.told
        if fragile := self._fragile:
            advice = Message("; use fewer sensors (thermocomp select) or filter the readings")
            reason = join([fragile, advice])
        if not self.learned:
            return reason
        left_out = Message(
            "; {n:,} of {of:,} rows were used for training and are left out",
            n=self.learned,
            of=len(self.measured) + self.learned,
        )
        return join([reason, left_out])


def with_uncertainty(found: Sequence[Assessment], recordings: Sequence[Recording]) -> tuple[Assessment, ...]:
    """Return assessments with the measurement uncertainty that the recordings declare for their displacements."""
    scatter = cache(find_scatter)
    return tuple(
        a
        if a.failure or a.verdict.unit != "um"
        else replace(
            a, uncertainty=find_uncertainty(a.target, a.measured, a.predicted, a.test, recordings, scatter=scatter)
        )
        for a in found
    )


@dataclass(frozen=True)
class Comparison:
    """Several methods on the same unseen blocks.

    Parameters
    ----------
    assessments : tuple of Assessment
        Per target, method and block; with several blocks, also one over all blocks.
    collinearity : Collinearity
        Collinearity of the temperatures.
    left : int
        Number of pairs of method and target not judged because the work was interrupted.
    recommended : tuple of Recommendation
        Per target, if there was a choice.
    starts : tuple of (str, Start)
        Names of the recordings, and their initial states.
    noise : float
        Noise of the temperatures in use [degC].
    stated : bool
        The noise was stated before the evaluation, not estimated from the recordings.
    unwatched : dict of str to str
        Blocks for which no watch could be trained, and why: the loss of a sensor is judged there as if undetected.
    """

    judging: Judging
    assessments: tuple[Assessment, ...]
    collinearity: Collinearity
    left: int = 0
    recommended: tuple[Recommendation, ...] = ()
    starts: tuple[tuple[str, Start], ...] = ()
    noise: float = 0.0
    stated: bool = False
    unwatched: dict[str, str] = field(default_factory=dict)

    def overall(self) -> tuple[Assessment, ...]:
        """Return one assessment per target and method, over all its blocks."""
        return tuple(a for a in self.assessments if a.overall)

    def best(self, target: str) -> Assessment | None:
        """Return the assessment of the recommended method for a target; None if none may run.

        Of the accepted methods that can be deployed, it has the least error in use; see `thermocomp.judging.inuse`.
        """
        fit = [a for a in self._candidates(target) if a.accepted and a.metric("rms") <= a.none_metric("rms")]
        return self._least(fit) if fit else None

    def in_use(self, judged: Assessment) -> InUse:
        """Return the error in use of a method over all blocks."""
        own = [a for a in self.assessments if (a.target, a.model) == (judged.target, judged.model)]
        return replace(judged.in_use(self.noise), numbers=max(a.in_use(self.noise).numbers for a in own))

    def next_best(self, target: str) -> Assessment | None:
        """Return the accepted method with the least error in use besides the recommended one."""
        best = self.best(target)
        others = [a for a in self._candidates(target) if a.accepted and a is not best]
        return min(others, key=lambda a: self.in_use(a).rms, default=None)

    def _candidates(self, target: str) -> list[Assessment]:
        return [a for a in self.overall() if a.target == target and a.deployable and not a.failure]

    def _least(self, judged: Sequence[Assessment]) -> Assessment:
        found = {a.model: a for a in judged}
        return found[least({name: self.in_use(a) for name, a in found.items()})]

    def written(self, target: str) -> Assessment | None:
        """Return the assessment of the method that ``fit`` writes for a target.

        It is `best`, or if none was accepted, the unproven or else the refused one with the least error in use; None if
        no method could be judged that can be stored as coefficients.
        """
        own = self._candidates(target)
        open_ones = [a for a in own if a.word != "refused"] or own
        return self.best(target) or (self._least(open_ones) if open_ones else None)

    def of(self, chosen: Mapping[str, str]) -> "Comparison":
        """Return the results of one method per target, in the order of `chosen`."""
        kept = (a for target, name in chosen.items() for a in self.assessments if (a.target, a.model) == (target, name))
        return replace(self, assessments=tuple(kept))
