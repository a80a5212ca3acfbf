"""Detection of the dialect of a whole program (LinuxCNC or Fanuc); ambiguous programs are refused.

A *sign* is something that one of the two controls refuses: it is conclusive. A *hint* is a habit of LinuxCNC users:
text after ``;`` (programs for Fanuc controls end lines with a bare ``;``), unless such a text or a comment has a
program number or names another control; a comment that LinuxCNC executes or that names LinuxCNC; arcs in several lines
that close only if lengths without a decimal point are whole units. It decides the meaning of such lengths and of a few
other words (`_USUAL`). Signs and hints count before the end of the program: LinuxCNC reads nothing after M2, M30 or a
closing ``%``, but a Fanuc may. All words that both accept but interpret differently
(`thermocomp.nc.interpreter.openwords`) are refused for clarification, unless there is a sign of LinuxCNC.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final, Literal, NamedTuple

from thermocomp.core.exceptions import ProgramError
from thermocomp.nc.interpreter.codes import G_CODES, M_CODES, find_owner_of_p
from thermocomp.nc.interpreter.inforce import DRILLS, InForce, LineWords, read_number
from thermocomp.nc.interpreter.openwords import DOUBTS, list_open_words
from thermocomp.nc.parser.tokens import read_line

Whose = Literal["linuxcnc", "fanuc"]

# most lines of a long program: moves only, in which nothing but a length without a decimal point can be ambiguous
_PLAIN = re.compile(
    r"[ \t]*(?:N[0-9]+[ \t]*)?(?:G0?([0-3])(?![0-9.])[ \t]*)?(?:[XYZIJKABCRFS][-+]?[0-9.]+[ \t]*)*[\r\n]*",
    re.IGNORECASE,
).fullmatch
_BARE_FEED = re.compile(r"F[-+]?0*[1-9][0-9]*(?![0-9.])", re.IGNORECASE).search
_BARE = re.compile(r"[XYZIJKABCR][-+]?0*[1-9][0-9]*(?![0-9.])", re.IGNORECASE).search

# all other lines, without comments and blanks, in upper case, with {} for brackets
_COMMENT = re.compile(r"\([^()]*\)?")
_ACTIVE = re.compile(r"\([ \t]*(?:MSG|DEBUG|PRINT|LOG|LOGOPEN|PROBEOPEN)[ \t]*,|LINUXCNC")
_OTHERS = re.compile(
    r"\b(?:FANUC|HAAS|MAZAK|MITSUBISHI|MELDAS|BROTHER|OKUMA|SIEMENS|SINUMERIK|HEIDENHAIN|FAGOR|YASNAC|FADAL|SYNTEC|GSK|"
    r"MAKINO|DOOSAN|DMG|KITAMURA|HURCO|ROBODRILL|VF-?[0-9]+[A-Z]*|[0-9]+I-[MT][A-F]?)\b"
)
# a program number in a comment: O or : with at least three digits ("O2 sensor", "side :2"), or the word PROGRAM
_NUMBER_IN_TEXT = re.compile(
    r"(?<![A-Z0-9#<.])(?:[O:%][ \t-]*|(?:PROGRAM|PROG|PRG)\b[^0-9]{0,8})[0-9]{3,8}(?![0-9]*\.[0-9])"
)
_MARKS = ("\ufeff", "ï»¿")
_BRACKET = re.compile(r"\[[^\[\]]*\]")
_HEAD = re.compile(r"(?P<delete>/[1-9]?)?(?:N[0-9]+(?:\.[0-9]+)?)?(?P<again>/[1-9]?)?")
_O_WORD = re.compile(
    r"O(?:[0-9]+|<[^<>]*>|#+[0-9]+|\{\})"
    r"(?:SUB|ENDSUB|CALL|RETURN|IF|ELSEIF|ELSE|ENDIF|WHILE|ENDWHILE|DO|REPEAT|ENDREPEAT|BREAK|CONTINUE)"
)
_NUMBER_ALONE = re.compile(r"[O:][0-9]+")
_PROGRAM_NUMBER = re.compile(r"[O:][0-9]+|O?<[^<>]*>$")
# after other words of the line, or the % that begins a tape; X1O5 is a typing error
_NUMBER_BEHIND = re.compile(r"(?:[ \t%]|[GMN][0-9.]+)[O:][ \t]*[0-9]+(?![0-9]*[ \t]*\.)")
_FANUC_FLOW = re.compile(r"IF\{\}(?:GOTO|THEN)|GO(?:TO)?[0-9#{]|WH(?:ILE)?\{\}DO[0-9]|DO[0-9#]|END[0-9]")
_FANUC_OUTPUT = re.compile(r"DPRNT|BPRNT|POPEN|PCLOS|SETVN")
_FANUC_CORNER = re.compile(r",[RCA]")
_ASSIGNED = re.compile(r"#[#0-9]*(?:<[^<>]*>|\{\})?=")
_OPERATOR = re.compile(r"[0-9.}][-+*/]")  # between operands that are not enclosed in brackets
_WORD = re.compile(
    r"([A-Z@^])([-+]*(?:[0-9]+\.?[0-9]*|\.[0-9]+)|[-+]*#[#0-9]*(?:\{\}|<[^<>]*>)?|[-+]*[A-Z]*\{\}(?:/\{\})?)"
)
_WORDS = re.compile(f"(?:{_WORD.pattern})+")

_FANUC_G: Final = G_CODES["fanuc"].keys() - G_CODES["linuxcnc"].keys()
_FANUC_M: Final = M_CODES["fanuc"].keys() - M_CODES["linuxcnc"].keys()
#: not codes of a Fanuc or Haas, whatever its options; other LinuxCNC codes can be (G7, G28.1, G33, G43.1, M60 ...)
_LINUXCNC_G: Final = frozenset((5.2, 5.3, 33.1, 38.2, 38.3, 38.4, 38.5, 59.1, 59.2, 59.3, 90.1, 91.1, 92.2, 92.3))
#: kinds of ambiguous words that a hint resolves
_USUAL: Final = ("length", "feed", "g41", "g43", "exact", "radius", "state", "behind")
#: maximum number of kinds of ambiguous words listed in the error message
_NAMED: Final = 5

_BEGINS = "the beginning of a Fanuc's or Haas's program"
_EITHER = "or give --controller linuxcnc or --controller fanuc"
_BEHIND = "is a comment for LinuxCNC, and the next block for a Fanuc: remove it, or put it on a separate line"


class Place(NamedTuple):
    """Position and description of something found in a program."""

    line: int
    text: str  #: text as written
    what: str  #: description of the item, or its interpretations


@dataclass
class Judgement:
    """Evidence of the dialect of a program.

    Parameters
    ----------
    linuxcnc, fanuc : Place or None
        First sign of each control.
    hint : Place or None
        First hint of LinuxCNC.
    open : dict of str to Place
        First ambiguous word of each kind: its interpretations, and what to write instead.
    count : dict of str to int
        Number of lines with an ambiguous word of each kind.
    fault : Place or None
        First ambiguous word on a line that neither control can read, with the reason: it counts as a typing error.
    """

    linuxcnc: Place | None = None
    fanuc: Place | None = None
    hint: Place | None = None
    open: dict[str, Place] = field(default_factory=dict)
    count: dict[str, int] = field(default_factory=dict)
    fault: Place | None = None


def check_dialect(lines: Iterable[str], *, whole: bool = False, startup: str = "") -> None:
    """Raise an error if the dialect of a program is not specified and may be other than LinuxCNC."""
    found = judge_dialect(lines, whole=whole, startup=startup)
    mine, other = found.linuxcnc, found.fanuc
    if mine and other:
        raise ProgramError(
            other.line,
            f"{other.text!r} is {other.what}, and line {mine.line}: {mine.text!r} is {mine.what}: remove the wrong "
            f"one, {_EITHER}",
        )
    if other:
        raise ProgramError(
            other.line,
            f"{other.text!r} is {other.what}: give --controller fanuc (its dwells, cycles and lengths differ), "
            "or --controller linuxcnc",
        )
    if found.fault is not None and not mine:
        raise ProgramError(found.fault.line, found.fault.what)
    if mine or not found.open:
        return
    kinds = sorted(found.open, key=lambda kind: found.open[kind].line)
    told = []
    for kind in kinds[:_NAMED]:
        place, more = found.open[kind], found.count[kind] - 1
        told.append(f"line {place.line}: {place.text} {place.what}" + f" (and {more} more)" * (more > 0))
    if len(kinds) > _NAMED:
        told.append(f"and {len(kinds) - _NAMED} other kinds of words")
    first = found.open[kinds[0]].line
    raise ProgramError(
        first,
        f"{'; '.join(told).removeprefix(f'line {first}: ')}. No word is specific to LinuxCNC or to a Fanuc: "
        f"write the line so that both controls read it alike, {_EITHER}",
    )


def judge_dialect(lines: Iterable[str], *, whole: bool = False, startup: str = "") -> Judgement:
    """Return the evidence of the dialect in a whole program; see `check_dialect`."""
    scan = _Scan(InForce(whole))
    scan.force.take(_line_words("", [word for word in _WORD.findall(_squeeze(startup.upper())) if word[0] == "G"]))
    for number, text in enumerate(lines, 1):
        if not scan.pass_plain(text):
            scan.take(number, text)
    found = scan.found
    found.hint = scan.hint
    for kind, shown in DOUBTS.items():
        if getattr(scan.force, shown):
            found.open.pop(kind, None)
    if found.hint is not None:
        for kind in _USUAL:
            found.open.pop(kind, None)
    return found


class _Scan:
    """Scan of a program that tracks its modal state."""

    def __init__(self, force: InForce) -> None:
        self.found = Judgement()
        self.force = force
        self._began = self._ended = False
        self._commented: Place | None = None  # first text behind ";"
        self._foreign = False  # such a text has a program number, or a comment names another control
        self._line = 0
        self._whole = self._text = self._code = ""

    def pass_plain(self, text: str) -> bool:
        """Return whether a line needs no examination, and update the motion in force."""
        found = _PLAIN(text)
        if found is None:
            return False
        motion = float(found[1]) if found[1] else self.force.motion
        if motion in DRILLS or (self.force.feed and _BARE_FEED(text)):
            return False
        if not self.force.whole and _BARE(text):
            if "length" not in self.found.open or motion not in (0.0, 1.0):
                return False
            self.found.count["length"] += 1
        self.force.take_plain(motion, text)
        return True

    def take(self, number: int, text: str) -> None:
        """Examine a line for signs, hints and ambiguous words."""
        self._line, self._whole, self._text = number, text, text.strip()[:40]
        for mark in _MARKS:
            text = text.removeprefix(mark)
        text = text.upper()
        if _ACTIVE.search(text):
            self._hint("a comment for LinuxCNC")
        self._code, *rest = _COMMENT.sub(" ", text).split(";")
        comments = " ".join([*_COMMENT.findall(text), *rest])
        self._foreign |= bool(_OTHERS.search(comments) or _NUMBER_IN_TEXT.search(comments))
        block = _squeeze(self._code)
        self._ended = self._ended or (block == "%" and self._began)
        self._began = self._began or bool(block)
        self._block(block)
        for behind in map(_squeeze, rest):
            if _NUMBER_ALONE.fullmatch(behind):
                self._sign("fanuc", _BEGINS)
            elif _WORDS.fullmatch(behind) and not self._ended:
                self._ask("behind", f"';{behind[:20]}'", _BEHIND)
            elif behind and not self._ended:
                self._commented = self._commented or Place(self._line, self._text, "a comment of LinuxCNC's")

    @property
    def hint(self) -> Place | None:
        """First hint of LinuxCNC in the whole program."""
        return self.found.hint or (None if self._foreign else self._commented)

    def _sign(self, whose: Whose, what: str) -> None:
        if getattr(self.found, whose) is None and (whose == "fanuc" or not self._ended):
            setattr(self.found, whose, Place(self._line, self._text, what))

    def _hint(self, what: str) -> None:
        if not self._ended:
            self.found.hint = self.found.hint or Place(self._line, self._text, what)

    def _ask(self, kind: str, text: str, what: str) -> None:
        if kind not in self.found.open and (fault := self._fault()):
            self.found.fault = self.found.fault or Place(self._line, text, fault)
            return
        self.found.open.setdefault(kind, Place(self._line, text, what))
        self.found.count[kind] = self.found.count.get(kind, 0) + 1

    def _fault(self) -> str:
        """Return the reason why neither control can read the line; empty if one can."""
        fault = read_line(self._whole, self._line).error
        return fault if fault and read_line(self._whole, self._line, "fanuc").error else ""

    def _block(self, text: str) -> None:
        head = _HEAD.match(text)
        assert head is not None  # all parts of it are optional
        body = text[head.end() :]
        if _O_WORD.match(body):
            self._sign("linuxcnc", "an O-word, which only LinuxCNC has")
            return
        if _PROGRAM_NUMBER.match(body):
            self._sign("fanuc", _BEGINS)
            return
        if _NUMBER_BEHIND.search(self._code):
            self._sign("fanuc", _BEGINS)
            return
        if len(head["delete"] or "") > 1 or head["again"]:
            self._sign("fanuc", "a block delete with a number, or after N, which only a Fanuc or Haas has")
        if _FANUC_FLOW.match(body) or _FANUC_OUTPUT.match(body):
            self._sign("fanuc", "a macro word of a Fanuc or Haas")
            return
        if "#<" in "".join(self._code.split()):
            self._sign("linuxcnc", "a named parameter, which only LinuxCNC has")
        if "@" in body or "^" in body:
            self._sign("linuxcnc", "a position in LinuxCNC's polar coordinates (@ ^)")
        if _FANUC_CORNER.search(body):
            self._sign("fanuc", "a corner word of a Fanuc or Haas (,R ,C ,A)")
        if assigned := _ASSIGNED.search(body):
            self._assigned(body[assigned.end() :].replace("ATAN{}/{}", "{}"))
            body = body[: assigned.start()]
        self._words(_WORD.findall(body), runs=not (head["delete"] or head["again"]))

    def _assigned(self, value: str) -> None:
        if "=" in value:
            self._sign("linuxcnc", "several assignments on a line, which only LinuxCNC accepts")
        elif _OPERATOR.search(value):
            self._sign("fanuc", "an expression without brackets, which only a Fanuc or Haas accepts")

    def _words(self, words: list[tuple[str, str]], *, runs: bool) -> None:
        line = _line_words(self._code, words)
        self.force.take(line)
        self._signs(line)
        if not self._ended:
            for kind, text, readings in list_open_words(line, self.force):
                self._ask(kind, text.replace("{}", "[..]"), readings)
            if self.force.mixed > 1:
                self._hint("an arc that closes only if lengths without a decimal point are in whole units")
        # an end after "/" may be skipped
        self._ended = self._ended or (runs and not {2.0, 30.0}.isdisjoint(line.m))

    def _signs(self, line: LineWords) -> None:
        g, m, values = line.g, line.m, line.values
        theirs = [f"G{n:g}" for n in g if n in _FANUC_G] + [f"M{n:g}" for n in m if n in _FANUC_M]
        owner = "" if self.force.takes_p(line) else line.p_of
        own = [f"G{n:g}" for n in g if n in _LINUXCNC_G] + ["G64 P"] * (owner == "G64")
        own += ["G96 D"] * (96.0 in g and "D" in values)
        if 4.0 in g and "P" not in values:
            theirs.append("G4 without P")
        if owner == "G30" or (owner in ("G8", "G54") and not line.linuxcncs_user_of_p()):
            theirs.append(f"{owner} with P")
        if 33.0 in g and "K" not in values:
            theirs.append("G33 without K")
        moves = not values.keys().isdisjoint("XYIJ")
        if 5.0 in g:  # path smoothing in a Fanuc and a spline in LinuxCNC, as is G5.1
            theirs += ["G5 without X and Y"] * (not moves and not values.keys().isdisjoint("PQ"))
            own += ["G5 with X, Y, P and Q"] * (moves and values.keys() >= {"P", "Q"})
        if 5.1 in g:
            theirs += ["G5.1 with Q"] * ("Q" in values)
            own += ["G5.1 with I or J"] * ("Q" not in values and not values.keys().isdisjoint("IJ"))
        if theirs:
            self._sign("fanuc", f"a Fanuc's or Haas's ({theirs[0]})")
        if own:
            self._sign("linuxcnc", f"LinuxCNC's ({own[0]})")


def _line_words(code: str, words: list[tuple[str, str]]) -> LineWords:
    """Return the words of a line by kind, with their numbers."""
    g, m = ([read_number(value) for letter, value in words if letter == kind] for kind in "GM")
    computed = (letter + value for letter, value in words if letter in "GM" and ("#" in value or "{" in value))
    values = {letter: value for letter, value in words if letter not in "GM"}
    p_of = find_owner_of_p((letter, read_number(value)) for letter, value in words) if "P" in values else ""
    return LineWords(code=code, g=g, m=m, computed=next(computed, ""), values=values, p_of=p_of)


def _squeeze(text: str) -> str:
    """Return a block without blanks, and with ``{}`` for its brackets."""
    text = "".join(text.split())
    while "[" in text:
        inner = _BRACKET.sub("{}", text)
        if inner == text:
            break
        text = inner
    return text
