"""Chen, Yuan, Ni 1996, headline: compensation of the error anywhere in the work volume.

The synthesis itself is in ref. 6 of the paper; here that of `thermocomp.volumetric` is used. The compensation is judged
by `thermocomp.virtual.volume`, which models the machine independently of that synthesis.
"""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from thermocomp.core.components import BY_CODE, COMPONENTS
from thermocomp.papers.chen1996.setup import TENFOLD, exhibits
from thermocomp.papers.chen1996.volume import LearnedVolume
from thermocomp.papers.claims import Claims, Facts
from thermocomp.papers.common import Errors, rms
from thermocomp.papers.study import Figure, FloatArray, PlotCurve, StudyTable
from thermocomp.runtime.geometry.kinematics import INDEX, Kinematics
from thermocomp.runtime.geometry.straight import straight_lines
from thermocomp.runtime.geometry.volumetric import VolumetricModel
from thermocomp.virtual import datasets as virtual
from thermocomp.virtual.axes import AXES, TEST_POSITION, TRAVEL
from thermocomp.virtual.centre import MachiningCentre
from thermocomp.virtual.experiments import SimulatedTest, simulate
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
WITHOUT, WITH, LINES = "no compensation", "all components", "one straight line per axis"
#: causes of the residual
SPINDLE, AXES_SHARE, START = "drift of the tool point at rest", "axes", "start of a test"
MIDDLE = tuple(float(TEST_POSITION[a]) for a in AXES)
#: shortest and longest tool [mm]
TOOLS = (60.0, 300.0)


@dataclass(frozen=True, eq=False)
class Volume:
    """Residuals after compensation at random points of the work volume, in random thermal states of unseen tests.

    Parameters
    ----------
    errors : mapping of str to ndarray of shape (n, 3)
        Errors by type of compensation [um].
    causes : mapping of str to ndarray of shape (n, 3)
        Residuals after compensation with all components, by cause, including the error at the start of the test [um].
    by_component : mapping of str to float
        RMS effect of the error of each component on the tool point [um].
    closure : float
        Largest difference between the first-order error from the true components and the true error [um].
    """

    learned: LearnedVolume
    errors: Mapping[str, FloatArray]
    causes: Mapping[str, FloatArray]
    by_component: Mapping[str, float]
    closure: float

    @cached_property
    def sizes(self) -> dict[str, FloatArray]:
        """Lengths of the error vectors by type of compensation, each of shape (n,) [um]."""
        return {name: np.linalg.norm(e, axis=1) for name, e in self.errors.items()}

    def gain(self, what: str = WITH) -> float:
        """Return the factor by which a type of compensation reduces the RMS error."""
        return rms(self.sizes[WITHOUT]) / rms(self.sizes[what])


class _Points(NamedTuple):
    """Random points of the volume in random rows of a test, with the state of the machine and the model predictions.

    Parameters
    ----------
    now, start : ndarray of shape (n, n_observables)
        Observables of the machine at the time of the row, and at the start of the test.
    points, tools : ndarray of shape (n, 3)
        Points, and vectors to the tool tip [mm].
    told : ndarray of shape (n, 32)
        Predicted components [um, urad].
    full, lines, begin : ndarray of shape (n, 3)
        Corrections: by all components, by one straight line per axis, and by all components at the start of the test
        [um].
    """

    now: FloatArray
    start: FloatArray
    points: FloatArray
    tools: FloatArray
    told: FloatArray
    full: FloatArray
    lines: FloatArray
    begin: FloatArray


