"""Latest value of each channel; the number of unused channels kept is limited."""

from collections.abc import Iterable, Mapping

#: number of unused names kept for display; further names are counted up to a maximum
KEPT, COUNTED = 64, 10_000
#: two clocks are read one after the other: values that are older by no more than this are of the same time [s]
JITTER = 0.01


class Latest(dict[str, tuple[float, float]]):
    """Value and time of measurement, by channel name.

    Parameters
    ----------
    used : iterable of str
        Names that are used and always kept.
    """

    def __init__(self, used: Iterable[str]) -> None:
        super().__init__()
        self.used = set(used)
        self.behind = 0.0  #: by how much values of the last reading were older than those used; 0: none were [s]
        self._left_out = set[int]()  # hashes of names, because names may be long

    @property
    def left_out(self) -> int:
        """Number of channel names that were not stored; `COUNTED` means that number or more."""
        return len(self._left_out)

    def take(self, values: Mapping[str, float], tick: float, longest: float, measured: float | None = None) -> str:
        """Store values, but not in place of newer ones.

        Returns the first channel name that was not stored, if all were stored until then.

        Parameters
        ----------
        tick : float
            Present time [s].
        measured : float, optional
            Time of the values; default: now [s].
        longest : float
            Time without a value after which an unused name may be replaced [s].
        """
        first, others, at = "", values.keys() - self.used, tick if measured is None else measured
        if new := others - self.keys():
            room = KEPT - len(self.keys() - self.used)
            if room < len(new):
                old = [n for n, (_, at) in self.items() if n not in self.used and tick - at > longest]
                for name in old:
                    del self[name]
                room += len(old)
            ordered = [name for name in values if name in new]
            new = set(ordered[:room])
            first = ordered[room] if len(ordered) > room and not self._left_out else ""
            self._left_out.update(map(hash, ordered[room : room + COUNTED - len(self._left_out)]))
        self.behind = 0.0
        for name, value in values.items():
            if name in self.used or name in self or name in new:
                before = self.get(name)
                if before is None or before[1] <= at + JITTER:
                    self[name] = (value, at)
                else:
                    self.behind = max(self.behind, before[1] - at)
        return first
