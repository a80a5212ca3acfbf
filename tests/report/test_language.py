"""Pages in other languages: no text without a translation, no value lost in one, and English as before."""

import json
import pickle
import re
from dataclasses import replace
from html import unescape
from pathlib import Path
from string import Formatter

import numpy as np
import pytest
from babel.messages.pofile import read_po
from hypothesis import given
from hypothesis import strategies as st
from markupsafe import escape
from smallmachine import small_machine

import catalogue
import thermocomp
from thermocomp.core.exceptions import InputError
from thermocomp.core.messages import Message, join
from thermocomp.recordings.recording import Recording
from thermocomp.report.language import (
    LANGUAGES,
    VARIABLE,
    load_catalogue,
    load_words,
    translate,
    use_language,
    write_cell,
    write_date,
    write_number,
)

OTHERS = [language for language in LANGUAGES if language != "en"]


def troubled() -> Recording:
    """A recording with a gap, a spike, a stuck and a missing stretch."""
    recording = small_machine()
    table = recording.table.copy()
    name = recording.temperatures[0].name
    table.loc[table.index[30:60], name] = table[name].iloc[30]
    table.loc[table.index[80:90], recording.temperatures[1].name] = np.nan
    table.loc[table.index[100], recording.displacements[0].name] += 500.0
    return replace(recording, table=table)


def fields(text: str) -> set[str]:
    """The values that a text contains, with their formats."""
    if found := re.findall(r"%\((\w+)\)s", text):
        return set(found)
    return {f"{name}:{spec}" for _, name, spec, _ in Formatter().parse(text) if name}


@pytest.mark.parametrize("language", OTHERS)
def test_every_text_has_a_translation_with_the_same_values(language: str) -> None:
    texts = {m.id for m in catalogue.find_texts() if m.id}
    with (catalogue.LOCALE / f"{language}.po").open("rb") as file:
        known = read_po(file, locale=language)

    assert {m.id for m in known if m.id} == texts, "run python tools/catalogue.py, and translate what is new"
    assert not catalogue.find_open(known)
    for m in known:
        assert m.string is not None
        texts_of = ([m.id], [m.string]) if isinstance(m.id, str) else (m.id, m.string)
        for text, translation in zip(*texts_of, strict=True) if m.id else ():
            assert fields(str(translation)) == fields(str(text)), text


def test_a_message_is_its_text_and_keeps_what_it_is_made_of() -> None:
    row = Message("row {row} ({time:.10g} s)", row=7, time=1.5)
    whole = Message("is exchanged with {other} at {row}: each {x}", other="t{2}", row=row, x="{")

    again = pickle.loads(pickle.dumps(whole))

    assert whole == again == "is exchanged with t{2} at row 7 (1.5 s): each {"
    assert (again.template, again.values["row"].values) == (whole.template, {"row": 7, "time": 1.5})
    assert join([row, "b", "c"], "; ") == "row 7 (1.5 s); b; c"


def test_values_are_written_as_the_language_does() -> None:
    row = Message("row {row} ({time:.10g} s)", row=7, time=1.5)
    with use_language("de"):
        assert translate(row) == "Zeile 7 (1,5 s)"
        assert translate(Message("until {recording}", recording="1.5.csv")) == "bis 1.5.csv"
        assert translate("no such text") == "no such text"
        for text, shown in (("12.50", "12,50"), ("-0.10", "-0,10"), ("99.1 %", "99,1 %"), ("1.2.3", "1.2.3")):
            assert write_cell(text) == shown
        assert write_cell(Message("rows")) == "Zeilen"
        assert write_cell("rows") == "rows"  # a channel of this name
        assert write_date("2024-03-05T14:30:00") == "05.03.24, 14:30"
        assert write_date("on Monday") == "on Monday"
    assert translate(row) == row
    assert write_number("1.5") == "1.5"
    assert write_date("2024-03-05T14:30:00") == "2024-03-05T14:30:00"


@given(name=st.text(max_size=20), value=st.floats(allow_nan=True))
def test_no_value_breaks_a_translation(name: str, value: float) -> None:
    message = Message("starts at {start:.3g} {unit}, not near zero", start=value, unit=name)
    outer = Message("until {recording}", recording=message)

    assert translate(outer, "de") == f"bis starts at {value:.3g}".replace(".", ",") + f" {name}, not near zero"


