"""thermocomp: thermal error compensation of machine tools.

From temperature recordings to a validated model at the controller. Public names are loaded when first used, so the
running wing never pays for the training wing.
"""

import sys
from importlib import import_module
from importlib.metadata import version
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from thermocomp.api.check import check
    from thermocomp.api.explain import explain
    from thermocomp.api.inputs import read, training_table
    from thermocomp.api.join import join
    from thermocomp.api.plan import may_stop, plan
    from thermocomp.api.select import select
    from thermocomp.api.verbs import assess, compare, fit
    from thermocomp.core.correction import Correction, Deviation, Limits
    from thermocomp.core.exceptions import ThermocompError
    from thermocomp.core.lineardynamic import LinearDynamic
    from thermocomp.core.model import ErrorModel
    from thermocomp.core.polynomial import Polynomial
    from thermocomp.core.reading import Reading
    from thermocomp.export.verbs import export
    from thermocomp.iso230.verbs import iso230
    from thermocomp.judging.probing import Probings
    from thermocomp.models.ace import ACE
    from thermocomp.models.ace_monotone import MonotoneACE
    from thermocomp.models.arx import ARX
    from thermocomp.models.arx_net import NetARX
    from thermocomp.models.averaged import AveragedDynamic
    from thermocomp.models.dynamic import DynamicRidge
    from thermocomp.models.gp import GaussianProcess
    from thermocomp.models.grouping import CorrelationGrouping
    from thermocomp.models.lasso import ElasticNet, Lasso
    from thermocomp.models.mlp import SigmoidNet
    from thermocomp.models.mlp_sklearn import SklearnNet
    from thermocomp.models.ols import LeastSquares
    from thermocomp.models.partial_f import PartialF
    from thermocomp.models.pcr import PrincipalComponents
    from thermocomp.models.pcr_traversal import TraversedComponents
    from thermocomp.models.pipelines import freeze
    from thermocomp.models.pls import PartialLeastSquares
    from thermocomp.models.ppr import ProjectionPursuit
    from thermocomp.models.ridge import Ridge
    from thermocomp.models.second_order import SecondOrderRegression
    from thermocomp.models.sensors import SensorSelector
    from thermocomp.models.sir import SlicedInverse
    from thermocomp.models.subsets import BestSubset
    from thermocomp.nc.revise import revise
    from thermocomp.recordings.recording import Recording
    from thermocomp.recordings.starts import Start
    from thermocomp.virtual.verbs import simulate
    from thermocomp.volumetric.verbs import position, volumetric

__version__ = version("thermocomp")

_PUBLIC = {
    # the main job
    "read": "thermocomp.api.inputs",
    "simulate": "thermocomp.virtual.verbs",
    "check": "thermocomp.api.check",
    "join": "thermocomp.api.join",
    "select": "thermocomp.api.select",
    "compare": "thermocomp.api.verbs",
    "fit": "thermocomp.api.verbs",
    "assess": "thermocomp.api.verbs",
    "revise": "thermocomp.nc.revise",
    "plan": "thermocomp.api.plan",
    "may_stop": "thermocomp.api.plan",
    "explain": "thermocomp.api.explain",
    "export": "thermocomp.export.verbs",
    "iso230": "thermocomp.iso230.verbs",
    "position": "thermocomp.volumetric.verbs",
    "volumetric": "thermocomp.volumetric.verbs",
    "freeze": "thermocomp.models.pipelines",
    "training_table": "thermocomp.api.inputs",
    "Recording": "thermocomp.recordings.recording",
    "Start": "thermocomp.recordings.starts",
    # what runs at the machine
    "Correction": "thermocomp.core.correction",
    "Deviation": "thermocomp.core.correction",
    "ErrorModel": "thermocomp.core.model",
    "Probings": "thermocomp.judging.probing",
    "Limits": "thermocomp.core.correction",
    "LinearDynamic": "thermocomp.core.lineardynamic",
    "Polynomial": "thermocomp.core.polynomial",
    "Reading": "thermocomp.core.reading",
    "ThermocompError": "thermocomp.core.exceptions",
    # the estimators
    "ACE": "thermocomp.models.ace",
    "ARX": "thermocomp.models.arx",
    "AveragedDynamic": "thermocomp.models.averaged",
    "BestSubset": "thermocomp.models.subsets",
    "CorrelationGrouping": "thermocomp.models.grouping",
    "DynamicRidge": "thermocomp.models.dynamic",
    "ElasticNet": "thermocomp.models.lasso",
    "GaussianProcess": "thermocomp.models.gp",
    "Lasso": "thermocomp.models.lasso",
    "LeastSquares": "thermocomp.models.ols",
    "MonotoneACE": "thermocomp.models.ace_monotone",
    "NetARX": "thermocomp.models.arx_net",
    "PartialF": "thermocomp.models.partial_f",
    "PartialLeastSquares": "thermocomp.models.pls",
    "PrincipalComponents": "thermocomp.models.pcr",
    "ProjectionPursuit": "thermocomp.models.ppr",
    "Ridge": "thermocomp.models.ridge",
    "SensorSelector": "thermocomp.models.sensors",
    "SigmoidNet": "thermocomp.models.mlp",
    "SklearnNet": "thermocomp.models.mlp_sklearn",
    "SecondOrderRegression": "thermocomp.models.second_order",
    "SlicedInverse": "thermocomp.models.sir",
    "TraversedComponents": "thermocomp.models.pcr_traversal",
}

__all__ = [
    "ACE",
    "ARX",
    "AveragedDynamic",
    "BestSubset",
    "Correction",
    "CorrelationGrouping",
    "Deviation",
    "DynamicRidge",
    "ElasticNet",
    "ErrorModel",
    "GaussianProcess",
    "Lasso",
    "LeastSquares",
    "Limits",
    "LinearDynamic",
    "MonotoneACE",
    "NetARX",
    "PartialF",
    "PartialLeastSquares",
    "Polynomial",
    "PrincipalComponents",
    "Probings",
    "ProjectionPursuit",
    "Reading",
    "Recording",
    "Ridge",
    "SecondOrderRegression",
    "SensorSelector",
    "SigmoidNet",
    "SklearnNet",
    "SlicedInverse",
    "Start",
    "ThermocompError",
    "TraversedComponents",
    "__version__",
    "assess",
    "check",
    "compare",
    "explain",
    "export",
    "fit",
    "freeze",
    "iso230",
    "join",
    "may_stop",
    "plan",
    "position",
    "read",
    "revise",
    "select",
    "simulate",
    "training_table",
    "volumetric",
]


class _FrontDoor(ModuleType):
    """Keeps a verb in front of the room of its name: importing the room would put the room there."""

    def __setattr__(self, name: str, value: object) -> None:
        if not (name in _PUBLIC and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _FrontDoor


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        raise AttributeError(f"module 'thermocomp' has no attribute {name!r}")
    from thermocomp.cli.extras import needs

    with needs("study"):
        return getattr(import_module(_PUBLIC[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
