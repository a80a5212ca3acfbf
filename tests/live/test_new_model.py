"""A new model on a warm machine takes over the zero, and rebuilds its slow states from the journal, or is held."""

import asyncio
import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from driftmodels import ACCEPTED
from numpy.typing import NDArray
from test_loop import Given, running, until
from test_page import Told

from thermocomp.core.correction import Correction, Deviation, Limits
from thermocomp.core.model import ErrorModel
from thermocomp.core.ports import Sink
from thermocomp.core.reading import Measurement, Reading
from thermocomp.files import jsonfile
from thermocomp.live import loop, statefile
from thermocomp.live.adapters.plain import FileSink
from thermocomp.live.journal.journal import Journal, JournalLimits
from thermocomp.live.journal.journalreader import JournalReader
from thermocomp.live.journal.journalrows import ReadingRow, StartRow
from thermocomp.live.loop import Service
from thermocomp.live.page.orders import PageOrder, give
from thermocomp.live.page.snapshot import snapshot
from thermocomp.live.rebuild import rebuild
from thermocomp.live.recorder import Recorder
from thermocomp.models.training import train
from thermocomp.models.watching import find_watch
from thermocomp.recordings.stacking import stack
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.state import Compensated, CompensatorState, Status
from thermocomp.virtual.datasets import record

FEW = ("t_housing_C", "t_column_front_left_C", "t_z_bearing_C", "t_air_C", "spindle_rpm")
MORE = (*FEW, "t_motor_C")
#: the machine is switched over in the middle of its second warm-up [rows]
SWITCH, END, PACE = 1020, 2100, 20.0


@cache
def model(method: str, names: tuple[str, ...]) -> ErrorModel:
    """Return a model of the virtual machine's Z; it has seen another day than is run."""
    (day,) = record("demo")
    samples = stack([day], ["z_um"]).only(names)
    samples = samples.take(np.arange(len(samples)) % 5 == 0)
    every = np.ones(len(samples), np.bool_)
    found = train(method, samples, 0, every).model
    return replace(found, honest_error=ACCEPTED, watch=find_watch(samples, every))


@cache
def day() -> tuple[list[dict[str, float]], NDArray[np.float64]]:
    """Return readings of the inputs, and the deviation of Z [um]."""
    (found,) = record("demo", seed=3)
    rows = found.table[list(MORE)].to_dict("records")
    z = found.table["z_um"].to_numpy()
    return [{str(n): float(v) for n, v in row.items()} for row in rows], z - z[:15].mean()


@dataclass
class Machine:
    """The virtual machine, with services that run one after another in one folder."""

    folder: Path
    limits: Limits = Limits()
    corrections: list[float] = field(default_factory=list)
    words: list[str] = field(default_factory=list)
    row: int = 0
    later: int = 0  #: rows by which the readings come later

    def service(
        self, own: ErrorModel | list[ErrorModel], *, journal: bool = True, sinks: Sequence[Sink] = ()
    ) -> Service:
        clock = Told()
        clock.at = PACE * (self.row + self.later - 1)
        compensator = Compensator.of(own if isinstance(own, list) else [own], self.limits)
        found = Service(compensator, [], sinks, clock, self.folder / "state.json")
        if journal:
            path = self.folder / "live.db"
            found.recorder = Recorder(path, compensator, "off", clock, JournalLimits(), {"t_air_C": "temperature"})
        return found

    def feed(self, service: Service, end: int) -> None:
        """Let the service process the readings up to a row."""
        rows = day()[0]
        assert isinstance(service.clock, Told)
        for self.row in range(self.row, end):  # noqa: B020
            service.clock.at = PACE * (self.row + self.later)
            service.take(Reading(service.clock.now(), rows[self.row]))
            assert isinstance(service.said, Compensated)
            self.corrections.append(service.said.corrections["z_um"].offset)
            self.words.append(service.said.states["z_um"].word)
        self.row = end

    def run(self, service: Service, end: int, work: Callable[[], None] = lambda: None) -> None:
        """Run the service up to a row, then do something, and stop it."""

        async def fed() -> None:
            async with asyncio.timeout(30.0):
                while not service._begun:
                    await asyncio.sleep(0.01)
            self.feed(service, end)
            work()

        asyncio.run(running(service, fed))

    def error(self, begin: int, end: int = END) -> float:
        """Return the root mean square of the residual [um]."""
        left = day()[1][begin:end] + np.array(self.corrections[begin:end])
        return float(np.sqrt(np.mean(left**2)))


