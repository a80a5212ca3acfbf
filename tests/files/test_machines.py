"""The TOML door of machines: every component can be told, and what cannot be used is told to the key."""

import json
import re
import shutil
from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from thermocomp.core.components import BY_CODE, COMPONENTS
from thermocomp.core.exceptions import InputError
from thermocomp.core.inputs import Input
from thermocomp.core.machine import Axis, Source
from thermocomp.core.model import ErrorModel
from thermocomp.core.polynomial import Polynomial
from thermocomp.core.position import PositionModel
from thermocomp.core.profile import PolynomialProfile
from thermocomp.core.provenance import RULES, HonestError
from thermocomp.core.structure import Structure
from thermocomp.core.terms import Variable
from thermocomp.files import modelfile, positionfile
from thermocomp.files.machines import read_machine

HEAD = """
structure = "w X' b Z Y (C1) t"
[axes.X]
travel = ["0 mm", "600 mm"]
[axes.Y]
travel = ["0 mm", "400 mm"]
[axes.Z]
travel = ["-0.5 m", "0 m"]
[components]
"""
ZERO = '["0 mm", "0 mm", "0 mm"]'
#: the same with all that a turn or a squareness needs
WHOLE = re.sub(
    r"(?m)^(travel .*)$",
    rf"""\1
reference_position = "0 mm"
measured_at = {ZERO}
measured_tool = {ZERO}""",
    HEAD,
).replace("[components]", f"[spindle]\nmeasured_tool = {ZERO}\n[components]")

Word = Literal["", "accepted", "refused"]


def written(folder: Path, text: str) -> Path:
    path = folder / "mill.toml"
    path.write_text(text, encoding="utf-8")
    return path


def drift(target: str, unit: str = "um", verdict: Word = "") -> Polynomial:
    judged = None
    if verdict:
        judged = HonestError("made", 2.0, 2.0, 4.0, 3.0, 3.0, {"1": 2.0}, verdict, "worse than none", 2, rules=RULES)
    return Polynomial(
        target=target,
        unit=unit,
        inputs=(Input("t1_C", "temperature", "degC", 20.0, True, -10.0, 10.0),),
        variables=(Variable.single("t1_C", 0),),
        terms=((0,),),
        coefficients=(2.0,),
        honest_error=judged,
    )


def along(target: str, unit: str = "um", axis: str = "Y", verdict: Word = "") -> PositionModel:
    return PositionModel(
        target=target,
        unit=unit,  # type: ignore[arg-type]
        axis=axis,
        travel=(0.0, 400.0),
        slopes=(drift(target, f"{unit}/m", verdict),),
    )


def test_all_that_can_be_written(tmp_path: Path) -> None:
    text = """
name = "Mill 7"
structure = "XFZ"
reference_temperature = "68 degF"
tool = ["0 mm", "0 in", "-0.15 m"]

[axes.X]
travel = ["0 mm", "24 in"]
reference_position = "300000 um"
measured_at = ["1 mm", "2 mm", "3 mm"]
measured_tool = ["0 mm", "0 mm", "-150 mm"]
rapid = "30 m/min"
acceleration = "5 m/s2"

[axes.Z]
travel = ["-500 mm", "+.5e2 mm"]
reference_position = "0 mm"
measured_on = "workpiece"

[spindle]
measured_tool = ["0 mm", "0 mm", "-200 mm"]

[components]
B0Z = "10 arcsec"
X0C = "-1e-3 mm"
EBX = {profile = [["0 mm", "0 urad"], ["300 mm", "-0.002 mrad"], ["500 mm", "4 µrad"]]}
"""
    machine = read_machine(written(tmp_path, text))
    assert (machine.name, machine.structure) == ("Mill 7", Structure(("X",), ("Z",)))
    assert machine.reference_temperature == pytest.approx(20.0)
    assert machine.tool == (0.0, 0.0, -150.0)
    assert machine.spindle_tool == (0.0, 0.0, -200.0)
    x, z = machine.axes
    assert x.travel == pytest.approx((0.0, 609.6))
    assert x.reference_position == pytest.approx(300.0)
    assert (x.measured_at, x.measured_tool) == ((1.0, 2.0, 3.0), (0.0, 0.0, -150.0))
    assert (x.rapid, x.acceleration) == (30_000.0, 5000.0)
    assert z == Axis("Z", (-500.0, 50.0), measured_on="workpiece")
    assert (z.rapid, z.acceleration) == (None, None)
    assert machine.components["B0Z"] == pytest.approx(10 * 1e6 * np.pi / 180 / 3600)
    assert machine.components["X0C"] == -1.0
    profile = machine.components["EBX"]
    assert isinstance(profile, PositionModel)
    points = np.zeros((6, 3))
    points[:, 0] = [-10, 0, 150, 300, 400, 600]
    assert profile.at(points, np.zeros(0)) == pytest.approx([0, 0, -1, -2, 1, 4])
    assert (profile.unit, profile.axis, profile.reference_position) == ("urad", "X", 300.0)


