"""The shipped numbers against the full models they come from."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from finite_elements.__main__ import FOLDER
from finite_elements.assembly import Assembly, Film, FullModel, lump
from finite_elements.machines import MODELS, centre, tool
from finite_elements.materials import material
from finite_elements.reduction import basis, project, write
from finite_elements.screw import Screw
from finite_elements.transient import Stepper
from thermocomp.core.exceptions import InputError
from thermocomp.virtual.heat import HeatSources
from thermocomp.virtual.machine import FeedDrive
from thermocomp.virtual.statespace import REFERENCE_TEMPERATURE, ReducedModel

FloatArray = NDArray[np.float64]
HOUR = 3600.0
#: Chen's test at its highest speed (C-14), its axes moving: 6 h of running, 10 h of stop
RUN, STOP = FeedDrive(2600.0, (600.0, 1000.0, 600.0)), FeedDrive()
#: steps [s] after each change of the drive, and how many of them; then minutes
PLAN = ((1.0, 30), (5.0, 54))


def warming(time: float) -> FloatArray:
    """Air of a day: its temperature, layers and side wander."""
    return np.array([22 + 1.8 * np.sin(time / 13751), 0.5 + 0.2 * np.sin(time / 9000), 0.4 * np.sin(time / 5000)])


def given(model: FullModel | ReducedModel, drive: FeedDrive) -> FloatArray:
    """Heat of a drive [W], with the friction of warm bearings and a chiller that runs evenly."""
    source = HeatSources()
    heat = source.given(drive)
    if drive.speed:
        ratio = drive.speed / source.top_speed
        heat["front_bearing"] = source.front.heat(ratio, 45.0, 8.0)
        heat["rear_bearing"] = source.rear.heat(ratio, 45.0, 8.0)
    heat["coolant"] -= 450.0 if drive.speed else 200.0
    return np.array([heat.get(name, 0.0) for name in model.inputs])


def shares(drive: FeedDrive) -> dict[str, float]:
    source = HeatSources()
    feeds = {f"feed_{a}": source.moving(f) for a, f in zip("xyz", drive.feed, strict=True)}
    return {"rotation": source.rotation(drive.speed), "flow": 1.0} | feeds


def matrices(model: FullModel | ReducedModel, theta: dict[str, float]) -> tuple[csr_matrix, csr_matrix, FloatArray]:
    """Capacity, conduction with films, and what the air brings."""
    if isinstance(model, FullModel):
        return model.capacity, model.stiffness(theta), model.air_heat(theta)
    values = [theta[name] for name in model.theta]
    return csr_matrix(np.eye(len(model.one))), csr_matrix(model.stiffness(values)), model.to_air(values)


def whole_test(model: FullModel | ReducedModel) -> tuple[FloatArray, float]:
    """Run the test; return the fields after all steps, and the share of the machine's heat that is not accounted for.

    Both models are run by the same method with the same steps, so that what differs is the reduction alone.
    """
    field = REFERENCE_TEMPERATURE * model.one
    fields = [field]
    time, came, put = 0.0, 0.0, 0.0
    for drive, hours in ((RUN, 6.0), (STOP, 10.0)):
        capacity, conduction, air = matrices(model, shares(drive))
        heat = model.heat @ given(model, drive)

        def load(t: float, heat: FloatArray = heat, air: FloatArray = air) -> FloatArray:
            return np.asarray(heat + air @ warming(t))

        for dt, count in (*PLAN, (60.0, round(60 * hours) - 5)):
            stepper = Stepper(capacity, conduction, dt)
            for _ in range(count):
                step = stepper.advance(field, load, time)
                # A field of 1 degC in air of 1 degC is at rest: the first column of the air is where heat leaves.
                came += dt * float(model.one @ step.heat - air[:, 0] @ step.mean)
                put += dt * float(np.abs(given(model, drive)).sum())
                field, time = step.temperatures, time + dt
                fields.append(field)
    stored = float(model.one @ (capacity @ (fields[-1] - fields[0])))
    return np.array(fields), (stored - came) / put


def answers(model: FullModel | ReducedModel, fields: FloatArray) -> FloatArray:
    if isinstance(model, FullModel):
        places, observables = (np.array(list(rows.values())) for rows in (model.places, model.observables))
    else:
        places, observables = model.temperature, model.observable
    return np.hstack([fields @ places.T, (fields - REFERENCE_TEMPERATURE * model.one) @ observables.T])


@pytest.fixture(scope="module")
def full() -> FullModel:
    return centre()


@pytest.fixture(scope="module")
def shipped() -> ReducedModel:
    return ReducedModel.load("centre")


def small(cells: int = 40) -> FullModel:
    """A screw in air with a lump at its end."""
    screw = Screw(diameter=0.04, length=1.0, nut=(0.2, 0.8), cells=cells).part(
        "screw", material("steel"), (0, 300, 600)
    )
    parts = Assembly([screw, lump("bearing", 8000.0)])
    rows = {p: parts.observable("screw", p) for p in ("at@0", "at@300", "at@600")}
    return parts.join(
        [Film("screw.air", 8.0), Film("bearing.air", 2.0), Film("screw.air", 30.0, theta="feed")],
        [],
        {"nut": "screw.middle", "motor": "bearing"},
        {"screw": "screw.middle", "bearing": "bearing"},
        rows,
        ("feed",),
    )


def test_the_basis_is_orthonormal_in_the_capacity_and_holds_the_constant_field() -> None:
    model = small()
    v = basis(model, 12, [{"nut": 10.0}, {"motor": 5.0}], [{}, {"feed": 1.0}])
    assert np.abs(v.T @ (model.capacity @ v) - np.eye(12)).max() < 1e-12
    assert v @ (v.T @ (model.capacity @ model.one)) == pytest.approx(model.one, abs=1e-10)
    reduced = project(model, v)
    assert reduced.temperature @ reduced.one == pytest.approx(np.ones(2))
    assert reduced.stiffness([0.3]) @ reduced.one == pytest.approx(reduced.to_air([0.3])[:, 0])


def test_observables_of_squared_temperatures_are_those_of_the_mesh() -> None:
    model = small()
    v = basis(model, 12, [{"nut": 10.0}, {"motor": 5.0}])
    reduced = project(model, v, ("at@300", "at@600"))
    assert reduced.squared == ("at@300", "at@600")
    assert reduced.squares is not None
    state = np.random.default_rng(1).normal(size=12)
    for name, square in zip(reduced.squared, reduced.squares, strict=True):
        assert state @ square @ state == pytest.approx(model.observables[name] @ (v @ state) ** 2)
    assert project(model, v).squares is None is project(model, v).squared


def test_a_reduced_screw_answers_like_the_full_one_the_better_the_larger() -> None:
    model = small()
    times = np.array([30.0, 300.0, 3000.0, 30000.0])
    errors = []
    for size in (4, 8, 16):
        reduced = project(model, basis(model, size, [{"nut": 10.0}, {"motor": 5.0}], [{}, {"feed": 1.0}]))
        worst = 0.0
        for feed in (0.0, 0.5):
            exact = step_answers(project(model, complete(model)), (feed,), times)
            worst = max(
                worst, float((np.abs(step_answers(reduced, (feed,), times) - exact) / np.abs(exact).max()).max())
            )
        errors.append(worst)
    assert errors[0] > 10 * errors[1]
    assert errors[1] > 10 * errors[2]
    assert errors[2] < 1e-6


def complete(model: FullModel) -> FloatArray:
    """A basis of all fields, orthonormal in the capacity."""
    return np.asarray(np.linalg.inv(np.linalg.cholesky(model.capacity.toarray())).T)


def step_answers(model: ReducedModel, theta: tuple[float, ...], times: FloatArray) -> FloatArray:
    """Return the answers of all outputs to steps of all inputs of 1 W and of the air of 1 K."""
    outputs = np.vstack([model.temperature, model.observable])
    answer = []
    for t in times:
        operators = model.operators(theta, float(t))
        answer.append(outputs @ np.hstack([operators.heat, operators.air]))
    return np.array(answer)


def test_mixes_must_name_all_inputs_and_no_others() -> None:
    with pytest.raises(InputError, match="'motor'"):
        basis(small(), 8, [{"nut": 10.0}])
    with pytest.raises(InputError, match="'rotor' of a mix is not an input"):
        basis(small(), 8, [{"nut": 10.0, "motor": 1.0, "rotor": 1.0}])


def test_equal_numbers_make_equal_files(tmp_path: Path, shipped: ReducedModel) -> None:
    for name in ("a", "b"):
        write(shipped, tmp_path / name)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    again = ReducedModel.read(tmp_path / "a")
    assert again.inputs == shipped.inputs
    assert np.array_equal(again.conduction_theta, shipped.conduction_theta)


def test_the_shipped_files_are_those_that_the_command_writes_and_small() -> None:
    import thermocomp.virtual as package

    assert Path(package.__path__[0]) / "reduced" == FOLDER
    assert {path.stem for path in FOLDER.iterdir()} == MODELS.keys()
    assert all(path.stat().st_size < 2e6 for path in FOLDER.iterdir())


@pytest.mark.long
@pytest.mark.parametrize("name", list(MODELS))
def test_the_shipped_numbers_are_those_of_the_mesh(name: str) -> None:
    made, shipped = MODELS[name](), ReducedModel.load(name)
    for names in ("theta", "inputs", "places", "observables"):
        assert getattr(made, names) == getattr(shipped, names), "run python -m finite_elements"
    times = np.array([60.0, 600.0, HOUR, 4 * HOUR, 24 * HOUR, 240 * HOUR])
    for share in (0.0, 0.6):
        theta = (share,) * len(made.theta)
        new, old = (step_answers(m, theta, times) for m in (made, shipped))
        # the basis may differ in directions that hardly count: as much as the reduction itself misses
        scale = np.abs(old).max(axis=(0, 2), keepdims=True)
        assert float((np.abs(new - old) / scale).max()) < 2e-3, "run python -m finite_elements"


def test_it_answers_like_the_full_model_over_a_whole_test(full: FullModel, shipped: ReducedModel) -> None:
    exact, reduced = (answers(m, whole_test(m)[0]) for m in (full, shipped))
    drift = np.ptp(exact, axis=0)
    missed = np.abs(reduced - exact).max(axis=0)
    names = [*full.places, *full.observables]
    error = dict(zip(names, missed / drift, strict=True))
    # The basis was made for these; components of the axes, some of which hardly move, take it as it is.
    main = {name: e for name, e in error.items() if name[0] != "E"}
    worst = max(main, key=main.__getitem__)
    assert main[worst] < 0.01, f"{worst}: {100 * main[worst]:.2f} % of its drift"
    assert np.median(list(main.values())) < 0.002
    assert missed[len(full.places) :].max() < 0.2  # um, urad
    assert all(error[name] < 0.01 for name in error if name[:3] in ("EXX", "EYX", "EZX", "EAX", "EYY", "EZY", "EAY"))
    assert all(error[name] < 0.05 for name in error)
    # and the drifts are those of a machine tool: z of tens to 200 um, the front seat below 55 degC
    z, seat = (exact[:, names.index(n)] for n in ("z", "front_seat"))
    assert 30 < np.ptp(z) < 200
    assert 30 < seat.max() < 55


def test_energy_is_kept_over_a_whole_test(full: FullModel, shipped: ReducedModel) -> None:
    for model in (full, shipped):
        assert abs(whole_test(model)[1]) < 1e-3


def test_the_spindle_is_much_faster_than_the_column(shipped: ReducedModel) -> None:
    theta = (0.8, 1.0, 0.0, 0.0, 0.0)
    minutes = np.arange(1, 24 * 60)
    operators = shipped.operators(theta, 60.0)
    rows = shipped.rows(("front_seat", "column_front_right"))
    heat = operators.heat @ given(shipped, replace(RUN, feed=(0.0, 0.0, 0.0)))
    state, history = np.zeros(len(shipped.one)), []
    for _ in minutes:
        state = operators.state @ state + heat
        history.append([*(rows @ state), shipped.observable[shipped.observables.index("tip")] @ state])
    rise = np.array(history)
    seat, column, tip = (float(minutes[(r >= 0.63 * r.max()).argmax()]) for r in rise.T)
    assert tip < seat < 60
    assert column > 3 * seat
    assert column > 120


def test_the_tool_answers_like_its_full_model() -> None:
    """Also where heat passes the joints beside their conductances, surfaces lose more than by their films, and W-15.

    W-15: hot air along the tool, and a foundation of its own temperature.
    """
    histories = []
    given = {"heater": 30.0, "tip": 5.0, "surface": -3.0, "on_tool": 3.0, "on_foot": 5.0}
    given |= {"taper_a": -4.0, "taper_b": 4.0, "grip_a": 2.0, "grip_b": -2.0, "on_chuck": -1.0}
    for model in (tool(joints=True), ReducedModel.load("tool_joints")):
        capacity, conduction, air = matrices(model, {})
        watts = np.array([given.get(name, 0.0) for name in model.inputs])
        heat = model.heat @ watts + air @ np.array([22.0, 0.5, 0.0])
        fields = [REFERENCE_TEMPERATURE * model.one]
        for dt, count in ((2.0, 100), (60.0, 200)):
            fields += [s.temperatures for s in Stepper(capacity, conduction, dt).march(fields[-1], heat, count)]
        histories.append(answers(model, np.array(fields)))
    exact, reduced = histories
    assert (np.abs(reduced - exact).max(axis=0) / np.ptp(exact, axis=0)).max() < 2e-3
