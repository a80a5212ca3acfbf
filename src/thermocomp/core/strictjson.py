"""Strict parsing of external JSON: UTF-8, and unique keys."""

import json
from typing import Any


def parse_json(text: bytes | str) -> Any:
    """Return the content of a JSON text; repeated keys and invalid UTF-8 are errors."""
    try:
        # json would guess UTF-16 and UTF-32, and use the last of duplicate keys
        return json.loads(text.decode("utf-8") if isinstance(text, bytes) else text, object_pairs_hook=_once)
    except RecursionError as e:
        raise ValueError("nested too deeply") from e


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        keys = [key for key, _ in pairs]
        raise ValueError(f"the key {next(k for k in keys if keys.count(k) > 1)!r} occurs twice")
    return found
