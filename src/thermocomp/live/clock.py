"""Clock of the service: real time, or faster for a virtual machine."""

import time


class ServiceClock:
    """Machine time: real time, or faster for a virtual machine.

    Parameters
    ----------
    speed : float
        Machine time per unit of real time.
    """

    def __init__(self, speed: float = 1.0) -> None:
        self.speed = speed
        self._epoch, self._begin = time.time(), time.monotonic()

    def now(self) -> float:
        """Return the present machine time, in seconds since 1970."""
        return time.time() if self.speed == 1.0 else self._epoch + self.tick()

    def tick(self) -> float:
        """Return the monotonic machine time, unaffected by changes of the system clock [s]."""
        return self.speed * (time.monotonic() - self._begin)

    def of(self, stamp: float) -> float:
        """Return the machine time at a real time [s since 1970]."""
        return stamp if self.speed == 1.0 else self._epoch + self.speed * (stamp - self._epoch)
