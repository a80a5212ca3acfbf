"""Parser of any line of a program, for those that the fast parsers of `thermocomp.nc.parser.tokens` do not handle.

A line is first squeezed, that is, stripped of blanks and comments, then parsed, and its columns are mapped back to the
text.
"""

import re
from collections.abc import Sequence
from math import isinf

from thermocomp.nc.parser.line import Assignment, Controller, Line, Word

#: characters that controls ignore
BLANK = " \t\n\r\f\v"
_UPPER = str.maketrans("abcdefghijklmnopqrstuvwxyz", "ABCDEFGHIJKLMNOPQRSTUVWXYZ")
_BYTE_ORDER_MARKS = ("\ufeff", "ï»¿")

# of squeezed lines
_PIECE = re.compile(r"\(([^()]*)(\)?)|;(.*)|[^ \t(;]+")
_PLAIN = re.compile(r"[0-9]+\.?[0-9]*|\.[0-9]+")
_LABEL = {"linuxcnc": re.compile(r"N([0-9]+(?:\.[0-9]+)?)"), "fanuc": re.compile(r"N([0-9]+)")}
_DELETE = {"linuxcnc": re.compile("/"), "fanuc": re.compile("/[1-9]?")}
_NAME = re.compile(r"<[^<>(]*>")
_FUNCTION = re.compile(r"(?:ABS|ACOS|ASIN|ATAN|COS|EXISTS|EXP|FIX|FUP|LN|ROUND|SIN|SQRT|TAN|BIN|BCD)(?=\[)")
_CONTROL = re.compile("SUB|ENDSUB|CALL|RETURN|IF|ELSEIF|ELSE|ENDIF|WHILE|ENDWHILE|DO|REPEAT|ENDREPEAT|BREAK|CONTINUE")
_PROGRAM_NUMBER = re.compile(r"[O:][0-9]+|O?<[^<>(]*>")
_FANUC_FLOW = re.compile(r"IF\[|WH(?:ILE)?\[|GO(?:TO)?[0-9#\[]|(?:DO|END)[0-9#\[]")
_FANUC_OUTPUT = re.compile(r"DPRNT|BPRNT|POPEN|PCLOS|SETVN")


class _NotUnderstoodError(Exception):
    """Syntax error at a position of the squeezed line."""

    def __init__(self, place: int, what: str) -> None:
        super().__init__(what)
        self.place = place
        self.what = what


def runs_python(comment: str) -> bool:
    """Return whether LinuxCNC runs a comment as Python."""
    return comment.lstrip()[:3].lower() == "py,"


def read_slowly(text: str, number: int, controller: Controller) -> Line:
    """Parse any line, with the same result as `thermocomp.nc.parser.tokens.read_line` for ordinary lines."""
    line = Line(number, text)
    body = text.rstrip(BLANK)
    columns: Sequence[int] = range(len(body))
    try:
        _refuse_bytes(text, body)
        squeezed, columns = _squeeze(body, controller, line)
        _read_squeezed(squeezed, columns, controller, line)
    except _NotUnderstoodError as problem:
        column = columns[problem.place] if problem.place < len(columns) else len(body)
        line.error = f"column {column + 1}: {problem.what}"
    return line


def _refuse_bytes(text: str, body: str) -> None:
    """Refuse bytes that controls interpret differently: line endings, NUL bytes, byte order marks."""
    for mark in _BYTE_ORDER_MARKS:
        if text.startswith(mark):
            raise _NotUnderstoodError(0, "a byte order mark, which controls cannot read; save the program without it")
    if "\0" in text:
        raise _NotUnderstoodError(text.index("\0"), "a NUL byte, at which LinuxCNC stops reading; remove it")
    if text.endswith("\r") or "\n" in body or "\r" in body:
        what = "a lone carriage return, which LinuxCNC ignores and others read as a line end; save with usual line ends"
        raise _NotUnderstoodError(len(body), what)


