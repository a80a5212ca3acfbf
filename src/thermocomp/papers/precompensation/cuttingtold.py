"""Report of the cutting tests with NC programs: claims, tables, figures and numbers."""

import numpy as np

from thermocomp.papers.pictures import curves
from thermocomp.papers.precompensation import cutting
from thermocomp.papers.precompensation.cutting import CARRIED, COOLS, FALSE, RIGHT, UNKNOWN, WARMS, Milled, Surfaces
from thermocomp.papers.precompensation.program import EVERY, NEEDED, SAFE, TOLERANCE, WAYS
from thermocomp.papers.precompensation.setup import LEAST, NET, NONE, PAPERS_DEPTHS, SHARE
from thermocomp.papers.study import Claims, Figure, FloatArray, Ours, Panel, PlotCurve, StudyTable, Style

claims = Claims[Milled]()


@claims.add(
    "P-06 P-07",
    "The same with whole NC programs: written, revised by the net every 10 min, read back, and milled on the "
    f"virtual machine (criterion: {SHARE:.2f} is left)",
    f"{PAPERS_DEPTHS[0]:g} -> {PAPERS_DEPTHS[1]:g} um",
)
def _revised(m: Milled) -> Ours:
    before, after = m.without(RIGHT), m.paper(RIGHT)
    worse = int(np.sum(after.by_test > before.by_test))
    rest = "; ".join(f"{name}: {m.paper(RIGHT, name).mean:.1f} um" for name in _models(m) if name != NET)
    ranges = [f"{s.by_test.min():.1f} to {s.by_test.max():.1f}" for s in (before, after)]
    return Ours(
        f"{before.mean:.1f} -> {after.mean:.1f} um, {_over(m)}",
        after.mean <= SHARE * before.mean,
        note=f"By test {' -> '.join(ranges)} um; it grows in {worse} of {len(after.depth)}. With other models {rest}. "
        f"Revised as soon as the drift has moved by {TOLERANCE:g} um, it is {m.surfaces[RIGHT, NET, NEEDED].mean:.1f} "
        f"um; by the work offset, between the faces only, {m.surfaces[RIGHT, NET, SAFE].mean:.1f} um. The first program"
        f" has {m.lines} lines; in {m.turning:.1%} of the time the spindle turns as in the recorded tests.",
    )


@claims.add("P-06", "Within one surface, from its lowest to its highest place: milled cold, and after the hour")
def _uneven(m: Milled) -> Ours:
    def within(s: Surfaces) -> str:
        first, second = s.unevenness.mean(axis=(0, 2))
        return f"{first:.1f} and {second:.1f} um"

    return Ours(
        f"{within(m.without(RIGHT))}; revised every 10 min {within(m.paper(RIGHT))}, by {TOLERANCE:g} um "
        f"{within(m.surfaces[RIGHT, NET, NEEDED])}",
        note="Depth differences do not show it: the tool warms up in either surface, by cutting, which no model of the "
        "speed knows of.",
    )


@claims.add(
    "E-P5",
    f"The start state is wrong by half an hour: the spindle had run at {cutting.BEFORE_SPEED:g} 1/min for "
    f"{cutting.BEFORE / 60:g} min when the program began, which was revised for a cold machine; revised with the state "
    "carried over; and a cold machine with a program revised for one that had run",
    "assumes a cold start",
)
def _start(m: Milled) -> Ours:
    cases = (UNKNOWN, CARRIED, FALSE)
    before, after, least = (
        [s.mean for s in each]
        for each in (map(m.without, cases), map(m.paper, cases), (m.paper(c, LEAST) for c in cases))
    )
    unknown, _, false = ("worse" if a > b else "better" for a, b in zip(after, before, strict=True))
    return Ours(
        "; ".join(f"{b:.1f} -> {a:.1f} um" for b, a in zip(before, after, strict=True)),
        note=f"With least squares {', '.join(f'{e:.1f}' for e in least)} um. "
        f"Taken for cold, the warm machine mills {unknown} than with a program that nobody has revised; "
        f"taken for warm, the cold one {false}.",
    )


