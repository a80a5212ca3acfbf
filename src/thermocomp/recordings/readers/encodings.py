"""Character encoding of a text file that is not UTF-8."""

import re
from collections.abc import Iterable
from pathlib import Path

from thermocomp.core.exceptions import RecordingError
from thermocomp.core.messages import Message
from thermocomp.recordings.readers.limits import FileLimits

#: candidates in this order; the first under which most of the text is meaningful is used
_ENCODINGS = ("cp1252", "cp850", "mac-roman", "shift_jis", "gb18030")
#: non-ASCII characters expected in headings: unit symbols, and letters within words
_SENSE = re.compile(
    r"°(?= ?[CFK])|℃|[µμ](?=m|rad)|(?<=min)[⁻¯]¹"
    r"|(?<=[A-Za-z])[äöüßéèêàçñóíáô]|[äöüÄÖÜéèêàçñóíáô](?=[a-z])"
)
_HEAD = 65536
_LONE_CR = re.compile(rb"\r(?![\r\n])")


def bring_to_utf8(path: Path, limits: FileLimits) -> tuple[bytes | None, tuple[str, ...]]:
    """Return a file as UTF-8 with standard line ends, and notes on the conversion, if it needs conversion.

    Returns
    -------
    data : bytes or None
        None: the file can be read directly, line by line.
    """
    with path.open("rb") as f:
        head = f.read(_HEAD)
    encoding = _find_utf16(head)
    lone = not encoding and _LONE_CR.search(head[:-1]) is not None
    if not (encoding or lone):
        return None, ()
    limits.check("recoded_bytes", path.stat().st_size, f"{path}: UTF-16, or line ends of an old Macintosh")
    data = path.read_bytes()
    notes: tuple[str, ...] = ()
    if encoding:
        try:
            data = data.decode(encoding).removeprefix("\ufeff").encode()
        except UnicodeError as e:
            raise RecordingError(
                f"{path}: the file is written in UTF-16, but damaged ({e}); save it as UTF-8 (in a spreadsheet: CSV "
                "UTF-8)"
            ) from e
        notes = (Message("written in {encoding}", encoding=encoding.upper()),)
    if _LONE_CR.search(data):
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        notes = (*notes, Message("lines end as in files of old Macintoshes"))
    return data, notes


def find_encoding(lines: Iterable[bytes]) -> str:
    """Return the encoding under which lines that are not UTF-8 are most meaningful."""
    text = b"".join(lines)
    found = {}
    for encoding in _ENCODINGS:
        try:
            found[encoding] = len(_SENSE.findall(text.decode(encoding)))
        except UnicodeDecodeError:
            continue
    return max(found, key=lambda e: found[e]) if found else "latin-1"


def _find_utf16(head: bytes) -> str:
    """Return the UTF-16 variant of the head of a file, with or without byte order mark; empty if it is not UTF-16."""
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16-le" if head[0] == 0xFF else "utf-16-be"
    half = len(head) // 2
    even, odd = head[0::2].count(0), head[1::2].count(0)
    if half and max(even, odd) > 0.8 * half and min(even, odd) == 0:
        return "utf-16-le" if odd > even else "utf-16-be"
    return ""
