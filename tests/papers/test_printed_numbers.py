"""The printed numbers of the papers, typed a second time: from the paper, never from our code.

A slip of the pen in a constant changes what the studies compare, and nothing else notices. So every constant of a study
stands here again, with its requirement and its place in the paper, or it is listed as a choice of our own.
"""

import ast
import importlib
import math
import re
import tomllib
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from thermocomp.papers.chen1996 import setup as chen
from thermocomp.papers.hwang import setup as hwang
from thermocomp.papers.wessel2004 import sets, tools
from thermocomp.virtual.kits import HWANG_PLACES

PAPERS = Path(importlib.import_module("thermocomp.papers").__path__[0])
STUDIES = ("chen1996", "wessel2004", "hwang", "precompensation", "stepwise2017")


class Printed(NamedTuple):
    """A number of a paper, and the constant that must be equal to it."""

    constant: str
    value: object
    ids: str
    place: str


#: Table 2 of Chen, row by row
TABLE_2 = {
    "x": ("T1", "T2", "T3", "T6-T7", "T8-T9"),
    "y": ("T1", "T2", "T3", "T4", "T5", "T6-T8", "T7-T9"),
    "z": ("T1", "T2", "T3", "T6-T8", "T7-T9"),
}
#: Eq. 5 of Chen, in its order
DELTA_X = {
    "T2": -0.586,
    "T3": +7.527,
    "(T6-T7)": -36.966,
    "(T8-T9)": +10.809,
    "T3*T3": -0.149,
    "(T6-T7)*(T6-T7)": -18.119,
    "T2*(T6-T7)": +2.499,
}

