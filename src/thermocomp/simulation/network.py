"""Thermal networks: lumped heat capacities, joined by conductances, in air."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.exceptions import InputError

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Node:
    """A part of the machine with one temperature.

    Parameters
    ----------
    name : str
    capacity : float
        Heat capacity [J/K].
    convection : float
        Conductance to the air at rest [W/K].
    rotating : float
        What the spindle at top speed adds to that conductance [W/K].
    height : float
        Of the air it stands in, above the floor [m].
    side : float
        Of the air it stands in, to the right of the middle [m].
    """

    name: str
    capacity: float
    convection: float = 0.0
    rotating: float = 0.0
    height: float = 1.2
    side: float = 0.0


@dataclass(frozen=True)
class Link:
    """A path of heat between two nodes.

    Parameters
    ----------
    a, b : str
        Names of the nodes.
    conductance : float
        [W/K]
    flow : bool
        Carried by the coolant: open only while the pump runs.
    """

    a: str
    b: str
    conductance: float
    flow: bool = False


@dataclass(frozen=True)
class Regime:
    """What decides the conductances: while it stays the same the network is linear.

    Parameters
    ----------
    rotation : float
        Share of `Node.rotating` in force; 0 at rest, 1 at top speed.
    flow : bool
        The coolant flows.
    """

    rotation: float = 0.0
    flow: bool = False


class Network:
    """C dT/dt = -K T + G T_air + P, with K symmetric.

    Parameters
    ----------
    nodes : sequence of Node
    links : sequence of Link

    Raises
    ------
    InputError
        Two nodes have one name, a link leads nowhere, a capacity is not positive, or a conductance is negative.

    Notes
    -----
    With S = C^(1/2) the matrix S^-1 K S^-1 is symmetric, so its eigenvectors give the exact solution over a step in
    which `P`, `T_air` and the regime are constant: stable and exact for any step.
    """

    #: steps kept ready; a programme has a few speeds, a live source may have any
    _KEEP = 64

    def __init__(self, nodes: Sequence[Node], links: Sequence[Link]) -> None:
        self.names = tuple(n.name for n in nodes)
        if len(set(self.names)) != len(self.names):
            raise InputError(f"thermal network: two nodes have the same name among {', '.join(self.names)}")
        self.index: Mapping[str, int] = {name: k for k, name in enumerate(self.names)}
        for n in nodes:
            if not (n.capacity > 0 and n.convection >= 0 and n.rotating >= 0):
                raise InputError(f"thermal network: node {n.name} needs a positive capacity and no negative convection")
        self.capacity = np.array([n.capacity for n in nodes])
        self.height = np.array([n.height for n in nodes])
        self.side = np.array([n.side for n in nodes])
        self._convection = np.array([n.convection for n in nodes])
        self._rotating = np.array([n.rotating for n in nodes])
        self._conduction = {flow: self._laplacian(links, flow) for flow in (False, True)}
        self._steps: dict[tuple[Regime, float], tuple[FloatArray, FloatArray]] = {}

    def _laplacian(self, links: Sequence[Link], flow: bool) -> FloatArray:
        matrix = np.zeros((len(self.names), len(self.names)))
        for link in links:
            for name in (link.a, link.b):
                if name not in self.index:
                    raise InputError(f"thermal network: link {link.a}-{link.b}: there is no node {name!r}")
            if link.a == link.b or not link.conductance >= 0:
                raise InputError(f"thermal network: link {link.a}-{link.b} needs two nodes and no negative conductance")
            if link.flow and not flow:
                continue
            a, b = self.index[link.a], self.index[link.b]
            matrix[[a, b], [a, b]] += link.conductance
            matrix[[a, b], [b, a]] -= link.conductance
        return matrix

    def to_air(self, regime: Regime) -> FloatArray:
        """Return G: each node's conductance to its air [W/K], of shape (n_nodes,)."""
        return self._convection + regime.rotation * self._rotating

    def stiffness(self, regime: Regime) -> FloatArray:
        """Return K [W/K], of shape (n_nodes, n_nodes)."""
        return self._conduction[regime.flow] + np.diag(self.to_air(regime))

    def advance(
        self, temperatures: FloatArray, power: FloatArray, air: FloatArray, regime: Regime, dt: float
    ) -> FloatArray:
        """Return the temperatures [degC] after a step.

        Parameters
        ----------
        temperatures, power, air : ndarray of shape (n_nodes,)
            Before the step [degC]; heat put into each node [W]; air round it [degC].
        regime : Regime
        dt : float
            [s]
        """
        decay, gain = self._step(regime, dt)
        result: FloatArray = decay @ temperatures + gain @ (power + self.to_air(regime) * air)
        return result

    def steady(self, power: FloatArray, air: FloatArray, regime: Regime) -> FloatArray:
        """Return the temperatures [degC] that constant heat [W] and air [degC] lead to."""
        return np.asarray(np.linalg.solve(self.stiffness(regime), power + self.to_air(regime) * air), dtype=np.float64)

    def time_constants(self, regime: Regime) -> FloatArray:
        """Return the time constants of the modes [s], longest first."""
        root = np.sqrt(self.capacity)
        rates = np.linalg.eigvalsh(self.stiffness(regime) / np.outer(root, root))
        return np.asarray(1.0 / rates, dtype=np.float64)

    def _step(self, regime: Regime, dt: float) -> tuple[FloatArray, FloatArray]:
        key = (regime, dt)
        if key not in self._steps:
            if len(self._steps) >= self._KEEP:
                self._steps.pop(next(iter(self._steps)))
            self._steps[key] = self._exponential(regime, dt)
        return self._steps[key]

    def _exponential(self, regime: Regime, dt: float) -> tuple[FloatArray, FloatArray]:
        """Return exp(-C^-1 K dt), and its integral over the step times C^-1."""
        root = np.sqrt(self.capacity)
        rates, modes = np.linalg.eigh(self.stiffness(regime) / np.outer(root, root))
        # A network without air has a rate of zero (or its rounding): there the integral is the step itself.
        slow = np.abs(rates * dt) < 1e-12
        integral = np.where(slow, dt, -np.expm1(-rates * dt) / np.where(slow, 1.0, rates))
        left, right = modes / root[:, None], modes.T * root
        return (left * np.exp(-rates * dt)) @ right, (left * integral) @ left.T
