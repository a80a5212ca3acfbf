"""`Watch`: sensor monitoring by predicting each temperature from the others and the spindle speed."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.bounds import (
    DEGREE,
    ENTRIES,
    GAP,
    INPUTS,
    LEAST,
    RANGE,
    READING,
    check_between,
    check_count,
    check_finite,
)
from thermocomp.core.exceptions import SettingError
from thermocomp.core.heatcheck import HeatCheck, HeatConstants, SpeedFault
from thermocomp.core.inputs import Input
from thermocomp.core.pacedbank import Bank
from thermocomp.core.thresholds import THRESHOLDS, Thresholds
from thermocomp.core.zero import FIRST_READING, Zeroing

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]


@dataclass(frozen=True)
class Watched:
    """A temperature with its prediction from the others, and the limits for rejecting its readings.

    Parameters
    ----------
    input : int
        Index into the inputs of the watch.
    weights : tuple of float
        Readout coefficients of the temperatures, of their lags, lag by lag, and of the speed states [degC/degC; degC];
        0 for the temperature itself.
    off : float
        Difference from the prediction above which the sensor counts as faulty [degC].
    jump : float
        Change within `Watch.pace` above which the reading has jumped [degC].
    moved : float
        Change of the prediction, with a constant reading, above which the sensor is stuck [degC].
    still : float
        Longest constant reading while another one changes, above which the sensor is stuck; `GAP`: no time limit [s].
    unseen : float
        Cross-validation error (RMS) of the prediction, on left-out cycles [degC].
    frozen : float
        Change of the prediction, while all temperatures repeat, above which the source has stopped; 0: not known, as in
        a file of an earlier version: `moved` instead [degC].
    step : float
        Typical smallest change in the recordings: resolution, or noise; 0: not known, as in a file of an earlier
        version: half of `moved` is taken for twice this [degC].
    """

    input: int
    weights: tuple[float, ...]
    off: float
    jump: float
    moved: float
    still: float
    unseen: float
    frozen: float = 0.0
    step: float = 0.0


@dataclass(frozen=True)
class Watch:
    """Predictions of temperatures from each other and from spindle speed states, with limits; see `PacedDynamic`.

    Parameters
    ----------
    inputs : tuple of Input
        Temperatures and speeds, in this order.
    zeroing : Zeroing
        Averaging time of their zero.
    time_constants : tuple of float
        Time constants of the lags, the same for all temperatures [s].
    top_speed : float
        [1/min]
    states : tuple of (int, float, float, float)
        States of the speed: input, power, time constants at rest and at top speed [s].
    sensors : tuple of Watched
        One per temperature, in the order of the inputs.
    pace : float
        Time within which a change counts as a jump [s].
    checks : tuple of HeatCheck
        Supervision of the speeds; the last check of a speed determines its substitute. A speed without one is trusted.
    speed_faults : tuple of SpeedFault
        How soon the faults of each supervised speed are found.
    thresholds : Thresholds
        Those of the models that the watch belongs to.
    repeats : float
        Longest repetition of all temperatures in the recordings, in mean intervals between changes.

    Raises
    ------
    SettingError
        A number is out of range, or the parts are inconsistent.
    """

    inputs: tuple[Input, ...]
    zeroing: Zeroing = FIRST_READING
    time_constants: tuple[float, ...] = ()
    top_speed: float = 1.0
    states: tuple[tuple[int, float, float, float], ...] = ()
    sensors: tuple[Watched, ...] = ()
    pace: float = 60.0
    checks: tuple[HeatCheck, ...] = ()
    speed_faults: tuple[SpeedFault, ...] = ()
    thresholds: Thresholds = THRESHOLDS
    repeats: float = 1.0

    def __post_init__(self) -> None:
        check_count("watch", INPUTS, inputs=self.inputs)
        names = [i.name for i in self.inputs]
        if len(set(names)) != len(names):
            raise SettingError(f"watch: an input is named twice in {names}")
        heat = [k for k, i in enumerate(self.inputs) if i.quantity == "temperature"]
        if [s.input for s in self.sensors] != heat:
            raise SettingError(
                f"watch: sensors of inputs {[s.input for s in self.sensors]}: expected one per temperature, {heat}"
            )
        for k, s in enumerate(self.states):
            if not 0 <= s[0] < len(names) or self.inputs[s[0]].quantity != "spindle_speed":
                raise SettingError(f"watch: speed state {k}: input {s[0]} is not a spindle speed")
        parts = len(heat) * (1 + len(self.time_constants)) + len(self.states)
        for sensor in self.sensors:
            if len(sensor.weights) != parts:
                raise SettingError(
                    f"watch: sensor {names[sensor.input]} has {len(sensor.weights)} weights; expected {parts}: one for "
                    "each temperature, each of its lags and each speed state"
                )
        lagged = len(heat) * (1 + len(self.time_constants))
        for k, sensor in enumerate(self.sensors):
            if any(sensor.weights[k : lagged : len(heat)]):
                raise SettingError(f"watch: {names[sensor.input]} must not be predicted from itself")
        check_count("watch", ENTRIES, weights=[w for s in self.sensors for w in s.weights])
        check_finite("watch", weights=[w for s in self.sensors for w in s.weights])
        slow, fast = [s[2] for s in self.states], [s[3] for s in self.states]
        check_between(
            "watch", LEAST, GAP, time_constants=self.time_constants, stopped=slow, running=fast, pace=self.pace
        )
        check_between("watch", LEAST, DEGREE, power=[s[1] for s in self.states])
        check_between("watch", LEAST, RANGE, top_speed=self.top_speed)
        for name in ("off", "jump", "moved"):
            check_between("watch", LEAST, READING, **{name: [getattr(s, name) for s in self.sensors]})
        for name in ("unseen", "frozen", "step"):
            check_between("watch", 0.0, READING, **{name: [getattr(s, name) for s in self.sensors]})
        check_between("watch", 1.0, READING, repeats=self.repeats)
        check_between("watch", LEAST, GAP, still=[s.still for s in self.sensors])
        self._check_speeds(lagged)

    def _check_speeds(self, lagged: int) -> None:
        """Raise `SettingError` unless the checks of the speeds fit the inputs and are within their bounds."""
        check_count("watch", INPUTS, checks=self.checks, speed_faults=self.speed_faults)
        for k in (*(c.input for c in self.checks), *(f.input for f in self.speed_faults)):
            if not 0 <= k < len(self.inputs) or self.inputs[k].quantity != "spindle_speed":
                raise SettingError(f"watch: check of input {k}: it is not a spindle speed")
        for c in self.checks:
            if len(c.weights) != lagged:
                raise SettingError(
                    f"watch: check of {self.inputs[c.input].name} has {len(c.weights)} weights; expected {lagged}: one "
                    "for each temperature and each of its lags"
                )
            check_finite("watch", weights=c.weights)
        check_between("watch", LEAST, DEGREE, power=[c.power for c in self.checks])
        check_between("watch", LEAST, GAP, lag=[c.lag for c in self.checks])
        for name in ("off", "unseen"):
            check_between("watch", LEAST, READING, **{name: [getattr(c, name) for c in self.checks]})
        check_between("watch", 0.0, 1.0, found=[f.found for f in self.speed_faults])
        check_between("watch", 0.0, GAP, minutes=[f.minutes for f in self.speed_faults])

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the monitored temperatures."""
        return tuple(self.inputs[s.input].name for s in self.sensors)

    @cached_property
    def supervised(self) -> IntArray:
        """Indices of the inputs that can fail: the temperatures, then the supervised speeds."""
        return np.append(self.bank.temperatures, self.speeds[self.deciding >= 0])

    @cached_property
    def failing(self) -> tuple[str, ...]:
        """Names of the inputs that can fail: the temperatures, then the supervised speeds."""
        return tuple(self.inputs[k].name for k in self.supervised)

    @cached_property
    def bank(self) -> Bank:
        """Lags and speed states from which temperatures are predicted."""
        stopped = [1 / slow for _, _, slow, _ in self.states]
        lags = [1 / tau for tau in self.time_constants for _ in self.sensors]
        return Bank(
            temperatures=np.array([s.input for s in self.sensors], dtype=np.intp),
            taus=len(self.time_constants),
            speeds=np.array([s[0] for s in self.states], dtype=np.intp),
            powers=np.array([s[1] for s in self.states], dtype=np.float64),
            rates=np.array(lags + stopped, dtype=np.float64),
            gain=np.array([1 / s[3] - k for s, k in zip(self.states, stopped, strict=True)], dtype=np.float64),
            top=self.top_speed,
        )

    @cached_property
    def read_out(self) -> tuple[FloatArray, FloatArray]:
        """Readout coefficients: of temperatures, (n_sensors, n_sensors), and of states, (n_memory, n_sensors)."""
        table = np.array([s.weights for s in self.sensors], dtype=np.float64).reshape(len(self.sensors), -1).T
        return table[: len(self.sensors)], table[len(self.sensors) :]

    @cached_property
    def heat_read_out(self) -> tuple[FloatArray, FloatArray]:
        """Readout coefficients of the heats: of temperatures, and of their lags, (..., n_checks) each."""
        n = len(self.sensors)
        table = np.array([c.weights for c in self.checks], dtype=np.float64)
        table = table.reshape(len(self.checks), n * (1 + len(self.time_constants))).T
        return table[:n], table[n:]

    @cached_property
    def heat_reach(self) -> FloatArray:
        """Error of each estimate of a heat if a substitute is wrong by its limit, (n_sensors, n_checks)."""
        direct, lagged = self.heat_read_out
        settled = direct + lagged.reshape(len(self.time_constants), *direct.shape).sum(axis=0)
        return np.asarray(np.maximum(np.abs(direct), np.abs(settled)) * self.limits("off")[:, None])

    @cached_property
    def heat_constants(self) -> HeatConstants:
        """Numbers of the checks."""
        return HeatConstants.of(self.checks, self.speeds.tolist())

    @cached_property
    def deciding(self) -> IntArray:
        """Check that determines the substitute of each speed, (n_speeds,); -1: the speed is not supervised."""
        of = [c.input for c in self.checks]
        return np.array([max((k for k, i in enumerate(of) if i == s), default=-1) for s in self.speeds], dtype=np.intp)

    @cached_property
    def state_speeds(self) -> IntArray:
        """Index of the speed among the speeds, of each speed state, (n_states,)."""
        return np.searchsorted(self.speeds, self.bank.speeds)

    @cached_property
    def signatures(self) -> FloatArray:
        """Effect of one degree in each sensor on all residuals, immediate and steady-state.

        Returns
        -------
        ndarray of shape (2, n_sensors + n_checks, n_sensors)
            Residuals of the temperatures, then of the heats, by row; the sensor by column.
        """
        n, lags = len(self.sensors), len(self.sensors) * len(self.time_constants)
        direct = np.hstack([self.read_out[0], self.heat_read_out[0]])
        lagged = np.hstack([self.read_out[1][:lags], self.heat_read_out[1]])
        lagged = lagged.reshape(len(self.time_constants), n, n + len(self.checks))
        immediate = np.eye(n + len(self.checks), n) - direct.T
        return np.stack([immediate, immediate - lagged.sum(axis=0).T])

    @cached_property
    def pairs(self) -> tuple[IntArray, IntArray]:
        """Indices of the sensors of all possible pairs."""
        first, second = np.triu_indices(len(self.sensors), 1)
        return first, second

    def limits(self, what: str) -> FloatArray:
        """Return one field of `Watched` for each sensor, (n_sensors,), such as off; of `step`, the largest usual."""
        return self._limits[what]

    @cached_property
    def _limits(self) -> dict[str, FloatArray]:
        names = ("off", "jump", "moved", "still", "unseen", "frozen", "step")
        found = {name: np.array([getattr(s, name) for s in self.sensors], dtype=np.float64) for name in names}
        found["unseen"] = np.maximum(found["unseen"], self.thresholds.least_unseen)
        found["frozen"] = np.where(found["frozen"] > 0.0, found["frozen"], found["moved"])
        twice = self.thresholds.same_moved * found["step"]  # that of few changes is larger
        found["step"] = np.where(found["step"] > 0.0, twice, found["moved"] / self.thresholds.same_moved)
        return found

    @cached_property
    def speeds(self) -> IntArray:
        """Indices of the inputs that are spindle speeds."""
        return np.array([k for k, i in enumerate(self.inputs) if i.quantity == "spindle_speed"], dtype=np.intp)

    @cached_property
    def ranges(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Trained range of each temperature and its width, (n_sensors,) each [degC]."""
        own = [self.inputs[s.input] for s in self.sensors]
        low, high = np.array([i.low for i in own]), np.array([i.high for i in own])
        return low, high, high - low
