"""Variables by name: namespace of the block's functions when they run in Python."""

from typing import Any


class Names:
    """A namespace of variables; see `thermocomp.export.block.layout`.

    Parameters
    ----------
    **values : object
    """

    def __init__(self, **values: Any) -> None:
        self.__dict__.update(values)

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(name)

    def __setattr__(self, name: str, value: Any) -> None:
        self.__dict__[name] = value
