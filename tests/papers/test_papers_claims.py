"""Claims as data: sentences filled in, criteria judged, and entries that are wrong."""

import importlib
from collections.abc import Callable
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from thermocomp.papers.claims import Claims, Facts
from thermocomp.papers.sentences import Sentences
from thermocomp.papers.studies import _known
from thermocomp.papers.study import Claim

FILE = """
[parts]
both = "shared by {LIMIT} claims"

[study.small]
ids = "C-34 C-36"
text = "It is small, {each}"
paper = "{LIMIT} um"
ours = "{error:g} um"
holds = "error <= LIMIT"
note = "Of ten rows."
otherwise = "The rest is noise."
each = ["cold", "warm"]

[study.rows]
ids = "C-35"
text = "Rows"
ours = "{rows:#}, {both}"

[study.softer]
ids = "C-35"
text = "Smaller"
paper = "half"
ours = "{times:g}"
holds = "times > ONE"
softer = "Half in the paper, here {times:g}."
whole = "times >= HALF"
note = "Of ten rows."

[study.reading]
ids = "C-32"
text = "Well"
ours = "{times:g}"
holds = "times > ONE"
reading = "'well' as more than {ONE:g}"

[study.presupposed]
ids = "W-08"
text = "Better"
ours = "{times:g}"
holds = "times > ONE"
premise = "error <= LIMIT"
untestable = "An error of {error:g} um leaves nothing to compare."
otherwise = "It is not."

[study.told]
ids = "C-35"
text = "Verdict of the facts"
ours = "{word}"
"""


