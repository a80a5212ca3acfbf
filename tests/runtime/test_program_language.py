"""What the language of the program cannot express is an error while it is recorded, not a wrong program."""

from collections.abc import Callable

import numpy as np
import pytest

from thermocomp.judging.compiled import rows  # noqa: F401 - has functions of the program, too
from thermocomp.runtime.program import models, steps  # noqa: F401
from thermocomp.runtime.program import tree as n
from thermocomp.runtime.program.constants import Constants
from thermocomp.runtime.program.language import choose, each, find_function, is_known, let, otherwise, record, when
from thermocomp.runtime.program.memory import FlatMemory
from thermocomp.runtime.program.values import Condition, flag, integer, real
from thermocomp.runtime.program.variables import RECORDS, Kept, Work

S, W, T = Kept(), Work(), Constants()


def recorded(write: Callable[[], object]) -> list[n.Statement]:
    with record("tick") as found:
        write()
    return found.body


def use_as_a_condition() -> None:
    if S.clock > 0.0:
        S.seen = True


def assign_an_unknown() -> None:
    S.unheard = real(1.0)  # type: ignore[attr-defined]


def index_twice() -> None:
    S.zero[1, 2] = 0.0


def change_the_kind() -> None:
    let("x", real(1.0))
    let("x", integer(1))


def go_on_without_a_branch() -> None:
    S.seen = True
    with otherwise():
        S.seen = False


def assign_a_sum() -> None:
    (S.clock + 1.0).set(2.0)


@pytest.mark.parametrize(
    ("write", "says"),
    [
        (use_as_a_condition, "no truth value"),
        (assign_an_unknown, "is not a declared variable of Kept"),
        (index_twice, "2 indices, expected 1"),
        (change_the_kind, "declared with two types, real and int"),
        (go_on_without_a_branch, "must directly follow a `when` block"),
        (assign_a_sum, "cannot be assigned"),
    ],
)
def test_mistakes_are_errors(write: Callable[[], object], says: str) -> None:
    with pytest.raises(TypeError, match=says):
        recorded(write)


def test_statements_are_recorded_in_order() -> None:
    def write() -> None:
        total = let("total", real(0.0))
        for k in each("k", T.CHANNELS):
            with when(W.given[k]):
                total.set(total + W.value[k])
            with otherwise():
                total.set(choose(S.seen, total, 0.0))
        S.clock = total

    first, loop, last = recorded(write)
    assert isinstance(first, n.Assign)
    assert isinstance(loop, n.For)
    (branch,) = loop.body
    assert isinstance(branch, n.If)
    assert len(branch.body) == len(branch.other) == 1
    assert isinstance(last, n.Assign)
    assert last.target == Kept.variables()["clock"].node


def test_the_result_of_an_operation_with_a_time_is_a_time() -> None:
    assert (S.clock - 1.0).node.kind == "time"
    assert (2.0 * (W.value[0] + 1.0)).node.kind == "real"
    assert abs(S.clock).node.kind == "time"
    assert isinstance(flag(True) & (S.clock > W.value[0]), Condition)


def test_a_recording_that_fails_leaves_nothing_behind() -> None:
    with pytest.raises(TypeError):
        recorded(use_as_a_condition)
    assert len(recorded(lambda: S.zero[0].set(1.0))) == 1


def test_every_variable_of_the_program_is_used() -> None:
    banks = ("read_inputs", "find_gains", "advance_lags", "add_up")
    roots = ("step", "find_distances", "run_clock", "find_linear", "find_step", "believe_rows", "power_up", *banks)
    used = set().union(*(names_in(name) for name in roots))
    by_formulas = {("s", "deviation"), ("s", "begun_absolute"), ("s", "begun_rezeroed")}
    by_languages = {("s", "model"), ("s", "checked"), ("t", "fingerprint")}  # of a retained state
    assert {
        (letter, name) for letter, r in RECORDS.items() for name in r.variables()
    } == used | by_formulas | by_languages


def names_in(name: str) -> set[tuple[str, str]]:
    """Return the variables that a function and all that it calls use."""
    found = set()
    for node in n.walk(find_function(name).body):
        if isinstance(node, n.Name) and node.record:
            found.add((node.record, node.name))
        if isinstance(node, n.ProcedureCall | n.Call) and is_known(node.name):
            found |= names_in(node.name)
    return {(letter, name) for letter, name in found if name in RECORDS[letter].variables()}


def test_memory_is_laid_out_without_overlaps() -> None:
    sizes = {"CHANNELS": 3, "RANGES": 2, "SENSORS": 2, "FAILING": 2, "MODELS": 2}
    memory = FlatMemory(sizes, {"rate": 0.5, "channel": [1, 2], "leans_on": [[True, False], [False, True]]})
    assert memory.find("t", "rate") == 0.5
    assert memory.find("t", "leans_on").tolist() == [[1, 0], [0, 1]]
    memory.find("s", "zero")[:] = [7.0, 8.0]
    memory.find("s", "clock")[...] = 3.0
    assert memory.find("s", "zero").tolist() == [7.0, 8.0]
    assert float(memory.arrays["sr"].sum()) == 18.0
    for record_ in "sw":
        for name in RECORDS[record_].variables():
            memory.find(record_, name)[...] = 1
    assert all((memory.arrays[a] == 1).all() for a in ("sr", "si", "wr", "wi"))
    assert np.array_equal(memory.find("t", "channel"), [1, 2])
