"""Small changes of exported code in C or structured text, drawn at random: numbers, comparisons, signs, loops, ..."""

import random
import re
from collections.abc import Iterator
from typing import Literal, NamedTuple

Language = Literal["c", "st"]

_COMPARE = {
    "c": {"<": ("<=", ">"), "<=": ("<", ">"), ">": (">=", "<"), ">=": (">", "<"), "==": ("!=",), "!=": ("==",)},
    "st": {"<": ("<=", ">"), "<=": ("<", ">"), ">": (">=", "<"), ">=": (">", "<"), "=": ("<>",), "<>": ("=",)},
}
_SIGNS = {"+": ("-",), "-": ("+",), "*": ("/",), "/": ("*",)}
_WORDS = {"c": {"&&": ("||",), "||": ("&&",)}, "st": {"AND": ("OR",), "OR": ("AND",), "TRUE": ("FALSE",)}}
_LOOP = {
    "c": re.compile(r"for \((?P<n>\w+) = (?P<a>[^;]+); \w+ < (?P<b>[^;]+); \w+\+\+\)"),
    "st": re.compile(r"\bFOR (?P<n>\w+) := (?P<a>.+?) TO (?P<b>.+?) DO"),
}
_TEST = {"c": re.compile(r"\b(?:if|while) \((.+)\) \{$"), "st": re.compile(r"\b(?:IF|ELSIF|WHILE) (.+) (?:THEN|DO)$")}
_NOT = {"c": re.compile(r"!(?!=)"), "st": re.compile(r"\bNOT ")}
_CHOICE = re.compile(r"(?:= |return )(?P<test>.+) \? (?P<one>.+) : (?P<other>.+);")
_ASSIGN = {
    "c": re.compile(r"^\s+[\w>.\-\[\]() *+]+ = [^=].*;$"),
    "st": re.compile(r"^\s*[\w.\[\] *+\-()]+ := .*;$"),
}
_NUMBER = re.compile(r"(?<![\w.])\d+(?:\.\d+)?(?:[eE][-+]?\d+)?(?![\w.])")
_COMMENT = {"c": re.compile(r"/\*.*?\*/|\"[^\"]*\"", re.DOTALL), "st": re.compile(r"\(\*.*?\*\)", re.DOTALL)}
_TABLE = {
    "c": re.compile(r"^static const [^;]*? = [^;]*;", re.MULTILINE),
    "st": re.compile(r"^ {4}\w+ : [^;]*? := [^;]*;", re.MULTILINE),
}
_BODY = {
    "c": re.compile(r"^\w[^\n;]*\n\{\n.*?^\}$", re.MULTILINE | re.DOTALL),
    "st": re.compile(r"^END_VAR\n(?!VAR).*?^END_FUNCTION\w*$", re.MULTILINE | re.DOTALL),
}
#: how many of a hundred mutants are of each kind
SHARES = {"table": 25, "compare": 25, "condition": 15, "sign": 10, "loop": 10, "index": 5, "number": 5, "assignment": 5}


class Mutant(NamedTuple):
    """A change of a text."""

    kind: str
    line: int  #: number of the line, from 1
    begin: int
    end: int
    becomes: str

    def apply(self, text: str) -> str:
        """Return the changed text."""
        return text[: self.begin] + self.becomes + text[self.end :]

    def tell(self, text: str) -> str:
        """Return the changed line before the change, with the place marked, and what is put there."""
        first = text.rfind("\n", 0, self.begin) + 1
        last = text.find("\n", self.end)
        line = f"{text[first : self.begin]}[[{text[self.begin : self.end]}]]{text[self.end : last]}".strip()
        place = line.find("[[")
        return f"{self.kind} {self.line}: {line[max(0, place - 60) : place + 90]} -> {self.becomes}"