PRINTED = (
    # Chen, Yuan, Ni 1996
    Printed("chen1996.drift.TERMS", {"x": 7, "y": 15, "z": 7}, "C-20", "Eq. 5 has 7 terms; section 3.2: 15 and 7"),
    Printed("chen1996.drift.MAE_NET", {"x": 6.5, "y": 4.2, "z": 6.0}, "C-31", "section 4.2"),
    Printed("chen1996.drift.MAE_MRA", {"x": 8.9, "y": 3.8, "z": 6.9}, "C-31", "section 4.2, in brackets"),
    Printed("chen1996.drift.R2_X", 0.988, "C-19", "Fig. 2, squared multiple R"),
    Printed("chen1996.drift.SEE_X", 10.628, "C-19", "Fig. 2, standard error of estimate"),
    Printed("chen1996.drift.EQ5", DELTA_X, "C-18", "Eq. 5, and the table of coefficients in Fig. 2"),
    Printed("chen1996.screening.LEFT", 9, "C-11", "section 3.2: nine temperature measurements"),
    Printed("chen1996.drift.HIDDEN", 20, "C-26", "section 4.2: 9-20-3"),
    Printed("chen1996.law.HIDDEN", 8, "C-27", "section 4.3: 5-8-1"),
    Printed("chen1996.setup.COLUMN", ("T6", "T7", "T8", "T9"), "C-11", "Table 1: the four sides of the column"),
    Printed("chen1996.setup.SUBGROUPS", TABLE_2, "C-13", "Table 2"),
    Printed("chen1996.setup.SLOPE_VARIABLES", ("T1", "T3", "T4", "T6-T8", "T7-T9"), "C-23 E-C7", "section 3.3"),
    Printed(
        "chen1996.setup.EQ8",
        {"T3": 0.465, "T4": 2.705, "(T6-T8)": 3.675, "(T7-T9)": -5.589},
        "C-24 E-C4",
        "Eq. 8, its braces",
    ),
    Printed("chen1996.setup.TENFOLD", 10, "C-35", "abstract: improved by a factor of ten"),
    Printed("chen1996.setup.LATERAL", 92.4 / 7.2, "C-35", "abstract: from 92.4 to 7.2 um"),
    Printed("chen1996.setup.DEPTH", 196 / 8, "C-35", "abstract: from 196 to 8 um"),
    Printed("chen1996.drift.REMOVALS", 6, "C-17", "Fig. 2: steps 9, 13, 16, 24, 26, 27"),
    Printed("chen1996.volume.PATTERNS", 810, "C-14", "section 3.2: 810 observation sets"),
    Printed("chen1996.unseen.NOISE", 0.4, "C-33", "section 5.2 [degC]"),
    # Wessel et al. 2004
    Printed("wessel2004.sets.PAPER_SETS", 511, "W-10", "Appendix B, all combinations"),
    Printed("wessel2004.sets.PAPER_MODELS", 35_259, "W-10", "Appendix B, too many to be calculated"),
    Printed("wessel2004.sets.PAPER_SMALL_SETS", 129, "W-10", "Appendix B, at most three locations"),
    Printed("wessel2004.sets.ENOUGH_PSI", 0.99, "W-12", "Appendix B: triples > 0.99"),
    Printed("wessel2004.sets.MOST", 3, "W-12", "Appendix B: at most three locations"),
    Printed("wessel2004.spindle.PAPER_PSI", 0.9994, "W-06", "section III"),
    Printed("wessel2004.spindle.GOOD_PSI", 0.99, "W-12", "Appendix B: triples > 0.99"),
    Printed("wessel2004.spindle.NEIGHBOURS", range(1, 10 + 1), "W-05", "section III: k = 1, ..., 10"),
    Printed("wessel2004.tools.AT_REST", 5.7 / 1.0, "W-08", "section IV: 5.7 um, by ACE 1.0 um"),
    Printed("wessel2004.tools.AT_WORK", 5.0 / 2.2, "W-09", "section V: 5.0 um, by ACE 2.2 um"),
    Printed("wessel2004.tools.PAPER_GAIN", 10, "W-08 E-W1 E-W7", "section IV: up to 10-fold lower"),
    Printed("wessel2004.tools.PAPER_ACCURACY", 2, "W-09 E-W2", "section V: 1-2 um accuracy, its upper end"),
    Printed("wessel2004.tools.OVER", (10, 40), "W-09", "section V: over-estimation between points 10 and 40"),
    Printed("wessel2004.tools.UNDER", 60, "W-09", "section V: under-estimation from point 60 on"),
    # Hwang, Lee, Yang
    Printed(
        "hwang.setup.TABLE_1",
        ((7,), (9, 10, 11, 12), (13,), (8, 4), (5,), (2,), (1, 6), (3,)),
        "H-10 E-H4",
        "Table 1, groups 1 to 8",
    ),
    Printed("hwang.setup.PAPERS_SHARE", 4 / 8, "H-11", "section 3.2.1 and Table 1: four of eight groups"),
    Printed("hwang.setup.PAPERS_VARIABLES", (7, 4), "H-15", "Eq. 8 and Eq. 6"),
    Printed("hwang.setup.PAPERS_ERRORS", (6.39, 6.72), "H-12 H-13", "Table 2 [um]"),
    Printed("hwang.setup.JUDGEMENT", ("T6", "T7", "T13"), "H-13", "Table 2, right column, beside the squares"),
    Printed("hwang.setup.DRAWS", 100, "H-18", "section 3.2.4"),
    Printed("hwang.setup.INTERVAL", 30 * 60, "H-09", "section 3.1: every 30 min [s]"),
    # Precompensation
    Printed("precompensation.setup.PAPERS_ORDERS", (1, 0), "P-02", "text: k = 1, m = 0"),
    Printed("precompensation.setup.INTERVAL", 10 * 60, "P-06", "text: every 10 min [s]"),
    Printed("precompensation.setup.PAPERS_DEPTHS", (7, 2), "P-07", "text: from 7 um to 2 um"),
    Printed("precompensation.setup.SHARE", 2 / 7, "P-07", "text: from 7 um to 2 um"),
    # Open Mech. Eng. J. 11, 2017
    Printed("stepwise2017.redo.FIGURE_2", (3, 11, 14), "T-09 E-T6", "section 2, Fig. 2"),
    Printed("stepwise2017.setup.F_ENTER", 100, "T-03 E-T1", "section 3.2"),
    Printed("stepwise2017.setup.F_DELETE", 50, "T-03", "section 3.2"),
    Printed("stepwise2017.setup.PAPERS_COUNT", 5, "T-07", "abstract and section 3.2: from 24 to 5"),
    Printed("stepwise2017.setup.PAPERS_RESIDUAL", 5, "T-08", "abstract and section 4: less than 5 um"),
)

