"""What each part does to the tool point, against closed forms: the signs and levers of the whole machine.

A field of temperatures that is linear in a homogeneous part strains it without any stress, so displacements follow from
geometry alone. With T = g y in the plane z-y: ``u_y = alpha g (y^2 - z^2) / 2`` and ``u_z = alpha g y z``; with T = g z
the same with y and z exchanged. To these come rigid motions that keep the supports in place. A turn ``a`` about X moves
a point by ``-a z`` in y and ``a y`` in z, ``b`` about Y by ``b z`` in x, ``c`` about Z by ``-c y`` in x. The spindle
points to -Z, right is +X, up is +Y; all is tool minus workpiece [um, urad] for 1 K or 1 K/m.
"""

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from finite_elements import machines
from finite_elements.assembly import Assembly, FullModel
from finite_elements.bed import Bed
from finite_elements.column import Column
from finite_elements.machines import dimensions
from finite_elements.materials import data, material
from finite_elements.part import Part
from thermocomp.virtual.axes import STATIONS, TEST_POSITION

FloatArray = NDArray[np.float64]
#: from a place x, y, z [m] to the displacement there [um]
Displacement = Callable[[FloatArray], FloatArray]

TABLE = data("centre.toml")
COLUMN, BED, LENGTHS = TABLE["column"], TABLE["bed"], TABLE["lengths"]
IRON, STEEL = (1e6 * material(m).expansion for m in ("grey_iron", "steel"))
#: variance over the round spot of a carriage or sensor, in squares of its radius: of cos^2 within it
SPREAD = 1.0 / 3.0 - 2.0 / np.pi**2

FRONT = COLUMN["depth"] / 2.0
#: front guide to tool, middle of the foot to tool
REACH = LENGTHS["headstock"] + LENGTHS["tip"]
OVERHANG = FRONT + REACH
MOUNT = LENGTHS["mount"]
#: tool and workpiece above the bed's guides
HEIGHT = COLUMN["test"] + MOUNT
#: along the bed: the column hangs on the screw of Z, the tool in front of it, the table's middle in front of the tool
FOOT = BED["bearing"] - (TABLE["screw"]["z"]["nut"][0] - TEST_POSITION["z"] / 1e3)
MIDDLE = FOOT - OVERHANG - LENGTHS["table"]

#: half of the table's guides along Z, radius of the spots on column and bed, as the parts have them
TABLE_GUIDE, COLUMN_SPOT = 0.20, 0.10


class Machine:
    """The full model with the fields of its parts."""

    def __init__(self) -> None:
        kept: list[Assembly] = []

        class Kept(Assembly):
            def __init__(self, parts: Sequence[Part]) -> None:
                super().__init__(parts)
                kept.append(self)

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(machines, "Assembly", Kept)
            self.model: FullModel = machines.centre()
        (self.parts,) = kept
        column = Column(**dimensions(COLUMN)).space().points
        # the left sheet lies far beside the right one in the mesh
        left = column[0] > 5.0
        self.right = np.where(left, -1.0, 1.0) * COLUMN["width"] / 2.0
        self.column_z = column[0] - np.where(left, np.round(column[0][left].mean()), 0.0)
        bed = Bed(**dimensions(BED), table=MIDDLE, foot=FOOT, shoe=COLUMN["shoe"])
        self.bed_z, self.bed_y = bed.space().points[0], bed.space().points[1]

    def moved(self, **fields: FloatArray | float) -> dict[str, float]:
        """Return all observables where parts are this much warmer than 20 degC."""
        rise = np.zeros(self.model.size)
        for part, field in fields.items():
            rise[self.parts.where(part)] = field
        return {name: float(row @ rise) for name, row in self.model.observables.items()}


@pytest.fixture(scope="module")
def machine() -> Machine:
    return Machine()


def expect(found: dict[str, float], wanted: dict[str, float], rel: float = 3e-3) -> None:
    """Check the tool point: what is not named does not move."""
    names = ("x", "y", "z", "a", "b", "nose", "tip", "slide")
    assert set(wanted) <= set(names)
    full = {name: wanted.get(name, 0.0) for name in names}
    assert {name: found[name] for name in names} == pytest.approx(full, rel=rel, abs=6e-3)


