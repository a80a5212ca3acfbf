"""Random programs of a milling machine with rotary axes, as CAM posts and shops write them, for LinuxCNC.

`program(seed)` gives the same text for the same seed. Almost all of them run in the interpreter; what it refuses
is no program, and whoever uses these leaves it out.
"""

import random
from collections.abc import Callable

import machine_cuts
import machine_holes
import machine_places
from machine_writer import Writer

_NOTES = (
    "Fräser Ø6 Schlichten",
    "Bohrbild ±0.05",
    "pocket 1",
    "check clamp!",
    "T2 = 8.5mm drill",
    "Op 20 - rear",
)
_TRIFLES = {
    "dwell": ("G4 P0.2", "G4 P0.5", "G4 P1.", "G4 P2"),
    "coolant": ("M8", "M7", "M9"),
    "safe": ("G90", "G40", "G17 G40", "G94", "G90 G17"),
    "path": ("G64", "G61", "G64 P0.005", "G61.1"),
    "/": ("/M8", "/M9", "/M1", "/G4 P0.5", "/M0"),
    "stop": ("M0", "M1", "M1", "M60"),
}


def program(seed: int) -> str:
    """Return a program of some 15 to 80 lines, its letters within Latin-1."""
    w = Writer(random.Random(seed))
    _begin(w)
    length = w.draw.randint(14, 66)
    names = list(SECTIONS)
    weights = [SECTIONS[name][0] for name in names]
    while len(w.lines) < length:
        name = w.draw.choices(names, weights)[0]
        if not (w.machine == "mill" and name in _ROTARY):
            SECTIONS[name][1](w)
        if w.maybe(0.25):
            _trifle(w)
    _end(w)
    return w.text()


def _begin(w: Writer) -> None:
    draw = w.draw
    if w.percent:
        w.lines.append("%")
    if w.maybe(0.5):
        w.lines.append(f"({draw.choice(_NOTES)})")
    w.inch = w.maybe(0.12)
    codes = ["G20" if w.inch else "G21", "G90", "G17", "G40", "G80", "G94", "G54"]
    style = draw.choice(("one", "one", "each", "few"))
    w.retract = draw.choice(("", "", "", "G98", "G99"))
    path = draw.choice(("", "", "G64", "G64 P0.01", "G61", "G64 P0.02 Q0.01"))
    if style == "few" and not w.inch:
        codes = draw.sample(codes[1:], 3)
    if style == "each":
        for code in codes:
            w.put(code)
    else:
        w.put(" ".join(codes))
    if path:
        w.put(path)
    if w.retract and w.maybe(0.7):
        w.put(w.retract)
    else:
        w.retract = ""
    if w.maybe(0.85):
        machine_places.tool(w, first=True)
    else:
        w.put(f"S{draw.choice((800, 3000, 12000))} M3")
        w.up = False
    machine_places.approach(w)


def _end(w: Writer) -> None:
    if w.maybe(0.7):
        w.rapid(Z=w.clear)
    if w.maybe(0.4):
        w.put("M5")
    if w.maybe(0.3):
        w.put("M9")
    if w.maybe(0.3):
        w.put(w.draw.choice(("G53 G0 Z0", "G28", "G91 G28 Z0", "G53 G0 X0 Y0", "G0 X0 Y0", "G54", "G49")))
    w.put(w.draw.choice(("M30", "M2", "M30", "M5 M30")))
    if w.percent:
        w.lines.append("%")


def _trifle(w: Writer) -> None:
    """Put a line that moves nothing, one that the operator may skip, or a stop."""
    draw = w.draw
    kind = draw.choice(
        ("blank", "note", "dwell", "coolant", "safe", "speed", "path", "/", "/ move", "stop", "stop", "stop")
    )
    if kind == "blank":
        w.lines.append("")
    elif kind == "note":
        w.lines.append(f"({draw.choice(_NOTES)})")
    elif kind == "speed":
        w.put(f"S{draw.randint(5, 120) * 100}")
    elif kind == "/ move":
        _skipped(w)
    else:
        w.put(draw.choice(_TRIFLES[kind]))
        if kind in ("/", "stop", "safe"):
            w.stopped()
        if kind == "stop":
            machine_places.wake(w)


def _skipped(w: Writer) -> None:
    """Put an optional line, behind which all axes are positioned again."""
    x, y = w.spot()
    w.rapid(Z=w.clear)
    w.lines.append(f"/G0 X{w.number(x)} Y{w.number(y)}")
    w.motion = "G0"
    w.lost("X", "Y")
    w.rapid(X=x + 5.0, Y=y)


#: name -> how often, and what writes it
SECTIONS: dict[str, tuple[int, Callable[[Writer], None]]] = {
    "contour": (5, machine_cuts.contour),
    "face": (2, machine_cuts.pass_at_depth),
    "drill": (7, machine_holes.drill),
    "tap": (1, machine_holes.tap),
    "steps": (3, machine_holes.steps),
    "systems": (3, machine_places.systems),
    "shift": (2, machine_places.shift),
    "home": (3, machine_places.home),
    "flat": (2, machine_cuts.flat),
    "planes": (3, machine_cuts.planes),
    "bore": (2, machine_cuts.helical_bore),
    "compensated": (1, machine_cuts.compensated),
    "inverse": (2, machine_cuts.inverse),
    "per turn": (1, machine_cuts.per_turn),
    "inches": (1, machine_cuts.inches),
    "parameters": (2, machine_cuts.parameters),
    "tool": (4, machine_places.tool),
    "index": (2, machine_cuts.index),
    "turn": (4, machine_cuts.turn),
    "wind": (3, machine_cuts.wind),
}
_ROTARY = frozenset(("index", "turn", "wind"))
