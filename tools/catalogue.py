"""Texts of the pages that are translated, from the sources; `python tools/catalogue.py` updates the catalogues."""

import ast
import json
import re
import sys
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path

from babel.messages.catalog import Catalog
from babel.messages.pofile import read_po, write_po

ROOT = Path(__file__).resolve().parents[1]
SOURCE = ROOT / "src" / "thermocomp"
LOCALE = SOURCE / "report" / "locale"
#: beginning of a catalogue, without the dates that would change with every update
HEADER = r"""msgid ""
msgstr ""
"Language: {language}\n"
"Content-Type: text/plain; charset=utf-8\n"
"Content-Transfer-Encoding: 8bit\n"
"Plural-Forms: {plural}\n"

"""
#: pages that are translated; the texts of others wait for a translator
PAGES = ("report", "check", "selection", "assessed", "targets", "recordings", "table", "iso230", "volumetric")
#: words that the code writes and a page translates: verdicts, severities, kinds of findings, quantities
WORDS = (
    *(
        "accepted",
        "accepted for this duty",
        "unproven",
        "refused",
        "not unseen",
        "trouble",
        "warning",
        "info",
        "nothing",
    ),
    *("clock", "step", "swapped", "interference", "leak", "offset", "left out", "compensation", "duplicate channel"),
    *("implausible", "constant", "short", "gap", "irregular sampling", "no cycle", "missing-value code", "time unit"),
    *("missing values", "probed", "quantised", "stuck", "spike", "unit", "turning start", "not zeroed", "loggers"),
    *("temperature", "displacement", "spindle speed", "position", "angle", "feed"),
    *("running", "done", "stopped", "failed"),
    # baselines of the verdict
    *("no compensation", "the learned mean", "the last learned value"),
    *("no compensation, both re-zeroed at the start of the block", "no compensation (slow changes removed from both)"),
    "the mean curve of the other cycles or files over time",
    "Conditions covered by the judged cycles or files",
    # figures of merit
    *("Mean absolute residual.", "Root mean square of the residual.", "Largest absolute residual."),
    "Range of the residual, as ISO 230-3 states a drift.",
    "Reduction of the RMS relative to no compensation, in percent; negative means harm.",
    # places in files, orders of dates
    *(
        "row {first}",
        "rows {first}",
        "rows {first} to {last}",
        "line {first}",
        "lines {first}",
        "lines {first} to {last}",
    ),
    *("{rows} above the headings is skipped", "{rows} above the headings are skipped"),
    *("day/month/year", "month/day/year", "year/month/day", "year/day/month"),
    "{rows} at the end is not part of the table, and left out",
    "{rows} at the end are not part of the table, and left out",
    # sets of sensors
    "no set of temperatures is clearly better than no compensation; the smallest error: {error}",
    *("one of the targets", "the target"),
    *("{n} sensors cost {what} (means over the blocks)", "{n} sensor costs {what} (means over the blocks)"),
    ", {none:.2f} without compensation: the model does not help on unseen cycles",
    # how a test began, axes, contributions to the measurement uncertainty
    *("cold", "continued", "rezeroed", "known", "moved", "stood still", "not recorded"),
    *("zero", "repeatability", "sensitivity", "misalignment", "probe", "mounting", "instrument drift", "expansion"),
)


def find_texts() -> Catalog:
    """Return all texts that the pages translate, with the files in which they are."""
    catalog = Catalog(fuzzy=False)
    for path in sorted(SOURCE.rglob("*")):
        for text in _texts_of(path):
            catalog.add(text, locations=[(path.relative_to(SOURCE).as_posix(), 1)])
    for text in WORDS:
        catalog.add(text, locations=[("words", 1)])
    return catalog


def _texts_of(path: Path) -> Iterator[str]:
    if path.suffix == ".py":
        yield from _messages(ast.parse(path.read_text(encoding="utf-8")))
        return
    room = path.relative_to(SOURCE).parts[0]
    if path.suffix == ".html" and (path.stem in PAGES or room == "app"):
        for text in re.findall(r'\b_\("((?:[^"\\]|\\.)*)"', path.read_text(encoding="utf-8")):
            yield " ".join(text.replace(r"\"", '"').split())
    elif path.suffix == ".js" and room in ("app", "report") and ".min" not in path.name:
        yield from map(json.loads, re.findall(r'\b_\(("(?:[^"\\]|\\.)*")', path.read_text(encoding="utf-8")))


def _messages(tree: ast.AST) -> Iterator[str]:
    """Yield the templates of messages, the headings of columns and the labels of figures in Python code."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.args:
            text, known = node.args[0], node.func.id in ("Message", "Column")
            if node.func.id == "Method":
                text, known = node.args[1], True
            for part in ast.walk(text) if known else [text] if node.func.id == "translate" else []:
                if isinstance(part, ast.Constant) and isinstance(part.value, str) and _is_text(part.value):
                    yield part.value


def _is_text(template: str) -> bool:
    """Return whether a template has words besides its values."""
    return re.search(r"[A-Za-z]{2}", re.sub(r"\{.*?\}", "", template)) is not None


def main() -> None:
    """Add new texts to every catalogue, and remove those that are no longer used."""
    texts = find_texts()
    for path in sorted(LOCALE.glob("*.po")):
        with path.open("rb") as file:
            catalog = read_po(file, locale=path.stem)
        catalog.update(texts, no_fuzzy_matching=True)
        catalog.obsolete.clear()
        content = BytesIO()
        write_po(content, catalog, width=0, include_lineno=False, sort_output=True, omit_header=True)
        head = HEADER.format(language=path.stem, plural=catalog.plural_forms)
        path.write_text(head + content.getvalue().decode(), encoding="utf-8")
        sys.stdout.write(f"{path.name}: {len(catalog)} texts, {len(find_open(catalog))} without a translation\n")


def find_open(catalog: Catalog) -> list[str]:
    """Return the texts of a catalogue that have no translation."""
    return [
        str(m.id) for m in catalog if m.id and not all(m.string if isinstance(m.string, (list, tuple)) else [m.string])
    ]


if __name__ == "__main__":
    main()
