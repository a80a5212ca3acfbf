"""The function of a program that is being recorded."""

from contextvars import ContextVar

from thermocomp.runtime.program.tree import Kind, Statement


class Trace:
    """The function that is being recorded."""

    def __init__(self) -> None:
        self.blocks: list[list[Statement]] = [[]]
        self.locals: dict[str, Kind] = {}


TRACE: ContextVar[Trace] = ContextVar("recording")


def add(statement: Statement) -> None:
    """Add a statement to the present block."""
    TRACE.get().blocks[-1].append(statement)
