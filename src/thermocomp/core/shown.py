"""Texts from outside, made fit to be read: no name of a file moves a cursor, changes colours or begins a line."""

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
