"""The function of a program that is being recorded, and its statements so far."""

from contextvars import ContextVar

from thermocomp.runtime.program.tree import Kind, Statement


class Trace:
    """Statements and local variables of the function that is being recorded."""

    def __init__(self) -> None:
        self.blocks: list[list[Statement]] = [[]]
        self.locals: dict[str, Kind] = {}


TRACE: ContextVar[Trace] = ContextVar("recording")


def add(statement: Statement) -> None:
    """Append a statement to the block that is being recorded."""
    TRACE.get().blocks[-1].append(statement)
