"""What models are, in plain words."""

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
    """Return models, given as one, as a sequence of them, as what `fit` returned, or as the path of a model file."""
    if isinstance(model, ErrorModel):
        return (model,)
    if isinstance(model, str | Path):
        return tuple(modelfile.read(Path(model)))
    return tuple(model.fitted.models if hasattr(model, "fitted") else model)


def explain(model: "ErrorModel | FittedModels | str | Path | Sequence[ErrorModel]") -> Explanation | Explanations:
    """Say what the models of a file are made of, how good they are, and what a failure of each sensor does.

    Parameters
    ----------
    model : ErrorModel, FittedModels, path of a model file, or sequence of ErrorModel
        Model file of `fit`.

    Returns
    -------
    Explanation or Explanations
        Of one model, or of several; print it to read it.

    Examples
    --------
    >>> import thermocomp as tc
    >>> fitted = tc.fit(tc.simulate("wessel-milling"), "s1_um", "ols", leave_one="file")
    >>> print(str(tc.explain(fitted)).splitlines()[0])
    s1_um: ols predicts it [um] from 3 temperatures: these alone, without a memory.
    """
    return explain_one(model) if isinstance(model, ErrorModel) else explain_all(models_of(model))
