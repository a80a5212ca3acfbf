"""Models from the papers' printed coefficients, loaded, written, read back and evaluated."""

from dataclasses import replace

import numpy as np
import pytest

from thermocomp.core.correction import Deviation
from thermocomp.core.expression import Constant, Node, Power, Product, Sum, sum_weighted
from thermocomp.core.expression import Input as Leaf
from thermocomp.core.inputs import Input
from thermocomp.core.polynomial import Polynomial
from thermocomp.core.provenance import Provenance
from thermocomp.core.terms import Term, TermTable, Variable
from thermocomp.files import modelfile


def paper_model(
    target: str,
    names: list[str],
    variables: list[Variable],
    terms: dict[Term, float],
    source: str,
    *,
    intercept: float = 0.0,
    unit: str = "um",
    quantity: str = "temperature",
) -> Polynomial:
    house = {"temperature": "degC", "position": "mm"}[quantity]
    return Polynomial(
        target=target,
        unit=unit,
        inputs=tuple(Input(n, quantity, house, 0.0, False, -1000.0, 1000.0) for n in names),
        variables=tuple(variables),
        terms=tuple(terms),
        coefficients=tuple(terms.values()),
        intercept=intercept,
        provenance=Provenance(method="paper", source=source),
    )


def chen_dx() -> Polynomial:
    """C-18: Eq. (5), the drift of the spindle in x."""
    names = ["T2", "T3", "T6", "T7", "T8", "T9"]
    variables = [
        Variable.single("T2", 0),
        Variable.single("T3", 1),
        Variable.difference(names, "T6", "T7"),
        Variable.difference(names, "T8", "T9"),
    ]
    terms = {(0,): -0.586, (1,): 7.527, (2,): -36.966, (3,): 10.809, (1, 1): -0.149, (2, 2): -18.119, (0, 2): 2.499}
    return paper_model("x", names, variables, terms, "Chen, Yuan, Ni 1996, Eq. 5")


def hwang() -> Polynomial:
    """H-12: Eq. (6)."""
    names = ["T7", "T8", "T2", "T6"]
    variables = [Variable.single(n, k) for k, n in enumerate(names)]
    terms: dict[Term, float] = {(0,): 6.5, (1,): 1.3, (2,): -10.4, (3,): 6.7}
    return paper_model("z", names, variables, terms, "Hwang, Lee, Yang, Eq. 6", intercept=-46.2)


def chen_slope() -> Polynomial:
    """C-24: the slope k1 of Eq. (8), in um/m (E-C6), with T7-T9 (E-C4)."""
    names = ["T3", "T4", "T6", "T7", "T8", "T9"]
    variables = [
        Variable.single("T3", 0),
        Variable.single("T4", 1),
        Variable.difference(names, "T6", "T8"),
        Variable.difference(names, "T7", "T9"),
    ]
    terms: dict[Term, float] = {(0,): 0.465, (1,): 2.705, (2,): 3.675, (3,): -5.589}
    return paper_model("EYY slope", names, variables, terms, "Chen, Yuan, Ni 1996, Eq. 8", unit="um/m")


def chen_geometric() -> Polynomial:
    """C-22: Eq. (6), f_g of y [mm]; printed for mm, here in um."""
    printed = (2.424e-4, 3.096e-4, -3.571e-6, 1.474e-8, -2.662e-11, 1.738e-14)
    terms: dict[Term, float] = {(0,) * k: 1e3 * c for k, c in enumerate(printed) if k}
    return paper_model(
        "EYY",
        ["y"],
        [Variable.single("y", 0)],
        terms,
        "Chen, Yuan, Ni 1996, Eq. 6",
        intercept=0.2424,
        quantity="position",
    )


def at(model: Polynomial, *values: float) -> float:
    return float(model.step(model.init(), np.array(values), 0.0)[1])