def test_the_loop_of_lengths_is_that_of_the_data(machine: Machine) -> None:
    assert COLUMN["first"] + TEST_POSITION["y"] / 1e3 == pytest.approx(COLUMN["test"])
    assert np.ptp(machine.column_z) == pytest.approx(COLUMN["depth"])
    assert np.abs(machine.column_z).max() == pytest.approx(FRONT)
    assert machine.parts.parts["column"].patches["guide_left"] @ machine.right == pytest.approx(-COLUMN["width"] / 2)
    assert machine.parts.parts["column"].patches["guide_left"] @ machine.column_z == pytest.approx(-FRONT)


def test_a_column_warm_in_front_bends_back(machine: Machine) -> None:
    found = machine.moved(column=-machine.column_z)
    # T = -z: u_z = alpha (y^2 - z^2) / 2, u_y = -alpha y z. Its slope along y is the tilt about X.
    tilt = IRON * COLUMN["test"]
    spots = SPREAD * COLUMN_SPOT**2
    # two carriages of the headstock, each a spot; the nut of Z in the middle of the foot, a spot too, stays
    bent = IRON / 2.0 * (COLUMN["test"] ** 2 + COLUMN["carriage"] ** 2 + spots - FRONT**2 + spots)
    expect(
        found,
        {
            "a": tilt,
            "z": bent + tilt * MOUNT,
            # its front is longer, up to the bearing of Y; the tool stands out in front of the tilted guide
            "y": IRON * FRONT * COLUMN["bearing"] + tilt * REACH,
            # the guide on the right leads a headstock that is colder than the column
            "x": IRON * LENGTHS["guide_x"] * FRONT,
        },
    )
    for p in STATIONS["y"]:
        away = (p - TEST_POSITION["y"]) / 1e3
        at = COLUMN["test"] + away
        assert found[f"ay@{p}"] == pytest.approx(IRON * at, rel=1e-3)
        straight = IRON / 2.0 * (at**2 - COLUMN["test"] ** 2) + MOUNT * IRON * away
        assert found[f"zy@{p}"] - found["zy@250"] == pytest.approx(straight, rel=3e-3, abs=3e-3)
        # Abbe: the guide's tilt changes along Y, the tool stands out in front of it
        assert found[f"yy@{p}"] == pytest.approx(IRON * FRONT * COLUMN["bearing"] + REACH * IRON * away, rel=3e-3)


def test_a_column_warm_on_its_right_leans_and_turns_left(machine: Machine) -> None:
    found = machine.moved(column=machine.right)
    # Sections roll by c = alpha y and shift by -int c; the right front grows forward: a turn about +Y.
    roll, yaw = IRON * COLUMN["test"], IRON * FRONT
    led = IRON * LENGTHS["guide_x"] * COLUMN["width"] / 2.0
    shift = -IRON * COLUMN["test"] ** 2 / 2.0
    expect(found, {"b": yaw, "x": shift + led - roll * MOUNT - yaw * REACH})


def test_an_evenly_warm_column_grows_up_and_forward(machine: Machine) -> None:
    found = machine.moved(column=1.0)
    expect(
        found,
        {
            "x": IRON * LENGTHS["guide_x"],
            "y": IRON * COLUMN["bearing"],
            "z": -IRON * FRONT,
            # the foot grows on a bed that does not
            "slide": IRON * 2.0 * COLUMN["shoe"],
        },
        rel=1e-2,
    )