@pytest.fixture
def study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    package = tmp_path / "small_paper"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "claims.toml").write_text(FILE, encoding="utf-8")
    (package / "study.py").write_text("LIMIT = 1\nONE, HALF = 1.0, 2.0\n", encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    return importlib.import_module("small_paper.study")


def test_a_claim_is_judged_by_its_criterion_or_its_facts(study: ModuleType) -> None:
    claims = Claims[SimpleNamespace](study.__name__)

    @claims.facts
    def _small(found: SimpleNamespace, state: str) -> Facts:
        return {"error": np.float64(found.cold if state == "cold" else 2.0)}

    @claims.facts
    def _told(found: SimpleNamespace) -> Facts:
        return {"word": "so", "holds": np.bool_(found.cold < 1)}

    cold, warm, rows, *_, told = claims(SimpleNamespace(cold=0.5, rows=[1, 2, 3], both=True, times=1.5, error=2.0))
    assert (cold.ids, cold.text, cold.paper, cold.ours) == (("C-34", "C-36"), "It is small, cold", "1 um", "0.5 um")
    assert (cold.holds, cold.finding) == (True, "Of ten rows.")
    assert (warm.holds, warm.finding) == (False, "Of ten rows. The rest is noise.")
    assert (rows.ours, rows.holds, rows.finding) == ("3, shared by 1 claims", None, "")
    assert told.holds is True
    assert claims.judged("rows", SimpleNamespace(rows=[], both=False))[0].ours == "0, "


@pytest.mark.parametrize(
    ("error", "times", "verdict"),
    [(1.0, 1.5, "yes"), (1.0, 0.5, "no"), (1.1, 1.5, "not testable"), (1.1, 0.5, "not testable")],
)
def test_a_claim_without_its_premise_is_not_testable(
    study: ModuleType, error: float, times: float, verdict: str
) -> None:
    found = SimpleNamespace(error=error, times=times)
    claims = Claims[SimpleNamespace](study.__name__)
    (claim,) = claims.judged("presupposed", found)
    assert claim.verdict == verdict
    reasons = {"yes": "", "no": "It is not.", "not testable": "An error of 1.1 um leaves nothing to compare."}
    assert claim.finding == reasons[verdict]
    assert (claim.holds, claim.testable) == ({"yes": True, "no": False}.get(verdict), verdict != "not testable")


@pytest.mark.parametrize(
    ("runs", "verdict"),
    [
        ((None, None, None), "not testable"),
        ((None, False, False), "no"),
        ((False, False, None), "no"),
        ((True, True, None), "2 of 3"),
        ((None, True, False), "1 of 3"),
        ((True, True, True), "yes"),
    ],
)
def test_a_run_that_cannot_test_a_claim_hides_no_failure(runs: tuple[bool | None, ...], verdict: str) -> None:
    untested = Claim(("W-08",), "Better", "", "1", None, "Nothing to compare.", testable=False)
    made = {None: untested, True: Claim(("W-08",), "Better", "", "1", True)}
    made[False] = Claim(("W-08",), "Better", "", "1", False, "It is not.")
    first, *others = (made[holds] for holds in runs)
    joined = _known(first, [[c] for c in others], seed=0)
    assert joined.verdict == verdict
    assert ("Nothing to compare." in joined.finding) is (None in runs)


@pytest.mark.parametrize(
    ("times", "verdict", "finding", "read"),
    [
        (0.9, "no", "Of ten rows.", "no"),
        (1.9, "in part", "Half in the paper, here 1.9. Of ten rows.", "in part"),
        (2.1, "yes", "Of ten rows.", "in part"),
    ],
)
def test_a_criterion_softer_than_the_paper_holds_in_part(
    study: ModuleType, times: float, verdict: str, finding: str, read: str
) -> None:
    """Softer than a printed number, or than a word that the paper gives no number for: the reading is always told."""
    claims = Claims[SimpleNamespace](study.__name__)
    (softer,) = claims.judged("softer", SimpleNamespace(times=times))
    assert (softer.verdict, softer.finding) == (verdict, finding)
    (word,) = claims.judged("reading", SimpleNamespace(times=times))
    assert (word.verdict, word.softer) == (read, read != "no")
    assert word.finding == "The paper gives no number: we read 'well' as more than 1."


def test_facts_of_no_claim_are_refused(study: ModuleType) -> None:
    claims = Claims[None](study.__name__)

    def large(_: None) -> Facts:
        return {}

    with pytest.raises(KeyError, match="no claim is named large"):
        claims.facts(large)


def made(**names: object) -> Callable[[str], str]:
    parts = {
        "pairs": "{0} is {1:.1f}",
        "extra": "; and {word}",
        "kind": {"true": "all of it", "false": "none", "some": "some of it", "most": "most"},
    }
    return Sentences({"word": "more", **names}, parts).fill


@pytest.mark.parametrize("values", [[1.0, 2.5], (1.0, 2.5), np.array([1.0, 2.5]), {"a": 1.0, "b": 2.5}])
def test_lists_are_joined(values: object) -> None:
    assert made(values=values)("{values:.1f} or {values:.0%| / }: {values:#}") == "1.0, 2.5 or 100% / 250%: 2"


def test_parts_are_optional_repeated_or_chosen() -> None:
    fill = made(pairs=[("x", 1.0), ("y", 2.0)], extra=True, kind=np.bool_(False))
    assert fill("{pairs:|; }{extra}") == "x is 1.0; y is 2.0; and more"
    assert made(pairs={"x": 1.0}, extra=[])("{pairs}{extra}") == "x is 1.0"
    assert made(extra=0)("so{extra}") == "so"
    assert fill("{kind}") == "none"
    assert made(kind="some")("{kind}") == "some of it"
    assert made(kind=["some", "most"])("{kind:| or }") == "some of it or most"
    assert made(kind="neither")("{kind}.") == "."


@pytest.mark.parametrize(
    ("criterion", "holds"),
    [("low < high", True), ("high <= low", False), ("high > low", True), ("low >= high", False), ("unknown", None)],
)
def test_criteria(criterion: str, holds: bool | None) -> None:
    assert Sentences({"low": 1, "high": 2, "unknown": None}, {}).judge(criterion) is holds
