"""Scalar error components from displacements measured between bodies of a machine (Chen 1996, section 2; C-01).

At the tool point the six shifts of the axes' references add up with the drift of the spindle, equally everywhere: no
measurement between table and tool can tell them apart, at however many positions. A reading between two other bodies
of the chain contains only the components of the links between them.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from thermocomp.core.arrays import BoolArray, FloatArray
from thermocomp.core.components import BY_CODE, COMPONENTS
from thermocomp.core.exceptions import FitError, InputError
from thermocomp.core.machine import Machine, Vector
from thermocomp.core.structure import Structure
from thermocomp.runtime.geometry.kinematics import INDEX, Kinematics

#: the 11 scalar components that Chen adds to the 21 known ones (C-01)
THERMAL = tuple(c.code for c in COMPONENTS if c.group in ("spindle", "origin"))
#: a combination of components is not determined if an error of 1 um of the readings changes it by more [um, urad]
AMPLIFIED = 100.0
#: share in an undetermined combination from which a component is named
_NAMED = 0.05


@dataclass(frozen=True)
class Displacement:
    """A measured displacement of a body of the machine relative to another one, actual minus commanded.

    Bodies are ``workpiece``, ``bed``, ``tool``, and the letter of an axis for the slide that it moves. On
    ``w X' b Z Y (C1) t``, X is the table, Z the column, and Y the headstock with the housing of the spindle.

    Parameters
    ----------
    along : {'X', 'Y', 'Z'}
        Direction.
    at : tuple of float
        Positions of X, Y and Z [mm].
    tool : tuple of float, optional
        Vector from the spindle's gauge point to the measured point [mm]. Default: that of the machine.
    between : (str, str)
        The two bodies, that nearer to the workpiece first: a probe on the first that touches the second.
    """

    along: str
    at: Vector
    tool: Vector | None = None
    between: tuple[str, str] = ("workpiece", "tool")


@dataclass(frozen=True, eq=False)
class IdentifiedComponents:
    """Components identified from displacements.

    Parameters
    ----------
    codes : tuple of str
    values : ndarray of shape (..., n_codes)
        [um, urad]
    standard_errors : ndarray of shape (n_codes,)
        From the uncertainty of the readings [um, urad].
    residual : ndarray of shape (..., n_readings)
        Readings minus the effects of all components [um].
    """

    codes: tuple[str, ...]
    values: FloatArray
    standard_errors: FloatArray
    residual: FloatArray

    def __getitem__(self, code: str) -> FloatArray:
        """Return the values of one component, shape (...)."""
        return np.asarray(self.values[..., self.codes.index(code)])


def identify_components(
    machine: Machine,
    readings: Sequence[Displacement],
    values: ArrayLike,
    *,
    codes: Sequence[str] | None = None,
    known: ArrayLike | None = None,
    uncertainty: float = 0.5,
) -> IdentifiedComponents:
    """Identify scalar components by least squares.

    Parameters
    ----------
    machine : Machine
        Structure, axes and reference points; the machine's own components are not used.
    readings : sequence of Displacement
        Where each displacement was measured.
    values : array-like of shape (..., n_readings)
        Displacements in one or several thermal states, relative to the reference state [um].
    codes : sequence of str
        Scalar components to identify. Default: two tilts and three drifts of the spindle, and the shifts of the
        references of X and Y, if the machine has them.
    known : array-like of shape (..., n_readings, 32), optional
        Known components at the position of each reading, such as ``field.components([r.at for r in readings])``; those
        of `codes` are ignored. Default: zero.
    uncertainty : float
        Standard uncertainty of a reading [um].

    Returns
    -------
    IdentifiedComponents

    Raises
    ------
    InputError
        A component or body is unknown or a component depends on a position, or values are not finite or not one per
        reading.
    FitError
        The readings do not determine the components: the message names those that cannot be separated, and what to
        measure in addition.
    """
    measured = np.asarray(values, dtype=np.float64)
    if measured.shape[-1:] != (len(readings),) or not np.isfinite(measured).all():
        raise InputError(f"expected {len(readings)} finite displacements per state, one for each reading")
    if codes is None:
        codes = [code for code in THERMAL if {*BY_CODE[code].axes} <= {*machine.structure.axes}]
    columns = [_column(code, machine) for code in codes]
    effects = effects_of_components(machine, readings)
    design = effects[:, columns]
    if known is not None:
        others = np.array(known, dtype=np.float64)
        others[..., columns] = 0.0
        measured = measured - np.einsum("nc,...nc->...n", effects, others)
    _, sizes, combinations = np.linalg.svd(design)
    sizes = np.pad(sizes, (0, len(codes) - len(sizes)))
    if (sizes < 1.0 / AMPLIFIED).any():
        # in units in which each component has the same effect, whether it is a length or an angle
        scale = np.maximum(np.linalg.norm(design, axis=0), 1.0 / AMPLIFIED**2)
        open_, _ = np.linalg.qr(scale[:, None] * combinations[sizes < 1.0 / AMPLIFIED].T)
        raise FitError(_explain(machine.structure, codes, np.abs(open_ @ open_.T) > _NAMED))
    inverse = np.linalg.pinv(design)
    found = measured @ inverse.T
    return IdentifiedComponents(
        codes=tuple(codes),
        values=found,
        standard_errors=uncertainty * np.linalg.norm(inverse, axis=1),
        residual=measured - found @ design.T,
    )


def effects_of_components(machine: Machine, readings: Sequence[Displacement]) -> FloatArray:
    """Return the effect of one um or one urad of each component on each reading.

    Returns
    -------
    ndarray of shape (n_readings, 32)
        [um per um, um per urad]; zero for components outside the two bodies.
    """
    kinematics = Kinematics(machine)
    links = np.array([_link(c.code, machine.structure) for c in COMPONENTS])
    effects = np.empty((len(readings), len(COMPONENTS)))
    for k, r in enumerate(readings):
        first, last = (_body(name, machine.structure) for name in r.between)
        if first >= last:
            raise InputError(f"a reading between {' and '.join(r.between)}: the first must be nearer to the workpiece")
        if r.along not in ("X", "Y", "Z"):
            raise InputError(f"a reading along {r.along!r}: expected X, Y or Z")
        inside = (first <= links) & (links < last)
        effects[k] = inside * kinematics.sensitivity(r.at, r.tool)[:, "XYZ".index(r.along)]
    return effects


def _column(code: str, machine: Machine) -> int:
    if code not in BY_CODE or not BY_CODE[code].is_scalar:
        scalars = ", ".join(c.code for c in COMPONENTS if c.is_scalar)
        raise InputError(f"{code!r} is not one of the scalar components {scalars}")
    for axis in BY_CODE[code].axes:
        machine.axis(axis)
    return INDEX[code]


def _link(code: str, structure: Structure) -> int:
    """Return the place in the chain of the axis, or of the spindle, in which a component occurs; -1: nowhere."""
    if BY_CODE[code].group == "spindle":
        return len(structure.axes)
    return structure.axes.index(code[2]) if code[2] in structure.axes else -1


def _body(name: str, structure: Structure) -> int:
    """Return the number of links between the workpiece and a body."""
    bodies = {"workpiece": 0, "bed": len(structure.workpiece), "tool": len(structure.axes) + 1}
    for k, axis in enumerate(structure.axes):
        bodies[axis] = k if axis in structure.workpiece else k + 1
    if name not in bodies:
        raise InputError(f"there is no body {name!r}; there are {', '.join(bodies)}")
    return bodies[name]


def _explain(structure: Structure, codes: Sequence[str], linked: BoolArray) -> str:
    """Return which components the undetermined combinations contain, and how to separate them."""
    told = []
    for group in _connected(linked):
        names = [codes[k] for k in group]
        links = sorted({_link(name, structure) for name in names})
        text, others = f"the readings hardly depend on {names[0]}", links
        if len(names) > 1:
            text, others = f"{', '.join(names[:-1])} and {names[-1]} cannot be separated", links[:-1]
        advice = [_between(structure, link) for link in others]
        if any(BY_CODE[name].unit == "urad" for name in names):
            advice.append("with tools of different lengths and at distant positions of the axes")
        told.append(f"{text}: measure also {', '.join(advice)}")
    return ". ".join(told)


def _connected(linked: BoolArray) -> Iterator[list[int]]:
    """Yield groups of indices that are linked directly or through others."""
    left = [k for k in range(len(linked)) if linked[k, k]]
    while left:
        group, grown = [], [left[0]]
        while grown:
            k = grown.pop()
            if k in left:
                left.remove(k)
                group.append(k)
                grown += np.flatnonzero(linked[k]).tolist()
        yield sorted(group)


def _between(structure: Structure, link: int) -> str:
    """Return the place of a reading that contains the components of one link only."""
    table, axes = len(structure.workpiece), structure.axes
    names = [*axes[:table], "bed", *axes[table:], "tool"]
    return f"between {names[link]} and {names[link + 1]}"
