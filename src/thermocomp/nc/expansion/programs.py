"""Programs in a Fanuc file, with the positions of their N numbers and loops."""

import re
from collections.abc import Sequence

from thermocomp.core.exceptions import ProgramError
from thermocomp.nc.parser.tokens import read_line

_NUMBER = re.compile(r"[ \t]*[O:][ \t]*([0-9]+)", re.IGNORECASE)
_LABEL = re.compile(r"[ \t]*/?[ \t]*N[ \t]*([0-9]+)", re.IGNORECASE)
_COMMENT = re.compile(r"\([^()]*\)")
_END = re.compile(r"END([0-9]+)")
#: a P of M98 with more digits may contain both repeat count and program number
FOUR = 10_000


class Program:
    """One program: its lines from its O number up to the next O number.

    Parameters
    ----------
    texts : sequence of str
        All lines of the file.
    start, stop : int
        Index of the first line, and index after the last line.
    """

    def __init__(self, texts: Sequence[str], start: int, stop: int) -> None:
        self.texts = texts
        self.start = start
        self.stop = stop
        self._labels: dict[int, list[int]] | None = None
        self._closing: dict[tuple[int, int], int] = {}

    def label(self, number: int, line: int, who: str) -> int:
        """Return the index of the line with a given N number."""
        if self._labels is None:
            self._labels = {}
            for i in range(self.start, self.stop):
                if found := _LABEL.match(self.texts[i]):
                    self._labels.setdefault(int(found.group(1)), []).append(i)
        places = self._labels.get(number, [])
        if not places:
            raise ProgramError(line, f"{who}: there is no N{number} in this program")
        if len(places) > 1:
            lines = " and ".join(str(i + 1) for i in places[:2])
            raise ProgramError(line, f"{who}: N{number} appears in lines {lines}: renumber the lines")
        return places[0]

    def closing(self, begin: int, loop: int) -> int:
        """Return the index of the END of a loop whose DO is at a given index."""
        if (begin, loop) in self._closing:
            return self._closing[begin, loop]
        for i in range(begin + 1, self.stop):
            text = self.texts[i]
            if "END" in text.upper():
                found = _END.fullmatch(squeeze(read_line(text, i + 1, "fanuc").flow))
                if found and int(found.group(1)) == loop:
                    self._closing[begin, loop] = i
                    return i
        raise ProgramError(begin + 1, f"DO{loop} without END{loop} after it in this program")


class File:
    """All programs of a file; the first one is run."""

    def __init__(self, texts: Sequence[str]) -> None:
        self.texts = texts
        heads = [(i, int(found.group(1))) for i, text in enumerate(texts) if (found := _NUMBER.match(text))]
        first = heads[0][0] if heads else 0
        leader = next((i for i in range(first) if texts[i].strip() == "%"), 0)
        if any(_COMMENT.sub("", text).strip(" \t\r\n%;") for text in texts[leader:first]):
            heads.insert(0, (0, -1))  # a main program without a number
        ends = [i for i, _ in heads[1:]] + [len(texts)]
        self.main = Program(texts, 0, ends[0])
        self._programs: dict[int, list[Program]] = {}
        for k, (start, number) in enumerate(heads):
            own = self.main if k == 0 else Program(texts, start, ends[k])
            self._programs.setdefault(number, []).append(own)

    def find(self, number: int, line: int, who: str) -> Program:
        """Return the program with a given O number."""
        found = self._programs.get(number, [])
        if len(found) == 1:
            return found[0]
        if found:
            lines = " and ".join(str(p.start + 1) for p in found[:2])
            raise ProgramError(line, f"{who}: O{number} appears in lines {lines}; delete the duplicate")
        raise ProgramError(
            line,
            f"{who}: O{number:04d} is not in this file; put it after the program, with its O number and M99, or have "
            "the CAM system output its moves",
        )

    def called(self, number: int, line: int, *, told: bool) -> tuple[Program, int]:
        """Return the program called by M98 P, and the number of calls, which some controls include in P."""
        times, last = divmod(number, FOUR)
        who = f"M98 P{number}"
        if number < FOUR or told or number in self._programs:
            if times and not told and last in self._programs:
                raise ProgramError(
                    line,
                    f"{who}: either one call of O{number} or {times} calls of O{last:04d}: write the number of calls "
                    "with L",
                )
            return self.find(number, line, who), 1
        return self.find(last, line, who), times


def squeeze(text: str) -> str:
    """Return a text without whitespace, in upper case."""
    return "".join(text.split()).upper()
