"""A command is its verb: the same options, the same defaults, the same words."""

import inspect
from dataclasses import fields
from importlib import import_module
from pathlib import Path
from typing import Any, get_args

import pytest
from cyclopts import Parameter

import thermocomp as tc
from thermocomp.cli.app import COMMANDS
from thermocomp.cli.face import SHOWN, Verb, is_group, plain
from thermocomp.nc.revise import GROUPS

#: commands without a verb in Python: they ask, serve, or run several others
WITHOUT = {"app", "demo", "map", "run", "serve", "journal", "linuxcnc", "papers"}
#: what a terminal has and Python does not need: where it is written, and how it is shown
TERMINAL = {"output", "overwrite", "json"}


def commands() -> dict[str, Any]:
    """Return the commands that are made of a verb."""
    found = {}
    for name, entry in COMMANDS.items():
        made = entry.load()
        if hasattr(made, "verb"):
            found[name] = made
    return found


MADE = commands()


@pytest.mark.parametrize("name", MADE)
def test_every_option_is_a_parameter_of_the_verb_and_the_other_way_round(name: str) -> None:
    command = MADE[name]
    options = inspect.signature(command).parameters
    verb: Verb = command.verb
    wanted = inspect.signature(verb.function).parameters
    assert options.keys() - TERMINAL - set(command.own) == wanted.keys() - set(SHOWN)
    for option, p in options.items():
        if option in wanted and not is_group(p.annotation):
            default = wanted[option].default
            assert p.default == (list(default) if isinstance(default, tuple) else default), option


@pytest.mark.parametrize("name", MADE)
def test_every_option_says_what_it_is(name: str) -> None:
    for option, p in inspect.signature(MADE[name]).parameters.items():
        if is_group(p.annotation):
            assert p.annotation.__doc__
            assert p.kind is p.KEYWORD_ONLY
            continue
        (said,) = (m for m in get_args(p.annotation)[1:] if isinstance(m, Parameter) and m.help)
        assert said.help is not None, option
        assert "`" not in said.help, option
        assert said.help.strip().endswith("."), option


@pytest.mark.parametrize("name", sorted(MADE.keys() - {"simulate"}))
def test_what_a_verb_returns_is_one_dict_for_programs(name: str) -> None:
    returned = inspect.signature(MADE[name].verb.function).return_annotation
    assert all(hasattr(result, "to_dict") for result in get_args(returned) or (returned,))


def test_the_verbs_of_python_are_commands() -> None:
    public = {n for n in vars(import_module("thermocomp"))["_PUBLIC"] if n.islower() and n in COMMANDS}
    assert public - MADE.keys() == {"revise"}  # see below
    for name in public & MADE.keys():
        assert MADE[name].verb.function is getattr(tc, name)


def test_a_command_without_a_verb_is_named_here() -> None:
    own = {name for name, entry in COMMANDS.items() if entry.value.startswith("thermocomp.")}
    assert own - MADE.keys() == WITHOUT | {"revise"}


def test_marks_of_a_docstring_are_no_part_of_the_help() -> None:
    assert plain("see :doc:`/methods`, ``ols`` and `thermocomp.core`") == "see methods, ols and thermocomp.core"


def test_options_of_the_verb_that_is_not_asked_for_are_refused(tmp_path: Path) -> None:
    with pytest.raises(tc.ThermocompError, match="writes no file"):
        MADE["plan"]([tmp_path / "a.csv"], running=True, output=tmp_path / "b.ngc")


def test_revise_has_the_same_options_in_python_and_on_a_line() -> None:
    """Both take the same groups; in Python their fields are keywords."""
    line, verb = (inspect.signature(f).parameters for f in (COMMANDS["revise"].load(), tc.revise))
    groups = {n: p.annotation for n, p in line.items() if is_group(p.annotation)}
    assert tuple(groups.values()) == GROUPS
    asked = {f.name for group in GROUPS for f in fields(group)}
    # the models are the one keyword of a group that Python names
    assert verb.keys() - {"words", "model"} == line.keys() - groups.keys() - {"json"}
    assert "model" in asked
    for name in ("overwrite", "date"):
        assert verb[name].default == line[name].default


def test_rooms_do_not_hide_the_verbs_of_their_names() -> None:
    for name in ("export", "iso230", "volumetric"):
        import_module(f"thermocomp.{name}.verbs")
        assert inspect.isfunction(getattr(tc, name))
