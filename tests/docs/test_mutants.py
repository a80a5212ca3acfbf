"""The table of mutants belongs to the code and the tests as they are, and the tool that makes it is right."""

import ast
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from mutants.__main__ import examine
from mutants.draw import draw, find, fingerprint
from mutants.run import KILLED, RAISED, SURVIVED, Copy
from mutants.table import Project

ROOT = Path(__file__).resolve().parents[2]
PROJECT = Project(ROOT)
TOY = '''"""A toy."""

PRICES = {"one": 1.0, "two": 2.5}


def pay(counts: list[int]) -> float:
    """Return what is to be paid."""
    total = 0.0
    for k in counts[1:]:
        total += k * PRICES["two"] - 0.5  # a discount
    assert total >= -1.0
    if len(counts) > 9:
        raise ValueError("too many")
    return total if counts[0] == 1 else -total
'''
TESTS = """
import pytest
from thermocomp.toy import pay

def test_amount():
    assert pay([1, 2, 3]) == 11.5

def test_sign():
    assert pay([1, 2]) > 0

def test_refusal():
    with pytest.raises(ValueError):
        pay([1] * 10)
"""


@pytest.mark.parametrize("key", PROJECT.tests)
def test_the_table_belongs_to_the_code(key: str) -> None:
    gaps = PROJECT.gaps(key)
    assert not gaps, f"{key}: {'; '.join(gaps)}: run `make mutants` and commit docs/mutants.json"


def test_nothing_else_is_in_the_table() -> None:
    assert set(PROJECT.table) == set(PROJECT.tests)


@pytest.fixture
def copy(toy: Project, tmp_path: Path) -> Iterator[Copy]:
    with closing(Copy(toy.root, tmp_path / "copy")) as made:
        yield made


@pytest.fixture
def toy(tmp_path: Path) -> Project:
    root = tmp_path / "toy"
    texts = {
        "src/thermocomp/__init__.py": "",
        "src/thermocomp/toy.py": TOY,
        "src/thermocomp/toy.toml": 'text = "7"\nspeed = 600\nduration = "6.5 h" # 3 h\n',
        "tests/test_toy.py": TESTS,
        "docs/requirements.toml": '[A]\ntitle = "A"\nA-01 = { what = "x", tests = ["test_toy.py::test_amount"] }\n',
        "docs/requirements_code.toml": '[code]\nA-01 = ["toy.py::pay"]\n',
    }
    for name, text in texts.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text, encoding="utf-8")
    return Project(root)


def package(project: Project) -> Path:
    return project.root / "src" / "thermocomp"


def test_what_is_drawn(toy: Project) -> None:
    drawn = {m.after for m in draw(package(toy), ["toy.py"], 0, "A-01")}
    assert drawn == {
        'PRICES = {"one": 1.1, "two": 2.5}',
        'PRICES = {"one": 1.0, "two": 2.75}',
        'PRICES = {"one": 2.5, "two": 1.0}',
        "total = 1.0",
        "for k in counts[2:]:",
        "for k in counts[0:]:",
        'total -= k * PRICES["two"] - 0.5  # a discount',
        'total += k * PRICES["two"] + 0.5  # a discount',
        'total += k * PRICES["two"] - 0.55  # a discount',
        *(f"return total if counts[{k}] == {n} else -total" for k, n in ((1, 1), (0, 2), (0, 0))),
        "return total if counts[0] != 1 else -total",
        "return total if counts[0] == 1 else total",
    }
    pairs = {(m.before, m.after) for m in draw(package(toy), ["toy.toml::speed|duration"], 0, "")}
    assert {after for _, after in pairs} == {"speed = 601", "speed = 599", 'duration = "7.15 h" # 3 h'}
    with pytest.raises(KeyError, match=r"there is no cost in toy\.py"):
        find(package(toy), "toy.py::cost")


