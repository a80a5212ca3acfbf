"""`Message`: a text that keeps its template and values, so that a page can show it in another language."""

from collections.abc import Sequence
from typing import Any


class Message(str):
    """Text made from an English template and values.

    It is the English text wherever text is expected; `thermocomp.report.language` translates it.

    Parameters
    ----------
    template : str
        Text with fields as of `str.format`, such as ``{low:.4g}``; its key in the catalogues of translations.
    **values : object
        Values of the fields; a `Message` among them is translated, too. Without any, braces are ordinary characters.

    Examples
    --------
    >>> Message("rows are {low:.4g} to {high:.4g} s apart", low=1.0, high=2.5)
    'rows are 1 to 2.5 s apart'
    """

    template: str
    values: dict[str, Any]

    def __new__(cls, template: str, /, **values: Any) -> "Message":
        """Return the text with its template and values."""
        made = super().__new__(cls, template.format(**values) if values else template)
        made.template, made.values = template, values
        return made

    def __getnewargs_ex__(self) -> tuple[tuple[str], dict[str, Any]]:
        """Return what `__new__` takes, for copies in other processes."""
        return (self.template,), self.values


def join(messages: Sequence[str], mark: str = "") -> str:
    """Return messages, of which there is at least one, as one message with a mark between them."""
    first, *others = messages
    for other in others:
        first = Message("{first}{mark}{second}", first=first, mark=mark, second=other)
    return first