#: criteria that stand for a word of a paper; how strict they are is our choice
CRITERIA = (
    Printed(
        "chen1996.setup.CLOSELY", 0.973, "C-19 E-C2", "fit closely: the smaller R2 of Fig. 2, last step of its log"
    ),
    Printed("chen1996.setup.COMPETITIVE", 1.5, "C-31", "very close: 8.9 and 6.5 um are 1.37 apart"),
    Printed("chen1996.setup.WELL", 0.8, "C-32", "predict well; the headline asks for nine tenths"),
    Printed("chen1996.slope.STRAIGHT", 0.1, "C-05", "approximated accurately with only the first-order term"),
    Printed("wessel2004.spindle.CLOSE", 0.05, "W-05", "quite close to the original ones"),
    Printed("wessel2004.trial.SLIGHT", 0.01, "W-05", "only slight differences"),
    Printed("wessel2004.tools.WINDOW", 0.05, "W-04 E-W8", "N = 10 of n = 199"),
    Printed("wessel2004.transfer.SHARE", 0.2, "W-14", "may be immediately transferred"),
    Printed("hwang.setup.SAME", 1.1, "H-13", "nearly the same level"),
    Printed("precompensation.redo.WELL", 0.9, "P-05", "can describe thermal errors well"),
    Printed("precompensation.redo.AS_WELL", 1.1, "P-04", "the errors at any z can be obtained"),
)

#: constants with a test of their own below
COMPARED = {
    "chen1996.equation5": ("IMPLIED",),
    "chen1996.setup": ("SENSORS", "TEMPERATURES", "DIFFERENCES", "EQ6"),
    "wessel2004.sets": ("PAPERS_OWN",),
    "hwang.setup": ("NAMES", "TABLE_3", "PAPERS_ROWS"),
    "precompensation.setup": ("POSITIONS", "INTERPOLATIONS"),
}
#: choices of our own, and names of the virtual machine: no paper prints them
OURS = {
    "chen1996.anywhere": ("POINTS", "CLOSED", "MOST", "MIDDLE", "TOOLS"),
    "chen1996.drift": ("STARTS", "SWEEP", "SWEEP_STARTS"),
    "chen1996.equation5": ("DRAWS",),
    "chen1996.law": ("LASER", "SENSOR", "MOST", "DAYS", "DRAWS", "FEWER", "POSITIONS", "OURS", "DESIGNS"),
    "chen1996.part": ("TOOL", "PLACES", "PROBED", "HOURLY", "POINT", "SCALE"),
    "chen1996.setup": ("DRIFTS", "SPEED"),
    "chen1996.slope": ("STARTS",),
    "chen1996.unseen": ("DRAWS", "TESTS", "BETTER"),
    "chen1996.volume": ("PAPERS", "METHODS", "ROUND", "COLD", "SPINDLE"),
    "wessel2004.sets": ("TOLERANCE", "TOLERANCE_LARGER"),
    "wessel2004.tools": ("STRETCHES", "EPISODE"),
    "wessel2004.trial": ("SWEEPS", "LOOP_STEPS"),
    "hwang.setup": ("NOISES", "LAWS", "RUNS", "NEW", "TIMINGS", "OURS"),
    "precompensation.cutting": ("HOUR", "BEFORE", "BEFORE_SPEED", "ROOM", "OFTEN", "CASES", "TRIED", "HOUSE"),
    "precompensation.redo": ("BEYOND",),
    "precompensation.setup": ("BETWEEN", "GREATEST", "INTERVALS", "CUTS", "MILLING"),
    "stepwise2017.setup": ("METHODS", "THINNED"),
}
#: everything of the program that is milled, and of the way it is revised, is our own
WHOLLY_OURS = ("precompensation.program",)

