"""JSON output of the commands; it imports no training code."""

import json
import math
import sys
from collections.abc import Mapping
from numbers import Integral, Real
from typing import Any

from thermocomp import __version__

#: current command line
called_with: list[str] = []


def print_json(content: dict[str, Any]) -> None:
    """Print results as JSON, with the version and the settings."""
    sys.stdout.write(as_text({"arguments": called_with, **content}))


def as_text(content: Mapping[str, Any]) -> str:
    """Return results as JSON text, with the version."""
    # JSON has no nan and no infinity: unknown values are null
    text = json.dumps(_nulled({"thermocomp": __version__, **content}), indent=2, ensure_ascii=False)
    # characters unfit for terminals, and undecodable bytes of names, are written as JSON escapes
    return "".join(c if c.isprintable() or c == "\n" else json.dumps(c)[1:-1] for c in text) + "\n"


def _nulled(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _nulled(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_nulled(v) for v in value]
    if isinstance(value, Real) and not isinstance(value, Integral):
        return float(value) if math.isfinite(value) else None
    return value
