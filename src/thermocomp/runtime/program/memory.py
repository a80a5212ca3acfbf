"""Variables of the program of any compensator in flat arrays: real numbers and integers of each record."""

from collections.abc import Mapping
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from thermocomp.runtime.program.constants import Constants
from thermocomp.runtime.program.declarations import Var
from thermocomp.runtime.program.tree import Kind
from thermocomp.runtime.program.variables import RECORDS

IntArray = NDArray[np.int64]


class Location(NamedTuple):
    """Location of a variable in the flat arrays."""

    array: str  #: letter of its record, then ``r`` for real numbers or ``i`` for integers
    place: int  #: index of a number in this array; for an array, index into ``at``, which gives its first element


def letter_of(kind: Kind) -> str:
    """Return ``r`` for real numbers and times, ``i`` for integers and conditions."""
    return "r" if kind in ("real", "time") else "i"


def _dimensions() -> list[str]:
    options = [k for k, v in vars(Constants).items() if isinstance(v, Var) and k not in Constants.variables()]
    dims = [d for r in RECORDS.values() for v in r.variables().values() for d in v.dims]
    return list(dict.fromkeys([*options, *dims]))


#: index of each size and option of a compensator
SIZES: dict[str, int] = {name: k for k, name in enumerate(_dimensions())}
#: arrays of a program, in the order of its arguments
ARRAYS = (*(f"{letter}{kind}" for letter in RECORDS for kind in "ri"), "at", "sizes")


@cache
def find_places() -> dict[tuple[str, str], Location]:
    """Return the location of each variable in the flat arrays, by record and name."""
    found: dict[tuple[str, str], Location] = {}
    counts, arrays = dict.fromkeys(ARRAYS, 0), 0
    for letter, record in RECORDS.items():
        for name, var in record.variables().items():
            array = f"{letter}{letter_of(var.kind)}"
            if var.dims:
                found[letter, name], arrays = Location(array, arrays), arrays + 1
            else:
                found[letter, name] = Location(array, counts[array])
                counts[array] += 1
    return found


class FlatMemory:
    """All variables of a compensator before its first call.

    Parameters
    ----------
    sizes : mapping of str to int
    values : mapping of str to object
        Constants by name; those that are missing are 0.
    """

    def __init__(self, sizes: Mapping[str, int], values: Mapping[str, Any]) -> None:
        lengths, at = dict.fromkeys(ARRAYS[:-2], 0), list[int]()
        self._shapes: dict[tuple[str, str], tuple[int, ...]] = {}
        for (letter, name), place in find_places().items():
            dims = RECORDS[letter].variables()[name].dims
            self._shapes[letter, name] = shape = tuple(sizes.get(d, 0) for d in dims)
            if not dims:
                lengths[place.array] += 1
        for key, place in find_places().items():
            if shape := self._shapes[key]:
                at.append(lengths[place.array])
                lengths[place.array] += int(np.prod(shape))
        self.arrays: dict[str, NDArray[Any]] = {
            name: np.zeros(length, dtype=np.float64 if name[1] == "r" else np.int64) for name, length in lengths.items()
        }
        self.arrays |= {"at": np.array(at), "sizes": np.array([sizes.get(name, 0) for name in SIZES])}
        for name, value in values.items():
            found = self.find("t", name)
            found[...] = np.reshape(value, found.shape)  # also of a table without rows

    def find(self, record: str, name: str) -> NDArray[Any]:
        """Return a view of a variable, without dimensions for a single number."""
        place, shape = find_places()[record, name], self._shapes[record, name]
        held = self.arrays[place.array]
        if not shape:
            return held[place.place : place.place + 1].reshape(())
        begin = int(self.arrays["at"][place.place])
        return held[begin : begin + int(np.prod(shape))].reshape(shape)
