"""docs/lesson.md: its commands run in their order, and its first table is theirs."""

import re
import runpy
import sys
from pathlib import Path

import pytest

from tests.no_pictures import draw_nothing
from tests.processes import PATIENCE, forget, python_process
from tests.test_fake import fake_process

PAGE = (Path(__file__).resolve().parent.parent / "docs" / "lesson.md").read_text()
BLOCKS = re.findall(r"^```\n(.*?)^```", PAGE, re.M | re.S)
COMMANDS = [line for block in BLOCKS for line in block.splitlines()]
BRIDGE = "python -m epuck_mj.bridge"

NO_ANSWER = 3
"""Exit status of a bridge whose robot did not answer in time."""


def quickly(command: str) -> str:
    """The command with few starts on wheels and, but for the first run, few trials."""
    command = re.sub(r"--(validation|test)-starts \d+", r"--\1-starts 2", command)
    command = re.sub(r"--seconds \d+", "--seconds 1", command)
    if re.search(r"--robot epuck( |$)", command):
        command = re.sub(r"--starts \d+", "--starts 2", command)
    if "evolution.run" in command and "runs/lesson" not in command:
        command += " --evaluations 150 --trials 1 --steps 20"
    return command


def in_here(command: str, monkeypatch) -> int:
    """Exit status of a command in this process."""
    python, _, *argv = command.split()
    assert python == "python"
    forget(monkeypatch, argv[0])
    monkeypatch.setattr(sys, "argv", argv)
    with pytest.raises(SystemExit) as end:
        runpy.run_module(argv[0], run_name="__main__", alter_sys=True)
    return int(end.value.code or 0)


def bridged(command: str, monkeypatch, capsys) -> tuple[int, str, str]:
    """Exit status of a drive, and what it says; in its own process if it also draws."""
    if "--log" not in command:
        return in_here(command, monkeypatch), *capsys.readouterr()
    with python_process("-W", "error", *command.split()[1:]) as process:
        out, error = process.communicate(timeout=PATIENCE)
    return process.returncode, out, error


@pytest.mark.slow
def test_the_lesson(alone, monkeypatch, capsys, handlers):
    draw_nothing(monkeypatch)
    for command in COMMANDS:
        if command.startswith(BRIDGE):
            continue
        assert in_here(quickly(command), monkeypatch) == 0, command
    tested = r"generation (\d+), .*\n.* mean (\S+) .*\n +crashes: (\d+)\.0%"
    found = re.findall(tested, capsys.readouterr().out)
    table = PAGE.split("<!-- generations -->")[1].split("<!-- end")[0]
    assert re.findall(r"^\| (\d+) \| (\S+) \| (\d+) %", table, re.M) == found
    assert len(found) == 4

    # the champions of these runs drive emulated robots
    emulated, *drives = [each for each in COMMANDS if each.startswith(BRIDGE)]
    arguments = emulated.replace("--tcp 5000", "--tcp 0").split()[3:]
    assert len(drives) == 4
    with fake_process(*arguments) as (_, port):
        for command in drives:
            told = re.sub(r"--port \S+", f"--port {port}", quickly(command))
            status, out, error = bridged(told, monkeypatch, capsys)
            # on a busy machine an emulated robot may answer late
            if status == NO_ANSWER:
                status, out, error = bridged(told, monkeypatch, capsys)
            assert (status, error) == (0, ""), command
            assert "--list-ports" in command or "ended" in out
    assert Path("runs/drive.png").stat().st_size > 1000