def test_a_bed_warm_on_top_crowns(machine: Machine) -> None:
    # T = y from the middle of its height
    found = machine.moved(bed=machine.bed_y - BED["height"] / 2.0)
    top = BED["height"] / 2.0
    # u_y = -alpha z^2 / 2 and more that is constant on top: the slope gives a = alpha z
    foot, table = IRON * FOOT, IRON * MIDDLE
    # carriages before and behind the middles; table and column stand on them, workpiece behind the table's middle
    crown = IRON / 2.0 * (MIDDLE**2 + TABLE_GUIDE**2 - FOOT**2 - COLUMN["shoe"] ** 2)
    expect(
        found,
        {
            "a": foot - table,
            "y": crown + foot * OVERHANG + table * LENGTHS["table"],
            # its top is longer between table and bearing of Z
            "z": IRON * top * (BED["bearing"] - MIDDLE) + (foot - table) * HEIGHT,
            # its bearing of X moves right, and the table with it
            "x": -IRON * LENGTHS["bearing_x"] * top,
            "slide": -IRON * top * 2.0 * COLUMN["shoe"],
        },
        rel=1e-2,
    )
    for p in STATIONS["y"]:
        away = (p - TEST_POSITION["y"]) / 1e3
        # the higher the headstock, the farther back: column and table lean away from each other
        assert found[f"zy@{p}"] - found["zy@250"] == pytest.approx((foot - table) * away, rel=5e-3)
        assert found[f"yy@{p}"] == pytest.approx(0.0, abs=1e-6)
        assert found[f"ay@{p}"] == pytest.approx(0.0, abs=1e-6)


def test_a_bed_warm_at_its_rear_moves_bearing_table_and_column(machine: Machine) -> None:
    # T = z: u_z = alpha (z^2 - y^2) / 2, u_y = alpha z y; the mounts at y = 0 stay
    found = machine.moved(bed=machine.bed_z)
    lean = -IRON * BED["height"]  # du_y/dz = alpha y: as a whole it leans, both alike
    expect(
        found,
        {
            "y": IRON * BED["height"] * (FOOT - MIDDLE) + lean * OVERHANG + lean * LENGTHS["table"],
            "z": IRON / 2.0 * (BED["bearing"] ** 2 - MIDDLE**2),
            "x": -IRON * LENGTHS["bearing_x"] * MIDDLE,
            "slide": -IRON * 2.0 * COLUMN["shoe"] * FOOT,
        },
        rel=1e-2,
    )


def test_an_evenly_warm_bed_only_grows(machine: Machine) -> None:
    expect(
        machine.moved(bed=1.0),
        {
            "x": -IRON * LENGTHS["bearing_x"],
            "z": IRON * (BED["bearing"] - MIDDLE),
            "slide": -IRON * 2.0 * COLUMN["shoe"],
        },
        rel=1e-2,
    )


def test_a_headstock_warm_in_front_nods_up(machine: Machine) -> None:
    # its front rises by alpha mount over the bearing span; seen from the guide the tool stands out by the reach
    nod = IRON * MOUNT / LENGTHS["bearing_span"]
    share = LENGTHS["head_front"]
    expect(
        machine.moved(headstock_front=1.0),
        {
            "a": nod,
            "y": nod * REACH,
            "z": nod * MOUNT - IRON * LENGTHS["headstock"] * share,
            # the middle of the headstock grows to the left from its right guide
            "x": -IRON * LENGTHS["guide_x"] / 2.0,
        },
    )
    expect(
        machine.moved(headstock_rear=1.0),
        {
            "a": -nod,
            "y": IRON * MOUNT - nod * REACH,
            "z": -nod * MOUNT - IRON * LENGTHS["headstock"] * (1.0 - share),
            "x": -IRON * LENGTHS["guide_x"] / 2.0,
        },
    )
    # warm all over it does not nod
    expect(
        machine.moved(headstock_front=1.0, headstock_rear=1.0),
        {"y": IRON * MOUNT, "z": -IRON * LENGTHS["headstock"], "x": -IRON * LENGTHS["guide_x"]},
    )


def test_a_warm_table_lifts_the_workpiece_and_moves_it_back(machine: Machine) -> None:
    expect(machine.moved(table=1.0), {"y": -IRON * HEIGHT, "z": -IRON * LENGTHS["table"]})


