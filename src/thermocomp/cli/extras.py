"""Optional dependencies: a command whose extra is missing reports the package to install."""

from collections.abc import Iterator
from contextlib import contextmanager

from thermocomp.core.exceptions import MissingExtraError

#: top-level modules of each extra
EXTRAS: dict[str, tuple[str, ...]] = {
    "study": ("jinja2", "joblib", "matplotlib", "openpyxl", "pandas", "pyarrow", "scipy", "sklearn"),
    "live": ("aiomqtt", "fastapi", "jinja2", "uvicorn"),
    "app": ("fastapi", "jinja2", "tomlkit", "uvicorn"),
    "opcua": ("asyncua",),
    "files": ("h5py", "matio", "nptdms"),
    "onnx": ("onnx",),
    "dask": ("dask", "distributed"),
}


@contextmanager
def needs(extra: str) -> Iterator[None]:
    """Convert a failed import of a module of the extra into a `MissingExtraError`."""
    try:
        yield
    except ImportError as e:
        # a command that cannot be imported gives the reason as the cause
        missing = (e.name or getattr(e.__cause__, "name", None) or "").split(".")[0]
        if missing in EXTRAS[extra]:
            raise MissingExtraError(extra, missing) from e
        raise
