"""Chen 1996, Fig. 2: the printed log of the stepwise regression, step by step, and what the scan has damaged of it.

The log is one of y, although the coefficients below it are those of x (E-C1, E-C2). The scan carries the figure twice;
the first copy is beyond use, so the second is typed here, and its damaged lines are repaired as far as the others allow
(E-C3). In the repaired lines the term is read, not scanned.
"""

import math
from itertools import pairwise
from typing import NamedTuple

import pytest

from thermocomp.models.numerics.stepwise import AlphaThresholds
from thermocomp.papers.chen1996 import drift
from thermocomp.papers.chen1996.setup import CLOSELY, SUBGROUPS


class Line(NamedTuple):
    """A line of the log: number, action, term, R and RSQUARE as repaired; empty where nothing can be read."""

    step: int
    action: str
    term: str
    r: str
    r_squared: str


LOG = [
    Line(int(step), action, *("" if text == "?" else text for text in rest))
    for step, action, *rest in (
        line.split()
        for line in """
             1 ENTER  T2                .751 .564
             2 ENTER  T5*T5             .781 .609
             3 ENTER  (T6-T8)           .852 .726
             4 ENTER  T3                .929 .862
             5 ENTER  T5                .947 .897
             6 ENTER  (T7-T9)           .953 .908
             7 ENTER  T2*T5             .955 .913
             8 ENTER  T3*T3             .972 .946
             9 REMOVE T5                .972 .946
            10 ENTER  T2*T2             .974 .948
            11 ENTER  T2*T3             .975 .950
            12 ENTER  T3*(T7-T9)        .976 .953
            13 REMOVE T3*T3             .976 .952
            14 ENTER  T4*(T6-T8)        .976 .953
            15 ENTER  T4*(T7-T9)        .978 .956
            16 REMOVE T3*(T7-T9)        .978 .956
            17 ENTER  T4*T4             .980 .961
            18 ENTER  ?                 .981 .963
            19 ENTER  T4                ?    ?
            20 ENTER  T4*T5             .983 .966
            21 ENTER  (T6-T8)*(T6-T8)   .983 .967
            22 ENTER  (T6-T8)*(T7-T9)   .985 .970
            23 ENTER  (T7-T9)*(T7-T9)   .986 .973
            24 REMOVE T5*T5             .986 .973
            25 ENTER  T2*T3             .986 .973
            26 REMOVE T4*T4             .986 .973
            27 REMOVE T4*T5             .986 .973
        """.strip().splitlines()
    )
]
#: R and RSQUARE of the damaged lines as scanned. From step 19 on, the numbers in a row of the scan are those of the
#: next step, until steps 23 and 24 share a row; one pair of numbers is lost, and is missing in step 19 here. In step 16
#: a removal at alpha .015 cannot lower RSQUARE from .956 to .951, so its R is that of step 15; the garbled first copy
#: of the figure also has .978 and .956 in a line of step 16.
SCANNED = {
    15: (".978", ".930"),
    16: (".975", ".930"),
    17: (".980", ".501"),
    18: (".981", ".903"),
    19: ("", ""),
    20: (".093", ".966"),
    21: (".093", ".967"),
    22: (".085", ".970"),
}
#: terms that cannot be read; one of the two entries of T2*T3 is another term, but which of them is not to be told
UNREAD = (18,)
TWICE = (11, 25)


def agree(r: str, r_squared: str) -> bool:
    """Return whether some R that is printed as `r` has a square that is printed as `r_squared`."""
    low, high = ((float(r) + half) ** 2 for half in (-0.0005, 0.0005))
    return low - 0.0005 < float(r_squared) < high + 0.0005


def test_steps_are_numbered() -> None:
    assert [line.step for line in LOG] == [*range(1, 27 + 1)]


def test_r_and_r_squared_belong_together() -> None:
    """C-16: every printed RSQUARE is the square of the R beside it."""
    assert [line.step for line in LOG if not line.r] == [19]
    assert all(agree(line.r, line.r_squared) for line in LOG if line.r)


