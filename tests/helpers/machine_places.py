"""Sections of random programs that bring the tool somewhere: approaches, tools, offsets, home."""

from machine_writer import Writer


def wake(w: Writer) -> None:
    """Continue after the operator or the tool changer may have moved the axes: some name one axis at first."""
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


def approach(w: Writer) -> None:
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


def ready(w: Writer) -> None:
    """Stand above the part, all of X, Y, Z certain."""
    if any(w.at.get(letter) is None for letter in "XYZ"):
        x, y = w.spot()
        w.rapid(Z=w.clear)
        w.rapid(X=x, Y=y)
    elif (w.at["Z"] or 0.0) < 1.0:
        w.rapid(Z=w.clear)


def tool(w: Writer, first: bool = False) -> None:
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
    number, other = draw.randint(1, 6), draw.randint(1, 6)
    w.put(draw.choice((f"T{number} M6", f"M6 T{number}", f"T{number}\nM6")))
    length = f"G43 H{number}"
    more = ("G43", "", f"G43.1 Z{w.number(112.345)}", f"{length}\nG43.2 H{other}", "with Z", "with Z")
    text = draw.choice((length,) * 6 + more)
    if text and text != "with Z":
        w.put(text)
    w.put(draw.choice((f"S{draw.randint(8, 120) * 100} M3", f"M3 S{draw.randint(8, 120) * 100}")))
    if w.maybe(0.3):
        w.put("M8")
    w.motion = ""
    w.lost("X", "Y", "Z")
    if text == "with Z":
        w.put(draw.choice((f"G0 G43 Z{w.number(w.clear)} H{number}", f"G43 H{number} G0 Z{w.number(w.clear)}")))
        w.at["Z"], w.motion = w.rounded("Z", w.clear), "G0"
    if not first:
        wake(w)


def systems(w: Writer) -> None:
    """Continue in another work coordinate system, some of which the program has set."""
    draw = w.draw
    w.rapid(Z=w.clear) if w.maybe(0.7) else w.put("G53 G0 Z0")
    system = draw.choice((1, 2, 2, 3, 4, 6, 7, 9))
    name = f"G{53 + system}" if system <= 6 else f"G59.{system - 6}"
    if w.maybe(0.35):
        axes = draw.choice(("XYZ", "XY", "Z"))
        words = " ".join(f"{a}{w.number(draw.uniform(-90, 90))}" for a in axes)
        if w.rotary and w.maybe(0.2):
            words += f" {w.rotary[0]}10"
            w.lost(w.rotary[0])
        w.put(f"G10 L2 P{system} {words}")
    w.put(name)
    w.lost("X", "Y", "Z")
    wake(w)
    if w.maybe(0.3):
        axes = draw.choice(("X", "Z", "XY"))
        w.put(f"G10 L20 P{draw.choice((0, system))} " + " ".join(f"{a}{w.number(10)}" for a in axes))
        for a in axes:
            w.at[a] = 10.0
    ready(w)


def shift(w: Writer) -> None:
    """G92 or G52, a cut, and back."""
    draw = w.draw
    ready(w)
    kind = draw.randint(0, 2)
    if kind == 0:
        axes = draw.choice(("X", "XY", "Z", "XYZ"))
        w.put("G92 " + " ".join(f"{a}{w.number(draw.choice((0, 5, 12.5)))}" for a in axes))
        back = draw.choice(("G92.1", "G92.2", "G92.2\nG92.3\nG92.1"))
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
    ready(w)


def home(w: Writer) -> None:
    """Go to machine coordinates, and come back."""
    w.rapid(Z=w.clear)
    x, y = (w.number(v) for v in w.spot())
    high = w.number(w.clear)
    text, axes = w.draw.choice(
        (
            ("G28", "XYZ" + w.rotary),
            ("G30", "XYZ" + w.rotary),
            (f"G28 Z{high}", "Z"),
            (f"G30 Z{high}", "Z"),
            (f"G28 X{x} Y{y} Z{high}", "XYZ"),
            ("G91 G28 Z0\nG90", "Z"),
            ("G91 G30 Z0\nG90", "Z"),
            ("G53 G0 Z0", "Z"),
            *((f"G28 {letter}0", letter) for letter in w.rotary),
            *((f"G53 G0 Z0 {letter}0", f"Z{letter}") for letter in w.rotary),
            (f"G53 G0 X{w.number(-100)} Y{w.number(-50)}", "XY"),
            (f"G53 G1 Z0 F{w.feedrate(900)}", "Z"),
        )
    )
    w.put(text)
    w.lost(*axes)
    w.motion = ""
    wake(w)