@cache
def sound(method: str, names: tuple[str, ...]) -> NDArray[np.float64]:
    """Return the corrections of a model that has run from the start [um]."""
    rows, said = day()[0], list[float]()
    compensator = Compensator.of([model(method, names)])
    state = compensator.start()
    for k in range(END):
        state, told = compensator.step(state, Reading(1.8e9 + PACE * k, rows[k]), 1.8e9 + PACE * k)
        said.append(told.corrections["z_um"].offset)
    return np.array(said)


def alarm(service: Service) -> str:
    return next(str(a) for a in snapshot(service, 1.0)["alarms"] if "no zero" in a)


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (("dynamic", MORE), ("averaged", MORE)),
        (("averaged", MORE), ("dynamic", MORE)),
        (("averaged", MORE), ("averaged", FEW)),
    ],
)
def test_a_refit_goes_on_as_if_it_had_run_from_the_start(
    first: tuple[str, tuple[str, ...]], second: tuple[str, tuple[str, ...]], tmp_path: Path
) -> None:
    machine = Machine(tmp_path)
    machine.run(machine.service(model(*first)), SWITCH)
    refit = machine.service(model(*second))
    machine.run(refit, END)
    steps = np.abs(np.diff(machine.corrections))
    assert steps.max() <= machine.limits.rate * PACE + 1e-9
    assert machine.words[SWITCH - 1] == "active"
    assert machine.words[SWITCH] == "restarting"
    settled = machine.words.index("active", SWITCH)
    assert settled - SWITCH <= abs(sound(*second)[SWITCH] - machine.corrections[SWITCH - 1]) / steps.max() + 5
    whole = sound(*second)
    assert np.abs(np.array(machine.corrections)[settled:] - whole[settled:]).max() < 0.5
    own, other = machine.error(SWITCH), float(np.sqrt(np.mean((day()[1][SWITCH:END] + whole[SWITCH:]) ** 2)))
    print(f"{first} -> {second}: RMS {own:.2f} um, {other:.2f} from the start; {settled - SWITCH} rows until active")
    assert own <= 1.5 * other
    assert refit.state.references["z_um"].time < 1.8e9 + 400.0  # the zero of the cold machine
    assert not (tmp_path / "state.json.refused").exists()


def test_while_it_catches_up_the_reason_is_stated_also_after_another_restart(tmp_path: Path) -> None:
    machine = Machine(tmp_path, Limits(rate=0.002))
    machine.run(machine.service(model("dynamic", MORE)), SWITCH)
    for _ in range(2):
        again = machine.service(model("averaged", FEW))
        machine.run(again, machine.row + 1)
        assert again.said is not None
        status = again.said.states["z_um"]
        assert (status.word, status.reason) == (
            "restarting",
            "the models are new: the correction moves to theirs",
        )


