"""Names that people type, or that stand in a damaged file: none of them may do anything."""

from dataclasses import replace

from thermocomp.recordings.recording import Recording

NAMES = [
    "$x^{$",
    "a$b$",
    "$\\frac{1}{2}$",
    "\\$\\alpha_{",
    "_hidden",
    "_nolegend_",
    "_child0",
    "<script>alert(1)</script>",
    "\"><img src=x onerror=alert(1)>&amp;'",
    "{{ 7 * 7 }}{% raw %}",
    "]]>--><!--",
    "[red]x[/red][/]",
    "a\\",
    "a:warning:b",
    "[link=http://a]b",
    "a\nG0 Z-50 (x)\r%;",
    "\x1b[31m\x1b]0;title\x07",
    "\x9b31mC1",
    "a\x00b",
    "\udcff\ud800",
    "abc\u202edcba\u2066",
    "a\u200b\u2028b\ufeff",
    "\u6e29\u5ea6 \U0001f600 \u0416",
    "\ue000\U0010ffff\u0378",
    "e\u0301\u0489" * 20,
    "Temp\xa01",
    "x" * 10_000,
    "W\n" * 5_000,
    "",
    " ",
    "%s %(a)s {0} {x}",
    "=cmd|'/c calc'!A1",
    "`rm -rf /`; $(ls)",
]


def renamed(recording: Recording, name: str) -> Recording:
    """A recording in which everything has such a name; channels and cycles have one of their own each."""
    column = name.encode("utf-8", "replace").decode("utf-8")  # a table has no surrogates
    channels = tuple(replace(c, name=f"{column}{k}", place=name) for k, c in enumerate(recording.channels))
    table = recording.table.set_axis([c.name for c in channels], axis=1)
    cycles = tuple(replace(c, name=f"{name}{k}") for k, c in enumerate(recording.cycles))
    return replace(recording, name=name, source=name, channels=channels, table=table, cycles=cycles, notes=(name,))
