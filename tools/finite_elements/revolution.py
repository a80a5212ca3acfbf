"""Bodies of revolution from a table of blocks, contacts, surfaces and places, as in ``data/spindle.toml``.

Coordinates are the radius r and z along the axis [m]. A place is one table, or several whose mean is taken:

- ``r`` and ``z`` ranges: the mean over that volume of the body,
- one of them a number: the mean over that line on the body,
- both numbers and a ``radius``: the neighbourhood of that point, such as that of a sensor.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from finite_elements.blocks import Blocks, Box
from finite_elements.conduction import capacity, conduction, contact, edge, together
from finite_elements.elasticity import Elastic, Tie
from finite_elements.part import Part
from finite_elements.space import Space, Weight

FloatArray = NDArray[np.float64]
Table = Mapping[str, Any]


class Revolution:
    """A part of several bodies of revolution with a common axis.

    Parameters
    ----------
    table : mapping
        ``size`` of the largest element [m]; ``height`` of the origin above the floor [m], and whether the axis is
        ``upright``; ``cuts`` where places end within blocks; lists ``block`` (see
        `finite_elements.blocks.Blocks`) and ``contact`` (``a``, ``b``, where, ``conductance`` [W/(m2 K)],
        ``rotation``: what full speed adds to it, ``stiffness`` along r and z [N/m3]; ``name``: see `with_joints`);
        mappings ``surface``, ``patch``, ``support`` and ``observable``.

    Attributes
    ----------
    space : Space
        Of the temperatures.
    """

    def __init__(self, table: Table) -> None:
        self._table = table
        self.blocks = Blocks(table["block"], table["size"], table.get("cuts", {}))
        self.space = Space(self.blocks.mesh, None, table.get("degree", 2))

    def part(self, name: str) -> Part:
        """Return the matrices, and what the temperatures displace."""
        space, table = self.space, self._table
        of = self.blocks.materials
        inner, switched = conduction(space, [m.conductivity for m in of]), csr_matrix((space.n, space.n))
        for c in table.get("contact", ()):
            joint = contact(space, *self._sides(c), 1.0)
            inner, switched = inner + c["conductance"] * joint, switched + c.get("rotation", 0.0) * joint
        base = float(table["height"])
        height: Weight = (lambda x: base + x[1]) if table.get("upright") else base
        surfaces = {
            k: together(*(edge(space, self.blocks.line(b), height=height) for b in boxes))
            for k, boxes in table["surface"].items()
        }
        patches = {k: self.place(space, boxes) for k, boxes in table["patch"].items()}
        return Part(
            name,
            capacity(space, [m.heat_capacity for m in of]),
            inner,
            surfaces,
            patches,
            self._observables(),
            {"rotation": switched} if switched.nnz else {},
        )

    def place(self, space: Space, boxes: Box | Sequence[Box]) -> FloatArray:
        """Return the row that averages over a place, of shape (space.n,)."""
        several = [boxes] if isinstance(boxes, Mapping) else list(boxes)
        return np.asarray(np.mean([self._mean(space, b) for b in several], axis=0))

    def _mean(self, space: Space, box: Box) -> FloatArray:
        lines = [axis for axis in "rz" if isinstance(box[axis], float)]
        if len(lines) == 1:
            return space.edge_mean(self.blocks.line(box))
        weight = np.zeros(space.mesh.nelements)
        if not lines:
            weight[self.blocks.elements(box)] = 1.0
            return space.mean(weight)
        # round a point, on its own body only
        weight[self.blocks.body == self.blocks.bodies.index(box["body"])] = 1.0
        return space.around((box["r"], box["z"]), box["radius"], weight)

    def _sides(self, joint: Table) -> tuple[NDArray[np.integer[Any]], NDArray[np.integer[Any]]]:
        first, second = (self.blocks.line({**joint, "body": joint[side]}) for side in "ab")
        return first, second

    def _observables(self) -> dict[str, FloatArray]:
        of, table = self.blocks.materials, self._table
        elastic = Elastic(
            self.space,
            modulus=[m.modulus for m in of],
            poisson=[m.poisson for m in of],
            expansion=[m.expansion for m in of],
        )
        joints = [elastic.contact(*self._sides(c), c["stiffness"]) for c in table.get("contact", ())]
        row = _rows(self, elastic)
        ties = [Tie(row(s), s.get("stiffness", np.inf)) for s in table["support"].values()]
        return elastic.observables({k: row(o) for k, o in table["observable"].items()}, ties, joints)


def with_joints(table: Table) -> dict[str, Any]:
    """Return a table in which both sides of every contact with a ``name`` are patches, ``name_a`` and ``name_b``."""
    named = [c for c in table["contact"] if "name" in c]
    sides = {f"{c['name']}_{s}": {"body": c[s], "r": c["r"], "z": c["z"]} for c in named for s in "ab"}
    return {**table, "patch": {**table["patch"], **sides}}


def _rows(revolution: Revolution, elastic: Elastic) -> Callable[[Table], FloatArray]:
    """Return what turns a table {direction, of, minus} into a combination of displacements."""

    def row(table: Table) -> FloatArray:
        weights = revolution.place(elastic.space, table["of"])
        if "minus" in table:
            weights = weights - revolution.place(elastic.space, table["minus"])
        return elastic.row(weights, "rz".index(table["direction"]))

    return row
