"""Escaping of external texts for display: no file name may move a cursor, change colours or start a line."""

from unicodedata import category


def replace_unprintable(text: object) -> str:
    """Return a text with unprintable characters replaced by question marks, and all white space by blanks."""
    return "".join(c if c.isprintable() else " " if category(c) == "Zs" else "?" for c in str(text))


def shorten(text: object, longest: int) -> str:
    """Return a text that prints on one line, shortened with dots."""
    line = str(text)
    return replace_unprintable(line if len(line) <= longest else f"{line[: longest - 3]}...")


def escape(text: object, longest: int) -> str:
    r"""Return a text with unprintable characters escaped, such as ``\x07`` or ``\ud800``; line breaks stay."""
    line = str(text)
    line = line if len(line) <= longest else f"{line[: longest - 3]}..."
    return "".join(c if c.isprintable() or c == "\n" else ascii(c)[1:-1] for c in line)


def explain_unfit(text: str, longest: int = 200) -> str:
    """Return the reason why an external text cannot be a name; empty if it is valid."""
    if len(text) > longest:
        return f"{text[:40]!a}... has {len(text):,} characters; at most {longest:,} are allowed"
    if not text.isprintable():
        return f"{text[:40]!a} contains non-printable characters"
    return ""
