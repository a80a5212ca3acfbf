"""Language of pages: texts from catalogues of gettext, numbers as the language writes them."""

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from datetime import datetime
from functools import cache
from gettext import NullTranslations
from importlib.resources import files
from io import BytesIO
from string import Formatter
from typing import Any

from babel.dates import format_datetime
from babel.messages.catalog import Catalog
from babel.messages.mofile import write_mo
from babel.messages.pofile import read_po
from babel.numbers import get_decimal_symbol
from babel.support import Translations

from thermocomp.core.exceptions import InputError
from thermocomp.core.messages import Message

#: languages with a catalogue, ``locale/LANGUAGE.po``, but for English, the language of the keys
LANGUAGES = {"en": "English", "de": "Deutsch"}
#: environment variable with the language of pages
VARIABLE = "THERMOCOMP_LANGUAGE"
_NUMBER = re.compile(r"[+-]?\d+\.\d+(e[+-]\d+)?( %)?")
#: units as in files, and as a page shows them; "um" is a word in German, so only English texts and units are searched
_UNITS = {"um": "\N{MICRO SIGN}m", "degC": "\N{DEGREE SIGN}C"}
_UNIT = re.compile(r"""(?<![\w"'])(um|degC)(?![\w"'])""")
_chosen: ContextVar[str] = ContextVar("language", default="")


@contextmanager
def use_language(language: str) -> Iterator[None]:
    """Render pages in a language; an empty one leaves the choice to the environment.

    Raises
    ------
    InputError
        There is no catalogue of this language.
    """
    if language and language not in LANGUAGES:
        raise InputError(f"language {language!r}: choose one of {', '.join(LANGUAGES)}")
    before = _chosen.set(language)
    try:
        yield
    finally:
        _chosen.reset(before)


def find_language() -> str:
    """Return the language in which pages are rendered: that of `use_language`, else that of the environment.

    Raises
    ------
    InputError
        The environment names a language without a catalogue.
    """
    language = _chosen.get() or os.environ.get(VARIABLE, "") or "en"
    if language not in LANGUAGES:
        raise InputError(f"{VARIABLE}={language}: choose one of {', '.join(LANGUAGES)}")
    return language


@cache
def load_catalogue(language: str) -> NullTranslations:
    """Return the translations into a language."""
    if language == "en":
        return NullTranslations()
    content = BytesIO()
    write_mo(content, _read(language))
    content.seek(0)
    return Translations(content)


@cache
def _read(language: str) -> Catalog:
    with (files(__package__) / "locale" / f"{language}.po").open("rb") as file:
        return read_po(file, locale=language)


def load_words(language: str, *places: str) -> dict[str, str]:
    """Return the translations of the texts of scripts, by their English text.

    Parameters
    ----------
    *places : str
        Beginnings of the paths of the scripts.
    """
    if language == "en":
        return {}
    return {
        str(m.id): str(m.string)
        for m in _read(language)
        if m.string and any(path.startswith(places) for path, _ in m.locations)
    }


def translate(text: str, language: str = "") -> str:
    """Return a text in a language; one without a translation stays English.

    Parameters
    ----------
    text : str
        A `Message` is translated by its template and values.
    language : str
        Default: the language of the page.
    """
    language = language or find_language()
    template = text.template if isinstance(text, Message) else text
    found = load_catalogue(language).gettext(template) if template else ""
    if found == template:
        found = show_units(template)
    return _Values(language).format(found, **text.values) if isinstance(text, Message) and text.values else found


def show_units(text: str) -> str:
    """Return an English text, or a unit, with its units as a page shows them."""
    return _UNIT.sub(lambda unit: _UNITS[unit[0]], text)


def write_number(text: str, language: str = "") -> str:
    """Return a number with the decimal symbol of a language, given with a point."""
    return text.replace(".", _decimal_symbol(language or find_language()))


def write_cell(text: str) -> str:
    """Return the cell of a table: a number as `write_number` does, a message translated, a unit, or text as it is."""
    if isinstance(text, Message):
        return translate(text)
    if text in _UNITS:
        return _UNITS[text]
    return write_number(text) if _NUMBER.fullmatch(text) else text


def write_date(text: str) -> str:
    """Return a date and time of ISO 8601 as the language writes it; unchanged in English, and other text."""
    language = find_language()
    if language != "en":
        with suppress(ValueError):
            return str(format_datetime(datetime.fromisoformat(text), "short", locale=language))
    return text


@cache
def _decimal_symbol(language: str) -> str:
    return get_decimal_symbol(language)


class _Values(Formatter):
    """Format of the values of a message in a language."""

    def __init__(self, language: str) -> None:
        self._language = language

    def format_field(self, value: Any, format_spec: str) -> str:
        if isinstance(value, str):
            return translate(value, self._language) if isinstance(value, Message) else _UNITS.get(value, value)
        text = format(value, format_spec)
        if "," in format_spec and self._language != "en":
            text = text.replace(",", "\N{NARROW NO-BREAK SPACE}")
        return write_number(text, self._language) if isinstance(value, float) else text
