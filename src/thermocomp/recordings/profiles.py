"""`Profiles`: the error of one component along its axis, measured in several thermal states."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, cast

import numpy as np

from thermocomp.core.arrays import FloatArray, IntArray
from thermocomp.core.components import BY_CODE
from thermocomp.core.exceptions import InputError, RecordingError
from thermocomp.recordings.recording import Recording

#: measured quantity, by the unit of the error
QUANTITY = {"um": "displacement", "urad": "angle"}
#: a position as coordinates by axis, such as {"Y": 250.0} [mm]
Place = Mapping[str, float]
#: minimum number of positions of a profile
MIN_POSITIONS = 3


@dataclass(frozen=True, kw_only=True)
class ProfileOptions:
    """Definition of the contents of a table of profiles.

    Parameters
    ----------
    target : str
        Code of the component, such as ``EYY``, or any other name.
    axis : str
        Axis of the profiles; empty: the axis of the component.
    unit : str
        um or urad; empty: the unit of the component.
    columns : str
        Wide: names of the columns, with ``*`` in place of the position in mm, such as ``y_laser_*``. Long: the column
        of the error. Empty: columns named after the component, such as ``EYY_250_um`` (see
        `thermocomp.recordings.readers.codecolumns`); if there are none, found by unit and position in the name.
    places : mapping of str to Place
        Wide: position of each column by its name, instead of `columns`; see
        `thermocomp.recordings.readers.profiles.read_places`.
    position : str
        Long: column of the position of the axis; empty: ``position_mm``, or the axis column, such as ``y_mm``.
    state : str
        Long: column with the state of each row; empty: the column named state or profile, else the time, else a new
        state starts where a position recurs.
    """

    target: str
    axis: str = ""
    unit: str = ""
    columns: str = ""
    places: Mapping[str, Place] | None = None
    position: str = ""
    state: str = ""

    @property
    def about(self) -> tuple[str, Literal["um", "urad"]]:
        """Axis along which the profiles were measured, and unit of their values."""
        component = BY_CODE.get(self.target)
        axis = self.axis or (component.depends_on if component else "") or ""
        unit = self.unit or (component.unit if component else "")
        if not axis:
            hint = (
                f"{component.description} does not depend on a position"
                if component
                else "it is not the name of an error component"
            )
            raise InputError(f"{self.target}: {hint}; give an error component such as EYY, or specify the axis")
        if unit not in QUANTITY:
            raise InputError(f"{self.target}: unit {unit!r}: state whether it is in um or urad")
        return axis, cast(Literal["um", "urad"], unit)


@dataclass(frozen=True, eq=False)
class Slopes:
    """Least-squares fits of thermal parts, one per state: k_0 + k_1 q + k_2 q^2 ..., q in m (C-04, C-07).

    Parameters
    ----------
    powers : tuple of int
        Power of q of each factor.
    factors : ndarray of shape (n_states, n_powers)
        k_i [unit/m^i]; NaN where a state has too few points.
    errors : ndarray of shape (n_states, n_powers)
        Standard errors of the factors, from the fit residual of the same profile [unit/m^i].
    residual : ndarray of shape (n_states, n_points)
        Residual of the fit [unit].
    remainder : float
        Residual of all states except the reference, RMS per degree of freedom [unit]; NaN if there is none.
    shared : float
        Fraction of the error variance that is common to all states: noise of the reference profile.
    """

    powers: tuple[int, ...]
    factors: FloatArray
    errors: FloatArray
    residual: FloatArray
    remainder: float
    shared: float


@dataclass(frozen=True, eq=False)
class Profiles:
    """Error profiles of one component, measured in several thermal states.

    Parameters
    ----------
    target : str
        Code of the component, such as ``EYY``, or any other name.
    axis : {'X', 'Y', 'Z'}
        Axis along which the component was measured.
    points : ndarray of shape (n_points, 3)
        x, y, z of the axes [mm]. Where the other two coordinates vary (C-06), the points form lines, along which the
        position of the axis itself increases.
    values : ndarray of shape (n_states, n_points)
        Actual minus commanded [unit]; NaN where a point is missing.
    states : Recording
        Thermal states, one per row: time, temperatures, spindle speed; cycles.
    zero : ndarray of shape (n_points,), optional
        Profile of the cold state that replaces the profile of the reference states [unit].

    Raises
    ------
    RecordingError
        Shapes differ, a number is infinite, there are fewer than 3 positions, or they are not increasing or not unique.
    InputError
        The unit or axis is invalid, or differs from that of the component.
    """

    target: str
    unit: Literal["um", "urad"]
    axis: str
    points: FloatArray
    values: FloatArray
    states: Recording
    zero: FloatArray | None = None

    def __post_init__(self) -> None:
        owner = self._owner
        if self.unit not in ("um", "urad"):
            raise InputError(f"{owner}: unit {self.unit!r}: expected um or urad")
        if self.axis not in ("X", "Y", "Z"):
            raise InputError(f"{owner}: axis {self.axis!r}: expected X, Y or Z")
        component = BY_CODE.get(self.target)
        if component is not None:
            if component.depends_on != self.axis:
                along = f"is one along {component.depends_on}" if component.depends_on else "has no profile"
                raise InputError(f"{owner}: {component.description} {along}; the given profiles are along {self.axis}")
            if component.unit != self.unit:
                raise InputError(
                    f"{owner}: {component.description} is in {component.unit}; the given profiles are in {self.unit}"
                )
        if self.points.ndim != 2 or self.points.shape[1] != 3:
            raise RecordingError(
                f"{owner}: points of shape {self.points.shape}: expected (n_points, 3), the X, Y and Z of each point"
            )
        wanted = (len(self.states), len(self.points))
        if self.values.shape != wanted:
            raise RecordingError(
                f"{owner}: values of shape {self.values.shape}: expected {wanted}, one row per thermal state and one "
                "column per point"
            )
        if not np.isfinite(self.points).all():
            k = int(np.flatnonzero(~np.isfinite(self.points).all(axis=1))[0])
            raise RecordingError(
                f"{owner}: point {k + 1} at {self.points[k].tolist()} mm: must be finite; remove NaN and infinity"
            )
        if np.isinf(self.values).any():
            state, k = np.argwhere(np.isinf(self.values))[0]
            raise RecordingError(
                f"{owner}: infinite in state {state + 1} at {_place(self.points[k])}: leave values that were not "
                "measured empty (NaN)"
            )
        self._check_positions()

    def _check_positions(self) -> None:
        owner = self._owner
        found = np.unique(self.position)
        if len(found) < MIN_POSITIONS:
            raise RecordingError(
                f"{owner}: {len(found)} positions along {self.axis} ({', '.join(f'{p:g}' for p in found)} mm); a "
                f"profile needs at least {MIN_POSITIONS}"
            )
        last: dict[tuple[float, ...], float] = {}
        seen: set[tuple[float, ...]] = set()
        for point in self.points:
            if tuple(point) in seen:
                raise RecordingError(
                    f"{owner}: two values of a state at {_place(point)}: take their mean, or read the two directions "
                    "as two sets of profiles"
                )
            seen.add(tuple(point))
            line = tuple(np.delete(point, self._own).tolist())
            before, here = last.get(line, -np.inf), float(point[self._own])
            if here < before:
                raise RecordingError(
                    f"{owner}: positions along {self.axis} must increase, but {here:g} mm follows {before:g} mm: sort "
                    "them"
                )
            last[line] = here

    def __len__(self) -> int:
        return len(self.values)

    @property
    def _owner(self) -> str:
        return f"{self.states.source or self.states.name}: profiles of {self.target}"

    @property
    def _own(self) -> int:
        return "XYZ".index(self.axis)

    @property
    def position(self) -> FloatArray:
        """Position of the axis itself at each point, shape (n_points,) [mm]."""
        return self.points[:, self._own]

    @property
    def varying(self) -> str:
        """Axes whose position varies between the points, such as ``YX``, the measured axis first."""
        return self.axis + "".join(a for k, a in enumerate("XYZ") if a != self.axis and np.ptp(self.points[:, k]) > 0)

    @cached_property
    def fingerprint(self) -> str:
        """SHA-256 of the thermal states, the points and the values."""
        digest = hashlib.sha256(self.states.fingerprint.encode())
        for array in (self.points, self.values):
            digest.update(np.ascontiguousarray(array, dtype=np.float64).tobytes())
        return digest.hexdigest()

    def reference_rows(self, reference: int | Sequence[int] = 0) -> IntArray:
        """Return the rows of the thermal states that count as cold."""
        rows = np.atleast_1d(np.asarray(reference, dtype=np.intp))
        n = len(self)
        wrong = [int(k) for k in rows if not -n <= k < n]
        if wrong or not rows.size:
            raise InputError(f"{self._owner}: reference state {wrong or 'missing'}: expected numbers from 0 to {n - 1}")
        return np.unique(rows % n)

    def cold(self, reference: int | Sequence[int] = 0) -> FloatArray:
        """Return the profile in the reference state (C-07).

        Returns
        -------
        ndarray of shape (n_points,)
            [unit]; NaN where no reference state has a value.
        """
        if self.zero is not None:
            return self.zero
        rows = self.values[self.reference_rows(reference)]
        count = np.isfinite(rows).sum(axis=0)
        return np.where(count > 0, np.nansum(rows, axis=0) / np.maximum(count, 1), np.nan)

    def thermal(self, reference: int | Sequence[int] = 0) -> FloatArray:
        """Return the profiles minus the cold profile, shape (n_states, n_points) [unit] (C-07)."""
        return self.values - self.cold(reference)

    def slopes(
        self,
        order: int = 1,
        *,
        offset: bool = False,
        reference: int | Sequence[int] = 0,
        reference_position: float = 0.0,
    ) -> Slopes:
        """Fit k_1 q + k_2 q^2 ... to the thermal part of each profile (C-04, C-07).

        Parameters
        ----------
        order : int
            Highest power m; Chen finds 1 sufficient (C-05).
        reference_position : float
            Position at which q is zero [mm].
        """
        powers = tuple(range(0 if offset else 1, order + 1))
        n_positions = len(np.unique(self.position[self.position != reference_position])) + offset
        if order < 0 or not powers or n_positions <= len(powers):
            raise InputError(
                f"{self._owner}: {len(powers)} coefficients cannot be fitted to {n_positions} positions; choose 1 to "
                f"{n_positions - 1}"
            )
        q = 1e-3 * (self.position - reference_position)
        reach = float(np.abs(q).max())
        # the columns are scaled, because powers of metres differ by orders of magnitude
        columns = np.stack([(q / reach) ** k for k in powers], axis=1)
        scale = np.array([reach**-k for k in powers])
        thermal = self.thermal(reference)
        factors = np.full((len(self), len(powers)), np.nan)
        errors, residual = factors.copy(), np.full(thermal.shape, np.nan)
        warm = np.ones(len(self), dtype=np.bool_)
        warm[self.reference_rows(reference)] = False
        freedom, squares = 0, 0.0
        # states with the same points are fitted together
        alike: dict[bytes, list[int]] = {}
        for state, there in enumerate(np.isfinite(thermal)):
            alike.setdefault(there.tobytes(), []).append(state)
        for mine in alike.values():
            there = np.isfinite(thermal[mine[0]])
            n = int(there.sum())
            if n <= len(powers) or np.linalg.matrix_rank(columns[there]) < len(powers):
                continue
            Q, R = np.linalg.qr(columns[there])
            inverse = np.linalg.inv(R)
            parts = thermal[np.ix_(mine, there)]
            found = parts @ Q @ inverse.T
            left = parts - found @ columns[there].T
            rest = (left**2).sum(axis=1)
            factors[mine] = found * scale
            errors[mine] = np.sqrt(np.outer(rest / (n - len(powers)), (inverse**2).sum(axis=1))) * scale
            residual[np.ix_(mine, there)] = left
            freedom += (n - len(powers)) * int(warm[mine].sum())
            squares += float(rest[warm[mine]].sum())
        remainder = float(np.sqrt(squares / freedom)) if freedom else float("nan")
        return Slopes(
            powers=powers,
            factors=factors,
            errors=errors,
            residual=residual,
            remainder=remainder,
            shared=1.0 / (1.0 + int((~warm).sum())),
        )


def _place(point: FloatArray) -> str:
    return ", ".join(f"{a} {v:g}" for a, v in zip("XYZ", point, strict=True)) + " mm"
