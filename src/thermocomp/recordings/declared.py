"""What a mapping declares about a test besides its columns: header data, measurement uncertainty, workpiece."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Annotated, Any

from pydantic import BeforeValidator

from thermocomp.core.exceptions import InputError

_COEFFICIENT = {"range": (0.01, 300.0)}
_LENGTH = {"range": (0.001, 1e5)}


def _date(found: Any) -> Any:
    """Return the text of a date, which arrives from TOML in a list."""
    return found[0] if isinstance(found, list) and len(found) == 1 else found


@dataclass(frozen=True)
class HeaderData:
    """Table ``[test]``: header data of a test, as text; empty entries are not stated."""

    machine: str = ""
    serial: str = ""
    place: str = ""
    date: Annotated[str, BeforeValidator(_date)] = ""
    operator: str = ""
    instrument: str = ""

    def stated(self) -> dict[str, str]:
        """Return the entries that are not empty."""
        return {name: text for name, text in vars(self).items() if text}

    def __str__(self) -> str:
        return ", ".join(f"{name} {text}" for name, text in self.stated().items())


@dataclass(frozen=True)
class MeasuringUncertainty:
    """Table ``[uncertainty]``: contributions to the measurement uncertainty of displacements; None: not stated.

    Parameters
    ----------
    probe_um : float
        Expanded uncertainty (k = 2) of a displacement, from the calibration certificate of the instrument [um].
    sensitivity_pct : float
        Expanded uncertainty (k = 2) of its sensitivity, in percent of the displacement.
    misalignment_deg : float
        Largest angle between the instrument and the direction that it measures [deg].
    mounting_um : float
        Range (largest minus smallest) of the readings that the mounting can cause, such as play and cable forces [um].
    instrument_drift_um : float
        Range of the readings of the instrument against its own fixture, over a time as long as the test [um].
    repeatability_um : float
        Standard deviation of single readings with the machine at rest [um]. None: from the scatter of the rows.
    """

    probe_um: float | None = field(default=None, metadata={"range": (0.0, 1000.0)})
    sensitivity_pct: float | None = field(default=None, metadata={"range": (0.0, 100.0)})
    misalignment_deg: float | None = field(default=None, metadata={"range": (0.0, 45.0)})
    mounting_um: float | None = field(default=None, metadata={"range": (0.0, 1000.0)})
    instrument_drift_um: float | None = field(default=None, metadata={"range": (0.0, 1000.0)})
    repeatability_um: float | None = field(default=None, metadata={"range": (0.0, 1000.0)})


@dataclass(frozen=True)
class ExpandingBody:
    """Table ``[expansion.NAME]``: instrument, fixture or artefact that expands between tool and table during the test.

    Parameters
    ----------
    length_mm : float
        Length in the measuring direction [mm].
    coefficient_um_per_m_K : float
        Coefficient of thermal expansion [um/(m K)], such as 11.5 for steel.
    variation_K : float
        Range (largest minus smallest) of its temperature during the test [K].
    """

    length_mm: float = field(metadata=_LENGTH)
    coefficient_um_per_m_K: float = field(metadata=_COEFFICIENT)  # noqa: N815 - K is the kelvin
    variation_K: float = field(metadata={"range": (0.0, 100.0)})  # noqa: N815

    @property
    def range(self) -> float:
        """Range of its expansion during the test [um]."""
        return self.coefficient_um_per_m_K * self.length_mm / 1000.0 * self.variation_K


@dataclass(frozen=True)
class Workpiece:
    """Table ``[workpiece]``: the expansion of the workpiece itself, which is stated but not subtracted.

    Parameters
    ----------
    length_mm : float
        Length [mm].
    coefficient_um_per_m_K : float
        Coefficient of thermal expansion [um/(m K)].
    temperature : str
        Channel of its temperature.
    reference_degC : float
        Temperature at which its length is specified [degC]; 20 by ISO 1.
    material : str
        Material, in words.
    """

    length_mm: float = field(metadata=_LENGTH)
    coefficient_um_per_m_K: float = field(metadata=_COEFFICIENT)  # noqa: N815
    temperature: str
    reference_degC: float = field(default=20.0, metadata={"range": (-50.0, 100.0)})  # noqa: N815
    material: str = ""

    def expansion(self, temperature: Any) -> Any:
        """Return the change of its length since the reference temperature [um], for temperatures [degC]."""
        return self.coefficient_um_per_m_K * self.length_mm / 1000.0 * (temperature - self.reference_degC)


@dataclass(frozen=True)
class Declared:
    """All that a mapping declares about a test.

    Parameters
    ----------
    expansion : mapping of str to ExpandingBody
        By name, such as ``fixture``.

    Raises
    ------
    InputError
        A number is outside its range.
    """

    test: HeaderData = HeaderData()
    uncertainty: MeasuringUncertainty = MeasuringUncertainty()
    expansion: Mapping[str, ExpandingBody] = field(default_factory=dict)
    workpiece: Workpiece | None = None

    def __post_init__(self) -> None:
        _check(self.uncertainty, "uncertainty")
        for name, body in self.expansion.items():
            _check(body, f"expansion.{name}")
        if self.workpiece is not None:
            _check(self.workpiece, "workpiece")

    @property
    def states_uncertainty(self) -> bool:
        """Whether a contribution to the measurement uncertainty is stated."""
        return bool(self.expansion) or self.uncertainty != MeasuringUncertainty()

    def over(self, below: "Declared") -> "Declared":
        """Return these declarations, completed by the entries that only `below` has."""
        known = {name: value for name, value in vars(self.uncertainty).items() if value is not None}
        return Declared(
            replace(below.test, **self.test.stated()),
            replace(below.uncertainty, **known),
            {**below.expansion, **self.expansion},
            self.workpiece or below.workpiece,
        )


def _check(table: Any, name: str) -> None:
    """Raise `InputError` if a number is outside its range."""
    for entry in fields(table):
        value = getattr(table, entry.name)
        low, high = entry.metadata.get("range", (-math.inf, math.inf))
        if isinstance(value, int | float) and not low <= value <= high:
            raise InputError(
                f"[{name}]: {entry.name} = {value:g}: must be from {low:g} to {high:g} in the unit that ends the key; "
                "correct the number, or leave the key out if it is not known"
            )
