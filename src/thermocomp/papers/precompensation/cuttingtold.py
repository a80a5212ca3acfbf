"""Report of the cutting tests with NC programs: claims, tables, figures and numbers."""

import numpy as np

from thermocomp.papers.claims import Claims, Facts
from thermocomp.papers.exhibits import Exhibits
from thermocomp.papers.pictures import curves
from thermocomp.papers.precompensation import cutting, program, setup
from thermocomp.papers.precompensation.cutting import CARRIED, COOLS, FALSE, RIGHT, UNKNOWN, WARMS, Milled, Surfaces
from thermocomp.papers.precompensation.program import EVERY, NEEDED, SAFE, WAYS
from thermocomp.papers.precompensation.setup import LEAST, NET, NONE
from thermocomp.papers.study import Figure, FloatArray, PlotCurve, StudyTable, Style

claims, exhibits = Claims[Milled](__name__, setup, cutting, program), Exhibits(__name__)


@claims.facts
def _revised(m: Milled) -> Facts:
    before, after = m.without(RIGHT), m.paper(RIGHT)
    return {
        "before": before,
        "after": after,
        "over": _over(m),
        "holds": after.mean <= setup.SHARE * before.mean,
        "ranges": [(s.by_test.min(), s.by_test.max()) for s in (before, after)],
        "worse": int(np.sum(after.by_test > before.by_test)),
        "rest": [(name, m.paper(RIGHT, name).mean) for name in _models(m) if name != NET],
        "needed": m.surfaces[RIGHT, NET, NEEDED],
        "safe": m.surfaces[RIGHT, NET, SAFE],
    }


@claims.facts
def _uneven(m: Milled) -> Facts:
    made = {"before": m.without(RIGHT), "after": m.paper(RIGHT), "needed": m.surfaces[RIGHT, NET, NEEDED]}
    return {name: s.unevenness.mean(axis=(0, 2)) for name, s in made.items()}


def _changes(m: Milled, *cases: str) -> Facts:
    changes = [(m.without(case).mean, m.paper(case).mean) for case in cases]
    return {"changes": changes, "least": [m.paper(case, LEAST).mean for case in cases]}


@claims.facts
def _start(m: Milled) -> Facts:
    facts = _changes(m, UNKNOWN, CARRIED, FALSE)
    unknown, _, false = ("worse" if after > before else "better" for before, after in facts["changes"])
    return facts | {"minutes": cutting.BEFORE / 60, "unknown": unknown, "false": false}


@claims.facts
def _room(m: Milled) -> Facts:
    alone = [np.abs(m.without(case).depth - m.without(RIGHT).depth).mean() for case in (WARMS, COOLS)]
    cold = {"least_cold": m.paper(RIGHT, LEAST), "net_cold": m.paper(RIGHT)}
    return _changes(m, WARMS, COOLS) | {"alone": alone} | cold


def tables(m: Milled) -> tuple[StudyTable, ...]:
    """Return depth differences by model and revision method, by test, and by true state."""
    shown = [m.without(RIGHT), *(m.surfaces[RIGHT, NET, way] for way in WAYS), m.paper(RIGHT, LEAST)]
    by_method = [(name, [_cell(m, name, way) for way in WAYS]) for name in _models(m)]
    by_state = [
        (case, _told(m.without(case)), *(_told(m.paper(case, name)) for name in cutting.TRIED))
        for case in cutting.CASES
    ]
    return (
        exhibits.table("by_method", [(NONE, [_told(m.without(RIGHT)), "", ""]), *by_method], over=_over(m)),
        exhibits.table("by_test", enumerate(zip(*(s.by_test for s in shown), strict=True), start=1)),
        exhibits.table("by_state", by_state, over=_over(m)),
    )


def figures(m: Milled) -> tuple[Figure, ...]:
    """Return the surfaces of one test, and the depth differences of all tests."""
    tests = np.arange(1.0, len(m.without(RIGHT).depth) + 1)
    # extended to the right, where the legend hides nothing
    zero = PlotCurve("", np.array([1.0, 1.5 * len(tests)]), np.zeros(2), "dashed")
    ways: dict[str, tuple[str, Style]] = {
        "": ("not revised", "line"),
        EVERY: (EVERY, "dashed"),
        NEEDED: (NEEDED, "line"),
    }
    cold, later = (
        [PlotCurve(label, *_surfaces(m, way, number), style) for way, (label, style) in ways.items()]
        for number in (1, 2)
    )
    room, state = (
        {"not revised": m.without(RIGHT).signed} | {case: m.paper(case).signed for case in cases}
        for cases in ((RIGHT, WARMS, COOLS), (RIGHT, UNKNOWN, CARRIED, FALSE))
    )
    compared = ([*curves(tests, values, "points"), zero] for values in (room, state))
    return (
        exhibits.figure("precompensation-surfaces", cold, later),
        exhibits.figure("precompensation-programs", *compared, minutes=cutting.BEFORE / 60),
    )


def _surfaces(m: Milled, way: str, number: int) -> tuple[FloatArray, FloatArray]:
    """Return times [min] and surface positions [um], with a break in the line between two faces."""
    faces = [(face.time / 60, lies) for face, lies in m.first[way] if face.number == number]
    x, y = (np.concatenate([np.append(part, np.nan) for part in parts]) for parts in zip(*faces, strict=True))
    return x, y


def numbers(m: Milled) -> dict[str, float]:
    """Return the key numbers of the cutting tests, by name."""
    short = {
        RIGHT: "cold",
        UNKNOWN: "warm_taken_for_cold",
        CARRIED: "warm_carried_over",
        FALSE: "cold_taken_for_warm",
        WARMS: "room_warms",
        COOLS: "room_cools",
    }
    found = {"program_time_turning_as_recorded": m.turning, "program_lines": float(m.lines)}
    for case, name in short.items():
        found[f"program_depth_difference_{name}_um"] = m.without(case).mean
        found[f"program_depth_difference_{name}_revised_um"] = m.paper(case).mean
        found[f"program_depth_difference_{name}_least_squares_um"] = m.paper(case, LEAST).mean
    found["program_depth_difference_by_tolerance_um"] = m.surfaces[RIGHT, NET, NEEDED].mean
    found["program_depth_difference_by_tolerance_least_squares_um"] = m.surfaces[RIGHT, LEAST, NEEDED].mean
    found["program_depth_difference_work_offset_um"] = m.surfaces[RIGHT, NET, SAFE].mean
    return found


def _models(m: Milled) -> list[str]:
    return list(dict.fromkeys(name for _, name, _ in m.surfaces if name != NONE))


def _over(m: Milled) -> str:
    tests, positions = m.without(RIGHT).depth.shape
    return f"mean of {tests} tests and {positions} positions"


def _cell(m: Milled, name: str, way: str) -> str:
    found = m.surfaces.get((RIGHT, name, way))
    return _told(found) if found else ""


def _told(s: Surfaces) -> str:
    return f"{s.mean:.1f} ({s.most:.1f})"
