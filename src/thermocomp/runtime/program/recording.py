"""The function of a program that is being recorded."""

from contextvars import ContextVar

from thermocomp.runtime.program.tree import Kind, Statement


class Recording:
    """The function that is being recorded."""

    def __init__(self) -> None:
        self.blocks: list[list[Statement]] = [[]]
        self.locals: dict[str, Kind] = {}


RECORDING: ContextVar[Recording] = ContextVar("recording")


def add(statement: Statement) -> None:
    """Add a statement to the present block."""
    RECORDING.get().blocks[-1].append(statement)
