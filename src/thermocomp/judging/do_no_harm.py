"""The do-no-harm gate: a model is accepted, unproven or refused, by its errors on independent cycles or files.

The thermal cycles or files are unseen by the model and independent, unlike rows. A model is better than a baseline if
its error is smaller on average over them, and if its output agrees with the baseline's error by a one-sided t-test
(`thermocomp.judging.baselines`). It is harmful if it is much worse than no compensation in a single one. For the
reasons see ``docs/decisions/0020-verdict.md`` and ``0048-proof.md``.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy import stats

from thermocomp.core.arrays import FloatArray
from thermocomp.core.learned import Learned
from thermocomp.core.messages import Message
from thermocomp.core.provenance import Word, accepted
from thermocomp.core.size import Size
from thermocomp.judging.baselines import (
    BASELINES,
    CURVE,
    OF_TIME,
    REZEROED,
    SLOW,
    Against,
    OfTime,
    Series,
    compare_with_time,
    p_above_least,
    rezero,
    worst_of,
)
from thermocomp.judging.repeats import group_repeats
from thermocomp.judging.splits import MIN_ROWS

#: minimum number of cycles or files for a significance test
MIN_UNITS = 3
#: smaller p-values are not told apart: the test assumes normal values
LEAST_P = 0.001
#: significance level of the one-sided test
LEVEL = 0.05
#: largest harm tolerated by default [um], [urad]: 10 urad are 2 um at 200 mm
MOST_MARGIN = {"um": 2.0, "urad": 10.0}
#: the margin is the larger of this multiple of the probe's noise and this share of the largest training drift, capped
TIMES_NOISE, SHARE = 3.0, 0.05
#: drifts are of one duty if, slow changes removed, their mean curve leaves less than this share of them, and if the
#: largest is less than this multiple of the smallest
UNLIKE, SIZES = 0.6, 3.0
#: reason against acceptance if the effects of noise and lost sensors were not tested
UNTRIED = Message("the effects of noise and of a lost sensor were not tested: compare with robustness=True")
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


@dataclass(frozen=True)
class Verdict:
    """Decision of the do-no-harm gate over several cycles or files.

    Parameters
    ----------
    unit : str
        Unit of the deviations.
    caps : tuple of str
        Reasons that prevent acceptance whatever the errors: a single continuous block, faults in the data.
    refusal : str
        Reason to refuse the model whatever the errors: no sensor.
    tried : int
        Number of methods tried for this target.
    p : float or None
        P-value of the test, corrected for the number of methods; None: computed from the errors.
    about : str
        Reason why the p-value is not corrected for the number of methods; empty if it is.
    given : tuple of str
        Names of the baselines of the units.
    stated : float or None
        Tolerated degradation as set by the user before the evaluation; None: calculated by `margin_of`.
    """

    units: tuple[JudgedUnit, ...]
    unit: str = "um"
    caps: tuple[str, ...] = ()
    refusal: str = ""
    tried: int = 1
    p: float | None = None
    about: str = ""
    given: tuple[str, ...] = (*BASELINES, REZEROED)
    stated: float | None = None

    @cached_property
    def compared(self) -> dict[str, tuple[Against, ...]]:
        """Comparison with each baseline in each cycle or file."""
        if not self.units:
            return {}
        columns = zip(*(u.baselines for u in self.units), strict=True)
        found = dict(zip(self.given, columns, strict=False))
        if self._of_time is not None:
            found |= dict(zip(OF_TIME, zip(*self._of_time.units, strict=True), strict=True))
        return found

    @cached_property
    def _of_time(self) -> OfTime | None:
        """Comparison with the baselines that know the time; None if there are too few cycles or files."""
        series = [u.series for u in self.units if u.series is not None]
        stretch = any(len(u.baselines) > len(BASELINES) for u in self.units)
        if stretch or not len(series) == len(self.units) >= MIN_UNITS:
            return None
        return compare_with_time(series, [u.noise for u in self.units])

    @cached_property
    def one_duty(self) -> bool:
        """True if the drift is so alike in all cycles or files that they prove one duty only."""
        of_time = self._of_time
        alike = of_time is not None and of_time.unlike < UNLIKE and of_time.sizes < SIZES
        return alike or self._p_without_repeats > LEVEL

    @property
    def _p_without_repeats(self) -> float:
        """P-value of the test in which cycles or files that repeat each other count once; 0 if there are none."""
        series = [u.series for u in self.units if u.series is not None]
        if not len(series) == len(self.units) >= MIN_UNITS:
            return 0.0
        groups = group_repeats(series)
        if len(groups) == len(self.units):
            return 0.0
        if len(groups) < MIN_UNITS:
            return 1.0
        columns = [np.array([a.agreement for a in c]) for c in self.compared.values()]
        worst = max(p_above_least([float(c[g].mean()) for g in groups]) for c in columns)
        return worst * (1 if self.p is None else self.tried)

    @cached_property
    def mean_ratios(self) -> dict[str, float]:
        """Mean logarithm of the ratio of the errors of model and baseline."""
        return {
            name: float(np.mean([a.log_ratio(u.noise) for a, u in zip(column, self.units, strict=True)]))
            for name, column in self.compared.items()
        }

    @cached_property
    def p_values(self) -> dict[str, float]:
        """One-sided p-value for each baseline; 1 with fewer than `MIN_UNITS` units, or if not beaten on average."""
        if len(self.units) < MIN_UNITS:
            return dict.fromkeys(self.compared, 1.0)
        return {
            name: p_above_least([a.agreement for a in column]) if self.mean_ratios[name] < 0 else 1.0
            for name, column in self.compared.items()
        }

    @property
    def worst(self) -> str:
        """Name of the baseline that is hardest to beat."""
        names = list(self.compared)
        return max(names, key=lambda name: (self.p_values[name], self.mean_ratios[name]))

    @property
    def p_value(self) -> float:
        """P-value that decides the verdict: that for the baseline that is hardest to beat."""
        return self.p_values[self.worst] if self.p is None else self.p

    @property
    def _unbeaten(self) -> str:
        """Baseline that refuses the model because it is at least as good; empty if there is none."""
        found = {name: ratio for name, ratio in self.mean_ratios.items() if name not in OF_TIME}
        name = max(found, key=found.__getitem__)
        return name if found[name] >= 0 else ""

    @cached_property
    def word(self) -> Word:
        """Decision: the model may run, may run in shadow only, or may not run."""
        if self.refusal or any(u.harmful for u in self.units):
            return "refused"
        if not self.units or not self._moving:
            return "unproven"
        if self._unbeaten:
            return "refused"
        enough = len(self.units) >= MIN_UNITS and self._moving >= MIN_UNITS - 1
        if not enough or self.caps or self.p_value > LEVEL:
            return "unproven"
        return "accepted for this duty" if self.one_duty else "accepted"

    @property
    def accepted(self) -> bool:
        """True if the model may run."""
        return accepted(self.word)

    @property
    def _moving(self) -> int:
        return sum(u.moves for u in self.units)

    @property
    def reason(self) -> str:
        """Reason for the verdict in one sentence, with the decisive cycle, file or baseline."""
        if self.refusal or not self.units:
            return self.refusal or f"every cycle has fewer than {MIN_ROWS} rows of validation data"
        stated = "" if self.stated is None else f"; the harm margin was set to {self.stated:g} {self.unit}"
        return self._by_units() + stated

    def _by_units(self) -> str:
        if any(u.harmful for u in self.units):
            worst = max(self.units, key=lambda u: u.harm - u.margin)
            return f"does harm in {worst.name}: {self._figures(worst)} (margin {worst.margin:.2g} {self.unit})"
        if self._moving and self._unbeaten:
            return f"no better than {self._unbeaten}: {self._pooled(self._unbeaten)}"
        return self._why_accepted() if self.accepted else self._why_unproven()

    def _why_accepted(self) -> str:
        least = max(self.units, key=lambda u: u.harm)
        others = f"better than {self.worst} and the other baselines"
        duty = "; the drift is much the same each time, so other speeds and durations are not proved" * self.one_duty
        return f"{others}, {self._tested()}; smallest gain in {least.name}: {self._figures(least)}{duty}"

    def _why_unproven(self) -> str:
        n, moving = len(self.units), self._moving
        if not moving:
            return (
                f"no significant drift in the validation data: {self._figures(self.units[0])} in {self.units[0].name}"
            )
        if self.caps:
            return "; ".join(self.caps)
        if n < MIN_UNITS:
            return f"judged on only {n} of {MIN_UNITS} required cycles or files"
        if moving < MIN_UNITS - 1:
            return f"only {moving} of {n} cycles or files have a significant drift"
        name = self.worst
        tested = "" if self.mean_ratios[name] >= 0 else f", {self._tested()}"
        return f"not shown to be better than {name}: {self._pooled(name)}{tested}"

    def _tested(self) -> str:
        tried = f", {self.tried} methods tried" if self.tried > 1 else ""
        p = f"p = {self.p_value:.2g}" if self.p_value >= LEAST_P else f"p < {LEAST_P}"
        return f"{p} over {len(self.units)} cycles or files{tried}{', ' if self.about else ''}{self.about}"

    @property
    def told(self) -> str:
        """Return the reason, and for an unproven model the test that would decide the verdict."""
        return f"{self.reason}; {self.advice}" if self.advice else self.reason

    @property
    def advice(self) -> str:
        """Thermal test that would decide an unproven verdict; empty for the other verdicts."""
        if self.word != "unproven" or self.caps == (UNTRIED,):  # the reason already gives the advice
            return ""
        if self.caps:
            by_stretch = any("one section" in cap for cap in self.caps)
            way = "by leave-one-cycle-out or leave-one-file-out" if by_stretch else "on recordings without this problem"
            return f"judge it {way}"
        n = len(self.units)
        if n < MIN_UNITS:
            more = MIN_UNITS - n
            return f"record {more} more thermal cycle{'s' * (more > 1)}, at other speeds or on other days"
        if self._moving < MIN_UNITS - 1:
            return "record cycles with a warm-up or a change of speed"
        return self._more_units()

    def _more_units(self) -> str:
        """Advice if all required cycles or files were judged."""
        if self.worst == CURVE and self.one_duty:
            return "the drift is much the same each time: record other speeds and durations"
        if self.worst == SLOW and len({u.series.record for u in self.units if u.series}) < MIN_UNITS:
            return (
                "the cycles of a recording share its warm-up and its days: let the machine cool and record again, "
                f"{MIN_UNITS} starts in all, or run speeds in a random order"
            )
        more = self._units_for(LEVEL if self.p is None else LEVEL / max(self.tried, 1))
        return f"about {more} cycles or files in all would decide" if more else "many more cycles would be needed"

    def _units_for(self, level: float) -> int | None:
        """Return the number of cycles or files with such errors that would suffice for acceptance; None if over 50."""
        agreements = np.array([a.agreement for a in self.compared[self.worst]])
        effect = agreements.mean() / max(agreements.std(ddof=1), 1e-9)
        for n in range(len(agreements) + 1, 51):
            if stats.t.sf(effect * np.sqrt(n), n - 1) <= level / 2:  # half the level: clearly below
                return n
        return None

    def _figures(self, u: JudgedUnit) -> str:
        text = f"RMS {u.rms:.2f} {self.unit}, {u.none_rms:.2f} {self.unit} without compensation"
        if u.rms - u.none_rms < u.harm:
            text += f", largest {u.largest:.2f} and {u.none_largest:.2f} {self.unit}"
        return text

    def _pooled(self, name: str) -> str:
        mine, other = np.sqrt(np.mean(np.square([(a.rms, a.other) for a in self.compared[name]]), axis=0))
        return f"RMS {mine:.2f} {self.unit} compared with {other:.2f} {self.unit} over all cycles or files"


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


def join_verdicts(parts: Sequence[Verdict], about: str = "", caps: tuple[str, ...] = ()) -> Verdict:
    """Return the verdict over the cycles or files of several verdicts, with all reasons against acceptance."""
    return Verdict(
        units=tuple(u for v in parts for u in v.units),
        unit=parts[0].unit,
        caps=tuple(dict.fromkeys([*caps, *(c for v in parts for c in v.caps)])),
        refusal=next((v.refusal for v in parts if v.refusal), ""),
        about=about,
        stated=parts[0].stated,
    )


def margin_of(learned: Learned, unit: str = "um") -> float:
    """Return the default of the tolerated degradation in a single cycle or file [unit]."""
    return min(max(TIMES_NOISE * learned.noise, SHARE * learned.largest), MOST_MARGIN.get(unit, np.inf))