def judge(learned: LearnedVolume, seed: int) -> Volume:
    """Judge compensation in experiment ``volumetric-new`` at random points of the volume and in random rows."""
    rng = np.random.default_rng(seed)
    tests = list(simulate(virtual.find_experiment("volumetric-new"), seed=seed, whole=True))
    share = -(-POINTS // len(tests))
    parts = (_points(learned, test, min(share, POINTS - share * k), rng) for k, test in enumerate(tests))
    p = _Points._make(map(np.array, zip(*chain.from_iterable(parts), strict=True)))
    truth, kinematics = VolumetricTruth(MachiningCentre().observables), Kinematics(learned.machine)

    def effect(values: FloatArray, codes: Collection[str] = INDEX) -> FloatArray:
        """Return the effect of the errors of some components at the tool points [um]."""
        alone = np.zeros_like(values)
        columns = [INDEX[code] for code in codes]
        alone[:, columns] = values[:, columns]
        return np.vstack([kinematics.synthesize(*each)[0] for each in zip(alone, p.points, p.tools, strict=True)])

    # the zero was set at the test position with this tool, at the start of the test
    zero = truth.error(p.start, np.tile(MIDDLE, (POINTS, 1)), p.tools)
    errors = {
        name: truth.error(p.now, p.points + 1e-3 * added, p.tools) - zero + added
        for name, added in ((WITHOUT, np.zeros((POINTS, 3))), (LINES, p.lines), (WITH, p.full))
    }
    true = as_measured(truth, p.now, p.start, p.points)
    missed = true - p.told
    drifts = [c.code for c in COMPONENTS if c.group == "spindle"]
    causes = {
        SPINDLE: effect(missed, drifts),
        AXES_SHARE: effect(missed, INDEX.keys() - drifts),
        START: truth.error(p.start, p.points + 1e-3 * p.begin, p.tools) - zero + p.begin,
    }
    by_component = {c.code: rms(np.linalg.norm(effect(missed, [c.code]), axis=1)) for c in COMPONENTS}
    return Volume(
        learned=learned,
        errors=errors,
        causes=causes,
        by_component=by_component,
        closure=float(np.abs(effect(true) - errors[WITHOUT]).max()),
    )


def _points(learned: LearnedVolume, test: SimulatedTest, n: int, rng: np.random.Generator) -> Iterator[tuple[Any, ...]]:
    """Yield the values of `_Points` for each random point."""
    model = VolumetricModel(learned.machine)
    recording = virtual.make_recording(test)
    states = model.replay(recording.time, {name: recording.table[name].to_numpy() for name in model.inputs})
    rows = rng.integers(0, len(recording), n)
    points = rng.uniform(size=(n, 3)) * [TRAVEL[a] for a in AXES]
    tools = np.stack([np.zeros(n), np.zeros(n), -rng.uniform(*TOOLS, n)], axis=-1)
    assert test.observables is not None
    for row, point, tool in zip(rows.tolist(), points, tools, strict=True):
        straight = straight_lines(states[row], MIDDLE, tool, grid=2).lines
        yield (
            test.observables[row],
            test.observables[0],
            point,
            tool,
            states[row].components(point),
            states[row].correction(point, tool),
            [line.correction.at(p) for line, p in zip(straight, point.tolist(), strict=True)],
            states[0].correction(point, tool),
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


claims = Claims[Volume](__name__)


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
    spindle, axes, start = (rms(np.linalg.norm(found.causes[c], axis=1)) for c in (SPINDLE, AXES_SHARE, START))
    ratio = found.sizes[WITHOUT] / found.sizes[WITH]
    facts: Facts = {"without": rms(found.sizes[WITHOUT]), "with": rms(found.sizes[WITH]), "gain_all": found.gain()}
    facts |= {"median": np.median(ratio), "often": np.mean(ratio >= TENFOLD)}
    facts |= {"spindle": spindle, "axes": axes, "start": start}
    return facts | {"components": {c: e for c, e in found.by_component.items() if e >= 1.0}}


@claims.facts
def _lines(found: Volume) -> Facts:
    return {"lines": rms(found.sizes[LINES]), "gain_lines": found.gain(LINES)}


def numbers(found: Volume) -> dict[str, float]:
    """Return the key numbers, which the gallery page checks."""
    sizes = {name: rms(size) for name, size in found.sizes.items()}
    return exhibits.numbers("anywhere", found, gain=found.gain(), gain_lines=found.gain(LINES), rms=sizes)


# -- tables and figures ------------------------------------------------------------------------------------------------


def tables(found: Volume) -> list[StudyTable]:
    """Return the errors before and after compensation, and source and residual of each component."""
    sizes = [
        (name, Errors.of(size), np.percentile(size, MOST), [rms(e) for e in found.errors[name].T])
        for name, size in found.sizes.items()
    ]
    parts = []
    for c in COMPONENTS:
        fit = found.learned.fits.get(c.code)
        source = found.learned.machine.components.get(c.code)
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