def _squeeze(body: str, controller: Controller, line: Line) -> tuple[str, list[int]]:
    """Return the upper case line without blanks, ``(`` in place of every comment, and the columns of its characters."""
    pieces: list[str] = []
    comments: list[str] = []
    columns: list[int] = []
    for found in _PIECE.finditer(body):
        start, end = found.span()
        remark, closed, rest = found.groups()
        if rest is not None:
            remark = rest
            if controller == "fanuc" and rest.strip(BLANK):
                raise _NotUnderstoodError(start, "text after ';', which ends the block; put it on a separate line")
        elif remark is not None:
            if not closed:
                nested = body.startswith("(", end)
                what = "nested comments are not supported" if nested else "the comment is not closed on its line"
                raise _NotUnderstoodError(end if nested else start, what)
            pieces.append("(")
            columns.append(start)
        else:
            pieces.append(found.group())
            columns.extend(range(start, end))
        if remark is not None:
            comments.append(remark)
            if controller == "linuxcnc" and runs_python(remark):
                raise _NotUnderstoodError(
                    start, "this comment runs Python in LinuxCNC: its effect is unknown; remove it"
                )
    line.comment = " ".join(filter(None, comments))
    return "".join(pieces).translate(_UPPER), columns


def _read_squeezed(text: str, columns: Sequence[int], controller: Controller, line: Line) -> None:
    """Fill in the fields of a line from its squeezed text."""
    if line.text.strip(BLANK) == "%":
        line.demarcation = True
        return
    place = 0
    if found := _DELETE[controller].match(text):
        line.optional, place = True, found.end()
    if found := _LABEL[controller].match(text, place):
        line.label, place = found.group(1), found.end()
        if controller == "fanuc" and not line.optional and (found := _DELETE[controller].match(text, place)):
            line.optional, place = True, found.end()
    if controller == "linuxcnc":
        flow = text.startswith("O", place)
        if flow:
            end = _NAME.match(text, place + 1) or _value(text, place + 1, "O", controller)
            end = end if isinstance(end, int) else end.end()
            if not text[end:].strip("("):
                line.label = text[place:end]
                return
            _check_control(text, end)
    else:
        if found := _PROGRAM_NUMBER.match(text, place):
            line.label, place = found.group(), found.end()
        if found := _FANUC_OUTPUT.match(text, place):
            raise _NotUnderstoodError(
                place, f"{found.group()} is not supported: it passes values of the program to other programs; remove it"
            )
        flow = _FANUC_FLOW.match(text, place) is not None
    if flow:
        last = len(text.rstrip("(")) - 1
        line.flow = line.text[columns[place] : columns[last] + 1]
        return
    _read_words(text, place, columns, controller, line)


def _check_control(text: str, place: int) -> None:
    """Raise a syntax error if the text after the name of an O-word is invalid."""
    found = _CONTROL.match(text, place)
    if found is None:
        raise _NotUnderstoodError(place, "an O-word needs sub, call, if, while, repeat ... after its number or name")
    place, control = found.end(), found.group()
    if control in {"IF", "ELSEIF", "WHILE", "REPEAT"} and not text.startswith("[", place):
        raise _NotUnderstoodError(place, f"'{control.lower()}' needs '[' after it")
    while place < len(text):
        if text[place] == "[":
            place = _closed(text, place)
        elif text[place] == "(":
            place += 1
        else:
            raise _NotUnderstoodError(
                place, f"expected only brackets and comments after the O-word, found '{text[place]}'"
            )


