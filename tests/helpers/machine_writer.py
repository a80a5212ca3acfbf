"""Writes the lines of a random program, and knows where the tool is: habits of posts and shops."""

import random
import re

MM = 25.4


class Writer:
    """A program as it grows.

    Places are in mm and degrees, whatever the unit of the program.

    Parameters
    ----------
    draw : Random

    Attributes
    ----------
    repeat : bool
        Every line of a move names all axes and F, as FreeCAD's post does.
    at : dict of str to (float or None)
        Where each axis is, None where the program does not say.
    """

    def __init__(self, draw: random.Random) -> None:
        self.draw = draw
        self.lines: list[str] = []
        self.machine = draw.choice(("mill", "fourth", "fourth", "fifth"))
        self.rotary = {"mill": "", "fourth": draw.choice("AAABC"), "fifth": draw.choice(("AC", "BC", "AB"))}[
            self.machine
        ]
        self.repeat = self.maybe(0.3)
        self.glued = self.maybe(0.2)
        self.numbered = self.maybe(0.25)
        self.percent = self.maybe(0.25)
        self.small = self.maybe(0.1)
        self.zeros = self.maybe(0.15)
        self.pointed = self.maybe(0.2)
        self.ending = "\r\n" if self.maybe(0.1) else "\n"
        self.decimals = draw.choice((2, 3, 3, 4))
        self.plain = self.maybe(0.5)
        self.clear = draw.choice((10.0, 20.0, 50.0))
        self.inch = False
        self.absolute = True
        self.mode = 94
        self.motion = ""
        self.retract = ""
        self.told: float | None = None
        self.up = False
        self.at: dict[str, float | None] = dict.fromkeys("XYZ" + self.rotary)

    def maybe(self, chance: float) -> bool:
        """Return True as often as that."""
        return self.draw.random() < chance

    @property
    def unit(self) -> float:
        """Millimetres in a unit of the program."""
        return MM if self.inch else 1.0

    def number(self, value: float, decimals: int | None = None) -> str:
        """Return a length as it is written in the unit in force."""
        digits = (self.decimals if decimals is None else decimals) + (2 if self.inch else 0)
        text = f"{value / self.unit:.{digits}f}"
        if "." in text and self.plain:
            text = text.rstrip("0").rstrip(".")
        if float(text) == 0.0:
            return "0.0" if self.pointed else "0"
        if self.pointed:
            text = re.sub(r"^(-?)0\.", r"\1.", text) if "." in text else f"{text}."
        return text

    def angle(self, value: float) -> str:
        """Return an angle as it is written."""
        text = f"{value:.3f}"
        return text.rstrip("0").rstrip(".") if self.plain else text

    def feedrate(self, value: float) -> str:
        """Return a feed per minute as it is written."""
        return f"{value / self.unit:.{2 if self.inch else 0}f}"

    def rounded(self, letter: str, value: float) -> float:
        """Return a value as it is after it has been written."""
        return float(self.angle(value)) if letter in "ABC" else float(self.number(value)) * self.unit

    def put(self, text: str) -> None:
        """Write lines with the habits of this program."""
        for part in text.split("\n"):
            row = part
            if self.zeros:
                row = re.sub(r"\b([GM])(\d)(?![\d.])", r"\g<1>0\2", row)
            if self.glued and "#" not in row and "[" not in row:
                row = row.replace(" ", "")
            if self.small:
                row = row.lower()
            if self.numbered and not row.startswith("/"):
                row = f"N{10 * (len(self.lines) + 1)} {row}"
            if self.maybe(0.03):
                row += self.draw.choice((" (see drawing)", " ; für später", " (Ø)"))
            self.lines.append(row)

    def text(self) -> str:
        """Return the program."""
        return self.ending.join(self.lines) + self.ending

    def lost(self, *letters: str) -> None:
        """Forget where axes are."""
        for letter in letters:
            self.at[letter] = None

    def stopped(self) -> None:
        """Take in that the program has stopped, and the operator may have moved the axes."""
        self.lost("X", "Y", "Z")

    def lengthy(self) -> bool:
        """Return whether a tool length may be in force."""
        return any("g43" in line.lower() for line in self.lines)

    def spot(self) -> tuple[float, float]:
        """Return a place on the part."""
        x, y = self.draw.uniform(-60, 60), self.draw.uniform(-60, 60)
        return (round(x), round(y)) if self.maybe(0.5) else (x, y)

    def rapid(self, **goal: float) -> None:
        """Go there with G0."""
        self._move("G0", None, goal)

    def feed(self, f: float | None = None, **goal: float) -> None:
        """Go there with G1."""
        self._move("G1", f, goal)

    def _move(self, code: str, f: float | None, goal: dict[str, float]) -> None:
        named = {}
        for letter in self.at:
            value = goal.get(letter, self.at[letter] if self.repeat else None)
            if value is None:
                continue
            new = self.rounded(letter, value)
            if self.repeat or self.at[letter] is None or abs(new - (self.at[letter] or 0.0)) > 1e-9 or self.maybe(0.15):
                named[letter] = new
            self.at[letter] = new
        if not named:
            letter = next(iter(goal))
            named[letter] = self.at[letter] or 0.0
        words = [code] if code != self.motion or self.repeat or self.maybe(0.2) else []
        words += [c + (self.angle(v) if c in "ABC" else self.number(v)) for c, v in named.items()]
        if code == "G1":
            words += self._f(f)
        elif self.maybe(0.05):
            words.append(self.draw.choice(("M8", "M9", "S4000 M3", "G90", "G64")))
            words[0] = words[0] if self.maybe(0.5) else f"G90 {words[0]}" if "G90" not in words else words[0]
        self.motion = code
        self.put(" ".join(words))

    def _f(self, f: float | None) -> list[str]:
        if f is None:
            f = self.told if self.told is not None else {94: 400.0, 93: 30.0, 95: 0.2}[self.mode]
        if f == self.told and self.mode != 93 and not self.repeat:
            return []
        self.told = f
        if self.mode == 94:
            return [f"F{self.feedrate(f)}"]
        return [f"F{self.number(f) if self.mode == 95 else f'{f:g}'}"]

    def arc(self, code: str, centre: tuple[float, float], extra: str = "", **goal: float) -> None:
        """Turn in G17 to an end; the centre as seen from the start."""
        words = [code]
        for letter, value in goal.items():
            new = self.rounded(letter, value)
            at = self.at[letter]
            if letter in "XY" or at is None or abs(new - at) > 1e-9:
                words.append(letter + self.number(new))
            self.at[letter] = new
        words += [f"I{self.number(centre[0])}", f"J{self.number(centre[1])}"]
        words += self._f(None) if self.repeat or self.told is None else []
        self.motion = code
        self.put(" ".join(words) + extra)

    def by(self, code: str, f: float | None = None, **steps: float | None) -> None:
        """Continue by these ways, in G91."""
        words = [code]
        for letter, step in steps.items():
            if step is None:
                continue
            text = self.angle(step) if letter in "ABC" else self.number(step)
            words.append(letter + text)
            if letter in "ABC":
                self.at[letter] = (self.at[letter] or 0.0) + float(text)
                continue
            self.at[letter] = (self.at[letter] or 0.0) + float(text) * self.unit
        words += self._f(f) if code == "G1" else []
        self.motion = code
        self.put(" ".join(words))