def test_damaged_lines_are_those_that_contradict_themselves() -> None:
    """E-C3: in the other lines the scanned numbers are those of `LOG`."""
    scanned = {line.step: SCANNED.get(line.step, (line.r, line.r_squared)) for line in LOG}
    assert [step for step, both in scanned.items() if not (all(both) and agree(*both))] == list(SCANNED)


def test_r_squared_rises_with_entries_and_falls_with_removals() -> None:
    known = [line for line in LOG if line.r]
    for before, line in pairwise(known):
        change = float(line.r_squared) - float(before.r_squared)
        assert change >= 0 if line.action == "ENTER" else change <= 0


def test_removals_lose_next_to_nothing() -> None:
    """C-15, C-17: F below that of alpha .015; so R of step 16 is not the .975 of the scan."""
    threshold = AlphaThresholds(0.001, 0.015).delete_f(810 - 15)
    for before, line in pairwise(LOG):
        if line.action == "REMOVE":
            most = threshold * (1 - float(before.r_squared) + 0.0005) / (810 - 15)
            assert float(before.r_squared) - float(line.r_squared) <= most + 0.001
    fall = (0.956 - 0.0005) - (0.975 + 0.0005) ** 2
    assert fall > threshold * (1 - 0.955) / (810 - 15)


def test_terms_leave_after_they_entered() -> None:
    inside: set[str] = set()
    again = []
    for line in LOG:
        if line.action == "REMOVE":
            inside.remove(line.term)
        elif line.term in inside:
            again.append(line.step)
        elif line.term:
            inside.add(line.term)
    assert again == [TWICE[1]]
    assert LOG[TWICE[0] - 1].term == LOG[TWICE[1] - 1].term == "T2*T3"
    assert [line.step for line in LOG if not line.term] == [*UNREAD]
    # the two steps whose terms are not known are still two terms
    assert len(inside) + len(UNREAD) + len(again) == drift.TERMS["y"]


def test_entries_and_removals_make_the_terms_of_y() -> None:
    """C-17, C-20, E-C1: 21 - 6 is the number of terms of y; those of x are 7."""
    entered, removed = ([line.step for line in LOG if line.action == action] for action in ("ENTER", "REMOVE"))
    assert removed == [9, 13, 16, 24, 26, 27]
    assert len(entered) == 21
    assert len(entered) - len(removed) == 15 == drift.TERMS["y"]
    assert len(removed) == drift.REMOVALS


def test_variables_are_those_of_the_subgroup_of_y() -> None:
    """E-C1: T4, T5 and both differences are in no other row of Table 2 together."""
    used = {variable.strip("()") for line in LOG if line.term for variable in line.term.split("*")}
    assert used == {"T2", "T3", "T4", "T5", "T6-T8", "T7-T9"}
    assert [target for target, subgroup in SUBGROUPS.items() if used <= {*subgroup}] == ["y"]


def test_log_and_table_tell_different_fits() -> None:
    """C-19, E-C2: the log ends at .973, the table below it says R .994, R2 .988, adjusted .988, for 810 rows."""
    assert float(LOG[-1].r_squared) == CLOSELY
    assert agree(".994", ".988")
    assert drift.R2_X == 0.988
    adjusted = 1 - (1 - drift.R2_X) * 810 / (810 - len(drift.EQ5))
    assert adjusted == pytest.approx(0.988, abs=0.0005)
    # the standard error then implies a drift of 97 um (RMS)
    assert drift.SEE_X / math.sqrt(1 - adjusted) == pytest.approx(97, abs=1)


def test_eq_5_is_no_outcome_of_this_log() -> None:
    """C-18, E-C1: variables of Eq. 5 that never enter, and the other way round."""
    assert {"(T6-T7)", "(T8-T9)"} <= set(drift.EQ5)
    assert not any("T6-T7" in line.term or "T8-T9" in line.term for line in LOG)
