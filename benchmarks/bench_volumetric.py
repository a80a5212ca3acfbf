"""The 32 components of a machine: synthesis at many points, and step and synthesis at one point in live operation.

Run with ``python benchmarks/bench_volumetric.py``. The machine has 18 position models, each with a profile of fifth
order and one slope, and 14 scalars: 32 models of time, half of them polynomials of 8 terms, half with 8 lags each. The
results must agree: those of the stack with those of the models stepped one by one, a batch of points with single
points, and the first-order sum with exact transforms, except for terms of second order in the angles. Goals: 100,000
points in at most 100 ms, one evaluation in live operation (step, components, error) in at most 200 us (median).
"""

import sys
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.components import COMPONENTS
from thermocomp.core.inputs import Input
from thermocomp.core.lineardynamic import LinearDynamic
from thermocomp.core.machine import Axis, Machine, Source
from thermocomp.core.polynomial import Polynomial
from thermocomp.core.position import PositionModel, slope_unit
from thermocomp.core.profile import PolynomialProfile
from thermocomp.core.structure import Structure
from thermocomp.core.terms import Variable
from thermocomp.runtime.geometry.volumetric import ThermalStates, VolumetricModel

FloatArray = NDArray[np.float64]

GOAL_MANY_MS, GOAL_LIVE_US = 100.0, 200.0
POINTS, EXACT_POINTS, ROWS = 100_000, 10_000, 5760
TRAVEL = (0.0, 600.0)
TEMPERATURES = [f"t{k}" for k in range(12)]
SECONDS: FloatArray = 10.0 * np.arange(ROWS, dtype=np.float64)
#: 16 h of warming up, one row every 10 s
READINGS = [{n: 32 - 12 * float(np.exp(-t / (2e3 + 1e3 * k))) for k, n in enumerate(TEMPERATURES)} for t in SECONDS]


def inputs(rng: np.random.Generator, count: int) -> tuple[Input, ...]:
    """Return some of the temperatures; every model has different trained ranges, so that nothing can be shared."""
    names = rng.choice(TEMPERATURES, count, replace=False).tolist()
    return tuple(Input(n, "temperature", "degC", 20.0, True, -5.0, 20.0 + rng.uniform(0, 1)) for n in names)


def polynomial(rng: np.random.Generator, target: str, unit: str) -> Polynomial:
    """Return 8 terms of four temperatures, one of the variables a difference."""
    taken = inputs(rng, 4)
    names = [i.name for i in taken]
    variables = (*(Variable.single(n, k) for k, n in enumerate(names)), Variable.difference(names, names[0], names[1]))
    terms = ((0,), (1,), (2,), (3,), (4,), (0, 0), (1, 2), (4, 4))
    coefficients = tuple((rng.normal(size=8) * np.array([1, 1, 1, 1, 1, 0.02, 0.02, 0.02])).tolist())
    return Polynomial(
        target=target, unit=unit, inputs=taken, variables=variables, terms=terms, coefficients=coefficients
    )


def dynamic(rng: np.random.Generator, target: str, unit: str) -> LinearDynamic:
    """Return four temperatures, direct and through two lags each."""
    return LinearDynamic(
        target=target,
        unit=unit,
        inputs=inputs(rng, 4),
        signals=((0,), (1,), (2,), (3,)),
        direct=tuple(rng.normal(size=4).tolist()),
        lag_signals=(0, 1, 2, 3, 0, 1, 2, 3),
        time_constants=tuple(rng.uniform(300, 20_000, 8).tolist()),
        lagged=tuple(rng.normal(size=8).tolist()),
    )


def machine(rng: np.random.Generator) -> Machine:
    """Return a machine all of whose components are modelled."""
    exponents = {"X": tuple((k, 0, 0) for k in range(6)), "Y": tuple((0, k, 0) for k in range(6))}
    exponents["Z"] = tuple((0, 0, k) for k in range(6))
    components: dict[str, Source] = {}
    for number, c in enumerate(COMPONENTS):
        make = polynomial if number % 2 else dynamic
        if c.depends_on is None:
            components[c.code] = make(rng, c.code, c.unit)
            continue
        profile = PolynomialProfile(
            exponents=exponents[c.depends_on],
            coefficients=tuple((4 * rng.normal(size=6)).tolist()),
            centre=(300.0, 300.0, 300.0),
            scale=(300.0, 300.0, 300.0),
            low=(0.0, 0.0, 0.0),
            high=(600.0, 600.0, 600.0),
        )
        components[c.code] = PositionModel(
            target=c.code,
            unit=c.unit,
            axis=c.depends_on,
            travel=TRAVEL,
            profile=profile,
            slopes=(make(rng, c.code, slope_unit(c.unit, 1)),),
        )
    axes = tuple(Axis(a, TRAVEL, 300.0, (300.0, 300.0, 300.0), (0.0, 0.0, -150.0)) for a in "XYZ")
    structure = Structure.parse("w X' b Z Y (C1) t")
    tool = (0.0, 0.0, -200.0)
    return Machine("bench", structure, axes, components, spindle_tool=(0.0, 0.0, -100.0), tool=tool)


