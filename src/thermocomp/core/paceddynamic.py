"""PacedDynamic family: lagged temperatures, and states of the spindle speed with speed-dependent time constants."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.core.bounds import DEGREE, ENTRIES, GAP, LEAST, RANGE, check_between, check_count, check_finite
from thermocomp.core.exceptions import SettingError
from thermocomp.core.expression import Lag, Magnitude, Node, PacedLag, Power, scale_node, sum_weighted
from thermocomp.core.model import ErrorModel
from thermocomp.core.pacedbank import Bank


@dataclass(frozen=True)
class LaggedInput:
    """A temperature with the readout coefficients of itself and its lags.

    Parameters
    ----------
    input : int
        Index into the inputs of the model.
    direct : float
        Readout coefficient of the temperature itself [um/degC].
    lagged : tuple of float
        Readout coefficient of each lag, one per time constant of the model [um/degC].
    """

    input: int
    direct: float
    lagged: tuple[float, ...]


@dataclass(frozen=True)
class SpeedState:
    """A state that follows a power of the spindle speed, with a time constant that depends on the speed.

    Parameters
    ----------
    input : int
        Index into the inputs of the model.
    power : float
        Exponent of the fraction of the top speed.
    stopped, running : float
        Time constants at rest and at top speed [s]; the reciprocal is linear in the speed.
    weight : float
        Readout coefficient [um].
    """

    input: int
    power: float
    stopped: float
    running: float
    weight: float


@dataclass(frozen=True, kw_only=True)
class PacedDynamic(ErrorModel):
    """Deviation = intercept + weighted sum of temperatures, their first-order lags and speed states.

    A lag of a temperature T follows tau dx/dt = T - x. A state of the speed n follows dx/dt = k (nu^p - x), nu =
    abs(n) / n_top, with k = 1/tau_stopped + nu (1/tau_running - 1/tau_stopped): a turning spindle stirs the air that
    cools it. All states start at steady state in the first reading.

    Parameters
    ----------
    family : str
        Name of the family in a file.
    time_constants : tuple of float
        Time constants of the lags, the same for all temperatures [s].
    top_speed : float
        n_top [1/min].
    spread : tuple of tuple of float
        Readout coefficients of the same terms (temperatures, their lags, lag by lag, and the speed states); the root of
        the sum of the squared outputs is the spread of the regressions averaged by the model [unit]; empty: unknown.

    Examples
    --------
    >>> from thermocomp.core.inputs import Input
    >>> from thermocomp.core.paceddynamic import PacedDynamic, SpeedState
    >>> speed = Input("spindle_rpm", "spindle_speed", "1/min", reference=0.0, rezero=False, low=0.0, high=6000.0)
    >>> model = PacedDynamic(
    ...     target="z_um",
    ...     unit="um",
    ...     inputs=(speed,),
    ...     time_constants=(),
    ...     temperatures=(),
    ...     top_speed=6000.0,
    ...     states=(SpeedState(0, power=2.0, stopped=3600.0, running=1800.0, weight=30.0),),
    ... )
    >>> table = {"time_s": [0, 1800, 18000, 19800], "spindle_rpm": [0.0, 6000.0, 6000.0, 0.0]}
    >>> model.predict(table).round(1).tolist()  # warms up twice as fast as it cools down
    [0.0, 19.0, 30.0, 18.2]
    """

    family: Literal["paced-dynamic"] = "paced-dynamic"

    time_constants: tuple[float, ...]
    temperatures: tuple[LaggedInput, ...]
    top_speed: float
    states: tuple[SpeedState, ...]
    spread: tuple[tuple[float, ...], ...] = ()

    def _check(self) -> None:
        owner, temperatures, states = f"model of {self.target}", self.temperatures, self.states
        wrong = [t for t in temperatures if len(t.lagged) != len(self.time_constants)]
        if wrong:
            raise SettingError(
                f"{owner}: lagged coefficients of input {wrong[0].input}: expected {len(self.time_constants)}, one per "
                f"lag; found {len(wrong[0].lagged)}"
            )
        named = [(f"temperature {k}", t.input) for k, t in enumerate(temperatures)]
        named += [(f"speed state {k}", s.input) for k, s in enumerate(states)]
        for what, index in named:
            if not 0 <= index < len(self.inputs):
                raise SettingError(f"{owner}: {what}: input index {index}: expected 0 to {len(self.inputs) - 1}")
        slower = [s for s in states if s.running > s.stopped]
        if slower:
            raise SettingError(
                f"{owner}: speed state {states.index(slower[0])}: its time constant is {slower[0].running:g} s with "
                f"the spindle running and {slower[0].stopped:g} s with it stopped; the first must not be longer"
            )
        check_count(owner, ENTRIES, lags=range(len(temperatures) * len(self.time_constants)), states=states)
        parts = len(temperatures) * (1 + len(self.time_constants)) + len(states)
        if wrong_rows := [len(row) for row in self.spread if len(row) != parts]:
            raise SettingError(
                f"{owner}: a row of spread has {wrong_rows[0]} numbers; expected {parts}: one for each temperature, "
                "each of its lags and each speed state"
            )
        check_count(owner, ENTRIES, spread=[w for row in self.spread for w in row])
        check_between(owner, LEAST, RANGE, top_speed=self.top_speed)
        check_between(
            owner,
            LEAST,
            GAP,
            time_constants=self.time_constants,
            stopped=[s.stopped for s in states],
            running=[s.running for s in states],
        )
        check_between(owner, LEAST, DEGREE, power=[s.power for s in states])
        check_finite(
            owner,
            intercept=self.intercept,
            direct=[t.direct for t in temperatures],
            lagged=[w for t in temperatures for w in t.lagged],
            weight=[s.weight for s in states],
            spread=[w for row in self.spread for w in row],
        )

    @cached_property
    def bank(self) -> Bank:
        """Lags and speed states of the model; models with the same bank can share their values."""
        taus, states = self.time_constants, self.states
        stopped = [1 / s.stopped for s in states]
        lags = [1 / tau for tau in taus for _ in self.temperatures]
        return Bank(
            temperatures=np.array([t.input for t in self.temperatures], dtype=np.intp),
            taus=len(taus),
            speeds=np.array([s.input for s in states], dtype=np.intp),
            powers=np.array([s.power for s in states], dtype=np.float64),
            rates=np.array(lags + stopped, dtype=np.float64),
            gain=np.array([1 / s.running - k for s, k in zip(states, stopped, strict=True)], dtype=np.float64),
            top=self.top_speed,
        )

    @cached_property
    def read_out(self) -> tuple[FloatArray, FloatArray]:
        """Readout coefficients of the inputs, (n_inputs,), and of the states, (n_memory,)."""
        direct = np.zeros(len(self.inputs))
        for t in self.temperatures:
            direct[t.input] += t.direct
        lagged = [t.lagged[k] for k in range(len(self.time_constants)) for t in self.temperatures]
        return direct, np.array(lagged + [s.weight for s in self.states], dtype=np.float64)

    def _order_memory(self, change: Sequence[Node]) -> Sequence[Node]:
        lags: list[Node] = [Lag(change[t.input], tau) for tau in self.time_constants for t in self.temperatures]
        for s in self.states:
            share = scale_node(1 / self.top_speed, Magnitude(change[s.input]))
            lags.append(PacedLag(Power(share, s.power), s.stopped, s.running, share))
        return lags

    def _terms(self, change: Sequence[Node]) -> list[Node]:
        """Return the temperatures, their lags, lag by lag, and the states of the speed."""
        return [*(change[t.input] for t in self.temperatures), *self._order_memory(change)]

    def _expression(self, change: Sequence[Node]) -> Node:
        terms, n = self._terms(change), len(self.temperatures)
        order, weights = list[int](), list[float]()
        for k, t in enumerate(self.temperatures):  # each temperature is followed by its lags
            order += range(k, n * (1 + len(self.time_constants)), n)
            weights += [t.direct, *t.lagged]
        order += range(len(order), len(terms))
        weights += [s.weight for s in self.states]
        return sum_weighted(weights, [terms[k] for k in order], self.intercept)

    def spread_expressions(self, change: Sequence[Node]) -> Sequence[Node]:
        """Return, as expressions, the outputs with each row of `spread` as readout coefficients."""
        terms = self._terms(change)
        return [sum_weighted(row, terms) for row in self.spread]

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the inputs that affect the deviation."""
        active = {t.input for t in self.temperatures if t.direct or any(t.lagged)}
        active |= {s.input for s in self.states if s.weight}
        return tuple(self.inputs[k].name for k in sorted(active))

    def coefficients_by_name(self) -> dict[str, float]:
        """Return the coefficient of each term; the name of a speed state contains its lags at rest and at top speed."""
        found: dict[str, float] = {}
        for t in self.temperatures:
            name = self.inputs[t.input].name
            found[name] = t.direct
            found |= {
                f"lag({name}, {tau / 60:.4g} min)": w for w, tau in zip(t.lagged, self.time_constants, strict=True)
            }
        for s in self.states:
            name = f"({self.inputs[s.input].name}/{self.top_speed:g})^{s.power:.3g}"
            found[f"lag({name}, {s.stopped / 60:.4g} to {s.running / 60:.4g} min)"] = s.weight
        return {name: w for name, w in found.items() if w != 0}
