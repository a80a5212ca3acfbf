"""thermocomp: thermal error compensation of machine tools.

From temperature recordings to a validated model at the controller. Public names are loaded when first used, so the
running wing never pays for the training wing.
"""

from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from thermocomp.core.correction import Correction, Deviation, Limits
    from thermocomp.core.exceptions import ThermocompError
    from thermocomp.core.lineardynamic import LinearDynamic
    from thermocomp.core.model import ErrorModel
    from thermocomp.core.polynomial import Polynomial
    from thermocomp.core.reading import Reading

__version__ = version("thermocomp")

_PUBLIC = {
    "Correction": "thermocomp.core.correction",
    "Deviation": "thermocomp.core.correction",
    "ErrorModel": "thermocomp.core.model",
    "Limits": "thermocomp.core.correction",
    "LinearDynamic": "thermocomp.core.lineardynamic",
    "Polynomial": "thermocomp.core.polynomial",
    "Reading": "thermocomp.core.reading",
    "ThermocompError": "thermocomp.core.exceptions",
}

__all__ = [
    "Correction",
    "Deviation",
    "ErrorModel",
    "Limits",
    "LinearDynamic",
    "Polynomial",
    "Reading",
    "ThermocompError",
    "__version__",
]


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        raise AttributeError(f"module 'thermocomp' has no attribute {name!r}")
    return getattr(import_module(_PUBLIC[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
