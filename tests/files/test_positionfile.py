"""Files of position models: bit-exact round trip; damaged files and files of another kind are refused."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thermocomp.core.bounds import COEFFICIENT
from thermocomp.core.exceptions import InputError, ModelFileError
from thermocomp.core.inputs import Input, Support
from thermocomp.core.lineardynamic import LinearDynamic
from thermocomp.core.polynomial import Polynomial
from thermocomp.core.position import PositionModel
from thermocomp.core.profile import PolynomialProfile, Profile, SplineProfile
from thermocomp.core.provenance import HonestError, Provenance
from thermocomp.core.terms import Variable
from thermocomp.files import jsonfile, modelfile, positionfile

finite = st.floats(-COEFFICIENT, COEFFICIENT)
T1 = Input("t1_C", "temperature", "degC", 20.1, True, -1 / 3, 12.7)
HONEST = HonestError("leave one out", 1.0, 2.0, 3.0, 4.0, 5.0, {"1": 0.1}, "refused", "worse than none")


def slope(unit: str = "um/m", coefficient: float = 1 / 3) -> Polynomial:
    return Polynomial(
        target="EYY_k1",
        unit=unit,
        inputs=(T1,),
        variables=(Variable("t1_C", ((0, 1.0),)),),
        terms=((0,), (0, 0)),
        coefficients=(coefficient, -0.1),
        support=Support("hold", 0.1, 0.2),
        honest_error=HONEST,
    )


def polynomial(coefficient: float = 1 / 3) -> PolynomialProfile:
    return PolynomialProfile(
        exponents=((0, 0, 0), (1, 2, 0)),
        coefficients=(coefficient, -2.5),
        centre=(0.0, 275.0, 0.0),
        scale=(1.0, 275.0, 1.0),
        low=(0.0, 0.0, -1.0),
        high=(600.0, 550.0, 1.0),
    )


def spline(coefficient: float = 1 / 3) -> SplineProfile:
    return SplineProfile(axis="Y", knots=(0.0, 100.1, 550.0), pieces=((0.0, 1.0, coefficient, 0.2), (1e-9, 0, 0, 1)))


def model(profile: Profile | None = None, *, coefficient: float = 1 / 3, offset: bool = True) -> PositionModel:
    lagged = LinearDynamic(
        target="EYY_k0",
        unit="um",
        inputs=(T1,),
        signals=((0,),),
        direct=(coefficient,),
        lag_signals=(0,),
        time_constants=(600.0,),
        lagged=(1e-7,),
    )
    return PositionModel(
        target="EYY",
        unit="um",
        axis="Y",
        travel=(0.0, 550.0),
        reference_position=coefficient if abs(coefficient) < 1e6 else 0.0,
        profile=profile,
        offset=lagged if offset else None,
        slopes=(slope(coefficient=coefficient), slope("um/m^2")),
        provenance=Provenance("mra", {"order": "(5, 0)"}, ("ab12",), ("1",), 51, "0.1.0"),
    )


@given(finite, st.booleans())
def test_round_trip_keeps_every_bit(value: float, offset: bool) -> None:
    models = [model(p, coefficient=value, offset=offset) for p in (None, polynomial(value), spline(value))]
    back = positionfile.loads(positionfile.dumps(models))
    assert back == tuple(models)
    assert [np.float64(m.slopes[0].coefficients_by_name()["t1_C"]).tobytes() for m in back] == [
        np.float64(value).tobytes()
    ] * 3


def test_files(tmp_path: Path) -> None:
    path = tmp_path / "eyy.json"
    positionfile.write([model(polynomial())], path)
    assert positionfile.read(path) == (model(polynomial()),)
    with pytest.raises(InputError, match="exists already"):
        positionfile.write([model(spline())], path)
    positionfile.write([model(spline())], path, overwrite=True)
    assert positionfile.read(path) == (model(spline()),)
    assert [p.name for p in tmp_path.iterdir()] == ["eyy.json"]
    with pytest.raises(ModelFileError, match=r"none\.json: no such position model file"):
        positionfile.read(tmp_path / "none.json")
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ModelFileError, match="cannot be read as a position model file"):
        positionfile.read(path)


def test_either_kind_of_file_says_which_it_is(tmp_path: Path) -> None:
    one, other = tmp_path / "model.json", tmp_path / "eyy.json"
    modelfile.write([slope()], one)
    positionfile.write([model()], other)
    with pytest.raises(ModelFileError, match=r"model\.json: not a position model file but a model file, as 'th"):
        positionfile.read(one)
    with pytest.raises(ModelFileError, match=r"eyy\.json: not a model file but a position model file, as 'th"):
        modelfile.read(other)


def test_cut_anywhere_is_told_and_never_half_used() -> None:
    text = positionfile.dumps([model(spline())])
    for length in range(len(text) - 2):
        with pytest.raises(ModelFileError):
            positionfile.loads(text[:length])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("0.3333333333333333", "0.3333333333333334", "do not match its checksum.*'thermocomp position'"),
        (
            '"version": 1',
            '"version": 2',
            "written by a newer thermocomp, version 2 of a position model file; this thermocomp reads version 1",
        ),
        ("thermocomp-position-model", "something-else", "not a position model file: it has no"),
    ],
)
def test_altered_text_is_refused(old: str, new: str, message: str) -> None:
    text = positionfile.dumps([model(polynomial())])
    assert old in text
    with pytest.raises(ModelFileError, match=message):
        positionfile.loads(text.replace(old, new, 1))


def altered(change: dict[str, Any]) -> str:
    """Return a file whose one model was changed and whose checksum was made to fit."""
    content = json.loads(positionfile.dumps([model(polynomial())]))
    entry = content["models"][0]
    for key, value in change.items():
        if value is None:
            del entry[key]
        elif isinstance(value, dict):
            entry[key] |= value
        else:
            entry[key] = value
    content["sha256"] = jsonfile.digest(content["models"])
    return json.dumps(content)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"slopes": None}, "model 1: slopes: is missing"),
        ({"slopes": 1}, "model 1: slopes: Input should be a valid array, found 1"),
        ({"slopes": [{"family": "oracle"}]}, "model 1: slopes.0: unknown family 'oracle'"),
        ({"offset": {"unit": "um/m"}}, "k_0 is in um/m, must be in um"),
        ({"offset": {"direct": []}}, "model 1: offset: .*1 signals but 0 direct"),
        ({"surprise": 1}, "model 1: surprise: "),
        ({"unit": "mm"}, "model 1: unit: "),
        ({"axis": "B"}, "axis 'B': expected X, Y or Z"),
        ({"travel": [550.0, 0.0]}, "travel .* must increase"),
        (
            {"profile": {"kind": "wavelet"}},
            "model 1: profile: unknown kind 'wavelet'; expected one of polynomial, spline",
        ),
        ({"profile": 3}, "model 1: profile: Input should be an object, found 3"),
        ({"profile": {"scale": [0.0, 1.0, 1.0]}}, "profile: scale must be from 1e-06 to 1e\\+07, found 0"),
        ({"profile": {"low": [0.0]}}, r"profile\.low\.1: is missing"),
    ],
)
def test_wrong_content_is_refused_with_its_place(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ModelFileError, match=message):
        positionfile.loads(altered(change))


def test_what_is_no_model_at_all() -> None:
    for body, message in (([], "contains no model"), ([3], "model 1: Input should be an object, found 3")):
        content = {"format": "thermocomp-position-model", "version": 1, "sha256": jsonfile.digest(body), "models": body}
        with pytest.raises(ModelFileError, match=message):
            positionfile.loads(json.dumps(content))
