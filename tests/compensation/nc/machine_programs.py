"""Random programs of a milling machine with rotary axes, as CAM posts and shops write them, for LinuxCNC.

`program(seed)` gives the same text for the same seed. Almost all of them run in the interpreter; what it refuses
is no program, and whoever uses these leaves it out.
"""

import random
from collections.abc import Callable

from machine_writer import Writer

_NOTES = ("Fräser Ø6 Schlichten", "Bohrbild ±0.05", "pocket 1", "check clamp!", "T2 = 8.5mm drill", "Op 20 – rear".replace("–", "-"))
_CYCLES = ("G81", "G81", "G82", "G83", "G73", "G85", "G86", "G89")


def program(seed: int) -> str:
    """Return a program of 15 to 80 lines, its letters within Latin-1."""
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
        _tool(w, first=True)
    else:
        w.put(f"S{draw.choice((800, 3000, 12000))} M3")
        w.up = False
    _approach(w)


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
    """Put a line that moves nothing, or one that the operator may skip."""
    draw = w.draw
    kind = draw.randint(0, 11)
    if kind == 0:
        w.lines.append("")
    elif kind == 1:
        w.lines.append(f"({draw.choice(_NOTES)})")
    elif kind == 2:
        w.put(f"G4 P{draw.choice(('0.2', '0.5', '1.', '2'))}")
    elif kind == 3:
        w.put(draw.choice(("M8", "M7", "M9")))
    elif kind == 4:
        w.put(f"S{draw.randint(5, 120) * 100}")
    elif kind == 5:
        w.put(draw.choice(("/M8", "/M9", "/M1", "/G4 P0.5", "/M0")))
        w.stopped()
    elif kind == 6:
        w.put(draw.choice(("G64", "G61", "G64 P0.005", "G61.1")))
    elif kind == 7:
        _skipped(w)
    elif kind in (8, 9, 10):
        w.put(draw.choice(("M0", "M1", "M1", "M60")))
        w.stopped()
        _wake(w)
    else:
        w.put(f"G{w.number(0, 0)}" if w.maybe(0.5) else draw.choice(("G0", "G1")))
        w.motion = "G0"
        w.lines.pop()


def _skipped(w: Writer) -> None:
    """Put an optional line, behind which all axes are positioned again."""
    x, y = w.spot()
    w.rapid(Z=w.clear)
    w.lines.append(f"/G0 X{w.number(x)} Y{w.number(y)}")
    w.motion = "G0"
    w.lost("X", "Y")
    w.rapid(X=x + 5.0, Y=y)


def _wake(w: Writer) -> None:
    """Go on after the operator or the tool changer may have moved the axes: some name one axis at first."""
    x, y = w.spot()
    way = w.draw.randint(0, 4)
    if way == 0:
        w.rapid(X=x)
        w.rapid(Y=y)
        w.rapid(Z=w.clear)
    elif way == 1:
        w.rapid(X=x, Y=y)
        w.rapid(Z=w.clear)
    elif way == 2:
        w.rapid(Z=w.clear)
        w.rapid(X=x, Y=y)
    elif way == 3:
        w.rapid(X=x, Y=y, Z=w.clear)
    else:
        w.rapid(X=x)
        w.rapid(X=x + 10.0)
        w.rapid(X=x, Y=y, Z=w.clear)


def _approach(w: Writer) -> None:
    x, y = w.spot()
    way = w.draw.randint(0, 3)
    rotary = dict.fromkeys(w.rotary, 0.0) if w.maybe(0.6) else {}
    if way == 0:
        w.rapid(X=x, Y=y, Z=w.clear, **rotary)
    elif way == 1:
        w.rapid(X=x, Y=y, **rotary)
        w.rapid(Z=w.clear)
    elif way == 2:
        w.rapid(Z=w.clear)
        w.rapid(X=x, Y=y, **rotary)
    else:
        w.put("G53 G0 Z0")
        w.lost("Z")
        w.rapid(X=x, Y=y, **rotary)
        w.rapid(Z=w.clear)


def _ready(w: Writer) -> None:
    """Stand above the part, all of X, Y, Z certain."""
    if any(w.at.get(letter) is None for letter in "XYZ"):
        x, y = w.spot()
        w.rapid(Z=w.clear)
        w.rapid(X=x, Y=y)
    elif (w.at["Z"] or 0.0) < 1.0:
        w.rapid(Z=w.clear)


