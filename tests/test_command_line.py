"""What all command lines share: help with words and examples, mistakes answered."""

import sys

import pytest

from epuck_mj.__main__ import COMMANDS as ROBOT_COMMANDS
from epuck_mj.__main__ import listing
from epuck_mj.errors import UserError
from evolution.__main__ import COMMANDS, script
from evolution.export import export
from evolution.run.__main__ import evolve
from tests.processes import forget

ALL = COMMANDS | ROBOT_COMMANDS


@pytest.mark.parametrize("module", ALL)
def test_help_ends_with_examples_in_words(module, capsys, monkeypatch, handlers):
    forget(monkeypatch, module)
    monkeypatch.setattr(sys, "argv", ["epuck-mj", module.rpartition(".")[2], "--help"])
    with pytest.raises(SystemExit) as end:
        script()
    assert not end.value.code
    text = capsys.readouterr().out
    assert f"python -m {module}" in text
    examples = text.partition("examples:\n")[2].splitlines()
    assert len(examples) >= 2
    assert all(line.startswith(f"  python -m {module}") for line in examples)
    # the optimisers' own parameters have words for their values only as text
    text = text.replace("--strategy STR", "").replace("--bounds-rule STR", "")
    for raw in ("PATH", "STR", "{None}", "[["):
        assert raw not in text, raw


def test_the_commands_are_listed(capsys, monkeypatch, handlers):
    monkeypatch.setattr(sys, "argv", ["epuck-mj"])
    with pytest.raises(SystemExit) as end:
        script()
    assert not end.value.code
    text = capsys.readouterr().out
    assert listing(ALL) in text
    assert all(text.count(f"python -m {module} ") == 1 for module in ALL)


def test_an_unknown_command_is_one_line(capsys, monkeypatch, handlers):
    monkeypatch.setattr(sys, "argv", ["epuck-mj", "evolve"])
    with pytest.raises(SystemExit) as end:
        script()
    assert end.value.code == 2
    error = capsys.readouterr().err
    assert error.startswith("error: no command 'evolve'; available: run, replay, ")
    assert error.count("\n") == 1


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        ("--popultion 20", "unknown option --popultion 20; did you mean --population?"),
        ("--strategy rand", "unknown option --strategy rand; see python -m evolution"),
        ("ga", "expected an option, got 'ga'; see python -m evolution"),
        ("--seed abc", "--seed: expected a whole number, got 'abc'"),
        ("--control-step x", "--control-step: expected a number, got 'x'"),
        ("--hidden 0", "hidden: expected a whole number from 1 to 1,000, got 0"),
        ("--v-max 0", "v_max: expected a number above 0, at most 0.13 m/s (sp"),
        (
            "--hidden 0 --v-max 0",
            "v_max: expected a number above 0, at most 0.13 m/s (sp",
        ),
        (
            "--test-starts 1",
            "test_starts: expected a whole number from 2 to 100,000, got",
        ),
    ],
)
def test_a_mistake_is_answered_with_what_to_do(flags, message):
    with pytest.raises(UserError) as caught:
        evolve(["ga", *flags.split(), "--print-config"])
    assert str(caught.value).startswith(message)


@pytest.mark.parametrize(
    ("arguments", "names"), [([], "RUN, FILE"), (["runs/ga-seed-1"], "FILE")]
)
def test_what_is_missing_is_named(arguments, names):
    with pytest.raises(UserError) as caught:
        export(arguments)
    expected = f"expected {names}, got none; see python -m evolution.export --help"
    assert str(caught.value) == expected
