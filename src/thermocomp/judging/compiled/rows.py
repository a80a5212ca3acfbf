"""Procedures that process all rows of a test, in the language of `thermocomp.runtime.program`."""

from thermocomp.runtime.program.constants import Constants
from thermocomp.runtime.program.language import each, procedure
from thermocomp.runtime.program.variables import Kept, TestRows, Work
from thermocomp.runtime.program.watching import believe


@procedure
def believe_rows(s: Kept, w: Work, t: Constants, r: TestRows) -> None:
    """Replace temperatures and speeds that are not trusted, reading by reading."""
    for row in each("row", t.ROWS):
        w.now = r.time[row]
        w.stands = r.resting[row]
        for c in each("c", t.CHANNELS):
            w.value[c] = r.value[row, c]
            w.given[c] = (w.value[c] >= -1e30) & (w.value[c] <= 1e30)
        believe(s, w, t)
        for c in each("c", t.CHANNELS):
            r.value[row, c] = w.value[c]
        for i in each("i", t.FAILING):
            r.fault[row, i] = s.fault[i]


#: all procedures that are called from Python
PROCEDURES = (believe_rows,)
