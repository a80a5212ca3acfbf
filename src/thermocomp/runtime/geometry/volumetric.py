"""`VolumetricModel`: the components of a machine, stepped reading by reading or replayed over a recording."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.components import COMPONENTS
from thermocomp.core.exceptions import InputError, ReadingError
from thermocomp.core.machine import Machine
from thermocomp.core.model import ErrorModel
from thermocomp.core.position import PositionModel
from thermocomp.core.stack import Stack, StackState
from thermocomp.runtime.geometry.field import ErrorField
from thermocomp.runtime.geometry.kinematics import INDEX, Kinematics

FloatArray = NDArray[np.float64]

#: state of a volumetric model between two readings
VolumetricState = StackState


class VolumetricModel:
    """The error components of a machine as functions of time.

    Parameters
    ----------
    machine : Machine
        Machine; components that it does not define are zero.

    Attributes
    ----------
    stack : Stack
        All its models of time.

    Raises
    ------
    InputError
        Two models use a channel of the same name for different quantities, or the do-no-harm gate refused a model.
    """

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        self._kinematics = Kinematics(machine)
        self._constants = np.zeros(len(COMPONENTS))
        self._varying: list[tuple[int, PositionModel, slice]] = []
        models: list[ErrorModel] = []
        uniform: list[tuple[int, int]] = []  # component, model
        for code, source in machine.components.items():
            if isinstance(source, PositionModel):
                self._varying.append((INDEX[code], source, slice(len(models), len(models) + len(source.models))))
                models += source.models
            elif isinstance(source, ErrorModel):
                uniform.append((INDEX[code], len(models)))
                models.append(source)
            else:
                self._constants[INDEX[code]] = source
        self._of_time = [k for k, _ in uniform], [m for _, m in uniform]
        for model in models:
            if model.honest_error is not None:  # unjudged models are excluded from compensators only
                model.check_may_run()
        self.stack = Stack(models)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the channels that the models need."""
        return self.stack.inputs

    def init(self) -> VolumetricState:
        """Return the state of a machine that has just been zeroed."""
        return self.stack.init()

    def step(
        self, state: VolumetricState, values: Mapping[str, float], dt: float
    ) -> tuple[VolumetricState, ErrorField]:
        """Process one reading and return the errors at its instant.

        Parameters
        ----------
        dt : float
            Time since the previous reading [s]; ignored in the first step.
        """
        try:
            reading = np.array([values[name] for name in self.inputs], dtype=np.float64)
        except KeyError as e:
            raise ReadingError(f"machine {self.machine.name}: channel {e.args[0]} is not in the reading") from None
        state, deviations = self.stack.step(state, reading, dt)
        return state, self.field(deviations)

    def field(self, deviations: FloatArray) -> ErrorField:
        """Return the errors of the machine in the state given by the models of time.

        Parameters
        ----------
        deviations : ndarray of shape (n_models,)
            Outputs of the models of `stack`.
        """
        uniform = self._constants.copy()
        components, models = self._of_time
        uniform[components] = deviations[models]
        factors = deviations.tolist()
        return ErrorField(self._kinematics, uniform, tuple((k, m, factors[at]) for k, m, at in self._varying))

    def replay(self, time: FloatArray, table: Mapping[str, FloatArray]) -> "ThermalStates":
        """Step through a recording, with the zero in its first row.

        Parameters
        ----------
        time : ndarray of shape (n,)
            [s]
        table : mapping of str to ndarray of shape (n,)
            Readings by channel; must contain those of `inputs`.
        """
        times = np.asarray(time, dtype=np.float64)
        if not np.isfinite(times).all() or (np.diff(times) <= 0).any():
            raise InputError(f"machine {self.machine.name}: the times of the recording must be finite and increase")
        for name in self.inputs:
            if name not in table:
                there = ", ".join(table) or "none"
                raise InputError(f"machine {self.machine.name}: there is no channel {name!r}; there are {there}")
            if np.shape(table[name]) != times.shape:
                raise InputError(
                    f"channel {name}: {len(table[name])} values for {len(times)} times; their numbers must be equal"
                )
        values = np.empty((len(times), len(self.inputs)))
        for column, name in enumerate(self.inputs):
            values[:, column] = table[name]
        state, deviation = self.init(), np.zeros(len(self.stack.models))
        deviations = np.empty((len(times), len(self.stack.models)))
        usable = np.flatnonzero(np.isfinite(values).all(axis=1))
        steps = dict(zip(usable.tolist(), np.diff(times[usable], prepend=times[usable][:1]).tolist(), strict=True))
        for k in range(len(times)):
            if k in steps:
                state, deviation = self.stack.step(state, values[k], steps[k])
            deviations[k] = deviation
        return ThermalStates(self, times, deviations)


@dataclass(frozen=True, eq=False)
class ThermalStates:
    """Thermal states of a machine in the rows of a recording: a sequence of `ErrorField`.

    Parameters
    ----------
    time : ndarray of shape (n,)
        [s]
    deviations : ndarray of shape (n, n_models)
        Outputs of the models of ``model.stack``.
    """

    model: VolumetricModel
    time: FloatArray
    deviations: FloatArray

    def __len__(self) -> int:
        return len(self.time)

    def __getitem__(self, k: int) -> ErrorField:
        return self.model.field(self.deviations[k])

    def __iter__(self) -> Iterator[ErrorField]:
        return (self[k] for k in range(len(self)))
