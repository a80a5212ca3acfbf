"""The log of a stepwise regression as text, in the style of SYSTAT 5.0 (Chen 1996, Fig. 2; C-16)."""

import math
from collections.abc import Sequence
from textwrap import fill
from typing import Protocol

from thermocomp.models.numerics.stepwise import Step


class Stepped(Protocol):
    """A regression whose terms were selected step by step."""

    log_: tuple[Step, ...]
    cycled_: bool
    terms_: tuple[str, ...]
    coef_: Sequence[float]
    intercept_: float
    fit_intercept: bool
    n_rows_: int
    n_effective_: float
    r_squared_: float
    adjusted_r_squared_: float
    standard_error_: float
    r_squared_kind_: str


def log_text(model: Stepped, rule: str, target: str) -> str:
    """Return header, steps, fit and coefficients.

    To SYSTAT's columns are added the partial F, the significance it corresponds to, the change of R2 (E-T3), the kind
    of R2 (E-C10) and the effective sample size (E-C12).

    Parameters
    ----------
    model : Stepped
        A fitted regression.
    rule : str
        The thresholds.
    target : str
        Name of what is predicted.

    Returns
    -------
    str
    """
    wide = max((len(s.term) for s in model.log_), default=0)
    lines = [f"STEPWISE REGRESSION WITH {rule}", ""]
    lines += [
        f"STEP={s.number:3d}  {s.action.upper():<6}  {s.term:<{wide}}  R= {_three(s.r)}  RSQUARE= {_three(s.r_squared)}"
        f"  F= {s.f:<9.4g}  ALPHA= {s.alpha:<8.2g}  CHANGE OF RSQUARE= {s.r_squared_step:+.2e}"
        for s in model.log_
    ]
    if model.cycled_:
        lines.append("STOPPED: THIS MODEL HAS BEEN THERE BEFORE")
    lines += ["", "THE SUBSET MODEL INCLUDES THE FOLLOWING PREDICTORS:", ""]
    lines.append(fill(", ".join(model.terms_) or "NONE", 100, break_long_words=False, break_on_hyphens=False))
    lines += [
        "",
        f"DEP VAR: {target}   N: {model.n_rows_}   MULTIPLE R: {_three(math.sqrt(max(model.r_squared_, 0.0)))}"
        f"   SQUARED MULTIPLE R: {_three(model.r_squared_)}",
        f"ADJUSTED SQUARED MULTIPLE R: {_three(model.adjusted_r_squared_)}"
        f"   STANDARD ERROR OF ESTIMATE: {model.standard_error_:.3f}",
        f"R-SQUARES ARE {model.r_squared_kind_.upper()}   EFFECTIVE SAMPLE SIZE: {model.n_effective_:.1f}",
        "",
    ]
    rows = [*zip(model.terms_, model.coef_, strict=True)]
    if model.fit_intercept:
        rows.insert(0, ("CONSTANT", model.intercept_))
    wide = max([len("VARIABLE"), *(len(name) for name, _ in rows)])
    lines.append(f"{'VARIABLE':<{wide}}  {'COEFFICIENT':>14}")
    lines += [f"{name:<{wide}}  {value:>14.6g}" for name, value in rows]
    return "\n".join(lines) + "\n"


def _three(value: float) -> str:
    """Write a number like SYSTAT: three decimals, no zero before the point."""
    return f"{value:.3f}".replace("0.", ".", 1) if abs(value) < 1 else f"{value:.3f}"