def _tool(w: Writer, first: bool = False) -> None:
    draw = w.draw
    if not first:
        way = draw.randint(0, 3)
        if way == 0:
            w.rapid(Z=w.clear)
        elif way == 1:
            w.put("G53 G0 Z0")
        elif way == 2:
            w.put("G91 G28 Z0")
            w.put("G90")
        if w.maybe(0.6):
            w.put("M5")
        if w.maybe(0.3):
            w.put("M9")
        if w.maybe(0.2):
            w.put("G49")
    number = draw.randint(1, 6)
    w.put(draw.choice((f"T{number} M6", f"M6 T{number}", f"T{number}\nM6")))
    way = draw.randint(0, 9)
    if way <= 5:
        w.put(f"G43 H{number}")
    elif way == 6:
        w.put("G43")
    elif way == 7:
        w.put(f"G43.1 Z{w.number(draw.choice((50.0, 112.345)))}")
    elif way == 8:
        w.put(f"G43 H{number}")
        w.put(f"G43.2 H{draw.randint(1, 6)}")
    w.put(draw.choice((f"S{draw.randint(8, 120) * 100} M3", f"M3 S{draw.randint(8, 120) * 100}")))
    if w.maybe(0.3):
        w.put("M8")
    w.motion = ""
    w.lost("X", "Y", "Z")
    if not first:
        _wake(w)


def _contour(w: Writer) -> None:
    """Plunge, lines and corners, and up: some with a ramp, some in several depths."""
    draw = w.draw
    _ready(w)
    x, y = w.spot()
    a, b, r = draw.uniform(20, 60), draw.uniform(15, 40), draw.uniform(2, 6)
    w.rapid(X=x, Y=y)
    w.rapid(Z=2.0)
    for k in range(draw.randint(1, 2)):
        depth = -1.0 - k - draw.choice((0.0, 0.25))
        w.feed(f=draw.randint(10, 60) * 10, Z=depth)
        f = draw.randint(20, 200) * 10
        w.feed(f=f, X=x + a, **({"Z": depth - 0.2} if w.maybe(0.2) else {}))
        if w.maybe(0.6):
            w.arc("G3", (r * 0, r), X=x + a + r, Y=y + r)
            w.feed(Y=y + b)
            w.arc("G3", (-r, 0.0), X=x + a, Y=y + b + r)
            w.feed(X=x)
            w.feed(X=x, Y=y)
        else:
            w.feed(Y=y + b)
            w.feed(X=x)
            w.feed(Y=y)
    w.rapid(Z=draw.choice((2.0, w.clear)))


def _pass_at_depth(w: Writer) -> None:
    """Face a surface: several lines, a rapid at depth among them."""
    _ready(w)
    x, y = w.spot()
    w.rapid(X=x, Y=y)
    w.feed(f=400, Z=-0.5)
    for k in range(w.draw.randint(2, 4)):
        w.feed(f=1500, X=x + (60.0 if k % 2 == 0 else 0.0))
        (w.rapid if w.maybe(0.3) else w.feed)(Y=y + 5.0 * (k + 1))
    w.rapid(Z=w.clear)