def draw(text: str, language: Language, count: int, seed: int) -> list[Mutant]:
    """Draw mutants: of each kind its share; first a table or function, then a place in it.

    Large tables and functions are thus not drawn more often than small ones.
    """
    random_ = random.Random(seed)
    plain = _COMMENT[language].sub(lambda m: re.sub(r"[^\n]", " ", m[0]), text)
    found: dict[str, list[list[Mutant]]] = {kind: [] for kind in SHARES}
    for pattern, places in ((_TABLE, _table_places), (_BODY, _code_places)):
        for part in pattern[language].finditer(plain):
            of_part: dict[str, list[Mutant]] = {}
            for kind, begin, end, becomes in places(part[0], language, random_):
                line = plain.count("\n", 0, part.start() + begin) + 1
                of_part.setdefault(kind, []).append(
                    Mutant(kind, line, part.start() + begin, part.start() + end, becomes)
                )
            for kind, mutants in of_part.items():
                found[kind].append(mutants)
    drawn: dict[Mutant, None] = {}
    wanted = {kind: -(-count * share // 100) for kind, share in SHARES.items()}
    for kind, n in wanted.items():
        for _ in range(50 * n):
            if sum(m.kind == kind for m in drawn) < n and found[kind]:
                drawn[random_.choice(random_.choice(found[kind]))] = None
    return list(drawn)


Place = tuple[str, int, int, str]


def _table_places(part: str, language: Language, random_: random.Random) -> Iterator[Place]:
    begin = part.index(":=" if language == "st" else "= ")
    for m in re.finditer(r"\b(?:TRUE|FALSE)\b", part[begin:]):
        yield "table", begin + m.start(), begin + m.end(), "FALSE" if m[0] == "TRUE" else "TRUE"
    for m in _NUMBER.finditer(part, begin):
        yield "table", m.start(), m.end(), _other_number(m[0], random_)


def _other_number(number: str, random_: random.Random) -> str:
    if re.fullmatch(r"\d+", number):
        return {"0": "1", "1": "0"}.get(number, str(int(number) + random_.choice((-1, 1))))
    value = float(number) * random_.choice((0.99, 1.01, 1.1, -1.0)) if float(number) else random_.choice((0.01, 1.0))
    text = repr(value).upper()
    return f"({text})" if value < 0.0 else text


def _code_places(part: str, language: Language, random_: random.Random) -> Iterator[Place]:
    at = 0
    for line in part.splitlines(keepends=True):
        for kind, begin, end, becomes in _line_places(line.rstrip("\n"), language, random_):
            yield kind, at + begin, at + end, becomes
        at += len(line)


def _line_places(line: str, language: Language, random_: random.Random) -> Iterator[Place]:
    if loop := _LOOP[language].search(line):
        for group, change in (("b", " + 1"), ("b", " - 1"), ("a", " + 1")):
            yield "loop", loop.start(group), loop.end(group), f"({loop[group]}{change})"
        return
    if re.match(r"(static|void|int|double|tc_real|const|unsigned)\b|\s+(int|tc_real|double|static|const)\b", line):
        return
    yield from _operators(line, language)
    yield from _conditions(line, language)
    for m in re.finditer(r"\[([a-z]\w*)\]", line):
        yield "index", *m.span(1), random_.choice(("0", f"{m[1]} - {m[1]}"))
    for m in _NUMBER.finditer(line):
        yield "number", *m.span(), _other_number(m[0], random_)
    if _ASSIGN[language].match(line):
        yield "assignment", len(line) - len(line.lstrip()), len(line), ";"


def _operators(line: str, language: Language) -> Iterator[Place]:
    for table, kind in ((_COMPARE[language], "compare"), (_SIGNS, "sign"), (_WORDS[language], "condition")):
        for m in re.finditer(r"(?<=\s)(?:[<>=!]=?|<>|[-+*/]|&&|\|\||AND|OR|TRUE)(?=\s|;)", line):
            for other in table.get(m[0], ()):
                yield kind, *m.span(), other


def _conditions(line: str, language: Language) -> Iterator[Place]:
    if test := _TEST[language].search(line):
        no = "!" if language == "c" else "NOT "
        yield "condition", *test.span(1), f"{no}({test[1]})"
    for m in _NOT[language].finditer(line):
        yield "condition", *m.span(), ""
    if language == "c" and (choice := _CHOICE.search(line)):
        yield "condition", choice.start("one"), choice.end("other"), f"{choice['other']} : {choice['one']}"
