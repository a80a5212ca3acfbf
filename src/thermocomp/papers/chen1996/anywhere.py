"""Chen, Yuan, Ni 1996, headline: compensation of the error anywhere in the work volume.

The synthesis itself is in ref. 6 of the paper; here that of `thermocomp.volumetric` is used. The compensation is judged
by `thermocomp.virtual.volume`, which models the machine independently of that synthesis.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from thermocomp.core.components import BY_CODE, COMPONENTS
from thermocomp.papers.chen1996 import setup
from thermocomp.papers.chen1996.setup import exhibits
from thermocomp.papers.chen1996.volume import DYNAMIC, METHODS, PAPERS, LearnedVolume, with_sensors
from thermocomp.papers.claims import Claims, Facts
from thermocomp.papers.common import Errors, rms
from thermocomp.papers.study import Figure, FloatArray, PlotCurve, StudyTable
from thermocomp.runtime.geometry.kinematics import INDEX, Kinematics
from thermocomp.runtime.geometry.straight import straight_lines
from thermocomp.runtime.geometry.volumetric import ThermalStates, VolumetricModel
from thermocomp.virtual import datasets as virtual
from thermocomp.virtual.axes import AXES, TEST_POSITION, TRAVEL
from thermocomp.virtual.centre import MachiningCentre
from thermocomp.virtual.experiments import simulate
from thermocomp.virtual.geometry import find_cold_component
from thermocomp.virtual.probes import NEARER, swing
from thermocomp.virtual.volume import VolumetricTruth
from thermocomp.volumetric.models.position import PositionFit

#: number of points in the work volume, each in a different thermal state (C-35)
POINTS = 1000
#: largest permitted difference between first order and exact transforms [um]
CLOSED = 0.1
#: share of the points for which the upper bound of the error is reported [%]
MOST = 95
WITHOUT, LINES = "no compensation", "one straight line per axis, dynamic"
#: causes of the residual
SPINDLE, AXES_SHARE = "drift of the tool point at rest", "axes"
MIDDLE = tuple(float(TEST_POSITION[a]) for a in AXES)
#: shortest and longest tool [mm]
TOOLS = (60.0, 300.0)


@dataclass(frozen=True, eq=False)
class Volume:
    """Residuals after compensation at random points of the work volume, in random thermal states of unseen tests.

    Parameters
    ----------
    errors : mapping of str to ndarray of shape (n, 3)
        Errors without compensation, with all components by each method, and with straight lines [um].
    causes : mapping of str to mapping of str to ndarray of shape (n, 3)
        Residuals of each method, by cause [um].
    start : ndarray of shape (n, 3)
        Error with `DYNAMIC` that exists already at the start of the test [um].
    by_component : mapping of str to float
        RMS effect of the error of each component by `DYNAMIC` on the tool point [um].
    closure : float
        Largest difference between the first-order error from the true components and the true error [um].
    """

    learned: LearnedVolume
    errors: Mapping[str, FloatArray]
    causes: Mapping[str, Mapping[str, FloatArray]]
    start: FloatArray
    by_component: Mapping[str, float]
    closure: float

    @cached_property
    def sizes(self) -> dict[str, FloatArray]:
        """Lengths of the error vectors by type of compensation, each of shape (n,) [um]."""
        return {name: np.linalg.norm(e, axis=1) for name, e in self.errors.items()}

    def gain(self, what: str) -> float:
        """Return the factor by which a type of compensation reduces the RMS error."""
        return self.gains[what][0]

    @cached_property
    def gains(self) -> dict[str, tuple[float, float, float]]:
        """Factors by which RMS, median and largest error shrink, by type of compensation (C-35)."""
        ways = rms, np.median, np.max
        none, *after = ([float(way(size)) for way in ways] for size in self.sizes.values())
        names = [name for name in self.sizes if name != WITHOUT]
        return {name: (none[0] / r, none[1] / m, none[2] / x) for name, (r, m, x) in zip(names, after, strict=True)}

    @property
    def closest(self) -> str:
        """The method of the paper with the larger gain in RMS."""
        return max(PAPERS, key=self.gain)


@dataclass(frozen=True, eq=False)
class UnseenTest:
    """A test not used for training: observables of the machine, and its states as predicted by each method."""

    observables: FloatArray
    time: FloatArray
    states: Mapping[str, ThermalStates]


class _Points(NamedTuple):
    """Random points of the volume in random rows of a test, with the state of the machine and the model predictions.

    Parameters
    ----------
    now, start : ndarray of shape (n, n_observables)
        Observables of the machine at the time of the row, and at the start of the test.
    points, tools : ndarray of shape (n, 3)
        Points, and vectors to the tool tip [mm].
    full : ndarray of shape (n, n_methods, 3)
        Corrections by all components [um].
    told : ndarray of shape (n, n_methods, 32)
        Predicted components [um, urad].
    lines, begin : ndarray of shape (n, 3)
        Corrections by `DYNAMIC`: by one straight line per axis, and by all components at the start of the test [um].
    """

    now: FloatArray
    start: FloatArray
    points: FloatArray
    tools: FloatArray
    full: FloatArray
    told: FloatArray
    lines: FloatArray
    begin: FloatArray


def predict(learned: LearnedVolume, seed: int) -> list[UnseenTest]:
    """Run experiment ``volumetric-new`` and replay the models of all methods over it."""
    models = {method: VolumetricModel(machine) for method, machine in learned.machines.items()}
    found = []
    for test in simulate(virtual.find_experiment("volumetric-new"), seed=seed, whole=True):
        recording = with_sensors(virtual.make_recording(test))
        table = {c.name: recording.table[c.name].to_numpy() for c in recording.channels}
        states = {method: model.replay(recording.time, table) for method, model in models.items()}
        assert test.observables is not None
        found.append(UnseenTest(test.observables, recording.time, states))
    return found


def left(
    truth: VolumetricTruth,
    start: FloatArray,
    now: FloatArray,
    points: FloatArray,
    tools: FloatArray,
    added: FloatArray | float = 0.0,
) -> FloatArray:
    """Return the error of the tool tip after a correction, with the zero set at the test position at the start.

    Parameters
    ----------
    start, now : ndarray of shape (n_observables,) or (n, n_observables)
        Observables of the machine.
    points, tools : ndarray of shape (n, 3)
        Points, and vectors to the tool tip [mm].
    added : ndarray of shape (n, 3) or 0
        Correction [um].

    Returns
    -------
    ndarray of shape (n, 3)
        [um]
    """
    zero = truth.error(start, np.tile(MIDDLE, (len(points), 1)), tools)
    return np.asarray(truth.error(now, points + 1e-3 * added, tools) - zero + added)


def judge(learned: LearnedVolume, tests: Sequence[UnseenTest], seed: int) -> Volume:
    """Judge compensation at random points of the volume and in random rows of unseen tests (C-35)."""
    rng = np.random.default_rng(seed)
    share = -(-POINTS // len(tests))
    parts = (_points(test, min(share, POINTS - share * k), rng) for k, test in enumerate(tests))
    p = _Points._make(map(np.array, zip(*chain.from_iterable(parts), strict=True)))
    truth, kinematics = VolumetricTruth(MachiningCentre().observables), Kinematics(learned.machines[DYNAMIC])

    def effect(values: FloatArray, codes: Collection[str] = INDEX) -> FloatArray:
        """Return the effect of the errors of some components at the tool points [um]."""
        alone = np.zeros_like(values)
        columns = [INDEX[code] for code in codes]
        alone[:, columns] = values[:, columns]
        return np.vstack([kinematics.synthesize(*each)[0] for each in zip(alone, p.points, p.tools, strict=True)])

    added = {WITHOUT: 0.0 * p.lines} | dict(zip(tests[0].states, p.full.transpose(1, 0, 2), strict=True))
    errors = {name: left(truth, p.start, p.now, p.points, p.tools, c) for name, c in (added | {LINES: p.lines}).items()}
    true = as_measured(truth, p.now, p.start, p.points)
    missed = dict(zip(tests[0].states, true - p.told.transpose(1, 0, 2), strict=True))
    drifts = [c.code for c in COMPONENTS if c.group == "spindle"]
    causes = {
        method: {SPINDLE: effect(m, drifts), AXES_SHARE: effect(m, INDEX.keys() - drifts)}
        for method, m in missed.items()
    }
    by_component = {c.code: rms(np.linalg.norm(effect(missed[DYNAMIC], [c.code]), axis=1)) for c in COMPONENTS}
    return Volume(
        learned=learned,
        errors=errors,
        causes=causes,
        start=left(truth, p.start, p.start, p.points, p.tools, p.begin),
        by_component=by_component,
        closure=float(np.abs(effect(true) - errors[WITHOUT]).max()),
    )


def _points(test: UnseenTest, n: int, rng: np.random.Generator) -> Iterator[tuple[Any, ...]]:
    """Yield the values of `_Points` for each random point."""
    rows = rng.integers(0, len(test.time), n)
    points = rng.uniform(size=(n, 3)) * [TRAVEL[a] for a in AXES]
    tools = np.stack([np.zeros(n), np.zeros(n), -rng.uniform(*TOOLS, n)], axis=-1)
    ours = test.states[DYNAMIC]
    for row, point, tool in zip(rows.tolist(), points, tools, strict=True):
        straight = straight_lines(ours[row], MIDDLE, tool, grid=2).lines
        yield (
            test.observables[row],
            test.observables[0],
            point,
            tool,
            [states[row].correction(point, tool) for states in test.states.values()],
            [states[row].components(point) for states in test.states.values()],
            [line.correction.at(p) for line, p in zip(straight, point.tolist(), strict=True)],
            ours[0].correction(point, tool),
        )


def as_measured(truth: VolumetricTruth, now: FloatArray, start: FloatArray, points: FloatArray) -> FloatArray:
    """Return the true components as measured: lasers zeroed at the test position, and a probe nest there.

    Parameters
    ----------
    now, start : ndarray of shape (n, n_observables)
        Observables of the machine at the time of the row, and when the nest was zeroed.
    points : ndarray of shape (n, 3)
        Points [mm].

    Returns
    -------
    ndarray of shape (n, 32)
        [um, urad]
    """
    middles = np.tile(MIDDLE, (len(points), 1))
    here, there, before = (truth.components(rows, at) for rows, at in ((now, points), (now, middles), (start, middles)))
    values = np.zeros((len(points), len(COMPONENTS)))
    for code, value in here.items():
        group = BY_CODE[code].group
        if group == "squareness":
            values[:, INDEX[code]] = value
        elif group == "axis":
            values[:, INDEX[code]] = value - there[code]
        else:  # the nest measures the sum over all bodies
            bodies = [code, *(f"E{code[0]}{axis}" for axis in "XYZ")]
            values[:, INDEX[code]] = sum(there[body] - before[body] for body in bodies)
    for axis, nearer in NEARER.items():
        k = AXES.index(axis)
        for along in "XYZ":
            way = np.zeros(3)
            way[k] = 1.0
            for turn, arm in swing(along, way):
                for other in nearer:
                    turned = there[f"E{turn}{other.upper()}"]
                    values[:, INDEX[f"E{along}{axis.upper()}"]] += arm * turned * (points[:, k] - MIDDLE[k])
    return values


# -- claims ------------------------------------------------------------------------------------------------------------


claims = Claims[Volume](__name__, setup)


@claims.facts
def _first_order(found: Volume) -> Facts:
    enough = {code: fit.enough for code, fit in found.learned.fits.items()}
    more = {code: m for code, m in enough.items() if m > 1}
    straight = sum(m == 1 for m in enough.values())
    return {
        "straight": straight,
        "fits": len(enough),
        "bent": bool(more),
        "more": more,
        "holds": 2 * straight > len(enough),
    }


@claims.facts
def _bed(found: Volume) -> Facts:
    return {"flat": _off(found.learned.flat), "full": _off(found.learned.fits["EYX"])}


@claims.facts
def _tenfold(found: Volume) -> Facts:
    facts: Facts = {"without": rms(found.sizes[WITHOUT]), "after": _after(found, *PAPERS)}
    facts |= {"best": found.gain(found.closest), "closest": found.closest}
    return facts | _causes(found, found.closest)


@claims.facts
def _ours(found: Volume) -> Facts:
    facts: Facts = {"after": _after(found, *(name for name in METHODS if name not in PAPERS))}
    facts |= {"start": rms(np.linalg.norm(found.start, axis=1))} | _causes(found, DYNAMIC)
    return facts | {"components": {c: e for c, e in found.by_component.items() if e >= 1.0}}


def _after(found: Volume, *methods: str) -> list[tuple[str, float, float, float, float]]:
    return [(name, rms(found.sizes[name]), *found.gains[name]) for name in methods]


def _causes(found: Volume, method: str) -> Facts:
    spindle, axes = (rms(np.linalg.norm(found.causes[method][c], axis=1)) for c in (SPINDLE, AXES_SHARE))
    return {"spindle": spindle, "axes": axes}


@claims.facts
def _lines(found: Volume) -> Facts:
    return {"lines": rms(found.sizes[LINES]), "gain_lines": found.gain(LINES)}


def numbers(found: Volume) -> dict[str, float]:
    """Return the key numbers, which the gallery page checks."""
    made = exhibits.numbers("anywhere", found, gain_lines=found.gain(LINES))
    for name in (*METHODS, LINES):
        short = "lines" if name == LINES else name.lower()
        made |= {f"volume_{short}_um": rms(found.sizes[name]), f"volume_gain_{short}": found.gain(name)}
    return made | {"volume_none_um": rms(found.sizes[WITHOUT])}


# -- tables and figures ------------------------------------------------------------------------------------------------


def tables(found: Volume) -> list[StudyTable]:
    """Return the errors before and after compensation, and source and residual of each component."""
    gains = {WITHOUT: ("", "", "")} | {name: tuple(f"{g:.1f}" for g in g3) for name, g3 in found.gains.items()}
    sizes = [
        (name, Errors.of(size), np.percentile(size, MOST), [rms(e) for e in found.errors[name].T], *gains[name])
        for name, size in found.sizes.items()
    ]
    parts = []
    for c in COMPONENTS:
        fit = found.learned.fits.get(c.code)
        source = found.learned.machines[DYNAMIC].components.get(c.code)
        how = "no model: in the spindle's drifts" if source is None else "constant" if fit is None else ""
        if c.group == "spindle":
            how = "drift"
        made = ("", "", "") if fit is None else (fit.profile.order[0], fit.enough, f"{fit.thermal_rms:.2f}")
        parts.append((c, how, *made, found.by_component[c.code]))
    return [exhibits.table("errors", sizes, points=POINTS), exhibits.table("components", parts)]


def figures(found: Volume) -> list[Figure]:
    """Return the cumulative distribution of the error over the points, before and after."""
    share = 100.0 * np.arange(1, POINTS + 1) / POINTS
    lines = [PlotCurve(name, np.sort(size), share) for name, size in found.sizes.items()]
    return [exhibits.figure("chen1996-volume", lines, points=POINTS)]


def _off(fit: PositionFit) -> float:
    """Return the RMS error of a model of the cold profile of EYX, over the travels of X and Z [um]."""
    x, z = np.meshgrid(*(np.linspace(0.0, TRAVEL[a], 31) for a in "xz"))
    points = np.stack([x.ravel(), np.full(x.size, float(TEST_POSITION["y"])), z.ravel()], axis=-1)
    assert fit.model.profile is not None
    return rms(fit.model.profile.at(points) - find_cold_component("EYX", points))
