"""The do-no-harm gate: a model is accepted, unproven or refused, by its errors on independent cycles or files.

The thermal cycles or files are unseen by the model and independent, unlike rows. A model is better than a baseline if
its error is smaller on average over them, and if its output agrees with the baseline's error by a one-sided t-test
(`thermocomp.judging.baselines`). It is harmful if it is much worse than no compensation in a single one. For the
reasons see ``docs/decisions/0020-verdict.md`` and ``0048-proof.md``.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import stats

from thermocomp.core.messages import Message, join
from thermocomp.core.provenance import Word, accepted
from thermocomp.judging.baselines import (
    BASELINES,
    CURVE,
    OF_TIME,
    REZEROED,
    SLOW,
    Against,
    OfTime,
    compare_with_time,
    p_above_least,
)
from thermocomp.judging.judgedunits import JudgedUnit
from thermocomp.judging.repeats import group_repeats
from thermocomp.judging.splits import MIN_ROWS

#: minimum number of cycles or files for a significance test
MIN_UNITS = 3
#: smaller p-values are not told apart: the test assumes normal values
LEAST_P = 0.001
#: significance level of the one-sided test
LEVEL = 0.05
#: drifts are of one duty if, slow changes removed, their mean curve leaves less than this share of them, and if the
#: largest is less than this multiple of the smallest
UNLIKE, SIZES = 0.6, 3.0
#: reason against acceptance if the effects of noise and lost sensors were not tested
UNTRIED = Message("the effects of noise and of a lost sensor were not tested: compare with robustness=True")


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
        if self.refusal:
            return self.refusal
        if not self.units:
            return Message("every cycle has fewer than {n} rows of validation data", n=MIN_ROWS)
        if self.stated is None:
            return self._by_units()
        margin = Message("; the harm margin was set to {margin:g} {unit}", margin=self.stated, unit=self.unit)
        return join([self._by_units(), margin])

    def _by_units(self) -> str:
        if any(u.harmful for u in self.units):
            worst = max(self.units, key=lambda u: u.harm - u.margin)
            return Message(
                "does harm in {cycle}: {figures} (margin {margin:.2g} {unit})",
                cycle=worst.name,
                figures=self._figures(worst),
                margin=worst.margin,
                unit=self.unit,
            )
        if self._moving and self._unbeaten:
            return Message("no better than {baseline}: {figures}", **self._pooled(self._unbeaten))
        return self._why_accepted() if self.accepted else self._why_unproven()

    def _why_accepted(self) -> str:
        least = max(self.units, key=lambda u: u.harm)
        duty = Message("; the drift is much the same each time, so other speeds and durations are not proved")
        return Message(
            "better than {baseline} and the other baselines, {tested}; smallest gain in {cycle}: {figures}{duty}",
            baseline=Message(self.worst),
            tested=self._tested(),
            cycle=least.name,
            figures=self._figures(least),
            duty=duty if self.one_duty else "",
        )

    def _why_unproven(self) -> str:
        n, moving = len(self.units), self._moving
        if not moving:
            first = self.units[0]
            return Message(
                "no significant drift in the validation data: {figures} in {cycle}",
                figures=self._figures(first),
                cycle=first.name,
            )
        if self.caps:
            return join(self.caps, "; ")
        if n < MIN_UNITS:
            return Message("judged on only {n} of {of} required cycles or files", n=n, of=MIN_UNITS)
        if moving < MIN_UNITS - 1:
            return Message("only {n} of {of} cycles or files have a significant drift", n=moving, of=n)
        found = Message("not shown to be better than {baseline}: {figures}", **self._pooled(self.worst))
        return found if self.mean_ratios[self.worst] >= 0 else join([found, self._tested()], ", ")

    def _tested(self) -> str:
        least = self.p_value < LEAST_P
        found = Message(
            "p < {p:g} over {n} cycles or files" if least else "p = {p:.2g} over {n} cycles or files",
            p=LEAST_P if least else self.p_value,
            n=len(self.units),
        )
        tried = Message("{n} methods tried", n=self.tried) if self.tried > 1 else ""
        return join([found, *filter(None, (tried, self.about))], ", ")

    @property
    def told(self) -> str:
        """Return the reason, and for an unproven model the test that would decide the verdict."""
        return join([self.reason, self.advice], "; ") if self.advice else self.reason

    @property
    def advice(self) -> str:
        """Thermal test that would decide an unproven verdict; empty for the other verdicts."""
        if self.word != "unproven" or self.caps == (UNTRIED,):  # the reason already gives the advice
            return ""
        if any("one section" in cap for cap in self.caps):
            return Message("judge it by leave-one-cycle-out or leave-one-file-out")
        if self.caps:
            return Message("judge it on recordings without this problem")
        n = MIN_UNITS - len(self.units)
        if n > 0:
            return Message(
                "record {n} more thermal cycles, at other speeds or on other days"
                if n > 1
                else "record {n} more thermal cycle, at other speeds or on other days",
                n=n,
            )
        if self._moving < MIN_UNITS - 1:
            return Message("record cycles with a warm-up or a change of speed")
        return self._more_units()

    def _more_units(self) -> str:
        """Advice if all required cycles or files were judged."""
        if self.worst == CURVE and self.one_duty:
            return Message("the drift is much the same each time: record other speeds and durations")
        if self.worst == SLOW and len({u.series.record for u in self.units if u.series}) < MIN_UNITS:
            return Message(
                "the cycles of a recording share its warm-up and its days: let the machine cool and record again, {n} "
                "starts in all, or run speeds in a random order",
                n=MIN_UNITS,
            )
        more = self._units_for(LEVEL if self.p is None else LEVEL / max(self.tried, 1))
        if more:
            return Message("about {n} cycles or files in all would decide", n=more)
        return Message("many more cycles would be needed")

    def _units_for(self, level: float) -> int | None:
        """Return the number of cycles or files with such errors that would suffice for acceptance; None if over 50."""
        agreements = np.array([a.agreement for a in self.compared[self.worst]])
        effect = agreements.mean() / max(agreements.std(ddof=1), 1e-9)
        for n in range(len(agreements) + 1, 51):
            if stats.t.sf(effect * np.sqrt(n), n - 1) <= level / 2:  # half the level: clearly below
                return n
        return None

    def _figures(self, u: JudgedUnit) -> str:
        largest = u.rms - u.none_rms < u.harm
        return Message(
            "RMS {rms:.2f} {unit}, {none:.2f} {unit} without compensation, largest {largest:.2f} and "
            "{none_largest:.2f} {unit}"
            if largest
            else "RMS {rms:.2f} {unit}, {none:.2f} {unit} without compensation",
            rms=u.rms,
            none=u.none_rms,
            unit=self.unit,
            largest=u.largest,
            none_largest=u.none_largest,
        )

    def _pooled(self, name: str) -> dict[str, str]:
        """Return a baseline, and the RMS over all cycles or files compared with it."""
        mine, other = np.sqrt(np.mean(np.square([(a.rms, a.other) for a in self.compared[name]]), axis=0)).tolist()
        figures = Message(
            "RMS {rms:.2f} {unit} compared with {other:.2f} {unit} over all cycles or files",
            rms=mine,
            other=other,
            unit=self.unit,
        )
        return {"baseline": Message(name), "figures": figures}


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
