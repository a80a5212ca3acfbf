"""Corrections in force when the service starts: confirmed by the controller, or as last sent by an earlier run."""

import asyncio
import math
import time
from collections.abc import Mapping
from typing import Literal

from thermocomp.core.correction import Correction
from thermocomp.core.ports import Confirming, Remembering, Sink, Suspending
from thermocomp.live.inforce import confirms
from thermocomp.live.links import TIMEOUT
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.state import Status

#: what is done if the correction in force is unknown
AtStart = Literal["order", "zero"]

#: time for which a controller is awaited at the start [0.1 s]
WAIT = 30

#: status of a target that waits: at a later start, and at the first one
WAITS = {
    False: Status("unknown", "the correction in force is unknown: remove it at the controller, then order 'start'"),
    True: Status(
        "first start", "there is no state of an earlier run: check that no correction is in force, then order 'start'"
    ),
}


class StartValues:
    """Corrections in force at the start, as far as sinks know them."""

    def __init__(self, compensator: Compensator) -> None:
        self._compensator = compensator
        self._confirmed, self._sent = dict[str, Correction](), dict[str, Correction]()
        self.asked = list[Sink]()  #: sinks that have answered, also with nothing
        #: targets whose correction was in force, or sent, less than a day ago
        self.lately = set[str]()

    async def ask(self, sink: Sink) -> None:
        """Connect a sink and ask it for the corrections in force."""
        if not isinstance(sink, Confirming | Remembering):
            return
        await sink.connect(TIMEOUT)
        if isinstance(sink, Confirming):
            report = await sink.confirmed()
            for _ in range(WAIT if confirms(sink) else 0):  # what the controller says goes before what was sent
                if report is not None:
                    break
                await asyncio.sleep(0.1)
                report = await sink.confirmed()
            found = self.within_limits(report or {})
            if confirms(sink):
                self._confirmed |= found
                if isinstance(sink, Suspending):  # without a service its correction fades
                    self.lately |= found.keys()
            else:
                self._sent |= found
        if isinstance(sink, Remembering):
            self._sent |= (sent := self.within_limits(await sink.last_sent() or {}))
            if time.time() - getattr(sink, "last_time", -math.inf) <= self._compensator.thresholds.resumable:
                self.lately |= sent.keys()
        self.asked.append(sink)

    def of(self, target: str) -> Correction | None:
        """Return the correction in force, confirmed or else as last sent; None if no sink knows it."""
        return self._confirmed.get(target, self._sent.get(target))

    def within_limits(self, corrections: Mapping[str, Correction]) -> dict[str, Correction]:
        """Return the corrections of known targets that do not exceed the limits: others are not ours."""
        lines, most = self._compensator.lines, self._compensator.limits.magnitude
        return {
            t: c for t, c in corrections.items() if t in lines and max(abs(c.at(p)) for p in lines[t].travel) <= most
        }
