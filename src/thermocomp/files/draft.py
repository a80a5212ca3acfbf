"""Write beside and move: a crash never leaves half a file where a whole one was."""

import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from thermocomp.core.exceptions import InputError
from thermocomp.core.scratch import scratch


@contextmanager
def draft(target: Path) -> Iterator[Path]:
    """Give the path of a draft of `target`; it becomes `target` if the block ends well.

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
    with scratch(target.parent) as folder:
        path = folder / "draft"
        yield path
        path.replace(target)


def refuse_existing(paths: Sequence[Path], overwrite: bool, inputs: Sequence[Path] = (), ending: str = "") -> None:
    """Raise `InputError` if an output cannot be written, before any work is done.

    Parameters
    ----------
    paths : sequence of Path
        To be written.
    overwrite : bool
        Existing files may be replaced.
    inputs : sequence of Path
        What is read: never to be replaced.
    ending : str
        Of the names of such files, such as ``.html``.
    """
    for path in paths:
        if not path.parent.is_dir():
            raise InputError(f"{path}: there is no folder {path.parent}; make it first")
        if path.is_dir():
            raise InputError(f"{path}: is a folder; name a file")
        if any(path.exists() and other.exists() and path.samefile(other) for other in inputs):
            raise InputError(f"{path}: is also an input; choose another name")
        if path.exists() and not overwrite:
            raise InputError(f"{path}: exists already; choose another name or allow overwriting with --overwrite")
        if ending and path.suffix.lower() != ending:
            raise InputError(f"{path}: the file is written as {ending[1:]}; name it {path.with_suffix(ending)}")


def publish(drafts: Mapping[Path, Path], *, overwrite: bool) -> None:
    """Move drafts to where they belong, the last one last: all of them, or none.

    Parameters
    ----------
    drafts : mapping of Path to Path
        Drafts by target.
    overwrite : bool
        Files of these names are replaced.

    Raises
    ------
    InputError
        A file of such a name has come into being since somebody looked.
    """
    done: list[Path] = []
    try:
        for target, path in drafts.items():
            if overwrite:
                path.replace(target)
            else:
                _link(path, target)
                done.append(target)
    except FileExistsError as e:
        for target in done:
            target.unlink()
        raise InputError(f"{target}: has come into being meanwhile; nothing was written: use --overwrite") from e


def _link(path: Path, target: Path) -> None:
    """Let a file have another name, unless there is one."""
    try:
        target.hardlink_to(path)
    except FileExistsError:
        raise
    except OSError:  # a disk without links
        with path.open("rb") as source, target.open("xb") as copy:
            shutil.copyfileobj(source, copy)
