"""The examples in the docstrings of all public names run, and print what stands there."""

import doctest
import inspect
import re
from pathlib import Path

import pytest

import thermocomp

#: a base class of errors, and text
WITHOUT = ("ThermocompError", "__version__")
PUBLIC = sorted(name for name in thermocomp.__all__ if name not in WITHOUT)
ESTIMATORS = [n for n in PUBLIC if inspect.isclass(kind := getattr(thermocomp, n)) and hasattr(kind, "fit")]
#: bring a compiler along, which takes its time when it is first asked, or simulate and judge
SLOW = (
    "ACE",
    "BestSubset",
    "NetARX",
    "SigmoidNet",
    "assess",
    "compare",
    "export",
    "fit",
    "iso230",
    "plan",
    "revise",
    "select",
    "simulate",
    "Start",
)


@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.long] * (n in SLOW)) for n in PUBLIC])
def test_an_example_prints_what_it_says(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    public = getattr(thermocomp, name)
    (example,) = doctest.DocTestFinder(recurse=False).find(public, name, globs={})
    monkeypatch.chdir(tmp_path)  # an example may write

    found = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE).run(example)

    assert found.failed == 0
    assert any(re.search(r"\d", step.want) for step in example.examples), "the example asserts no number"


@pytest.mark.parametrize("name", ESTIMATORS)
def test_an_estimator_names_its_source(name: str) -> None:
    assert "\nReferences\n----------\n" in (inspect.getdoc(getattr(thermocomp, name)) or "")
