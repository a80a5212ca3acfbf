"""Explanation of a frozen model in plain words and numbers: its terms, its accuracy, and the effect of a failure."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import combinations
from typing import Any

from thermocomp.core.bounds import GAP
from thermocomp.core.contributions import gains
from thermocomp.core.heatcheck import SpeedFault
from thermocomp.core.model import ErrorModel
from thermocomp.core.paceddynamic import PacedDynamic
from thermocomp.core.thresholds import Threshold
from thermocomp.core.watch import Watched

#: a spare sensor is recommended if a larger drift of a sensor may stay undetected [degC]
FAR = 3.0
#: a spare sensor is recommended above this ratio of the error with the substitute value to that with all sensors
DEAR = 2.0
#: arbitrary time constant or time step; settled values do not depend on it [s]
_ANY = 60.0


@dataclass(frozen=True)
class SensorExplanation:
    """An input of a model: its effect, the detection of its failure, and the response to a failure.

    Parameters
    ----------
    low, high : float
        Training range, relative to the reference of the input if it has a separate one [unit].
    settled : float or None
        Steady-state gain: per degree, or for a spindle speed at the highest trained speed [unit of the model]; None:
        unknown for this family.
    bound : float or None
        Largest possible contribution at any reading [unit of the model].
    watched : bool
        The input is predicted from the others and the spindle speed; a failure is detected by the difference, and the
        prediction replaces the reading.
    jump, off, moved : float or None
        Limits of the change within `pace`, of the difference from the prediction, and of the change of the prediction
        while the reading is constant [degC].
    pace : float or None
        [s]
    still : float or None
        Longest constant reading while another input changes [s]; None: time alone is not a criterion.
    unseen : float or None
        Cross-validation error (RMS) of the prediction, on left-out cycles [degC].
    undetected : float or None
        Effect of an undetected drift up to `off` on the output of the model, once settled [unit of the model].
    lost : float or None
        RMS error on unseen cycles without the input [unit of the model]; None: never judged.
    runs_on : bool
        The correction continues with the predicted value; otherwise it is held, then fades.
    spare : str
        Reason why a spare sensor is recommended; empty if none is.
    faults : tuple of SpeedFault
        How soon wrong values of a supervised speed are found.
    """

    name: str
    quantity: str
    unit: str
    low: float
    high: float
    settled: float | None
    bound: float | None
    watched: bool
    jump: float | None
    off: float | None
    moved: float | None
    pace: float | None
    still: float | None
    unseen: float | None
    undetected: float | None
    lost: float | None
    runs_on: bool
    spare: str
    faults: tuple[SpeedFault, ...] = ()


@dataclass(frozen=True)
class Explanation:
    """Explanation of a model; `print` shows it as text.

    Parameters
    ----------
    remembers : bool
        The output depends on earlier readings.
    sensors : tuple of SensorExplanation
        Inputs that affect the output, by descending bound where it is known.
    zero : str
        Reference of its inputs.
    word, reason : str
        Verdict of the do-no-harm gate, and the reason for it.
    rms, max_abs, none_rms : float or None
        Errors on unseen cycles; `none_rms` without compensation [unit]; None: never judged.
    cycles : dict of str to float
        RMS error per unseen cycle [unit].
    band : str
        Band as text; empty without one.
    outside : str
        Behaviour outside its training range.
    covered : str
        Conditions covered by the judged cycles; empty if unknown.
    judged_pairs : bool
        Whether the errors with two sensors lost were judged; otherwise they are predicted.
    pairs : tuple of int
        Number of sensor pairs whose simultaneous failure was tested, or with none tested of all pairs of temperatures,
        and number of these for which the correction continues.
    thresholds : tuple of Threshold
        Fixed numbers by which the compensator decides.
    tests : tuple of str
        Header data of the training recordings, as stated: machine, serial, place, date, operator, instrument.
    """

    target: str
    unit: str
    method: str
    family: str
    remembers: bool
    sensors: tuple[SensorExplanation, ...]
    zero: str
    word: str
    reason: str
    rms: float | None
    max_abs: float | None
    none_rms: float | None
    cycles: dict[str, float]
    band: str
    outside: str
    covered: str
    judged_pairs: bool
    pairs: tuple[int, int]
    thresholds: tuple[Threshold, ...]
    tests: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return the explanation as plain numbers and text."""
        return asdict(self)

    def __str__(self) -> str:
        return "\n".join(_lines(self))


