"""Chen, Yuan, Ni 1996, conclusion 5: inspection of a milled part on a coordinate measuring machine (C-37).

A part is milled on the virtual machining centre in many thermal states, without compensation and with that of each
method, and is then measured point by point. The protocol is in decision 16.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from thermocomp.papers.chen1996.anywhere import WITHOUT, UnseenTest, left
from thermocomp.papers.chen1996.setup import DEPTH, LATERAL, exhibits
from thermocomp.papers.chen1996.volume import PAPERS
from thermocomp.papers.claims import Claims, Facts
from thermocomp.papers.study import FloatArray, StudyTable
from thermocomp.virtual.centre import MachiningCentre
from thermocomp.virtual.volume import VolumetricTruth

#: vector from the spindle's gauge point to the tip of the end mill [mm]
TOOL = (0.0, 0.0, -100.0)
#: places of walls and floors: two rows along Y, on both sides of the table [mm]
PLACES = np.array([[x, y, 250.0] for x in (150.0, 450.0) for y in (50.0, 500.0)])
#: points probed on each surface, from its place [mm]
PROBED = np.array([[0.0, 0.0, 0.0], [8.0, 8.0, 0.0], [8.0, -8.0, 0.0], [-8.0, 8.0, 0.0], [-8.0, -8.0, 0.0]])
#: interval between the millings [s]
HOURLY = 3600.0
#: standard uncertainty of a probed point [um]: uniform within a maximum permissible error of 1.5 um
POINT = 1.5 / np.sqrt(3.0)
#: standard deviation of the scale of the measuring machine [um/mm]: uniform within 3 um/m
SCALE = 3e-3 / np.sqrt(3.0)


@dataclass(frozen=True, eq=False)
class Part:
    """Errors of the dimensions of all parts, as measured.

    Parameters
    ----------
    lengths : mapping of str to ndarray of shape (n_millings, 2)
        Distances along Y of two walls milled in the same hour, minus nominal, by type of compensation [um].
    depths : mapping of str to ndarray of shape (n_millings, 4)
        Heights of the floors above the floor milled at the start of the test, minus nominal [um].
    true : mapping of str to (float, float)
        Largest magnitudes of the true errors of length and depth [um].
    """

    lengths: Mapping[str, FloatArray]
    depths: Mapping[str, FloatArray]
    true: Mapping[str, tuple[float, float]]

    @cached_property
    def largest(self) -> dict[str, tuple[float, float]]:
        """Largest magnitudes of the errors of length and depth, by type of compensation [um]."""
        return _largest(self.lengths, self.depths)

    def gain(self, name: str) -> tuple[float, float]:
        """Return the factors by which a method reduces the largest error of length and of depth."""
        (length, depth), (length_after, depth_after) = self.largest[WITHOUT], self.largest[name]
        return length / length_after, depth / depth_after


def inspect(tests: Sequence[UnseenTest], seed: int) -> Part:
    """Mill a part in each of the tests, and measure it.

    Parameters
    ----------
    tests : sequence of UnseenTest
        Machine and predictions of each method.
    seed : int
        Seed of the errors of the measuring machine.
    """
    rng = np.random.default_rng(seed)
    names = (WITHOUT, *tests[0].states)
    measured, true = [], []
    for test in tests:
        rows = [0, *np.flatnonzero(np.diff(test.time // HOURLY, prepend=0.0)).tolist()]
        parts = [mill(test, name, rows) for name in names]
        true.append(np.stack([milled.mean(axis=2) for milled in parts]))
        measured.append(np.stack([measure(milled, rng) for milled in parts]))
    lengths, depths = _dimensions(names, measured)
    return Part(lengths=lengths, depths=depths, true=_largest(*_dimensions(names, true)))


def _dimensions(
    names: Sequence[str], parts: Sequence[FloatArray]
) -> tuple[dict[str, FloatArray], dict[str, FloatArray]]:
    """Return the errors of lengths and depths from surfaces of shape (n_names, n_rows, n_places, 3), one per day."""
    lengths = np.concatenate([p[:, 1:, 1::2, 1] - p[:, 1:, ::2, 1] for p in parts], axis=1)
    depths = np.concatenate([p[:, 1:, :, 2] - p[:, :1, :1, 2] for p in parts], axis=1)
    return dict(zip(names, lengths, strict=True)), dict(zip(names, depths, strict=True))


def _largest(lengths: Mapping[str, FloatArray], depths: Mapping[str, FloatArray]) -> dict[str, tuple[float, float]]:
    return {name: (float(np.abs(e).max()), float(np.abs(depths[name]).max())) for name, e in lengths.items()}


def mill(test: UnseenTest, name: str, rows: Sequence[int]) -> FloatArray:
    """Return the deviations of all surfaces from the drawing, with or without the compensation of a method.

    Parameters
    ----------
    rows : sequence of int
        Rows of the test at which the surfaces at all places are milled; the zero is set in the first row of the test.

    Returns
    -------
    ndarray of shape (n_rows, n_places, n_probed, 3)
        Of each point [um].
    """
    truth = VolumetricTruth(MachiningCentre().observables)
    points = (PLACES[:, None] + PROBED).reshape(-1, 3)
    tools = np.tile(TOOL, (len(points), 1))
    milled = []
    for row in rows:
        added = 0.0 if name == WITHOUT else test.states[name][row].correction(points, TOOL)
        milled.append(left(truth, test.observables[0], test.observables[row], points, tools, added))
    return np.reshape(milled, (len(rows), len(PLACES), len(PROBED), 3))


def measure(milled: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return the deviations of surfaces as measured point by point: the mean over the points of each.

    Parameters
    ----------
    milled : ndarray of shape (n_rows, n_places, n_probed, 3)
        [um]

    Returns
    -------
    ndarray of shape (n_rows, n_places, 3)
        In Y: of the wall; in Z: of the floor [um].
    """
    scale = rng.normal(0.0, SCALE)
    probed = milled + rng.normal(0.0, POINT, milled.shape) + scale * PLACES[:, None]
    return np.asarray(probed.mean(axis=2))


