"""Frozen models that a spindle speed drives, for the tests of the drift along a program."""

from dataclasses import replace
from typing import Literal

from thermocomp.core.autoregressive import Autoregressive, AutoregressiveNet
from thermocomp.core.inputs import Input, Support
from thermocomp.core.lineardynamic import LinearDynamic
from thermocomp.core.model import ErrorModel
from thermocomp.core.network import Affine, Perceptron
from thermocomp.core.polynomial import Polynomial
from thermocomp.core.provenance import RULES, HonestError
from thermocomp.core.terms import Variable

SPEED = Input("spindle_rpm", "spindle_speed", "1/min", 0.0, False, 0.0, 6000.0)
ACCEPTED = HonestError(
    "test", 1.0, 1.0, 2.0, 5.0, 5.0, {"1": 1.0}, "accepted", "worse than none on cycle 3", 2, rules=RULES
)
ROOM = Input("t3_C", "temperature", "degC", 20.0, True, -5.0, 5.0)


def lags(target: str = "z_um", size: float = 1.0, *, room: bool = False, direct: bool = True) -> LinearDynamic:
    """Two lags of the speed, one of its square, some of it at once; 1 um per degC of the room if asked for."""
    return LinearDynamic(
        target=target,
        unit="um",
        inputs=(SPEED, ROOM) if room else (SPEED,),
        signals=((0,), (0, 0), (1,)) if room else ((0,), (0, 0)),
        direct=(size * 2e-4 * direct, 0.0, 0.3) if room else (size * 2e-4 * direct, 0.0),
        lag_signals=(0, 0, 1, 2) if room else (0, 0, 1),
        time_constants=(120.0, 2400.0, 1200.0, 600.0) if room else (120.0, 2400.0, 1200.0),
        lagged=tuple(size * c for c in ((1e-3, 4e-3, 2e-7, 0.7) if room else (1e-3, 4e-3, 2e-7))),
    )


def ticking(target: str = "z_um", size: float = 1.0, interval: float = 600.0) -> Autoregressive:
    """k = 1, m = 0, the paper's orders (P-02)."""
    return Autoregressive(target=target, unit="um", inputs=(SPEED,), interval=interval, a=(0.85,), b=((size * 1e-3,),))


def net(target: str = "z_um", interval: float = 60.0) -> AutoregressiveNet:
    """k = 2, m = 1."""
    return AutoregressiveNet(
        target=target,
        unit="um",
        inputs=(SPEED,),
        interval=interval,
        k=2,
        m=1,
        net=Perceptron(((1.0, 0.4, 0.8, 0.3), (0.5, -0.2, -0.4, 0.6)), (0.1, -0.2), ((1.2, 0.7),), (-0.9,)),
        input_scaling=Affine((0.02, 0.02, 2e-4, 2e-4), (0.0, 0.0, 0.0, 0.0)),
        output_scaling=Affine((60.0,), (-20.0,)),
    )


def static(target: str = "z_um") -> Polynomial:
    """A millimetre at a million turns: no memory."""
    return Polynomial(
        target=target,
        unit="um",
        inputs=(SPEED,),
        variables=(Variable.single("spindle_rpm", 0),),
        terms=((0,),),
        coefficients=(1e-3,),
    )


def judged(model: ErrorModel, max_abs: float, verdict: Literal["accepted", "refused"] = "accepted") -> ErrorModel:
    """Return the model with an honest error."""
    return replace(model, honest_error=replace(ACCEPTED, max_abs=max_abs, verdict=verdict))


def strict(model: ErrorModel) -> ErrorModel:
    """Return the model without a margin beyond its trained range."""
    return replace(model, support=Support(margin=0.0))


def growing(target: str, per_degree: float, unit: str = "um") -> Polynomial:
    """So much a degree of one temperature, counted from the first reading; accepted."""
    return Polynomial(
        target=target,
        unit=unit,
        inputs=(Input("t", "temperature", "degC", 20.0, True, -50.0, 50.0),),
        variables=(Variable.single("t", 0),),
        terms=((0,),),
        coefficients=(per_degree,),
        honest_error=ACCEPTED,
    )