def test_a_name_is_that_of_the_file_if_there_is_none(tmp_path: Path) -> None:
    machine = read_machine(written(tmp_path, HEAD))
    assert (machine.name, machine.reference_temperature, dict(machine.components)) == ("mill", 20.0, {})


def test_all_32_components_are_reached_by_constants(tmp_path: Path) -> None:
    lines = [f'{c.code} = "{k} {c.unit}"' for k, c in enumerate(COMPONENTS)]
    machine = read_machine(written(tmp_path, WHOLE + "\n".join(lines)))
    assert len(COMPONENTS) == 32
    assert machine.components == {c.code: float(k) for k, c in enumerate(COMPONENTS)}


def test_all_32_components_are_reached_by_models(tmp_path: Path) -> None:
    ofposition = [along(c.code, c.unit, c.depends_on) for c in COMPONENTS if c.depends_on]
    oftime = [drift(c.code, c.unit) for c in COMPONENTS if c.is_scalar]
    assert (len(ofposition), len(oftime)) == (18, 14)
    positionfile.write(ofposition, tmp_path / "position.json")
    modelfile.write(oftime, tmp_path / "time.json")
    lines = [f'{c.code} = {{model = "{"time" if c.is_scalar else "position"}.json"}}' for c in COMPONENTS]
    machine = read_machine(written(tmp_path, WHOLE + "\n".join(lines)))
    told: dict[str, Source] = {**{m.target: m for m in ofposition}, **{m.target: m for m in oftime}}
    assert machine.components == told


def test_a_model_is_found_by_its_target_or_as_the_only_one(tmp_path: Path) -> None:
    modelfile.write([drift("z_um"), drift("tip z", "um")], tmp_path / "two.json")
    modelfile.write([drift("y_um")], tmp_path / "one.json")
    text = 'Z0C = {model = "two.json", target = "tip z"}\nY0C = {model = "one.json"}\nEYY = {model = "one.json"}'
    found = read_machine(written(tmp_path, HEAD + text)).components
    assert all(isinstance(m, ErrorModel) for m in found.values())
    assert [m.target for m in found.values() if isinstance(m, ErrorModel)] == ["tip z", "y_um", "y_um"]


