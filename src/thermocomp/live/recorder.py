"""Writes the readings, corrections and events of the service to its journal."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Literal

from thermocomp.core.correction import Correction
from thermocomp.core.machine import Channel
from thermocomp.core.reading import Measurement
from thermocomp.core.units import HOUSE_UNITS
from thermocomp.live.clock import ServiceClock
from thermocomp.live.journal.journal import Journal, JournalLimits
from thermocomp.live.journal.journalrows import (
    AlarmRow,
    ConfirmationRow,
    DemandRow,
    MeasurementRow,
    Own,
    ReadingRow,
    ReferenceRow,
    StartRow,
    StateRow,
    TargetRow,
    UpdateRow,
)
from thermocomp.live.probe import Checked
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.state import Compensated, Reference

#: validity of a confirmed correction after its confirmation [s of real time]
CONFIRM_WITHIN = 10.0


class Recorder:
    """Writes the data of the service to a journal.

    Parameters
    ----------
    own : {'on', 'off', 'unknown'}
        Whether the controller has its own compensation.
    more : mapping of str to str, optional
        Quantity of channels that are recorded in addition to the inputs of the models.
    """

    def __init__(
        self,
        path: Path,
        compensator: Compensator,
        own: Own,
        clock: ServiceClock,
        limits: JournalLimits,
        more: Mapping[str, str] | None = None,
    ) -> None:
        inputs = [i for m in compensator.models for i in (*m.inputs, *(m.watch.inputs if m.watch else ()))]
        channels = {name: Channel(name, kind, HOUSE_UNITS[kind]) for name, kind in (more or {}).items()}
        channels |= {i.name: Channel(i.name, i.quantity, i.unit) for i in inputs}
        targets = tuple(TargetRow(name) for name in compensator.lines)
        start = StartRow(
            time=clock.now(),
            targets=targets,
            channels=tuple(channels.values()),
            own_compensation=own,
            confirm_within=CONFIRM_WITHIN * clock.speed,
        )
        self.journal = Journal(path, limits, start)  # nothing is written before the service runs
        self._before: Compensated | None = None
        self._references: dict[str, Reference] = {}

    def take(self, time: float, values: Mapping[str, float], said: Compensated) -> None:
        """Write a reading to the journal, and what it changed; `said` contains the states as reported."""
        self.journal.add(ReadingRow(time, values))
        self.tell(time, said)

    def tell(self, time: float, said: Compensated) -> None:
        """Write the corrections and the status of targets that have changed."""
        before, self._before = self._before, said
        for target, correction in said.corrections.items():
            if before is None or before.corrections.get(target) != correction:
                self.journal.add(DemandRow(time, target, correction))
        for target, status in said.states.items():
            if before is None or (known := before.states.get(target)) is None or known.word != status.word:
                self.journal.add(StateRow(time, target, status.word, status.reason))

    def count(self, time: float, references: Mapping[str, Reference]) -> None:
        """Write the zeros of targets that have changed."""
        for target, reference in references.items():
            if self._references.get(target) != reference:
                self.journal.add(ReferenceRow(time, target, reference.why, reference.shift))
        self._references = dict(references)

    def confirm(self, time: float, in_force: Mapping[str, Correction]) -> None:
        """Write the corrections in force, as reported by a controller."""
        for target, correction in in_force.items():
            self.journal.add(ConfirmationRow(time, target, correction))

    def measure(self, time: float, found: Measurement, in_force: Correction | None) -> None:
        """Write a measurement of the tool point."""
        kind: Literal["probing"] = "probing"
        row = MeasurementRow(
            time=time,
            target=found.target,
            value=found.measured,
            kind=kind,
            includes_offset=not found.left,
            position=found.position,
            in_force=in_force,
        )
        self.journal.add(row)

    def update(self, checked: Checked, after: float) -> None:
        """Write the change of a model by a probing; `after` is the prediction after it [um]."""
        measured = checked.predicted + checked.residual
        if math.isfinite(measured):
            self.journal.add(
                UpdateRow(
                    time=checked.time,
                    target=checked.target,
                    measured=measured,
                    before=checked.predicted,
                    after=after,
                    refused=checked.refused,
                )
            )

    def alarm(self, time: float, kind: str, text: str) -> None:
        """Write an alarm that needs attention."""
        self.journal.add(AlarmRow(time, kind, text))