def _drill(w: Writer) -> None:
    """Holes, with and without an approach in Z, and what comes behind G80."""
    draw = w.draw
    code = draw.choice(_CYCLES)
    x, y = w.spot()
    way = draw.randint(0, 4)
    if way == 0:
        w.put("G53 G0 Z0")
        w.lost("Z")
        w.motion = "G0"
    elif way in (1, 2):
        w.rapid(Z=w.clear)
    if way or w.maybe(0.8):
        w.rapid(X=x, Y=y)
    else:
        _known_xy(w, x, y)
    habit = draw.choice(("none", "none", "98", "99", "99 then 98", "mixed"))
    level = {"none": "", "98": "G98", "99": "G99", "99 then 98": "G99", "mixed": "G99"}[habit]
    for series in range(draw.choice((1, 1, 2))):
        depth, r = -draw.choice((3.0, 8.5, 12.0)), draw.choice((1.0, 2.0, 3.0, 5.0))
        extra = {"G82": " P0.3", "G86": " P0.2", "G89": " P0.2", "G83": " Q2.5", "G73": " Q1.7"}.get(code, "")
        if w.inch:
            extra = extra.replace("Q2.5", "Q0.1").replace("Q1.7", "Q0.07")
        holes = draw.randint(2, 5)
        for k in range(holes):
            x, y = x + draw.choice((10.0, 15.0)), y + draw.choice((0.0, 0.0, 10.0))
            last = k == holes - 1
            place = f"X{w.number(x)} Y{w.number(y)}" if w.repeat or w.maybe(0.5) or k == 0 else f"X{w.number(x)}"
            if "Y" not in place:
                y = w.at["Y"] if w.at["Y"] is not None else y
            told = level if k == 0 and series == 0 else ""
            if (habit == "99 then 98" and last) or (habit == "mixed" and k and w.maybe(0.5)):
                told = "G98"
            full = f"{code} {place} Z{w.number(depth)} R{w.number(r)}{extra} F{w.feedrate(draw.randint(6, 40) * 10)}"
            w.put(f"{told} {full if k == 0 or w.repeat else place}".strip())
            w.at["X"], w.at["Y"] = x, y
        if series == 0:
            code = draw.choice(_CYCLES)
    w.lost("Z")
    w.motion = ""
    if w.maybe(0.85):
        w.put("G80")
    if w.maybe(0.2):
        w.put("G4 P0.3")
    for _ in range(draw.choice((0, 1, 2))):
        w.motion = ""
        x += 10.0
        w.rapid(**(draw.choice(({"X": x}, {"Y": y + 20.0}, {"X": x, "Y": y}))))
    w.rapid(Z=w.clear)


def _known_xy(w: Writer, x: float, y: float) -> None:
    if w.at["X"] is None or w.at["Y"] is None:
        w.rapid(X=x, Y=y)


def _tap(w: Writer) -> None:
    _ready(w)
    x, y = w.spot()
    speed = w.draw.choice((300, 500))
    w.put(f"S{speed} M3")
    w.rapid(X=x, Y=y)
    w.put(f"{w.draw.choice(('G98 ', 'G99 ', ''))}G84 X{w.number(x)} Y{w.number(y)} Z{w.number(-8)} R{w.number(3)} F{w.feedrate(speed)}")
    w.put(f"X{w.number(x + 12)}")
    w.put("G80")
    w.motion = ""
    w.lost("Z")
    w.at["X"], w.at["Y"] = x + 12, y
    w.rapid(Z=w.clear)


def _steps(w: Writer) -> None:
    """Moves, arcs and cycles in G91."""
    draw = w.draw
    _ready(w)
    w.put("G91")
    w.absolute = False
    kind = draw.randint(0, 2)
    if kind == 0:
        w.by("G0", Z=-(w.at["Z"] or 0.0) + 1.0)
        w.by("G1", f=300, Z=-2.0)
        for _ in range(draw.randint(1, 4)):
            w.by("G1", f=draw.choice((None, 600)), X=draw.uniform(-20, 20), Y=draw.choice((None, 5.0)))
        w.by("G0", Z=w.clear + 1.0)
    elif kind == 1:
        w.by("G1", f=500, Z=-1.5)
        r = draw.uniform(3, 12)
        w.put(f"{draw.choice(('G2', 'G3'))} X{w.number(2 * r)} Y0 I{w.number(r)} J0")
        w.motion = "G2"
        w.at["X"] = (w.at["X"] or 0.0) + 2 * float(w.number(r)) * w.unit
        w.by("G1", X=-5.0)
        w.by("G0", Z=1.5)
    else:
        r = -(w.at["Z"] or 0.0) + 2.0
        repeats = draw.choice(("", " L2", " L3"))
        told = draw.choice(("", "G98 ", "G99 "))
        w.put(f"{told}G81 X{w.number(8)} Y{w.number(0)} Z{w.number(-6)} R{w.number(r)}{repeats} F{w.feedrate(200)}")
        if w.maybe(0.5):
            w.put(f"X{w.number(5)} Y{w.number(4)}")
        w.put("G80")
        w.motion = ""
        w.lost("X", "Y", "Z")
    w.put("G90")
    w.absolute = True
    _ready(w)


