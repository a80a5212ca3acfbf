"""LinearDynamic family: a bank of first-order lags and a linear readout."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

from thermocomp.core.bounds import ENTRIES, GAP, LEAST, check_between, check_count, check_finite
from thermocomp.core.exceptions import SettingError
from thermocomp.core.expression import Lag, Node, sum_weighted
from thermocomp.core.model import ErrorModel
from thermocomp.core.terms import Term, TermTable, Variable


@dataclass(frozen=True, kw_only=True)
class LinearDynamic(ErrorModel):
    """Deviation = intercept + direct . s + lagged . x, with tau dx/dt = s - x.

    ``s`` are signals: products of the inputs (mostly the inputs themselves, or the square of the spindle speed); each
    lag follows one signal with a separate time constant. The bank starts at steady state in the first reading.

    Parameters
    ----------
    family : str
        Name of the family in a file.
    signals : tuple of tuple of int
        Per signal, the indices of the inputs that are multiplied.
    direct : tuple of float
        Readout coefficient of each signal.
    lag_signals : tuple of int
        Index of the signal followed by each lag.
    time_constants : tuple of float
        Time constant of each lag [s].
    lagged : tuple of float
        Readout coefficient of each lag.

    Examples
    --------
    >>> from thermocomp import LinearDynamic
    >>> from thermocomp.core.inputs import Input
    >>> speed = Input("spindle_rpm", "spindle_speed", "1/min", reference=0.0, rezero=False, low=0.0, high=6000.0)
    >>> model = LinearDynamic(
    ...     target="z_um",
    ...     unit="um",
    ...     inputs=(speed,),
    ...     signals=((0,),),
    ...     direct=(0.0,),
    ...     lag_signals=(0,),
    ...     time_constants=(1800.0,),
    ...     lagged=(0.005,),
    ... )
    >>> table = {"time_s": [0.0, 1800.0, 3600.0, 18000.0], "spindle_rpm": [0.0, 6000.0, 6000.0, 6000.0]}
    >>> model.predict(table).round(1).tolist()  # settles at 30 um
    [0.0, 19.0, 25.9, 30.0]
    """

    family: Literal["linear-dynamic"] = "linear-dynamic"

    signals: tuple[Term, ...]
    direct: tuple[float, ...]
    lag_signals: tuple[int, ...]
    time_constants: tuple[float, ...]
    lagged: tuple[float, ...]

    def _check(self) -> None:
        owner = f"model of {self.target}"
        if len(self.direct) != len(self.signals):
            raise SettingError(f"{owner}: {len(self.signals)} signals but {len(self.direct)} direct coefficients")
        if not len(self.lag_signals) == len(self.time_constants) == len(self.lagged):
            raise SettingError(
                f"{owner}: {len(self.lag_signals)} lag signals, {len(self.time_constants)} time constants and "
                f"{len(self.lagged)} lag coefficients; their numbers must be equal"
            )
        for k, i in enumerate(self.lag_signals):
            if not 0 <= i < len(self.signals):
                raise SettingError(f"{owner}: lag {k}: signal index {i}: expected 0 to {len(self.signals) - 1}")
        check_count(owner, ENTRIES, signals=self.signals, lags=self.lagged)
        check_between(owner, LEAST, GAP, time_constants=self.time_constants)
        check_finite(owner, direct=self.direct, lagged=self.lagged, intercept=self.intercept)
        self._table  # noqa: B018 - rejects invalid indices

    @cached_property
    def _table(self) -> TermTable:
        singles = tuple(Variable.single(x.name, i) for i, x in enumerate(self.inputs))
        return TermTable(len(self.inputs), singles, self.signals)

    def _expression(self, change: Sequence[Node]) -> Node:
        signals, lags = self._table.expressions(change), self._order_memory(change)
        return sum_weighted((*self.direct, *self.lagged), (*signals, *lags), self.intercept)

    def _order_memory(self, change: Sequence[Node]) -> Sequence[Node]:
        signals = self._table.expressions(change)
        return [Lag(signals[k], tau) for k, tau in zip(self.lag_signals, self.time_constants, strict=True)]

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the inputs that affect the deviation."""
        active = {k for k, c in enumerate(self.direct) if c != 0}
        active |= {k for k, c in zip(self.lag_signals, self.lagged, strict=True) if c != 0}
        used = {i for k in active for i in self._table.inputs_of(k)}
        return tuple(self.inputs[i].name for i in sorted(used))

    def coefficients_by_name(self) -> dict[str, float]:
        """Return the coefficient of each signal and each lag; ``lag(s, 20 min)`` is a first-order lag."""
        names = self._table.names()
        found = {n: c for n, c in zip(names, self.direct, strict=True) if c != 0}
        for k, tau, c in zip(self.lag_signals, self.time_constants, self.lagged, strict=True):
            found[f"lag({names[k]}, {tau / 60:.4g} min)"] = c
        return found