#: numbers in the column "paper" of the claims that are written out there, in the order in which they stand
CLAIMED: dict[str, str] = {
    "chen1996.screening.table_1": "20",  # C-11, section 3.2
    "chen1996.equation5.consistent": "2",  # R2
    "chen1996.equation5.recovered": "20 7",  # C-10, C-20, section 3.2
    "chen1996.equation5.moves": "2",  # R2
    "chen1996.drift.sets": "810",  # C-14, section 3.2 and Fig. 2
    "chen1996.drift.coefficients": "20 35 20",  # C-10, section 3.2
    "chen1996.drift.closely": "2",  # R2
    "chen1996.drift.nodes": "9 20 3",  # C-26, section 4.2
    "chen1996.slope.cold": "18.5 8.5",  # C-22, Eq. 6 at 550 and 50 mm
    "chen1996.slope.sets": "51 20",  # C-23, section 3.3
    "chen1996.slope.terms": "3 4 6 8 7 9",  # C-24, Eq. 8
    "chen1996.slope.closely": "7",  # Fig. 7
    "chen1996.slope.net_closely": "13",  # Fig. 13
    "chen1996.law.whole": "20 4",  # C-23, section 3.3
    "chen1996.length.lateral": "92.4 7.2",  # C-35, abstract
    "chen1996.unseen.uniform": "16",  # Fig. 16
    "chen1996.unseen.tool_point": "10",  # C-35, abstract
    "chen1996.unseen.depth": "196 8",  # C-35, abstract
    "chen1996.anywhere.first_order": "1",  # C-05, section 2.2: the first-order term
    "chen1996.part.lateral": "92.4 7.2",  # C-37, conclusion 5
    "chen1996.part.depth": "196 8",  # C-37, conclusion 5
    "wessel2004.spindle.series": "199 100",  # W-06, section III
    "wessel2004.sets.calculated": "511 35259 129",  # W-10, Appendix B
    "wessel2004.sets.several": "46 7 27 1 2 3 4 1 2 8 2 4 8 2 5 8 2 8 9",  # W-11, Appendix B
    "wessel2004.sets.shared": "2 8",  # W-11, Appendix B
    "wessel2004.resting.better_at_rest": f"5.7 1.0 {5.7 / 1.0:.1f}",  # W-08, section IV
    "wessel2004.resting.locally": f"{5.7 / 1.0:.1f}",  # W-08, section IV
    "wessel2004.resting.range": "30 50",  # W-08, section IV
    "wessel2004.resting.window": "10",  # W-04, Appendix A
    "wessel2004.milling.better_at_work": f"5.0 2.2 {5.0 / 2.2:.1f}",  # W-09, section V
    "wessel2004.milling.without_episode": "17 2.2",  # W-09, section V
    "hwang.redo.groups": "7 9 10 11 12 13 4 8 5 2 1 6 3",  # H-10, Table 1; group 4 in ascending order
    "hwang.redo.representatives": "7 8 2 1",  # H-11, section 3.2.1 (E-H4)
    "hwang.redo.fewer": "4 8",  # H-11, section 3.2.1 and Table 1
    "hwang.redo.models": f"{2**13 - 1} {2**8 - 1} {1 * 2 * 1 * 2}",  # H-07: groups 1, 4, 6, 7 of Table 1
    "hwang.redo.quicker": f"{2**13 - 1} {2**8 - 1} {1 * 2 * 1 * 2}",  # H-19, section 3.2.3
    "hwang.redo.best": "7 8 2 6",  # H-11, section 3.2.1
    "hwang.redo.rows": "32",  # E-H7
    "hwang.redo.more": "7 4",  # H-15, Eq. 8 and Eq. 6
    "hwang.redo.fits": "2 0.9704 6.39 2 0.9697 6.72",  # H-12, H-13, Table 2
    "hwang.redo.predicts": "2 0.9704",  # H-12, Table 2
    "hwang.redo.collinearity": "3.3 0.019 0.363 62.8",  # H-16, Table 3
    "hwang.redo.contributions": "7 0.9599 8 0.9526 2 0.8064 6 0.8066",  # H-17, Eq. 9
    "hwang.redo.noise": "6",  # Fig. 6
    "precompensation.redo.orders": "1 0",  # P-02
    "precompensation.redo.described": "4",  # Fig. 4
    "precompensation.redo.scheduled": "10",  # P-06
    "stepwise2017.redo.given": "24",  # T-01, abstract
    "stepwise2017.redo.few": "5 3 9 11 18 23",  # T-07, section 3.2, below Eq. 8
    "stepwise2017.redo.model": "8",  # Eq. 8
    "stepwise2017.redo.beats": "6",  # Fig. 6
}


