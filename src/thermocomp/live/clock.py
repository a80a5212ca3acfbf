"""The clocks of the service."""

import time


class ServiceClock:
    """The time of the machine: that of the world, or faster where the machine is a virtual one.

    Parameters
    ----------
    speed : float
        Seconds of the machine in a second of the world.
    """

    def __init__(self, speed: float = 1.0) -> None:
        self.speed = speed
        self._epoch, self._begin = time.time(), time.monotonic()

    def now(self) -> float:
        """Return the time of day of the machine, in seconds since 1970."""
        return time.time() if self.speed == 1.0 else self._epoch + self.tick()

    def tick(self) -> float:
        """Return the monotonic clock, which is never set [s]."""
        return self.speed * (time.monotonic() - self._begin)

    def of(self, stamp: float) -> float:
        """Return the time of the machine at a stamp of the world [s]."""
        return stamp if self.speed == 1.0 else self._epoch + self.speed * (stamp - self._epoch)
