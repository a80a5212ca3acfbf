"""A reduced model: judged on what it has not seen, beside the full one, by the numbers that are printed."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from poorcontroller import growing_machine, left, noisy_machine, temperatures
from smallmachine import small_machine, two_that_matter

from thermocomp.core.exceptions import InputError
from thermocomp.core.model import ErrorModel
from thermocomp.core.provenance import RULES, HonestError
from thermocomp.export.reduction.judging import Reduction, method_of, reduce_model
from thermocomp.export.reduction.reduced import SHAPES, as_it_is, find_axis, fits, in_mm, linear_factors, mark
from thermocomp.models.training import train
from thermocomp.recordings.readers.mapping import read_mapping
from thermocomp.recordings.readers.recordings import read
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.stacking import stack

JUDGED = HonestError("test", 1.0, 1.0, 2.0, 5.0, 5.0, {"1": 1.0}, "accepted", "better", 3, rules=RULES)


def full(recording: Recording, method: str = "ols", target: str = "z_um") -> ErrorModel:
    samples = stack([recording], [target])
    return train(method, samples, 0, np.ones(len(samples), np.bool_)).model


def reduce(recording: Recording, to: str = "klipper", method: str = "ols") -> Reduction:
    return reduce_model(full(recording, method), "Z", [recording], SHAPES[to])


@pytest.mark.parametrize("per_kelvin", [3.0, -7.5])
def test_what_a_machine_grows_by_is_found(per_kelvin: float) -> None:
    r = reduce(growing_machine(per_kelvin)).reduced
    ((sensor, factor),) = r.terms
    assert sensor.name == "t1_C"
    assert factor == pytest.approx(per_kelvin, rel=0.01)
    assert r.model.honest_error is not None
    assert (r.model.honest_error.word, r.model.intercept) == ("accepted", 0.0)
    assert r.reduced.rms < 1.1 * np.hypot(0.1, 0.02 * per_kelvin)  # the noise of the probe, and of the sensor
    assert r.loss < 1.0  # the full one stops beyond what it has learned
    assert r.why_not(2.0) == ""


@pytest.mark.parametrize("to", ["klipper", "heidenhain"])
@pytest.mark.parametrize("seed", range(4))
def test_noise_is_never_accepted(to: str, seed: int) -> None:
    r = reduce(noisy_machine(seed), to).reduced
    assert r.model.honest_error is not None
    assert r.model.honest_error.word != "accepted"
    assert r.why_not(100.0)


def test_a_machine_with_a_memory_loses_too_much() -> None:
    r = reduce(small_machine(), method="dynamic").reduced
    assert r.model.honest_error is not None
    assert r.model.honest_error.word == "accepted"
    assert r.loss == pytest.approx(r.reduced.rms / r.full.rms)
    assert r.loss > 5
    assert "loses too much accuracy: RMS 3.5" in r.why_not(2.0)
    assert r.why_not(10.0) == ""


@pytest.mark.parametrize("to", ["klipper", "heidenhain"])
def test_what_was_judged_is_what_the_numbers_say(to: str) -> None:
    recording = two_that_matter(1)
    channels = tuple(replace(c, name=c.name.replace("x_um", "z_um")) for c in recording.channels)
    table = recording.table.rename(columns={"x_um": "z_um"})
    recording = replace(recording, table=table, channels=channels)
    r = reduce(recording, to).reduced
    warm, zero = temperatures(recording)
    squares = 0.0
    for cycle, kept in zip(recording.cycles, r.cycles, strict=True):
        factors = linear_factors(kept.model)
        assert factors is not None
        said = sum(f * (warm[i.name] - zero[i.name]) for i, f in zip(kept.model.inputs, factors, strict=True))
        rms, _ = left(recording, -np.asarray(said), slice(cycle.start, cycle.stop))
        assert kept.reduced == pytest.approx(rms, rel=1e-9)
        squares += rms**2 * (cycle.stop - cycle.start)
    assert r.reduced.rms == pytest.approx(np.sqrt(squares / len(recording.table)), rel=1e-9)
    said = np.array([r.deviation([warm[i.name][k] for i, _ in r.terms]) for k in range(len(recording.table))])
    at_zero = r.deviation([zero[i.name] for i, _ in r.terms])
    assert r.replayed == pytest.approx(left(recording, at_zero - said), rel=1e-9)


def test_the_choice_does_not_look_at_the_judged_cycle() -> None:
    recording = growing_machine(2.0, t2_C=1.0)
    last = recording.cycles[-1]
    table = recording.table.copy()
    table.loc[last.start :, "z_um"] = 9.0 * (table["t3_C"] - table["t3_C"].iloc[0])  # there another sensor is right
    changed = replace(recording, table=table)
    plain, other = (reduce(r, "heidenhain").reduced.cycles for r in (recording, changed))
    assert plain[-1].name == other[-1].name
    for field in ("inputs", "terms", "coefficients"):
        assert getattr(plain[-1].model, field) == getattr(other[-1].model, field)
    assert plain[-1].reduced < 1.0 < other[-1].reduced
    assert any(a.model != b.model for a, b in zip(plain[:-1], other[:-1], strict=True))


def test_the_full_model_is_fitted_anew_or_its_own_error_told() -> None:
    recording = growing_machine(3.0)
    model, samples = full(recording, "dynamic"), stack([recording], ["z_um"])
    assert method_of(model, samples) == "dynamic"
    found = reduce_model(model, "Z", [recording], SHAPES["klipper"])
    assert "dynamic, fitted again" in found.reduced.beside
    assert [a.block for a in found.full] == [a.block for a in found.blocks]
    assert model.provenance is not None
    for known in (None, replace(model.provenance, method="theirs"), replace(model.provenance, parameters={"a": "1"})):
        foreign = replace(model, provenance=known, honest_error=JUDGED)
        assert method_of(foreign, samples) == ""
        r = reduce_model(foreign, "Z", [recording], SHAPES["klipper"]).reduced
        assert (r.full.rms, r.full.largest) == (1.0, 2.0)
        assert "that in the model file" in r.beside
    r = reduce_model(replace(model, provenance=None), "Z", [recording], SHAPES["klipper"]).reduced
    assert "loss cannot be stated" in r.why_not(2.0)


def test_a_single_cycle_proves_nothing() -> None:
    whole = growing_machine(3.0)
    first = whole.cycles[0]
    one = replace(whole, table=whole.table[: first.stop], time=whole.time[: first.stop], cycles=(first,))
    r = reduce(one).reduced
    assert r.model.honest_error is not None
    assert r.model.honest_error.word == "unproven"
    assert "--accept-unproven" in r.why_not(2.0)
    taken = replace(r, model=r.model.taken("M. Weber, trial"))
    assert taken.why_not(2.0) == ""


def test_a_measured_printer(shared_data: Path) -> None:
    """Its frame, with the bed hot: its maker finds -33.35 um/K (R, with the bed as a second input)."""
    night = shared_data / "voron_frame" / "frame_exp_quant_v3_2021-06-13_05-41-53.csv"
    whole = read(night, read_mapping(Path(__file__).parents[1] / "recordings" / "voron.toml"))
    hot = np.flatnonzero(whole.table["bed_t"] > 104)[30:]
    table = whole.table.iloc[hot].reset_index(drop=True)
    table["z"] -= table["z"].iloc[0]
    one = (replace(whole.cycles[0], start=0, stop=len(hot)),)
    warm = replace(whole, table=table, time=whole.time[hot] - whole.time[hot[0]], cycles=one)
    r = reduce_model(full(warm, "ols", "z"), "Z", [warm], SHAPES["klipper"], sensors=["frame_t"]).reduced
    ((_, factor),) = r.terms
    assert factor == pytest.approx(-33.35, rel=0.03)
    assert r.none.rms > 200
    assert r.reduced.rms == pytest.approx(6.7, abs=0.2)
    assert r.loss < 1.5
    assert "--accept-unproven" in r.why_not(2.0)


def test_sensors_that_the_controller_has() -> None:
    recording = growing_machine(3.0)
    model = full(recording)
    r = reduce_model(model, "Z", [recording], SHAPES["klipper"], sensors=["t2_C"]).reduced
    assert [i.name for i, _ in r.terms] == ["t2_C"]
    with pytest.raises(InputError, match=r"t9_C: no such temperature; there are t1_C, t2_C, t3_C"):
        reduce_model(model, "Z", [recording], SHAPES["klipper"], sensors=["t9_C"])


def test_what_has_the_shape_already_is_taken_as_it_is() -> None:
    recording = growing_machine(3.0)
    model = replace(full(recording), honest_error=JUDGED)
    assert fits(model, SHAPES["heidenhain"])
    assert not fits(model, SHAPES["klipper"])
    assert not fits(full(recording, "dynamic"), SHAPES["macro"])
    r = as_it_is(model, "Z")
    assert (r.loss, r.why_not(1.0)) == (1.0, "")
    warm, zero = temperatures(recording)
    row = 150
    said = r.deviation([warm[i.name][row] for i, _ in r.terms]) - r.deviation([zero[i.name] for i, _ in r.terms])
    for exact, within in ((r.model, 1e-9), (model, 1e-4)):  # five digits
        assert said == pytest.approx(exact.predict(recording.table, recording.time)[row] - exact.intercept, abs=within)
    assert as_it_is(full(recording), "Z").why_not(2.0) == "it was never judged on unseen cycles"


def test_names_and_digits() -> None:
    assert [find_axis(t, {}) for t in ("z_um", "X1_um", "y", "ch5_um", "zebra")] == ["Z", "X", "Y", "", ""]
    assert [find_axis(t, {}) for t in ("Verlagerung_X_oben_um", "drift dY1", "dz_um", "\u0394X1_um")] == [
        "X",
        "Y",
        "Z",
        "X",
    ]
    assert [find_axis(t, {}) for t in ("tip_X_at_Y100_um", "x_over_z", "axis_um", "ad_z")] == ["", "X", "", "Z"]
    assert find_axis("ch5_um", {"ch5_um": "Z"}) == "Z"
    assert [in_mm(v) for v in (2.7509, -1e-7, 300.0, 0.0)] == ["0.0027509", "-0.0000000001", "0.3", "0"]
    assert [mark("t 1/C"), mark("a", ["A"]), mark("")] == ["t_1_C", "a_1", "_"]