def constant(name: str) -> Any:
    """Return a constant of a study by its name below `thermocomp.papers`."""
    module, _, attribute = name.rpartition(".")
    return getattr(importlib.import_module(f"thermocomp.papers.{module}"), attribute)


def constants() -> set[str]:
    """Return the names of all constants of the five studies that are not a text."""
    found = set()
    for file in (f for study in STUDIES for f in (PAPERS / study).glob("*.py")):
        module = f"{file.parent.name}.{file.stem}"
        for node in ast.parse(file.read_text(encoding="utf-8")).body:
            targets = node.targets if isinstance(node, ast.Assign) else []
            targets = [node.target] if isinstance(node, ast.AnnAssign) else targets
            names = [n.id for t in targets for n in ast.walk(t) if isinstance(n, ast.Name)]
            found |= {f"{module}.{n}" for n in names if n.isupper()}
    return {name for name in found if not isinstance(constant(name), str)}


@pytest.mark.parametrize("printed", [*PRINTED, *CRITERIA], ids=lambda p: p.constant)
def test_a_constant_is_the_printed_number(printed: Printed) -> None:
    found = constant(printed.constant)
    assert found == printed.value
    if isinstance(found, dict):
        assert [*found] == [*printed.value]  # type: ignore[misc]  # in the order of the paper


def test_every_constant_is_compared_or_our_own() -> None:
    elsewhere = [f"{module}.{n}" for listed in (COMPARED, OURS) for module, names in listed.items() for n in names]
    elsewhere += [name for name in constants() if name.rpartition(".")[0] in WHOLLY_OURS]
    known = [*(p.constant for p in (*PRINTED, *CRITERIA)), *elsewhere]
    assert sorted(known) == sorted(constants())


def test_a_word_that_is_read_as_a_number_is_told_in_a_claim() -> None:
    """A claim holds in part at best if its criterion is our reading of a word, and says which word and number."""
    for criterion in CRITERIA:
        study, *_, name = criterion.constant.split(".")
        content = tomllib.loads((PAPERS / study / "claims.toml").read_text(encoding="utf-8"))
        entries = [entry for key, section in content.items() if key != "parts" for entry in section.values()]
        told = [entry.get("reading", "") + entry.get("softer", "") for entry in entries]
        assert name == "WINDOW" or any(re.search(f"{{{name}[:}}]", text) for text in told), criterion


def test_table_1_of_chen() -> None:
    """C-11, E-C8: the fourth symbol is scanned as an A, and is the bearing of the y axis; dT5 is an average."""
    places = {
        "T1": "air",  # environmental temperature
        "T2": "housing",  # spindle housing
        "T3": "y_nut",
        "T4": "y_bearing",
        "T6": "column_front_right",
        "T7": "column_front_left",
        "T8": "column_rear_right",
        "T9": "column_rear_left",
    }
    assert {symbol: f"t_{place}_C" for symbol, place in places.items()} == chen.SENSORS
    assert chen.TEMPERATURES == ("T1", "T2", "T3", "T4", "T5", "T6", "T7", "T8", "T9")


def test_differences_are_those_of_table_2() -> None:
    """C-12, C-23: each difference of Table 2 is a variable, and no other."""
    needed = {tuple(name.split("-")) for row in TABLE_2.values() for name in row if "-" in name}
    assert set(chen.DIFFERENCES) == needed
    assert len(chen.DIFFERENCES) == 4
    # in the order in which Table 2 uses them, which is that of their terms
    used = dict.fromkeys(name for row in TABLE_2.values() for name in row if "-" in name)
    assert ["-".join(pair) for pair in chen.DIFFERENCES] == [*used]


def test_eq_6() -> None:
    """C-22, E-C5, E-C6: printed for y in mm and a result in mm; ours is in um."""
    printed = [2.424e-4, 3.096e-4, -3.571e-6, 1.474e-8, -2.662e-11, 1.738e-14]
    assert chen.EQ6.coef.tolist() == pytest.approx([1000 * c for c in printed], rel=1e-14)
    np.testing.assert_array_equal(chen.EQ6.domain, chen.EQ6.window)
    for y, um in {0: 0.24, 50: 8.48, 100: 7.74, 250: -2.24, 500: -15.83, 550: -18.53}.items():
        assert chen.EQ6(y) == pytest.approx(um, abs=0.006)


