"""Sections of random programs that drill, tap, or go by steps (G91)."""

from machine_places import ready
from machine_writer import Writer

_CYCLES = ("G81", "G81", "G82", "G83", "G73", "G85", "G86", "G89")


def drill(w: Writer) -> None:
    """Holes, with and without an approach in Z, and what comes behind G80."""
    draw = w.draw
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
    habit = draw.choice(("none", "none", "none", "98", "98", "99", "99", "99 then 98", "mixed"))
    level = {"none": "", "98": "G98", "99": "G99", "99 then 98": "G99", "mixed": "G99"}[habit]
    for series in range(draw.choice((1, 1, 2))):
        x, y = _holes(w, x, y, level if series == 0 else "", habit)
    w.lost("Z")
    w.motion = ""
    if w.maybe(0.85):
        w.put("G80")
    if w.maybe(0.2):
        w.put("G4 P0.3")
    elif w.maybe(0.2):
        w.put(f"G80 G0 Z{w.number(w.clear)}")
        w.at["Z"] = w.rounded("Z", w.clear)
    for _ in range(draw.choice((0, 1, 2))):
        w.motion = ""
        x += 10.0
        w.rapid(**(draw.choice(({"X": x}, {"Y": y + 20.0}, {"X": x, "Y": y}))))
    w.rapid(Z=w.clear)


def _holes(w: Writer, x: float, y: float, level: str, habit: str) -> tuple[float, float]:
    """Write one cycle; return where its last hole is."""
    draw = w.draw
    code = draw.choice(_CYCLES)
    depth, r = -draw.choice((3.0, 8.5, 12.0)), draw.choice((1.0, 2.0, 3.0, 5.0))
    extra = {"G82": " P0.3", "G86": " P0.2", "G89": " P0.2"}.get(code, "")
    if code in ("G83", "G73"):
        extra = f" Q{w.number(2.5, 2)}"
    holes = draw.randint(2, 5)
    for k in range(holes):
        x, y = x + draw.choice((10.0, 15.0)), y + draw.choice((0.0, 0.0, 10.0))
        place = f"X{w.number(x)} Y{w.number(y)}"
        if k and not w.repeat and w.maybe(0.5):
            place, y = f"X{w.number(x)}", w.at["Y"] or y
        if k and not w.repeat and w.maybe(0.1):
            place += f" Z{w.number(depth - 1.0)}"
        told = level if k == 0 else ""
        if (habit == "99 then 98" and k == holes - 1) or (habit == "mixed" and k and w.maybe(0.5)):
            told = "G98"
        full = f"{code} {place} Z{w.number(depth)} R{w.number(r)}{extra} F{w.feedrate(draw.randint(6, 40) * 10)}"
        w.put(f"{told} {full if k == 0 or w.repeat else place}".strip())
        w.at["X"], w.at["Y"] = x, y
    return x, y


def _known_xy(w: Writer, x: float, y: float) -> None:
    if w.at["X"] is None or w.at["Y"] is None:
        w.rapid(X=x, Y=y)


def tap(w: Writer) -> None:
    ready(w)
    x, y = w.spot()
    speed = w.draw.choice((300, 500))
    w.put(f"S{speed} M3")
    w.rapid(X=x, Y=y)
    w.put(
        f"{w.draw.choice(('G98 ', 'G99 ', ''))}G84 X{w.number(x)} Y{w.number(y)} Z{w.number(-8)} R{w.number(3)} "
        f"F{w.feedrate(speed)}"
    )
    w.put(f"X{w.number(x + 12)}")
    w.put("G80")
    w.motion = ""
    w.lost("Z")
    w.at["X"], w.at["Y"] = x + 12, y
    w.rapid(Z=w.clear)


def steps(w: Writer) -> None:
    """Moves, arcs and cycles in G91."""
    draw = w.draw
    ready(w)
    w.put("G91")
    w.absolute = False
    kind = draw.randint(0, 2)
    if kind == 0:
        w.by("G0", Z=-(w.at["Z"] or 0.0) + 1.0)
        w.by("G1", f=300, Z=-2.0)
        for _ in range(draw.randint(1, 4)):
            w.by("G1", f=draw.choice((None, 600)), X=draw.uniform(-20, 20), Y=draw.choice((None, 5.0)))
            if w.rotary and w.maybe(0.5):
                still = {"X": 0.0, "Y": 0.0, "Z": 0.0} if w.repeat else {}
                w.by(draw.choice(("G1", "G1", "G0")), f=1440, **still, **{w.rotary[0]: draw.choice((90.0, -45.0))})
            elif w.maybe(0.15):
                w.put(draw.choice(("M0", "M1")))
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
    ready(w)
