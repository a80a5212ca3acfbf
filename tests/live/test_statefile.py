"""The state of a compensator comes back as it was, or not at all."""

import json
import math
import random
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from driftmodels import ACCEPTED, ROOM, SPEED, lags, static

from thermocomp.core import provenance
from thermocomp.core.correction import Limits
from thermocomp.core.exceptions import InputError, ModelFileError
from thermocomp.core.reading import Reading
from thermocomp.core.watch import Watch, Watched
from thermocomp.core.zero import Zeroing
from thermocomp.files import jsonfile
from thermocomp.files.typed import encode
from thermocomp.live import statefile
from thermocomp.models.training import train
from thermocomp.models.watching import find_watch
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack
from thermocomp.runtime.adaptation import Probing
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.feed import FeedState
from thermocomp.runtime.orders import order, rezero
from thermocomp.runtime.state import Compensated, CompensatorState, Status, resume
from thermocomp.virtual.datasets import record

NOW = datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC)
FEW = ("t_housing_C", "t_motor_C", "t_column_front_left_C", "t_z_bearing_C", "spindle_rpm")


@pytest.fixture(scope="module")
def samples() -> Samples:
    found = stack(record("demo"), ["x1_um", "z_um"])
    return found.take(np.arange(len(found)) % 9 == 0).only(FEW)


@pytest.fixture(scope="module")
def machine(samples: Samples) -> Compensator:
    everything = np.ones(len(samples), dtype=np.bool_)
    watch = find_watch(samples, everything)
    models = [train("averaged", samples, k, everything).model for k in range(2)]
    return Compensator.of([replace(m, watch=watch, honest_error=ACCEPTED) for m in models], Limits())


def run(machine: Compensator, samples: Samples, rows: int) -> CompensatorState:
    names, state = [c.name for c in samples.inputs], machine.start()
    for k in range(rows):
        values = dict(zip(names, samples.values[k].tolist(), strict=True))
        if k > 150:
            values["t_motor_C"] = math.nan
        probings = {"z_um": Probing(5.0)} if k == 100 else None
        state, _ = machine.step(state, Reading(float(samples.time[k]), values), float(samples.time[k]), probings)
    return state


def same(one: object, other: object) -> bool:
    one, other = ({"state": plain(encode(x))} for x in (one, other))
    return json.dumps(one) == json.dumps(other)


def plain(value: Any) -> Any:
    """Return JSON in which an array of no dimension is its number."""
    if isinstance(value, dict):
        return value["values"][0] if value.get("shape") == [] else {k: plain(v) for k, v in value.items()}
    return [plain(v) for v in value] if isinstance(value, list) else value


@pytest.mark.parametrize("rows", [0, 1, 2, 5, 90, 101, 200])
def test_it_comes_back_bit_by_bit(machine: Compensator, samples: Samples, rows: int, tmp_path: Path) -> None:
    state = run(machine, samples, rows)
    state = order(machine, state, "x1_um", Status("holding", "by M. Weber"))
    if rows > 5:
        state = rezero(machine, state, "x1_um", 5.0, "homing")
    statefile.write(state, machine, tmp_path / "state.json", NOW)
    saved = statefile.read(tmp_path / "state.json", machine)
    assert saved.written == NOW
    assert same(saved.state, state)
    statefile.write(machine.start(), machine, tmp_path / "state.json", NOW)  # over the one before
    assert same(statefile.read(tmp_path / "state.json", machine).state, machine.start())


def test_other_families_too(tmp_path: Path) -> None:
    models = [replace(m, honest_error=ACCEPTED) for m in (lags(room=True), static("y_um"))]
    machine = Compensator.of([replace(m, zeroing=Zeroing(60.0, 60.0)) for m in models])
    state = machine.start()
    for k in range(5):
        reading = Reading(30.0 * k, {"spindle_rpm": 1000.0, "t3_C": 20.0})
        state, _ = machine.step(state, reading, reading.time)
        statefile.write(state, machine, tmp_path / "state.json", NOW)
        assert same(statefile.read(tmp_path / "state.json", machine).state, state)


# -- a restart while the zero is averaged ------------------------------------------------------------------------------

AVERAGING = Zeroing(300.0, 10.0, "spindle_rpm")
SENSOR = Watched(input=0, weights=(0.0, 0.5, 0.0, 0.25, 1.0), off=3.0, jump=2.0, moved=3.0, still=7200.0, unseen=0.2)
WATCH = Watch(
    inputs=(ROOM, replace(ROOM, name="t4_C"), SPEED),
    zeroing=AVERAGING,
    time_constants=(600.0,),
    top_speed=6000.0,
    states=((2, 1.5, 1200.0, 600.0),),
    sensors=(SENSOR, replace(SENSOR, input=1, weights=(0.5, 0.0, 0.25, 0.0, 1.0))),
)
#: room temperature each 30 s, with a wrong one
BEGINS = (20.0, 20.3, 24.9, 20.1, 19.8, 20.2, 20.4, 19.9, 20.0, 20.1, 20.3, 20.6, 20.8)


