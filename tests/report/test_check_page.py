"""The page of `check`: findings at their rows, everything of a recording, and no name that breaks it."""

import re
from collections.abc import Sequence
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from ownscripts import without_scripts
from smallmachine import small_machine

from thermocomp.core.machine import Channel
from thermocomp.recordings.checks.findings import Finding
from thermocomp.recordings.checks.quality import check
from thermocomp.recordings.recording import Recording
from thermocomp.report import checks


def _renamed(recording: Recording, names: Sequence[str]) -> Recording:
    channels = tuple(replace(c, name=n) for c, n in zip(recording.channels, names, strict=True))
    table = recording.table.copy()
    table.columns = list(names)
    return replace(recording, channels=channels, table=table)


def _troubled() -> Recording:
    recording = small_machine()
    table = recording.table.copy()
    table.loc[400:402, "z_um"] += 4300.0
    table.loc[500:, "x_um"] += 30.0
    table["t3_C"] += 273.15
    return replace(recording, table=table)


class _Tags(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.links: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.links += [v for k, v in attrs if k in ("src", "href") and v and not v.startswith("#")]


def test_findings_are_listed_and_marked_at_their_rows() -> None:
    recording = _troubled()
    found = check(recording)
    page = checks.render([recording], [found])

    assert [(f.channel, f.kind) for f in found[:3]] == [("z_um", "spike"), ("t3_C", "unit"), ("x_um", "step")]
    for number, f in enumerate(found, start=1):
        assert f'<span class="n {f.severity}">{number}</span> {f.severity}, {f.kind}' in page
    assert "3 serious problems: a model fitted to this recording would be wrong" in page
    for c in recording.channels:
        assert f'<td class="l">{c.name}</td>' in page
    # its number stands in the figure once, beside the axes' own; without the finding there is none
    picture = checks.draw(recording, found)
    bare = checks.draw(recording, ())
    assert picture.count("<path") > bare.count("<path")
    assert len(re.findall(r">1</text>", picture)) == len(re.findall(r">1</text>", bare)) + 1


def test_a_spike_does_not_hide_the_rest() -> None:
    """The axis shows what is sound: its largest label is far below the 4.3 mm of the spike."""
    recording = _troubled()
    text = checks.draw(recording, check(recording))
    numbers = [float(n.replace("−", "-")) for n in re.findall(r">([−\d.]+)</text>", text)]
    assert max(n for n in numbers if n != 3000) < 3000
    assert 4000 not in numbers
    assert 4000 in [float(n) for n in re.findall(r">([\d.]+)</text>", checks.draw(recording, ()))]


@pytest.mark.parametrize(
    "hostile",
    [
        "$\\frac{_C",
        "<script>alert(1)</script>_C",
        "_hidden_C",
        "a$b$_C",
        "x" * 300 + "_C",
        "温度😀_C",
        "a\nb\tc\x07_C",
        "{%%}_C",
    ],
)
def test_hostile_names_do_not_break_it(hostile: str) -> None:
    recording = _troubled()
    names = [hostile, *(c.name for c in recording.channels[1:])]
    bad = replace(_renamed(recording, names), name=hostile, source=f"/data/{hostile.replace('/', '')}.csv")
    bad = bad.with_cycles([replace(c, name=hostile) for c in bad.cycles])
    table = bad.table.copy()
    table.loc[350:, hostile] += 5.0
    found = check(replace(bad, table=table))
    assert hostile in [f.channel for f in found]

    page = checks.render([replace(bad, table=table)], [found])

    tags = _Tags()
    tags.feed(without_scripts(page))
    assert "script" not in tags.tags
    assert tags.links == []
    assert "svg" in tags.tags
    assert page.rstrip().endswith("</html>")


def test_the_page_needs_no_network_and_tells_several_files() -> None:
    tests = [small_machine(), _troubled()]
    page = checks.render(tests, [check(t) for t in tests])
    tags = _Tags()
    tags.feed(page)
    assert tags.links == []
    assert page.count("<h2") == 2
    assert tags.tags.count("svg") == 2
    assert "Nothing wrong was found." in page
    assert not re.search(r"""(?:src|href)=["']?https?:""", page)


def test_a_recording_of_nothing_but_a_position_or_of_no_numbers_is_drawn() -> None:
    recording = small_machine()
    empty = replace(recording, table=recording.table * np.nan)
    assert checks.render([empty], [check(empty)]).count("has no value at all") == len(recording.channels)
    channel = Channel("n", "dimensionless", "1")
    odd = replace(recording, channels=(channel,), table=recording.table[["z_um"]].rename(columns={"z_um": "n"}))
    assert checks.draw(odd, ()) == ""
    assert "</html>" in checks.render([odd], [check(odd)])


def test_many_channels_name_those_with_a_finding() -> None:
    recording = small_machine()
    names = [f"s{k}_um" for k in range(60)]
    rng = np.random.default_rng(0)
    table = recording.table[[]].copy()
    for n in names:
        table[n] = rng.normal(size=len(recording)).cumsum()
    many = replace(recording, table=table, channels=tuple(Channel(n, "displacement", "um") for n in names))
    text = checks.draw(many, [Finding("trouble", "s57_um", "step", "steps", row=300)])
    assert ">s57_um<" in text
    assert ">and 47 more<" in text
