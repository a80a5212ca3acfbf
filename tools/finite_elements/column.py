"""The column as two sheets in plane stress, heated from one side: it grows, bends, twists and leans."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from skfem import MeshQuad

from finite_elements.conduction import capacity, conduction, contact, edge, faces, together
from finite_elements.elasticity import Elastic, Tie
from finite_elements.materials import Material
from finite_elements.part import Part, Surface
from finite_elements.space import Space, spot

FloatArray = NDArray[np.float64]

#: where each sheet lies in the plane of the mesh [m]
_SHEETS = {"right": 0.0, "left": 10.0}
#: radius of the spot of a sensor or a carriage [m]
_SPOT = 0.10


@dataclass(frozen=True)
class Column:
    """A box column on four carriages, its right and left walls as sheets in the plane z-y.

    The edges of each sheet are thick: they carry half of the front wall, and half of the rear wall. Front is -z.

    Parameters
    ----------
    depth, height, width : float
        Front to rear, foot to top, right to left [m].
    base : float
        Of the foot above the floor [m].
    side_wall, front_wall, rear_wall : float
        Thickness [m].
    shoe : float
        Carriages of Z in front of the middle of the foot and behind it [m].
    bearing : float
        Bearing of the Y screw above the foot, at the front wall [m].
    carriage : float
        Carriages of the headstock above and below their middle [m].
    first, test : float
        Middle of the headstock's carriages above the foot at Y = 0, and in the tests [m].
    sensors : tuple of float
        Of the lower and of the upper sensors above the foot [m].
    cabinet : float
        Middle of the electric cabinet above the foot [m].
    cells : tuple of int
        Elements of a side wall from front to rear, and from the foot to the top.
    """

    depth: float
    height: float
    width: float
    base: float
    side_wall: float
    front_wall: float
    rear_wall: float
    shoe: float
    bearing: float
    carriage: float
    first: float
    test: float
    sensors: tuple[float, float]
    cabinet: float
    cells: tuple[int, int] = (8, 32)

    def part(self, name: str, material: Material, positions: tuple[int, ...] = ()) -> Part:
        """Cut the column into finite elements.

        Parameters
        ----------
        positions : tuple of int
            Positions of Y at which the guide's shape is wanted [mm].

        Returns
        -------
        Part
            Surfaces: ``outside`` (walls, to the room), ``front_low`` (front wall below the headstock's travel, to the
            work space), ``inside`` (to the air in the box). Patches, each with ``_right`` and ``_left``: ``front rear
            front_low rear_low`` (spots of sensors), ``guide`` (where the headstock is), ``shoe_front shoe_rear foot``
            (carriages of Z; both), ``bearing`` (of Y), ``cabinet`` (rear wall). Observables [um, urad] against the
            carriages of Z and the nut of Z between them: at the headstock's guide ``z a`` (bending, tilt about X: mean
            of the sheets) and ``x c b`` (bending to the right, roll about Z, yaw about Y), ``lift`` (the bearing of Y),
            ``foot`` (growth from the front carriage to the rear one), ``zy@P ay@P xy@P by@P cy@P`` (``z a x b c`` with
            the headstock at Y = P mm).

        Notes
        -----
        The sheets expand freely of each other. What they do alike is what the box does: bending in the plane z-y. What
        they do unlike bends the box across its width as a beam: with u the lift of a section (mean over the sheet's
        section), roll is ``c(y) = (u_right - u_left) / width`` and the bending to the right ``-int_0^y c``; this leaves
        out the shear of the front and the rear wall. Yaw is the difference of the guides' z over the width.

        Heat passes between the sheets through the front and the rear wall, from the middle of one half to the middle
        of the other: half the width.
        """
        space = self.space()
        half = self.width / 2.0
        joined = conduction(space, material.conductivity)
        for wall, thickness in (("front", self.front_wall), ("rear", self.rear_wall)):
            through = material.conductivity * thickness / half**2
            first, last = (self._edge(wall, s, space) for s in ("right", "left"))
            joined += contact(space, first, last, through, (_SHEETS["left"], 0.0))

        def up(x: FloatArray) -> FloatArray:
            return np.asarray(self.base + x[1])

        def right(x: FloatArray) -> FloatArray:
            return np.where(x[0] < _SHEETS["left"] / 2.0, half, -half)

        def walls(where: str, span: tuple[float, float] = (0.0, np.inf)) -> Surface:
            """Return both halves of a wall; the middle of each is half as far to the side as the sheets."""
            edges = [self._edge(where, s, space, span) for s in _SHEETS]
            return together(*(edge(space, e, height=up, side=lambda x: right(x) / 2.0, width=half) for e in edges))

        below = self.first - self.carriage
        sheets = (np.asarray(space.section) < half).astype(float)
        return Part(
            name,
            capacity(space, material.heat_capacity),
            joined,
            {
                "outside": together(
                    faces(space, 1.0, height=up, side=right), walls("front", (below, np.inf)), walls("rear")
                ),
                "front_low": walls("front", (0.0, below)),
                "inside": together(
                    faces(space, sheets, height=up, side=right), walls("front_inside"), walls("rear_inside")
                ),
            },
            self._patches(space),
            self._displaced(space, material, positions),
        )

    def _patches(self, space: Space) -> dict[str, FloatArray]:
        spots = {
            "front": ("front", self.sensors[1], _SPOT),
            "front_low": ("front", self.sensors[0], _SPOT),
            "rear": ("rear", self.sensors[1], _SPOT),
            "rear_low": ("rear", self.sensors[0], _SPOT),
            "guide": ("front", self.test, 2.0 * self.carriage),
            "bearing": ("front", self.bearing, _SPOT),
            "cabinet": ("rear", self.cabinet, 4.0 * _SPOT),
        }
        patches = {}
        for s in _SHEETS:
            for patch, (wall, at, radius) in spots.items():
                patches[f"{patch}_{s}"] = space.edge_mean(self._edge(wall, s, space), spot(1, at, radius))
            front, rear = (self._shoe(s, at, space) for at in (-self.shoe, self.shoe))
            patches |= {f"shoe_front_{s}": front, f"shoe_rear_{s}": rear, f"foot_{s}": (front + rear) / 2.0}
        return patches

    def space(self) -> Space:
        """Return the elements: the right sheet at its z, the left one 10 m beside it."""
        z, rear = -self.depth / 2.0, self.depth / 2.0
        across = np.linspace(z + self.front_wall, rear - self.rear_wall, self.cells[0] + 1)
        # A node where the work space ends.
        below = self.first - self.carriage
        low = max(1, round(self.cells[1] * below / self.height))
        up = np.concatenate(
            [np.linspace(0.0, below, low + 1), np.linspace(below, self.height, self.cells[1] - low + 1)[1:]]
        )
        sheet = MeshQuad.init_tensor(np.concatenate([[z], across, [rear]]), up)
        beside = sheet.p + np.array([[_SHEETS["left"]], [0.0]])
        mesh = MeshQuad(np.hstack([sheet.p, beside]), np.hstack([sheet.t, sheet.t + sheet.nvertices]))
        middle = mesh.p[0, mesh.t].mean(axis=0)
        middle = np.where(middle > _SHEETS["left"] / 2.0, middle - _SHEETS["left"], middle)
        side = (middle > z + self.front_wall) & (middle < rear - self.rear_wall)
        return Space(mesh, np.where(side, self.side_wall, self.width / 2.0))

    def _edge(
        self, wall: str, side: str, space: Space, span: tuple[float, float] = (0.0, np.inf)
    ) -> NDArray[np.integer[Any]]:
        """Return the facets of a wall on one sheet, from one height to another."""
        at = {
            "front": -self.depth / 2.0,
            "front_inside": self.front_wall - self.depth / 2.0,
            "rear": self.depth / 2.0,
            "rear_inside": self.depth / 2.0 - self.rear_wall,
        }[wall] + _SHEETS[side]
        low, high = span
        return np.asarray(
            space.mesh.facets_satisfying(lambda x: (np.abs(x[0] - at) < 1e-9) & (x[1] > low) & (x[1] < high))
        )

    def _shoe(self, side: str, at: float, space: Space) -> FloatArray:
        """Return the row that averages over a carriage under a sheet's foot, this far behind its middle."""
        foot = space.mesh.facets_satisfying(
            lambda x: (np.abs(x[1]) < 1e-9) & (np.abs(x[0] - _SHEETS[side]) < self.depth), boundaries_only=True
        )
        # The foot is a flange all along: the thickness of the walls above it is no weight.
        row = space.edge_load(foot, spot(0, _SHEETS[side] + at, _SPOT), width=1.0)
        return np.asarray(row / row.sum())

    def _displaced(self, space: Space, material: Material, positions: tuple[int, ...]) -> dict[str, FloatArray]:
        """Return the observables."""
        body = Elastic(space, modulus=material.modulus, poisson=material.poisson, expansion=material.expansion)
        sheet = body.space
        section = float(sheet.load().sum()) / 2.0 / self.height

        def front(side: str, at: float) -> FloatArray:
            return sheet.edge_mean(self._edge("front", side, sheet), spot(1, at, _SPOT))

        def guide(side: str, at: float) -> tuple[FloatArray, FloatArray]:
            """Return z: mean of the upper and the lower carriage, and upper minus lower over their distance."""
            high, low = (body.row(front(side, at + d), 0) for d in (self.carriage, -self.carriage))
            return (high + low) / 2.0, (high - low) / (2.0 * self.carriage)

        def on(side: str) -> Callable[[FloatArray], FloatArray]:
            return lambda x: (np.abs(x[0] - _SHEETS[side]) < self.depth).astype(float)

        def both(of: Callable[[str], FloatArray]) -> FloatArray:
            return (of("right") + of("left")) / 2.0

        def unlike(of: Callable[[str], FloatArray]) -> FloatArray:
            return (of("right") - of("left")) / self.width

        cell = self.height / self.cells[1]

        def lifted(side: str, weight: Callable[[FloatArray], FloatArray]) -> FloatArray:
            """Return the lift of the sections, integrated up the sheet with a weight."""
            return body.row(sheet.load(lambda x: on(side)(x) * weight(x)) / section, 1)

        def roll(at: float) -> FloatArray:
            near = spot(1, at, 2.0 * cell)
            return unlike(lambda s: lifted(s, lambda x: near(x) / (2.0 * cell)))

        def aside(at: float) -> FloatArray:
            # The step at that height is spread over an element: a jump within an element cannot be integrated.
            return -unlike(lambda s: lifted(s, lambda x: np.clip((at - x[1]) / cell + 0.5, 0.0, 1.0)))

        rows = {
            "z": both(lambda s: guide(s, self.test)[0]),
            "a": both(lambda s: guide(s, self.test)[1]),
            "b": -unlike(lambda s: guide(s, self.test)[0]),
            "c": roll(self.test),
            "x": aside(self.test),
            "lift": both(lambda s: body.row(front(s, self.bearing), 1)),
            "foot": both(lambda s: body.row(self._shoe(s, self.shoe, sheet) - self._shoe(s, -self.shoe, sheet), 0)),
        }
        for p in positions:
            at = self.first + p / 1000.0
            (right, tilt_right), (left, tilt_left) = (guide(s, at) for s in _SHEETS)
            rows[f"zy@{p}"] = (right + left) / 2.0
            rows[f"ay@{p}"] = (tilt_right + tilt_left) / 2.0
            rows[f"xy@{p}"], rows[f"cy@{p}"] = aside(at), roll(at)
            rows[f"by@{p}"] = -(right - left) / self.width
        ties = []
        for s in _SHEETS:
            ties += [Tie(body.row(self._shoe(s, at, sheet), 1)) for at in (self.shoe, -self.shoe)]
            ties.append(Tie(body.row(self._shoe(s, 0.0, sheet), 0)))
        return body.observables(rows, ties)
