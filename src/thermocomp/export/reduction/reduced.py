"""Model forms of controllers that support less than a full model, and a model reduced to such a form."""

import math
import re
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass, replace
from decimal import ROUND_DOWN, ROUND_HALF_EVEN, Decimal
from typing import NamedTuple

from thermocomp.core.inputs import Input
from thermocomp.core.model import ErrorModel
from thermocomp.core.polynomial import Polynomial
from thermocomp.export.facts import Facts, tell_verdict

#: largest number of eight digits
_LARGEST = Decimal(99_999_999)
#: how names begin that denote a change: dX, and the Greek letter and the sign
_CHANGE = "(?:d|delta|\u0394|\u2206)?"


@dataclass(frozen=True)
class Shape:
    """Form of a controller's formula: current temperatures times coefficients.

    Parameters
    ----------
    sensors : int
        Maximum number of sensors.
    constant : bool
        A constant may be added. False: the formula is relative to the temperature at homing.
    axes : str
        Letters of the axes with a formula.
    """

    sensors: int
    constant: bool
    axes: str


#: by export target; macro: of Fanuc, Haas and Okuma
SHAPES = {
    "klipper": Shape(1, False, "Z"),
    "heidenhain": Shape(3, True, "XYZ"),
    "macro": Shape(3, True, "XYZ"),
}


class RemainingError(NamedTuple):
    """Size of the error that remains after compensation [um]; nan if unknown."""

    rms: float
    largest: float


@dataclass(frozen=True)
class LeftOut:
    """Model fitted without a cycle, and its result on that cycle.

    Parameters
    ----------
    name : str
        Name of the cycle.
    model : ErrorModel
        The reduced model.
    none, full, reduced : float
        RMS without compensation, with the full and with the reduced model [um]; nan if unknown.
    """

    name: str
    model: ErrorModel
    none: float
    full: float
    reduced: float


@dataclass(frozen=True)
class Reduced:
    """A model in the form supported by a controller, with the full model for comparison.

    Parameters
    ----------
    model : ErrorModel
        Linear in temperatures, without memory; its honest error is from unseen cycles.
    axis : str
        X, Y or Z.
    beside : str
        Description of the full model, and the data on which its error was found.
    none, full, reduced : RemainingError
        Residuals on unseen cycles: without compensation, with the full and with the reduced model.
    cycles : tuple of LeftOut
        Results per cycle; empty if the full model already had this form.
    replayed : RemainingError or None
        Residual of the exported model over all rows of the recordings used for its fit.
    most : float
        Largest output in judging and replay [um].
    """

    model: ErrorModel
    axis: str
    beside: str
    none: RemainingError
    full: RemainingError
    reduced: RemainingError
    cycles: tuple[LeftOut, ...] = ()
    replayed: RemainingError | None = None
    most: float = 0.0

    @property
    def loss(self) -> float:
        """RMS on unseen cycles over that of the full model; nan if unknown."""
        if self.full.rms > 0:
            return self.reduced.rms / self.full.rms
        return 1.0 if self.reduced.rms == self.full.rms else math.nan

    @property
    def loss_in_words(self) -> str:
        """Loss of accuracy, such as ``RMS 2.10 um on unseen cycles, 1.05 um more than the full model: 2.00 times``."""
        more = self.reduced.rms - self.full.rms
        way = "more" if more >= 0 else "less"
        return (
            f"RMS {self.reduced.rms:.2f} um on unseen cycles, {abs(more):.2f} um {way} than the full model "
            f"({self.loss:.2f} times its RMS)"
        )

    def why_not(self, most_loss: float) -> str:
        """Return the reason why the reduced model must not be exported; empty if it may be."""
        found = self.model.honest_error
        if found is None:
            return "it was never judged on unseen cycles"
        if found.word == "refused":
            return found.why
        if math.isnan(self.loss):
            return "the loss cannot be stated: the error of the full model on unseen cycles is not known"
        if self.loss > most_loss:
            return (
                f"loses too much accuracy: {self.loss_in_words}; at most {most_loss:g} times is permitted (--most-loss)"
            )
        if found.word == "unproven" and not found.taken:
            return f'unproven: {found.why} (to approve its use nevertheless: --accept-unproven "NAME, REASON")'
        return ""

    @property
    def terms(self) -> list[tuple[Input, float]]:
        """Temperatures, and the deviation per degree of each [um/K]."""
        factors = linear_factors(self.model)
        assert factors is not None
        return [(i, f) for i, f in zip(self.model.inputs, factors, strict=True) if f]

    @property
    def zeros(self) -> list[float]:
        """Fixed zero of each temperature, for an exported formula that does not know when a test starts [degC]."""
        return [round(i.reference, 2) if i.rezero else i.reference for i, _ in self.terms]

    def deviation(self, temperatures: Sequence[float]) -> float:
        """Return the output of the formula for the temperatures in `terms` [um]."""
        parts = zip(self.terms, temperatures, self.zeros, strict=True)
        return self.model.intercept + sum(f * (t - zero) for (_, f), t, zero in parts)


def linear_factors(model: ErrorModel) -> list[float] | None:
    """Return the effect of each input [um/K]; None if the model is not a linear combination of current temperatures."""
    if not isinstance(model, Polynomial) or any(len(t) != 1 for t in model.terms):
        return None
    if any(i.quantity != "temperature" for i in model.inputs) or model.support.policy != "clip":
        return None
    found = [0.0] * len(model.inputs)
    for (variable,), factor in zip(model.terms, model.coefficients, strict=True):
        for place, weight in model.variables[variable].weights:
            found[place] += factor * weight
    return found


