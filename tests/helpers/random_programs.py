"""Random programs that are mostly right, for comparisons with the interpreter."""

from hypothesis import strategies as st

_number = st.integers(-2000, 2000).map(lambda n: f"{n / 64:.6f}")
_positive = st.integers(1, 2000).map(lambda n: f"{n / 64:.6f}")
_axes = st.lists(st.sampled_from("XYZ"), min_size=1, max_size=3, unique=True)


@st.composite
def _words(draw: st.DrawFn, letters: str = "XYZ") -> str:
    chosen = [c for c in letters if draw(st.booleans())] or [letters[0]]
    return " ".join(f"{c}{draw(_number)}" for c in chosen)


@st.composite
def _straight(draw: st.DrawFn) -> str:
    code = draw(st.sampled_from(["G0 ", "G1 ", "G1 ", "G1 F200 ", ""]))
    return f"{code}{draw(_words())}"


@st.composite
def _arc(draw: st.DrawFn) -> str:
    """Half circles, full circles and helices in the form of R and of the centre, so that most are right."""
    code = draw(st.sampled_from(["G2", "G3"]))
    plane = draw(st.sampled_from(["G17", "G17", "G18", "G19"]))
    first, second, across = {"G17": tuple("XYZ"), "G18": tuple("ZXY"), "G19": tuple("YZX")}[plane]
    offsets = {"X": "I", "Y": "J", "Z": "K"}
    a, b = draw(st.integers(-300, 300)) / 16, draw(st.integers(1, 300)) / 16
    helix = f" {across}{draw(_number)}" if draw(st.booleans()) else ""
    turns = draw(st.sampled_from(["", "", " P1", " P2", " P5"]))
    shape = draw(st.sampled_from(["half", "full", "radius"]))
    if shape == "full":
        return f"{plane} {code} {offsets[first]}{a} {offsets[second]}{b}{helix}{turns}"
    if shape == "half":
        back = "\nG90" if draw(st.booleans()) else ""
        centre = f"{offsets[first]}{a} {offsets[second]}{b}"
        return f"G91 {plane} {code} {first}{2 * a} {second}{2 * b} {centre}{helix}{turns}{back}"
    radius = (abs(a) + b) * draw(st.sampled_from([1.0, 1.5, -1.0, -4.0]))
    return f"G91 {plane} {code} {first}{a} {second}{b} R{radius}{helix}{turns}\nG90"


@st.composite
def _cycle(draw: st.DrawFn) -> str:
    code = draw(st.sampled_from(["G81", "G82", "G83", "G73", "G85", "G86", "G89", "G84", "G74", "G87"]))
    spindle = "M4 " if code == "G74" else "M3 "
    r, depth = draw(st.integers(-40, 40)) / 8, draw(st.integers(1, 80)) / 8
    incremental = draw(st.booleans())
    bottom = -depth if incremental else r - depth
    across = "G17 Z" if code in ("G74", "G84", "G87") else draw(st.sampled_from(["G17 Z", "G17 Z", "G18 Y", "G19 X"]))
    plane, letter = across.split()
    others = "XYZ".replace(letter, "")
    extra = {"G82": " P0.5", "G86": " P0.25", "G89": " P1", "G87": " I1 J-2 K0"}.get(code, "")
    if code in ("G83", "G73"):
        extra = f" Q{draw(st.integers(2, 40)) / 8}"
    repeats = "" if code == "G74" else draw(st.sampled_from(["", "", " L2", " L3"]))
    retract = draw(st.sampled_from(["G98 ", "G99 ", ""]))
    modes = f"{spindle}{plane} {'G91' if incremental else 'G90'} {retract}{code}"
    lines = [f"{modes} {draw(_words(others))} {letter}{bottom} R{r}{extra}{repeats}"]
    for _ in range(draw(st.integers(0, 3))):
        change = draw(st.sampled_from(["", "", "G98 ", "G99 "]))
        more = draw(st.sampled_from(["", repeats]))
        lines.append(f"{change}{draw(_words(others))}{more}")
    lines.append(draw(st.sampled_from(["G80", "G0 X1", "G80 G90", "G90"])))
    return "\n".join(lines)


@st.composite
def _offset(draw: st.DrawFn) -> str:
    words = draw(_words())
    number = draw(st.integers(0, 9))
    return draw(
        st.sampled_from(
            [
                f"G92 {words}",
                f"G52 {words}",
                "G92.1",
                "G92.2",
                "G92.3",
                f"G10 L2 P{number} {words}",
                f"G10 L2 P{number} {words} R{draw(st.sampled_from([0, 30, 90, -45.5]))}",
                f"G10 L20 P{number} {words}",
                f"G10 L1 P{number + 1} Z{draw(_number)}",
                f"G10 L10 P{number + 1} Z{draw(_number)}",
                f"G10 L11 P{number + 1} Z{draw(_number)}",
                draw(st.sampled_from(["G54", "G55", "G56", "G59", "G59.1", "G59.3"])),
                f"G55 G0 {words}",
            ]
        )
    )


@st.composite
def _tool(draw: st.DrawFn) -> str:
    number = draw(st.integers(1, 9))
    return draw(
        st.sampled_from(
            [
                # after M6, and in splines, the gcode module begins where the last straight move was: make one before
                f"G1\nT{number} M6",
                f"G1\nT{number} M6\nG43",
                f"G43 H{number}",
                f"G43 H{number} Z{draw(_number)}",
                "G43 H0",
                f"G43.2 H{number}",
                f"G43.1 {draw(_words())}",
                "G49",
                "G43",
            ]
        )
    )


@st.composite
def _other(draw: st.DrawFn) -> str:
    words = draw(_words())
    return draw(
        st.sampled_from(
            [
                "G20",
                "G21",
                "G20 F10",
                "G90",
                "G91",
                "G90 G53 G0 " + words,
                "G90 G53 G1 F300 " + words,
                "G28 " + words,
                "G28",
                "G91 G28 Z0\nG90",
                "G30 " + words,
                "G4 P0.5",
                "G4 P1 " + words,
                "G7",
                "G8",
                "G17",
                "G18",
                "G19",
                "G64 P0.01",
                "G61",
                "G90.1",
                "G91.1",
                "G93 G1 F30 " + words + "\nG94 F100",
                "G95 F0.1 G1 " + words + "\nG94 F100",
                "G33 K0.5 " + words,
                "G33.1 K0.5 " + words + "\nG1",
                "G38.3 " + words,
                "M5",
                "S500 M3",
                "M4",
                "#1=5 #<a>=[#1+2]",
                "G1 X#1 Y[#<a>*2-1]",
                "G0 Z[1.5**2]",
                "G17 G1 F100\nG5.1 I1 J2 " + draw(_words("XY")) + "\nG1",
                "G17 G1\nG5 I1 J2 P-1 Q2 " + draw(_words("XY")) + "\nG1",
                "G80",
                "G98",
                "G99",
                "/" + words,
                "M0",
                "F150",
                "G0",
                "G1",
            ]
        )
    )


#: a program that begins with unit, feed and speed stated
programs = st.lists(
    st.one_of(_straight(), _straight(), _straight(), _arc(), _cycle(), _offset(), _tool(), _other()),
    min_size=1,
    max_size=14,
).map(lambda lines: "\n".join(["G21 G90", "F100 S1000 M3", "G1 X0", *lines, "M2"]) + "\n")
