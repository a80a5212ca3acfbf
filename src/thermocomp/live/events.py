"""Recent events for display; events of frequent kinds are limited in number so as not to displace others."""

import time
from collections import deque
from dataclasses import dataclass

from thermocomp.core.shown import escape

#: number of events kept for display, and maximum length of an event [characters]
EVENTS, LONGEST = 200, 1_000
#: kinds whose number is limited, and maximum number of one kind shown per minute
LIMITED, MOST = ("link", "probing", "state"), 30


@dataclass(frozen=True)
class Event:
    """An event of the service.

    Parameters
    ----------
    time : float
        Machine time, seconds since 1970.
    kind : str
        ``reference``, ``state``, ``sensor``, ``probing``, ``link`` or ``service``.
    """

    time: float
    kind: str
    text: str


class Events(deque[Event]):
    """The newest events, oldest first."""

    def __init__(self) -> None:
        super().__init__(maxlen=EVENTS)
        self._lately = {kind: deque[float](maxlen=MOST) for kind in LIMITED}
        self._left_out = dict.fromkeys(LIMITED, 0)

    def tell(self, time_of_it: float, kind: str, text: str) -> Event | None:
        """Add an event and return it; None if too many of its kind: the next one states the number omitted.

        Parameters
        ----------
        time_of_it : float
            Machine time, seconds since 1970.
        """
        if (lately := self._lately.get(kind)) is not None:
            now = time.monotonic()
            if len(lately) == MOST and now - lately[0] < 60.0:
                self._left_out[kind] += 1
                return None
            lately.append(now)
            if left := self._left_out[kind]:
                text, self._left_out[kind] = f"{text} ({left:,} earlier events of this kind are not listed)", 0
        if len(self) == EVENTS and sum(e.kind in LIMITED for e in self) > EVENTS // 2:
            self.remove(next(e for e in self if e.kind in LIMITED))
        self.append(Event(time_of_it, kind, escape(text, LONGEST)))
        return self[-1]