def fits(model: ErrorModel, shape: Shape) -> bool:
    """Return whether a model already has the form of a controller."""
    factors = linear_factors(model)
    if factors is None or not 0 < sum(map(bool, factors)) <= shape.sensors:
        return False
    return shape.constant or (model.intercept == 0 and all(i.rezero for i in model.inputs))


def as_it_is(model: ErrorModel, axis: str) -> Reduced:
    """Return a model that already has the form of the controller, with rounded coefficients and no loss."""
    found = model.honest_error
    assert isinstance(model, Polynomial)
    model = replace(
        model,
        inputs=tuple(replace(i, reference=round(i.reference, 4)) for i in model.inputs),
        coefficients=tuple(float(f"{c:.5g}") for c in model.coefficients),
        intercept=float(f"{model.intercept:.5g}"),
    )
    none = RemainingError(math.nan if found is None else found.none_rms, math.nan)
    own = RemainingError(*((math.nan, math.nan) if found is None else (found.rms, found.max_abs)))
    return Reduced(
        model=model,
        axis=axis,
        beside="the model already has this form, written here with five digits; its error is that in the model file",
        none=none,
        full=own,
        reduced=own,
    )


def vectors(reduced: Reduced) -> list[tuple[float, ...]]:
    """Return test temperatures of a formula, in the order of its terms: each alone, all, beyond the trained range."""
    inputs, zeros = [i for i, _ in reduced.terms], reduced.zeros
    rows = [tuple(zeros)]
    for k, i in enumerate(inputs):
        for share in (0.0, 0.25, 0.5, 0.75, 1.0):
            row = list(zeros)
            row[k] += i.low + share * (i.high - i.low)
            rows.append(tuple(row))
    for share in (-1.5, -0.2, 0.3, 0.8, 1.2, 2.5):  # beyond the trained range: below 0 and above 1
        rows.append(tuple(z + i.low + share * (i.high - i.low) for i, z in zip(inputs, zeros, strict=True)))
    return [tuple(round(t, 2) for t in row) for row in dict.fromkeys(rows)]


def find_axis(target: str, named: dict[str, str]) -> str:
    """Return the letter of the axis of a target, as `named` or by its name; empty if neither defines it.

    A name defines it by its beginning (``z_um``, ``X1_um``), or by the only letter of an axis among its words
    (``drift_Z_um``, ``dZ_top_um``).
    """
    if target in named:
        return named[target]
    if begins := re.fullmatch(rf"{_CHANGE}([xyz])([\d_].*)?", target, re.IGNORECASE):
        return begins[1].upper()
    words = re.split(r"[\W_]+", target)
    letters = {
        found[1].upper() for word in words if (found := re.fullmatch(rf"{_CHANGE}([xyz])\d*", word, re.IGNORECASE))
    }
    return letters.pop() if len(letters) == 1 else ""


def in_mm(um: float) -> str:
    """Return micrometres converted to millimetres as text, without rounding."""
    return _plain(Decimal(repr(um)).scaleb(-3))


def in_um(um: float) -> str:
    """Return a number as text, without rounding and without an exponent."""
    return _plain(Decimal(repr(um)))


def shorten(text: str, *, cap: bool = False) -> str:
    """Return a number of eight digits, at most seven of them after the point: the limit of Fanuc controls."""
    value = Decimal(text)
    if abs(value) >= _LARGEST:
        return _plain(_LARGEST.copy_sign(value))
    behind = 8 - max(1, value.adjusted() + 1)
    rounded = value.quantize(Decimal(1).scaleb(-behind), ROUND_DOWN if cap else ROUND_HALF_EVEN)
    return _plain(min(max(rounded, -_LARGEST), _LARGEST)) if rounded else "0"


def _plain(value: Decimal) -> str:
    text = f"{value:f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def to_ascii(text: str, other: str = ".") -> str:
    """Return text in ASCII: letters without their accents, `other` for letters of other alphabets."""
    apart = unicodedata.normalize("NFKD", text.replace("\u00df", "ss"))
    bare = "".join(c for c in apart if c.isascii() or (c.isalnum() and not unicodedata.combining(c)))
    return re.sub(r"[^\x00-\x7f]+", other, bare)


def mark(name: str, taken: Sequence[str] = ()) -> str:
    """Return a name of letters, digits and ``_`` only that differs from those in `taken`, ignoring case.

    Letters of other alphabets become the number of the name, such as ``n2_C``.
    """
    found = re.sub(r"[^0-9A-Za-z_]", "_", to_ascii(name, f"n{len(taken) + 1}")) or "_"
    used = {t.upper() for t in taken}
    return found if found.upper() not in used else f"{found}_{len(taken)}"


def head(reductions: Sequence[Reduced], facts: Facts, sign: str, units: str) -> list[str]:
    """Return the header of an export, with the verdict in the first line."""
    words, more = [], []
    for r in reductions:
        found = r.model.honest_error
        taken = found.taken if found is not None else ""
        words.append(f"{r.model.target}: {tell_verdict([r.model])}")
        more += [f"{r.model.target}: unproven, approved by {taken}"] if taken else []
        more += [f"{r.model.target}: {r.loss_in_words}; {r.none.rms:.2f} um without compensation"]
    kind = (
        "reduced to a form that the controller supports"
        if any(r.cycles for r in reductions)
        else "the full model, not reduced"
    )
    return [f"{'; '.join(words)}; {kind}", *more, *facts.origin(), sign, units]
