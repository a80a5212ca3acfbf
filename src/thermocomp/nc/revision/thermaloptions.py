"""Options of a revision that concern its drift: the models, their inputs, and the initial thermal state."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Literal

from thermocomp.core.exceptions import InputError
from thermocomp.core.model import ErrorModel
from thermocomp.files import modelfile
from thermocomp.nc.revision import forecast as forecasts
from thermocomp.nc.revision import jobstate
from thermocomp.nc.revision.values import Spread, read_value, spread_of
from thermocomp.nc.rewrite.conditions import Assumption, OtherRun
from thermocomp.nc.thermal import start
from thermocomp.nc.thermal.drift import Drift
from thermocomp.nc.thermal.inputs import SPEED, InputSignal, constants
from thermocomp.nc.thermal.start import ThermalStart
from thermocomp.nc.thermal.stations import Station, stations

Zero = Literal["start", "cold", "last"]

#: largest range of a temperature that may be set constant, except the ambient temperature [degC]
WARMED = 3.0
#: a machine that is said to be cold is compared with one after a run at the top trained speed, and a rest [s]
HEATED, RESTED = 1800.0, 600.0

_COUNTED: dict[Zero, str] = {
    "start": "the start of the program",
    "cold": "the cold machine",
    "last": "the zero of the last job",
}


@dataclass(frozen=True, kw_only=True)
class Drifting:
    """Models and inputs of the thermal drift.

    Parameters
    ----------
    model : list of Path
        Model files of thermocomp fit (.json).
    axis : list of str
        Target of a model and the axis that it corrects, such as ch3=Z, or "zz=X at Z 200 mm" if the target was measured
        at one of several positions; models that are not listed are ignored. Default: the axes in the names of the
        targets, such as x_um, z or z_at_200.
    constant : list of str
        Constant values of model inputs that the program does not determine, such as "ambient=22 degC".
    forecast : Path
        CSV file with model inputs that the program does not determine, over the time since the start of the program
        (columns such as time_min, ambient_C).
    accept_unproven : str
        Person who approves the use of unproven models, and the reason: "NAME, REASON".
    """

    model: list[Path]
    axis: list[str] | None = None
    constant: list[str] | None = None
    forecast: Path | None = None
    accept_unproven: str | None = None

    def stations(self) -> list[Station]:
        """Return the models with the axes, and the positions, for which they are valid."""
        models = [m.taken(self.accept_unproven) for path in self.model for m in modelfile.read(path)]
        return stations(models, self.axis or ())

    def others(self, found: Sequence[Station]) -> tuple[dict[str, InputSignal], list[str]]:
        """Return the inputs that do not follow from the program, and notes on them."""
        models = [s.model for s in found]
        if self.constant and all(i.quantity == SPEED for m in models for i in m.inputs):
            raise InputError(
                f"--constant {self.constant[0]!r}: the models are driven by the spindle speed alone; omit it"
            )
        signals = constants(self.constant or (), models)
        for m in models:
            _refuse_heated(m, signals)
        driven = any(i.quantity == SPEED and i.name in m.sensors for m in models for i in m.inputs)
        if not driven and self.forecast is None and any(m.sensors for m in models):
            raise InputError(
                "no model is driven by the spindle speed, and no --forecast gives changing inputs: the effect of this "
                "program on the machine is unknown; fit a model with --inputs spindle_rpm"
            )
        if self.forecast is None:
            return signals, _taken(signals, "held at a constant")
        read = forecasts.read(self.forecast)
        twice = sorted(set(signals) & set(read.columns))
        if twice:
            raise InputError(f"{self.forecast}: {twice[0]} is also given by --constant; remove one")
        wanted = {i.name for m in models for i in m.inputs}
        notes = [f"{self.forecast}: {name} is no input of the models" for name in read.columns if name not in wanted]
        notes += [f"{self.forecast}: {text}" for text in read.left_out]
        notes += _taken(signals, "held at a constant") + _taken(wanted & set(read.columns), "forecast")
        return signals | {n: InputSignal(*column) for n, column in read.columns.items() if n in wanted}, notes

    def hashes(self) -> dict[str, str]:
        """Return the file name and the beginning of its SHA-256 for each target."""
        return {
            m.target: f"{path.name} {sha256(path.read_bytes()).hexdigest()[:8]}"
            for path in self.model
            for m in modelfile.read(path)
        }


def _refuse_heated(model: ErrorModel, constant: Iterable[str]) -> None:
    """Raise `InputError` if a temperature affected by the machine's heat is set constant while a program runs."""
    surroundings = model.validity.ambient_channel if model.validity is not None else ""
    for i in model.inputs:
        if i.name in constant and i.quantity == "temperature" and i.name != surroundings and i.high - i.low > WARMED:
            raise InputError(
                f"--constant {i.name}: it varied by {i.high - i.low:.1f} degC in training and will not stay constant "
                "while this program runs; give it by --forecast, or fit a model without it, such as "
                "--inputs spindle_rpm"
            )


