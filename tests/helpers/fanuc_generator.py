"""Random programs for a Fanuc, one per seed, made of what posts and hands write."""

import random


def program(seed: int) -> str:
    """Return a program."""
    return _Post(seed).program()


class _Post:
    def __init__(self, seed: int) -> None:
        self.chance = random.Random(seed)
        self.lines: list[str] = []
        self.inch = self.chance.random() < 0.2
        self.numbered = self.chance.random() < 0.4

    def some(self, low: float, high: float) -> str:
        value = self.chance.uniform(low, high) / (25.4 if self.inch else 1.0)
        text = f"{value:.{4 if self.inch else 3}f}".rstrip("0")
        return "0." if text in ("0.", "-0.") else text

    def one(self, *texts: str) -> str:
        return self.chance.choice(texts)

    def add(self, *lines: str) -> None:
        self.lines += lines

    def program(self) -> str:
        self.add(f"G2{0 if self.inch else 1} G17 G40 G49 G80 G90" + self.one("", " G69", " G94"))
        self.add(self.one("G0 G91 G28 Z0.", "G91 G28 Z0.\nG90", "G53 G0 Z0.", "G28 G91 Z0.", "G0 G28 G91 Z0. M9"))
        for tool in range(1, self.chance.randint(2, 4)):
            self.tool(tool)
        self.add(self.one("G91 G28 X0. Y0.", "G28 G91 Y0.", "G90 G53 X0. Y0.", ""), "M30")
        body = [line for text in self.lines for line in text.split("\n") if line]
        if self.numbered:
            body = [f"N{10 * k} {line}" for k, line in enumerate(body, 1)]
        return "\n".join(("%", "O0100 (RANDOM)", *body, "%", ""))

    def tool(self, tool: int) -> None:
        self.add(self.one(f"T{tool} M6", f"M06 T0{tool}", f"T{tool}\nM6"))
        speed = self.chance.randint(5, 80) * 100
        system = self.one("G54", "G54", "G55", "G54.1 P1", "G154 P2")
        start = f"X{self.some(-50, 50)} Y{self.some(-50, 50)}"
        self.add(self.one(f"G0 G90 {system} {start} S{speed} M3", f"S{speed} M3\nG90 {system}\nG0 {start}"))
        high = self.some(20, 60)
        self.add(self.one(f"G43 H{tool} Z{high} M8", f"G43 Z{high} H{tool}\nM8", f"M8\nG0 G43 H{tool} Z{high}"))
        for _ in range(self.chance.randint(1, 4)):
            parts = [self.holes, self.contour, self.turned, self.others, self.local]
            self.chance.choices(parts, (6, 6, 4, 3, 1))[0]()
        self.add(f"G0 Z{high}")
        self.add(self.one("M9\nM5", "M5 M9", "M9", ""))
        self.add(
            self.one(
                "G0 G91 G28 Z0.", "G91 G28 Z0.", "G90 G53 G0 Z0.", "G53 G49 Z0.", "G28 Z100." if not self.inch else ""
            )
        )
        self.add(self.one("M1", "M01", "M0", "", "G90"))

    def holes(self) -> None:
        code = self.one("G81", "G81", "G82", "G83", "G73", "G85", "G89", "G84")
        extra = {"G82": " P250", "G83": f" Q{self.some(1, 3)}", "G73": f" Q{self.some(2, 4)}", "G89": " P100"}.get(
            code, ""
        )
        back = self.one("G98", "G99", "G99", "G98")
        words = f"Z{self.some(-15, -4)} R{self.some(1, 4)}{extra} F{self.chance.randint(5, 30) * 10}."
        self.add(f"G90 G0 Z{self.some(5, 12)}")
        if self.chance.random() < 0.2:
            self.add(f"{back} {code} {words} {self.one('K0', 'L0')}")
        elif self.chance.random() < 0.15:
            times = self.chance.randint(1, 4)
            self.add(f"G91 {back} {code} X{self.some(5, 9)} Z{self.some(-9, -6)} R-1.{extra} F100. K{times}")
            self.add(f"Y{self.some(3, 9)}", "G80", "G90")
            return
        else:
            self.add(f"{back} {code} X{self.some(-40, 40)} Y{self.some(-40, 40)} {words}")
        for _ in range(self.chance.randint(1, 5)):
            last = self.one("", "", "", "G98 ", "G99 ")
            axes = self.one(
                f"X{self.some(-40, 40)}", f"Y{self.some(-40, 40)}", f"X{self.some(-40, 40)} Y{self.some(-40, 40)}"
            )
            self.add(f"{last}{axes}{self.one('', '', '', f' Z{self.some(-15, -4)}')}")
        self.add(self.one("G80", "G80", f"G80 Z{self.some(15, 20)}", f"G0 G80 Z{self.some(15, 20)}"))
        self.add(self.one("", f"X{self.some(-40, 40)}", f"G0 Z{self.some(15, 30)}"))

    def contour(self) -> None:
        self.add(f"G90 G0 X{self.some(-40, 40)} Y{self.some(-40, 40)}", f"Z{self.some(1, 5)}")
        self.add(f"G1 Z{self.some(-6, -1)} F{self.chance.randint(5, 60) * 10}.")
        for _ in range(self.chance.randint(2, 7)):
            kind = self.chance.random()
            if kind < 0.4:
                self.add(
                    f"{self.one('G1 ', 'G1 ', 'G01 ')}X{self.some(-50, 50)}{self.one('', f' Y{self.some(-50, 50)}')}"
                )
            elif kind < 0.5:
                self.add(f"G1 Z{self.some(-8, -1)}")
            elif kind < 0.7:
                self.add(f"{self.one('G2', 'G3')} I{self.some(3, 9)}{self.one('', f' J{self.some(-4, 4)}')}")
            elif kind < 0.85:
                self.add(f"G91 G1 X{self.some(-5, 5)} Y{self.some(-5, 5)}", "G90")
            else:
                self.add(self.one("G4 P200", "G4 X.5", "M8", "G61\nG64", "G5.1 Q1\nG5.1 Q0", "(CHECK)", "G103 P1"))
        self.add(f"G0 Z{self.some(3, 20)}")

    def turned(self) -> None:
        self.add(f"G90 G68 X{self.some(-20, 20)} Y{self.some(-20, 20)} R{self.chance.randint(-180, 180)}.")
        self.chance.choice((self.holes_turned, self.contour, self.contour))()
        self.add(self.one("G69", "G69", f"G69 G0 X{self.some(-20, 20)} Y{self.some(-20, 20)}"))
        self.add(f"G0 X{self.some(-20, 20)} Y{self.some(-20, 20)}")

    def holes_turned(self) -> None:
        self.add(f"G0 X{self.some(-20, 20)} Y{self.some(-20, 20)}")
        self.holes()

    def local(self) -> None:
        self.add(f"G52 X{self.some(-30, 30)} Y{self.some(-30, 30)}")
        self.contour()
        self.add("G52 X0. Y0.", f"G0 X{self.some(-20, 20)} Y{self.some(-20, 20)}")

    def others(self) -> None:
        self.add(self.one("M1", "M0", "G4 P100", "M9\nM8", "/M8", "G90", "G17", "G94 F200.", "G8 P1"))