def averaging() -> Compensator:
    """Return the machine of `states/version_1.json`."""
    models, honest = [lags(room=True), static("y_um")], replace(ACCEPTED, rules=provenance.RULES)
    return Compensator.of([replace(m, zeroing=AVERAGING, watch=WATCH, honest_error=honest) for m in models])


def go_on(machine: Compensator, state: CompensatorState, begin: int) -> tuple[CompensatorState, list[Compensated]]:
    """Pass the readings from one on; the spindle starts at the last but one."""
    done = []
    for k, t in enumerate(BEGINS[begin:], begin):
        values = {"t3_C": t, "t4_C": t - 0.25, "spindle_rpm": 3000.0 if k >= len(BEGINS) - 2 else 0.0}
        state, said = machine.step(state, Reading(30.0 * k, values), 30.0 * k)
        done.append(said)
    return state, done


def shown(state: CompensatorState) -> str:
    return json.dumps(plain(encode((state.models, state.averaged, state.watches))))


@pytest.mark.parametrize("rows", range(1, len(BEGINS)))
def test_a_restart_while_the_zero_is_averaged_changes_nothing(rows: int) -> None:
    machine = averaging()
    whole, _ = go_on(machine, machine.start(), 0)
    assert np.isfinite(whole.models[0].reference).all()
    state = machine.start()
    for k, t in enumerate(BEGINS[:rows]):
        values = {"t3_C": t, "t4_C": t - 0.25, "spindle_rpm": 3000.0 if k >= len(BEGINS) - 2 else 0.0}
        state, _ = machine.step(state, Reading(30.0 * k, values), 30.0 * k)
    saved = statefile.loads(statefile.dumps(state, machine, NOW), machine).state
    assert same(saved, state)
    again = resume(saved, machine.start(), 0.0, tick=30.0 * (rows - 1))
    assert shown(go_on(machine, again, rows)[0]) == shown(whole)


@pytest.fixture
def old_rules(monkeypatch: pytest.MonkeyPatch) -> None:
    """Judge by the rules of the version that wrote `states/version_1.json`."""
    monkeypatch.setattr(provenance, "RULES", 1)


def old_file() -> dict[str, Any]:
    """Return a file of version 1, written while the zero was averaged, by a version that kept the readings."""
    content: dict[str, Any] = json.loads((Path(__file__).parent / "states/version_1.json").read_text())
    return content


@pytest.mark.usefixtures("old_rules")
def test_a_file_with_the_readings_of_the_zero_goes_on_as_without_a_restart() -> None:
    machine, content = averaging(), old_file()
    begun = [*content["models"][0]["state"]["gathered"], content["models"][0]["state"]["watches"][0]["gathered"]]
    assert [len(g["times"]) for g in begun] == [5, 0, 5]
    found = statefile.loads(json.dumps(content), machine).state
    state, done = machine.start(), list[Compensated]()
    whole, without = go_on(machine, state, 0)
    state, done = go_on(machine, found, 5)
    references = {t: r._replace(why=whole.references[t].why) for t, r in state.references.items()}  # worded differently
    assert np.isnan(state.zeroed)
    assert found.feed == FeedState()  # a file from before it existed
    assert same(state._replace(references=references, zeroed=whole.zeroed, feed=whole.feed), whole)
    assert [d.corrections for d in done] == [d.corrections for d in without[5:]]
    assert done[-1].corrections["z_um"].offset != 0.0


@pytest.mark.usefixtures("old_rules")
@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("times", [0.0, 30.0, "nan", 90.0, 120.0]),
        ("times", [0.0, 30.0, 20.0, 90.0, 120.0]),
        ("times", [0.0, 30.0]),
        ("values", []),
        ("values", [{"shape": [4], "values": [0.0, 20.0, 1.0, 1.0]}] * 5),
        ("values", [{"shape": [2], "values": [0.0, "nan"]}] * 5),
        ("resting", 1),
    ],
)
@pytest.mark.parametrize("watch", [False, True])
def test_invalid_readings_in_a_file_of_version_1_are_refused_by_name(name: str, value: object, watch: bool) -> None:
    content = old_file()
    stored = content["models"][0]["state"]
    (stored["watches"][0]["gathered"] if watch else stored["gathered"][0])[name] = value
    text = jsonfile.pack(replace(statefile.KIND, version=1), content["models"])
    with pytest.raises(ModelFileError, match=r"state\.json: not a valid state of these models: .*(gathered|averaged)"):
        statefile.loads(text, averaging(), "state.json")