def test_an_unknown_language_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match="language 'xx': choose one of en, de"), use_language("xx"):
        pass
    monkeypatch.setenv(VARIABLE, "xx")
    with pytest.raises(InputError, match=f"{VARIABLE}=xx: choose one of en, de"):
        thermocomp.check(small_machine()).page()


def find_english(page: str) -> list[str]:
    """The texts, and beginnings of texts with values, that a German page still has in English; and units of files."""
    shown = " ".join(unescape(re.sub(r"<(script|style|code).*?</\1>|<[^>]+>", " ", page, flags=re.DOTALL)).split())
    known = load_catalogue("de")
    starts = [(str(m.id), str(m.id).partition("{")[0].strip()) for m in catalogue.find_texts() if isinstance(m.id, str)]
    left = [start for text, start in starts if len(start) > 12 and start in shown and start not in known.gettext(text)]
    return left + re.findall(r"[0-9\[] ?(?:um|degC)\b(?! \d| \w{3})", shown)


def test_a_german_choice_of_sensors_and_plan() -> None:
    chosen = thermocomp.select([small_machine()], models=["ols"], max_sensors=2, jobs=1)
    planned = thermocomp.plan([small_machine()], curve=False)
    with use_language("de"):
        assert not find_english(chosen.page())
        assert not find_english(f"{translate(str(chosen))} {translate(str(planned))}")
        assert str(planned).startswith("Record next: ")
        assert translate(str(planned)).startswith("Als Nächstes aufzeichnen: ")


def test_notes_on_reading_are_german(tmp_path: Path) -> None:
    file = tmp_path / "a.csv"
    rows = "".join(f"{60 * k};{20 + k / 10:.1f};{k / 5:.1f}\n".replace(".", ",") for k in range(50))
    file.write_text(
        f"Versuch 1\n\ntime_s;t1_C;z_um;Kraft [kN]\n{rows.replace(chr(10), ';1' + chr(10))}", encoding="utf-8"
    )
    recording = thermocomp.read(file)

    german = [translate(note, "de") for note in recording.notes]

    assert "das Dezimalzeichen ist ein Komma" in german
    assert any(note.startswith("weggelassen: 'Kraft [kN]'") for note in german)
    assert not [note for note in recording.notes if note in german]


def test_a_german_check() -> None:
    found = thermocomp.check(troubled())
    english = found.page()
    with use_language("de"):
        german = found.page()

    assert '<html lang="en">' in english
    assert '<html lang="de">' in german
    assert "<h1>Prüfung der Aufzeichnung: Inhalt und Fehler</h1>" in german
    assert '<th class="l">Kanal</th>' in german
    assert {f.kind for f in found.findings[0]} >= {"stuck", "missing values", "spike"}
    for f in found.findings[0]:
        assert translate(f.text, "de") != f.text
        assert str(escape(translate(f.text))) in english
        assert str(escape(f.text)) not in german
        assert str(escape(translate(f.text, "de"))) in german
    assert not find_english(german)
    words = re.findall(r'<script type="application/json" id="words">(.*?)</script>', german)
    assert json.loads(words[0]) == load_words("de", "report/static/")
    assert '<script type="application/json" id="words">{}</script>' in english


def test_findings_are_a_template_and_values_for_programs() -> None:
    told = thermocomp.check(troubled()).to_dict()["recordings"][0]["findings"]

    stuck = next(f for f in told if f["kind"] == "stuck")
    assert stuck["message"]["template"].startswith("is constant at {value:.6g} {unit} for {n} rows, from {first} to")
    assert stuck["message"]["values"]["first"]["template"] == "row {row} ({time:.10g} s)"
    assert stuck["message"]["values"]["n"] == 30
    json.dumps(told)


def test_a_german_comparison(monkeypatch: pytest.MonkeyPatch) -> None:
    found = thermocomp.compare([small_machine()], models=["ols", "dynamic"])
    english = found.page()
    monkeypatch.setenv(VARIABLE, "de")
    german = found.page()

    headings = [h for h in re.findall(r"<h[123]>([^<{]*)</h[123]>", english) if " " in h]
    assert len(headings) > 5
    assert not [h for h in headings if f">{h}<" in german]
    assert not find_english(german)
    assert "Verwenden: " in german
    assert re.search(r"sinkt der RMS von \d+,\d", german)
    assert "Jeder Punkt ist ein Modell" in german
