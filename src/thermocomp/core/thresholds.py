"""`Thresholds`: fixed numbers by which the compensator decides, each with unit, reason and source; part of every model.

A model is judged with these numbers, so it keeps them: they are stored in its file, and a later version of this package
that uses other numbers for new models still runs the model with its own.
"""

from dataclasses import dataclass, field, fields
from functools import cached_property

from thermocomp.core.bounds import GAP, LEAST, RANGE, check_between, check_finite
from thermocomp.core.exceptions import SettingError


@dataclass(frozen=True)
class Threshold:
    """A threshold with its unit, the reason for its value, and the source of the value."""

    name: str
    value: float
    unit: str
    reason: str
    source: str


def _fixed(value: float, unit: str, reason: str, source: str) -> float:
    found: float = field(default=value, metadata={"unit": unit, "reason": reason, "source": source})
    return found


_START, _WATCH, _PROBING, _OWN = "decision 0021", "decision 0030", "decision 0031", "choice of this project"
_FEED = "decision 0046"
_HEAT = "decision 0047"


@dataclass(frozen=True, kw_only=True)
class Thresholds:
    """Fixed numbers of gate, watch, adaptation and restart; `rows` returns them with unit, reason and source.

    Raises
    ------
    SettingError
        A number is not finite or not positive, or two numbers contradict each other.
    """

    # plausible readings
    least_temperature: float = _fixed(-40.0, "degC", "colder readings indicate a broken sensor", _OWN)
    most_temperature: float = _fixed(150.0, "degC", "warmer readings indicate a broken sensor", _OWN)
    most_speed: float = _fixed(500_000.0, "1/min", "no spindle turns faster", _OWN)
    most_position: float = _fixed(100_000.0, "mm", "no axis is longer", _OWN)
    zero_change: float = _fixed(
        15.0, "degC", "a zero that differs more from that of the training belongs to no known day", _START
    )
    start_offset: float = _fixed(
        42.0,
        "degC",
        "a temperature that is further off the others at the start is in another unit, as degF",
        _START,
    )
    start_reported: float = _fixed(
        0.8, "degC", "a temperature that is off the others at the start by more is reported", _START
    )
    least_margin: float = _fixed(
        10.0, "degC", "margin outside the trained range of a temperature, if that range is smaller", _START
    )
    margin: float = _fixed(
        10.0, "range widths", "margin outside the trained range of a quantity without physical bounds", _START
    )
    clock_skew: float = _fixed(1.0, "s", "clocks of a source and of the controller differ by this much", _OWN)
    stopped_speed: float = _fixed(10.0, "1/min", "a tachometer may show a few revolutions at rest", _START)

    # watch (sensor monitoring)
    check_interval: float = _fixed(10.0, "s", "temperatures change slowly; sensors are checked this often", _WATCH)
    fault_duration: float = _fixed(300.0, "s", "a shorter jump or difference does not count as a failure", _WATCH)
    return_time: float = _fixed(
        600.0, "s", "a missing sensor must agree with its prediction for this time before it is trusted again", _WATCH
    )
    substitute_fade: float = _fixed(
        3600.0, "s", "time constant with which a substitute moves to the prediction, without a jump", _WATCH
    )
    fault_rest: float = _fixed(
        3600.0, "s", "effect of a failure on the predictions of other sensors, and of an untrained speed", _WATCH
    )
    heat_factor: float = _fixed(2.0, "", "a speed beyond this multiple of the top speed adds no heat", _WATCH)
    fast_factor: float = _fixed(1.02, "", "differences are not evaluated beyond this multiple of the top speed", _WATCH)
    unknown_step: float = _fixed(
        1.0, "degC", "a temperature that has not changed yet may be from a sensor of this resolution", _WATCH
    )
    same_moved: float = _fixed(
        2.0, "resolutions", "rounding hides a change of up to one, and shifts a prediction by as much", _WATCH
    )
    least_unseen: float = _fixed(0.05, "degC", "least error by which differences are weighted", _WATCH)
    difference_time: float = _fixed(1800.0, "s", "time constant of the usual difference from the prediction", _WATCH)
    swap_evidence: float = _fixed(
        0.1, "", "a swap of two sensors is excluded once it has increased the mean square residual by this", _WATCH
    )

    least_share: float = _fixed(
        0.02,
        "",
        "a spindle that turns slower than this share of its top speed counts as stopped, also one in 1/s",
        _HEAT,
    )
    more_heat: float = _fixed(
        0.4, "", "cutting heats the spindle up to 30 % more than turning in air; the speed is not wrong then", _HEAT
    )
    more_stored: float = _fixed(0.25, "", "the same for heat that is left in the spindle", _HEAT)
    heat_stored: float = _fixed(1800.0, "s", "time constant with which heat of cutting leaves the spindle", _HEAT)
    less_heat: float = _fixed(
        0.1, "", "axes that move warm the bearings of the spindle, whose friction then falls by up to this share", _HEAT
    )
    untrained_heat: float = _fixed(
        0.5, "", "share of the heat above that at the trained top speed by which the estimate may be wrong", _HEAT
    )
    speed_doubt: float = _fixed(
        1800.0, "s", "while a speed is in doubt for less than this, no temperature is excluded in its place", _HEAT
    )
    speed_preferred: float = _fixed(
        4.0,
        "",
        "a wrong speed is more likely than a failed temperature unless its squares are this many times as large",
        _HEAT,
    )
    swap_preferred: float = _fixed(
        2.0, "", "a swap must leave residuals whose squares are this many times smaller than one failure does", _WATCH
    )
    swap_certain: float = _fixed(
        6.0,
        "",
        "the same for a swap to be certain: heat near two sensors that was not recorded may resemble one",
        _WATCH,
    )
    agree_moved: float = _fixed(
        2.0, "", "agreement counts only where a temperature should have changed by this multiple of its limit", _WATCH
    )
    speed_return: float = _fixed(
        28_800.0,
        "s",
        "a wrong speed that has agreed for this time is trusted again: the models have forgotten it",
        _HEAT,
    )

    # repetition of all temperatures
    repeat_factor: float = _fixed(
        15.0, "intervals", "temperatures that repeat for this many usual intervals are not measured any more", _FEED
    )
    repeat_margin: float = _fixed(
        3.0,
        "",
        "repetition is counted only if that is this many times the longest one on a sound machine",
        _FEED,
    )
    repeat_wait: float = _fixed(3.0, "intervals", "between two updates of a source only predictions move", _FEED)
    repeat_changes: float = _fixed(20.0, "changes", "number of changes after which an interval is usual", _FEED)
    repeat_memory: float = _fixed(100.0, "changes", "number of changes over which the interval is averaged", _FEED)
    repeat_moved: float = _fixed(3.0, "resolutions", "change of a prediction that a temperature must show", _FEED)

    # adaptation by probings
    offset_decay: float = _fixed(4 * 3600.0, "s", "an offset represents the present state of the machine", _PROBING)
    direction_decay: float = _fixed(
        7 * 86400.0, "s", "the weights of the averaged regressions represent what the training left open", _PROBING
    )
    unexplained: float = _fixed(
        0.2, "", "share of the error on left-out cycles that neither offset nor directions explain", _PROBING
    )
    suspect: float = _fixed(
        2.5, "standard deviations", "beyond this a probing counts less (Hampel's function)", _PROBING
    )
    suspect_first: float = _fixed(
        2.0, "standard deviations", "the same for the first probing within `offset_decay`", _PROBING
    )
    implausible: float = _fixed(3.0, "standard deviations", "beyond this a probing is refused", _PROBING)
    least_usual: float = _fixed(
        0.5, "", "least typical error as a share of the overall RMS: most cycles have smaller errors", _PROBING
    )
    probings_averaged: float = _fixed(
        5.0, "probings", "number over which the size of the present day's errors is averaged", _PROBING
    )
    agreement: float = _fixed(
        5.0, "standard deviations", "two probings that differ by no more may be wrong in the same way", _PROBING
    )
    probing_interval: float = _fixed(
        600.0, "s", "probings closer in time, with the same error, count once: it may be the same chip", _PROBING
    )
    confirmed: float = _fixed(3.0, "", "not used any more; model files of earlier versions contain it", _PROBING)
    most_error: float = _fixed(
        5.0, "", "largest error of a model as a multiple of that on left-out cycles (RMS): three bands", _PROBING
    )
    most_probing: float = _fixed(
        10.0, "um", "largest error of a model; a wrong probing is usually further off", _PROBING
    )
    most_usual: float = _fixed(2.0, "", "but at least this multiple of that on left-out cycles (RMS)", _PROBING)
    most_moved: float = _fixed(
        1.645, "", "largest change by probings as a multiple of that on left-out cycles (RMS): a band of 90 %", _PROBING
    )
    most_drift: float = _fixed(3.0, "", "largest error of a model as a multiple of the drift (RMS)", _PROBING)
    least_error: float = _fixed(1e-3, "um", "least error that is assumed", _OWN)

    # restart
    caught_up: float = _fixed(
        0.1, "um", "after a restart a correction is active once it is this close to its models", _OWN
    )
    resumable: float = _fixed(
        24 * 3600.0,
        "s",
        "of an older state only the corrections in force are kept; probings are remembered",
        _OWN,
    )

    def __post_init__(self) -> None:
        numbers = {f.name: getattr(self, f.name) for f in fields(self)}
        check_finite("thresholds", RANGE, least_temperature=numbers.pop("least_temperature"))
        check_between("thresholds", LEAST, GAP, **numbers)
        if not self.least_temperature < self.most_temperature:
            raise SettingError(
                f"thresholds: least_temperature = {self.least_temperature:g} degC must be below most_temperature = "
                f"{self.most_temperature:g} degC"
            )
        if not 1.0 <= self.repeat_changes <= self.repeat_memory:
            raise SettingError(
                f"thresholds: repeat_changes = {self.repeat_changes:g} must be from 1 to repeat_memory = "
                f"{self.repeat_memory:g}"
            )
        if not max(self.suspect, self.suspect_first) < self.implausible:
            raise SettingError(
                f"thresholds: suspect = {self.suspect:g} and suspect_first = {self.suspect_first:g} must be below "
                f"implausible = {self.implausible:g}"
            )

    @property
    def rows(self) -> tuple[Threshold, ...]:
        """Thresholds with unit, reason and source."""
        return tuple(Threshold(f.name, getattr(self, f.name), **f.metadata) for f in fields(self))

    @cached_property
    def plausible(self) -> dict[str, tuple[float, float]]:
        """Possible values of each quantity; a value outside indicates a sensor failure."""
        return {
            "temperature": (self.least_temperature, self.most_temperature),
            "spindle_speed": (-self.most_speed, self.most_speed),
            "position": (-self.most_position, self.most_position),
        }


#: those of new models
THRESHOLDS = Thresholds()
