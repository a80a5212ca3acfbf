"""Explanation of models in plain words."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from thermocomp.core.explained import Explanation, Explanations, explain_all
from thermocomp.core.explained import explain as explain_one
from thermocomp.core.model import ErrorModel
from thermocomp.files import modelfile

if TYPE_CHECKING:
    from thermocomp.api.results import FittedModels


def models_of(model: Any) -> tuple[ErrorModel, ...]:
    """Return a list of models from a model, a sequence, a result of `fit`, or the path of a model file."""
    if isinstance(model, ErrorModel):
        return (model,)
    if isinstance(model, str | Path):
        return tuple(modelfile.read(Path(model)))
    return tuple(model.fitted.models if hasattr(model, "fitted") else model)


def explain(model: "ErrorModel | FittedModels | str | Path | Sequence[ErrorModel]") -> Explanation | Explanations:
    """Explain the models of a file: their terms, their accuracy, and the effect of a failure of each sensor.

    Parameters
    ----------
    model : ErrorModel, FittedModels, path of a model file, or sequence of ErrorModel
        Model file of `fit`.

    Returns
    -------
    Explanation or Explanations
        Explanation of one or several models, to be printed.

    Examples
    --------
    >>> import thermocomp as tc
    >>> fitted = tc.fit(tc.simulate("wessel-milling"), "s1_um", "ols", leave_one="file")
    >>> print(str(tc.explain(fitted)).splitlines()[0])
    s1_um [um]: predicted by ols from 3 temperatures; present values only.
    """
    return explain_one(model) if isinstance(model, ErrorModel) else explain_all(models_of(model))