def test_a_file_of_before_probings_were_told_apart(machine: Compensator, samples: Samples) -> None:
    state = run(machine, samples, 110)
    assert set(state.probed) == {"z_um"}
    assert state.learned["z_um"].most < math.inf
    stored = encode(state)
    del stored["probed"]
    for name in ("refused_since", "most", "usual"):
        del stored["learned"]["z_um"][name]
    entry = {"written": NOW.isoformat(), "models": statefile.fingerprint(machine), "state": stored}
    found = statefile.loads(jsonfile.pack(statefile.KIND, [entry]), machine).state
    assert found.probed == {}
    assert same(found._replace(probed=state.probed, learned=state.learned), state)
    assert found.learned["z_um"].mean == pytest.approx(state.learned["z_um"].mean)


def test_the_state_of_other_models_is_refused(machine: Compensator, samples: Samples) -> None:
    text = statefile.dumps(run(machine, samples, 5), machine, NOW)
    other = Compensator.of([replace(m, intercept=1e-9) for m in machine.models])
    with pytest.raises(ModelFileError, match=r"here\.json: this state belongs to other models"):
        statefile.loads(text, other, "here.json")
    with pytest.raises(InputError, match="time zone"):
        statefile.dumps(machine.start(), machine, datetime(2026, 1, 1))


def places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    found = [path]
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        found += places(inner, (*path, key))
    return found


BAD: tuple[object, ...] = (
    None,
    "x",
    -1,
    True,
    1e300,
    [],
    {},
    "nan",
    "inf",
    "1.0",
    [[1.0]],
    {"shape": [2], "values": [1.0]},
)


def damaged(content: dict[str, Any], rng: random.Random) -> str:
    """Return a state in which one place is something else, with a checksum that is right."""
    body = json.loads(json.dumps(content["models"]))
    path = rng.choice([p for p in places(body) if len(p) > 1])
    inner = body
    for key in path[:-1]:
        inner = inner[key]
    if rng.random() < 0.2:
        del inner[path[-1]]
    else:
        inner[path[-1]] = rng.choice(BAD)
    return jsonfile.pack(statefile.KIND, body)


def attempt(read: Callable[[], statefile.Saved]) -> tuple[CompensatorState | None, str]:
    try:
        return read().state, ""
    except ModelFileError as e:
        return None, str(e)


@pytest.mark.parametrize("count", [300, pytest.param(10_000, marks=pytest.mark.long)])
def test_what_is_damaged_with_a_right_checksum_never_moves_an_axis(
    machine: Compensator, samples: Samples, count: int
) -> None:
    """It is refused by name, or what it says is within all limits, finite, and lets the machine run."""
    state, rng, refused = run(machine, samples, 170), random.Random(1), 0
    content = json.loads(statefile.dumps(state, machine, NOW))
    names = [c.name for c in samples.inputs]
    readings = [Reading(1e9 + 10.0 * k, dict(zip(names, samples.values[170].tolist(), strict=True))) for k in range(3)]
    for _ in range(count):
        text = damaged(content, rng)
        found, error = attempt(partial(statefile.loads, text, machine, "state.json"))
        if found is None:
            assert error.startswith("state.json: ")
            refused += 1
            continue
        before = found.corrections
        for k, reading in enumerate(readings):
            found, said = machine.step(found, reading, reading.time, tick=reading.time)
            for target, correction in said.corrections.items():
                assert abs(correction.offset) <= machine.limits.magnitude * (1 + 1e-9)
                moved = abs(correction.offset - before[target].offset)
                assert moved <= machine.limits.rate * (60.0 if k == 0 else 10.0) + 1e-9
            before = said.corrections
    assert refused > 0.5 * count


@pytest.mark.parametrize("count", [300, pytest.param(10_000, marks=pytest.mark.long)])
def test_what_is_damaged_by_a_byte_is_refused_by_name(
    machine: Compensator, samples: Samples, count: int, tmp_path: Path
) -> None:
    state, rng = run(machine, samples, 170), random.Random(2)
    raw, path, unharmed = statefile.dumps(state, machine, NOW).encode(), tmp_path / "state.json", 0
    for _ in range(count):
        data = bytearray(raw)
        what = rng.random()
        if what < 0.3:
            data = data[: rng.randrange(len(data))]
        elif what < 0.5:
            place = rng.randrange(len(data))
            data[place:place] = bytes(rng.randrange(256) for _ in range(rng.randrange(1, 5)))
        else:
            data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        path.write_bytes(bytes(data))
        found, error = attempt(partial(statefile.read, path, machine))
        assert "state.json" in error if found is None else same(found, state)  # a blank, or a digit beyond the last bit
        unharmed += found is not None
    assert unharmed < 0.02 * count


def test_only_the_owner_may_read_it(machine: Compensator, tmp_path: Path) -> None:
    path = tmp_path / "state.json"
    path.write_text("older")
    path.chmod(0o644)
    statefile.write(machine.start(), machine, path, datetime.now(UTC))
    assert path.stat().st_mode & 0o777 == 0o600