def _systems(w: Writer) -> None:
    """Go on in another work coordinate system, some of which the program has set."""
    draw = w.draw
    w.rapid(Z=w.clear) if w.maybe(0.7) else w.put("G53 G0 Z0")
    system = draw.choice((1, 2, 2, 3, 4, 6, 7, 9))
    name = f"G{53 + system}" if system <= 6 else f"G59.{system - 6}"
    if w.maybe(0.35):
        axes = draw.choice(("XYZ", "XY", "Z"))
        words = " ".join(f"{a}{w.number(draw.uniform(-90, 90))}" for a in axes)
        w.put(f"G10 L2 P{system} {words}")
    w.put(name)
    w.lost("X", "Y", "Z")
    _wake(w)
    if w.maybe(0.3):
        axes = draw.choice(("X", "Z", "XY"))
        w.put(f"G10 L20 P{draw.choice((0, system))} " + " ".join(f"{a}{w.number(10)}" for a in axes))
        for a in axes:
            w.at[a] = 10.0
    _ready(w)


def _shift(w: Writer) -> None:
    """G92 or G52, a cut, and back."""
    draw = w.draw
    _ready(w)
    kind = draw.randint(0, 2)
    if kind == 0:
        axes = draw.choice(("X", "XY", "Z", "XYZ"))
        w.put("G92 " + " ".join(f"{a}{w.number(draw.choice((0, 5, 12.5)))}" for a in axes))
        back = draw.choice(("G92.1", "G92.2", "G92.1"))
    else:
        axes = draw.choice(("X", "XY", "Z"))
        w.put("G52 " + " ".join(f"{a}{w.number(draw.uniform(-30, 30))}" for a in axes))
        back = "G52 " + " ".join(f"{a}0" for a in axes)
    w.lost(*axes)
    x, y = w.spot()
    w.rapid(X=x, Y=y, Z=w.clear)
    w.feed(f=500, Z=-1.0)
    w.feed(X=x + 30.0)
    w.rapid(Z=w.clear)
    w.put(back)
    w.lost(*"XYZ")
    w.rapid(X=x, Y=y) if w.maybe(0.5) else None
    w.rapid(Z=w.clear)
    _ready(w)


def _home(w: Writer) -> None:
    draw = w.draw
    kind = draw.choice(("G28", "G30", "G28 Z", "G30 Z", "91", "G53 Z", "G53 XY", "G53 G1", "G28 XYZ"))
    w.rapid(Z=w.clear)
    if kind in ("G28", "G30"):
        w.put(kind)
        w.lost(*"XYZ", *w.rotary)
    elif kind in ("G28 Z", "G30 Z"):
        w.put(f"{kind}{w.number(w.clear + 10)}")
        w.lost("Z")
    elif kind == "91":
        w.put(f"G91 {draw.choice(('G28', 'G30'))} Z0")
        w.put("G90")
        w.lost("Z")
    elif kind == "G28 XYZ":
        x, y = w.spot()
        w.put(f"G28 X{w.number(x)} Y{w.number(y)} Z{w.number(w.clear)}")
        w.lost(*"XYZ")
    elif kind == "G53 Z":
        w.put("G53 G0 Z0")
        w.lost("Z")
    elif kind == "G53 XY":
        w.put(f"G53 G0 X{w.number(-100)} Y{w.number(-50)}")
        w.lost("X", "Y")
    else:
        w.put(f"G53 G1 Z0 F{w.feedrate(900)}")
        w.lost("Z")
    w.motion = ""
    _wake(w)


def _planes(w: Writer) -> None:
    """Arcs in all planes: half and full circles, by centre and by radius, with a helix."""
    draw = w.draw
    _ready(w)
    x, y = w.spot()
    w.rapid(X=x, Y=y)
    w.rapid(Z=3.0)
    w.feed(f=600, Z=0.5)
    for _ in range(draw.randint(1, 3)):
        plane = draw.choice(("G17", "G17", "G18", "G19"))
        first, letter, other = {"G17": ("X", "I", "J"), "G18": ("X", "I", "K"), "G19": ("Y", "J", "K")}[plane]
        r, code = draw.uniform(4, 15), draw.choice(("G2", "G3"))
        at = w.at[first] or 0.0
        w.motion = ""
        shape = draw.choice(("half", "radius", "full"))
        third = {"G17": "Z", "G18": "Y", "G19": "X"}[plane]
        helix = f" {third}{w.number((w.at[third] or 0.0) - 0.3)}" if w.maybe(0.3) else ""
        if helix:
            w.at[third] = (w.at[third] or 0.0) - 0.3
        if shape == "full":
            w.put(f"{plane} {code} {letter}{w.number(r)} {other}0{helix}")
            continue
        end = at + 2 * r if shape == "half" else at + 1.5 * r
        how = f"{letter}{w.number(r)} {other}0" if shape == "half" else f"R{w.number(r * draw.choice((1.0, 1.3)))}"
        if shape == "half":
            w.put(f"{plane} {code} {first}{w.number(end)} {how}{helix}")
        else:
            second = {"G17": "Y", "G18": "Z", "G19": "Z"}[plane]
            w.put(f"{plane} {code} {first}{w.number(end)} {second}{w.number(w.at[second] or 0.0)} {how}{helix}")
        w.at[first] = end
    w.put("G17")
    w.motion = ""
    w.rapid(Z=w.clear)