def median(job: Callable[[int], object], count: int, warm: int = 3) -> float:
    """Return the median time of a call [s]."""
    for k in range(warm):
        job(k)
    times = np.empty(count)
    for k in range(count):
        begin = time.perf_counter_ns()
        job(k)
        times[k] = time.perf_counter_ns() - begin
    return float(np.median(times)) / 1e9


def agreed(mill: VolumetricModel, states: ThermalStates, points: FloatArray) -> bool:
    """Print the differences between the methods, and whether they are due to rounding and neglected orders only."""
    alone = np.empty((200, len(mill.stack.models)))
    for column, model in enumerate(mill.stack.models):
        state = model.init()
        for k in range(len(alone)):
            values = np.array([READINGS[k][i.name] for i in model.inputs])
            state, alone[k, column] = model.step(state, values, 10.0)
    stacked = float(np.abs(states.deviations[: len(alone)] - alone).max() / np.abs(alone).max())
    warm = states[-1]
    some, first = points[:EXACT_POINTS], warm.error(points[:EXACT_POINTS])
    single = np.array([warm.error(p) for p in points[:200]])
    batched = float(np.abs(single - first[:200]).max() / np.abs(first).max())
    difference = float(np.abs(warm.error(some, exact=True) - first).max())
    values, turns = np.abs(warm.components(some)), np.array([c.unit == "urad" for c in COMPONENTS])
    turned, moved = (float(values[:, which].sum(axis=1).max()) for which in (turns, ~turns))
    # each rotation also rotates the displacements before it: angle^2 x distance, angle x translation
    bound = 1e-6 * turned * (1e-3 * turned * 3 * np.hypot(TRAVEL[1], TRAVEL[1]) + moved)
    print(f"stack against models one by one: {stacked:.1e}; one point against many: {batched:.1e} (goal 1e-12)")
    print(f"exact against first order: largest {difference:.3f} um of {np.abs(first).max():.0f} (bound {bound:.3f} um)")
    return stacked <= 1e-12 and batched <= 1e-12 and difference <= bound


def main() -> int:
    rng = np.random.default_rng(0)
    mill = VolumetricModel(machine(rng))
    table = {name: np.array([r[name] for r in READINGS]) for name in TEMPERATURES}
    begin = time.perf_counter()
    states = mill.replay(SECONDS, table)
    replayed = time.perf_counter() - begin
    points, warm = rng.uniform(*TRAVEL, (POINTS, 3)), states[-1]
    same = agreed(mill, states, points)

    live, spot = mill.init(), np.array([431.0, 122.0, 215.0])
    apart = [model.init() for model in mill.stack.models]

    def evaluate(k: int) -> FloatArray:
        nonlocal live
        live, field = mill.step(live, READINGS[k], 10.0)
        return field.error(spot)

    def one_by_one(k: int) -> None:
        for n, model in enumerate(mill.stack.models):
            apart[n], _ = model.step(apart[n], np.array([READINGS[k][i.name] for i in model.inputs]), 10.0)

    many = 1e3 * median(lambda _: warm.error(points), 9)
    first = 1e3 * median(lambda _: warm.error(points[:EXACT_POINTS]), 9)
    exact = 1e3 * median(lambda _: warm.error(points[:EXACT_POINTS], exact=True), 5)
    once = 1e6 * median(evaluate, 3000, 50)
    separately = 1e6 * median(one_by_one, 300, 10)
    exact_once = 1e6 * median(lambda _: warm.error(spot, exact=True), 1000, 50)
    rows = (
        (f"{POINTS} points, components and error", many, "ms", f"goal {GOAL_MANY_MS:.0f} ms"),
        (f"{EXACT_POINTS} points, to first order", first, "ms", ""),
        (f"{EXACT_POINTS} points, by exact transforms", exact, "ms", f"{exact / first:.1f}x first order"),
        ("live: step, components and error, p50", once, "us", f"goal {GOAL_LIVE_US:.0f} us"),
        ("only the models, stepped one by one, p50", separately, "us", f"{separately / once:.1f}x all of the above"),
        ("one point by exact transforms, p50", exact_once, "us", ""),
        (f"replay of {ROWS} rows", 1e3 * replayed, "ms", f"{1e6 * replayed / ROWS:.0f} us a row"),
    )
    for title, value, unit, note in rows:
        print(f"{title:<44} {value:>8.1f} {unit}  {note}")
    reached = same and many <= GOAL_MANY_MS and once <= GOAL_LIVE_US
    print(f"goals: {'reached' if reached else 'MISSED'}")
    return 0 if reached else 1


if __name__ == "__main__":
    sys.exit(main())
