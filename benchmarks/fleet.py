"""A class of robots in real time: `make fleet`.

Ten emulated robots, all in this process, are driven at once by one bridge on a
terminal. After a minute, one key stops all. Wants an idle machine.
"""

import json
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.figures import write_figures
from epuck_mj.host.command_line import main, parse
from epuck_mj.scene.model import load_scene
from epuck_mj.scene.model_files import KINEMATIC_ROBOT
from tests.fleets import Terminal, all_move, robots, slowest_stop, wait_for

ENDS = re.compile(r"robot-\d+: (\d+) control steps, (\d+) too long")


@dataclass(frozen=True)
class Options:
    """Measure a fleet.

    Attributes:
        json: file for the figures.
        seconds: how long the robots drive.
        robots: number of robots.
    """

    json: Path | None = None
    seconds: float = 60.0
    robots: int = 10


def measure_fleet(argv: Sequence[str]) -> int:
    """Run the command line; its exit status."""
    options = parse(Options, "python -m benchmarks.fleet", argv, Options())
    scene = load_scene(KINEMATIC_ROBOT, "arena")
    terminal = Terminal()
    with (
        tempfile.TemporaryDirectory() as folder,
        robots(scene, Path(folder), *[""] * options.robots) as there,
    ):
        ports = [part for port in there for part in ("--port", port)]
        bridge = subprocess.Popen(
            [
                *(sys.executable, "-m", "epuck_mj.bridge", "wall-follower", *ports),
                *("--log", f"{folder}/log", "--seconds", "600"),
            ],
            stdin=terminal.slave,
            stdout=terminal.slave,
        )
        try:
            answered = f"All {options.robots} robots answer"
            wait_for(lambda: answered in terminal.shown, "all answered")
            terminal.press(b"\n")
            wait_for(lambda: all_move(there), "all drove")
            time.sleep(options.seconds)
            terminal.press(b"q")
            stopped = slowest_stop(there)
            bridge.wait(timeout=60)
        finally:
            bridge.kill()
            terminal.close()
    drives = [(int(steps), int(late)) for steps, late in ENDS.findall(terminal.shown)]
    found = {
        "robots": len(drives),
        "control_steps": sum(steps for steps, _ in drives),
        "overruns": sum(late for _, late in drives),
        "seconds_from_the_key_to_the_last_stop": round(stopped, 3),
    }
    print(json.dumps(found, indent=1))
    write_figures(options.json, found)
    return 0


if __name__ == "__main__":
    main(measure_fleet)