AXES = HEAD.removesuffix("[components]\n")
MM = 'write a length with its unit, such as "600 mm"'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a = [", "mill.toml: not valid TOML"),
        (HEAD + 'EXX = "1 um"\nEXX = "2 um"', "mill.toml: not valid TOML: Cannot overwrite a value"),
        ("structure = 'XF'\n[axes.X]", 'axes.X.travel: is missing: write its lower and upper limit, such as ["0 mm"'),
        ("structure = 'XF'\n[axes.X]\ntravel = ['1,5 mm', '2 mm']", f'axes.X.travel: "1,5 mm": {MM}'),
        ("name = 'a'", "structure: is missing: write the axes from the workpiece to the tool"),
        (HEAD.replace("structure", "strukture"), "strukture: there is no key 'strukture'; the nearest are structure"),
        (HEAD.replace("w X' b Z Y (C1) t", "w U' b Z Y t"), "structure: axis U: only the linear axes X, Y and Z"),
        (HEAD.replace("w X' b Z Y (C1) t", "w X b Z Y t"), "structure: 'X' in 'w X b Z Y t' is on the workpiece's"),
        (HEAD.replace('"w X\' b Z Y (C1) t"', "3"), "structure: 3: must be a text in quotes"),
        (HEAD.replace("w X' b Z Y (C1) t", "XFZ"), "axes.Y: there is no axis 'Y' in the structure"),
        (
            HEAD.replace("w X' b Z Y (C1) t", "w A' X' b Z Y (C1) t") + '[axes.A]\ntravel = ["0 mm", "1 mm"]',
            "axes.A: A is a rotary axis, which the structure defines completely",
        ),
        (HEAD + '[axes.U]\ntravel = ["0 mm", "1 mm"]', "axes.U: there is no axis 'U' in the structure"),
        (AXES.replace("[axes.Y]", "[spindle]"), "spindle.travel: there is no key 'travel'; there are measured_tool"),
        ("structure = 'XFY'\n[axes.X]\ntravel = ['0 mm', '1 mm']", "axes.Y: is missing: the structure"),
        (HEAD.replace('"600 mm"', "600"), f"axes.X.travel: 600: {MM}"),
        (HEAD.replace('"600 mm"', '"600"'), f'axes.X.travel: "600": {MM}'),
        (HEAD.replace('"600 mm"', '"6.0.0 mm"'), f'axes.X.travel: "6.0.0 mm": {MM}'),
        (HEAD.replace('"600 mm"', '"nan mm"'), f'axes.X.travel: "nan mm": {MM}'),
        (HEAD.replace('"600 mm"', '"1e999 mm"'), 'axes.X.travel: "1e999 mm": the value is not a finite number'),
        (HEAD.replace('"600 mm"', '"600 parsec"'), "axes.X.travel: \"600 parsec\": unknown unit 'parsec'"),
        (
            HEAD.replace('"600 mm"', '"6 degC"'),
            "axes.X.travel: \"6 degC\": unit 'degC' measures temperature, not posit",
        ),
        (
            HEAD.replace("[axes.Y]", "rapid = 30\n[axes.Y]"),
            'axes.X.rapid: 30: write a speed with its unit, such as "30 m',
        ),
        (
            HEAD.replace("[axes.Y]", 'acceleration = "5"\n[axes.Y]'),
            'axes.X.acceleration: "5": write an acceleration with its unit, such as "3 m/s2"',
        ),
        (
            HEAD.replace("[axes.Y]", 'acceleration = "5 m/min"\n[axes.Y]'),
            "axes.X.acceleration: \"5 m/min\": unit 'm/min' measures feed, not acceleration; for acceleration use",
        ),
        (HEAD.replace("[axes.Y]", 'rapid = "0 m/min"\n[axes.Y]'), "axes.X.rapid: 0: must be positive"),
        (HEAD.replace('"600 mm"', '"-1 mm"'), "axes.X.travel: lower limit 0 mm must be less than upper limit -1 mm"),
        (HEAD.replace('["0 mm", "600 mm"]', '"600 mm"'), "axes.X.travel: '600 mm': write 2 values, such as"),
        (HEAD.replace("[axes.Y]\n", "[axes.Y]\ntravle = 3\n"), "axes.Y.travle: there is no key 'travle'; the nearest"),
        ("tool = ['0 mm']\n" + HEAD, "tool: ['0 mm']: write 3 values, such as"),
        ("axes = 3", "axes: 3: must be a table"),
        ("axes.X = 3", "axes.X: 3: must be a table"),
        (
            "reference_temperature = 20\n" + HEAD,
            'reference_temperature: 20: write a temperature with its unit, such as "',
        ),
        (HEAD + 'EXU = "1 um"', "components.EXU: there is no component 'EXU'; the nearest are EZX, EYX, EXZ"),
        (HEAD + "EXX = 1.0", 'components.EXX: 1.0: write a length with its unit, such as "12 um"'),
        (HEAD + 'C0Y = "12 um"', "components.C0Y: \"12 um\": unit 'um' measures displacement or position, not angle"),
        (HEAD + 'EXX = "12 urad"', "components.EXX: \"12 urad\": unit 'urad' measures angle, not displacement"),
        (HEAD + "C0Y = 12", 'components.C0Y: 12: write an angle with its unit, such as "12 urad"'),
        (HEAD + "C0Y = true", 'components.C0Y: true: write an angle with its unit, such as "12 urad"'),
        (HEAD + "C0Y = []", 'components.C0Y: []: write an angle with its unit, such as "12 urad"'),
        (HEAD + "EXX = {}", 'components.EXX: write either {model = "file.json"} or {profile ='),
        (HEAD + 'EXX = {modell = "a"}', "components.EXX.modell: there is no key 'modell'; the nearest are model"),
        (HEAD + "EXX = {model = 3}", "components.EXX.model: 3: must be a text in quotes"),
        (HEAD + 'EXX = {model = "a", profile = []}', "components.EXX: write either"),
        (HEAD + 'EXX = {profile = [], target = "a"}', "components.EXX.target: belongs to a model file"),
        (HEAD + "EXX = {profile = 3}", "components.EXX.profile: must be a list of points"),
        (HEAD + 'EXX = {profile = [["0 mm", "0 um"]]}', "components.EXX.profile: has 1 points: expected at least two"),
        (HEAD + 'EXX = {profile = ["0 mm"]}', "components.EXX.profile: '0 mm': expected position and error, such as"),
        (HEAD + 'EXX = {profile = [["0 mm", 3]]}', "components.EXX.profile: 3: write a length with its unit"),
        (HEAD + 'EXX = {profile = [["0 mm", "3 urad"]]}', "components.EXX.profile: \"3 urad\": unit 'urad' measures"),
        (
            HEAD + 'EXX = {profile = [["5 mm", "0 um"], ["1 mm", "0 um"]]}',
            "components.EXX.profile: 1 mm follows 5 mm: positions must increase",
        ),
        (HEAD + 'C0Y = {profile = [["0 mm", "0 um"]]}', "components.C0Y.profile: squareness of Y to X does not depend"),
        (HEAD + 'EXX = {model = "no.json"}', "no.json: no such model file"),
    ],
)
def test_what_cannot_be_used_is_told_to_the_key(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=re.escape(message)) as raised:
        read_machine(written(tmp_path, text))
    assert str(raised.value).startswith(f"{tmp_path / 'mill.toml'}: ")


