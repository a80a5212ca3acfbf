"""Write beside and move: a crash never leaves half a file where a whole one was."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from uuid import uuid4


@contextmanager
def draft(target: Path) -> Iterator[Path]:
    """Give the path of a draft in the folder of `target`; it becomes `target` if the block ends well.

    Not by the standard library's temporary files: nobody but their owner may read those.

    Parameters
    ----------
    target : Path
        A file of that name is replaced.

    Yields
    ------
    Path
        Of a file that does not exist yet.
    """
    path = target.with_name(f".{uuid4().hex}.part")
    try:
        yield path
        path.replace(target)
    finally:
        path.unlink(missing_ok=True)