def _helical_bore(w: Writer) -> None:
    draw = w.draw
    _ready(w)
    x, y = w.spot()
    r = draw.uniform(5, 15)
    w.rapid(X=x, Y=y)
    w.rapid(Z=1.0)
    w.feed(f=400, X=x + r)
    depth = 1.0
    for _ in range(draw.randint(1, 3)):
        depth -= 2.0
        turns = draw.choice(("", "", " P2"))
        w.arc("G3", (-r, 0.0), X=x + r, Y=y, Z=depth, extra=turns)
    if w.maybe(0.6):
        w.arc("G3", (-r, 0.0), X=x + r, Y=y)
    w.feed(X=x)
    w.rapid(Z=w.clear)


def _compensated(w: Writer) -> None:
    """A contour on the outside, under cutter radius compensation."""
    draw = w.draw
    _ready(w)
    x, y = w.spot()
    a, b = draw.uniform(20, 50), draw.uniform(20, 50)
    d = w.number(6.0)
    w.rapid(X=x - 15.0, Y=y - 15.0)
    w.rapid(Z=2.0)
    w.feed(f=300, Z=-2.0)
    left = w.maybe(0.5)
    w.put(f"{'G41.1' if left else 'G42.1'} D{d}")
    corners = [(x, y), (x, y + b), (x + a, y + b), (x + a, y), (x, y)]
    w.feed(f=800, X=x, Y=y - 8.0) if left else w.feed(f=800, X=x - 8.0, Y=y)
    for p, q in corners[1:] if left else [corners[3], corners[2], corners[1], corners[0]]:
        w.feed(X=p, Y=q)
    w.feed(X=x - 8.0, Y=y) if left else w.feed(X=x, Y=y - 8.0)
    w.put("G40")
    w.feed(X=x - 15.0, Y=y - 15.0)
    w.rapid(Z=w.clear)


def _inverse(w: Writer) -> None:
    """Feed by inverse time, as posts for rotary axes write it."""
    draw = w.draw
    _ready(w)
    x, y = w.spot()
    w.rapid(X=x, Y=y)
    w.put("G93")
    w.mode, w.told = 93, None
    w.feed(f=draw.choice((20, 35.5)), Z=-1.0)
    for _ in range(draw.randint(1, 4)):
        turn = {letter: draw.uniform(-180, 180) for letter in w.rotary[:1] if w.maybe(0.7)}
        moved = {} if turn and w.maybe(0.5) else {"X": x + draw.uniform(-20, 20)}
        w.feed(f=draw.choice((10, 24.5, 60)), **moved, **turn)
    w.put(f"G94 F{w.feedrate(600)}")
    w.mode, w.told = 94, None
    w.rapid(Z=w.clear)


def _per_turn(w: Writer) -> None:
    _ready(w)
    x, y = w.spot()
    w.put("S1500 M3")
    w.rapid(X=x, Y=y)
    w.put(f"G95 F{w.number(0.15)}")
    w.mode, w.told = 95, 0.15
    w.feed(f=0.15, Z=-1.0)
    w.feed(f=w.draw.choice((0.15, 0.3)), X=x + 25.0)
    if w.rotary and w.maybe(0.4):
        w.feed(f=2.0, **{w.rotary[0]: w.draw.uniform(-90, 90)})
    w.put(f"G94 F{w.feedrate(600)}")
    w.mode, w.told = 94, None
    w.rapid(Z=w.clear)


