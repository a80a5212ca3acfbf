"""The printed formula of a model names sensors and lags; whatever the names are, the code compiles and is the same."""

import re

import compiledblock
import numpy as np
import pytest
import stmachine
from driftmodels import ACCEPTED

from thermocomp.core.correction import Limits
from thermocomp.core.expression import Clip, Lag, Magnitude, PacedLag, Power, Product
from thermocomp.core.expression import Input as Leaf
from thermocomp.core.inputs import Input
from thermocomp.core.lineardynamic import LinearDynamic
from thermocomp.export.c99.c99 import translate
from thermocomp.export.st.structuredtext import translate as translate_st
from thermocomp.export.vectors import Readings
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.program.models import name_value
from thermocomp.runtime.program.tables import gather

FRONT = Clip(Leaf(0, "t_front_C"), -1.0, 9.0)
NAMES = ["T1", "t1", "if", "t__1_", "\u00b0", "x" * 150, "t1 lag 600 s", "t1_clip_4", "end_if", "a*/b", "t1*)"]


@pytest.mark.parametrize(
    ("node", "name"),
    [
        (FRONT.of, "x_t_front_C"),
        (FRONT, "x_t_front_C_clip"),
        (Lag(FRONT, 600.2), "x_t_front_C_lag_600_s"),
        (Power(Magnitude(FRONT), 0.5), "x_t_front_C_size_to_0_5"),
        (PacedLag(FRONT, 1800.0, 600.0, FRONT), "x_t_front_C_clip_lag_1800_to_600_s"),
        (Product((FRONT, FRONT)), ""),
        (Leaf(0, "\u00b0"), ""),
        (Leaf(0, "x" * 150), ""),
    ],
)
def test_a_value_is_named_after_its_sensor(node: Lag, name: str) -> None:
    assert name_value(node) == name


def test_any_names_of_sensors_compile() -> None:
    count = len(NAMES)
    model = LinearDynamic(
        target="z_um",
        unit="um",
        inputs=tuple(Input(n, "temperature", "degC", 20.0, True, -3.0, 15.0 + k) for k, n in enumerate(NAMES)),
        signals=tuple((k,) for k in range(count)),
        direct=tuple(0.1 * (k + 1) for k in range(count)),
        lag_signals=tuple(range(count)) * 2,
        time_constants=(600.0,) * count + (601.0,) * count,
        lagged=tuple(0.02 * (k + 1) for k in range(2 * count)),
        honest_error=ACCEPTED,
    )
    compensator = Compensator.of([model], Limits(magnitude=1e9, rate=1e9))
    tables = gather(compensator)
    source = translate(tables, "z").source
    for row in ("if [degC], lag 600 s", "a* /b [degC]"):
        assert f"/* {row} */" in source
    for unit in translate_st(tables, "tc_x", "codesys"):
        names = ", ".join(re.findall(r"^    ([\w, ]+) : ", unit.declaration, re.MULTILINE)).split(", ")
        assert len({n.lower() for n in names}) == len(names)
        assert not [n for n in names if "__" in n]
    values = 20.0 + np.random.default_rng(0).uniform(0.0, 10.0, (30, count))
    values[0] = 20.0
    compiledblock.check_block(compensator, values, np.full(30, 60.0))
    stmachine.check_block(compensator, Readings(values, np.zeros(30), np.full(30, 60.0)))