def _taken(names: Iterable[str], how: str) -> list[str]:
    return [f"{name} is {how}: a deviation from that is not part of the bounds" for name in sorted(names)]


@dataclass(frozen=True, kw_only=True)
class Starting:
    """Initial thermal state of the machine when the program starts.

    Parameters
    ----------
    cold : bool
        The machine is cold: it has been at rest for a long time.
    carried : Path
        Thermal state at the end of the last job: the file OUT.job.json that thermocomp revise wrote for it.
    pause : str
        Time since the last job with the spindle stopped, such as "30 min", or with its range "30 min, 20 min to 1 h".
        Default: none.
    measured : list of str
        Measured drift of the tool point relative to the cold machine, such as z=12um.
    zero : str
        Zero of the drift: the moment when the work offsets were set. start: at the start of the program; cold: on the
        cold machine; last: when those of the last job were set. Default: start for --cold, cold for --measured, last
        for --carried; this assumes that the work offsets have not been changed since the machine was cold, or since the
        last job.
    """

    cold: bool = False
    carried: Path | None = None
    pause: str | None = None
    measured: list[str] | None = None
    zero: Zero | None = None

    def check(self) -> None:
        """Raise `InputError` if the state is not given, or given more than once."""
        given = self.cold + (self.carried is not None) + (self.measured is not None)
        if given != 1:
            found = "not stated" if not given else f"stated {given} times"
            raise InputError(
                f"the initial thermal state of the machine is {found}: give one of --cold, --carried JOB.json and "
                "--measured z=12um"
            )
        if self.pause is not None and self.carried is None:
            raise InputError("--pause is the time since the last job: it requires --carried")

    def start(self, found: Sequence[Station], others: Mapping[str, InputSignal]) -> ThermalStart:
        """Return the state of the models at the start of the program."""
        if self.carried is not None:
            return start.carry_over(found, jobstate.read(self.carried).state, self._paused.value)
        if self.measured is not None:
            return start.begin_measured(found, start.deviations(self.measured), others)
        return start.begin_cold(found, others)

    def drift(self, found: Sequence[Station], others: Mapping[str, InputSignal]) -> Drift:
        """Return the drift at the start of the program."""
        return Drift(found, self.start(found, others), others, zero=self._zero)

    def conditions(self, found: Sequence[Station], others: Mapping[str, InputSignal]) -> list[Assumption]:
        """Return what is assumed about the initial state, and the runs from other states."""
        runs = []
        if self.carried is not None:
            left = jobstate.read(self.carried).state
            runs = [(text, left, pause) for text, pause in self._paused.ends]
        speeds = [i.reference + i.high for s in found for i in s.model.inputs if i.quantity == SPEED]
        if self.cold and speeds:
            warm = Drift(found, start.begin_cold(found, others), others, zero="cold")
            warm.advance(HEATED, min(speeds))
            text = f"{RESTED / 60:g} min after {HEATED / 60:g} min at {min(speeds):g}"
            runs = [(text, warm.state(), RESTED)]
        other = [
            OtherRun(text, drift=Drift(found, start.carry_over(found, left, pause), others, zero=self._zero))
            for text, left, pause in runs
        ]
        return [Assumption("start", self.words(), runs=other)] if other else []

    @property
    def _paused(self) -> Spread:
        """Time since the last job [s]."""
        example = "30 min, 20 min to 1 h"
        return spread_of(self.pause or "0 s", lambda t: read_value(t, "time", "--pause", "30 min"), "--pause", example)

    @property
    def _zero(self) -> Zero:
        return self.zero or ("start" if self.cold else "cold" if self.carried is None else "last")

    def words(self) -> str:
        """Return the initial thermal state as text, for the header."""
        if self.carried is not None:
            name = self.carried.name
            return f"{self._paused.text} after {name}" if self.pause else f"state of {name}"
        return f"measured {', '.join(self.measured)}" if self.measured else "cold"

    def counted(self) -> str:
        """Return the zero of the drift as text."""
        return _COUNTED[self._zero]