@pytest.mark.parametrize(
    ("axis", "sign"),
    [
        ("x", 1.0),  # the bearing on the right pushes the table to the left: the tool is to the right of it
        ("y", -1.0),  # the headstock hangs from the bearing on top
        ("z", -1.0),  # the bearing at the rear pushes the column forward
    ],
)
def test_a_warm_screw_pushes_away_from_its_bearing(machine: Machine, axis: str, sign: float) -> None:
    found = machine.moved(**{f"{axis}_screw": 1.0})
    first, last = TABLE["screw"][axis]["nut"]
    for p in STATIONS[axis]:
        distance = first + np.sign(last - first) * p / 1e3
        assert found[f"{axis}{axis}@{p}"] == pytest.approx(sign * STEEL * distance, rel=1e-6)
    expect(found, {axis: found[f"{axis}{axis}@{TEST_POSITION[axis]}"]}, rel=1e-9)
    others = [f"{o}{o}@{p}" for o in "xyz" if o != axis for p in STATIONS[o]]
    assert [found[name] for name in others] == [0.0] * len(others)


def test_a_warm_spindle_grows_out_of_its_flange_towards_the_workpiece(machine: Machine) -> None:
    found = machine.moved(spindle=1.0)
    # housing back from the flange to the middle of the front bearing, shaft and bar forward from there
    bearing = -0.025
    shaft = 1e6 * material("case_hardened_steel").expansion
    nose, tip = (STEEL * bearing + shaft * (at - bearing) for at in (0.075, LENGTHS["tip"]))
    assert found["nose"] == pytest.approx(nose, rel=0.02)
    assert found["tip"] == pytest.approx(tip, rel=0.02)
    expect(found, {"z": -found["tip"], "tip": found["tip"], "nose": found["nose"]}, rel=1e-9)


def shifted(u: Displacement, at: FloatArray, d: float = 1e-4) -> tuple[FloatArray, FloatArray]:
    """Return a guide's displacement and its turn: slopes of its height along Z and X, and of its line along X."""
    grad = np.array([(u(at + d * e) - u(at - d * e)) / (2.0 * d) for e in np.eye(3)])  # grad[j, i] = du_i / dx_j
    return u(at), np.array([-grad[2, 1], -grad[0, 2], grad[0, 1]])


def crowned(r: FloatArray) -> FloatArray:
    """T = y from the middle of the bed's height; the mounts stay."""
    x, z, y = r[0], r[2], r[1] - BED["height"] / 2.0
    held = BED["mount"] ** 2 - (BED["height"] / 2.0) ** 2
    return IRON * np.array([x * y, (y**2 - x**2 - z**2 + held) / 2.0, z * y])


def bowed(r: FloatArray) -> FloatArray:
    """T = z."""
    x, y, z = r
    return IRON * np.array([x * z, y * z, (z**2 - x**2 - y**2) / 2.0])


@pytest.mark.parametrize("u", [crowned, bowed])
def test_the_table_rides_on_guides_that_bend(machine: Machine, u: Displacement) -> None:
    rise = machine.bed_y - BED["height"] / 2.0 if u is crowned else machine.bed_z
    found = machine.moved(bed=rise)
    middle = np.array([0.0, BED["height"], MIDDLE])
    for p in STATIONS["x"]:
        # the table's middle is on the left while X is beyond its middle; the workpiece is always before the tool
        table = middle - [(p - TEST_POSITION["x"]) / 1e3, 0.0, 0.0]
        (_, up, back), turn = shifted(u, table)
        screw = u(middle + np.array([LENGTHS["bearing_x"], 0.0, 0.0]))[0]
        workpiece = np.array([middle[0] - table[0], HEIGHT, LENGTHS["table"]])
        moved = np.array([screw, up, back]) + np.cross(turn, workpiece)
        expected = dict(zip("XYZ", -moved, strict=True)) | dict(zip("ABC", -turn, strict=True))
        # two lines of carriages before and behind its middle
        expected["Y"] += IRON / 2.0 * TABLE_GUIDE**2 if u is crowned else 0.0
        # what the table's guides do along Z is in the way from them to the screw of Z
        expected["Z"] += back - _bow(table[0], u)
        for motion, value in expected.items():
            assert found.get(f"E{motion}X@{p}", 0.0) == pytest.approx(value, rel=1e-2, abs=0.02), motion