def test_the_same_seed_draws_the_same(toy: Project) -> None:
    one, again, other = (list(draw(package(toy), ["toy.py::pay"], seed, "A-01")) for seed in (1, 1, 2))
    assert one == again
    assert one != other
    assert sorted(one) == sorted(other)
    for m in one:
        ast.parse(m.text)
        changed = [(a, b) for a, b in zip(TOY.splitlines(), m.text.splitlines(), strict=True) if a != b]
        assert [(a.strip(), b.strip()) for a, b in changed] == [(m.before, m.after)]
        assert TOY.splitlines()[m.line - 1].strip() == m.before


def test_only_an_assertion_of_a_test_kills(copy: Copy) -> None:

    def judge(old: str, new: str, test: str) -> tuple[str, str]:
        assert TOY.count(old) == 1
        return copy.judge("toy.py", TOY.replace(old, new), [f"test_toy.py::{test}"])

    assert judge("- 0.5", "+ 0.5", "test_amount") == (KILLED, "test_toy.py::test_amount")
    assert judge("- 0.5", "+ 0.5", "test_sign") == (SURVIVED, "")
    # an error, an assertion of the package itself, a module that cannot be imported
    assert judge("counts[0]", "counts[9]", "test_amount")[0] == RAISED
    assert judge("total += ", "total -= ", "test_amount")[0] == RAISED
    assert judge('"""A toy."""', "import nowhere", "test_amount")[0] == RAISED
    # an error that should be raised and is not
    assert judge("> 9", "> 10", "test_refusal")[0] == KILLED
    assert (copy.package / "toy.py").read_text(encoding="utf-8") == TOY
    assert copy.run(["test_toy.py"]) == [["passed", f"test_toy.py::test_{t}"] for t in ("amount", "sign", "refusal")]


def test_a_change_that_only_raises_is_drawn_again(toy: Project, copy: Copy) -> None:
    seed = next(
        s for s in range(99) if next(draw(package(toy), ["toy.py::pay"], s, "A-01")).after.startswith("total -=")
    )
    toy.table["A-01"] = entry = examine(toy, copy, "A-01", seed)
    assert entry["raised"] >= 1
    assert [m["verdict"] for m in entry["mutants"]] == [KILLED, KILLED]
    assert toy.gaps("A-01") == []
    toy.save()
    assert Project(toy.root).table == toy.table
    # a table without its code, with a survivor, with another test
    toy.table["A-01"] = entry | {"mutants": [entry["mutants"][0], entry["mutants"][1] | {"verdict": SURVIVED}]}
    assert [gap.split(" ")[0] for gap in toy.gaps("A-01")] == ["no", "1"]
    toy.table["A-01"] = entry | {"code": {"toy.py::pay": "0"}, "tests": {}}
    assert [gap.split(" ")[0] for gap in toy.gaps("A-01")] == ["code", "tests"]
    # a further test changes no kill; a kill by a test that is no longer named counts no more
    toy.table["A-01"] = entry
    toy.tests["A-01"] = ["test_toy.py::test_amount", "test_toy.py::test_sign"]
    assert toy.gaps("A-01") == []
    toy.tests["A-01"] = ["test_toy.py::test_sign"]
    assert [gap.split(" ")[0] for gap in toy.gaps("A-01")] == ["tests"]


def test_words_do_not_change_a_hash(toy: Project, tmp_path: Path) -> None:
    def hashed(old: str = "", new: str = "") -> str:
        folder = tmp_path / str(len([*tmp_path.iterdir()]))
        folder.mkdir()
        (folder / "toy.py").write_text(TOY.replace(old, new) if old else TOY, encoding="utf-8")
        return fingerprint(folder, "toy.py::pay")

    assert hashed("Return what", "Give what") == hashed("    total = 0.0", "\n    # sum\n    total = 0.0") == hashed()
    assert hashed("1.0, ", "1.5, ") == hashed()  # not in the piece
    assert hashed("- 0.5", "- 0.6") != hashed()
