"""The methods by name: what each is, and how its estimator is made."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from importlib import import_module
from inspect import signature
from typing import Any, Literal

from thermocomp.core.exceptions import InputError
from thermocomp.models.base import ThermalRegressor
from thermocomp.models.foreign import adopt_estimator, title

#: asks for every method where names of methods are given
ALL_METHODS = "all"


@dataclass(frozen=True)
class Method:
    """A way to get a model.

    Parameters
    ----------
    name : str
        On the command line.
    summary : str
        One line.
    estimator : str
        Module in `thermocomp.models` and class; imported when it is built, for some bring a compiler along.
    speed : str
        Its parameter that takes the names of the spindle speeds; empty for a method that has no use for them.
    takes : tuple of {'dt', 'cycle'}
        What its `fit` wants beside X and y. With ``dt`` it has a memory, and also gets the rows it may not learn from.
    settings : dict of str to object
        Other parameters than the estimator's own defaults.
    """

    name: str
    summary: str
    estimator: str
    speed: str = ""
    takes: tuple[Literal["dt", "cycle"], ...] = ()
    settings: dict[str, Any] = field(default_factory=dict)

    @property
    def kind(self) -> type[ThermalRegressor]:
        """Class of the estimator."""
        module, _, name = self.estimator.rpartition(".")
        found: type[ThermalRegressor] = getattr(import_module(f"thermocomp.models.{module}"), name)
        return found

    def build(self, speeds: Sequence[str]) -> ThermalRegressor:
        """Make the estimator, given the names of the spindle speeds among its inputs."""
        columns = {self.speed: tuple(speeds)} if self.speed else {}
        return self.kind(**self.settings, **columns, **({"time": "routed"} if "dt" in self.takes else {}))


class NamedEstimator(str):
    """The name of an estimator that was handed in, which it carries along: it stands where names of methods do.

    Parameters
    ----------
    name : str
    estimator : estimator
        See `thermocomp.models.foreign.adopt_estimator`.
    """

    estimator: Any

    def __new__(cls, name: str, estimator: Any) -> "NamedEstimator":
        """Make the string."""
        made = super().__new__(cls, name)
        made.estimator = estimator
        return made

    def __getnewargs__(self) -> tuple[str, Any]:  # type: ignore[override]
        return str(self), self.estimator


METHODS: dict[str, Method] = {
    m.name: m
    for m in (
        Method("ols", "least squares on all temperatures", "ols.LeastSquares"),
        Method("partial-f", "stepwise by partial F, 100 to enter and 50 to delete", "partial_f.PartialF"),
        Method("mra", "Chen's stepwise second-order regression", "second_order.SecondOrderRegression"),
        Method(
            "averaged",
            "average of many ridges on lagged temperatures and states of the spindle speed",
            "averaged.AveragedDynamic",
            speed="speed",
            takes=("dt", "cycle"),
        ),
        Method(
            "dynamic",
            "ridge on temperatures, their lagged copies and the lagged spindle speed",
            "dynamic.DynamicRidge",
            speed="speed",
            takes=("dt", "cycle"),
        ),
        Method("grouping", "Hwang's correlation grouping and successive regression", "grouping.CorrelationGrouping"),
        Method("subsets", "exact best subset of the temperatures", "subsets.BestSubset", takes=("cycle",)),
        Method("ace", "Wessel's optimal transformations as printed, for a few temperatures", "ace.ACE"),
        Method("ace-monotone", "the same with a transformation that can be inverted", "ace_monotone.MonotoneACE"),
        Method("mlp", "Chen's sigmoid net of 20 hidden nodes, trained by back-propagation", "mlp.SigmoidNet"),
        Method("mlp-sklearn", "scikit-learn's net with one hidden layer", "mlp_sklearn.SklearnNet"),
        Method(
            "arx",
            "autoregression on the spindle speed alone, orders by final prediction error",
            "arx.ARX",
            speed="inputs",
            takes=("dt", "cycle"),
        ),
        Method(
            "arx-free-run",
            "the same, fitted to the free run, orders by cycles left out",
            "arx.ARX",
            speed="inputs",
            takes=("dt", "cycle"),
            settings={"criterion": "free-run", "k_max": 2, "m_max": 2},
        ),
        Method(
            "arx-net",
            "a sigmoid net in place of the linear recursion",
            "arx_net.NetARX",
            speed="inputs",
            takes=("dt", "cycle"),
        ),
        Method("ridge", "ridge regression on all temperatures", "ridge.Ridge", takes=("cycle",)),
        Method("pcr", "regression on the first principal components", "pcr.PrincipalComponents", takes=("cycle",)),
        Method("pls", "partial least squares", "pls.PartialLeastSquares", takes=("cycle",)),
        Method("lasso", "regression that drops temperatures by itself", "lasso.Lasso", takes=("cycle",)),
        Method(
            "elastic-net",
            "a lasso that keeps or drops collinear temperatures together",
            "lasso.ElasticNet",
            takes=("cycle",),
        ),
        Method("ppr", "projection pursuit regression", "ppr.ProjectionPursuit", takes=("cycle",)),
        Method("gp", "Gaussian process; for comparison only, cannot be deployed", "gp.GaussianProcess"),
    )
}


def find_method(name: str) -> Method:
    """Find a method.

    Raises
    ------
    InputError
        There is none of that name.
    """
    found = METHODS.get(name)
    if found is None:
        near = get_close_matches(name, METHODS, n=1, cutoff=0.4)
        hint = f"; did you mean {near[0]}?" if near else "."
        raise InputError(f"unknown model {name!r}{hint} Known are {', '.join(METHODS)}")
    return found


def make_method(estimator: Any) -> Method:
    """Return what an estimator with settings of its own is as a method: it takes all inputs."""
    kind = type(estimator)
    known: tuple[Literal["dt", "cycle"], ...] = ("dt", "cycle")
    takes = tuple(p for p in known if p in signature(estimator.fit).parameters)
    return Method(title(estimator), "", f"{kind.__module__}.{kind.__name__}", speed="inputs", takes=takes)


def expand(names: Sequence[Any]) -> list[str]:
    """Return names of methods once each, ``all`` standing for all of them.

    Parameters
    ----------
    names : sequence of str or estimator
        An estimator becomes a `Named`, called by its class; of several of one class the later ones get a number.

    Returns
    -------
    list of str

    Raises
    ------
    InputError
        None is given, there is no method of one of the names, or something else is no regressor.
    """
    if not names:
        raise InputError("no model given: name at least one method, such as dynamic, or all of them by all")
    listed: dict[str, None] = {}
    for entry in names:
        if isinstance(entry, NamedEstimator):
            listed[entry] = None
        elif isinstance(entry, str):
            listed.update(dict.fromkeys(METHODS if entry == ALL_METHODS else [find_method(entry).name]))
        else:
            estimator = adopt_estimator(entry)
            same = sum(n.partition(" #")[0] == title(estimator) for n in listed)
            listed[NamedEstimator(title(estimator) + (f" #{same + 1}" if same else ""), estimator)] = None
    return list(listed)


def deployable(name: str) -> bool:
    """Return whether models of this name can run at a machine: False for methods that cannot be frozen."""
    if isinstance(name, NamedEstimator):
        return bool(getattr(name.estimator, "freezable", True))
    return name not in METHODS or METHODS[name].kind.freezable
