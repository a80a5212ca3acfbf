"""Texts from outside, made fit to be read: no name of a file moves a cursor, changes colours or begins a line."""


def replace_unprintable(text: object) -> str:
    """Return a text with a question mark for all that cannot be printed."""
    return "".join(c if c.isprintable() else "?" for c in str(text))