def test_a_missing_sensor_is_named_and_the_correction_held_until_a_new_zero(tmp_path: Path) -> None:
    machine = Machine(tmp_path)
    machine.run(machine.service(model("averaged", FEW)), SWITCH)
    refit = machine.service(model("averaged", MORE), sinks=[FileSink(path=tmp_path / "out.json")])

    def look() -> None:
        assert "the model of z_um uses t_motor_C, the state of 20" in alarm(refit)
        assert alarm(refit).endswith(
            "UTC has no zero for it: let the machine cool down, set its zero anew, then order 're-zero'"
        )
        for do in ("run", "hold", "shadow", "roll back"):
            assert "no zero" in give(refit, PageOrder(target="z_um", do=do))
        assert "is known" in give(refit, PageOrder(target="z_um", do="start"))
        refit.measure(Measurement(refit.clock.now(), "z_um", -day()[1][machine.row], left=False))
        assert "its model has no valid zero" in refit.events[-1].text

    machine.run(refit, SWITCH + 60, look)
    assert json.loads((tmp_path / "out.json").read_text())["corrections"]["z_um"]["state"] == "no zero"
    again = machine.service(model("averaged", MORE))

    def resolve() -> None:
        assert "t_motor_C" in alarm(again)
        assert give(again, PageOrder(target="z_um", do="rezero")) == ""
        assert "is being averaged" in alarm(again)
        machine.feed(again, SWITCH + 120)

    machine.run(again, SWITCH + 90, resolve)
    check_new_zero(machine, SWITCH, SWITCH + 90)


def check_new_zero(machine: Machine, begin: int, ordered: int) -> None:
    """Check that the correction is held until a new zero is averaged, and moves on from there."""
    known = machine.words.index("active", begin)
    assert 1 <= known - ordered <= 16  # at a turning spindle, and at rest
    assert set(machine.words[begin:known]) == {"no zero"}
    assert set(machine.corrections[begin:known]) == {machine.corrections[begin - 1]}
    # relative to a zero taken warm, the temperatures do not show the heat of the speed: it is off, and it is held
    assert set(machine.words[known:]) <= {"active", "holding"}
    assert abs(machine.corrections[known] - machine.corrections[begin - 1]) < 0.5
    assert machine.corrections[-1] != machine.corrections[known]


def test_without_a_reading_it_is_held_as_well(tmp_path: Path) -> None:
    machine = Machine(tmp_path)
    machine.run(machine.service(model("averaged", FEW)), SWITCH)
    for _ in range(3):
        machine.run(machine.service(model("averaged", MORE)), SWITCH)
    machine.run(machine.service(model("averaged", MORE)), SWITCH + 30)
    assert set(machine.words[SWITCH:]) == {"no zero"}


def test_the_zero_that_was_valid_stays_in_the_file_until_there_is_a_new_one(tmp_path: Path) -> None:
    machine, few = Machine(tmp_path), model("averaged", FEW)
    machine.run(machine.service(few), SWITCH)
    zero = statefile.read_zero(tmp_path / "state.json")
    machine.run(machine.service(model("averaged", MORE)), SWITCH + 60)
    kept = statefile.read_zero(tmp_path / "state.json")
    assert zero is not None
    assert kept is not None
    assert kept.zero.inputs == zero.zero.inputs
    assert kept.zero.begun == zero.zero.begun == 1.8e9
    machine.run(machine.service(few), SWITCH + 120)
    assert machine.words[-1] == "active"
    assert machine.corrections[-1] == pytest.approx(sound("averaged", FEW)[SWITCH + 119], abs=0.5)


def spoil_journal(folder: Path, how: str) -> None:
    (path,) = folder.glob("live.0*.db")
    if how == "removed":
        path.unlink()
    elif how == "no journal":
        path.write_text("something else entirely, not a database at all" * 100)
    else:
        import sqlite3

        with sqlite3.connect(path) as connection:
            if how == "begins late":
                connection.execute("DELETE FROM rows WHERE kind = 'reading' AND time < ?", (1.8e9 + 10_000.0,))
            elif how == "gap":
                connection.execute(
                    "DELETE FROM rows WHERE kind = 'reading' AND time BETWEEN ? AND ?", (1.8e9 + 9e3, 1.8e9 + 11e3)
                )
            elif how == "ends early":
                connection.execute(
                    "DELETE FROM rows WHERE kind = 'reading' AND time > ?", (1.8e9 + PACE * SWITCH - 2000.0,)
                )
            elif how == "altered":
                connection.execute("UPDATE rows SET content = '[1]' WHERE kind = 'reading' AND seq = 9")
        connection.close()