def _bow(x: float, u: Displacement) -> float:
    """Displacement along Z of the table's guides against that in their middle."""
    middle = np.array([0.0, BED["height"], MIDDLE])
    return float(u(middle + np.array([x, 0.0, 0.0]))[2] - u(middle)[2])


def test_the_column_rides_on_guides_that_bend(machine: Machine) -> None:
    found = machine.moved(bed=machine.bed_y - BED["height"] / 2.0)
    for p in STATIONS["z"]:
        foot = FOOT + (p - TEST_POSITION["z"]) / 1e3
        tilt = IRON * foot
        assert found[f"EAZ@{p}"] == pytest.approx(tilt, rel=1e-2)
        assert found[f"EZZ@{p}"] - found["EZZ@300"] == pytest.approx(HEIGHT * IRON * (foot - FOOT), rel=1e-2, abs=1e-6)
        lower = IRON / 2.0 * (foot**2 - FOOT**2)
        assert found[f"EYZ@{p}"] - found["EYZ@300"] == pytest.approx(
            OVERHANG * IRON * (foot - FOOT) - lower, rel=1e-2, abs=2e-2
        )
    assert not any(name.startswith(("EXZ", "EBZ", "ECZ")) for name in found)


def test_the_headstock_rides_on_a_column_that_bends_and_twists(machine: Machine) -> None:
    front, right = machine.moved(column=-machine.column_z), machine.moved(column=machine.right)
    for p in STATIONS["y"]:
        at = COLUMN["first"] + p / 1e3
        assert front[f"EAY@{p}"] == pytest.approx(IRON * at, rel=1e-2)
        lift = IRON * FRONT * COLUMN["bearing"]
        assert front[f"EYY@{p}"] == pytest.approx(lift + REACH * IRON * at, rel=1e-2)
        bent = IRON / 2.0 * (at**2 - COLUMN["test"] ** 2) + MOUNT * IRON * (at - COLUMN["test"])
        assert front[f"EZY@{p}"] - front["EZY@250"] == pytest.approx(bent, rel=1e-2, abs=1e-2)
        assert right[f"ECY@{p}"] == pytest.approx(IRON * at, rel=1e-2)
        assert right[f"EBY@{p}"] == pytest.approx(IRON * FRONT, rel=1e-2)
        aside = -IRON * at**2 / 2.0 - IRON * at * MOUNT - IRON * FRONT * REACH
        assert right[f"EXY@{p}"] == pytest.approx(aside, rel=1e-2)
        assert [front[f"E{m}Y@{p}"] for m in "XBC"] == pytest.approx([0.0] * 3, abs=1e-6)
        assert [right[f"E{m}Y@{p}"] for m in "YZA"] == pytest.approx([0.0] * 3, abs=1e-6)


def test_at_the_test_position_the_axes_and_the_spindle_make_the_tool_point(machine: Machine) -> None:
    rng = np.random.default_rng(0)
    fields: dict[str, FloatArray | float] = {"bed": rng.normal(size=machine.bed_y.size), "table": 1.3}
    fields |= {f"{axis}_screw": float(rng.normal()) for axis in "xyz"}

    def axes(found: dict[str, float], motion: str) -> float:
        return sum(found.get(f"E{motion}{a.upper()}@{p}", 0.0) for a, p in TEST_POSITION.items())

    # neither headstock nor spindle is warm, nor the column's guide
    found = machine.moved(**fields)
    assert [axes(found, m) for m in "XYZAB"] == pytest.approx([found[n] for n in "xyzab"], abs=1e-8)
    found = machine.moved(column=rng.normal(size=machine.right.size))
    assert [axes(found, m) for m in "YZAB"] == pytest.approx([found[n] for n in "yzab"], abs=1e-8)
    # what is left is the spindle's own
    found = machine.moved(headstock_front=1.0, spindle=0.7)
    assert [axes(found, m) for m in "XYZAB"] == [0.0] * 5
    assert found["z"] != 0.0