def test_a_component_of_an_axis_that_is_not_there(tmp_path: Path) -> None:
    text = 'structure = "XFZ"\n[axes.X]\ntravel = ["0 mm", "1 mm"]\n[axes.Z]\ntravel = ["0 mm", "1 mm"]\n'
    text += 'reference_position = "0 mm"\n[components]\n'
    read_machine(written(tmp_path, text + 'EXX = "1 um"\nB0Z = "1 urad"'))
    missing = [c for c in BY_CODE.values() if "Y" in c.axes]
    assert len(missing) == 6 + 2 + 3
    for c in missing:
        message = f"components.{c.code}: {c.description}: the machine has no axis Y"
        with pytest.raises(InputError, match=re.escape(message)):
            read_machine(written(tmp_path, text + f'{c.code} = "1 {c.unit}"'))


def test_model_files_that_do_not_fit(tmp_path: Path) -> None:
    positionfile.write([along("EYY")], tmp_path / "eyy.json")
    positionfile.write([along("EXX")], tmp_path / "wrong_axis.json")
    positionfile.write([along("EYY", verdict="refused")], tmp_path / "refused_slope.json")
    modelfile.write([drift("a"), drift("b")], tmp_path / "two.json")
    modelfile.write([drift("z_um", verdict="refused")], tmp_path / "refused.json")
    modelfile.write([drift("z_um", verdict="accepted")], tmp_path / "accepted.json")
    whole = (tmp_path / "two.json").read_text(encoding="utf-8")
    (tmp_path / "half.json").write_text(whole[: len(whole) // 2], encoding="utf-8")
    (tmp_path / "altered.json").write_text(whole.replace("2.0", "3.0"), encoding="utf-8")
    altered = json.loads((tmp_path / "eyy.json").read_text(encoding="utf-8"))
    altered["models"][0]["travel"] = [0.0, 300.0]
    (tmp_path / "altered_position.json").write_text(json.dumps(altered), encoding="utf-8")
    for text, message in (
        ('Y0C = {model = "half.json"}', "components.Y0C.model: "),
        ('Y0C = {model = "half.json"}', "half.json: the file is incomplete"),
        ('Y0C = {model = "altered.json", target = "a"}', "altered.json: its numbers do not match its checksum"),
        ('EYY = {model = "altered_position.json"}', "altered_position.json: its numbers do not match its checksum"),
        ('Y0C = {model = "."}', "cannot be read as a model file"),
        ('Y0C = {model = "two.json"}', "components.Y0C: "),
        ('Y0C = {model = "two.json"}', "two.json holds models of a, b: select one with target"),
        ('Y0C = {model = "two.json", target = "c"}', "components.Y0C.target: there is no model in "),
        (
            'C0Y = {model = "two.json", target = "a"}',
            "components.C0Y: the model is in um; squareness of Y to X is in urad",
        ),
        ('EZZ = {model = "eyy.json"}', "eyy.json holds a model of EYY, not of EZZ"),
        (
            'Y0C = {model = "eyy.json", target = "EYY"}',
            "components.Y0C: spindle drift in Y does not depend on a position",
        ),
        (
            'EXX = {model = "wrong_axis.json"}',
            "components.EXX: positioning of X: expected a model along X, found one along Y",
        ),
        ('Z0C = {model = "refused.json"}', "components.Z0C.model: "),
        (
            'Z0C = {model = "refused.json"}',
            "refused.json: model of z_um was refused and will not run: worse than none; fit a better model, or leave",
        ),
        ('EYY = {model = "refused_slope.json"}', "model of EYY was refused and will not run: worse than none"),
    ):
        with pytest.raises(InputError, match=re.escape(message)):
            read_machine(written(tmp_path, HEAD + text))
    found = read_machine(written(tmp_path, HEAD + 'Z0C = {model = "accepted.json"}\nEYY = {model = "eyy.json"}'))
    assert sorted(found.components) == ["EYY", "Z0C"]


def test_no_file_or_no_text(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such machine file"):
        read_machine(tmp_path / "no.toml")
    with pytest.raises(InputError, match="cannot be read as a machine file"):
        read_machine(tmp_path)


def test_a_turn_or_a_squareness_needs_the_place_from_which_it_counts(tmp_path: Path) -> None:
    """A lever from a guessed zero would be off by the whole table: nothing is guessed."""
    read_machine(written(tmp_path, WHOLE + "\n".join(f'{c.code} = "1 {c.unit}"' for c in COMPONENTS)))
    for code, table, keys in (
        ("EAX", "axes.X", ("measured_at", "measured_tool")),
        ("EBY", "axes.Y", ("measured_at", "measured_tool")),
        ("ECZ", "axes.Z", ("measured_at", "measured_tool")),
        ("C0Y", "axes.Y", ("reference_position",)),
        ("B0Z", "axes.Z", ("reference_position",)),
        ("A0Z", "axes.Z", ("reference_position",)),
        ("A0C", "spindle", ("measured_tool",)),
        ("B0C", "spindle", ("measured_tool",)),
    ):
        before, head, after = WHOLE.partition(f"[{table}]\n")
        for key in keys:
            text = before + head + re.sub(f"{key} = .*\n", "", after, count=1)
            message = f"mill.toml: {table}.{key}: is missing: {code} ({BY_CODE[code].description}) is given, so write"
            with pytest.raises(InputError, match=re.escape(message)):
                read_machine(written(tmp_path, text + f'{code} = "1 urad"'))
            read_machine(written(tmp_path, text + 'EXX = "1 um"\nX0C = "1 um"'))


@pytest.mark.parametrize("value", ['{profile = [["0 mm", "0 urad"], ["9 mm", "1 urad"]]}', '{model = "ecx.json"}'])
def test_a_turn_by_profile_or_model_needs_it_too(value: str, tmp_path: Path) -> None:
    positionfile.write([along("ECX", "urad", "X")], tmp_path / "ecx.json")
    with pytest.raises(InputError, match=r"axes\.X\.measured_at: is missing: ECX \(tilt about Z of X\) is given"):
        read_machine(written(tmp_path, HEAD + f"ECX = {value}"))
    read_machine(written(tmp_path, WHOLE + f"ECX = {value}"))


def test_axes_stood_within_their_travels(tmp_path: Path) -> None:
    def at(axis: str, place: str, more: str = "") -> Path:
        return written(tmp_path, HEAD.replace(f"[axes.{axis}]\n", f"[axes.{axis}]\nmeasured_at = {place}\n{more}"))

    for axis, place, message in (
        ("X", '["0 mm", "401 mm", "0 mm"]', "axes.X.measured_at: Y 401 mm: outside the travel of Y, 0 to 400 mm"),
        ("Y", '["0 mm", "0 mm", "1 mm"]', "axes.Y.measured_at: Z 1 mm: outside the travel of Z, -500 to 0 mm"),
        ("Z", '["-1 mm", "0 mm", "0 mm"]', "axes.Z.measured_at: X -1 mm: outside the travel of X, 0 to 600 mm"),
    ):
        with pytest.raises(InputError, match=re.escape(message)):
            read_machine(at(axis, place))
    # its own coordinate counts if the place stays with the workpiece
    read_machine(at("X", '["-9 mm", "0 mm", "0 mm"]'))
    with pytest.raises(InputError, match=re.escape("axes.X.measured_at: X -9 mm: outside the travel of X")):
        read_machine(at("X", '["-9 mm", "0 mm", "0 mm"]', 'measured_on = "workpiece"\n'))
    assert read_machine(at("X", ZERO, 'measured_on = "workpiece"\n')).axis("X").measured_on == "workpiece"
    with pytest.raises(InputError, match=re.escape("axes.X.measured_on: 'table': must be 'tool' or 'workpiece'")):
        read_machine(at("X", ZERO, 'measured_on = "table"\n'))


def test_numbers_in_another_unit_are_seen(tmp_path: Path) -> None:
    for text, message in (
        ('EXX = "11 mm"', "components.EXX: 11000 um is more than 10 mm: check the unit"),
        ('C0Y = "-11 mrad"', "components.C0Y: -11000 urad is more than 10 mrad: check the unit"),
        (
            'EXX = {profile = [["1 m", "0 um"], ["2 m", "1 um"]]}',
            "components.EXX: positioning of X: its profile is known for X = 1000 to 2000 mm, but the axis travels",
        ),
    ):
        with pytest.raises(InputError, match=re.escape(message)):
            read_machine(written(tmp_path, WHOLE + text))
    read_machine(written(tmp_path, WHOLE + 'EXX = "10 mm"\nC0Y = "-10 mrad"'))


def test_the_virtual_machine_takes_18_components_from_one_file(tmp_path: Path) -> None:
    """docs/files/virtual.toml, with what `thermocomp position --component all` and `thermocomp fit` write."""
    shutil.copy(Path(__file__).parents[2] / "docs" / "files" / "virtual.toml", tmp_path)
    axes = [c for c in COMPONENTS if c.group == "axis"]
    low, high = (0.0, 0.0, 0.0), (600.0, 550.0, 600.0)
    models = [
        PositionModel(
            target=c.code,
            unit=c.unit,
            axis=c.depends_on or "",
            travel=(0.0, 550.0),
            profile=PolynomialProfile(exponents=((0, 0, 0),), coefficients=(float(k),), low=low, high=high),
        )
        for k, c in enumerate(axes)
    ]
    positionfile.write(models[::-1], tmp_path / "axes.json")
    drifts = [drift(name) for name in ("x1_um", "y1_um", "z_um")]
    drifts.append(drift("A0C", "urad"))
    modelfile.write(drifts, tmp_path / "spindle.json")
    machine = read_machine(tmp_path / "virtual.toml")
    assert [machine.components[c.code] for c in axes] == models
    assert {code: machine.components[code] for code in ("C0Y", "B0Z", "A0Z")} == {"C0Y": 14, "B0Z": -21, "A0Z": 17}
    assert [machine.components[code] for code in ("X0C", "Y0C", "Z0C", "A0C")] == drifts
    assert machine.axis("Y").measured_at == (300.0, 250.0, 300.0)
    assert machine.tool == machine.spindle_tool == (0.0, 0.0, -150.0)