@pytest.mark.parametrize(
    ("how", "reason"),
    [
        ("removed", "no usable readings from 2027-01-15 08:00 to 2027-01-15 13:39 UTC"),
        ("no journal", "no usable readings from 2027-01-15 08:00 to 2027-01-15 13:39 UTC"),
        ("begins late", "no usable readings from 2027-01-15 08:00 to 2027-01-15 10:46 UTC"),
        ("gap", "no usable readings from 2027-01-15 10:29 to 2027-01-15 11:03 UTC"),
        ("ends early", "no usable readings from 2027-01-15 13:06 to 2027-01-15 13:39 UTC"),
        ("altered", "the journal cannot be used: "),
        ("off", "no journal is configured"),
    ],
)
def test_without_the_journal_it_is_held_and_the_gap_named(how: str, reason: str, tmp_path: Path) -> None:
    machine = Machine(tmp_path)
    machine.run(machine.service(model("dynamic", MORE), journal=how != "off"), SWITCH)
    if how != "off":
        spoil_journal(tmp_path, how)
    refit = machine.service(model("averaged", MORE), journal=how != "off")

    def resolve() -> None:
        assert reason in alarm(refit)
        assert give(refit, PageOrder(target="z_um", do="rezero")) == ""
        machine.feed(refit, SWITCH + 70)

    machine.run(refit, SWITCH + 30, resolve)
    check_new_zero(machine, SWITCH, SWITCH + 30)


def test_a_short_gap_of_the_journal_is_bridged(tmp_path: Path) -> None:
    machine = Machine(tmp_path)
    machine.run(machine.service(model("dynamic", MORE)), 500)
    machine.row += 60  # the service is down for 20 minutes
    machine.corrections += [machine.corrections[-1]] * 60
    machine.words += ["down"] * 60
    machine.run(machine.service(model("dynamic", MORE)), SWITCH)
    machine.run(machine.service(model("averaged", MORE)), END)
    assert machine.words[-1] == "active"
    assert machine.error(SWITCH + 100) <= 1.5 * float(
        np.sqrt(np.mean((day()[1][SWITCH + 100 : END] + sound("averaged", MORE)[SWITCH + 100 :]) ** 2))
    )


def test_a_clock_that_was_set_back_is_no_known_time(tmp_path: Path) -> None:
    machine = Machine(tmp_path)
    machine.run(machine.service(model("dynamic", MORE)), 500)
    machine.row -= 100
    machine.run(machine.service(model("dynamic", MORE)), SWITCH)
    refit = machine.service(model("averaged", MORE))
    machine.run(refit, SWITCH + 10, lambda: None)
    assert "the clock was set back" in refit.state.orders["z_um"].reason


def rewritten(path: Path, change: Callable[[dict[str, Any]], None]) -> None:
    """Change the entry of a state file, with a checksum that is right."""
    body = json.loads(path.read_text())["models"]
    change(body[0])
    path.write_text(jsonfile.pack(statefile.KIND, body))


def test_after_a_day_the_machine_is_cold(tmp_path: Path) -> None:
    machine = Machine(tmp_path)
    machine.run(machine.service(model("dynamic", MORE)), SWITCH)
    left = machine.corrections[-1]
    rewritten(tmp_path / "state.json", lambda entry: entry.update(written="2026-01-02T03:04:05+00:00", boot=""))
    refit = machine.service(model("averaged", MORE))
    assert refit.events[0].text.startswith("cold start: the state of 2026-01-02 03:04 UTC belongs to other models")
    assert refit.state.corrections["z_um"].offset == left
    machine.run(refit, SWITCH + 100)
    assert refit.state.references["z_um"].time > 1.8e9 + PACE * SWITCH
    assert "no zero" not in machine.words


def test_a_clock_set_back_since_then_is_a_cold_start(tmp_path: Path) -> None:
    machine = Machine(tmp_path)
    machine.run(machine.service(model("dynamic", MORE)), 600)
    rewritten(tmp_path / "state.json", lambda entry: entry.update(written="2126-01-02T03:04:05+00:00", boot=""))
    refit = machine.service(model("averaged", MORE))
    assert refit.events[0].text.startswith("cold start: the state of 2126-01-02")
    assert refit.state.away is not None
    assert math.isnan(refit.state.away)


