"""The bed as a sheet in plane stress on levelling mounts: warmer on top, it crowns and lets the column lean."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from skfem import MeshQuad

from finite_elements.conduction import capacity, conduction, edge, faces, together
from finite_elements.elasticity import Elastic, Tie
from finite_elements.materials import Material
from finite_elements.part import Part, Surface
from finite_elements.space import Space, spot

FloatArray = NDArray[np.float64]

#: radius of the spot of a sensor, a mount or a carriage [m]
_SPOT = 0.12
#: half of the table's guides along Z [m]
_GUIDE = 0.20


@dataclass(frozen=True)
class Bed:
    """A box bed, in the plane z-y; z from its middle (front is -z), y from its underside.

    Parameters
    ----------
    length, height, width : float
        Along z, mounts to top, right to left [m].
    base : float
        Of the underside above the floor [m].
    web, top, bottom : float
        Thickness of side walls and ribs together; of the top plate; of the bottom plate [m].
    mount : float
        Mounts in front of the middle and behind it [m].
    bearing : float
        Bearing of the Z screw behind the middle [m].
    hydraulics : float
        Middle of the hydraulic unit on the rear face, above the middle of the height [m].
    table, foot, shoe : float
        z of the table's middle and of the column's; carriages of the column in front of it and behind it [m].
    cells : tuple of int
        Elements along, and up between the plates.
    """

    length: float
    height: float
    width: float
    base: float
    web: float
    top: float
    bottom: float
    mount: float
    bearing: float
    hydraulics: float
    table: float
    foot: float
    shoe: float
    cells: tuple[int, int] = (28, 5)

    def _surfaces(self, space: Space) -> dict[str, Surface]:
        """Return the surfaces that exchange heat, by name; see `part`."""
        front = self._front()

        def up(x: FloatArray) -> FloatArray:
            return np.asarray(self.base + x[1])

        def surface(where: Callable[[FloatArray], NDArray[np.bool_]]) -> Surface:
            return edge(space, where, height=up, width=self.width)

        return {
            "outside": together(
                faces(space, 2.0, height=up),
                surface(lambda x: np.abs(x[0]) > self.length / 2.0 - 1e-9),
                surface(lambda x: (x[1] > self.height - 1e-9) & (x[0] > front)),
            ),
            "work": surface(lambda x: (x[1] > self.height - 1e-9) & (x[0] < front)),
            "bottom": surface(lambda x: x[1] < 1e-9),
        }

    def part(self, name: str, material: Material, feet: Mapping[int, float] = MappingProxyType({})) -> Part:
        """Cut the bed into finite elements.

        Parameters
        ----------
        feet : mapping of int to float
            z of the column's middle with the Z axis at each position [mm: m].

        Returns
        -------
        Part
            Surfaces: ``outside`` (sides, front, rear, and the top from the column on, to the room), ``work`` (top in
            front of the column, to the work space), ``bottom`` (to the floor). Patches: ``front rear`` (top under table
            and column), ``table shoe_front shoe_rear`` (guides), ``bearing`` (of Z), ``mount_front mount_rear``,
            ``hydraulics``, ``under`` (underside below the table). Observables against the mounts [um, urad]: ``z``
            (bearing of Z away from the table), ``y`` (column's carriages above the table's guides), ``a_foot a_table``
            (tilt about X there), ``foot`` (growth from the column's front carriage to its rear one), ``y_table`` (lift
            of the table's guides), ``yz@P az@P`` (lift and tilt of the column's carriages with Z at P mm).
        """
        space = self.space()

        def top(at: float, radius: float = _SPOT, on: Space = space) -> FloatArray:
            return on.edge_mean(lambda x: x[1] > self.height - 1e-9, spot(0, at, radius))

        def under(at: float, on: Space = space) -> FloatArray:
            return on.edge_mean(lambda x: x[1] < 1e-9, spot(0, at, _SPOT))

        body = Elastic(space, modulus=material.modulus, poisson=material.poisson, expansion=material.expansion)
        sheet = body.space

        def tilt(at: float, half: float) -> FloatArray:
            """Tilt about X between two points of the top: a rise towards the rear is negative."""
            return body.row((top(at - half, on=sheet) - top(at + half, on=sheet)) / (2.0 * half), 1)

        def lift(at: float, half: float) -> FloatArray:
            return body.row((top(at - half, on=sheet) + top(at + half, on=sheet)) / 2.0, 1)

        return Part(
            name,
            capacity(space, material.heat_capacity),
            conduction(space, material.conductivity),
            self._surfaces(space),
            {
                "front": top(self.table),
                "rear": top(self.foot),
                "table": top(self.table, 2.0 * _GUIDE),
                "shoe_front": top(self.foot - self.shoe),
                "shoe_rear": top(self.foot + self.shoe),
                "bearing": top(self.bearing),
                "mount_front": under(-self.mount),
                "mount_rear": under(self.mount),
                "hydraulics": space.edge_mean(
                    lambda x: x[0] > self.length / 2.0 - 1e-9, spot(1, self.height / 2.0 + self.hydraulics, 0.2)
                ),
                "under": under(self.table),
            },
            body.observables(
                {
                    "z": body.row(top(self.bearing, on=sheet) - top(self.table, on=sheet), 0),
                    "y": lift(self.foot, self.shoe) - lift(self.table, _GUIDE),
                    "a_foot": tilt(self.foot, self.shoe),
                    "a_table": tilt(self.table, _GUIDE),
                    "foot": body.row(top(self.foot + self.shoe, on=sheet) - top(self.foot - self.shoe, on=sheet), 0),
                    "y_table": lift(self.table, _GUIDE),
                    **{f"yz@{p}": lift(at, self.shoe) for p, at in feet.items()},
                    **{f"az@{p}": tilt(at, self.shoe) for p, at in feet.items()},
                },
                [
                    Tie(body.row(under(-self.mount, sheet), 1)),
                    Tie(body.row(under(self.mount, sheet), 1)),
                    Tie(body.row(under(0.0, sheet), 0)),
                ],
            ),
        )

    def space(self) -> Space:
        """Return the elements."""
        z = np.linspace(-self.length / 2.0, self.length / 2.0, self.cells[0] + 1)
        # A node where the work space ends.
        z[np.abs(z - self._front()).argmin()] = self._front()
        y = np.linspace(self.bottom, self.height - self.top, self.cells[1] + 1)
        mesh = MeshQuad.init_tensor(z, np.concatenate([[0.0], y, [self.height]]))
        middle = mesh.p[1, mesh.t].mean(axis=0)
        web = (middle > self.bottom) & (middle < self.height - self.top)
        return Space(mesh, np.where(web, self.web, self.width))

    def _front(self) -> float:
        """Return where the work space ends: in front of the column."""
        return self.foot - 2.0 * self.shoe
