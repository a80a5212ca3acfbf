"""`thermocomp explain`: a model file in plain words."""

from pathlib import Path

from thermocomp.cli.jsonoutput import print_json
from thermocomp.cli.terminal import console, words
from thermocomp.core.explained import explain_all
from thermocomp.files import modelfile


def explain(model: Path, /, *, json: bool = False) -> int:
    """Say what the models of a file are made of, how good they are, and what a failure of each sensor does.

    Parameters
    ----------
    model : Path
        Model file from ``thermocomp fit``.
    json : bool
        Print it for a machine.

    Returns
    -------
    int
        0 done, 2 unusable input.
    """
    found = explain_all(modelfile.read(model))
    if json:
        print_json(found.to_dict())
        return 0
    for line in str(found).split("\n"):
        console.print(words(line), soft_wrap=True)
    return 0