@claims.add(
    "E-P6",
    f"The room warms, or cools, by {cutting.ROOM:g} degC in the hour between the surfaces, and the program does not "
    "know",
    "a relatively stable environment",
)
def _room(m: Milled) -> Ours:
    cases = (WARMS, COOLS)
    alone = [np.abs(m.without(c).depth - m.without(RIGHT).depth).mean() for c in cases]
    return Ours(
        "; ".join(f"{m.without(c).mean:.1f} -> {m.paper(c).mean:.1f} um" for c in cases),
        note=f"The room alone moves the second surface by {alone[0]:.1f} um, or {alone[1]:.1f} um: nothing of it can "
        f"be in the program. With least squares {' and '.join(f'{m.paper(c, LEAST).mean:.1f}' for c in cases)} um are "
        f"left; in a room that stays, {m.paper(RIGHT, LEAST).mean:.1f} um, with the net {m.paper(RIGHT).mean:.1f} um.",
    )


def tables(m: Milled) -> tuple[StudyTable, ...]:
    """Return depth differences by model and revision method, by test, and by true state."""
    shown = [(NONE, ""), *((NET, way) for way in WAYS), (LEAST, EVERY)]
    return (
        StudyTable(
            f"Depth difference with NC programs, {_over(m)}; in brackets the greatest [um]",
            ("model", *WAYS),
            [
                [NONE, _told(m.without(RIGHT)), "", ""],
                *([name, *(_cell(m, name, way) for way in WAYS)] for name in _models(m)),
            ],
        ),
        StudyTable(
            "Depth difference with NC programs, mean over the positions [um]",
            ("", *(f"{name.partition(',')[0]}{way and f', {way}'}" for name, way in shown)),
            [
                [f"test {n + 1}", *(f"{m.surfaces[RIGHT, name, way].by_test[n]:.1f}" for name, way in shown)]
                for n in range(len(m.without(RIGHT).depth))
            ],
        ),
        StudyTable(
            f"Depth difference with NC programs revised {EVERY}, {_over(m)}; in brackets the greatest [um]",
            ("machine and room", NONE, *cutting.TRIED),
            [
                [case, _told(m.without(case)), *(_told(m.paper(case, name)) for name in cutting.TRIED)]
                for case in cutting.CASES
            ],
        ),
    )


def figures(m: Milled) -> tuple[Figure, ...]:
    """Return the surfaces of one test, and the depth differences of all tests."""
    tests = np.arange(1.0, len(m.without(RIGHT).depth) + 1)
    # extended to the right, where the legend hides nothing
    zero = PlotCurve("", np.array([1.0, 1.5 * len(tests)]), np.zeros(2), "dashed")
    ways: tuple[tuple[str, str, Style], ...] = (
        ("", "not revised", "line"),
        (EVERY, EVERY, "dashed"),
        (NEEDED, NEEDED, "line"),
    )
    return (
        Figure(
            "precompensation-surfaces",
            "Test 1: where the surfaces lie that its NC program mills, at one position of Z after the other, cold and "
            "after the hour; revised with the net. Not in the paper.",
            [
                Panel(
                    title,
                    "time [min]",
                    "actual minus drawing [um]",
                    [PlotCurve(label, *_surfaces(m, way, number), style) for way, label, style in ways],
                )
                for number, title in ((1, "milled cold"), (2, "milled after the hour"))
            ],
            columns=2,
        ),
        Figure(
            "precompensation-programs",
            "Second surface minus first, mean over the positions, of NC programs revised every 10 min with the net "
            "(P-07); and where room (E-P6) or start state (E-P5) are not what the revision takes them for. Warm: the "
            f"spindle had run for {cutting.BEFORE / 60:g} min before.",
            [
                Panel(title, "cutting test", "depth difference [um]", [*curves(tests, values, "points"), zero])
                for title, values in (
                    (
                        f"revised: {what}",
                        {"not revised": m.without(RIGHT).signed} | {case: m.paper(case).signed for case in cases},
                    )
                    for what, cases in (
                        ("the room", (RIGHT, WARMS, COOLS)),
                        ("the start state", (RIGHT, UNKNOWN, CARRIED, FALSE)),
                    )
                )
            ],
        ),
    )


def _surfaces(m: Milled, way: str, number: int) -> tuple[FloatArray, FloatArray]:
    """Return times [min] and surface positions [um], with a break in the line between two faces."""
    faces = [(face.time / 60, lies) for face, lies in m.first[way] if face.number == number]
    x, y = (np.concatenate([np.append(part, np.nan) for part in parts]) for parts in zip(*faces, strict=True))
    return x, y


def numbers(m: Milled) -> dict[str, float]:
    """Return the numbers by name."""
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
