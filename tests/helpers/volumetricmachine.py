"""Machines of any structure with random reference points and components, for hypothesis and for tests by hand."""

from collections.abc import Mapping, Sequence

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

from thermocomp.core.components import COMPONENTS
from thermocomp.core.inputs import Input, Support
from thermocomp.core.machine import Axis, Machine, Source, Vector
from thermocomp.core.model import ErrorModel
from thermocomp.core.polynomial import Polynomial
from thermocomp.core.structure import Structure
from thermocomp.core.terms import Variable

FloatArray = NDArray[np.float64]

#: every way to share the axes between the sides; the last ones have two axes and one
STRUCTURES = (
    "XYZ",
    "XZY",
    "FXYZ",
    "XFYZ",
    "XYFZ",
    "YXFZ",
    "XYZF",
    "XFZY",
    "w X' b Z Y (C1) t",
    "w Y' X' b Z t",
    "XFZ",
    "FYZ",
    "YXF",
    "ZF",
)


def vector(rng: np.random.Generator, size: float) -> Vector:
    x, y, z = rng.uniform(-size, size, 3).tolist()
    return x, y, z


def random_machine(code: str, rng: np.random.Generator) -> Machine:
    """Return a machine without components, all of whose reference points are somewhere."""
    structure = Structure.parse(code)
    axes = tuple(
        Axis(
            name,
            (-400.0, 400.0),
            float(rng.uniform(-300, 300)),
            vector(rng, 400),
            vector(rng, 200),
            "workpiece" if rng.integers(2) else "tool",
        )
        for name in sorted(structure.axes)
    )
    return Machine("random", structure, axes, spindle_tool=vector(rng, 200), tool=vector(rng, 200))


def random_values(machine: Machine, rng: np.random.Generator, urad: float, um: float, rows: int = 1) -> FloatArray:
    """Return components of shape (rows, 32) within the limits; zero where the machine has not their axes."""
    size = [(urad if c.unit == "urad" else um) * (set(c.axes) <= set(machine.structure.axes)) for c in COMPONENTS]
    return np.asarray(rng.uniform(-1.0, 1.0, (rows, len(COMPONENTS))) * np.array(size))


machines = st.builds(
    lambda code, seed: (random_machine(code, np.random.default_rng(seed)), np.random.default_rng(seed + 1)),
    st.sampled_from(STRUCTURES),
    st.integers(0, 2**32),
)


def by_hand(
    code: str,
    components: Mapping[str, Source] | None = None,
    *,
    reference: float = 0.0,
    spindle_tool: Vector = (0.0, 0.0, 0.0),
) -> Machine:
    """Return a machine with round numbers."""
    structure = Structure.parse(code)
    axes = tuple(
        Axis(a, (0.0, 600.0), reference, (10.0, 20.0, 30.0), (0.0, 0.0, -50.0)) for a in "XYZ" if a in structure.axes
    )
    return Machine("round", structure, axes, components or {}, spindle_tool=spindle_tool, tool=(5.0, 0.0, -150.0))


def temperature(name: str, low: float = -100.0, high: float = 100.0) -> Input:
    """Return a temperature that counts from the first reading."""
    return Input(name, "temperature", "degC", 20.0, True, low, high)


def line(
    target: str, unit: str, factors: Mapping[str, float], *, differences: Sequence[tuple[str, str, float]] = ()
) -> ErrorModel:
    """Return a sum of factor x temperature rise and factor x difference of two rises."""
    names = list(dict.fromkeys([*factors, *(n for a, b, _ in differences for n in (a, b))]))
    singles = tuple(Variable.single(n, names.index(n)) for n in factors)
    variables = (*singles, *(Variable.difference(names, a, b) for a, b, _ in differences))
    return Polynomial(
        target=target,
        unit=unit,
        inputs=tuple(temperature(n) for n in names),
        variables=variables,
        terms=tuple((k,) for k in range(len(variables))),
        coefficients=(*factors.values(), *(c for _, _, c in differences)),
        support=Support(margin=0.0),
    )
