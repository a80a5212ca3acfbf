"""Meshes of bodies of revolution made of rectangular blocks (r, z), and how places on them are named."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from skfem import MeshQuad

from finite_elements.materials import Material, material
from thermocomp.core.exceptions import InputError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.integer[Any]]
#: where something is: ``body``, ``r``, ``z``; a coordinate is one number or a range [m]
Box = Mapping[str, Any]

_NEAR = 1e-9


class Blocks:
    """Quadrilaterals that fill rectangular blocks.

    Blocks of one body share their vertices where they touch. Different bodies do not, even where they touch: there a
    contact conducts, or nothing does. All grid lines run through the whole part, so that facets of two bodies
    that touch lie on each other.

    Parameters
    ----------
    blocks : sequence of mapping
        Each with ``body``, ``material``, ``r`` and ``z``: from, to [m].
    size : float
        Of the largest element [m].
    cuts : mapping of str to sequence of float
        Grid lines beside those at the ends of blocks, by axis ``r`` or ``z`` [m]: places end at grid lines only.

    Attributes
    ----------
    materials : list of Material
        One per element.

    Raises
    ------
    InputError
        Two blocks overlap, or a block is empty.
    """

    def __init__(
        self, blocks: Sequence[Box], size: float, cuts: Mapping[str, Sequence[float]] = MappingProxyType({})
    ) -> None:
        for b in blocks:
            if not (0 <= b["r"][0] < b["r"][1] and b["z"][0] < b["z"][1]):
                raise InputError(f"block of body {b['body']}: r {b['r']} or z {b['z']} is empty or negative")
        self._grid = {
            axis: _divide([*(x for b in blocks for x in b[axis]), *cuts.get(axis, ())], size) for axis in "rz"
        }
        r, z = self._grid.values()
        owner = np.full((len(r) - 1, len(z) - 1), -1)
        middle_r, middle_z = (r[1:] + r[:-1]) / 2, (z[1:] + z[:-1]) / 2
        for k, b in enumerate(blocks):
            inside = np.outer(_within(middle_r, b["r"]), _within(middle_z, b["z"]))
            if (owner[inside] >= 0).any():
                raise InputError(f"block of body {b['body']} at r {b['r']}, z {b['z']} overlaps another block")
            owner[inside] = k
        self.bodies = list(dict.fromkeys(b["body"] for b in blocks))
        body_of = np.array([self.bodies.index(b["body"]) for b in blocks])
        points: list[FloatArray] = []
        cells: list[IntArray] = []
        numbers: list[IntArray] = []
        begin = 0
        for body in range(len(self.bodies)):
            i, j = np.nonzero((owner >= 0) & (body_of[owner] == body))
            corners = np.array([i * len(z) + j, (i + 1) * len(z) + j, (i + 1) * len(z) + j + 1, i * len(z) + j + 1])
            used, local = np.unique(corners, return_inverse=True)
            points.append(np.array([r[used // len(z)], z[used % len(z)]]))
            cells.append(local.reshape(corners.shape) + begin)
            numbers.append(owner[i, j])
            begin += len(used)
        self.mesh = MeshQuad(np.hstack(points), np.hstack(cells))
        block = np.concatenate(numbers)
        self.body = body_of[block]
        self.materials: list[Material] = [material(blocks[k]["material"]) for k in block]
        self._middle = self.mesh.p[:, self.mesh.t].mean(axis=1)
        self._facet_middle = self.mesh.p[:, self.mesh.facets].mean(axis=1)
        self._facet_body = self.body[self.mesh.f2t[0]]

    def elements(self, box: Box) -> IntArray:
        """Return the elements of a body within a box."""
        self._uncut(box)
        inside = self.body == self._body(box)
        for axis, x in zip("rz", self._middle, strict=True):
            inside &= _within(x, box[axis])
        return _some(inside, box)

    def line(self, box: Box) -> IntArray:
        """Return the facets of a body on a line: ``r`` or ``z`` is one number, the other a range."""
        self._uncut(box)
        inside = self._facet_body == self._body(box)
        for axis, x, ends in zip("rz", self._facet_middle, self.mesh.p[:, self.mesh.facets], strict=True):
            at = box[axis]
            inside &= (np.abs(ends - at) < _NEAR).all(axis=0) if isinstance(at, float) else _within(x, at)
        return _some(inside, box)

    def _uncut(self, box: Box) -> None:
        for axis, lines in self._grid.items():
            for at in np.atleast_1d(box[axis]):
                if np.abs(lines - at).min() > _NEAR:
                    raise InputError(f"{dict(box)} ends at {axis} = {at:g} inside of elements; name it in cuts")

    def _body(self, box: Box) -> int:
        if box["body"] not in self.bodies:
            raise InputError(f"unknown body {box['body']!r}; there are {', '.join(self.bodies)}")
        return self.bodies.index(box["body"])


def _divide(marks: Sequence[float], size: float) -> FloatArray:
    """Return the marks, and between them as few equal divisions as keep to a size."""
    ends = np.unique(np.round(marks, 9))
    steps = np.ceil(np.diff(ends) / size - _NEAR).astype(int)
    inner = [np.linspace(a, b, n + 1)[:-1] for a, b, n in zip(ends[:-1], ends[1:], steps, strict=True)]
    return np.concatenate([*inner, ends[-1:]])


def _within(x: FloatArray, span: Sequence[float]) -> NDArray[np.bool_]:
    return np.asarray((x > span[0] - _NEAR) & (x < span[1] + _NEAR))


def _some(inside: NDArray[np.bool_], box: Box) -> IntArray:
    found = np.nonzero(inside)[0]
    if not found.size:
        raise InputError(f"nothing of the part is at {dict(box)}")
    return found