@dataclass(frozen=True)
class Explanations:
    """Explanations of the models of several targets; `print` shows them as text."""

    models: tuple[Explanation, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return the explanations as plain numbers and text."""
        return asdict(self)

    def __str__(self) -> str:
        return "\n\n".join(map(str, self.models))


def explain(model: ErrorModel) -> Explanation:
    """Return the explanation of a model.

    Examples
    --------
    >>> from thermocomp import Polynomial, explain
    >>> from thermocomp.core.inputs import Input
    >>> from thermocomp.core.terms import Variable
    >>> front = Input("t_front_C", "temperature", "degC", reference=20.0, rezero=True, low=0.0, high=15.0)
    >>> told = explain(
    ...     Polynomial(
    ...         target="z_um",
    ...         unit="um",
    ...         inputs=(front,),
    ...         variables=(Variable.single("t_front_C", 0),),
    ...         terms=((0,),),
    ...         coefficients=(2.5,),
    ...     )
    ... )
    >>> [s.name for s in told.sensors], len(told.sensors), told.word
    (['t_front_C'], 1, 'unjudged')
    """
    known = {g.name: g for g in gains(model, _ANY)} if isinstance(model, PacedDynamic) else {}
    order = list(known) if known else [i.name for i in model.inputs]
    found = model.honest_error
    # sensors of other models of the same method, fitted without a cycle, are among those lost, too
    judged = [pair for k in found.lost if len(pair := k.split(", ")) == 2] if found else []
    heat = [i.name for i in model.inputs if model.watch and i.name in model.watch.names and i.name in model.sensors]
    pairs = judged or [list(pair) for pair in combinations(heat, 2)]
    return Explanation(
        target=model.target,
        unit=model.unit,
        method=model.provenance.method if model.provenance else "",
        family=model.family,
        remembers=model.remembers,
        sensors=tuple(
            _sensor(model, name, *((known[name].settled, known[name].bound) if name in known else (None, None)))
            for name in order
            if name in model.sensors
        ),
        zero=_zero(model),
        word=found.word if found else "unjudged",
        reason=found.why if found else "never judged on unseen cycles; the model will not run",
        rms=found.rms if found else None,
        max_abs=found.max_abs if found else None,
        none_rms=found.none_rms if found else None,
        cycles=dict(found.cycles) if found else {},
        band=model.band.tell(model.unit) if model.band else "",
        outside=_outside(model),
        covered=_covered(model),
        judged_pairs=bool(judged),
        pairs=(len(pairs), sum(model.may_lose(pair) for pair in pairs)),
        thresholds=model.thresholds.rows,
        tests=model.provenance.headers if model.provenance else (),
    )


def explain_all(models: Sequence[ErrorModel]) -> Explanations:
    """Return the explanations of the models of several targets."""
    return Explanations(tuple(map(explain, models)))


def _spare(model: ErrorModel, name: str, seen: Watched | None) -> str:
    """Return the reason why a spare sensor for a temperature is recommended; empty if none is."""
    if seen is None:
        return "no other sensor predicts it"
    if not model.may_lose([name]):
        return "without it the correction is held, then fades"
    if model.widening([name]) > DEAR:
        return f"with its substitute value the error is {model.widening([name]):.1f} times as large"
    return f"its slow drift is detected only from {seen.off:.1f} degC on" if seen.off > FAR else ""


def _sensor(model: ErrorModel, name: str, settled: float | None, bound: float | None) -> SensorExplanation:
    own = next(i for i in model.inputs if i.name == name)
    watch, found = model.watch, model.honest_error
    seen = watch.sensors[watch.names.index(name)] if watch is not None and name in watch.names else None
    return SensorExplanation(
        name=name,
        quantity=own.quantity,
        unit=own.unit,
        low=own.low,
        high=own.high,
        settled=settled,
        bound=bound,
        watched=watch is not None and name in watch.failing,
        jump=seen.jump if seen else None,
        off=seen.off if seen else None,
        moved=seen.moved if seen else None,
        pace=watch.pace if watch and seen else None,
        still=seen.still if seen and seen.still < GAP else None,
        unseen=seen.unseen if seen else None,
        undetected=abs(settled) * seen.off if seen and settled is not None else None,
        lost=found.lost.get(name) if found else None,
        runs_on=watch is not None and name in watch.failing and model.may_lose([name]),
        spare=_spare(model, name, seen) if own.quantity == "temperature" else "",
        faults=tuple(f for f in watch.speed_faults if watch.inputs[f.input].name == name) if watch else (),
    )


def _zero(model: ErrorModel) -> str:
    own = [i for i in model.inputs if i.rezero]
    if not own:
        return "none, all inputs are absolute"
    zeroing = model.zeroing
    if not zeroing.at_rest:
        return "the first reading after a start"
    what = "temperatures" if all(i.quantity == "temperature" for i in own) else ", ".join(i.name for i in own)
    turning = f" ({_span(zeroing.otherwise)} if it turns)" if zeroing.speed else ""
    rest = " while the spindle is stopped" if zeroing.speed else ""
    return f"{what} are relative to their mean over the first {_span(zeroing.at_rest)} after a start{rest}{turning}"


def _outside(model: ErrorModel) -> str:
    support = model.support
    kept = f"inputs are clipped to their trained range, widened by {100 * support.margin:.0f} %"
    if support.policy == "clip":
        return kept
    more = {"hold": "the last output from inside the range is held", "fade": "the output fades to zero"}[support.policy]
    together = ", also where the combination of inputs is unlike the training data" if model.joint else ""
    return f"{kept}, and {more}{together}"


def _covered(model: ErrorModel) -> str:
    v = model.validity
    if v is None:
        return ""
    parts = [f"{v.hours:.1f} h, {v.units} cycles or tests, {v.independent} of them distinct"]
    if v.speeds:
        parts.append(f"{len(v.speeds)} spindle speeds from {v.speeds[0]:.0f} to {v.speeds[-1]:.0f} 1/min")
    parts.append({"moved": "axes moved"}.get(v.axes, f"axes {v.axes}: their heat was not judged"))
    if v.ambient:
        parts.append(f"{v.ambient_channel} {v.ambient[0]:.1f} to {v.ambient[1]:.1f} degC")
    if v.start:
        parts.append(f"started at {v.start[0]:.1f} to {v.start[1]:.1f} degC")
    return "; ".join(parts)


def _lines(e: Explanation) -> list[str]:
    heat = [s for s in e.sensors if s.quantity == "temperature"]
    other = [s.name for s in e.sensors if s.quantity != "temperature"]
    past = "present and past values" if e.remembers else "present values only"
    what = [f"{len(heat)} temperature{'s' if len(heat) > 1 else ''}"] if heat else []
    lines = [
        f"{e.target} [{e.unit}]: predicted by {e.method or e.family} from "
        f"{' and '.join([*what, *other]) or 'nothing'}; {past}.",
    ]
    lines += [f"Recorded with: {test}." for test in e.tests]
    if any(s.bound is not None for s in e.sensors):
        each = ", ".join(f"{s.name} {s.bound:.1f}" for s in e.sensors if s.bound is not None)
        lines.append(f"Largest contribution of each input [{e.unit}]: {each}.")
    lines.append(f"Zero (reference): {e.zero}.")
    if e.rms is not None and e.none_rms is not None:
        lines.append(
            f"Honest error (on unseen cycles): {e.rms:.2f} {e.unit} RMS, largest {e.max_abs:.2f}; without compensation "
            f"{e.none_rms:.2f} RMS."
        )
    lines.append(f"Verdict: {e.word}, {e.reason}.")
    lines.append(f"Uncertainty band: {e.band or 'none'}.")
    lines.append(f"Judged conditions: {e.covered or 'not known'}.")
    lines.append(f"Outside the trained range: {e.outside}.")
    watched = [s for s in e.sensors if s.watched]
    if watched:
        lasting = next(t.value for t in e.thresholds if t.name == "fault_duration")
        lines.append(
            "A missing temperature is detected immediately; one that has jumped, drifted or is stuck is detected "
            f"{_span(lasting)} after it exceeds its limit. It is replaced by its prediction from the other "
            "temperatures and the spindle speed, and a wrong speed by the one that explains the temperatures. Limits "
            "and errors:"
        )
    else:
        lines.append(
            "Sensors are not monitored: a reading with a missing value is rejected; a wrong value is not detected. "
            "Errors:"
        )
    lines += [f"  {_sensor_line(s, e.unit)}" for s in e.sensors]
    if e.pairs[0]:
        lines.append(
            f"Two sensors lost at once: {'judged' if e.judged_pairs else 'predicted from the errors above'} for "
            f"{e.pairs[0]} pairs; the model continues without {e.pairs[1]} of them."
        )
    return lines


def _sensor_line(s: SensorExplanation, unit: str) -> str:
    if s.quantity != "temperature" and not s.watched:
        left = f" ({s.lost:.2f} {unit} if it read zero)" if s.lost is not None else ""
        return f"{s.name}: not monitored; without it the correction is held, then fades{left}"
    lost = f"error {s.lost:.2f} {unit} without it" if s.lost is not None else "never judged without it"
    parts = []
    if s.watched and s.off is not None and s.jump is not None and s.moved is not None and s.pace is not None:
        shift = f" (a drift up to this limit shifts the output by {s.undetected:.2f} {unit})" if s.undetected else ""
        still = f" or for {_span(s.still)}" if s.still is not None else ""
        parts.append(
            f"jump by more than {s.jump:.1f} degC in {_span(s.pace)}; drift by {s.off:.1f} degC{shift}; stuck while "
            f"its prediction changes by {s.moved:.1f} degC{still}"
        )
    parts += [_fault_text(f) for f in s.faults]
    if s.faults:
        parts.append("then the correction is held, and fades; while it is missing, another speed replaces it")
    parts.append(lost if s.runs_on else f"{lost}; the correction is held, then fades")
    return f"{s.name}: {'; '.join(parts)}{f'; spare recommended: {s.spare}' if s.spare else ''}"


#: faults of a speed as text
_SPEED_FAULTS = {"zero": "reads 0", "stuck": "stuck", "halved": "reads half", "beyond": "stuck far too high"}


def _fault_text(fault: SpeedFault) -> str:
    """Return how soon a fault of a speed is found, as text."""
    if not fault.found:
        return f"{_SPEED_FAULTS[fault.fault]}: not found"
    cases = "" if fault.found > 0.995 else f" in {100 * fault.found:.0f} % of cases"
    return f"{_SPEED_FAULTS[fault.fault]}: found within {fault.minutes:.0f} min of running{cases}"


def _span(seconds: float) -> str:
    """Return a duration as text."""
    if seconds < 60.0 or not math.isfinite(seconds):
        return f"{seconds:g} s"
    return f"{seconds / 60:g} min" if seconds < 7200.0 else f"{seconds / 3600:g} h"