def _read_words(text: str, place: int, columns: Sequence[int], controller: Controller, line: Line) -> None:
    """Parse words and assignments up to the end of the line."""
    letters = "ABCDEFGHIJKLMPQRSTUVWXYZ@^$" if controller == "linuxcnc" else "ABCDEFGHIJKLMPQRSTUVWXYZ"
    first: dict[str, int] = {}  # column of the first word of each letter
    while place < len(text):
        begin, letter = place, text[place]
        start = columns[begin]
        if letter == "(":
            place += 1
        elif letter == "#":
            target = _parameter(text, place)
            if not text.startswith("=", target):
                raise _NotUnderstoodError(target, f"'=' is missing after {text[place:target]}")
            place = _assigned(text, target, controller)
            value = line.text[columns[target] + 1 : columns[place - 1] + 1].lstrip(BLANK)
            line.assignments.append(Assignment(text[begin:target].lower(), value, start, columns[place - 1] + 1))
        elif letter in letters:
            place = _value(text, place + 1, letter, controller)
            if first.setdefault(letter, start) != start and letter not in "GM":
                what = f"{letter} appears twice on the line, first in column {first[letter] + 1}"
                raise _NotUnderstoodError(begin, what)
            end = columns[place - 1] + 1
            value = line.text[start + 1 : end].lstrip(BLANK)
            plain = _PLAIN.fullmatch(text, begin + 1 + (text[begin + 1] in "+-"), place)
            number = float(text[begin + 1 : place]) if plain else None
            if number is not None and isinf(number):
                raise _NotUnderstoodError(begin, f"the number of {letter} is too large")
            line.words.append(Word(letter=letter, start=start, end=end, value=value, number=number))
        else:
            raise _NotUnderstoodError(begin, _complaint(text, begin))


def _complaint(text: str, place: int) -> str:
    """Return the error message for a character that starts no token."""
    letter = text[place]
    if letter == "," and text[place + 1 : place + 2] in {"R", "C", "A"}:
        mend = "" if text[place + 1] == "A" else "--expand writes it as plain moves for a Fanuc; otherwise "
        return (
            f"',{text[place + 1]}' (corner rounding, chamfer, angle) is not supported; {mend}replace it with its moves"
        )
    if letter == "N":
        return "the line number N must be a whole number at the beginning of the line"
    if letter == "O":
        return "an O-word must be at the beginning of the line; in a number write the digit 0, not the letter O"
    if letter == "/":
        return "block delete '/' must be at the beginning of the line"
    if letter == "%":
        return "'%' must be alone on its line"
    return f"found {letter!r}, which is not the start of a word{'; numbers have a decimal point' * (letter == ',')}"


def _value(text: str, place: int, letter: str, controller: Controller) -> int:
    """Return the position after the value that starts at a given position."""
    begin = place
    while text[place : place + 1] in {"+", "-"} and (controller == "linuxcnc" or place == begin):
        place += 1  # LinuxCNC reads X--5 as X5
    if found := _PLAIN.match(text, place):
        return found.end()
    head = text[place : place + 1]
    if head == "#":
        return _parameter(text, place)
    if head == "[":
        return _closed(text, place)
    if found := _FUNCTION.match(text, place):
        place = _closed(text, found.end())
        return _closed(text, place + 1) if found.group() == "ATAN" and text.startswith("/[", place) else place
    what = f"found {head!r}" if head and head != "(" else "found nothing"
    if head == "O":
        what = "found the letter O; write the digit 0"
    raise _NotUnderstoodError(place, f"expected the value of {letter}, {what}")


def _parameter(text: str, place: int) -> int:
    """Return the position after the parameter that starts at a given position."""
    while text.startswith("#", place):
        place += 1
    if found := _NAME.match(text, place) or re.compile("[0-9]+").match(text, place):
        return found.end()
    if text.startswith("[", place):
        return _closed(text, place)
    raise _NotUnderstoodError(place, "'#' needs a number, a <name> or a bracket after it")


def _assigned(text: str, equals: int, controller: Controller) -> int:
    """Return the end of the value of an assignment; in Fanuc, an unbracketed expression up to the end of the line."""
    if controller == "linuxcnc":
        return _value(text, equals + 1, "the parameter", controller)
    end = text.find("(", equals)
    end = len(text) if end < 0 else end
    if end == equals + 1:
        raise _NotUnderstoodError(end, "expected the value of the parameter, found nothing")
    return end


def _closed(text: str, place: int) -> int:
    """Return the position after the bracket that closes the one at this position."""
    depth = 0
    for found in re.compile(r"[][(]").finditer(text, place):
        if found.group() == "(":
            raise _NotUnderstoodError(found.start(), "a comment inside brackets; move it out")
        depth += 1 if found.group() == "[" else -1
        if depth == 0:
            return found.end()
    raise _NotUnderstoodError(place, "the bracket '[' is not closed")
