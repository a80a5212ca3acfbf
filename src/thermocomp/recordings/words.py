"""Sets of words in a compact, readable notation."""


def split_words(*lines: str) -> frozenset[str]:
    """Return the words of comma-separated lines."""
    return frozenset(word for line in lines for word in line.split(", "))
