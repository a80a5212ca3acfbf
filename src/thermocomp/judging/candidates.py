"""Candidate temperature sensors for a selection method."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from thermocomp.core.arrays import FloatArray
from thermocomp.core.exceptions import FitError, InputError
from thermocomp.core.messages import Message
from thermocomp.judging.choice import Table
from thermocomp.judging.diagnostics import diagnose
from thermocomp.recordings.samples import Samples


@dataclass(frozen=True, eq=False)
class Candidates:
    """Temperatures available to a selector, and the deviation to be predicted.

    Parameters
    ----------
    X : DataFrame of shape (n_rows, n_temperatures)
        Temperatures minus their reference.
    y : ndarray of shape (n_rows,)
        Deviation [um].
    cycle : ndarray of int of shape (n_rows,)
    """

    target: str
    X: pd.DataFrame
    y: FloatArray
    cycle: NDArray[np.intp]

    @classmethod
    def of(cls, samples: Samples, target: int) -> "Candidates":
        """Return the candidate temperatures and one target, in the rows without missing values."""
        temperatures = [j for j, c in enumerate(samples.inputs) if c.quantity == "temperature"]
        name = samples.targets[target].name
        if not temperatures:
            raise InputError(f"{name}: the inputs contain no temperature; sensors are selected among temperatures")
        rows = samples.valid & np.isfinite(samples.deviations[:, target])
        if rows.sum() < 3:
            raise FitError(f"{name}: {int(rows.sum())} complete rows; at least 3 are needed for selecting sensors")
        if np.ptp(samples.deviations[rows, target]) == 0:
            raise FitError(f"{name} is constant; name a target that changes")
        X = samples.frame().iloc[rows, temperatures].reset_index(drop=True)
        if not (np.ptp(X.to_numpy(), axis=0) > 0).any():
            raise FitError(f"{name}: all temperatures are constant; give recordings in which they change")
        return cls(name, X, samples.deviations[rows, target], samples.cycle[rows])

    @property
    def names(self) -> list[str]:
        """Names of the candidate temperatures."""
        return [str(n) for n in self.X.columns]

    def called(self, columns: Sequence[int]) -> tuple[str, ...]:
        """Return the names of the temperatures in the given columns."""
        return tuple(self.names[j] for j in columns)

    def repeats(self, sensors: Sequence[str]) -> Table:
        """Return a table of the collinearity of the given sensors."""
        values = self.X[list(sensors)].to_numpy()
        found = diagnose(values, self.y, tuple(sensors))
        raw = found.spectrum
        rows = tuple(zip(found.names, found.contributions, found.vif, strict=True))
        caption = Message(
            "X'X of their changes: smallest eigenvalue {smallest:.3g}, sum of inverse eigenvalues {inverse:.3g}, "
            "condition number {condition:.3g}. A variance inflation factor (VIF) above 10 means that the others carry "
            "almost the same information.",
            smallest=float(raw.smallest),
            inverse=float(raw.sum_inverse),
            condition=float(raw.condition_number),
        )
        title = Message("Collinearity of the chosen sensors")
        return Table(
            title=title,
            columns=(Message("sensor"), Message("correlation with the error"), "VIF"),
            rows=rows,
            caption=caption,
        )
