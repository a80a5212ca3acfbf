"""A ball screw as a bar: heat from a nut that travels, expansion from the fixed bearing."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from skfem import MeshLine

from finite_elements.conduction import capacity, conduction, faces
from finite_elements.materials import Material
from finite_elements.part import Part
from finite_elements.space import Space
from thermocomp.core.exceptions import InputError
from thermocomp.virtual.axes import N_HATS

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Screw:
    """A ball screw with a fixed bearing at one end and a floating one at the other.

    Parameters
    ----------
    diameter, length : float
        [m]
    nut : tuple of float
        From the fixed bearing to the nut at the start of the travel, and at its end [m].
    height, side : float
        Of the air round it [m].
    cells : int
        Elements along, at least.
    """

    diameter: float
    length: float
    nut: tuple[float, float]
    height: float = 1.2
    side: float = 0.0
    cells: int = 60

    def distance(self, position: float) -> float:
        """Return how far from the fixed bearing the nut is [m] at a position of the axis [mm]."""
        return self.nut[0] + position / 1000.0 * float(np.sign(self.nut[1] - self.nut[0]))

    def part(self, name: str, material: Material, positions: tuple[int, ...] = ()) -> Part:
        """Cut the screw into finite elements.

        Parameters
        ----------
        positions : tuple of int
            Positions of the axis at which the expansion is wanted [mm].

        Returns
        -------
        Part
            Surfaces ``air`` (all) and ``nut`` (where the nut travels); patches ``bearing``, ``end``, ``middle`` (mean
            over the travel) and ``hat_0`` ... ``hat_6`` (from the start of the travel to its end); observables
            ``at@P``: how far the point at which the nut is at P mm moves away from the fixed bearing. Nothing holds
            the far end: that is the integral of ``alpha (T - 20 degC)``.
        """
        first, last = sorted(self.nut)
        if not 0.0 <= first < last <= self.length:
            raise InputError(f"screw {name}: nut from {first} to {last} m is not within the length of {self.length} m")
        hats = np.linspace(*self.nut, N_HATS)
        reached = [self.distance(p) for p in positions]
        # A node where anything begins or ends: then all integrals are exact.
        marks = np.unique(np.round([0.0, *hats, *reached, self.length], 9))
        nodes = np.unique(
            np.concatenate(
                [np.linspace(a, b, 1 + max(1, round((b - a) / self.length * self.cells))) for a, b in pairwise(marks)]
            )
        )
        section = np.pi / 4.0 * self.diameter**2
        space = Space(MeshLine(nodes), section)
        middle = (nodes[1:] + nodes[:-1]) / 2.0
        travelled = ((middle > first) & (middle < last)).astype(float)
        around = np.pi * self.diameter
        air = faces(space, around, height=self.height, side=self.side)
        strain = 1e6 * material.expansion / section

        def hat(at: float) -> Callable[[FloatArray], FloatArray]:
            width = (last - first) / (N_HATS - 1)
            return lambda x: np.maximum(0.0, 1.0 - np.abs(x[0] - at) / width) * (x[0] > first) * (x[0] < last)

        return Part(
            name,
            capacity(space, material.heat_capacity),
            conduction(space, material.conductivity),
            {"air": air, "nut": faces(space, around * travelled)},
            {
                "bearing": space.edge_mean(lambda x: x[0] < 1e-9),
                "end": space.edge_mean(lambda x: x[0] > self.length - 1e-9),
                "middle": space.mean(travelled),
                **{f"hat_{k}": space.mean(hat(at)) for k, at in enumerate(hats)},
            },
            {
                f"at@{p}": strain * space.load((middle < d).astype(float))
                for p, d in zip(positions, reached, strict=True)
            },
        )
