"""Sets of words, as they are easiest to read: many in a line."""


def split_words(*lines: str) -> frozenset[str]:
    """Return the words of comma-separated lines."""
    return frozenset(word for line in lines for word in line.split(", "))
