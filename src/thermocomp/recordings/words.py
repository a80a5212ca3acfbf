"""Words of loggers and spreadsheets in several languages, from ``vocabulary.toml``."""

import re
import tomllib
from pathlib import Path

_VOCABULARY = tomllib.loads(Path(__file__).with_name("vocabulary.toml").read_text(encoding="utf-8"))


def read_words(key: str) -> tuple[str, ...]:
    """Return the words of an entry of ``vocabulary.toml``, in the order of the file."""
    return _split(_VOCABULARY[key])


def read_word_groups(key: str) -> tuple[tuple[str, ...], ...]:
    """Return the groups of words of an entry of ``vocabulary.toml``, in the order of the file."""
    return tuple(map(_split, _VOCABULARY[key]))


def _split(text: str) -> tuple[str, ...]:
    return tuple(re.split(r",\s+", text.strip()))