def test_the_set_of_wessel() -> None:
    """W-11: {T1, T2, T8}; counts of W-10 follow from nine locations, 23 data sets and three displacements."""
    assert tuple(k + 1 for k in sets.PAPERS_OWN) == (1, 2, 8)
    assert sets.PAPER_SETS == 2**9 - 1
    assert sum(math.comb(9, k) for k in (1, 2, 3)) == sets.PAPER_SMALL_SETS
    assert sets.PAPER_MODELS == (2**9 - 1) * 23 * 3
    assert round(tools.WINDOW * 199) == 10  # E-W8


def test_sensors_of_hwang() -> None:
    """H-08: bearing and nut of x, y and z, two at the spindle, four at the column, beds of x and z; T14 is the zero."""
    screws = [f"{axis}_{part}" for axis in "xyz" for part in ("bearing", "nut")]
    assert HWANG_PLACES[:6] == tuple(screws)
    kinds = [place.rpartition("_")[2 if place.endswith("seat") else 0].split("_")[0] for place in HWANG_PLACES[6:]]
    assert kinds == ["seat", "seat", *["column"] * 4, "bed", "bed"]
    # T14 is the rear of the bed; front before rear, right before left
    ends = ("front_seat", "rear_seat"), ("bed_front", "bed_rear")
    column = tuple(f"column_{end}_{side}" for end in ("front", "rear") for side in ("right", "left"))
    assert HWANG_PLACES[6:] == (*ends[0], *column, *ends[1])
    assert tuple(f"T{k}" for k in range(1, 14 + 1)) == hwang.NAMES
    assert hwang.REFERENCE == "T14"
    assert sorted(k for group in hwang.TABLE_1 for k in group) == [*range(1, 13 + 1)]


def test_table_3_of_hwang() -> None:
    """H-16, E-H5, E-H6: eigenvalues as numbered there, of Eq. 6 and 8 whatever its header says; ours are sorted."""
    eq6 = {1: 18.6, 2: 3.3, 3: 155.8, 4: 1.1e4}
    eq8 = {1: 0.019, 2: 0.114, 3: 1.129, 4: 2.359, 5: 19.835, 6: 76.397, 7: 8861.812}
    assert tuple(tuple(sorted(v.values(), reverse=True)) for v in (eq6, eq8)) == hwang.TABLE_3
    # the sums of 1 / lambda beside which the claim puts ours
    assert [round(sum(1 / e for e in v.values()), d) for v, d in ((eq6, 3), (eq8, 1))] == [0.363, 62.8]


def test_rows_of_hwang() -> None:
    """E-H7: if both models of Table 2 stem from the same n rows, then R2 and standard error give n."""
    squares = (1 - 0.9704) / (1 - 0.9697) / (6.39 / 6.72) ** 2  # (n - 5) / (n - 7), with 4 and 6 terms
    assert (7 * squares - 5) / (squares - 1) == pytest.approx(hwang.PAPERS_ROWS, abs=0.5)
    assert hwang.PAPERS_ROWS == 32
    # with every printed number rounded
    least, most = (
        2 / (s - 1) + 7 for s in (0.02965 / 0.03025 / (6.385 / 6.725) ** 2, 0.02955 / 0.03035 / (6.395 / 6.715) ** 2)
    )
    assert (round(least), round(most)) == (30, 34)


def test_positions_of_precompensation() -> None:
    """P-04: z1, z2, z3, z4, whose values the fragment does not tell."""
    assert len(set(constant("precompensation.setup.POSITIONS"))) == 4


def test_numbers_in_the_claims() -> None:
    found = {}
    for study in STUDIES:
        sections = tomllib.loads((PAPERS / study / "claims.toml").read_text(encoding="utf-8"))
        for section, entries in ((s, e) for s, e in sections.items() if s != "parts"):
            for key, entry in entries.items():
                text = entry.get("paper", "").replace("{{", "").replace("}}", "")
                numbers = re.findall(r"\d+(?:\.\d+)?", re.sub(r"\{[^{}]*\}", "", text))
                if numbers:
                    found[f"{study}.{section}.{key}"] = " ".join(numbers)
    assert found == CLAIMED
