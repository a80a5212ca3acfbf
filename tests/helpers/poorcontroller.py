"""What poor controllers make of what is written for them, reckoned by hand; and machines whose growth is known."""

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from smallmachine import small_machine

from thermocomp.cli.app import run
from thermocomp.recordings.readers import recordings
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.stacking import stack

FloatArray = NDArray[np.float64]
DATE = ["--date", "2026-01-31", "--jobs", "1"]


def growing_machine(per_kelvin: float, noise: float = 0.1, seed: int = 3, **more: float) -> Recording:
    """Return a test in which Z deviates by so much per kelvin of t1_C (and of others), counted from its first row."""
    plain, heat, rng = small_machine(), small_machine(noise=0.0).table, np.random.default_rng(seed)
    table = plain.table.copy()
    table["z_um"] = noise * rng.normal(size=len(table))
    for name, factor in {"t1_C": per_kelvin, **more}.items():
        table["z_um"] += factor * (heat[name] - heat[name].iloc[0])  # a part does not grow by the noise of its sensor
    return replace(plain, name="growing", table=table)


def noisy_machine(seed: int) -> Recording:
    """Return a test whose displacement has nothing to do with its temperatures."""
    plain, rng = small_machine(), np.random.default_rng(seed)
    table = plain.table.copy()
    table["z_um"] = 3.0 * rng.normal(size=len(table))
    return replace(plain, name="noise", table=table)


def exported(
    folder: Path, recording: Recording, to: str, *words: str, targets: str = "z_um", method: str = "ols"
) -> int:
    """Fit a model to a recording, and export it to the folder ``out``."""
    drift, model = folder / "drift.csv", folder / "model.json"
    recordings.write(recording, drift, overwrite=True)
    fit = ["fit", str(drift), "--target", *targets.split(), "--model", method, "-o", str(model), "--overwrite"]
    assert run([*fit, "--jobs", "1"]) in (0, 1)
    return run(["export", str(model), str(drift), "--to", to, "-o", str(folder / "out"), *DATE, *words])


def temperatures(recording: Recording) -> tuple[dict[str, FloatArray], dict[str, float]]:
    """Return the temperatures of a recording, its first minutes at their mean, and that mean: what counts as zero."""
    samples = stack([recording], ["z_um"])
    reference, change = samples.reference()[0], samples.change()
    names = [c.name for c in samples.inputs]
    return (
        {n: reference[k] + change[:, k] for k, n in enumerate(names)},
        dict(zip(names, reference.tolist(), strict=True)),
    )


def left(recording: Recording, correction: FloatArray, rows: slice = slice(None)) -> tuple[float, float]:
    """Return RMS and largest of what a correction leaves of Z [um]."""
    residual = (recording.table["z_um"].to_numpy() + correction)[rows]
    return float(np.sqrt(np.mean(residual**2))), float(np.abs(residual).max())


def klipper(text: str) -> Callable[[FloatArray, float], FloatArray]:
    """Return what Klipper adds to Z [um], by its documentation: a positive coefficient lowers it as it gets warmer."""
    options = dict(re.findall(r"^(\w+): (.*)$", text.partition("[z_thermal_adjust]")[2], re.M))
    coefficient, most = float(options["temp_coeff"]), float(options["max_z_adjustment"])

    def adjust(now: FloatArray, home: float) -> FloatArray:
        return 1e3 * np.clip(-coefficient * (now - home), -most, most)

    return adjust


def heidenhain(formula: str, words: Mapping[str, FloatArray], dimension: float = 0.0) -> FloatArray:
    """Return a formula such as ``<L>+3.45e-3*(W<t1_C>-20)``: sums and products, from left to right."""
    tokens = re.findall(r"<L>|W<\w+>|\d+\.?\d*(?:e[-+]?\d+)?|[-+*()]", formula)
    assert "".join(tokens) == formula

    def part() -> FloatArray:
        token = tokens.pop(0)
        if token == "(":
            found = total()
            assert tokens.pop(0) == ")"
            return found
        if token == "-":
            return -part()
        if token == "+":
            return part()
        if token == "<L>":
            return np.array(dimension)
        return words[token[2:-1]] if token.startswith("W") else np.array(float(token))

    def product() -> FloatArray:
        found = part()
        while tokens and tokens[0] == "*":
            tokens.pop(0)
            found = found * part()
        return found

    def total() -> FloatArray:
        found = product()
        while tokens and tokens[0] in "+-":
            found = found + product() if tokens.pop(0) == "+" else found - product()
        return found

    result = total()
    assert not tokens
    return result


def page_numbers(page: str, target: str = "z_um") -> dict[str, list[float]]:
    """Return what a page prints of no, the full and the reduced model; and of the numbers as they are written."""
    found = {
        what: [float(v) for v in re.findall(r"[-\d.]+|nan", line)]
        for what, line in re.findall(rf"^\| {target}: (RMS|largest) \|(.*)\|$", page, re.M)
    }
    written = re.search(rf"^{target}: on the recordings .* RMS ([\d.]+) um, largest ([\d.]+) um", page, re.M)
    return found | {"written": [float(v) for v in written.groups()] if written else []}


def left_out_cycles(page: str, target: str = "z_um") -> list[tuple[dict[str, float], list[float]]]:
    """Return the rows of its table of cycles: um per kelvin by sensor, and what none, full and reduced leave."""
    table = page.partition(f"{target}: coefficients fitted without")[2].partition("\n\n")[2].partition("\n\n")[0]
    rows = [line.strip("| ").split(" | ") for line in table.splitlines()[2:]]
    return [({n: float(f) for n, f in re.findall(r"(\w+) ([-\d.e]+)", r[1])}, [float(v) for v in r[2:]]) for r in rows]
