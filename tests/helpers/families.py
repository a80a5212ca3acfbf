"""Models of every family, and readings for them: strategies for hypothesis."""

from typing import Any

import numpy as np
from hypothesis import strategies as st

from thermocomp.core.additive import Additive
from thermocomp.core.autoregressive import Autoregressive, AutoregressiveNet
from thermocomp.core.curves import Curve
from thermocomp.core.inputs import Input
from thermocomp.core.lineardynamic import LinearDynamic
from thermocomp.core.network import Affine, Network, Perceptron
from thermocomp.core.paceddynamic import LaggedInput, PacedDynamic, SpeedState
from thermocomp.core.polynomial import Polynomial
from thermocomp.core.terms import Variable, second_order_terms

INPUTS = (
    Input("T1", "temperature", "degC", 20.0, True, -3.0, 15.0),
    Input("T2", "temperature", "degC", 20.0, False, -5.0, 10.0),
    Input("n", "spindle_speed", "1/min", 0.0, False, 0.0, 6000.0),
)
HEAD: dict[str, Any] = {"target": "z_um", "unit": "um", "inputs": INPUTS}
SINGLES = tuple(Variable.single(i.name, k) for k, i in enumerate(INPUTS))
MIXED = (*SINGLES[:2], Variable.difference(["T1", "T2", "n"], "T1", "T2"), Variable("p", ((0, 0.5), (2, -1e-3))))
numbers = st.floats(-5, 5, allow_subnormal=False)


def many(count: int) -> st.SearchStrategy[tuple[float, ...]]:
    return st.lists(numbers, min_size=count, max_size=count).map(tuple)


def rising(count: int) -> st.SearchStrategy[tuple[float, ...]]:
    steps = st.lists(st.floats(0.1, 4.0), min_size=count, max_size=count)
    return steps.map(lambda s: tuple((np.cumsum(s) - sum(s) / 2).tolist()))


POLYNOMIALS = st.builds(
    lambda c, k: Polynomial(**HEAD, variables=MIXED, terms=second_order_terms(4), coefficients=c, intercept=k),
    many(14).map(lambda c: tuple(x * 10.0 ** -(3 * (j in (3, 7))) for j, x in enumerate(c))),
    numbers,
)
LAGS = st.builds(
    lambda d, g, tau, k: LinearDynamic(
        **HEAD,
        signals=((0,), (1,), (2,), (2, 2)),
        direct=(*d, 0.0, 0.0),
        lag_signals=(0, 0, 2, 3),
        time_constants=tau,
        lagged=(g[0], g[1], 1e-3 * g[2], 1e-6 * g[3]),
        intercept=k,
    ),
    many(2),
    many(4),
    st.lists(st.floats(5.0, 9000.0), min_size=4, max_size=4).map(tuple),
    numbers,
)
PACED = st.builds(
    lambda w, tau, p, ends, k: PacedDynamic(
        **HEAD,
        time_constants=tau,
        temperatures=(LaggedInput(1, w[0], w[1:3]), LaggedInput(0, w[3], w[4:6])),
        top_speed=5000.0,
        states=tuple(SpeedState(2, q, max(e), min(e), v) for q, e, v in zip(p, ends, w[6:], strict=True)),
        intercept=k,
    ),
    many(8),
    st.lists(st.floats(5.0, 9000.0), min_size=2, max_size=2).map(tuple),
    st.lists(st.floats(0.5, 3.0), min_size=2, max_size=2),
    st.lists(st.tuples(st.floats(5.0, 9000.0), st.floats(5.0, 9000.0)), min_size=2, max_size=2),
    numbers,
)
CURVES = st.one_of(
    st.builds(Curve, rising(4), many(4), st.just("linear")), st.builds(Curve, rising(3), many(4), st.just("step"))
)
SMOOTH = st.builds(Curve, rising(4), many(4), st.just("linear"))
ADDITIVE = st.builds(
    lambda a, b, r, k: Additive(**HEAD, variables=(MIXED[0], MIXED[3]), curves=(a, b), response=r, intercept=k),
    SMOOTH,
    SMOOTH,
    st.none() | SMOOTH,
    numbers,
)
SCALING = Affine((0.1, 0.2, 1e-3), (0.0, -0.5, 0.25))
ACTIVE = st.sampled_from(["sigmoid", "tanh", "identity"])


def net(n_inputs: int) -> st.SearchStrategy[Perceptron]:
    return st.builds(
        Perceptron,
        st.tuples(many(n_inputs), many(n_inputs)),
        many(2),
        st.tuples(many(2)),
        many(1),
        ACTIVE,
        st.sampled_from(["sigmoid", "tanh"]),
    )


NETS = st.builds(
    lambda p, k: Network(**HEAD, net=p, input_scaling=SCALING, output_scaling=Affine((30.0,), (-15.0,)), intercept=k),
    net(3),
    numbers,
)
AUTOREGRESSIVE = st.builds(
    lambda a, b, k: Autoregressive(**HEAD, interval=15.0, a=a, b=(b[:2], b[2:4], (1e-3 * b[4], 0.0)), intercept=k),
    st.sampled_from([(0.7,), (0.5, 0.3), ()]),
    many(5),
    numbers,
)
AUTOREGRESSIVE_NETS = st.builds(
    lambda p, k: AutoregressiveNet(
        **HEAD,
        interval=15.0,
        k=1,
        m=1,
        net=p,
        input_scaling=Affine((0.05, *SCALING.gain, *SCALING.gain), (0.0, *SCALING.offset, *SCALING.offset)),
        output_scaling=Affine((30.0,), (-15.0,)),
        intercept=k,
    ),
    net(7),
    numbers,
)
FAMILIES = {
    "polynomial": POLYNOMIALS,
    "linear-dynamic": LAGS,
    "paced-dynamic": PACED,
    "additive": ADDITIVE,
    "network": NETS,
    "autoregressive": AUTOREGRESSIVE,
    "autoregressive-network": AUTOREGRESSIVE_NETS,
}
READINGS = st.lists(
    st.tuples(
        st.floats(10.0, 50.0), st.floats(5.0, 40.0), st.sampled_from([0.0, 2500.0, 9000.0]), st.floats(0.5, 60.0)
    ),
    min_size=1,
    max_size=12,
)