def test_an_outage_of_hours_counts_as_with_the_same_models(tmp_path: Path) -> None:
    machine = Machine(tmp_path)
    machine.run(machine.service(model("dynamic", MORE)), 1300)
    written = datetime.now(UTC) - timedelta(hours=3)
    rewritten(tmp_path / "state.json", lambda entry: entry.update(written=written.isoformat(), boot=""))
    machine.row, machine.corrections = 1300 + 540, machine.corrections + [machine.corrections[-1]] * 540
    refit = machine.service(model("averaged", MORE))
    machine.run(refit, 1841)
    assert refit.said is not None
    assert refit.said.states["z_um"].reason.startswith("compensation did not run for 108")
    machine.run(machine.service(model("averaged", MORE)), END)
    assert machine.corrections[-1] == pytest.approx(sound("averaged", MORE)[END - 1], abs=1.0)


@pytest.mark.parametrize("spoiled", ["cut", "zero", "earlier version"])
def test_an_unusable_zero_is_a_cold_start_as_before(spoiled: str, tmp_path: Path) -> None:
    machine, path = Machine(tmp_path), tmp_path / "state.json"
    machine.run(machine.service(model("dynamic", MORE)), 300)
    if spoiled == "cut":
        path.write_text(path.read_text()[:-500])
    elif spoiled == "zero":
        rewritten(path, lambda entry: entry["zero"].update(begun="nan"))
    else:
        rewritten(path, lambda entry: entry.pop("zero"))
    refit = machine.service(model("averaged", MORE), sinks=[FileSink(path=tmp_path / "out.json")])
    assert refit.events[0].text.startswith("cold start: ")
    machine.run(refit, 330)
    assert machine.words[-1] == "unknown"
    assert not (tmp_path / "out.json").exists()


def test_orders_are_kept_but_not_those_of_the_other_model(tmp_path: Path) -> None:
    machine = Machine(tmp_path)
    refused = replace(model("dynamic", MORE), honest_error=replace(ACCEPTED, verdict="refused"))
    first = machine.service([replace(model("dynamic", FEW), target="y_um"), model("dynamic", MORE)])

    def orders() -> None:
        first.order("z_um", Status("holding", "by M. Weber"))

    machine.run(first, 300, orders)
    second = machine.service([replace(model("averaged", FEW), target="y_um"), model("averaged", MORE)])
    assert second.state.orders == {"z_um": Status("holding", "by M. Weber")}
    third = machine.service([replace(refused, target="y_um"), replace(refused, target="x_um"), model("averaged", MORE)])
    assert {t: o.word for t, o in third.state.orders.items()} == {
        "z_um": "holding",
        "y_um": "shadow",
        "x_um": "shadow",
    }


def test_a_zero_taken_warm_in_shadow_is_not_used_later(tmp_path: Path) -> None:
    machine, refit = Machine(tmp_path), model("averaged", MORE)
    machine.run(machine.service(model("averaged", FEW)), SWITCH)
    trial = machine.service(refit)
    trial.watch_only("z_um")
    machine.run(trial, SWITCH + 60)
    assert machine.words[-1] == "shadow"
    assert machine.corrections[-1] == 0.0
    machine.run(machine.service(refit), SWITCH + 90)
    machine.run(machine.service(refit), SWITCH + 90)  # and another restart without a reading
    later = machine.service(refit)
    machine.run(later, SWITCH + 120)
    assert set(machine.words[SWITCH + 60 :]) == {"no zero"}
    assert alarm(later).startswith("z_um: no zero: these models took their zero warm: let the machine cool down")


def test_no_order_gets_past_a_missing_zero(tmp_path: Path) -> None:
    machine = Machine(tmp_path)
    first = machine.service(model("averaged", FEW))
    machine.run(first, SWITCH, lambda: first.order("z_um", Status("shadow", "by hand, on the page")))
    refit = machine.service(model("averaged", MORE))

    def run() -> None:
        assert machine.words[-1] == "shadow"
        assert give(refit, PageOrder(target="z_um", do="run")) == ""
        assert refit.state.orders["z_um"].word == "no zero"
        assert "z_um no zero: the model of z_um uses t_motor_C" in refit.events[-1].text

    machine.run(refit, SWITCH + 30, run)


