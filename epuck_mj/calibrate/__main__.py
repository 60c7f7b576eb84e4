"""Calibrate a robot: `python -m epuck_mj.calibrate --port PORT`, or `... fit LOG`."""

import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from epuck_mj.bridge.failures import (
    DONE,
    FAILED,
    RUNAWAY,
    STOPPED,
    BridgeError,
    StillMoving,
    told,
    told_of_runaway,
)
from epuck_mj.bridge.line.connect import connect
from epuck_mj.bridge.line.interfaces import Connection
from epuck_mj.bridge.line.last_resort import leave_to_last_resort
from epuck_mj.calibrate.bench import Bench
from epuck_mj.calibrate.fit_command import fit
from epuck_mj.calibrate.guide import STEPS, Person
from epuck_mj.errors import UserError
from epuck_mj.host.command_line import main, parse, word
from epuck_mj.host.files import check_writable, is_file
from epuck_mj.host.interruption import Interrupted, Interruption
from epuck_mj.host.output import Output, complain, say
from epuck_mj.step.calibration import Calibration

MODULE = "epuck_mj.calibrate"
FIT = "fit"
"""First word of the command line that fits a robot to a log."""


EXAMPLES = (
    "python -m epuck_mj.calibrate --port /dev/rfcomm0",
    "python -m epuck_mj.calibrate --port COM5 --only sensors --output robot.yaml",
    "python -m epuck_mj.calibrate fit runs/drive.npz",
)


@dataclass(frozen=True)
class Options:
    """Measure how a robot differs from the nominal robot, step by step.

    You need a ruler, a protractor, a flat wall and spacers of 10, 20 and 30 mm; or none
    of them and the log of a drive: see python -m epuck_mj.calibrate fit --help.

    Attributes:
        port: port of the robot, as for the bridge.
        output: file to write; values in it that are not measured now stay the same.
        only: do only this step; otherwise all: straight, turn and sensors.
        verbose: add technical details to messages.
    """

    port: Annotated[str, word("PORT")] = ""
    output: Annotated[Path, word("FILE")] = Path("robot.yaml")
    only: Annotated[Literal["straight", "turn", "sensors"] | None, word("STEP")] = None
    verbose: bool = False


def answer(question: str) -> str:
    """What standard input says to a question.

    Raises:
        EOFError: if it has ended, or there is none.
        OutputLost: if the question cannot be printed.
    """
    say(question, end="")
    # without `input`, which needs standard error, too
    line = sys.stdin.buffer.readline(ANSWER_MAX) if sys.stdin else b""
    if not line:
        raise EOFError
    return line.decode(errors="replace").strip()


ANSWER_MAX = 1000
"""Most bytes of an answer; what is behind them is the next one."""


def calibrate(argv: Sequence[str], ask: Callable[[str], str] = answer) -> int:
    """Run the command line and return its exit status.

    Args:
        argv: what was typed.
        ask: shows a question and gives the answer.
    """
    if argv[:1] == [FIT]:
        return fit(argv[1:])
    options = parse(Options, f"python -m {MODULE}", argv, examples=EXAMPLES)
    if not options.port:
        raise UserError(
            "expected --port, as for python -m epuck_mj.bridge, or fit and a log"
        )
    steps = tuple(STEPS) if options.only is None else (options.only,)
    status = calibrate_robot(
        steps,
        options.output,
        lambda: connect(options.port),
        ask,
        verbose=options.verbose,
    )
    if status == RUNAWAY:
        leave_to_last_resort(options.port)
    return status


def calibrate_robot(
    steps: Sequence[str],
    output: Path,
    connect: Callable[[], Connection],
    ask: Callable[[str], str],
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
    verbose: bool = False,
) -> int:
    """Calibrate, write the file after each step, and return the exit status.

    Args:
        steps: names of STEPS.
        output: file to write, or to extend.
        connect: opens the way to the robot.
        ask: shows a question and gives the answer.
        clock: what the connection tells times by.
        sleep: waits for a number of seconds.
        verbose: whether messages have details.

    Raises:
        UserError: if something cannot be; the robot stands.
    """
    # the measurements take time: check first that the file can be written
    check_writable(output)
    known = Calibration.load(output) if is_file(output) else Calibration()
    status, word = DONE, ""
    with Interruption() as interruption:
        bench = Bench(connect, interruption, clock, sleep, verbose)
        person = Person(ask, interruption)
        try:
            person.hear("The robot drives. Ctrl-C stops it and ends.")
            # check that the robot answers before the user prepares the floor
            bench.with_robot(known, lambda robot: None)
            for step in steps:
                known = STEPS[step](bench, person, known)
                known.save(output)
                person.hear(f"written: {output}")
        except Interrupted:
            pass
        except StillMoving as error:
            status, word = RUNAWAY, f"error: {told_of_runaway(error, verbose)}"
        except BridgeError as error:
            status, word = FAILED, f"error: {told(error, verbose, STOPPED)}"
        if interruption.signum is not None and status != RUNAWAY:
            status = interruption.status
            word = f"{interruption.signum.name}: ended, the robot stands still"
        if word:
            # the cursor may be behind an unanswered question
            with Output(sys.stdout) as line:
                line.say("")
            complain(word)
    return status


if __name__ == "__main__":
    main(calibrate)