def uncertainty(length: float) -> float:
    """Return the standard uncertainty of a measured distance [um] of nominal length [mm]."""
    return float(np.hypot(POINT * np.sqrt(2.0 / len(PROBED)), SCALE * length))


# -- claims ------------------------------------------------------------------------------------------------------------


claims = Claims[Part](__name__)


def _judged(found: Part, which: int) -> Facts:
    gains = {name: found.gain(name)[which] for name in found.lengths if name != WITHOUT}
    best = max(PAPERS, key=gains.__getitem__)
    true, none = found.true[best][which], found.true[WITHOUT][which]
    facts: Facts = {"none": found.largest[WITHOUT][which], "best": gains[best], "closest": best, "beyond": True}
    facts |= {"after": [(name, found.largest[name][which], gain) for name, gain in gains.items()]}
    return facts | {"true": true, "times": none / true if true else np.inf, "most": max(gains.values())}


@claims.facts
def _lateral(found: Part) -> Facts:
    return _judged(found, 0) | {"uncertainty": uncertainty(float(np.ptp(PLACES[:, 1])))}


@claims.facts
def _depth(found: Part) -> Facts:
    return _judged(found, 1) | {"uncertainty": uncertainty(0.0)}


def numbers(found: Part) -> dict[str, float]:
    """Return the key numbers: largest errors of length and depth by method [um]."""
    made: dict[str, float] = {}
    for name, (length, depth) in found.largest.items():
        short = "none" if name == WITHOUT else name.lower()
        made |= {f"part_length_{short}_um": length, f"part_depth_{short}_um": depth}
    return made


def tables(found: Part) -> list[StudyTable]:
    """Return the errors of length and depth before and after compensation, the paper's numbers in the last row."""
    rows = []
    for name, (length, depth) in found.largest.items():
        rms = [float(np.sqrt(np.mean(of[name] ** 2))) for of in (found.lengths, found.depths)]
        gain = found.gain(name) if name != WITHOUT else None
        told = [f"{g:.1f}" for g in gain] if gain else ["", ""]
        rows.append((name, f"{rms[0]:.1f}", f"{length:.1f}", told[0], f"{rms[1]:.1f}", f"{depth:.1f}", told[1]))
    rows.append(("the paper", "", "92.4 -> 7.2", f"{LATERAL:.1f}", "", "196 -> 8", f"{DEPTH:.1f}"))
    return [exhibits.table("part", rows, millings=len(found.lengths[WITHOUT]))]