def test_chen_dx_by_hand() -> None:
    t2, t3, t6, t7, t8, t9 = 12.0, 6.0, 3.0, 2.5, 2.0, 1.2
    d67, d89 = t6 - t7, t8 - t9
    expected = (
        -0.586 * t2 + 7.527 * t3 - 36.966 * d67 + 10.809 * d89 - 0.149 * t3**2 - 18.119 * d67**2 + 2.499 * t2 * d67
    )
    assert at(chen_dx(), t2, t3, t6, t7, t8, t9) == pytest.approx(expected, rel=1e-14)
    ones = replace(chen_dx(), coefficients=(1.0,) * 7)
    assert at(ones, t2, t3, t6, t7, t8, t9) == pytest.approx(t2 + t3 + d67 + d89 + t3**2 + d67**2 + t2 * d67, rel=1e-14)
    assert len(chen_dx().terms) == 7  # C-20
    assert at(chen_dx(), *[0.0] * 6) == 0.0  # no constant, C-09


def test_hwang_by_hand() -> None:
    assert at(hwang(), 10.0, 8.0, 3.0, 4.0) == pytest.approx(-46.2 + 65.0 + 10.4 - 31.2 + 26.8)
    assert hwang().sensors == ("T7", "T8", "T2", "T6")


def test_hwang_without_grouping_by_hand() -> None:
    """H-15, Eq. 8: seven variables."""
    names = ["T1", "T2", "T7", "T9", "T10", "T11", "T12"]
    printed = (22.6, -16.5, 7.9, -25.8, 45.4, -36.1, 13.0)
    terms: dict[Term, float] = {(k,): c for k, c in enumerate(printed)}
    variables = [Variable.single(name, k) for k, name in enumerate(names)]
    model = paper_model("z", names, variables, terms, "Hwang, Lee, Yang, Eq. 8", intercept=-50.7)
    expected = -50.7 + 22.6 * 3 - 16.5 * 2 + 7.9 * 9 - 25.8 * 4 + 45.4 * 5 - 36.1 * 6 + 13.0 * 7
    assert at(model, 3.0, 2.0, 9.0, 4.0, 5.0, 6.0, 7.0) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("y", "um"), [(0.0, 0.24), (50.0, 8.48), (100.0, 7.74), (250.0, -2.24), (500.0, -15.83), (550.0, -18.53)]
)
def test_geometric_check_values(y: float, um: float) -> None:
    """C-22."""
    assert at(chen_geometric(), y) == pytest.approx(um, abs=0.006)


def test_slope_is_um_per_m() -> None:
    """E-C6: T3=10, T4=20, T6-T8=2, T7-T9=1 give 60.5 um/m, 30 um at 500 mm."""
    slope = at(chen_slope(), 10.0, 20.0, 2.0, 1.0, 0.0, 0.0)
    assert slope == pytest.approx(60.5, abs=0.05)
    assert Deviation(0.0, slope).at(500.0) == pytest.approx(30.3, abs=0.1)


def test_round_trip_keeps_every_bit() -> None:
    models = (chen_dx(), hwang(), chen_slope(), chen_geometric())
    again = modelfile.loads(modelfile.dumps(models))
    assert again == models
    assert modelfile.dumps(again) == modelfile.dumps(models)
    assert at(again[0], 1.1, 2.2, 3.3, 4.4, 5.5, 6.6) == at(chen_dx(), 1.1, 2.2, 3.3, 4.4, 5.5, 6.6)


def test_terms_as_expressions() -> None:
    """C-18, H-12: a square is a power, a product of two is none; nothing is added where there is no constant."""
    names = ["T1", "T2", "T3"]
    leaves = [Leaf(k, name) for k, name in enumerate(names)]
    variables = (Variable.single("T1", 0), Variable.difference(names, "T2", "T3"))
    terms = TermTable(3, variables, ((0,), (0, 0), (0, 1), (0, 0, 0), (0, 1, 1))).expressions(leaves)
    one, two = leaves[0], variables[1].expression(leaves)
    products = (Product((one, two)), Product((one, two, two)))
    assert terms == (one, Power(one, 2), products[0], Power(one, 3), products[1])
    weighted: list[Node] = [Product((Constant(1.0), terms[0])), Product((Constant(-2.0), terms[2]))]
    assert sum_weighted((1.0, 0.0, -2.0), terms[:3]) == Sum(tuple(weighted))
    assert sum_weighted((1.0, 0.0, -2.0), terms[:3], 5.0) == Sum((Constant(5.0), *weighted))
    # every input with a weight counts, also one of 1
    assert replace(hwang(), coefficients=(1.0, 0.0, 1.0, 1.0)).sensors == ("T7", "T2", "T6")