def test_a_new_target_waits_for_its_start_and_then_for_its_zero(tmp_path: Path) -> None:
    machine = Machine(tmp_path)
    machine.run(machine.service(model("averaged", FEW)), SWITCH)
    both = [model("averaged", FEW), replace(model("averaged", MORE), target="y_um")]
    refit = machine.service(both, sinks=[FileSink(path=tmp_path / "out.json")])

    def start() -> None:
        assert {t: o.word for t, o in refit.state.orders.items()} == {"z_um": "no zero", "y_um": "unknown"}
        assert give(refit, PageOrder(target="y_um", do="start")) == ""
        assert refit.state.orders["y_um"].word == "no zero"

    machine.run(refit, SWITCH + 30, start)


def test_the_shift_of_a_re_zero_is_taken_over(tmp_path: Path) -> None:
    machine = Machine(tmp_path)
    first = machine.service(model("dynamic", MORE))

    def rezero() -> None:
        first.rezero("z_um", "a new part")
        machine.feed(first, SWITCH)

    machine.run(first, 500, rezero)
    reference = first.state.references["z_um"]
    assert abs(reference.shift.offset) < 3.0
    first.state = first.state._replace(
        references={"z_um": reference._replace(shift=Deviation(9.0))}, corrections={"z_um": Correction(30.0)}
    )
    first.keeper.save(first.state)
    refit = machine.service(model("averaged", MORE))
    machine.run(refit, END)
    assert refit.state.references["z_um"].shift == Deviation(9.0)
    assert machine.corrections[-1] == pytest.approx(sound("averaged", MORE)[END - 1] + 9.0, abs=0.5)


