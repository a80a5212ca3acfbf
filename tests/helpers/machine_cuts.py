"""Sections of random programs that mill: contours, arcs, feeds of every kind, rotary axes."""

from machine_places import ready
from machine_writer import Writer


def contour(w: Writer) -> None:
    """Plunge, lines and corners, and up: some with a ramp, some in several depths."""
    draw = w.draw
    ready(w)
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


def pass_at_depth(w: Writer) -> None:
    """Face a surface: several lines, a rapid at depth among them."""
    ready(w)
    x, y = w.spot()
    w.rapid(X=x, Y=y)
    w.feed(f=400, Z=-0.5)
    for k in range(w.draw.randint(2, 4)):
        w.feed(f=1500, X=x + (60.0 if k % 2 == 0 else 0.0))
        (w.rapid if w.maybe(0.3) else w.feed)(Y=y + 5.0 * (k + 1))
    w.rapid(Z=w.clear)


def flat(w: Writer) -> None:
    """Cut in X and Y where the program does not say where Z is."""
    draw = w.draw
    w.put(draw.choice(("M0", "G53 G0 Z0", "M1")))
    w.lost(*"XYZ")
    w.motion = ""
    x, y = w.spot()
    w.rapid(X=x, Y=y)
    w.feed(f=1200, X=x + 40.0)
    if w.maybe(0.6):
        w.arc("G3", (0.0, 10.0), X=x + 50.0, Y=y + 10.0)
    w.feed(Y=y + 60.0)
    if w.rotary and w.maybe(0.3):
        w.feed(f=900, **{w.rotary[0]: draw.uniform(-90, 90)})
    w.rapid(Z=w.clear)


def planes(w: Writer) -> None:
    """Arcs in all planes: half and full circles, by centre and by radius, with a helix."""
    draw = w.draw
    ready(w)
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


def helical_bore(w: Writer) -> None:
    draw = w.draw
    ready(w)
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


def compensated(w: Writer) -> None:
    """A contour on the outside, under cutter radius compensation."""
    draw = w.draw
    ready(w)
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


def inverse(w: Writer) -> None:
    """Feed by inverse time, as posts for rotary axes write it."""
    draw = w.draw
    ready(w)
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


def per_turn(w: Writer) -> None:
    ready(w)
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


def inches(w: Writer) -> None:
    """A stretch in the other unit, without a tool length in force when it changes."""
    draw = w.draw
    ready(w)
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


def parameters(w: Writer) -> None:
    draw = w.draw
    ready(w)
    x, y = w.spot()
    depth = draw.choice((0.8, 2.25))
    w.put(f"#<depth>={w.number(depth)}")
    w.put(f"#1={w.number(x)}")
    w.put(f"#2=[#1+{w.number(20)}]")
    w.put(f"G0 X#1 Y{w.number(y)}")
    w.put(f"G1 Z{draw.choice(('[0-#<depth>]', '-#<depth>', '[-1*#<depth>]'))} F{w.feedrate(300)}")
    w.put(f"X[#2] F[{w.feedrate(100)}*4]")
    w.put(f"Y[{w.number(y)}+10/2]" if not w.inch else f"Y{w.number(y)}")
    w.put(f"G0 Z[#<depth>+{w.number(w.clear)}]")
    w.motion, w.told = "G0", None
    w.at |= {"X": x + 20.0, "Y": None, "Z": None}
    ready(w)


def index(w: Writer) -> None:
    """Turn in rapid, and cut in XYZ, the rotary words repeated or not."""
    ready(w)
    for _ in range(w.draw.randint(1, 3)):
        x, y = w.spot()
        w.rapid(**{w.rotary[0]: w.draw.choice((0.0, 45.0, 90.0, 180.0, -30.0))})
        w.rapid(X=x, Y=y)
        w.feed(f=500, Z=-1.5)
        w.feed(X=x + 20.0)
        w.rapid(Z=w.clear)


def turn(w: Writer) -> None:
    """Feed with the rotary axis alone, as an engraving or a groove around a shaft."""
    draw = w.draw
    ready(w)
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
    if w.maybe(0.15):  # the turns are forgotten
        w.put(f"G92 {a}0")
        w.at[a] = 0.0


def wind(w: Writer) -> None:
    """Linear and rotary axes in one move, then by turns alone."""
    draw = w.draw
    ready(w)
    x, y = w.spot()
    a = w.rotary[0]
    w.rapid(X=x, Y=y, **{a: 0.0})
    w.feed(f=300, Z=-0.6)
    for _ in range(draw.randint(2, 5)):
        x += draw.choice((0.0, 1.5, 8.0))
        w.feed(f=draw.choice((900, None)), X=x, **{a: (w.at[a] or 0.0) + draw.choice((12.0, 90.0, 360.0))})
    w.rapid(Z=w.clear)
