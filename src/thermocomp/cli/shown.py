"""Texts on a terminal: no name of a file moves its cursor, changes its colours or begins a line."""


def shown(text: object) -> str:
    """Return a text with a question mark for all that cannot be printed."""
    return "".join(c if c.isprintable() else "?" for c in str(text))


def mark(verdict: str) -> str:
    """Return a verdict in its colour."""
    colour = {"accepted": "green", "unproven": "yellow"}.get(verdict.partition(" ")[0], "red")
    return f"[{colour}]{verdict}[/]"