def test_no_reading_is_taken_during_the_rebuild(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    machine, source, seen = Machine(tmp_path), Given(), list[tuple[int, int]]()
    machine.run(machine.service(model("dynamic", MORE)), SWITCH)
    refit = machine.service(model("averaged", MORE))
    refit.sources = [source]

    def slow(*given: Any) -> CompensatorState | str:
        time.sleep(0.5)
        seen.append((refit.counts["readings"], source.connects))
        return rebuild(*given)

    async def work() -> None:
        assert isinstance(refit.clock, Told)
        refit.clock.at += PACE
        source.queue.put_nowait(Reading(refit.clock.now(), day()[0][SWITCH]))
        await until(lambda: refit.counts["readings"] == 1)

    monkeypatch.setattr(loop, "rebuild", slow)
    asyncio.run(running(refit, work))
    assert seen == [(0, 0)]
    assert refit.said is not None
    assert refit.said.states["z_um"].word == "restarting"


def test_without_any_reading_since_the_zero_nothing_is_known(tmp_path: Path) -> None:
    machine = Machine(tmp_path)
    machine.run(machine.service(model("dynamic", MORE)), 60)  # less than the gap that is bridged
    spoil_journal(tmp_path, "removed")
    refit = machine.service(model("averaged", MORE))
    machine.run(refit, 61)
    assert "no usable readings from 2027-01-15 08:00 to 2027-01-15 08:19 UTC" in refit.state.orders["z_um"].reason


CHILD = """
import sys, time
from pathlib import Path
sys.path[:0] = sys.argv[2:]
from thermocomp.live import loop
from test_new_model import MORE, SWITCH, Machine, model
def slow(*given):
    print("rebuilding", flush=True)
    time.sleep(60.0)
loop.rebuild = slow
machine = Machine(Path(sys.argv[1]), row=SWITCH)
machine.run(machine.service(model("averaged", MORE)), SWITCH + 1)
"""


def test_a_kill_during_the_rebuild_leaves_the_state(tmp_path: Path) -> None:
    machine = Machine(tmp_path)
    machine.run(machine.service(model("dynamic", MORE)), SWITCH)
    before = (tmp_path / "state.json").read_bytes()
    child = subprocess.Popen(
        [sys.executable, "-c", CHILD, str(tmp_path), *sys.path], stdout=subprocess.PIPE, text=True, env=dict(os.environ)
    )
    assert child.stdout is not None
    assert child.stdout.readline() == "rebuilding\n"
    child.send_signal(signal.SIGKILL)
    child.communicate()
    assert (tmp_path / "state.json").read_bytes() == before
    machine.run(machine.service(model("averaged", MORE)), SWITCH + 200)
    assert machine.words[-1] == "active"
    assert machine.corrections[-1] == pytest.approx(sound("averaged", MORE)[SWITCH + 199], abs=0.5)


def write_journal(path: Path, own: Compensator, rows: Iterable[ReadingRow]) -> None:
    channels = Recorder(path, own, "off", Told(), JournalLimits()).journal._described.channels
    journal = Journal.open(path, JournalLimits(waiting_bytes=2**30), StartRow(1.8e9, (), channels))
    for row in rows:
        journal.add(row)
    journal.close()


def test_some_of_the_readings_give_the_same_state_as_all(tmp_path: Path) -> None:
    """A reading each second; the demo's rows, of 20 s each, with the noise of the sensors."""
    own, rng, rows = Compensator.of([model("averaged", MORE)]), np.random.default_rng(0), day()[0]
    machine = Machine(tmp_path)
    machine.run(machine.service(model("averaged", MORE)), 360)
    others = statefile.read_zero(tmp_path / "state.json")
    assert others is not None

    def noisy(k: int) -> dict[str, float]:
        return {n: v + 0.02 * rng.standard_normal() * (n != "spindle_rpm") for n, v in rows[k].items()}

    seconds = [ReadingRow(1.8e9 + k, noisy(k // 20)) for k in range(7181)]
    write_journal(tmp_path / "each.db", own, seconds)
    journal = JournalReader(tmp_path / "each.db")
    assert [r.time - 1.8e9 for r in journal.readings(1.8e9 + 7000.5, lambda _: 100.0)] == [7001, 7101, 7180]
    assert [r.time - 1.8e9 for r in journal.readings(1.8e9 + 7177, lambda _: 1.0)] == [7177, 7178, 7179, 7180]
    begin = time.process_time()
    found = rebuild(own, others, tmp_path / "each.db")
    print(f"two hours of readings each second: {time.process_time() - begin:.2f} s")
    assert isinstance(found, CompensatorState)
    state = own.start()
    for row in seconds:
        state, _ = own.step(state, Reading(row.time, row.values), row.time)
    print(f"{found.raw['z_um'].offset:.3f} um, {state.raw['z_um'].offset:.3f} from all readings")
    assert abs(state.raw["z_um"].offset) > 5.0
    assert found.raw["z_um"].offset == pytest.approx(state.raw["z_um"].offset, abs=0.1)


def test_after_a_new_zero_on_the_cold_machine_the_model_is_sound(tmp_path: Path) -> None:
    """The refit starts warm, is held overnight, and is re-zeroed on the cold machine; then the next day goes by."""
    machine = Machine(tmp_path)
    machine.run(machine.service(model("averaged", FEW)), SWITCH)
    refit, held = machine.service(model("averaged", MORE)), machine.corrections[SWITCH - 1]

    def work() -> None:
        machine.row, machine.later = 0, 6000
        assert give(refit, PageOrder(target="z_um", do="rezero")) == ""
        machine.feed(refit, END)

    machine.run(refit, SWITCH + 10, work)
    found = np.array(machine.corrections[-END:]) - held
    assert np.abs(found - sound("averaged", MORE)).max() < 0.5
    assert refit.state.orders == {}
    stored = statefile.read_zero(tmp_path / "state.json")
    assert stored is not None
    assert stored.zero.begun == 1.8e9 + PACE * 6000
    assert "t_motor_C" in stored.zero.inputs