def _inches(w: Writer) -> None:
    """A stretch in the other unit, without a tool length in force when it changes."""
    draw = w.draw
    _ready(w)
    if w.lengthy():
        w.put("G49")
        w.lost("Z")
    w.inch = not w.inch
    w.put("G20" if w.inch else "G21")
    w.told = None
    x, y = w.spot()
    w.rapid(X=x, Y=y, Z=w.clear)
    w.feed(f=500, Z=-1.0)
    w.feed(X=x + draw.uniform(5, 30))
    w.rapid(Z=w.clear)
    w.inch = not w.inch
    w.put("G20" if w.inch else "G21")
    w.told = None
    w.rapid(X=x, Y=y, Z=w.clear)


def _parameters(w: Writer) -> None:
    draw = w.draw
    _ready(w)
    x, y = w.spot()
    depth = draw.choice((0.8, 2.25))
    w.put(f"#<depth>={w.number(depth)}")
    w.put(f"#1={w.number(x)} #2=[#1+{w.number(20)}]")
    w.put(f"G0 X#1 Y{w.number(y)}")
    w.put(f"G1 Z[0-#<depth>] F{w.feedrate(300)}")
    w.put(f"X[#2] F[{w.feedrate(100)}*4]")
    w.put(f"Y[{w.number(y)}+10/2]" if not w.inch else f"Y{w.number(y)}")
    w.put(f"G0 Z[#<depth>+{w.number(w.clear)}]")
    w.motion, w.told = "G0", None
    w.at |= {"X": x + 20.0, "Y": None, "Z": None}
    _ready(w)


def _index(w: Writer) -> None:
    """Turn in rapid, and cut in XYZ, the rotary words repeated or not."""
    _ready(w)
    for _ in range(w.draw.randint(1, 3)):
        x, y = w.spot()
        w.rapid(**{w.rotary[0]: w.draw.choice((0.0, 45.0, 90.0, 180.0, -30.0))})
        w.rapid(X=x, Y=y)
        w.feed(f=500, Z=-1.5)
        w.feed(X=x + 20.0)
        w.rapid(Z=w.clear)


def _turn(w: Writer) -> None:
    """Feed with the rotary axis alone, as an engraving or a groove around a shaft."""
    draw = w.draw
    _ready(w)
    x, y = w.spot()
    a = w.rotary[0]
    w.rapid(X=x, Y=y)
    w.feed(f=300, Z=-1.0)
    for _ in range(draw.randint(1, 4)):
        angle = (w.at[a] or 0.0) + draw.choice((360.0, -180.0, 90.0, 720.0))
        turn = {a: angle} | ({r: draw.uniform(-30, 30) for r in w.rotary[1:]} if w.maybe(0.3) else {})
        w.feed(f=draw.choice((720, 1800, 5400, None)), **turn)
        if w.maybe(0.3):
            w.feed(f=400, X=x + draw.uniform(-10, 10))
        elif w.maybe(0.2):
            w.feed(f=200, Z=(w.at["Z"] or 0.0) - 0.5)
    w.rapid(Z=w.clear)


def _wind(w: Writer) -> None:
    """Linear and rotary axes in one move, then by turns alone."""
    draw = w.draw
    _ready(w)
    x, y = w.spot()
    a = w.rotary[0]
    w.rapid(X=x, Y=y, **{a: 0.0})
    w.feed(f=300, Z=-0.6)
    for _ in range(draw.randint(2, 5)):
        x += draw.choice((0.0, 1.5, 8.0))
        w.feed(f=draw.choice((900, None)), X=x, **{a: (w.at[a] or 0.0) + draw.choice((12.0, 90.0, 360.0))})
    w.rapid(Z=w.clear)


#: name -> how often, and what writes it
SECTIONS: dict[str, tuple[int, Callable[[Writer], None]]] = {
    "contour": (5, _contour),
    "face": (2, _pass_at_depth),
    "drill": (7, _drill),
    "tap": (1, _tap),
    "steps": (3, _steps),
    "systems": (3, _systems),
    "shift": (2, _shift),
    "home": (3, _home),
    "planes": (3, _planes),
    "bore": (2, _helical_bore),
    "compensated": (1, _compensated),
    "inverse": (2, _inverse),
    "per turn": (1, _per_turn),
    "inches": (1, _inches),
    "parameters": (2, _parameters),
    "tool": (4, _tool),
    "index": (2, _index),
    "turn": (4, _turn),
    "wind": (3, _wind),
}
_ROTARY = frozenset(("index", "turn", "wind"))
