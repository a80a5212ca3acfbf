"""External texts, escaped for display: no name of a file moves a cursor, changes colours or begins a line."""

from unicodedata import category


def replace_unprintable(text: object) -> str:
    """Return a text with a question mark for all that cannot be printed, and a blank for blanks of other widths."""
    return "".join(c if c.isprintable() else " " if category(c) == "Zs" else "?" for c in str(text))


def shorten(text: object, longest: int) -> str:
    """Return a text that can be printed on one line, with dots for what is too much.

    Parameters
    ----------
    text : object
    longest : int
        Characters it may have.

    Returns
    -------
    str
    """
    line = str(text)
    return replace_unprintable(line if len(line) <= longest else f"{line[: longest - 3]}...")


def escape(text: object, longest: int) -> str:
    r"""Return a text with escapes for all that cannot be printed, such as ``\x07`` or ``\ud800``; lines stay.

    Parameters
    ----------
    text : object
    longest : int
        Number of characters of the text that are shown; dots replace the others.

    Returns
    -------
    str
    """
    line = str(text)
    line = line if len(line) <= longest else f"{line[: longest - 3]}..."
    return "".join(c if c.isprintable() or c == "\n" else ascii(c)[1:-1] for c in line)


def explain_unfit(text: str, longest: int = 200) -> str:
    """Return the reason why an external text cannot be a name; empty if it can.

    Parameters
    ----------
    text : str
    longest : int
        Characters that it may have.

    Returns
    -------
    str
        Fault, with the text escaped.
    """
    if len(text) > longest:
        return f"{text[:40]!a}... has {len(text):,} characters; at most {longest:,}"
    if not text.isprintable():
        return f"{text[:40]!a} has characters that cannot be printed"
    return ""
