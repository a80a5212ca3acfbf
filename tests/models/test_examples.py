"""The examples in the docstrings of the public estimators run, and print the numbers that stand there."""

import doctest
import inspect
import re

import pytest

import thermocomp

ESTIMATORS = sorted(
    name for name in thermocomp.__all__ if inspect.isclass(kind := getattr(thermocomp, name)) and hasattr(kind, "fit")
)
#: bring a compiler along, which takes its time when it is first asked
COMPILED = ("ACE", "BestSubset", "NetARX", "SigmoidNet")


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[pytest.mark.long] * (name in COMPILED)) for name in [*ESTIMATORS, "freeze"]],
)
def test_an_example_prints_what_it_says(name: str) -> None:
    public = getattr(thermocomp, name)
    (example,) = doctest.DocTestFinder(recurse=False).find(public, name, globs={})

    found = doctest.DocTestRunner().run(example)

    assert found.failed == 0
    assert any(re.search(r"\d", step.want) for step in example.examples), "the example asserts no number"


@pytest.mark.parametrize("name", ESTIMATORS)
def test_an_estimator_names_its_source(name: str) -> None:
    assert "\nReferences\n----------\n" in (inspect.getdoc(getattr(thermocomp, name)) or "")
